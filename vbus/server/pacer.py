"""Wall time to chip time: the only file that reads the wall clock."""

import asyncio
import heapq
import time
from collections.abc import Callable
from fractions import Fraction
from math import isinf
from typing import Final

from vbus.board.board import Board
from vbus.kernel import MS, NEVER
from vbus.transports.linux import TimerFd

AHEAD: Final = 2 * MS
"""How far chip time may run ahead of the wall clock (ps)."""
TICK: Final = 10 * MS
"""How much chip time a lazy chip may owe before it is brought up to date (ps)."""
STALL: Final = 100 * MS
"""A gap between two looks at the wall clock beyond which the machine has stalled (ps)."""
SLICE: Final = 10 * MS
"""Chip time computed in one go; between slices the event loop answers others."""


class Pacer:
    """Moves a board's time with the wall clock.

    One anchor ties wall time to chip time and never moves, so nothing drifts; except with
    ``stall="slip"``, where the time of a stalled machine is left out, and reported.

    Lockstep and slaved boards are moved by their hosts; the pacer then does nothing.

    Args:
        board: the board.
        stall: ``"catch_up"``: after a stall of the machine chip time catches up in slices;
            ``"slip"``: it goes on where it was.
        clock: wall time in ns; for tests.
    """

    def __init__(
        self,
        board: Board,
        stall: str = "catch_up",
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        if stall not in ("catch_up", "slip"):
            raise ValueError(f"stall = {stall!r}: allowed are catch_up, slip")
        self.board: Board = board
        self.real: bool = board.policy == "realtime"
        self.free: bool = self.real and isinf(board.rate)
        """As fast as the machine can: no wall clock holds time back."""
        self.stall: str = stall
        self.lag: int = 0
        """How late chip time was (ps): at the latest wake-up, or after a slice of a stall."""
        self.worst_lag: int = 0
        self.slipped: int = 0
        """Chip time left out after stalls (ps)."""
        self._clock: Callable[[], int] = clock
        rate = Fraction(0 if not self.real or self.free else board.rate).limit_denominator(10**6)
        self._ps_per_ns: tuple[int, int] = (1000 * rate.numerator, rate.denominator)
        self._anchor_ns: int = clock()
        self._anchor_ps: int = board.now
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: TimerFd | None = None
        self._armed: int = NEVER
        self._tick_at: int = 0
        self._wakes: list[tuple[int, int, Callable[[], None]]] = []
        self._wake_number: int = 0
        if self.real and not self.free:
            board.limit = board.now + AHEAD

    # -- time ---------------------------------------------------------------------------------

    def wall(self) -> int:
        """Return the chip time that belongs to the present wall time (ps)."""
        numerator, denominator = self._ps_per_ns
        return self._anchor_ps + (self._clock() - self._anchor_ns) * numerator // denominator

    def catch_up(self) -> bool:
        """Bring the board to the present: before each look at it.

        Returns:
            Whether it is there; after a stall only one slice is computed at a time.
        """
        if not self.real or self.free:
            return True
        board = self.board
        wall = target = self.wall()
        behind = target - board.kernel.now
        if behind > STALL:
            if self.stall == "slip":
                self._anchor_ps -= behind
                self.slipped += behind
                wall = target = board.kernel.now
            else:
                target = board.kernel.now + SLICE
        board.limit = target + AHEAD
        if target > board.kernel.now:
            board.run_until(target)
        if behind <= STALL:
            return True
        self._note_lag(behind if self.stall == "slip" else wall - board.kernel.now)
        return self.stall == "slip"

    def _note_lag(self, lag: int) -> None:
        self.lag = lag
        if lag > self.worst_lag:
            self.worst_lag = lag

    # -- waking up ----------------------------------------------------------------------------

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin to move the board's time; wall time counts from here."""
        self._loop = loop
        self._anchor_ns = self._clock()
        self._anchor_ps = self.board.now
        if self.free:
            loop.call_soon(self._run_free)
        elif self.real:
            self._timer = TimerFd()
            loop.add_reader(self._timer.fd, self._woken)
            self._tick_at = self.board.now + TICK
            self.arm()

    def stop(self) -> None:
        """Let time stand still."""
        if self._timer is not None:
            if self._loop is not None:
                self._loop.remove_reader(self._timer.fd)
            self._timer.close()
            self._timer = None
        self._loop = None

    def wake_at(self, instant: int, callback: Callable[[], None]) -> None:
        """Call back when the wall clock allows chip time ``instant`` (ps)."""
        if instant < NEVER:
            self._wake_number += 1
            heapq.heappush(self._wakes, (instant - AHEAD, self._wake_number, callback))
            self.arm()

    def arm(self) -> None:
        """Set the timer to the earliest of: next watched edge, next wake-up, next tick."""
        if self._timer is None:
            return
        due = min(self.board.next_due(), self._tick_at)
        if self._wakes:
            due = min(due, self._wakes[0][0])
        if due != self._armed:
            self._armed = due
            numerator, denominator = self._ps_per_ns
            wait = -(-(due - self.wall()) * denominator // numerator) if numerator else 10**9
            self._timer.set(max(1, wait))

    def touched(self) -> None:
        """A host has been served: an edge may be due earlier now."""
        if self.board.kernel.next_due < self._armed:
            self.arm()

    def _woken(self) -> None:
        if self._timer is not None:
            self._timer.acknowledge()
        if self._armed != NEVER:
            self._note_lag(max(0, self.wall() - self._armed))
        self._armed = NEVER
        there = self.catch_up()
        now = self.board.now
        while self._wakes and self._wakes[0][0] <= now:
            heapq.heappop(self._wakes)[2]()
        if now >= self._tick_at or not there:
            self.board.catch_up()
            self._tick_at = now + (TICK if there else 0)
        self.arm()

    def _run_free(self) -> None:
        """Run one slice of chip time, then let the event loop serve the hosts."""
        if self._loop is not None:
            self.board.run_until(self.board.now + SLICE)
            self.board.catch_up()
            self._loop.call_soon(self._run_free)
