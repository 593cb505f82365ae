"""The faults of a board as plain numbers and texts, and back."""

from collections.abc import Collection
from typing import Any

from vbus.errors import SnapshotError
from vbus.faults.armed import Armed
from vbus.faults.row import LINK, Fault
from vbus.faults.table import faults
from vbus.faults.trigger import Until, When


def record(armed: Armed) -> tuple[object, ...]:
    """Return an armed fault as a tuple.

    Whether somebody was on a link when its fault began is no part of the board.
    """
    when, until = armed.when, armed.until
    return (
        armed.number, armed.name, armed.target, (when.kind, when.number, when.name, when.text),
        (until.kind, until.span, until.text), tuple(armed.values.items()), armed.state,
        0 if armed.fault.target == LINK else armed.fired, armed.seen, armed.draws,
        armed.cleared, armed.writes, armed.side,
    )  # fmt: skip


def armed_of(state: Any, fault: Fault) -> Armed:
    """Return the fault that :func:`record` made a tuple of."""
    number, _, target, when, until, values, stage, fired, seen, draws, cleared, writes, side = state
    return Armed(
        number, fault, target, When(*when), Until(*until), dict(values), stage, fired, seen, draws,
        cleared, tuple(tuple(pair) for pair in writes), side,
    )  # fmt: skip


def wrapped_in(state: Any, places: Collection[str]) -> set[str]:
    """Check the saved faults of a board with these axes; return the axes that were wrapped.

    Raises:
        SnapshotError: they are none; says why.
    """
    known = faults() if state else {}
    try:
        _, _, records, queue, (axes, clocks) = state or (0, 0, (), (), ((), ()))
        for row in records:
            armed_of(row, known[row[1]])
        for _, _, _, number in queue:
            int(number)
        dict(clocks)
        wrapped = {place for place, is_wrapped, _, _ in axes if is_wrapped}
    except (TypeError, ValueError, IndexError, KeyError) as error:
        raise SnapshotError(f"the state.faults: these are none: {error!r}") from None
    if not wrapped <= set(places):
        raise SnapshotError(f"the state.faults: no such axis: {', '.join(wrapped - set(places))}")
    return wrapped
