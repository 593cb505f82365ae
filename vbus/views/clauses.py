"""Clauses and AC tables of all registered chips, and what cites them, for explanations."""

from collections.abc import Iterable, Iterator
from functools import cache

from vbus import plugins
from vbus.board.check.checks import all_rules
from vbus.chips.ac_table import AcTable
from vbus.chips.base import Chip
from vbus.chips.clauses import Clause, clauses_of
from vbus.core.signals import Rule
from vbus.views.scope.frames import ALL, CLAUSES, frame, texts


def ac_tables() -> Iterator[tuple[str, str, AcTable]]:
    """Give every table of AC characteristics: family, supply (or ""), table."""
    for family in plugins.families():
        for supply, table in family.ac_tables.items():
            yield family.name, supply, table


def ac_limits(rule: str) -> list[str]:
    """Return the row of the manual's AC table that a rule checks, once for each supply.

    Args:
        rule: name of the rule, such as ``lm628.T14``.

    Returns:
        ``["T14: at least 100 ns"]``, ``["tSDR at 5 V: at least 2.1 ns", ...]``; empty if the rule
        is no row of such a table.
    """
    family, _, symbol = rule.partition(".")
    limits = []
    for owner, supply, table in ac_tables():
        for row in table:
            # Once for each supply: the MCP-1200 has a column for 5 V and one for 3.3 V.
            if owner == family and row.symbol == symbol:
                least = [f"{row.min_ps / 1000:g} ns"] if row.min_ps else []
                least += [f"{row.min_clk:g} clk"] if row.min_clk else []
                minimum = f"at least {' + '.join(least) or '0 ns'}"
                limit = f"at most {row.max_ps / 1000:g} ns" if row.max_ps else minimum
                both = f"{minimum}, {limit}" if row.max_ps and least else limit
                limits.append(f"{symbol}{f' at {supply}' if supply else ''}: {both}")
    return limits


@cache
def ac_rules() -> frozenset[str]:
    """Return the names of the rules that measure an interval, in ps."""
    return frozenset(rule.name for _, _, table in ac_tables() for rule in table.rules.values())


def all_clauses() -> Iterator[tuple[str, Clause]]:
    """Give every clause of every chip that is registered, with the package it stands in."""
    for chip in plugins.chip_classes():
        package, _, _ = chip.__module__.rpartition(".")
        for clause in clauses_of(package).values() if package else ():
            yield package, clause


def headed(rule: Rule) -> Iterator[str]:
    """Give a rule with its rows of AC tables."""
    yield f"{rule.name} ({rule.severity}, {rule.clause}): {rule.title}"
    for limit in ac_limits(rule.name):
        yield f"  AC row {limit}"


def carriers(name: str) -> list[str]:
    """Return the rules that cite a clause, and the commands, registers and settings it is of.

    A plug-in may cite clauses of a list it does not bring with it.
    """
    return [line for clause, line in _citing() if clause and clause == name]


def all_carriers() -> dict[str, list[str]]:
    """Return what :func:`carriers` gives, of each clause that is cited."""
    found: dict[str, list[str]] = {}
    for clause, line in _citing():
        found.setdefault(clause, []).append(line)
    return found


def _citing() -> Iterator[tuple[str, str]]:
    for rule in all_rules():
        # Rules first: they say what a host sees of a clause.
        for line in headed(rule):
            yield rule.clause, line
    for family in plugins.families():
        for row in family.commands:
            yield row.clause, f"{family.name}: {row.name} ({row.code:02X}H): {row.title}"
        for register in family.registers:
            where = " ".join(f"{address:02X}H" for address in register.addresses)
            yield register.clause, f"{family.name}: {register.name} ({where}): {register.title}"
        for value in family.values.rows:
            yield value.clause, f"{family.name}: {value.name}: {value.title}"
    for chip in plugins.chip_classes():
        for option in chip.OPTIONS:
            yield option.clause, f"{chip.FAMILY}: setting {option.name}: {option.title}"


def clause_frame(families: Iterable[str]) -> bytes:
    """Return a frame with the clauses of chip families: id, title, kind, section, text, citing.

    Args:
        families: names of the families; each may come more than once.
    """
    rows = []
    citing = all_carriers()
    for name in dict.fromkeys(families):
        chip = plugins.family(name).load("chip", Chip)
        # The list of clauses stands beside the module of the chip.
        package = chip.__module__.rpartition(".")[0] if chip is not None else ""
        for clause in clauses_of(package).values() if package else ():
            rows.append(
                {
                    "name": clause.name, "title": clause.title, "kind": clause.kind,
                    "section": clause.section, "text": clause.text,
                    "named_by": citing.get(clause.name, []),
                }
            )  # fmt: skip
    return frame(CLAUSES, ALL, len(rows), 0, texts(rows))
