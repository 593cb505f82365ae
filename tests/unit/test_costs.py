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
    for folder, spent in (("slow", 0.3), ("quick", 0.0)):
        (pytester.path / "tests" / folder).mkdir()
        (pytester.path / "tests" / folder / f"test_{folder}.py").write_text(
            f"import time\ndef test_a(): time.sleep({spent})\ndef test_b(): pass\n"
        )
    pytester.makeini("[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\n")

    lines = pytester.runpytest_subprocess(*workers).outlines
    told = [re.fullmatch(r" *(\d+\.\d) +(\d+) tests  (.*)", line) for line in lines]
    rows = [(row[2], row[3]) for row in told if row]
    assert rows == [("2", "tests/slow"), ("2", "tests/quick"), ("4", "in all")]
