"""The clause lists, and how a run of the tests reports on them."""

import shutil
from pathlib import Path

import pytest

from tests.clauses import read_clauses

pytest_plugins = ["pytester"]

LIST = """
[clauses]
X-A-1 = { state = "tested", title = "first" }
X-A-2 = { state = "tested", title = "second" }
X-A-3 = { state = "open", title = "third", reason = "cannot be seen" }
"""

BOTH = """
import pytest
@pytest.mark.spec("X-A-1", "X-A-2")
def test_both(): pass
"""


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    """A small suite of its own, with this project's plug-in and one list of clauses."""
    here = Path(__file__).parents[1]
    tests = pytester.mkpydir("tests")
    names = ("conftest", "clauses", "costs", "left_out", "repeat", "waiting")
    for name in names:
        shutil.copy(here / f"{name}.py", tests / f"{name}.py")
    (tests / "conformance" / "x").mkdir(parents=True)
    (tests / "conformance" / "x" / "clauses.toml").write_text(LIST)
    pytester.makeini(
        "[pytest]\ntestpaths = tests\npythonpath = .\nmarkers = spec(*clauses): clauses\n"
        "addopts = -p no:cacheprovider\n"
    )
    return pytester


def write(suite: pytest.Pytester, text: str) -> None:
    (suite.path / "tests" / "test_x.py").write_text(text)


def test_a_run_in_which_every_clause_has_a_test_passes_and_lists_the_open_ones(
    suite: pytest.Pytester,
) -> None:
    write(suite, BOTH)

    result = suite.runpytest_subprocess()

    assert result.ret == 0
    result.stdout.fnmatch_lines(
        ["X-A-3: open, third: cannot be seen", "2 of 3 clauses tested, 1 open"]
    )


def test_a_clause_without_a_test_is_named_and_fails_the_run(suite: pytest.Pytester) -> None:
    write(suite, BOTH.replace(', "X-A-2"', ""))

    result = suite.runpytest_subprocess()

    assert result.ret == 1
    result.stdout.fnmatch_lines(["X-A-2: no test (second)", "1 of 3 clauses tested, 1 open"])


@pytest.mark.parametrize("choice", [["-k", "both"], ["tests/test_x.py"]])
def test_a_run_of_part_of_the_tests_does_not_ask_for_all_clauses(
    suite: pytest.Pytester, choice: list[str]
) -> None:
    write(suite, BOTH.replace(', "X-A-2"', ""))

    result = suite.runpytest_subprocess(*choice)

    assert result.ret == 0
    result.stdout.no_fnmatch_line("*X-A-2*")


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("X-A-9", "X-A-9: a test names it, no list has it"),
        ("X-A-3", "X-A-3: listed as open, but a test names it"),
    ],
)
def test_a_marker_that_does_not_fit_the_list_fails_any_run(
    suite: pytest.Pytester, name: str, complaint: str
) -> None:
    write(suite, BOTH.replace("X-A-2", name))

    result = suite.runpytest_subprocess("tests/test_x.py")

    assert result.ret == 1
    result.stdout.fnmatch_lines([complaint])


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ('Y-1 = { state = "done", title = "t" }', "x/clauses.toml: Y-1 needs a title and state"),
        ('Y-1 = { state = "tested" }', "x/clauses.toml: Y-1 needs a title"),
        ('Y-1 = { state = "open", title = "t" }', "x/clauses.toml: Y-1: a reason belongs to an"),
        (
            'Y-1 = { state = "tested", title = "t", reason = "r" }',
            "x/clauses.toml: Y-1: a reason belongs to an open clause, and only to one",
        ),
    ],
)
def test_an_incomplete_row_is_refused(tmp_path: Path, row: str, complaint: str) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "clauses.toml").write_text(f"[clauses]\n{row}\n")

    with pytest.raises(ValueError, match=complaint):
        read_clauses(tmp_path)


def test_a_clause_in_two_lists_is_refused(tmp_path: Path) -> None:
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "clauses.toml").write_text(LIST)

    with pytest.raises(ValueError, match=r"y/clauses\.toml: X-A-1 stands in two lists"):
        read_clauses(tmp_path)
