"""A circle of 20 mm with two LM629 on two nodes; python demo.py --help says what it can do."""

import math
import sys
from collections.abc import Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from multi_axis.chips import Cycle, Lm629
from multi_axis.command import Demo, main
from multi_axis.picture import Picture
from multi_axis.result import Point, nearest, of_distances
from multi_axis.score import MS, US, Score
from multi_axis.velocity import lm629_velocities

COUNTS_PER_MM = 400
RADIUS = 10 * COUNTS_PER_MM
TURN = 1.5
"""Seconds for the whole circle."""
SAMPLE = 256 * US
"""The LM629's own period at 8 MHz."""
SEGMENT = 20
"""Samples between two velocities: 5.12 ms."""
SEGMENTS = math.ceil(TURN * 1000 * MS / (SEGMENT * SAMPLE)) + 4
BEGIN = 40 * SAMPLE + 128 * US
ACCELERATION = 2400
"""1/65536 counts/sample/sample."""
GAINS = {"kp": 2000, "ki": 1000, "kd": 20000, "il": 20000}


def path(t: float) -> Point:
    """Return where X and Y are to be ``t`` seconds after the start: a circle, softly begun."""
    part = min(1.0, max(0.0, t / TURN))
    angle = 2 * math.pi * part - math.sin(2 * math.pi * part)
    return RADIUS * math.sin(angle), RADIUS * (1 - math.cos(angle))


def aims(axis: int) -> list[float]:
    """Return where an axis is to be at the end of each segment."""
    return [path(n * SEGMENT * SAMPLE / 1e12)[axis] for n in range(1, SEGMENTS + 1)]


def score() -> Score:
    """Return what the host does: set up, then a velocity for each axis and STT to both."""
    made = Score()
    axes = [Lm629(made, "x"), Lm629(made, "y")]
    for axis, number in zip(axes, (0, 1), strict=True):
        at = axis.command(1 * MS, Lm629.RSTI, 0)
        at = axis.command(at, Lm629.MSKI, 0)
        at = axis.command(at, Lm629.LFIL, 0x000F, *GAINS.values())
        at = axis.command(at, Lm629.UDF)
        at = axis.command(at, Lm629.LTRJ, 0x1828, 0, ACCELERATION, 0, 0)
        goals = lm629_velocities(aims(number), ACCELERATION, SEGMENT)
        for segment, goal in enumerate(goals):
            start = BEGIN + segment * SEGMENT * SAMPLE
            mode = 0x0808 | (0x1000 if goal >= 0 else 0)
            if segment:
                axis.command(start - 5 * SAMPLE, Lm629.LTRJ, mode, abs(goal) >> 16, abs(goal))
            else:
                words = (0x0028 | mode, 0, ACCELERATION, abs(goal) >> 16, abs(goal))
                axis.command(start - 5 * SAMPLE, Lm629.LTRJ, *words)
            # Both STT have one latching edge.
            axis.command(start, Lm629.STT)
            for sample in (4, 9, 14, 19):
                axis.command(start + sample * SAMPLE, Lm629.RDRP, read=2)
    return made


def result(cycles: Mapping[str, list[Cycle]]) -> tuple[list[str], Picture]:
    """Return what is to be said of a run, and its plot."""
    x, y = (Lm629.positions(cycles[name]) for name in ("x", "y"))
    track = [
        ((a.when - BEGIN) / 1e12, (float(a.counts), float(b.counts)))
        for a, b in zip(x, y, strict=True)
    ]
    found = nearest(track, path)
    picture = Picture(
        "Circle by two LM629 on two nodes", "X (mm)", "Y (mm)", "contour error (counts)"
    )
    picture.path("programmed", [_mm(path(n * TURN / 720)) for n in range(721)], programmed=True)
    picture.path("real", [_mm(point) for _, point in track])
    picture.curve(
        "distance from the circle", [(t, d) for (t, _), (d, _) in zip(track, found, strict=True)]
    )
    error = of_distances([distance for distance, _ in found])
    return [error.line("contour error", "mm", COUNTS_PER_MM)], picture


def _mm(point: Point) -> tuple[float, float]:
    return point[0] / COUNTS_PER_MM, point[1] / COUNTS_PER_MM


if __name__ == "__main__":
    main(
        Demo(
            name="xy_circle_lm629",
            folder=Path(__file__).parent,
            title="A circle of 20 mm by two LM629 on two nodes.",
            period=SAMPLE,
            score=score,
            result=result,
            marks=lambda cycle: cycle.write and (cycle.address, cycle.data) == (0, Lm629.STT),
        )
    )
