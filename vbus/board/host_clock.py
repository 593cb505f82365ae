"""One host's time: its stamps, its waits, and being held until time may run on."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.core.kernel import END, FAR, US, Kernel
from vbus.core.state import Names
from vbus.protocols import codes
from vbus.protocols.port import HostPort, NotYet, PortError

APPROACH: Final = 1000 * US
"""How long before a host's time stamp the board may be brought there: longer than any strobe."""


class HostClock:
    """Knows when the host's next cycle happens.

    Args:
        board: the board.
        session: who is held while its time may not come.

    Attributes:
        stamp: the host's own time of its next cycle (ps); -1 if it has given none.
        last_at: the latest time stamp the host has given (ps).
        timed: whether time passes between the host's strobes, so that AC limits are judged: its
            own DELAY, or whatever passes while it holds a line.
        target: what a wait or a delay under way runs to (ps); -1 if none is.
        used: whether the host has let time pass: from then on the time of nodes waits for the host.
    """

    STATE: ClassVar[Names] = ("stamp", "last_at", "timed: bool", "target")
    WIRING: ClassVar[Names] = ("_board", "_kernel", "_session", "used")

    def __init__(self, board: Circuit, session: HostPort) -> None:
        self._board: Circuit = board
        self._kernel: Kernel = board.kernel
        self._session: HostPort = session
        self.stamp: int = -1
        self.last_at: int = 0
        self.timed: bool = board.policy != "lockstep"
        self.target: int = -1
        self.used: bool = False

    def judge(self, chips: list[Chip], timed: bool) -> None:
        """Have AC limits judged when the host moves lines of its chips, or not.

        Args:
            chips: what the host can reach.
            timed: whether its strobes carry times; so they do once time has passed for a line that
                it held, by its own DELAY or another host's.
        """
        self.timed = timed
        for chip in chips:
            chip.timing_checked = timed

    def hold(self, until: int) -> None:
        """Hold the session until time may run to ``until`` (ps)."""
        self._session.held = True
        self._session.hold_until = until

    def begin(self, cycle: int) -> i64:
        """Return the instant of the next cycle's latching edge.

        Args:
            cycle: what a whole cycle costs where the host has given no time stamp (ps).
        """
        if self.stamp < 0:
            instant: i64 = self._kernel.now
            cost: i64 = cycle
            if cost <= self._board.limit - instant:
                return instant + cost
        # Not a machine word: a sum may lie beyond the end of time.
        when = self.take_stamp(cycle)
        limit: int = self._board.limit
        if when > limit:
            self.hold(when)
        return when

    def take_stamp(self, cycle: int) -> int:
        """Return when the next cycle is, by its time stamp or its cost; the stamp is used up.

        Raises:
            PortError: time ends before.
        """
        self.used = True
        when = self.now() if self.stamp >= 0 else self.now() + cycle
        self.stamp = -1
        if when > FAR and when > END:
            raise PortError(codes.BAD_AT, f"time ends at {END} ps")
        return when

    def arrive(self) -> None:
        """Come to the host's instant for something that takes no time of its own."""
        if self.stamp >= 0:
            when = self.now()
            if self._board.granted:
                self.check_granted(when)
            self.stamp = -1
            self._board.pass_until(when)
        self._board.player.flush()

    def check_granted(self, when: int) -> None:
        """Hold the session if time is not granted to ``when`` (ps).

        Raises:
            NotYet: that is so.
        """
        if when > self._board.limit:
            self.used = True
            self.hold(when)
            raise NotYet

    def pass_to(self, when: i64) -> bool:
        """Let time pass to ``when`` if the wall clock allows; else hold the session."""
        board = self._board
        if when <= board.limit and board.sliced and when > self._kernel.now:
            # A chip may have been set to samples so short that the rest is too much in one go.
            reach = board.stride()
            if when - board.caught > reach:
                board.limit = max(board.caught + reach, self._kernel.now)
        if when > board.limit:
            self.hold(when)
            return False
        self._session.held = False
        if when > self._kernel.now:
            self._board.pass_until(when)
        return True

    def now(self) -> int:
        """Return the host's present instant: its time stamp, unless that is past (ps)."""
        now: int = self._kernel.now
        return max(self.stamp, now)

    def delay(self, duration: int) -> bool:
        """Let time pass for this host; False to be called again later."""
        self.timed = self.used = True
        if self.target < 0:
            until = self.now() + duration
            if until > FAR and until > END:
                raise PortError(codes.BAD_AT, f"delay {duration}: time ends at {END} ps")
            self.target = until
            self.stamp = -1
        if not self.pass_to(self.target):
            return False
        self.target = -1
        return True

    def check_at(self, when: int) -> None:
        """Refuse a time stamp that cannot be.

        Raises:
            PortError: the board is not slaved, the host's clock runs backwards, or time ends
                before.
        """
        if self._board.policy != "slaved":
            raise PortError(
                codes.BAD_AT, f"at: board {self._board.name!r} is {self._board.policy}, not slaved"
            )
        if when < self.last_at:
            raise PortError(codes.BAD_AT, f"at {when}: before the last at, {self.last_at}")
        if when > FAR and when > END:
            raise PortError(codes.BAD_AT, f"at {when}: time ends at {END} ps")

    def at(self, when: int) -> None:
        """Set the host's own clock (slaved boards only)."""
        self.check_at(when)
        self.used = True
        self.last_at = when
        self.stamp = when
        # Far ahead: the server brings time near it in slices, before the strobes of that cycle.
        limit: int = self._board.limit
        if when - APPROACH > limit:
            self.hold(when - APPROACH)

    def forget(self) -> None:
        """Time has been set: forget stamps, and what the session waited for."""
        self.stamp, self.last_at, self.target = -1, 0, -1
