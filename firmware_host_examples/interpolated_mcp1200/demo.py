"""A figure of eight by four MCP-1200 on four nodes; python demo.py --help says what it can do."""

import math
import sys
from collections.abc import Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from multi_axis.chips import Cycle, Mcp1200
from multi_axis.command import Demo, main
from multi_axis.picture import Picture
from multi_axis.result import Point, nearest, of_distances
from multi_axis.score import MS, US, Score

AXES = ("x", "y", "z", "a")
COUNTS_PER_MM = 400
COUNTS_PER_DEGREE = 20_000 / 360
RADIUS, DEPTH = 10 * COUNTS_PER_MM, 4 * COUNTS_PER_MM
TURN = 1.2
"""Seconds for the whole figure."""
SAMPLE = 312 * US
"""(38 + 1) x (63 + 1) clocks at 8 MHz."""
SEGMENT = 8
"""Samples between two points."""
SEGMENTS = math.ceil(TURN * 1000 * MS / (SEGMENT * SAMPLE)) + 4
SYNC = 5 * MS
"""When /SYNC is let go: a sample begins there, and every 312 us from there on."""
BEGIN = SYNC + 41 * SAMPLE
"""When the first segment begins."""
BREAKPOINT = 3000
WIRE = 5 * MS
"""How long the edge on TRIG takes to the other nodes."""
KP, KI, KD, KV = 160, 60, 200, 26
KA = (70, 100, 60, 25)
"""Feed-forward of acceleration, for the inertia of each axis."""


def heading(angle: float) -> float:
    """Return the direction of the figure, in degrees from where it begins; without jumps."""
    turned = math.degrees(math.atan2(math.cos(2 * angle), math.cos(angle)))
    return (turned - 360 if turned > 90 else turned) - 45


def path(t: float) -> Point:
    """Return where the axes are to be ``t`` seconds after the start."""
    part = min(1.0, max(0.0, t / TURN))
    angle = 2 * math.pi * part - math.sin(2 * math.pi * part)
    return (
        RADIUS * math.sin(angle),
        RADIUS / 2 * math.sin(2 * angle),
        DEPTH / 2 * (1 - math.cos(angle)),
        COUNTS_PER_DEGREE * heading(angle),
    )


def score(synchronised: bool = True) -> Score:
    """Return what the host does: set up, /SYNC, then a point for each axis every 2.5 ms."""
    made = Score()
    for number, name in enumerate(AXES):
        axis = Mcp1200(made, name)
        # One axis after the other: their samples begin at different instants, until /SYNC.
        at = (500 + 900 * number) * US
        for register, value in (
            (Mcp1200.EXCEPTION, 0x00),
            (Mcp1200.CONFIG, 0x11 if name == "x" else 0x01),
            (Mcp1200.CAPTURE_CONTROL, 0x00 if name == "x" else 0x06),
            (Mcp1200.FEATURE, 0x08),
            (Mcp1200.TIMER, 0x26),
            (Mcp1200.PRESCALER, 0x3F),
            (Mcp1200.INTERPOLATOR, 2),
            (Mcp1200.KP, KP),
            (Mcp1200.KI, KI),
            (Mcp1200.KD, KD),
            (Mcp1200.KV, KV),
            (Mcp1200.KA, KA[number]),
            (Mcp1200.BREAKPOINT, BREAKPOINT),
        ):
            at = axis.write(at, register, value)
        if synchronised:
            made.pin(SYNC - 10 * US, name, "/SYNC", 0)
            made.pin(SYNC, name, "/SYNC", 1)
        axis.write(SYNC + SAMPLE, Mcp1200.MODE, 3)
        for segment in range(SEGMENTS):
            start = BEGIN + segment * SEGMENT * SAMPLE
            aim = round(path((segment + 1) * SEGMENT * SAMPLE / 1e12)[number])
            axis.write(start - 3 * SAMPLE, Mcp1200.FINAL, aim)
            if segment == 0:
                axis.write(start - SAMPLE // 2, Mcp1200.FLAG, 0x0B)
            for sample in (3 + segment % 2,):
                axis.read(start + sample * SAMPLE + SAMPLE // 4, Mcp1200.ACTUAL)
        if name != "x":
            axis.read(BEGIN + SEGMENTS * SEGMENT * SAMPLE, Mcp1200.CAPTURE)
    return made


def result(cycles: Mapping[str, list[Cycle]]) -> tuple[list[str], Picture]:
    """Return what is to be said of a run, and its plot."""
    readings = [Mcp1200.values(cycles[name], Mcp1200.ACTUAL) for name in AXES]
    track = [
        ((at[0].when - BEGIN) / 1e12, tuple(float(axis.counts) for axis in at))
        for at in zip(*readings, strict=True)
    ]
    found = nearest([(t, point[:3]) for t, point in track], lambda t: path(t)[:3])
    # The knife is to point along the way where the tool is, not where it was to be.
    turned = [
        point[3] - path(place)[3] for (_, point), (_, place) in zip(track, found, strict=True)
    ]
    picture = Picture(
        "Figure of eight by four MCP-1200 on four nodes", "X (mm)", "Y (mm)", "error (counts)"
    )
    programmed = [path(n * TURN / 720) for n in range(721)]
    picture.path("programmed", [_mm(point) for point in programmed], programmed=True)
    picture.path("real", [_mm(point) for _, point in track])
    picture.curve(
        "distance from the way (X, Y, Z)",
        [(t, d) for (t, _), (d, _) in zip(track, found, strict=True)],
    )
    picture.curve("knife", [(t, d) for (t, _), d in zip(track, turned, strict=True)])
    contour = of_distances([distance for distance, _ in found])
    knife = of_distances(turned)
    lines = [
        contour.line("contour error of X, Y, Z", "mm", COUNTS_PER_MM),
        knife.line("knife off the way", "deg", COUNTS_PER_DEGREE),
        _captures(cycles, track),
    ]
    return lines, picture


def _captures(cycles: Mapping[str, list[Cycle]], track: list[tuple[float, Point]]) -> str:
    """Return what TRIG has made the others capture, beside what they read before and after."""
    passed = next(t for t, point in track if point[0] >= BREAKPOINT) + WIRE / 1e12
    after = next(point for t, point in track if t >= passed)
    words = [
        f"{name} {Mcp1200.values(cycles[name], Mcp1200.CAPTURE)[0].counts}"
        f" (read next: {after[number]:.0f})"
        for number, name in enumerate(AXES)
        if name != "x"
    ]
    return f"TRIG, {WIRE / MS:g} ms after x passed {BREAKPOINT}: captured " + ", ".join(words)


def _mm(point: Point) -> tuple[float, float]:
    return point[0] / COUNTS_PER_MM, point[1] / COUNTS_PER_MM


if __name__ == "__main__":
    main(
        Demo(
            name="interpolated_mcp1200",
            folder=Path(__file__).parent,
            title="A figure of eight by four MCP-1200 on four nodes, synchronised by /SYNC.",
            period=US,
            score=score,
            result=result,
            marks=lambda cycle: cycle.write and cycle.address == Mcp1200.FINAL[-1],
            variants={"--no-sync": ("leave /SYNC alone: see what it is for", lambda: score(False))},
        )
    )
