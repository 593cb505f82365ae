"""What the motors of a board do: where they are once in a millisecond, and the moves in that."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from vbus.board.board import Board
from vbus.core.kernel import MS

STEP: Final = MS
"""How often an axis is looked at (ps)."""
# 20 ms: an axis that overshoots turns round in less, and a driver's pause between moves is longer.
REST: Final = 20
"""Looks at an axis that stands, after which its move is over."""
# An encoder at rest on an edge shows one count to either side.
NOISE: Final = 2
"""Counts that are no motion."""


@dataclass(frozen=True, slots=True)
class Move:
    """An axis from one rest to the next.

    Attributes:
        begin: instant of the last look at which it stood (ps).
        path: position at that look, and at each after it until it stands again, in counts.
    """

    begin: int
    path: tuple[int, ...]

    @property
    def duration(self) -> int:
        """How long it took (ps)."""
        return (len(self.path) - 1) * STEP

    @property
    def overshoot(self) -> int:
        """How far beyond its end it was (counts)."""
        first, last = self.path[0], self.path[-1]
        return max(max(self.path) - last if last >= first else last - min(self.path), 0)


@dataclass(frozen=True, slots=True)
class AxisCourse:
    """What an axis did in a run.

    Attributes:
        moves: in their order.
        final: position at the last look (counts).
        peak_error: greatest position error its chip knew at a look, without sign (counts).
    """

    moves: tuple[Move, ...]
    final: int
    peak_error: int


def moves_of(counts: Sequence[int]) -> Iterator[Move]:
    """Give the moves in where an axis was, look by look."""
    stood = counts[0] if counts else 0  # where it was when it last was in motion
    begun = -1
    moved = 0
    for look, count in enumerate(counts):
        if abs(count - stood) > NOISE:
            # The move begins where it still stood: the look before.
            begun = look - 1 if begun < 0 else begun
            stood, moved = count, look
        elif begun >= 0 and look - moved >= REST:
            yield Move(begun * STEP, tuple(counts[begun : moved + 1]))
            begun = -1
    if begun >= 0:
        yield Move(begun * STEP, tuple(counts[begun : moved + 1]))


class Motion:
    """Looks at the axes of a board once in a millisecond, from now on.

    Args:
        board: a board at instant 0.
    """

    def __init__(self, board: Board) -> None:
        self._board: Board = board
        self._counts: dict[str, list[int]] = {axis: [] for axis in board.axes}
        """Where each axis was, look by look."""
        self._errors: dict[str, int] = dict.fromkeys(board.axes, 0)
        self._timer = board.kernel.onlooker(self._look)
        self._look()

    def _look(self) -> None:
        board = self._board
        for chip in board.chips:
            values = chip.telemetry()  # its plants are up to date after that
            for axis, counts in self._counts.items():
                name, _, number = axis.rpartition(".")
                if name != chip.name:
                    continue
                counts.append(board.axes[axis].count)
                row = chip.VALUES.lane("error")
                error = values[row.key.format(number)] if row is not None else 0
                self._errors[axis] = max(self._errors[axis], abs(int(error)))
        self._timer.at(board.now + STEP)

    def stop(self) -> dict[str, AxisCourse]:
        """Look no more; return what each axis did, by its name, as ``"x.1"``."""
        self._timer.cancel()
        return {
            axis: AxisCourse(tuple(moves_of(counts)), counts[-1], self._errors[axis])
            for axis, counts in self._counts.items()
        }
