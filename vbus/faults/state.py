"""The faults of a board as plain numbers and texts, and back."""

from typing import Any, Final

from vbus.faults.armed import Armed
from vbus.faults.row import LINK, Fault
from vbus.faults.trigger import Until, When

Record = tuple[Any, ...]
"""An armed fault as a row."""

RECORD: Final = (
    "(i64, str, str, (str, i64, str, str), (str, i64, str), list[(str, value), ...], str, i64, i64,"
    " i64, bool, list[(i64, i64), ...], i64)"
)
"""What is in such a row."""


def record(armed: Armed) -> Record:
    """Return an armed fault as a row.

    Whether somebody was on a link when its fault began is no part of the board.
    """
    when, until = armed.when, armed.until
    return (
        armed.number, armed.name, armed.target, (when.kind, when.number, when.name, when.text),
        (until.kind, until.span, until.text), tuple(armed.values.items()), armed.state,
        0 if armed.fault.target == LINK else armed.fired, armed.seen, armed.draws,
        armed.cleared, armed.writes, armed.side,
    )  # fmt: skip


def armed_of(state: Record, fault: Fault) -> Armed:
    """Return the fault that :func:`record` made a row of."""
    number, _, target, when, until, values, stage, fired, seen, draws, cleared, writes, side = state
    return Armed(
        number, fault, target, When(*when), Until(*until), dict(values), stage, fired, seen, draws,
        cleared, tuple(tuple(pair) for pair in writes), side,
    )  # fmt: skip
