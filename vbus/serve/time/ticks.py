"""How often lazy chips are brought up to date in real time."""

from typing import Final

from vbus.core.kernel import MS

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
a host that asks it waits for what it owes. Of many, all are looked after as their mean has it: few long
visits take less than many short ones, since each finds what it works on far from the processor."""
RESTING_NS: Final = 20_000
"""A round of all chips that takes less: boards at rest are left alone."""


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
