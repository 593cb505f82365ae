"""Clauses in full, and rules with the clause they rest on, for ``vbus explain``."""

import re
import textwrap
from collections.abc import Iterator
from typing import Final

from vbus.board import plugins
from vbus.board.checks import all_rules
from vbus.board.settings import suggestion
from vbus.chips.clauses import Clause, clauses_of, proofs_of
from vbus.signals import Rule
from vbus.trace.tables import ac_limits

WIDTH: Final = 80

_CLAUSE: Final = re.compile(r"[A-Z]+-[A-Z]+-\d+", re.IGNORECASE)
_ITEM: Final = re.compile(r"\d+\. |\* ")


def explained(what: str) -> list[str]:
    """Return the lines that explain a clause or a rule; none if ``what`` is neither.

    Args:
        what: id of a clause, or name of a rule; without its family the rule of every chip that
            has one of that name, such as the rows ``T5`` of two AC tables.
    """
    if _CLAUSE.fullmatch(what):
        for package, clause in _clauses():
            if clause.name == what.upper():
                return list(_clause(package, clause))
    lines: list[str] = []
    for rule in _rules(what):
        lines += ["", *_rule(rule)] if lines else _rule(rule)
    return lines or list(_carriers(what))


def unknown_clause(what: str) -> str:
    """Return a complaint if ``what`` looks like the id of a clause, and is none; else nothing."""
    if not _CLAUSE.fullmatch(what):
        return ""
    hint = suggestion(what.upper(), [clause.name for _, clause in _clauses()])
    return f'there is no clause "{what}"' + (f"; {hint.rstrip()}" if hint else "")


def _clauses() -> Iterator[tuple[str, Clause]]:
    """Give every clause of every chip that is registered, with the package it stands in."""
    for chip in plugins.chip_classes():
        package, _, _ = chip.__module__.rpartition(".")
        for clause in clauses_of(package).values() if package else ():
            yield package, clause


# -- rules ----------------------------------------------------------------------------------------


def _rules(name: str) -> list[Rule]:
    """Return the rule of this name; if there is none, those that have it after their family's."""
    rules = all_rules()
    return (
        [rule for rule in rules if rule.name == name]
        or [rule for rule in rules if _symbol(rule) == name]
        or [rule for rule in rules if _symbol(rule).lower() == name.lower()]
    )


def _symbol(rule: Rule) -> str:
    return rule.name.partition(".")[2]


def _rule(rule: Rule) -> Iterator[str]:
    """Give a rule with its rows of AC tables, and the clause it rests on."""
    yield from _headed(rule)
    for _, clause in _clauses():
        if clause.name == rule.clause:
            yield f"  {clause.name}: {clause.title}"
            yield from _wrapped(clause.text, "    ")


def _headed(rule: Rule) -> Iterator[str]:
    yield f"{rule.name} ({rule.severity}, {rule.clause}): {rule.title}"
    for limit in ac_limits(rule.name):
        yield f"  AC row {limit}"


# -- clauses --------------------------------------------------------------------------------------


def _clause(package: str, clause: Clause) -> Iterator[str]:
    yield f"{clause.name}: {clause.title}"
    yield f"  {clause.kind}: {clause.section}"
    yield ""
    yield from _wrapped(clause.text, "  ")
    carriers = [*_carriers(clause.name)]
    if carriers:
        yield ""
        yield from carriers
    yield ""
    if clause.tested:
        yield "Tests:"
        yield from (f"  {test}" for test in proofs_of(package).get(clause.name, ()))
    else:
        yield f"No test: {clause.reason}"


def _carriers(name: str) -> Iterator[str]:
    """Give the rules that cite a clause, and the commands, registers and settings it is of.

    A plug-in may cite clauses of a list it does not bring with it.
    """
    if not name:
        return
    for rule in all_rules():
        if rule.clause == name:
            yield from _headed(rule)
    for family in plugins.families():
        for row in family.commands:
            if row.clause == name:
                yield f"{family.name}: {row.name} ({row.code:02X}H): {row.title}"
        for register in family.registers:
            if register.clause == name:
                where = " ".join(f"{address:02X}H" for address in register.addresses)
                yield f"{family.name}: {register.name} ({where}): {register.title}"
    for chip in plugins.chip_classes():
        for option in chip.OPTIONS:
            if option.clause == name:
                yield f"{chip.FAMILY}: setting {option.name}: {option.title}"


def _wrapped(text: str, indent: str) -> Iterator[str]:
    """Give paragraphs and list items, each filled anew; lines of a table as they are."""
    for number, paragraph in enumerate(text.split("\n\n")):
        if number:
            yield ""
        if paragraph.startswith("|"):
            yield from (indent + line for line in paragraph.splitlines())
            continue
        for item in re.split(r"\n(?=\d+\. |\* )", paragraph):
            mark = _ITEM.match(item)
            yield from textwrap.wrap(
                " ".join(item.split()),
                WIDTH,
                initial_indent=indent,
                subsequent_indent=indent + " " * (len(mark[0]) if mark else 0),
                break_long_words=False,
                break_on_hyphens=False,
            )
