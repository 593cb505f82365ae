"""What a test is judged by: breaches of a datasheet that fail it, what it may take, its golden."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from vbus.board.check.checks import all_rules
from vbus.core.errors import ConfigError
from vbus.core.signals import Violation
from vbus.core.values.settings import rule_hint, rule_names
from vbus.protocols.quantities import format_instant
from vbus.testing.limits import BUDGET, NEAR, Limits, budget_of, tolerance_of
from vbus.views.findings.suppress import Suppression
from vbus.views.runs.difference import Tolerance

FAIL: Final = "fail"
REPORT: Final = "report"
CHOICES: Final = {"violations": (FAIL, REPORT), "after_fault": (REPORT, FAIL)}
"""What may be said of violations, and of those that follow a fault; the default first."""


@dataclass(slots=True)
class Judged:
    """The violations of one board of a test.

    Attributes:
        failing: those that fail the test.
        after_fault: those on a chip on which a fault had begun.
        accepted: the others, which a test or the project accepts, each with the reason.
        notes: those that are no breach.
    """

    failing: list[Violation] = field(default_factory=list)
    after_fault: list[Violation] = field(default_factory=list)
    accepted: list[tuple[Violation, str]] = field(default_factory=list)
    notes: list[Violation] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Judge:
    """Tells which violations fail a test, and how far it may go.

    Args:
        violations: ``"fail"``, or ``"report"`` to tell of them only.
        after_fault: the same of those on a chip on which a fault has begun.
        accepted: what is accepted; how often each was used is counted there.
        budget: what the test may take.
        tolerance: how far from its golden its run may be.
    """

    violations: str = FAIL
    after_fault: str = REPORT
    accepted: Sequence[Suppression] = ()
    budget: Limits = BUDGET
    tolerance: Tolerance = NEAR

    def configured(self, where: str, table: Mapping[str, Any]) -> "Judge":
        """Return one that goes by what a table says of :data:`CHOICES`, ``budget`` and ``golden``.

        Raises:
            ConfigError: a value makes no sense.
        """
        given: dict[str, Any] = {key: table[key] for key in CHOICES if key in table}
        for key, value in given.items():
            if value not in CHOICES[key]:
                allowed = " or ".join(f'"{one}"' for one in CHOICES[key])
                raise ConfigError(f"{where}: {key} = {value!r}: write {allowed}")
        given["budget"] = budget_of(where, table.get("budget", {}), self.budget)
        given["tolerance"] = tolerance_of(where, table.get("golden", {}), self.tolerance)
        return replace(self, **given)

    def sort(
        self, violations: Iterable[Violation], faulted: dict[str, int], judged: Judged
    ) -> None:
        """Sort violations of a board.

        Args:
            violations: those that have come since the last time.
            faulted: instant at which a fault first began, by chip; "" is every chip.
            judged: takes them.
        """
        for found in violations:
            begun = [faulted[name] for name in (found.chip, "") if name in faulted]
            accepting = [one for one in self.accepted if one.covers(found)]
            for one in accepting:
                one.used += 1
            if found.severity == "note":
                judged.notes.append(found)
            elif accepting:
                judged.accepted.append((found, accepting[0].reason))
            elif begun and found.when >= min(begun):
                judged.after_fault.append(found)
            else:
                judged.failing.append(found)


def by_rule(violations: Iterable[Violation], when: str = "", verb: str = "broke") -> list[str]:
    """Return a sentence for each rule that the host of each chip broke."""
    found: dict[tuple[str, str], list[Violation]] = {}
    for v in violations:
        found.setdefault((v.chip, v.rule), []).append(v)
    lines = []
    for (chip, rule), several in found.items():
        first = several[0]
        times = f"{len(several)} times, first " if len(several) > 1 else ""
        at = format_instant(first.when)
        lines.append(f"{chip} {verb} {rule} {times}at {at}{when}: {first.detail}  [{first.clause}]")
    return lines


def accepted(where: str, given: Any) -> list[Suppression]:
    """Check a table of rules and reasons.

    Raises:
        ConfigError: it is no table, a rule does not exist, or a reason is missing.
    """
    if not isinstance(given, dict):
        raise ConfigError(
            f'{where}: accept = {given!r}: write rules with reasons, {{"RULE": "why"}}'
        )
    known = rule_names(rule.name for rule in all_rules())
    for rule, reason in given.items():
        if rule not in known:
            hint = rule_hint(str(rule), known)
            raise ConfigError(f"{where}: accept: unknown rule {rule!r}; {hint}")
        if not isinstance(reason, str) or not reason.strip():
            raise ConfigError(f"{where}: accept: say in words why {rule} is accepted")
    return [Suppression(rule, "", reason) for rule, reason in given.items()]
