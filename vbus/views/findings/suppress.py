"""Violations that are known and accepted: a TOML file with the reason for each."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from msgspec import Struct

from vbus.board.check.checks import all_rules
from vbus.boardfile.key import Section, row
from vbus.boardfile.source import BoardFileError, Source
from vbus.boardfile.walker import Walker
from vbus.core.errors import VbusError, read_errors
from vbus.core.signals import Violation
from vbus.core.values.settings import rule_hint, rule_names


class Suppression(Struct):
    """One accepted kind of violation.

    Attributes:
        rule: name of a rule, or of a family.
        chip: name of a chip, or "" for all.
        reason: why it is accepted.
        used: how many violations it has covered.
    """

    rule: str
    chip: str
    reason: str
    used: int = 0

    def covers(self, violation: Violation) -> bool:
        """Tell whether a violation is accepted by it."""
        # Rules are named FAMILY.RULE, so a family accepts all of its rules.
        family = violation.rule.partition(".")[0]
        return self.rule in (violation.rule, family) and self.chip in ("", violation.chip)


class _Suppress(Section, frozen=True, kw_only=True):
    """``[[suppress]]``."""

    rule: Annotated[str, row("name of a rule, or of a family")]
    chip: Annotated[str, row("name of a chip; else all")] = ""
    reason: Annotated[str, row("why it is accepted")]
    place: int = 0


class _File(Section, frozen=True, kw_only=True):
    suppress: tuple[_Suppress, ...] = ()


def suppressions_of(path: str) -> list[Suppression]:
    """Return the accepted violations of a file; none if ``path`` is empty.

    Raises:
        VbusError: it cannot be read or is wrong.
    """
    if not path:
        return []
    with read_errors(path):
        text = Path(path).read_text()
    return read_suppressions(text, path, [rule.name for rule in all_rules()])


def read_suppressions(text: str, file: str, rules: Iterable[str]) -> list[Suppression]:
    """Read a suppression file.

    Args:
        text: its text: ``[[suppress]]`` tables with ``rule``, ``reason`` and perhaps ``chip``.
        file: its name, for messages.
        rules: names that may be suppressed.

    Raises:
        VbusError: it is no TOML, or an entry is wrong; all are named.
    """
    try:
        return _read(Source(file, text), rules)
    except BoardFileError as error:
        raise VbusError(str(error)) from None


def _read(source: Source, rules: Iterable[str]) -> list[Suppression]:
    data = source.parsed("list of accepted violations")
    found = Walker(source, data).section(_File, (), data) or _File()
    known = rule_names(rules)
    for one in found.suppress:
        where = ("suppress", one.place)
        if one.rule not in known:
            source.fail((*where, "rule"), f"unknown rule; {rule_hint(one.rule, known)}")
        # An acceptance without a reason cannot be reviewed.
        if not one.reason.strip():
            source.fail((*where, "reason"), "say in words why it is accepted")
    source.finish()
    return [Suppression(one.rule, one.chip, one.reason) for one in found.suppress]
