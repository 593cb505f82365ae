"""Wall time to chip time: the only file that reads the wall clock."""

import asyncio
import heapq
import logging
import time
from collections.abc import Callable
from fractions import Fraction
from math import isinf
from typing import Final

from mypy_extensions import i64, mypyc_attr

from vbus.board.board import Board
from vbus.core.errors import TimeEndedError
from vbus.core.kernel import END, FAR, MS, NEVER, SECOND
from vbus.core.wall_clock import monotonic_ns
from vbus.serve.time.overload import Overload
from vbus.serve.time.statistics import LAG_PS, Histogram
from vbus.serve.time.time_slicer import SLICE_NS, TimeSlicer
from vbus.transports.base import ignore
from vbus.transports.linux import TimerFd

TICK: Final = 10 * MS
"""How much chip time a lazy chip may owe before it is brought up to date (ps), at rate 1."""
SHORTEST_TICK: Final = 5 * MS
LONGEST_TICK: Final = 200 * MS
"""The longest tick of a board that moves: 8,180 axes on a core with it, 7,770 with 100 ms, 7,100
with 50 ms, 6,870 with 25 ms (docs/performance.md)."""
WATCHED_TICK: Final = 50 * MS
"""The longest tick while the board is observed: watchers get news as often."""
RESTING_TICK: Final = 1_000 * MS
"""The longest tick while nothing moves, no observer is there and no host asks: a board at rest
wakes the machine once a second."""
CHEAP_NS: Final = 50_000
DEAR_NS: Final = 200_000
"""A chip that is brought up to date in less or more than this is looked after less or more often:
a host that asks waits for what it owes. Of many, all are looked after as their mean has it: few
long visits take less than many short ones, since each finds what it works on far from the
processor."""
RESTING_NS: Final = 20_000
"""A round of all chips that takes less: boards at rest are left alone."""
_WEEKS_NS: Final = 1 << 51
_USUAL: Final = 1 << 10
"""Chip time that passes in less wall time, at such a rate, is no more than 2^61 ps."""


def chip_time(elapsed: int, ps_per_ns: tuple[int, int]) -> int:
    """Return the chip time (ps) that passes in ``elapsed`` wall time (ns), at a rate as a fraction.

    At the rate 1, and at whole parts of it, in machine words for the first 26 days.
    """
    numerator, denominator = ps_per_ns
    if elapsed >= _WEEKS_NS or numerator >= _USUAL:
        return elapsed * numerator // denominator
    ns: i64 = elapsed
    passed: i64 = ns * numerator // denominator
    return passed


@mypyc_attr(allow_interpreted_subclasses=True)
class TimeSource:
    """Time as a session knows it; by itself that of chips elsewhere, which no pacer here moves.

    Args:
        clock: wall time in ns; for tests.
    """

    def __init__(self, clock: Callable[[], int] = monotonic_ns) -> None:
        self.clock: Callable[[], int] = clock
        """Wall time (ns)."""
        self.real: bool = True
        """Whether time runs on whatever hosts do."""
        self.halted: bool = False
        """Whether time stands still, and what hosts ask for is held for later."""

    @property
    def now(self) -> int:
        """Chip time (ps); 0 where that is not known."""
        return 0

    def catch_up(self) -> bool:
        """Bring the chips to the present; tell whether they are there."""
        return True

    def served(self) -> None:
        """A host has been served."""

    def wake_at(self, instant: int, callback: Callable[[], None]) -> None:
        """Call back when chip time may run to ``instant`` (ps)."""

    def forget(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` no more."""


class Tick:
    """The time between two rounds in which lazy chips are brought up to date.

    Attributes:
        span: how long it is now (ps).
        longest: the longest while anything moves (ps).
    """

    def __init__(self) -> None:
        self._scale: int = 1
        self.span: int = TICK
        self.longest: int = LONGEST_TICK

    def scale(self, scale: int) -> None:
        """Let chip time run so many times as fast as the wall clock: begin anew."""
        self._scale = scale
        self.longest = LONGEST_TICK * scale
        self.begin()

    def begin(self) -> None:
        """What was at rest may move by now."""
        self.span = TICK * self._scale

    @property
    def visit(self) -> int:
        """Chip time worth computing in one go after a stall, at any rate (ps)."""
        return min(self.span, self.longest) // self._scale

    def adapt(self, took: int, chips: int, watched: bool) -> None:
        """Take a round into account.

        Args:
            took: wall time of it (ns).
            chips: how many were brought up to date.
            watched: whether the board is observed.
        """
        each = took // max(chips, 1)
        if each < CHEAP_NS:
            self.span *= 2
        elif each > DEAR_NS:
            self.span = max(self.span // 2, SHORTEST_TICK * self._scale)
        most = RESTING_TICK if took < RESTING_NS else LONGEST_TICK
        self.span = min(self.span, (WATCHED_TICK if watched else most) * self._scale)


AHEAD: Final = 2 * MS
"""How far chip time may run ahead of the wall clock (ps). It trades sleeps of hosts with short
DELAYs for how early a host may see an edge."""
STALL: Final = 100 * MS
"""A gap between two looks at the wall clock beyond which the machine has stalled (ps, rate 1). The
worst wake-up of a server on a crowded machine was 31 ms (docs/performance.md)."""
SLICE: Final = 10 * MS
"""Chip time computed in one go; between slices the event loop answers others."""
PIECE_NS: Final = 1_000_000
"""Wall time for which chips are brought up to date in one go in real time. Hosts wait for it, but
long visits cost less: a chip's memory is far away at first (docs/performance.md)."""
FREE_NS: Final = 1_000_000
"""Wall time of a slice where nothing holds time back, as far as that can be known before. With it
``--rate max`` has 0.95 of the core alone (docs/performance.md), and a host waits no longer."""
FREE_SLICE: Final = 10 * SECOND
"""Chip time of the longest of these: it bounds the jump of a board at rest."""
LEASE: Final = 20 * MS
"""Chip time by which a host that is master of time may move it in one go; more is sliced. It trades
turns of the event loop for how long other hosts wait."""
DAY: Final = 24 * 3600 * SECOND
"""How long before the end of time a warning says that it comes near (ps)."""

log = logging.getLogger("vbus")


@mypyc_attr(allow_interpreted_subclasses=True)
class WallClockPacer(TimeSource):
    """Moves a board's time with the wall clock.

    One anchor ties wall time to chip time and never moves, so nothing drifts; except with
    ``stall="slip"``, where the time of a stalled machine is left out, and reported.

    Lockstep and slaved boards are moved by their hosts. The pacer then sees to it that a long
    DELAY is computed in slices, so that other hosts, and Ctrl-C, are answered meanwhile.

    The time of a node is shared with the other nodes. In real time all count from one epoch; else
    the nodes grant time to each other, and the pacer wakes hosts when a grant comes.

    Args:
        board: the board.
        stall: ``"catch_up"``: after a stall of the machine chip time catches up in slices;
            ``"slip"``: it goes on where it was.
        clock: wall time in ns; for tests.
        spent: time of the processor in ns, of the thread that serves the board; for tests.
        epoch: when chip time is 0, by ``clock`` (ns); -1: time goes on from :meth:`start`.
    """

    def __init__(
        self,
        board: Board,
        stall: str = "catch_up",
        clock: Callable[[], int] = monotonic_ns,
        spent: Callable[[], int] = time.thread_time_ns,
        epoch: int = -1,
    ) -> None:
        if stall not in ("catch_up", "slip"):
            raise ValueError(f"stall = {stall!r}: allowed are catch_up, slip")
        super().__init__(clock)
        self.board: Board = board
        self.real = board.policy == "realtime"
        self.free: bool = self.real and isinf(board.rate)
        """As fast as the machine can: no wall clock holds time back."""
        self.stall: str = stall
        self.lag: int = 0
        """How late chip time was (ps): at the latest wake-up, or after a slice of a stall."""
        self.worst_lag: int = 0
        self.slipped: int = 0
        """Chip time left out after stalls (ps)."""
        self.lags: Histogram = Histogram(LAG_PS)
        """Every lag noted."""
        self._ps_per_ns: tuple[int, int] = (0, 1)
        self._scale: int = 1
        self._stalled: int = STALL
        self._tick: Tick = Tick()
        self._spent: Callable[[], int] = spent
        self.overload: Overload = Overload()
        """How much more than the machine can follow moves on the board."""
        self._paced: bool = False
        self._last: int = END
        """Time is moved no further than this (ps); hosts may be ahead of it."""
        self._use_rate()
        self._slice: int = SLICE
        self._slicing: bool = False
        self._slices: TimeSlicer = TimeSlicer(board, clock)
        self._epoch: int = epoch
        self._anchor_ns: int = clock()
        self._anchor_ps: int = board.now
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: TimerFd | None = None
        self._armed: int = NEVER
        self._asleep: int = 0
        self._hosts_until: int = 0
        """Until then (wall time, ns) hosts are served, and the chips stay behind."""
        self._tick_at: int = 0
        self._wakes: list[tuple[int, int, Callable[[], None]]] = []
        self._wake_number: int = 0
        self.on_moved: Callable[[], None] | None = None
        """Called on a node when a host has acted or waits, or time has run: edges may be under way,
        and other nodes may have to run on."""
        self.look_for_hosts: Callable[[], None] = ignore
        """Ends the sessions of hosts that have gone while they waited: no time passes for them."""
        self.report: Callable[[str], None] = log.warning
        """Takes the sentence that time comes near its end."""
        self.on_end: Callable[[], None] = ignore
        """Called when time has ended on a board that only the pacer moves."""
        self.over: bool = False
        """Whether that is so."""
        self._near: int = END - DAY
        """Beyond this instant there is something to tell or to stop (ps)."""
        self.bound: int = NEVER
        """The controller of the board lets time run no further (ps); NEVER without a controller."""
        self.on_bound: Callable[[], None] = ignore
        """Called when time is there: moves the bound, or halts."""

    def _use_rate(self) -> None:
        """Take the board's rate."""
        self.free = self.real and isinf(self.board.rate)
        self._paced = self.real and not self.free
        rate = Fraction(self.board.rate if self._paced else 0).limit_denominator(10**6)
        self._ps_per_ns = (1000 * rate.numerator, rate.denominator)
        # What is meant in wall time grows with the rate; chip time computed at a time does not
        # shrink with it.
        self._scale = max(1, self._ps_per_ns[0] // (1000 * self._ps_per_ns[1]))
        self._stalled = STALL * self._scale
        self._tick.scale(self._scale)
        self._last = END - AHEAD if self._paced else END

    # -- time ---------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        """Chip time (ps)."""
        return self.board.now

    def wall(self) -> int:
        """Return the chip time that belongs to the present wall time (ps)."""
        return self._anchor_ps + chip_time(self.clock() - self._anchor_ns, self._ps_per_ns)

    def catch_up(self) -> bool:
        """Bring the board to the present: before each look at it.

        Returns:
            Whether it is there; after a stall only one slice is computed at a time.
        """
        board = self.board
        kernel = board.kernel
        if self.bound < NEVER:
            return self._catch_up_to_bound()
        if not self._paced:
            if board.granted:
                return True
            lease: int = kernel.now + LEASE
            board.limit = lease if lease <= self._near else self._nearing(lease)
            return True
        target = self.wall()
        if target > FAR and target > self._near:
            target = self._nearing(target)
        if target - kernel.now > self._stalled and target - self._asleep > self._stalled:
            return self._recover(target)
        if self._slices.open and target - self._slices.begun > self._stalled + self._tick.span:
            return False  # more moves than the machine can follow: time waits for the chips
        board.limit = target + AHEAD
        if kernel.next_stop > target >= kernel.now:
            kernel.now = target
        elif target > kernel.now and not self._run(target):
            return False
        return True

    def _run(self, target: int, present: bool = True) -> bool:
        """Compute a slice towards ``target`` (ps); return whether the board is at the present.

        While it is not, hosts have as much of the processor as the chips: with a slice for each
        message a host waits for the slices of all others, of 300 for 6 s.

        Args:
            target: the instant.
            present: whether that is the present.
        """
        began = self.clock()
        if began >= self._hosts_until:
            if self._slices.run(target) and present:
                return True
            now = self.clock()
            self._hosts_until = now + now - began
        self.board.limit = self.board.kernel.now + AHEAD
        return False

    # -- controlled by another part ------------------------------------------------------------

    def halt(self) -> None:
        """Let time stand still from now on."""
        self.halted = True
        self.bound = self.board.limit = self.board.now

    def confine(self, bound: int) -> None:
        """Let time run on, to ``bound`` at most (ps); NEVER: as ever."""
        self.halted = False
        self.bound = bound
        self.jumped()
        if self.free:
            self._slice_soon()

    def set_rate(self, rate: float) -> None:
        """Let chip time run at another rate from now on, on a board in real time.

        Args:
            rate: chip seconds per wall second; ``inf`` is as fast as possible.
        """
        self.board.rate = rate
        self._use_rate()
        if self._paced and self._timer is None and self._loop is not None:
            self._use_timer(self._loop)
        if not self.halted:
            self.confine(self.bound)

    def _catch_up_to_bound(self) -> bool:
        """Bring the board to the present, or as far as its controller lets it come."""
        board = self.board
        began = self.clock()
        present, ahead = board.now, LEASE
        there = True
        while there and not self.halted:
            if self._paced:
                present, ahead = min(self.wall(), self.bound, self._last), AHEAD
            if present > board.now:
                there = self._slices.run(present)
            if board.now < self.bound:
                break
            self.on_bound()
            there = there and self.clock() - began < SLICE_NS
        board.limit = self._within(present + ahead)
        return there

    def _within(self, instant: int) -> int:
        """Return how far towards ``instant`` hosts may let time run (ps).

        Not to the bound itself: there the controller looks before any host goes on.
        """
        return max(min(instant, self.bound - 1, END), int(self.board.now))

    def _nearing(self, target: int) -> int:
        """Time comes near its end: tell people once; return how far towards ``target`` it goes."""
        if self._near < self._last:
            self._near = self._last
            self.report(
                f"board {self.board.name}: chip time ends at {END} ps, 106 days after power-on;"
                " less than a day is left"
            )
        if target <= self._last:
            return target
        if self.real and not self.over:
            self.over = True
            self.on_end()
        return self._last

    def check_over(self) -> None:
        """Say so if time has ended.

        Raises:
            TimeEndedError: it has, on a board that only the pacer moves.
        """
        if self.over:
            raise TimeEndedError(
                f"board {self.board.name} has ended: chip time ends at {END} ps, and it is there"
            )

    def _recover(self, wall: int) -> bool:
        """Go on after a stall; tell whether the board is at the present."""
        board = self.board
        if self._slices.open:
            return False
        now = board.kernel.now
        if self.stall == "slip":
            now = max(now, self._asleep)
            behind = wall - now
            self._anchor_ps -= behind
            self.slipped += behind
            self._note_lag(behind)
            board.limit = now + AHEAD
            return True
        self._run(now + max(SLICE, self._tick.visit), present=False)
        self._note_lag(wall - board.kernel.now)
        return False

    def _note_lag(self, lag: int) -> None:
        self.lag = lag
        self.lags.note(lag)
        self.worst_lag = max(self.worst_lag, lag)

    def jumped(self) -> None:
        """The board's time has been set: it goes on from there, with the wall clock as it is.

        What was to be woken at instants of before is woken now, and asks again.
        """
        self._anchor_ns, self._anchor_ps = self.clock(), self.board.now
        self._slices.open = False
        self._asleep = 0
        self.overload.begin()
        self._tick_at = self.board.now + self._tick.span
        self._armed = NEVER
        self._hold()
        wakes, self._wakes = sorted(self._wakes), []
        while wakes and not self.halted:
            wakes.pop(0)[2]()
        self._wakes += wakes
        heapq.heapify(self._wakes)
        self.arm()

    # -- waking up ----------------------------------------------------------------------------

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin to move the board's time; wall time counts from here, or from the epoch."""
        self._loop = loop
        if self.board.granted:
            return
        self._anchor_ns, self._anchor_ps = self.clock(), self.board.now
        if self._epoch >= 0:
            self._anchor_ns, self._anchor_ps = self._epoch, 0
        self.board.sliced = not self.real
        self._hold()
        if self.free:
            self._slice_soon()
        elif self.real:
            self._use_timer(loop)
            self._tick_at = self.board.now + self._tick.span
            self.arm()

    def _use_timer(self, loop: asyncio.AbstractEventLoop) -> None:
        self._timer = TimerFd()
        loop.add_reader(self._timer.fd, self._woken)

    def _hold(self) -> None:
        """Let hosts move time no further than the wall clock has it, or than one slice."""
        self.board.limit = self._within(self.board.now + (AHEAD if self._paced else LEASE))

    def stop(self) -> None:
        """Let time stand still."""
        self.board.sliced = False
        timer, self._timer = self._timer, None
        loop, self._loop = self._loop, None
        if timer is not None and loop is not None:
            loop.remove_reader(timer.fd)
            timer.close()

    def wake_at(self, instant: int, callback: Callable[[], None]) -> None:
        """Call back when chip time may run to ``instant`` (ps)."""
        if instant < NEVER:
            self._wake_number += 1
            # A host may be so far ahead of the wall clock (`catch_up`): it is woken as early.
            when = instant - AHEAD if self._paced else instant
            if not self._wakes:
                self._slice = SLICE  # what was at rest the last time may move by now
            heapq.heappush(self._wakes, (when, self._wake_number, callback))
            if self._paced:
                self.arm()
            elif not self.board.granted:
                self._slice_soon()
            elif self.on_moved is not None:
                self.on_moved()

    def forget(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` no more: its session has gone."""
        self._wakes = [wake for wake in self._wakes if wake[2] != callback]
        heapq.heapify(self._wakes)

    def arm(self) -> None:
        """Set the timer to the earliest of: next watched edge, next wake-up, next tick."""
        if not self._paced or self.halted:
            return
        due = min(self.board.next_due(), self._tick_at, self.bound)
        if self._wakes:
            due = min(due, self._wakes[0][0])
        self._asleep = due
        if due != self._armed and self._timer is not None:
            self._armed = due
            numerator, denominator = self._ps_per_ns
            # Rounded up: a timer that fires early finds nothing due, and is set again.
            wait = -(-(due - self.wall()) * denominator // numerator) if numerator else 10**9
            self._timer.set(max(1, wait))

    def served(self) -> None:
        """A host has been served: an edge may be due earlier now."""
        if self._tick.span > self._tick.longest:
            self._tick.begin()
            self._tick_at = min(self._tick_at, self.board.now + self._tick.span)
            self.arm()
        elif self.board.kernel.next_due < self._armed:
            self.arm()
        if self.on_moved is not None:
            self.on_moved()

    def shift(self, ns: int) -> None:
        """Follow a clock that drifts: the epoch was ``ns`` later than assumed."""
        self._anchor_ns += ns

    def grant_came(self) -> None:
        """The nodes let time run further: go on with the sessions that waited for it."""
        if self.board.limit > self._near:
            self._nearing(self.board.limit)
        self._wake(self.board.limit)

    def _woken(self) -> None:
        if self._timer is not None:
            self._timer.acknowledge()
        # The tick is the chips' turn, however many hosts ask.
        self._hosts_until = 0
        if self.halted or not self._paced:
            return
        if self._armed != NEVER:
            self._note_lag(max(0, self.wall() - self._armed))
        self._armed = NEVER
        there = self.catch_up()
        now = self.board.now
        # Not at `now`: hosts may have run ahead of the wall clock.
        self._wake(self.board.limit - AHEAD)
        if now >= self._tick_at or not there:
            slices = self._slices
            self._tick_at = now
            if slices.catch_up(PIECE_NS):
                watched = bool(self.board.observers or self.board.listeners)
                self._tick.adapt(slices.took, slices.moving, watched)
                if there:
                    self._tick_at = max(now, slices.begun + self._tick.span)
        if self.bound == NEVER and not self._slices.open:
            wall = self.clock()
            if self.overload.look(now, wall, self._spent, self._ps_per_ns):
                self.report(f"board {self.board.name}: {self.overload}")
        self.arm()
        if self.on_moved is not None:
            self.on_moved()

    def _wake(self, now: int) -> None:
        while not self.halted and self._wakes and self._wakes[0][0] <= now:
            heapq.heappop(self._wakes)[2]()

    # -- where no wall clock holds time back ----------------------------------------------------

    def _slice_soon(self) -> None:
        if self._loop is not None and not self._slicing:
            self._slicing = True
            self._loop.call_soon(self._run_slice)

    def _run_slice(self) -> None:
        """Compute one slice of chip time, then let the event loop serve the hosts.

        Time moves by itself on a board without limit; else only as far as a held host asks.
        """
        self._slicing = False
        if self._loop is None:
            return
        self.look_for_hosts()
        if self.halted or not (self._wakes or self.free):
            return
        board = self.board
        most: int = board.stride()  # a slice may be longer than a machine word is
        target = board.now + min(self._slice, most)
        if target > self._near:
            target = self._nearing(target)
        target = min(target, self.bound)
        if not self.free:
            target = min(target, self._wakes[0][0])
        slices, began = self._slices, self.clock()
        there = True
        if target > board.now and not slices.open:
            there = slices.run(target)
        ran = self.clock() - began
        if board.now >= self.bound:
            self.on_bound()
        if slices.catch_up():
            board.limit = self._within(board.now + LEASE)
            if self.free and not slices.moving:
                self._slice = SLICE  # no host has asked for a day of rest
            elif there:
                self._adapt_slice(ran + slices.took, FREE_NS if self.free else SLICE_NS)
            self._wake(board.now)
        if not self.halted and ((self.free and not self.over) or self._wakes):
            self._slice_soon()

    def _adapt_slice(self, took: int, most: int) -> None:
        """A day of rest costs nothing, a second of a hundred moving axes does."""
        if took < most // 4:
            self._slice = min(self._slice * 2, FREE_SLICE) if self.free else self._slice * 2
        elif took > most:
            self._slice = max(self._slice // 2, SLICE)
