"""The clauses of all chips that are registered, and what cites them, for those who explain them."""

from collections.abc import Iterator

from vbus import plugins
from vbus.board.check.checks import all_rules
from vbus.chips.clauses import Clause, clauses_of
from vbus.core.signals import Rule
from vbus.views.tables import ac_limits


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
