"""The example firmware project: its own tests pass, and notice when the firmware is wrong."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES, require


def run_suite(project: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n2", "-p", "no:cacheprovider", "tests"],
        cwd=project,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=100,
    )
    return done.stdout


@pytest.mark.parametrize(
    ("right", "wrong", "fails"),
    [
        ("", "", []),
        # LPEI tells of a position error and lets the motor go on; LPES stops it.
        ("LPES 0x1A", "LPES 0x1B", ["test_stall_is_reported"]),
        ("status != 0x84 &&", "0 &&", ["test_a_chip_that_fails_its_reset_is_refused"]),
        ("(uint8_t)(value >> 8)", "(uint8_t)value", ["test_a_move_ends_where_it_should"]),
    ],
)
def test_its_tests_find_what_is_wrong_with_the_firmware(
    right: str, wrong: str, fails: list[str], tmp_path: Path
) -> None:
    require("cc")
    project = tmp_path / "project"
    shutil.copytree(EXAMPLES / "firmware_project", project)
    source = project / "src" / "axis.c"
    if right:
        assert source.read_text().count(right) == 1
        source.write_text(source.read_text().replace(right, wrong))
    printed = run_suite(project)
    assert "6 passed" in printed or fails, printed
    assert (" failed" in printed) == bool(fails), printed
    for name in fails:
        assert f"FAILED tests/test_axis.py::{name}" in printed
