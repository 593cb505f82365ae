"""Which clauses of the chips' specifications have a test.

Each chip's list is ``vbus/chips/<chip>/clauses.toml``: see ``vbus.chips.clauses``. A test names the
clauses it would fail without: ``@pytest.mark.spec("LM-BUS-7", "LM-BUS-9")``.
"""

from collections.abc import Iterable
from pathlib import Path

from vbus.chips import clauses as lists
from vbus.chips.clauses import Clause


def read_clauses(folder: Path) -> dict[str, Clause]:
    """Return every clause of every ``*/clauses.toml`` under ``folder``.

    Raises:
        ValueError: a clause is incomplete, or stands in two lists.
    """
    clauses: dict[str, Clause] = {}
    for path in sorted(folder.glob(f"*/{lists.LIST}")):
        where = f"{path.parent.name}/{path.name}"
        for name, clause in lists.read_clauses(path.read_text(), where).items():
            if name in clauses:
                raise ValueError(f"{where}: {name} stands in two lists")
            clauses[name] = clause
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
