"""Chip time as a test moves it."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Final

from vbus.board.board import Board
from vbus.core.errors import VbusError, value_errors
from vbus.events.watch import wait_until
from vbus.protocols.quantities import format_instant, picoseconds

WITHIN: Final = "10 s"
"""Chip time that something may take to come."""

Call = Callable[[Callable[[], Any]], Any]


class BoardClock:
    """Moves a board's time.

    Durations and instants are picoseconds, or texts with a unit: ``"10ms"``, ``"341.5us"``.

    Args:
        board: the board.
        call: carries something out while no host acts on the board.
        excused: a block in which time passes by order of the test.
        bring: brings all nodes of a machine to an instant, where the board is that of a node.
    """

    def __init__(
        self,
        board: Board,
        call: Call,
        excused: Callable[[], AbstractContextManager[None]],
        bring: Callable[[int], None] | None = None,
    ) -> None:
        self.board: Final = board
        self._call: Final = call
        self._excused: Final = excused
        self._bring: Final = bring
        self._run_until: Final = bring or board.run_until
        self._frozen = False

    @property
    def now(self) -> int:
        """Chip time (ps); all of the board is there when it is asked for."""
        self._call(self.board.catch_up)
        return self.board.now

    def advance(self, duration: int | str) -> None:
        """Let ``duration`` pass.

        Raises:
            VbusError: time is the wall clock's, or frozen; or the duration is negative.
        """
        length = span_of(duration)
        self._move(lambda: self._run_until(self.board.now + length))

    def run_until(self, instant: int | str) -> None:
        """Let time pass to ``instant``, inclusive of what happens at it.

        Raises:
            VbusError: time is the wall clock's, or frozen; or that instant is over.
        """
        when = coming(instant, self.now)
        self._move(lambda: self._run_until(when))

    def wait_until(self, condition: str, within: int | str = WITHIN) -> int:
        """Let time pass to the earliest instant at which ``condition`` holds; return it (ps).

        Args:
            condition: such as ``"x.status.TRAJECTORY_COMPLETE"``.
            within: how long it may take.

        Raises:
            VbusError: it makes no sense on this board, or has not come to hold in time; or time
                is the wall clock's, or frozen.
        """
        if self._bring is not None:
            raise VbusError(
                f'wait_until "{condition}": the time of a node is that of all nodes; advance() the'
                " machine and look"
            )
        length = ps_of(within)
        self._move(lambda: wait_until(self.board, condition, length))
        return self.now

    @contextmanager
    def freeze(self) -> Iterator[None]:
        """Let bus cycles take no time while this lasts: everything happens at one instant.

        A chip that is busy stays busy, so a host that polls it polls in vain. Pauses a host asks
        for still pass.

        Raises:
            VbusError: time is the wall clock's or the host's own.
        """
        self._master("freeze")
        board = self.board
        frozen = self._call(lambda: [(port, port.cost(0)) for port in board.ports])
        self._frozen = True
        try:
            yield
        finally:
            self._frozen = False
            self._call(lambda: [port.cost(*costs) for port, costs in frozen])

    def _move(self, pass_time: Callable[[], object]) -> None:
        self._master("move")
        if self._frozen:
            raise VbusError("time is frozen: let the freeze() block end first")

        def work() -> None:
            with self._excused():
                try:
                    pass_time()
                finally:
                    self.board.catch_up()

        self._call(work)

    def _master(self, what: str) -> None:
        if self.board.policy != "lockstep":
            owner = {"realtime": "the wall clock's", "slaved": "the host's own"}
            raise VbusError(
                f'{what}: the time of board "{self.board.name}" is {owner[self.board.policy]};'
                " a test can do so on a lockstep board (leave out rate=)"
            )


def ps_of(quantity: int | str) -> int:
    """Return a duration or an instant in ps.

    Raises:
        VbusError: it is no text with a unit.
    """
    with value_errors(VbusError):
        return picoseconds(quantity)


def span_of(duration: int | str) -> int:
    """Return how far time is to advance (ps).

    Raises:
        VbusError: it is no duration, or negative.
    """
    length = ps_of(duration)
    if length < 0:
        raise VbusError(f"advance by {duration}: time does not run backwards")
    return length


def coming(instant: int | str, now: int) -> int:
    """Return the instant to which time is to run (ps).

    Raises:
        VbusError: it is none, or over.
    """
    when = ps_of(instant)
    if when < now:
        raise VbusError(f"run_until {format_instant(when)}: it is {format_instant(now)} already")
    return when
