"""Makes the fidelity ledger of a chip family: each clause, what proves it, and what is open."""

import tomllib
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from vbus.chips.clauses import KINDS, clauses_of, proofs_of
from vbus.chips.family import Family
from vbus.cli.generate.layout import ROOT, folder_of, table

_MUTATION: Final = ROOT / "tests" / "mutation"


def ledger(family: Family) -> str:
    """Return the ledger of a chip family, which lies beside its page.

    A mutant counts for the clauses of the tests that kill it.
    """
    clauses = clauses_of(family.home)
    proofs = proofs_of(family.home)
    rows = []
    touched = 0
    for clause in clauses.values():
        tests = proofs.get(clause.name, [])
        # Of the short list that CI tries each time: its results are at hand, those of a full run
        # are not.
        killed = sum(1 for mutant in _mutants("gate") if _killers(mutant) & set(tests))
        touched += killed > 0
        shown = f"open: {clause.reason}" if not clause.tested else "<br>".join(map(_test, tests))
        name = f"[{clause.name}]({family.name}-clauses.md#{clause.name.lower()})"
        kind, seen = clause.kind, clause.evidence
        rows.append((name, clause.title, kind, seen, shown, str(killed or "")))
    open_ones = sum(1 for clause in clauses.values() if not clause.tested)
    kinds = ", ".join(
        f"{sum(1 for clause in clauses.values() if clause.kind == kind)} {kind}" for kind in KINDS
    )
    return "\n".join(
        [
            f"# Fidelity ledger of the {family.title or family.name}",
            "",
            f"{len(clauses)} clauses: {kinds}; {open_ones} open. A clause that is not open is"
            " proved by the tests beside it, which every run of the tests repeats.",
            "",
            "What real parts, or drivers that work with them, have shown stands in the column"
            " *silicon*. Nothing else is evidence of what silicon does: a test proves that the code"
            " does what the clause says, and a test of `reference/` that the code agrees with a"
            " model written from the same manual and rulings.",
            "",
            "Of the small wrong changes of the source (mutants) that every run of CI tries,"
            f" {touched} clauses have one that their tests find: the column *mutants*. A full"
            " run tries thousands; those that no test can observe stand at the end.",
            "",
            *table(("clause", "title", "kind", "silicon", "tests", "mutants"), rows),
            "",
            "## Mutants that no test can observe",
            "",
            *_survivors(family),
            "",
        ]
    )


def _test(name: str) -> str:
    """Return a test's name without what all of them begin with."""
    return f"`{name.removeprefix('tests/')}`"


def _survivors(family: Family) -> list[str]:
    folder = f"{folder_of(family).relative_to(ROOT).as_posix()}/"
    rows = [
        f"* `{row['file'].removeprefix(folder)}`, `{row['function']}`: `{row['after']}` for"
        f" `{row['before']}`. {row['reason']}"
        for row in _mutants("survivors")
        if row["file"].startswith(folder)
    ]
    return rows or ["None."]


@cache
def _mutants(name: str) -> tuple[Mapping[str, Any], ...]:
    """Return the rows of a list of mutants."""
    with (_MUTATION / f"{name}.toml").open("rb") as file:
        return tuple(tomllib.load(file)["mutant"])


def _killers(mutant: Mapping[str, Any]) -> set[str]:
    """Return the tests that kill a mutant, without their parameters."""
    return {test.partition("[")[0] for test in mutant["tests"]}
