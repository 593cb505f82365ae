"""Whether the machine can follow what moves on a board in real time, and how much it lacks."""

from collections.abc import Callable
from typing import Final

WINDOW_NS: Final = 1_000_000_000
"""Wall time over which chip time is compared with it, at least: five of the longest ticks."""
LONGEST_NS: Final = 2_500_000_000
"""A window that took longer has a stall of the machine in it, and is left out."""
SHORT: Final = 0.98
"""Part of the due chip time below which it is too little. 99 of 100 late wake-ups on a crowded
machine are within 6.4 ms, below 1 % of a window (docs/performance.md)."""


class Overload:
    """Compares how far chip time has come with how far it should have, and what that took.

    Time of the processor counts, not time that passes: a machine that others keep busy makes a
    board late, and not its moves. A stall lies in one window, and is made up for in the next: only
    a board that is short in two of them, one after the other, has too much to do.

    Attributes:
        times: how many times the machine that there is would be enough, by the latest windows; 0.0
            while it would keep up.
        worst: the most that was.
    """

    def __init__(self) -> None:
        self.times: float = 0.0
        self.worst: float = 0.0
        self._begun_ns: int = -1
        self._begun_ps: int = 0
        self._begun_spent: int = 0
        self._before: float = 0.0

    def begin(self) -> None:
        """Time has been set, or made to stand: what was counted counts no longer."""
        self._begun_ns = -1
        self._before = self.times = 0.0

    def __str__(self) -> str:
        return (
            "more moves than this machine can follow: chip time runs at"
            f" {100 / self.times:.0f} % of its rate at best, {self.times:.2f} times this machine"
            ' would be enough; let less move, choose a lower rate, or see in "vbus doctor" whether'
            " the core is compiled"
        )

    def look(
        self, now: int, wall_ns: int, spent_ns: Callable[[], int], ps_per_ns: tuple[int, int]
    ) -> bool:
        """Take into account how far time has come; return whether an overload begins.

        Args:
            now: chip time (ps).
            wall_ns: wall time (ns).
            spent_ns: tells how long the processor has worked for this board (ns).
            ps_per_ns: chip time that should pass with wall time, as a fraction.
        """
        took, came = wall_ns - self._begun_ns, now - self._begun_ps
        if self._begun_ns >= 0 and (took < WINDOW_NS or not came):
            return False
        short, begins, spent = 0.0, False, spent_ns()
        if self._begun_ns >= 0 and took <= LONGEST_NS:
            due = took * ps_per_ns[0] / ps_per_ns[1]
            needed = (spent - self._begun_spent) / took * due / came
            if came < due * SHORT and needed > 1.0:
                short = needed
            times = short if self._before else 0.0
            begins = times > 0.0 and self.worst == 0.0
            self.times = times
            self.worst = max(self.worst, times)
        self._begun_ns, self._begun_ps, self._begun_spent = wall_ns, now, spent
        self._before = short
        return begins
