"""The faults of a board as plain numbers and texts, and back."""

from collections.abc import Callable
from typing import Any, Final

from vbus.circuit.circuit import Circuit
from vbus.core.errors import SnapshotError
from vbus.core.state import Saved, validate
from vbus.core.state.kinds import Load
from vbus.faults.armed import Armed
from vbus.faults.row import LINK, Fault
from vbus.faults.table import faults
from vbus.faults.trigger import Until, When

Record = tuple[Any, ...]
"""An armed fault as a row."""

RECORD: Final = (
    "(i64, str, str, (str, i64, str, str), (str, i64, str), list[(str, value), ...], str, i64, i64,"
    " i64, bool, list[(i64, i64), ...], i64)"
)
"""What is in such a row."""


NOTHING: Final[Saved] = {
    "_last": 0, "_serial": 0, "records": (), "due": (), "acts": {"axes": (), "courses": ()},
}  # fmt: skip
"""State of a board on which nothing has ever been armed."""


def record(armed: Armed) -> Record:
    """Return an armed fault as a row.

    Whether a link had a host when its fault began is no part of the board.
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


def prepare(part: Any, board: Circuit, saved: Any) -> tuple[Load, Callable[[], None]]:
    """Check saved faults, and wrap plants as they were then, so that their states fit.

    Args:
        part: the :class:`~vbus.faults.faults.Faults` of the board.
        board: the board.
        saved: the faults; None: nothing is armed.

    Returns:
        What loads them, before chips take back theirs; and what wraps plants as they are now.

    Raises:
        SnapshotError: they are none, or not of this board; nothing is changed.
    """
    state: Any = saved or NOTHING
    found = validate(part, state, "the state.faults")
    acts = state["acts"]
    for what, names, there in (
        ("fault", {row[1] for row in state["records"]}, faults() if saved else ()),
        ("axis", {row[0] for row in acts["axes"]}, board.axes),
        ("chip", {row[0] for row in acts["courses"]}, [chip.name for chip in board.chips]),
    ):
        missing = ", ".join(sorted(names - {*there}))
        if missing:
            raise SnapshotError(f"the state.faults: no such {what}: {missing}")
    return found, part.acts.wrap({row[0] for row in acts["axes"] if row[1]})
