"""A board computed in slices of wall time, however many chips move on it."""

from collections.abc import Callable
from typing import Final

from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.core.kernel import MS, NEVER, US

SLICE_NS: Final = 20_000_000
"""Wall time of a slice; between two of them hosts are served and Ctrl-C is heard. What is begun is
finished: one chip brought up to date, or one stretch of :data:`SHORTEST`."""
FIRST: Final = 10 * MS
"""Chip time run in one go on a board of unknown speed; not measured."""
SHORTEST: Final = 20 * US
LONG_NS: Final = 5_000_000
SHORT_NS: Final = 1_000_000
"""Stretches that take longer are halved, shorter ones doubled; four of the longest fill a slice."""


class TimeSlicer:
    """Moves a board and brings its lazy chips up to date, a slice at a time.

    Args:
        board: the board.
        clock: wall time (ns).
    """

    def __init__(self, board: Board, clock: Callable[[], int]) -> None:
        self._board: Board = board
        self._clock: Callable[[], int] = clock
        self.open: bool = False
        """Whether some chips have been brought up to date and others have not."""
        self.took: int = 0
        """Wall time of the round of chips under way, or of the one before (ns)."""
        self.begun: int = 0
        """Chip time at which that round began (ps)."""
        self.moving: int = 0
        """How many chips it brings up to date: those that do not rest."""
        self._awake: list[Chip] = []
        self._next: int = 0
        self._stretch: int = FIRST

    def run(self, target: int) -> bool:
        """Let time pass to ``target`` (ps); return whether it got there within the slice."""
        board, clock = self._board, self._clock
        began = now = clock()
        while True:
            end = min(target, board.now + self._stretch)
            board.pass_until(end)
            before, now = now, clock()
            if now - before > LONG_NS:
                self._stretch = max(self._stretch // 2, SHORTEST)
            elif now - before < SHORT_NS:
                self._stretch = min(self._stretch * 2, NEVER // 4)
            if end == target:
                return True
            if now - began >= SLICE_NS:
                return False

    def catch_up(self, most: int = SLICE_NS) -> bool:
        """Bring lazy chips up to now, beginning where the last slice ended.

        Chips at rest are left alone: thousands of them cost next to nothing.

        Args:
            most: wall time after which the rest is left to the next slice (ns).

        Returns:
            Whether all chips have been brought up to where time was when the round began.
        """
        board, clock = self._board, self._clock
        if not self.open:
            self.open, self.took, self._next, self.begun = True, 0, 0, board.now
            self._awake = [chip for chip in board.chips if not chip.resting()]
            self.moving = len(self._awake)
        chips = self._awake
        began = clock()
        while self._next < len(chips):
            chips[self._next].advance()
            self._next += 1
            if clock() - began >= most and self._next < len(chips):
                self.took += clock() - began
                return False
        self.open = False
        board.settled(self.begun)
        self.took += clock() - began
        return True
