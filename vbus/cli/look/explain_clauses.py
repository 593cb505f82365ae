"""Clauses in full, and rules with the clause they rest on, for ``vbus explain``."""

import re
import textwrap
from collections.abc import Iterator
from typing import Final

from vbus.board.check.checks import all_rules
from vbus.chips.clauses import Clause, proofs_of
from vbus.cli.output import Line
from vbus.core.signals import Rule
from vbus.core.values.settings import suggestion
from vbus.views.clauses import ac_limits, all_clauses, carriers, headed

# As the manuals' own columns: a terminal of the usual width breaks no line again.
WIDTH: Final = 80

_CLAUSE: Final = re.compile(r"[A-Z]+-[A-Z]+-\d+", re.IGNORECASE)
_ITEM: Final = re.compile(r"\d+\. |\* ")


def explained(what: str, as_data: bool = False) -> list[str]:
    """Return the lines that explain a clause or a rule; none if ``what`` is neither.

    Args:
        what: id of a clause, or name of a rule; without its family the rule of every chip that
            has one of that name, such as the rows ``T5`` of two AC tables.
        as_data: give one line for each, with its data (:class:`~vbus.cli.output.Line`).
    """
    if _CLAUSE.fullmatch(what):
        for package, clause in all_clauses():
            if clause.name == what.upper():
                return [_clause_data(package, clause)] if as_data else [*_clause(package, clause)]
    rules = _rules(what)
    if as_data:
        return [*map(_rule_data, rules)] or carriers(what)
    lines: list[str] = []
    for rule in rules:
        lines += ["", *_rule(rule)] if lines else _rule(rule)
    return lines or carriers(what)


def _clause_data(package: str, clause: Clause) -> Line:
    return Line(
        clause.name, clause=clause.name, title=clause.title, kind=clause.kind,
        section=clause.section, evidence=clause.evidence, text=clause.text,
        named_by=carriers(clause.name), tests=list(proofs_of(package).get(clause.name, ())),
    )  # fmt: skip


def _rule_data(rule: Rule) -> Line:
    return Line(
        rule.name, rule=rule.name, severity=rule.severity, clause=rule.clause, title=rule.title,
        limits=[str(limit) for limit in ac_limits(rule.name)],
    )  # fmt: skip


def unknown_clause(what: str) -> str:
    """Return a complaint if ``what`` looks like the id of a clause, and is none; else nothing."""
    if not _CLAUSE.fullmatch(what):
        return ""
    hint = suggestion(what.upper(), [clause.name for _, clause in all_clauses()])
    return f'there is no clause "{what}"' + (f"; {hint.rstrip()}" if hint else "")


# -- rules ----------------------------------------------------------------------------------------


def _rules(name: str) -> list[Rule]:
    """Return the rule of this name; if there is none, those that have it after their family's."""
    rules = all_rules()
    return (
        # Exactly as it is written first: "t5" and "T5" are rows of two tables.
        [rule for rule in rules if rule.name == name]
        or [rule for rule in rules if _symbol(rule) == name]
        or [rule for rule in rules if _symbol(rule).lower() == name.lower()]
    )


def _symbol(rule: Rule) -> str:
    return rule.name.partition(".")[2]


def _rule(rule: Rule) -> Iterator[str]:
    """Give a rule with its rows of AC tables, and the clause it rests on."""
    yield from headed(rule)
    for _, clause in all_clauses():
        if clause.name == rule.clause:
            yield f"  {clause.name}: {clause.title}"
            yield from _wrapped(clause.text, "    ")


# -- clauses --------------------------------------------------------------------------------------


def _clause(package: str, clause: Clause) -> Iterator[str]:
    yield f"{clause.name}: {clause.title}"
    yield f"  {clause.kind}: {clause.section}"
    if clause.evidence:
        yield from _wrapped(f"silicon: {clause.evidence}", "  ")
    yield ""
    yield from _wrapped(clause.text, "  ")
    citing = carriers(clause.name)
    if citing:
        yield ""
        yield from citing
    yield ""
    if clause.tested:
        yield "Tests:"
        yield from (f"  {test}" for test in proofs_of(package).get(clause.name, ()))
    else:
        yield f"No test: {clause.reason}"


def _wrapped(text: str, indent: str) -> Iterator[str]:
    """Give paragraphs and list items, each filled anew; lines of a table as they are."""
    for number, paragraph in enumerate(text.split("\n\n")):
        if number:
            yield ""
        # Cells of a table stand below each other: filled anew they would not.
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
