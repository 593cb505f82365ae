"""Rules that a host can break, and the breach of one. Data."""

from typing import NamedTuple


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
