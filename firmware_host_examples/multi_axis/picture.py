"""Plots as SVG, written by hand: paths to scale, and curves over time."""

import math
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

SIDE = 460
"""Height of the picture without its margins; the path has a square of this size."""
WIDE = 520
"""Width of the curves beside it."""
MARGIN = 60
LETTER = 6.5
"""Width of a letter, about."""
COLOURS = ("#1f6fb4", "#c8432b", "#2e8b57", "#8a5bb5")

Line = Sequence[tuple[float, float]]


class Picture:
    """A path on the left, to scale in both directions, and curves over time on the right.

    Args:
        title: stands above.
        across: what the path shows from left to right, with its unit.
        up: what it shows upward.
        curves: what the curves show, with its unit.
    """

    def __init__(self, title: str, across: str, up: str, curves: str) -> None:
        self._title = title
        self._across = across
        self._up = up
        self._curves = curves
        self._path: list[tuple[str, str, Line]] = []
        self._over_time: list[tuple[str, Line]] = []

    def path(self, name: str, points: Line, programmed: bool = False) -> None:
        """Add a path; a programmed one is drawn wide and pale, below the real one."""
        self._path.append((name, "programmed" if programmed else "real", points))

    def curve(self, name: str, points: Line) -> None:
        """Add a curve; its points are (seconds, value)."""
        self._over_time.append((name, points))

    def write(self, file: Path) -> None:
        """Write the picture.

        Raises:
            OSError: the file cannot be written.
        """
        width, height = SIDE + WIDE + 3 * MARGIN, SIDE + 2 * MARGIN
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}"'
            f' viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">',
            f'<rect width="{width}" height="{height}" fill="white"/>',
            _text(width / 2, 24, self._title, "middle", 16),
            *self._left(),
            *self._right(),
            "</svg>",
        ]
        file.write_text("\n".join(parts) + "\n")

    def _left(self) -> list[str]:
        lines = [points for *_, points in self._path]
        (x0, x1), (y0, y1) = _bounds(lines, 0), _bounds(lines, 1)
        span = max(x1 - x0, y1 - y0) * 1.08 or 1.0
        frame = _Frame(
            MARGIN, SIDE, SIDE, ((x0 + x1 - span) / 2, (y0 + y1 - span) / 2), (span, span)
        )
        parts = frame.grid(self._across, self._up)
        names: list[str] = []
        for name, kind, points in self._path:
            if kind == "programmed":
                parts.append(frame.line(points, "#b8b8b8", 5))
            else:
                parts.append(frame.line(points, COLOURS[len(names) % len(COLOURS)], 1.2))
                names.append(name)
        return [*parts, frame.legend(names)]

    def _right(self) -> list[str]:
        lines = [points for _, points in self._over_time]
        (x0, x1), (y0, y1) = _bounds(lines, 0), _bounds(lines, 1)
        room = (y1 - y0) * 0.08 or 1.0
        frame = _Frame(
            SIDE + 2 * MARGIN, WIDE, SIDE, (x0, y0 - room), (x1 - x0 or 1.0, y1 - y0 + 2 * room)
        )
        parts = frame.grid("time (s)", self._curves)
        for number, (_, points) in enumerate(self._over_time):
            parts.append(frame.line(points, COLOURS[number % len(COLOURS)], 1))
        return [*parts, frame.legend([name for name, _ in self._over_time])]


class _Frame:
    """Axes of one part of the picture."""

    def __init__(
        self,
        left: float,
        width: float,
        height: float,
        low: tuple[float, float],
        span: tuple[float, float],
    ) -> None:
        self._left, self._width, self._height = left, width, height
        self._low, self._span = low, span

    def _x(self, value: float) -> float:
        return self._left + (value - self._low[0]) / self._span[0] * self._width

    def _y(self, value: float) -> float:
        return MARGIN + self._height - (value - self._low[1]) / self._span[1] * self._height

    def grid(self, x_name: str, y_name: str) -> list[str]:
        """Return frame, grid lines, numbers and names."""
        right, bottom = self._left + self._width, MARGIN + self._height
        parts = [
            f'<rect x="{self._left}" y="{MARGIN}" width="{self._width}" height="{self._height}"'
            ' fill="none" stroke="#444"/>'
        ]
        for value in _ticks(self._low[0], self._span[0]):
            x = self._x(value)
            parts.append(_rule(x, MARGIN, x, bottom))
            parts.append(_text(x, bottom + 16, f"{value:g}", "middle"))
        for value in _ticks(self._low[1], self._span[1]):
            y = self._y(value)
            parts.append(_rule(self._left, y, right, y))
            parts.append(_text(self._left - 6, y + 4, f"{value:g}", "end"))
        parts.append(_text((self._left + right) / 2, bottom + 36, x_name, "middle"))
        parts.append(_text(self._left, MARGIN - 8, y_name, "start"))
        return parts

    def line(self, points: Line, colour: str, width: float) -> str:
        """Return a line through points."""
        places = " ".join(f"{self._x(x):.2f},{self._y(y):.2f}" for x, y in points)
        return (
            f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="{width}"'
            ' stroke-linejoin="round"/>'
        )

    def legend(self, names: Sequence[str]) -> str:
        """Return the names of lines, in their colours, above the frame."""
        parts = []
        right = self._left + self._width
        for number, name in reversed(list(enumerate(names))):
            colour = COLOURS[number % len(COLOURS)]
            parts.append(_text(right, MARGIN - 8, name, "end", colour=colour))
            right -= LETTER * len(name) + 2 * LETTER
        return "\n".join(parts)


def _bounds(lines: Sequence[Line], place: int) -> tuple[float, float]:
    values = [point[place] for points in lines for point in points]
    return (min(values), max(values)) if values else (0.0, 1.0)


def _ticks(low: float, span: float) -> list[float]:
    """Return round numbers, some six of them, within a range."""
    rough = span / 6
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * k for k in (1, 2, 5, 10) if power * k >= rough)
    first = math.ceil(low / step)
    return [n * step for n in range(first, math.floor((low + span) / step) + 1)]


def _rule(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}" stroke="#e4e4e4"/>'


def _text(x: float, y: float, text: str, anchor: str, size: int = 12, colour: str = "#222") -> str:
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" font-size="{size}"'
        f' fill="{colour}">{escape(text)}</text>'
    )
