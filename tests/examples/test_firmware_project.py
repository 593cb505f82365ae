"""The example firmware project: its own tests pass, and notice when the firmware is wrong."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES
from tests.left_out import require
from tests.schemas import mistakes
from vbus.board.config import read_board_file

PROJECT = EXAMPLES / "firmware_project"
PYTEST = re.compile(r"^ +pytest (.*\n(?: +--.*\n)+)", re.MULTILINE)


def run_suite(project: Path, *options: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n2", "-p", "no:cacheprovider", "tests", *options],
        cwd=project,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    return done.stdout


@pytest.mark.parametrize(
    ("right", "wrong", "fails"),
    [
        # LPEI tells of a position error and lets the motor go on; LPES stops it.
        ("LPES 0x1A", "LPES 0x1B", "test_stall_is_reported"),
        ("status != 0x84 &&", "0 &&", "test_a_chip_that_fails_its_reset_is_refused"),
        ("(uint8_t)(value >> 8)", "(uint8_t)value", "test_a_move_ends_where_it_should"),
    ],
)
def test_its_tests_find_what_is_wrong_with_the_firmware(
    right: str, wrong: str, fails: str, tmp_path: Path
) -> None:
    """That all of them pass as it is, and what its first draft fails, its page's commands show."""
    require("cc")
    project = tmp_path / "project"
    shutil.copytree(PROJECT, project)
    source = project / "src" / "axis.c"
    assert source.read_text().count(right) == 1
    source.write_text(source.read_text().replace(right, wrong))
    printed = run_suite(project, "-k", fails)
    assert f"FAILED tests/test_axis.py::{fails}" in printed, printed


@pytest.mark.parametrize(
    ("schema", "file"),
    [("vendor.github-workflows", "github-actions.yml"), ("vendor.gitlab-ci", "gitlab-ci.yml")],
)
def test_a_recipe_for_a_server_is_what_the_server_reads(schema: str, file: str) -> None:
    assert mistakes(schema, PROJECT / "ci" / file) == ""


def test_what_the_recipes_run_passes_and_leaves_its_artifacts(tmp_path: Path) -> None:
    require("cc")
    lines = {
        tuple(option for option in line.split() if option not in ("-n", "auto", "--vbus-github"))
        for file in ("github-actions.yml", "gitlab-ci.yml")
        for line in PYTEST.findall((PROJECT / "ci" / file).read_text())
    }
    (options,) = lines
    project = tmp_path / "project"
    shutil.copytree(PROJECT, project)
    printed = run_suite(project, *options, "-k", "move_ends")
    assert "2 passed" in printed
    assert "wanted" not in printed
    found = {path.name for path in (project / "evidence").iterdir()}
    assert {"coverage.html", "coverage.xml", "report.xml"} <= found
    percent = re.search(r"^lm628: \d+ of \d+ exercised, (\d+)\.\d%", printed, re.MULTILINE)
    assert percent is not None
    assert int(percent[1]) >= 30


def test_recipes_for_other_frameworks_take_what_vbus_has() -> None:
    files = sorted((PROJECT / "recipes").rglob("*.py"))
    assert [file.parent.name for file in files] == ["labgrid", "pytest_embedded"]
    for file in files:
        functions = [
            one for one in ast.parse(file.read_text()).body if isinstance(one, ast.FunctionDef)
        ]
        assert "vbus_pty" in {one.arg for function in functions for one in function.args.args}
    board, _ = read_board_file(PROJECT / "recipes" / "console.toml")
    assert board.hosts[0].protocol == "terminal"
