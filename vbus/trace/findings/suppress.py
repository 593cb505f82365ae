"""Violations that are known and accepted: a TOML file with the reason for each."""

import tomllib
from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct

from vbus.board.checks import all_rules
from vbus.errors import VbusError, read_errors
from vbus.file_kinds import foreign
from vbus.signals import Violation
from vbus.values.settings import rule_hint, rule_names

_KEYS = ("rule", "chip", "reason")


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
        family = violation.rule.partition(".")[0]
        return self.rule in (violation.rule, family) and self.chip in ("", violation.chip)


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
        data = tomllib.loads(text)
    except ValueError as error:
        reason = foreign(file, text.encode()) or str(error)
        raise VbusError(f"{file}: no TOML: {reason}; write [[suppress]] tables") from None
    known = rule_names(rules)
    wrong = [f"{file}: {key}: unknown section; write [[suppress]]" for key in data
             if key != "suppress"]  # fmt: skip
    entries = data.get("suppress", [])
    if not isinstance(entries, list):
        raise VbusError(f"{file}: suppress: write [[suppress]] with two brackets on either side")
    made = []
    for place, entry in enumerate(entries, 1):
        where = f"{file}: suppress[{place}]"
        for key, value in entry.items():
            if key not in _KEYS:
                wrong.append(f"{where}.{key}: unknown key; allowed are {', '.join(_KEYS)}")
            elif not isinstance(value, str) or not value.strip():
                wrong.append(f"{where}.{key}: write a text in quotes")
        for key in ("rule", "reason"):
            if key not in entry:
                wrong.append(f"{where}: {key} is missing")
        rule = str(entry.get("rule", ""))
        if rule and rule not in known:
            wrong.append(f"{where}.rule: unknown rule; {rule_hint(rule, known)}")
        made.append(Suppression(rule, str(entry.get("chip", "")), str(entry.get("reason", ""))))
    if wrong:
        raise VbusError("\n".join(wrong))
    return made
