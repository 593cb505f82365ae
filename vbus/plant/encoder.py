"""The encoder on a motor's shaft, and plants that have one."""

from typing import ClassVar, Final

from mypy_extensions import i64, mypyc_attr

from vbus.core.options import Option, Settings
from vbus.core.signals import Plant
from vbus.core.state import Names

ENCODER_OPTIONS: Final = (
    Option("encoder_lines", "count", 500, "lines of the encoder; it gives four counts a line",
           low=1, high=1_000_000),
    Option("index", "flag", True, "the encoder has an index, once a revolution"),
    Option("index_offset", "count", 0, "count since power-on at which an index lies, a multiple"
           " of 4: the index is low in the state A = B = 0", low=-(1 << 30), high=1 << 30),
)  # fmt: skip

_A: Final = (0, 1, 1, 0)
_B: Final = (0, 0, 1, 1)

MOST_TURNED: Final = 67108864.0
"""Counts that a shaft turns in a period at most: tens of thousands of times what a chip can count.

An index or a switch on the way is an event of its own, so a period without a bound could take for
ever. A plant that has further to go does so in the next period; a position that is loaded is
checked.
"""
# The largest float below 1.
_ALMOST_ONE: Final = 0.99999999999999988898


class Encoder:
    """An incremental encoder: ``lines`` periods of A and B a revolution, and an index.

    Args:
        lines: lines a revolution.
        index: whether it has an index.
        index_offset: a count at which the index lies; the others are whole revolutions away.
    """

    WIRING: ClassVar[Names] = ("counts", "index")

    def __init__(self, lines: int, index: bool = True, index_offset: int = 0) -> None:
        if index_offset % 4:
            raise ValueError(
                f"index_offset = {index_offset}: the index lies where A and B are low, at counts"
                f" that are multiples of 4, such as {index_offset - index_offset % 4}"
            )
        self.counts: int = 4 * lines
        """Counts a revolution."""
        self.index: bool = index
        self.index_offset: int = index_offset % self.counts
        self._turn: i64 = self.counts  # the same as words
        self._offset: i64 = self.index_offset

    def levels(self, count: int) -> tuple[int, int, int]:
        """Return the levels of A, B and index at ``count``.

        Counting up, A and B take the states 00, 10, 11, 01; the index is low in one of the 00
        states of each revolution and high everywhere else.
        """
        place = count & 3
        low = self.index and count % self.counts == self.index_offset
        return _A[place], _B[place], 0 if low else 1

    def index_between(self, start: i64, end: i64) -> tuple[bool, i64]:
        """Tell whether going from ``start`` to ``end`` enters an index, and at which count.

        ``start`` itself does not count; of several indices the first one on the way is returned.
        """
        if not self.index or start == end:
            return False, 0
        into = (start - self._offset) % self._turn
        count = start - into
        if start < end:
            count += self._turn
            if count > end:
                return False, 0
        else:
            if into == 0:
                count -= self._turn
            if count < end:
                return False, 0
        return True, count


@mypyc_attr(allow_interpreted_subclasses=True)
class EncodedPlant(Plant):
    """A plant whose shaft carries an encoder, and that remembers its course through a period.

    The course is a chain of straight pieces. Shaft positions are counts as real numbers, written
    as the count at the period's start plus a small float, so that the mechanics are as exact a
    million revolutions away as at home. The count is the position rounded down.
    """

    OPTIONS: ClassVar[tuple[Option, ...]] = ENCODER_OPTIONS
    STATE: ClassVar[Names] = (
        "count", "base", "_pieces", "points: list[float, ...]",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = (
        "first", "_forgotten", "last", "_next", "_part", "untraced",
    )  # fmt: skip

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.encoder: Final[Encoder] = Encoder(
            int(self.settings["encoder_lines"]),
            bool(self.settings["index"]),
            int(self.settings["index_offset"]),
        )
        # Count at the start of the last period, and the shaft's position at its start, at its
        # end, and at the end of each of its pieces, counted from there.
        self.base: i64 = 0
        self._next: i64 = 0
        """The count at its end: :attr:`count`, which a compiled core looks for in a plug-in too."""
        self._pieces: i64 = 1
        # At power-on the shaft stands in the middle of count 0.
        self.first: float = 0.5
        self.last: float = 0.5
        self._part: float = 0.5
        """The position at the end, counted from the count there: 0.0 to below 1.0."""
        self.points: list[float] = [0.5, 0.5]
        self.untraced: bool = False
        """The pieces of the last period have not been written down: trace() does."""
        self._forgotten: bool = False
        """Nor will they be: the period is over for good."""

    # A plant either writes its pieces down, between begin() and end(), or leaves that to
    # trace(), between depart() and arrive(): most periods are never asked for their course.

    def depart(self) -> float:
        """Begin a period where the last one has ended; return that position."""
        self.base = self._next
        self._forgotten = False
        self.first = self._part
        return self._part

    def arrive(self, position: float) -> i64:
        """End the period at ``position``; return the count there."""
        self.last = position
        if 0.0 <= position < 1.0:
            self._part = position
            self.count = self._next = self.base
            return self.base
        whole: i64 = int(position)
        back = float(whole)
        if position < back:
            whole -= 1
            back -= 1.0
        # A position just below a count may round up to it.
        part = position - back
        self._part = part if part < 1.0 else _ALMOST_ONE
        count = self.base + whole
        self.count = self._next = count
        return count

    def begin(self, pieces: i64) -> None:
        """Begin a period of ``pieces`` pieces where the last one has ended."""
        self.write_pieces(pieces, self.depart())

    def write_pieces(self, pieces: i64, first: float) -> list[float]:
        """Make room for the pieces of a period; return it."""
        points = self.points
        if pieces != self._pieces:
            self._pieces = pieces
            self.points = points = [first] * (pieces + 1)
        points[0] = first
        self.untraced = False
        return points

    def end(self) -> i64:
        """End the period: the count is where its last piece has led."""
        return self.arrive(self.points[self._pieces])

    @property
    def place(self) -> float:
        """Where the shaft is at the end of the period, in counts and parts of one."""
        return float(self.count) + self._part

    def trace(self) -> None:
        """Write the pieces of the last period down; state stays as it is."""
        raise NotImplementedError

    def course(self) -> list[float]:
        """Return where each piece of the last period begins, and the last one ends."""
        if self.untraced:
            if self._forgotten:
                self.write_pieces(1, self.last)[1] = self.last
            else:
                self.trace()
        return self.points

    def forget_course(self) -> None:
        """The period is over for good: what is left of its course is where it ended."""
        self.untraced = True
        self._forgotten = True

    def count_at(self, fraction: float) -> i64:
        """Return the count at ``fraction`` (0.0 to 1.0) of the last period."""
        if fraction <= 0.0:
            return self.base + floor(self.first)
        points = self.course()
        place = fraction * float(self._pieces)
        piece: i64 = int(place)
        if piece >= self._pieces:
            return self.count
        start = points[piece]
        end = points[piece + 1]
        return self.base + floor(start + (end - start) * (place - float(piece)))

    def fraction_at(self, count: i64) -> float:
        """Return when, as a fraction of the last period, the encoder first reached ``count``.

        :meth:`count_at` at that fraction has reached it. A count the shaft stood at or has
        not reached gives 0.0 or 1.0.
        """
        points = self.course()
        away = count - self.base
        start = floor(points[0])
        if away == start:
            return 0.0
        rising = away > start
        # Going down, a count is reached when the shaft leaves the one above it.
        border = float(away) if rising else float(away) + 1.0
        for piece in range(self._pieces):
            end = points[piece + 1]
            if (end >= border) if rising else (end < border):
                begin = points[piece]
                fraction = (float(piece) + (border - begin) / (end - begin)) / float(self._pieces)
                return self.reached(count, fraction, rising)
        return 1.0

    def reached(self, count: i64, fraction: float, rising: bool) -> float:
        """Return the first fraction from ``fraction`` on at which ``count`` is reached."""
        # The border itself may be missed by a rounding error.
        step = 2.220446049250313e-16
        while fraction < 1.0:
            here = self.count_at(fraction)
            if (here >= count) if rising else (here <= count):
                return fraction
            fraction += step
            step *= 2.0
        return 1.0

    def index_between(self, start: i64, end: i64) -> tuple[bool, i64]:
        """Tell whether moving from ``start`` to ``end`` enters an index position, and which."""
        return self.encoder.index_between(start, end)

    def before_save(self) -> None:
        """Write the course down that the state has."""
        self.course()

    def after_load(self) -> None:
        """Work out where the course begins and ends."""
        self._next = self.count
        self.first = self.points[0]
        self.last = self.points[self._pieces]
        part = self.last - float(self.count - self.base)
        if not -1.0 < part < 2.0 or not max(map(abs, self.points)) <= MOST_TURNED:
            raise ValueError(f"a shaft that has turned to {self.points} is not at {self.count}")
        self._part = part if part < 1.0 else _ALMOST_ONE
        self.untraced = False


def bounded(place: float) -> float:
    """Return the place in a period that a shaft reaches, of the place it would go to."""
    if place >= -MOST_TURNED:
        return place if place <= MOST_TURNED else MOST_TURNED
    return -MOST_TURNED


def floor(value: float) -> i64:
    """Round down."""
    whole: i64 = int(value)
    return whole - 1 if value < float(whole) else whole
