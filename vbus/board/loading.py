"""Bringing a board to a saved state: everything is checked first, then set in its order."""

from collections.abc import Callable
from typing import Any

from vbus.core.errors import SnapshotError
from vbus.core.state import validate
from vbus.core.state.kinds import Load


def prepare(board: Any, saved: Any) -> Callable[[], None]:
    """Check a state against a board; return what loads it, to be called at once.

    Args:
        board: a board with the same chips and open ports as the one that was saved.
        saved: what its ``save()`` gave.

    Raises:
        SnapshotError: the state was made by another board, or is none; the board is as it was.
    """
    try:
        fields = dict(saved)
        parts, broken = [tuple(pair) for pair in fields.pop("parts")], fields.pop("faults", None)
        through, lent = fields.pop("through", None), fields.pop("lent", None)
    except (TypeError, ValueError, KeyError):
        raise SnapshotError("this is no saved board") from None
    if parts != board.parts:
        raise SnapshotError(
            f"the state belongs to a board with {parts}, this one has {board.parts}"
        )
    breaking, unwrap, lend = None, None, None
    if board.broken or broken:
        from vbus.faults.state import prepare as prepare_faults

        breaking, unwrap = prepare_faults(board.faults, board, broken)
    try:
        loading = validate(board, fields, "the state")
        seen = None
        if through is not None and board.through is not None:
            seen = validate(board.through, through, "the state: through")
        if lent is not None:
            lend = board.player.prepare(lent, [port.pins for port in board.ports])
    except SnapshotError:
        if unwrap is not None:
            unwrap()
        raise

    def go() -> None:
        try:
            _load(board, loading, fields["wires"], breaking)
            if seen is not None:
                seen.apply()
            if lend is not None:
                lend()
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            # Each field fits by itself; together they do not.
            raise SnapshotError(f"the state does not fit: {error!r}") from error

    return go


def _load(board: Any, loading: Load, wires: Any, breaking: Load | None) -> None:
    board.player.flush()
    board.player.forget()
    if breaking is not None:
        breaking.apply()
    # Pending events are sent now: they belong to the run that is left behind.
    board.kernel.settle()
    loading.apply()
    if breaking is not None:
        board.faults.go_on()
    # Who listens now has begun to listen since.
    board.wires = wires
    for chip in board.chips:
        chip.heard_changed()
        chip.rearm()
