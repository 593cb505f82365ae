"""Polls: what a host may know of those to come, and those it has answered itself from that."""

from typing import ClassVar, Final

from vbus.board.host_clock import HostClock
from vbus.board.host_selection import Selection
from vbus.chips.base import OUTPUT, POLL
from vbus.circuit.circuit import Circuit
from vbus.circuit.host_pins import HostPins
from vbus.core.kernel import END, FAR, US
from vbus.core.state import Names
from vbus.protocols import codes
from vbus.protocols.port import HostPort, PortError

LONGEST_LEASE: Final = 100_000 * US
"""How far ahead a lease reaches at most: a host that polls for ever is heard of now and then."""


class HostPolls:
    """The leases of one session, and the polls it answers from them.

    See :meth:`~vbus.protocols.port.HostPort.lease`.

    Args:
        board: the board.
        session: whose cycles they are.
        selection: the session's chips.
        clock: the session's time.
        pins: the session's pins.

    Attributes:
        until: instant until which the last lease holds (ps); 0 if there is none.
        left: how many are still to be run; -1 if none are under way.
        every_cycle: whether each must be run, though the result is the same: for a journal.
    """

    STATE: ClassVar[Names] = ("left",)
    WIRING: ClassVar[Names] = (
        "_board", "_clock", "_pins", "_selection", "_session", "every_cycle",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("until",)

    def __init__(
        self, board: Circuit, session: HostPort, selection: Selection, clock: HostClock,
        pins: HostPins,
    ) -> None:  # fmt: skip
        self._board: Circuit = board
        self._session: HostPort = session
        self._selection: Selection = selection
        self._clock: HostClock = clock
        self._pins: HostPins = pins
        self.until: int = 0
        self.left: int = -1
        self.every_cycle: bool = False

    def lease(self, address: int) -> tuple[int, int, int] | None:
        """Tell how long the byte just read will be read again.

        Nothing is promised in real time, on nodes, and while something is broken.
        """
        board, found = self._board, self._selection.steady(address)
        if found is None:
            return None
        if board.policy == "realtime" or board.granted or board.disturbed:
            return None
        outputs = self._pins.output_word()
        chip, _ = found
        until = min(board.kernel.next_due, END)
        if chip is not None:
            until = min(until, chip.due(POLL))
        for neighbour in self._selection.chips:
            until = min(until, neighbour.due(OUTPUT))
        now: int = board.kernel.now
        if until <= now + self._selection.cycle:
            return None
        self.until = min(until, now + LONGEST_LEASE)
        return outputs, now, self.until

    def foresee(self, address: int) -> tuple[int, int] | None:
        """Tell what comes after the lease just given."""
        found, when, kernel = self._selection.steady(address), self.until, self._board.kernel
        chip, place = found if found is not None else (None, 0)
        following = chip.foresee(place, when) if chip is not None else None
        if following is None:
            return None
        data, until = following
        until = min(min(until, kernel.next_due), min(kernel.now + LONGEST_LEASE, END))
        for neighbour in self._selection.chips:
            if neighbour is not chip:
                until = min(until, neighbour.due(OUTPUT))
        if until <= when + self._selection.cycle:
            return None
        self.until = until
        return data, until

    def end(self) -> None:
        """Before anything else acts on the board: carry out the cycles that were promised."""
        until, self.until = self.until, 0
        if until > self._board.kernel.now:
            self._board.pass_until(until)

    # -- polls that a host has answered ---------------------------------------------------------

    def run(self, address: int, count: int) -> bool:
        """Run polls, each a cycle after the one before; False to be called again later."""
        session, clock = self._session, self._clock
        if self.left < 0:
            self.left = count
        session.held = False
        while self.left:
            if session.held:
                return False
            cycle, now = self._selection.cycle, self._board.now
            if clock.stamp < 0 and self._skippable(address, cycle, now + self.left * cycle):
                # The last one is run: it leaves chip and bus as all of them would.
                over = min(self.left, (self._board.limit - now) // cycle) - 1
                if over > 0:
                    self._board.kernel.pass_to(now + over * cycle)
                    self._skip(over)
            self._poll(address)
        self.left = -1
        return True

    def run_at(self, address: int, first: int, steps: tuple[int, ...]) -> bool:
        """Run polls, each at its time stamp; False to be called again later."""
        session, polls = self._session, len(steps) + 1
        last = first + sum(steps)
        if self.left < 0:
            self._clock.check_at(first)
            if last > FAR and last > END:
                raise PortError(codes.BAD_AT, f"at {last}: time ends at {END} ps")
            self.left = polls
        session.held = False
        while self.left:
            if (
                self.left > 1
                and last <= self._board.limit
                # On a card the first one shows whether there was room for it.
                and (self._selection.path is None or self.left < polls)
                and self._skippable(address, min(steps), last)
            ):
                self._skip(self.left - 1)
            session.at(last if self.left == 1 else first + sum(steps[: polls - self.left]))
            if session.held:
                return False
            self._poll(address)
        self.left = -1
        return True

    def _poll(self, address: int) -> None:
        try:
            self._session.read(address)
        except PortError:
            self.left = -1
            raise
        self.left -= 1

    def _skippable(self, address: int, least: int, last: int) -> bool:
        """Whether nothing could tell if a poll before the last one were skipped.

        Args:
            address: where they are.
            least: how far apart they are at least (ps).
            last: when the last one is (ps).
        """
        selection, board = self._selection, self._board
        found = selection.steady(address)
        if found is None or (found[0] is not None and not found[0].TRACELESS):
            return False
        if selection.path is not None and selection.chip is not None:
            # One for which there is no room is played; a wire that moves may lead elsewhere.
            if least < selection.chip.cycle_ps or board.kernel.next_due <= last:
                return False
        if self.every_cycle or board.observers:
            return False
        return not (board.kernel.observed and selection.observed())

    def _skip(self, polls: int) -> None:
        """Count polls that are not run."""
        # The fast way of a lease: 200 polls take 3.5 us, one by one 150 us (tests/unit/board's
        # test_leases.py holds both equal).
        self._board.reads += polls
        if self._selection.chip is not None:
            self._selection.chip.reads += polls
        self.left -= polls
