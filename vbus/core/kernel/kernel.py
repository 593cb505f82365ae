"""Virtual time and the queue of what is due."""

from collections.abc import Callable
from heapq import heappop, heappush
from typing import ClassVar

from mypy_extensions import i64, mypyc_attr

from vbus.core.instants import END, NEVER
from vbus.core.state import Names


@mypyc_attr(allow_interpreted_subclasses=True)
class Task:
    """Something to be done at this same instant: see :meth:`Kernel.soon`."""

    def run(self) -> None:
        """Do it."""
        raise NotImplementedError


class Timer:
    """One callback that can be set to one instant; made by :meth:`Kernel.timer`."""

    STATE: ClassVar[Names] = ("due",)
    DERIVED: ClassVar[Names] = ("queued",)

    def __init__(
        self, kernel: "Kernel", rank: int, callback: Callable[[], None], saved: bool, looks: bool
    ) -> None:
        self.kernel: Kernel = kernel
        self.rank: int = rank
        self.callback: Callable[[], None] = callback
        self.due: i64 = NEVER
        self.queued: i64 = NEVER
        """An instant for which the kernel's queue has this timer; NEVER: it may have none."""
        self.saved: bool = saved
        self.looks: bool = looks

    def at(self, when: i64) -> None:
        """Set the timer to instant ``when`` (ps); an earlier setting is forgotten."""
        # Chips set their timer after every access, mostly to the instant it has.
        if when == self.due:
            return
        if when < self.kernel.now:
            raise ValueError(f"instant {when} ps is past; it is {self.kernel.now} ps now")
        # What the queue holds for other instants stays there, and is passed over when it comes up.
        self.due = when
        # One that is cancelled, and set to the same instant again, still stands there.
        if when != NEVER and when != self.queued:
            self.queued = when
            self.kernel.push(when, self.rank, self.looks)

    def cancel(self) -> None:
        """Forget the setting."""
        self.due = NEVER


class Kernel:
    """Virtual time of one board, in integer picoseconds, and the timers that are set.

    Timers due at the same instant run in the order in which they were *made*, which is the order
    of the board file. Nothing depends on the order in which they were set.
    """

    STATE: ClassVar[Names] = ("now", "dues: list[i64]")
    WIRING: ClassVar[Names] = ("_timers", "observed", "observations")
    DERIVED: ClassVar[Names] = (
        "_done", "_heap", "_instant", "_looks", "_waiting", "batch", "next_due", "next_stop",
    )  # fmt: skip

    def __init__(self) -> None:
        self.now: i64 = 0
        self.next_due: i64 = NEVER
        """When the board does something next: what may be promised to hosts."""
        self.next_stop: i64 = NEVER
        """The same, or when an onlooker looks, if that comes first."""
        self.batch: i64 = 0
        """Number of the batch of changes under way: what moves in one batch moves together."""
        self.observed: int = 0
        """Number of observers on nets; while it is 0, bus strobes are not played."""
        self.observations: int = 0
        """How many have ever sat on nets. Who looks on leaves traces in saved states (when the
        last strobe was seen), never in replies, instants or findings."""
        self._heap: list[tuple[int, int]] = []
        self._looks: list[tuple[int, int]] = []
        self._timers: list[Timer] = []
        self._instant: list[Task] = []
        self._done: int = 0
        self._waiting: bool = False

    def timer(self, callback: Callable[[], None], saved: bool = True) -> Timer:
        """Make a timer. Its place among timers of one instant is its place of making.

        One that is not ``saved`` is no part of the board: it belongs to an observer.
        """
        timer = Timer(self, len(self._timers), callback, saved, False)
        self._timers.append(timer)
        return timer

    def onlooker(self, callback: Callable[[], None]) -> Timer:
        """Make a timer of an observer, which changes nothing.

        It runs after all that the board does at its instant, and no lease of a host ends by it:
        hosts are promised the same with observers and without.
        """
        timer = Timer(self, len(self._timers), callback, False, True)
        self._timers.append(timer)
        return timer

    def push(self, when: i64, rank: int, looks: bool) -> None:
        """Queue the timer ``rank``; for :class:`Timer` only."""
        # Two queues: what only looks must not shorten what hosts are promised.
        if looks:
            heappush(self._looks, (when, rank))
        else:
            heappush(self._heap, (when, rank))
            if when < self.next_due:
                self.next_due = when
        if when < self.next_stop:
            self.next_stop = when

    def _find_next(self) -> None:
        """A queue has lost its head."""
        heap, looks = self._heap, self._looks
        self.next_due = heap[0][0] if heap else NEVER
        self.next_stop = self.next_due
        if looks and looks[0][0] < self.next_stop:
            self.next_stop = looks[0][0]

    def soon(self, task: Task) -> None:
        """Run ``task`` at this same instant, after what is running now has returned."""
        self._instant.append(task)
        self._waiting = True

    @property
    def last(self) -> bool:
        """Whether what runs now is the last of what :meth:`soon` asked for."""
        return self._done >= len(self._instant)

    def settle(self) -> None:
        """Run what :meth:`soon` asked for, in order, and close the batch of changes."""
        if self._waiting:
            queue = self._instant
            # Tasks may ask for more: the list grows meanwhile.
            while self._done < len(queue):
                task = queue[self._done]
                self._done += 1
                task.run()
            self._forget()
        # Levels that moved up to here have moved together.
        self.batch += 1

    def _forget(self) -> None:
        self._instant.clear()
        self._done = 0
        self._waiting = False

    def run_until(self, when: i64) -> None:
        """Let time pass to instant ``when`` (ps), inclusive of everything due at it.

        Raises:
            ValueError: ``when`` is before now, or beyond the end of time.
        """
        if when < self.now:
            raise ValueError(f"time does not run backwards: now {self.now} ps, asked {when} ps")
        if when > END:
            raise ValueError(f"time ends at {END} ps, asked {when} ps")
        self.settle()
        while self.next_stop <= when:
            # The board before an onlooker: that sees what has come of the instant.
            own = self.next_due == self.next_stop
            due, rank = heappop(self._heap if own else self._looks)
            self._find_next()
            timer = self._timers[rank]
            if timer.queued == due:
                timer.queued = NEVER
            # Else it was cancelled, or set to another instant since.
            if timer.due == due:
                # Before the callback, which may set it again.
                timer.due = NEVER
                self.now = due
                timer.callback()
                self.settle()
        self.now = when

    def pass_to(self, when: i64) -> None:
        """Let time pass to an instant of a bus cycle, which is not before now (ps).

        If nothing is due by then, the batch of changes stays open.
        """
        if self.next_stop > when:
            self.now = when
        else:
            self.run_until(when)

    def run_for(self, duration: int) -> None:
        """Let ``duration`` ps pass."""
        now: int = self.now
        self.run_until(now + duration)

    @property
    def dues(self) -> list[int]:
        """What every timer of the board is set to. Loading forgets what waits at this instant."""
        return [timer.due for timer in self._timers if timer.saved]

    @dues.setter
    def dues(self, dues: list[int]) -> None:
        self._forget()
        # What moves from here on does not move together with what moved before.
        self.batch += 1
        self._heap = []
        self._looks = []
        self.next_due = self.next_stop = NEVER
        for timer, due in zip([one for one in self._timers if one.saved], dues, strict=True):
            timer.due = due
            if due != NEVER:
                self.push(due, timer.rank, timer.looks)
        for timer in self._timers:
            # Timers of observers go on, at once if their instant has passed.
            if not timer.saved and timer.due != NEVER:
                timer.due = max(timer.due, self.now)
                self.push(timer.due, timer.rank, timer.looks)
            timer.queued = timer.due
