"""The clause lists, and how a run of the tests reports on them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.clauses import read_clauses
from vbus.chips.clauses import MANUAL, RULING, SILICON, Clause, clauses_of, proofs_of

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
section = "Table 2"
kind = "ruling"
text = "Another thing."
state = "tested"
[X-A-3]
title = "third"
section = "Figure 3"
kind = "silicon"
evidence = "a log"
text = "A third."
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
    names = ("conftest", "clauses", "costs", "left_out", "left_running", "repeat", "waiting")
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


WHOLE = {"title": "t", "section": "s", "kind": "manual", "text": "x.", "state": "tested"}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"state": "done"}, 'state is "tested" or "open"'),
        ({"kind": "guess"}, "kind is one of manual, ruling, silicon"),
        ({"kind": "silicon"}, "what real parts have decided needs evidence"),
        ({"title": " "}, "title is not one of title, section, kind, text, state, evidence, reason"),
        ({"why": "w"}, "why is not one of title, section"),
        ({"state": "open"}, "a reason belongs to an open clause"),
        ({"reason": "r"}, "a reason belongs to an open clause, and only to one"),
    ],
)
def test_a_clause_that_is_not_right_is_refused(
    tmp_path: Path, change: dict[str, str], complaint: str
) -> None:
    complain(tmp_path, WHOLE | change, f": {complaint}")


@pytest.mark.parametrize("key", WHOLE)
def test_a_clause_that_lacks_something_is_refused(tmp_path: Path, key: str) -> None:
    complain(tmp_path, {name: WHOLE[name] for name in WHOLE if name != key}, f" needs {key}$")


def complain(folder: Path, row: dict[str, str], complaint: str) -> None:
    """Check that a list with this row is refused."""
    (folder / "x").mkdir()
    rows = "\n".join(f'{key} = "{value}"' for key, value in row.items())
    (folder / "x" / "clauses.toml").write_text(f"[Y-1]\n{rows}\n")
    with pytest.raises(ValueError, match=rf"^x/clauses\.toml: Y-1{complaint}"):
        read_clauses(folder)


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
    assert (second.tested, second.kind, second.reason) == (True, RULING, "")
    assert (third.tested, third.kind, third.reason) == (False, SILICON, "cannot be seen")


def test_a_clause_in_two_lists_is_refused(tmp_path: Path) -> None:
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "clauses.toml").write_text(LIST)

    with pytest.raises(ValueError, match=r"y/clauses\.toml: X-A-1 stands in two lists"):
        read_clauses(tmp_path)


# -- the lists of the chips -----------------------------------------------------------------------

PACKAGES = ("vbus.chips.lm628", "vbus.chips.mc1241a", "vbus.chips.mcp1200")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_text_is_whole_sentences(package: str) -> None:
    clauses = clauses_of(package)
    assert len(clauses) > 100
    for clause in clauses.values():
        assert clause.text.endswith("."), clause


@pytest.mark.parametrize("package", PACKAGES)
def test_every_clause_that_is_tested_names_its_tests(package: str) -> None:
    tested = [clause.name for clause in clauses_of(package).values() if clause.tested]
    assert list(proofs_of(package)) == tested


def test_a_package_of_somebody_else_brings_its_own_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "acme_clauses"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "clauses.toml").write_text(LIST)
    (package / "proofs.toml").write_text('X-A-1 = ["tests/test_acme.py::test_it"]\n')
    monkeypatch.syspath_prepend(tmp_path)

    assert list(clauses_of("acme_clauses")) == ["X-A-1", "X-A-2", "X-A-3"]
    assert proofs_of("acme_clauses") == {"X-A-1": ["tests/test_acme.py::test_it"]}


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
        "from vbus.cli.cli import cli; cli.main(['--version'], standalone_mode=False)",
        "from vbus import plugins; plugins.chip_classes()",
    ],
)
def test_clauses_are_read_by_nobody_who_does_not_ask(code: str) -> None:
    subprocess.run([sys.executable, "-c", OPENED.format(code=code)], check=True)
