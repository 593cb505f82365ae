"""One host's time: its stamps, its waits, and being held until time may run on."""

from bisect import bisect_right
from itertools import accumulate
from typing import ClassVar, Final

from mypy_extensions import i64, mypyc_attr

from vbus.board.circuit import Circuit
from vbus.kernel import NEVER, US, Kernel
from vbus.protocols import codes
from vbus.protocols.port import HostPort, PortError
from vbus.state import Names

APPROACH: Final = 1000 * US
"""How long before a host's time stamp the board may be brought there: longer than any strobe."""
_FAR: Final = 1 << 61
"""Numbers up to here are compared without making an object of them."""


@mypyc_attr(allow_interpreted_subclasses=True)
class HostClock(HostPort):
    """The part of a port that knows when the host's next cycle happens.

    Args:
        board: the board.
    """

    WIRING: ClassVar[Names] = ("_cycle", "_kernel", "board", "held", "hold_until")

    def __init__(self, board: Circuit) -> None:
        self.board: Circuit = board
        self.held = False
        self.hold_until = 0
        self._kernel: Kernel = board.kernel
        self._cycle: int = US
        self._stamp: int = -1
        self._last_at: int = 0
        self._timed: bool = board.policy != "lockstep"
        self._target: int = -1
        self._polls: int = -1

    def _hold(self, until: int) -> None:
        self.held = True
        self.hold_until = until

    def _begin(self) -> i64:
        """Return the instant of the next cycle's latching edge."""
        if self._stamp < 0:
            instant: i64 = self._kernel.now
            cycle: i64 = self._cycle
            if cycle <= self.board.limit - instant:
                return instant + cycle
        # Not a machine word: a sum may lie beyond the end of time.
        now: int = self._kernel.now
        if self._stamp >= 0:
            when = max(self._stamp, now)
            self._stamp = -1
        else:
            when = now + self._cycle
        limit: int = self.board.limit
        if when > limit:
            if when >= NEVER:
                raise PortError(codes.BAD_AT, f"time ends at {NEVER - 1} ps")
            self._hold(when)
        return when

    def _run_until(self, when: i64) -> None:
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
        limit: int = self.board.limit
        if when > limit:
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
            if until > _FAR and until >= NEVER:
                raise PortError(codes.BAD_AT, f"delay {duration}: time ends at {NEVER - 1} ps")
            self._target = until
            self._stamp = -1
        if not self._pass_to(self._target):
            return False
        self._target = -1
        return True

    def _check_at(self, when: int) -> None:
        if self.board.policy != "slaved":
            raise PortError(
                codes.BAD_AT, f"at: board {self.board.name!r} is {self.board.policy}, not slaved"
            )
        if when < self._last_at:
            raise PortError(codes.BAD_AT, f"at {when}: before the last at, {self._last_at}")

    def at(self, when: int) -> None:
        """Set the host's own clock (slaved boards only)."""
        self._check_at(when)
        self._last_at = when
        self._stamp = when
        # Far ahead: the server brings time near it in slices, before the strobes of that cycle.
        limit: int = self.board.limit
        if when - APPROACH > limit:
            self._hold(when - APPROACH)

    def now(self) -> int:
        """Return chip time."""
        return self._host_now()

    # -- polls answered from leases --------------------------------------------------------------

    def _untold(self, address: int) -> bool:
        """Whether nothing could tell if a poll before the last one were left out."""
        return False

    def _count_untold(self, polls: int) -> None:
        """Count polls that were left out."""
        self._polls -= polls

    def polled_at(self, address: int, first: int, steps: tuple[int, ...]) -> bool:
        """Run polls a host has answered from a lease, each at its stamp; False: resume later."""
        instants = list(accumulate(steps, initial=first))
        if self._polls < 0:
            self._check_at(first)
            if instants[-1] >= NEVER:
                raise PortError(codes.BAD_AT, f"at {instants[-1]}: time ends at {NEVER - 1} ps")
            self._polls = len(instants)
        self.held = False
        while self._polls:
            if self._untold(address):
                place = len(instants) - self._polls
                over = bisect_right(instants, self.board.limit, place) - place - 1
                if over > 0:
                    self._count_untold(over)
            self.at(instants[-self._polls])
            if self.held:
                return False
            try:
                self.read(address)
            except PortError:
                self._polls = -1
                raise
            self._polls -= 1
        self._polls = -1
        return True
