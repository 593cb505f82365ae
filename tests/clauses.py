"""Which clauses of the chips' specifications have a test.

Each chip's list is ``tests/conformance/<chip>/clauses.toml``: a table ``[clauses]`` with one row
per clause, ``ID = { state = "tested", title = "..." }`` or
``ID = { state = "open", title = "...", reason = "..." }``. A test names the clauses it would fail
without: ``@pytest.mark.spec("LM-BUS-7", "LM-BUS-9")``.
"""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Clause:
    """One row of a list."""

    name: str
    title: str
    tested: bool
    reason: str


def read_clauses(folder: Path) -> dict[str, Clause]:
    """Return every clause of every ``*/clauses.toml`` under ``folder``.

    Raises:
        ValueError: a row is incomplete, or a clause stands in two lists.
    """
    clauses: dict[str, Clause] = {}
    for path in sorted(folder.glob("*/clauses.toml")):
        for name, row in tomllib.loads(path.read_text())["clauses"].items():
            where = f"{path.parent.name}/{path.name}: {name}"
            if name in clauses:
                raise ValueError(f"{where} stands in two lists")
            if row.get("state") not in ("tested", "open") or not row.get("title"):
                raise ValueError(f'{where} needs a title and state = "tested" or "open"')
            if (row["state"] == "open") != bool(row.get("reason")):
                raise ValueError(f"{where}: a reason belongs to an open clause, and only to one")
            clauses[name] = Clause(
                name, row["title"], row["state"] == "tested", row.get("reason", "")
            )
    return clauses


def family(name: str) -> str:
    """Return the first part of a clause id, which names the chip: ``"LM"`` of ``"LM-BUS-7"``."""
    return name.partition("-")[0]


def unknown(clauses: dict[str, Clause], marked: Iterable[str], whole: bool) -> list[str]:
    """Return the ids marked on tests that stand in no list.

    In a run of part of the suite, chips that have no list yet are let pass.
    """
    listed = {family(name) for name in clauses}
    return sorted(name for name in set(marked) - set(clauses) if whole or family(name) in listed)


def untested(clauses: dict[str, Clause], marked: Iterable[str]) -> list[Clause]:
    """Return the clauses whose state is "tested" though no test names them."""
    named = set(marked)
    return [clause for clause in clauses.values() if clause.tested and clause.name not in named]


def stale(clauses: dict[str, Clause], marked: Iterable[str]) -> list[Clause]:
    """Return the clauses whose state is "open" though a test names them."""
    named = set(marked)
    return [clause for clause in clauses.values() if not clause.tested and clause.name in named]
