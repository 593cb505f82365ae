"""Makes the lists of tests that prove the clauses, from the marks the tests carry."""

import importlib
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import click
import pytest

from vbus.chips.clauses import PROOFS, clauses_of
from vbus.cli.generate.layout import ROOT, folder_of, own_families


def targets() -> list[tuple[str, Callable[[], str]]]:
    """Return the list of every chip family."""
    return [
        (str((folder_of(family) / PROOFS).relative_to(ROOT)), partial(_list, family.home))
        for family in own_families()
    ]


def _list(package: str) -> str:
    lines = [
        "# The tests of each clause. Made by contrib.generate from their marks,",
        '# @pytest.mark.spec("ID"): change those.',
        "",
    ]
    for name in clauses_of(package):
        if tests := _proofs().get(name):
            lines += [f"{name} = [", *(f'    "{test}",' for test in tests), "]"]
    return "\n".join(lines) + "\n"


@cache
def _proofs() -> dict[str, list[str]]:
    """Return the tests of every clause that a test names."""
    # Tests import each other as tests.*, wherever this is run from.
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for name, test in _of_file(path):
            tests = found.setdefault(name, [])
            # A test may carry a clause on itself and on its class.
            if test not in tests:
                tests.append(test)
    return found


def _of_file(path: Path) -> Iterator[tuple[str, str]]:
    """Give the clauses that tests of a file name, each with the test.

    The file is imported: marks are made by functions, kept in variables, and hung on parameters.
    """
    place = path.relative_to(ROOT)
    try:
        module = importlib.import_module(".".join(place.with_suffix("").parts))
    except pytest.skip.Exception as skipped:
        # Without the file the list would lack its tests, and be wrong in silence.
        raise click.ClickException(
            f"{place}: its marks cannot be read: {skipped.msg}; pip install -e '.[test]' gets all"
            " that tests want"
        ) from None
    for_all = [*_clauses(_marks(module))]
    for name, test in vars(module).items():
        if name.startswith(("test_", "Test")) and callable(test):
            where = f"{place.as_posix()}::{name}"
            marks = _marks(test)
            yield from ((clause, where) for clause in (*for_all, *_clauses(marks)))
            for mark in marks:
                if mark.name == "parametrize":
                    yield from _of_parameters(mark.args[1], where)


def _of_parameters(values: Iterable[Any], where: str) -> Iterator[tuple[str, str]]:
    """Give the clauses that some of a test's parameters name, with their ids."""
    for value in values:
        for clause in _clauses(getattr(value, "marks", ())):
            yield clause, f"{where}[{value.id}]" if value.id else where


def _marks(thing: Any) -> list[Any]:
    marks = getattr(thing, "pytestmark", [])
    return [getattr(mark, "mark", mark) for mark in (marks if isinstance(marks, list) else [marks])]


def _clauses(marks: Iterable[Any]) -> Iterator[str]:
    for mark in marks:
        if mark.name == "spec":
            yield from mark.args
