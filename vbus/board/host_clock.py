"""One host's time: its stamps, its waits, and being held until time may run on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from mypy_extensions import mypyc_attr

from vbus.kernel import NEVER, US, Kernel
from vbus.protocols import codes
from vbus.protocols.port import HostPort, PortError

if TYPE_CHECKING:
    from vbus.board.board import Board

APPROACH: Final = 1000 * US
"""How long before a host's time stamp the board may be brought there: longer than any strobe."""


@mypyc_attr(allow_interpreted_subclasses=True)
class HostClock(HostPort):
    """The part of a port that knows when the host's next cycle happens.

    Args:
        board: the board.
    """

    def __init__(self, board: Board) -> None:
        self.board: Board = board
        self.held = False
        self.hold_until = 0
        self._kernel: Kernel = board.kernel
        self._cycle: int = US
        self._stamp: int = -1
        self._last_at: int = 0
        self._timed: bool = board.policy != "lockstep"
        self._target: int = -1

    def _hold(self, until: int) -> None:
        self.held = True
        self.hold_until = until

    def _begin(self) -> int:
        """Return the instant of the next cycle's latching edge."""
        if self._stamp >= 0:
            when = max(self._stamp, self._kernel.now)
            self._stamp = -1
        else:
            when = self._kernel.now + self._cycle
        if when > self.board.limit:
            if when >= NEVER:
                raise PortError(codes.BAD_AT, f"time ends at {NEVER - 1} ps")
            self._hold(when)
        return when

    def _run_until(self, when: int) -> None:
        kernel = self._kernel
        if kernel.next_due > when:
            kernel.now = when
        else:
            kernel.run_until(when)

    def _arrive(self) -> None:
        """Come to the host's instant for something that takes no time of its own."""
        if self._stamp >= 0:
            when = max(self._stamp, self._kernel.now)
            self._stamp = -1
            self.board.run_until(when)
        self.board.player.flush()

    def _pass_to(self, when: int) -> bool:
        """Let time pass to ``when`` if the wall clock allows; else hold the session."""
        if when > self.board.limit:
            self._hold(when)
            return False
        self.held = False
        if when > self._kernel.now:
            self.board.run_until(when)
        return True

    def _host_now(self) -> int:
        if self._stamp >= 0:
            return max(self._stamp, self._kernel.now)
        return self._kernel.now

    def delay(self, duration: int) -> bool:
        """Let time pass for this host."""
        self._timed = True
        if self._target < 0:
            until = self._host_now() + duration
            if until >= NEVER:
                raise PortError(codes.BAD_AT, f"delay {duration}: time ends at {NEVER - 1} ps")
            self._target = until
            self._stamp = -1
        if not self._pass_to(self._target):
            return False
        self._target = -1
        return True

    def at(self, when: int) -> None:
        """Set the host's own clock (slaved boards only)."""
        if self.board.policy != "slaved":
            raise PortError(
                codes.BAD_AT, f"at: board {self.board.name!r} is {self.board.policy}, not slaved"
            )
        if when < self._last_at:
            raise PortError(codes.BAD_AT, f"at {when}: before the last at, {self._last_at}")
        self._last_at = when
        self._stamp = when
        # Far ahead: the server brings time near it in slices, before the strobes of that cycle.
        if when - APPROACH > self.board.limit:
            self._hold(when - APPROACH)

    def now(self) -> int:
        """Return chip time."""
        return self._host_now()
