"""Rules that a host can break, the breach of one, and what comes of it."""

from typing import ClassVar, Final, NamedTuple

from vbus.core.state import Names

OFF: Final = 0
WARN: Final = 1
STRICT: Final = 2


class Rule(NamedTuple):
    """One thing a host can break, declared beside the chip's tables.

    Attributes:
        name: stable name, e.g. ``"lm628.T14"`` or ``"lm628.busy-write"``.
        clause: clause of the chip's specification, e.g. ``"LM-TIM-14"``.
        title: one plain sentence saying what is required.
        severity: ``"error"`` (silicon may fail), ``"warning"`` (it works, but is not meant)
            or ``"note"`` (worth knowing).
    """

    name: str
    clause: str
    title: str
    severity: str = "error"


class Violation(NamedTuple):
    """One breach of a rule.

    Attributes:
        when: instant (ps).
        chip: the chip's name on the board.
        rule: name of the :class:`Rule`.
        clause: its clause id.
        severity: ``"error"``, ``"warning"`` or ``"note"``.
        measured: what the host did (ps for intervals, else a count or 0).
        limit: what is allowed, in the same unit.
        detail: a sentence for a person.
    """

    when: int
    chip: str
    rule: str
    clause: str
    severity: str
    measured: int
    limit: int
    detail: str


class Policy:
    """What happens on a violation: off, warn (record, perform) or strict (record, cycle lost).

    Args:
        default: for every rule not named.
        rules: exceptions by rule name, or by family (``"lm628"`` covers ``"lm628.T14"``).
    """

    __slots__ = ("_rules", "default")
    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, default: int = WARN, rules: dict[str, int] | None = None) -> None:
        self.default: int = default
        self._rules: dict[str, int] = dict(rules or {})

    def of(self, rule: str) -> int:
        """Return :data:`OFF`, :data:`WARN` or :data:`STRICT` for the rule named ``rule``."""
        level = self._rules.get(rule)
        # A rule by its name, else its family, else the default.
        if level is None:
            level = self._rules.get(rule.partition(".")[0], self.default)
        return level
