"""What a run has cost is told by folder."""

import re
import shutil
from pathlib import Path

import pytest

from tests.costs import folder_of

pytest_plugins = ["pytester"]


@pytest.mark.parametrize(
    ("nodeid", "folder"),
    [
        ("tests/e2e/test_a.py::test_b[c/d]", "tests/e2e"),
        ("tests/unit/board/test_a.py::test_b", "tests/unit/board"),
        ("tests/unit/test_a.py::test_b", "tests/unit"),
        ("tests/test_a.py::test_b", "tests"),
        ("test_a.py::test_b", "."),
    ],
)
def test_a_test_counts_under_its_folder(nodeid: str, folder: str) -> None:
    assert folder_of(nodeid) == folder


@pytest.mark.parametrize("workers", [(), ("-n", "1")], ids=["alone", "workers"])
def test_a_run_tells_what_its_folders_cost(
    pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    shutil.copy(Path(__file__).parents[1] / "costs.py", pytester.mkpydir("tests"))
    (pytester.path / "conftest.py").write_text('pytest_plugins = ["tests.costs"]\n')
    works = "subprocess.run([sys.executable, '-c', 'while time.process_time() < 0.3: pass'])"
    for folder, does in (("busy", works.replace("'while", "'import time\\nwhile")), ("quick", "0")):
        (pytester.path / "tests" / folder).mkdir()
        (pytester.path / "tests" / folder / f"test_{folder}.py").write_text(
            f"import subprocess, sys\ndef test_a(): {does}\ndef test_b(): pass\n"
        )
    pytester.makeini("[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\n")

    lines = pytester.runpytest_subprocess(*workers).outlines
    told = [re.fullmatch(r" *(\d+\.\d) +\d+\.\d +(\d+) tests  (.*)", line) for line in lines]
    rows = [row.groups() for row in told if row]
    assert [row[1:] for row in rows] == [("2", "tests/busy"), ("2", "tests/quick"), ("4", "in all")]
    assert float(rows[0][0]) >= 0.3  # of the process that the test has started
