"""The clause lists, and how a run of the tests reports on them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.clauses import read_clauses
from vbus.chips.clauses import MANUAL, Clause, clauses_of, proofs_of

pytest_plugins = ["pytester"]

LIST = """
[X-A-1]
title = "first"
section = "Table 1"
kind = "manual"
state = "tested"
text = '''
A thing.

1. And its
   parts.
'''
[X-A-2]
title = "second"
state = "tested"
[X-A-3]
title = "third"
state = "open"
reason = "cannot be seen"
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
    chip = pytester.path / "vbus" / "chips" / "x"
    chip.mkdir(parents=True)
    (chip / "clauses.toml").write_text(LIST)
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
        ('state = "done"\ntitle = "t"', 'Y-1: state is "tested" or "open"'),
        ('state = "tested"', "Y-1 needs title"),
        ('title = "t"', "Y-1 needs state"),
        ('state = "tested"\ntitle = " "', "Y-1: title is not one of title, state, section, kind"),
        (
            'state = "tested"\ntitle = "t"\nwhy = "w"',
            "Y-1: why is not one of title, state, section",
        ),
        (
            'state = "tested"\ntitle = "t"\nkind = "guess"',
            "Y-1: kind is one of manual, ruling, silicon",
        ),
        ('state = "open"\ntitle = "t"', "Y-1: a reason belongs to an open clause"),
        (
            'state = "tested"\ntitle = "t"\nreason = "r"',
            "Y-1: a reason belongs to an open clause, and only to one",
        ),
    ],
)
def test_an_incomplete_clause_is_refused(tmp_path: Path, row: str, complaint: str) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "clauses.toml").write_text(f"[Y-1]\n{row}\n")

    with pytest.raises(ValueError, match=rf"^x/clauses\.toml: {complaint}"):
        read_clauses(tmp_path)


def test_what_is_no_clause_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "clauses.toml").write_text('title = "t"\n')

    with pytest.raises(ValueError, match=r"^x/clauses\.toml: title is no table$"):
        read_clauses(tmp_path)


def test_a_clause_is_read_with_all_it_says(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "clauses.toml").write_text(LIST)

    first, second, third = read_clauses(tmp_path).values()
    assert first == Clause(
        "X-A-1", "first", "Table 1", MANUAL, "A thing.\n\n1. And its\n   parts.", "tested", ""
    )
    assert (second.tested, second.text) == (True, "")
    assert (third.tested, third.reason) == (False, "cannot be seen")


def test_a_clause_in_two_lists_is_refused(tmp_path: Path) -> None:
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "clauses.toml").write_text(LIST)

    with pytest.raises(ValueError, match=r"y/clauses\.toml: X-A-1 stands in two lists"):
        read_clauses(tmp_path)


# -- the lists of the chips -----------------------------------------------------------------------

PACKAGES = ("vbus.chips.lm628", "vbus.chips.mcp1200")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_clause_of_a_chip_says_what_is_required_and_where_the_manual_says_it(
    package: str,
) -> None:
    clauses = clauses_of(package)
    assert len(clauses) > 100
    for clause in clauses.values():
        assert clause.section, clause
        assert clause.kind, clause
        assert clause.text.endswith((".", ".|")), clause


@pytest.mark.parametrize("package", PACKAGES)
def test_every_clause_that_is_tested_names_its_tests(package: str) -> None:
    tested = [clause.name for clause in clauses_of(package).values() if clause.tested]
    assert list(proofs_of(package)) == tested


def test_a_package_without_lists_has_no_clauses() -> None:
    assert clauses_of("vbus.chips.motion") == proofs_of("vbus.chips.motion") == {}


OPENED = """
import sys
opened = []
def hook(event, arguments):
    if event == "open" and str(arguments[0]).endswith(".toml"):
        opened.append(arguments[0])
sys.addaudithook(hook)
{code}
assert not opened, opened
assert "vbus.chips.clauses" not in sys.modules
"""


@pytest.mark.parametrize(
    "code",
    [
        "import vbus.client.lm628, vbus.client.mc1241a, vbus.client.mcp1200, vbus.client.aio",
        "from vbus.tools.cli import cli; cli.main(['--version'], standalone_mode=False)",
        "from vbus.board import plugins; plugins.chip_classes()",
    ],
)
def test_clauses_are_read_by_nobody_who_does_not_ask(code: str) -> None:
    subprocess.run([sys.executable, "-c", OPENED.format(code=code)], check=True)
