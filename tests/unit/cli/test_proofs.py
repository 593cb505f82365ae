"""The lists of tests that prove the clauses."""

from pathlib import Path

import pytest

from contrib.generate import proofs
from vbus.chips.clauses import proofs_of
from vbus.cli.generate.layout import stale

MARKS = """
import pytest
KEPT = pytest.mark.spec("X-A-2", "X-A-3")
@pytest.mark.spec("X-A-1")
@KEPT
def test_function(): pass
@pytest.mark.parametrize(
    "row",
    [1, pytest.param(2, id="two", marks=KEPT), pytest.param(3, marks=pytest.mark.spec("X-A-4"))],
)
def test_rows(row): pass
@pytest.mark.spec("X-A-5")
class TestClass: pass
@KEPT
def helper(): pass
"""


@pytest.fixture
def of_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return what is found in a test file of this text."""

    def found(name: str, text: str) -> list[tuple[str, str]]:
        (tmp_path / name).write_text(text)
        monkeypatch.setattr(proofs, "ROOT", tmp_path)
        monkeypatch.syspath_prepend(tmp_path)
        return list(proofs._of_file(tmp_path / name))

    return found


def test_marks_are_found_however_they_are_made(of_file) -> None:
    assert of_file("test_marks_found.py", MARKS) == [
        ("X-A-2", "test_marks_found.py::test_function"),
        ("X-A-3", "test_marks_found.py::test_function"),
        ("X-A-1", "test_marks_found.py::test_function"),
        ("X-A-2", "test_marks_found.py::test_rows[two]"),
        ("X-A-3", "test_marks_found.py::test_rows[two]"),
        ("X-A-4", "test_marks_found.py::test_rows"),
        ("X-A-5", "test_marks_found.py::TestClass"),
    ]


def test_a_mark_of_the_file_is_one_of_each_of_its_tests(of_file) -> None:
    text = "import pytest\npytestmark = pytest.mark.spec('X-A-1')\ndef test_it(): pass\n"
    assert of_file("test_marks_of_all.py", text) == [("X-A-1", "test_marks_of_all.py::test_it")]


def test_the_lists_are_up_to_date() -> None:
    assert stale(proofs.targets()) == [], 'run "python -m contrib.generate proofs"'


def test_a_row_of_an_ac_table_is_proved_by_its_own_cases() -> None:
    tests = proofs_of("vbus.chips.lm628")["LM-TIM-5"]
    assert [test.rpartition("[")[2] for test in tests if "test_ac_rows" in test] == [
        "T5 -8]", "T5 -6]", "T5 longest]",
    ]  # fmt: skip
