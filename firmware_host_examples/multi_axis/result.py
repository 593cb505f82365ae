"""How well the axes kept to the path, and to each other."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

Point = tuple[float, ...]
Path = Callable[[float], Point]
"""The programmed path: where all axes are to be at an instant (s), in counts."""


class Contour(NamedTuple):
    """Distances from the path, in counts."""

    points: int
    rms: float
    worst: float

    def line(self, what: str, unit: str, per_unit: float) -> str:
        """Return it in words; ``per_unit`` is counts a unit of length or angle."""
        return (
            f"{what}: rms {self.rms:.2f} counts = {self.rms / per_unit:.4f} {unit},"
            f" max {self.worst:.2f} counts = {self.worst / per_unit:.4f} {unit},"
            f" over {self.points} points"
        )


def of_distances(distances: Sequence[float]) -> Contour:
    """Return rms and largest of some distances."""
    square = sum(d * d for d in distances) / len(distances)
    return Contour(len(distances), math.sqrt(square), max(abs(d) for d in distances))


def nearest(
    track: Sequence[tuple[float, Point]], path: Path, window: float = 0.01, step: float = 0.0002
) -> list[tuple[float, float]]:
    """Return how far real positions are from the programmed path, and where it is nearest.

    An axis that is behind on the way, with all others, makes no contour error.

    Args:
        track: instants (s) and real positions of all axes at them (counts).
        path: the programmed path.
        window: how far back and ahead in time the nearest place is sought (s).
        step: the path is taken as straight lines of this length of time (s).

    Returns:
        For each position its distance (counts), and when it was to be there (s).
    """
    reach = round(window / step)
    places: dict[int, Point] = {}

    def place(number: int) -> Point:
        if number not in places:
            places[number] = path(number * step)
        return places[number]

    found = []
    for when, point in track:
        middle = round(when / step)
        (distance, part), number = min(
            (_to_line(point, place(n), place(n + 1)), n)
            for n in range(middle - reach, middle + reach)
        )
        found.append((distance, (number + part) * step))
    return found


def contour(track: Sequence[tuple[float, Point]], path: Path) -> Contour:
    """Return the contour error of a track; see :func:`nearest`."""
    return of_distances([distance for distance, _ in nearest(track, path)])


def _to_line(point: Point, start: Point, end: Point) -> tuple[float, float]:
    """Return the distance from a straight line between two points, and which part of it is near."""
    along = [b - a for a, b in zip(start, end, strict=True)]
    offset = [p - a for a, p in zip(start, point, strict=True)]
    length = sum(d * d for d in along)
    part = 0.0
    if length:
        part = min(1.0, max(0.0, sum(a * b for a, b in zip(along, offset, strict=True)) / length))
    return math.dist(offset, [part * d for d in along]), part


class Skew(NamedTuple):
    """How far apart in time the axes were (ps)."""

    p50: int
    p99: int
    worst: int
    marks: int

    def line(self, what: str) -> str:
        """Return it in words."""
        values = ", ".join(
            f"{name} {value / 1e6:g} us"
            for name, value in (("p50", self.p50), ("p99", self.p99), ("max", self.worst))
        )
        return f"{what}: {values}, over {self.marks} marks"


def skew(instants: Sequence[Sequence[int]]) -> Skew:
    """Return the skew of things that were to happen on all axes at one instant.

    Args:
        instants: for each axis when they happened (ps).

    Raises:
        ValueError: they did not happen equally often on all axes.
    """
    spreads = sorted(max(marks) - min(marks) for marks in zip(*instants, strict=True))
    last = len(spreads) - 1
    return Skew(spreads[last // 2], spreads[last * 99 // 100], spreads[-1], len(spreads))
