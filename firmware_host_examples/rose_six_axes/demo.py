"""A rose by six axes on three nodes, one of which is killed; python demo.py --help says more."""

import math
import sys
from collections.abc import Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from multi_axis.accident import Accident, main
from multi_axis.chips import Cycle, Lm629, Mc1241a, Mcp1200, Reading
from multi_axis.picture import Picture
from multi_axis.result import Path as Way
from multi_axis.result import Point, nearest, of_distances
from multi_axis.score import MS, US, Score
from multi_axis.velocity import lm629_velocities, mc1241a_accelerations

PENS = ("blue", "red", "green")
COUNTS_PER_MM = 400
MICROSTEPS_PER_COUNT = 6.4
RADIUS = 10 * COUNTS_PER_MM
TURN = 1.6
"""Seconds for a petal."""
BREAKPOINT = -2000
"""Where red tells that it has passed, in X (counts)."""
BEGIN = 20 * MS
"""When all pens begin."""
JAMMED = (1150 * MS, 1350 * MS)
"""From when to when the red pen is off its way: board.toml holds it for 60 ms."""


def petal(pen: int) -> Way:
    """Return where a pen is to be, by the time after the start: its petal of the rose."""

    def path(t: float) -> Point:
        part = min(1.0, max(0.0, t / TURN))
        angle = (part - math.sin(2 * math.pi * part) / (2 * math.pi) - 0.5) * math.pi / 3
        out = RADIUS * math.cos(3 * angle)
        heading = math.pi / 2 + 2 * math.pi / 3 * pen + angle
        return out * math.cos(heading), out * math.sin(heading)

    return path


def blue(score: Score) -> None:
    """Two LM629: every 5.12 ms a velocity for each, and STT to both."""
    sample, segment, acceleration = 256 * US, 20, 2400
    count = math.ceil(TURN * 1000 * MS / (segment * sample)) + 4
    for number, name in enumerate(("blue_x", "blue_y")):
        axis = Lm629(score, name)
        at = axis.command(1 * MS, Lm629.RSTI, 0)
        at = axis.command(at, Lm629.MSKI, 0)
        at = axis.command(at, Lm629.LFIL, 0x000F, 2000, 1000, 20000, 20000)
        at = axis.command(at, Lm629.UDF)
        aims = [petal(0)((n + 1) * segment * sample / 1e12)[number] for n in range(count)]
        for n, goal in enumerate(lm629_velocities(aims, acceleration, segment)):
            start = BEGIN + n * segment * sample
            mode = 0x0808 | (0x1000 if goal >= 0 else 0)
            first = () if n else (0, acceleration)
            words = (*first, abs(goal) >> 16, abs(goal))
            axis.command(start - 5 * sample, Lm629.LTRJ, mode | (0 if n else 0x20), *words)
            axis.command(start, Lm629.STT)
            for look in (4, 9, 14):
                axis.command(start + look * sample, Lm629.RDRP, read=2)


def red(score: Score) -> None:
    """Two MCP-1200: every 2.5 ms a point for each, between which the chip interpolates."""
    sample, segment = 312 * US, 8
    count = math.ceil(TURN * 1000 * MS / (segment * sample)) + 4
    for number, name in enumerate(("red_x", "red_y")):
        axis = Mcp1200(score, name)
        at = (500 + 900 * number) * US
        for register, value in (
            (Mcp1200.EXCEPTION, 0x00),
            (Mcp1200.CONFIG, 0x11 if name == "red_x" else 0x01),
            (Mcp1200.CAPTURE_CONTROL, 0x00),
            (Mcp1200.FEATURE, 0x08),
            (Mcp1200.TIMER, 0x26),
            (Mcp1200.PRESCALER, 0x3F),
            (Mcp1200.INTERPOLATOR, 2),
            (Mcp1200.KP, 160),
            (Mcp1200.KI, 60),
            (Mcp1200.KD, 200),
            (Mcp1200.KV, 26),
            (Mcp1200.KA, 70),
            (Mcp1200.BREAKPOINT, BREAKPOINT),
        ):
            at = axis.write(at, register, value)
        # A sample begins on both where /SYNC is let go.
        score.pin(5 * MS - 10 * US, name, "/SYNC", 0)
        score.pin(5 * MS, name, "/SYNC", 1)
        axis.write(5 * MS + sample, Mcp1200.MODE, 3)
        begin = 5 * MS + (BEGIN - 5 * MS) // sample * sample
        for n in range(count):
            start = begin + n * segment * sample
            aim = round(petal(1)((n + 1) * segment * sample / 1e12)[number])
            axis.write(start - 3 * sample, Mcp1200.FINAL, aim)
            if n == 0:
                axis.write(start - sample // 2, Mcp1200.FLAG, 0x0B)
            axis.read(start + 3 * sample + sample // 4, Mcp1200.ACTUAL)


def green(score: Score) -> None:
    """Two MC1141A: every 4.3 ms an acceleration for each."""
    cycle, segment = 542_720_000, 8
    count = math.ceil(TURN * 1000 * MS / (segment * cycle)) + 4
    begin = BEGIN // cycle * cycle + 40 * US
    for number, name in enumerate(("green_x", "green_y")):
        axis = Mc1241a(score, name)
        at = axis.packet(1 * MS, Mc1241a.LMTS_OFF)
        at = axis.packet(at, Mc1241a.SET_PHASE_2)
        at = axis.packet(at, Mc1241a.SET_BUF_MTR_CMD, 32_000)
        at = axis.packet(at, Mc1241a.SET_AUTO_UPDATE_OFF)
        at = axis.packet(at, Mc1241a.SET_CAPT_HOME)
        at = axis.packet(at, Mc1241a.SET_PRFL_VEL)
        at = axis.long(at, Mc1241a.SET_VEL, 100 << 16)
        way = petal(2)
        aims = [
            MICROSTEPS_PER_COUNT * way((n + 1) * segment * cycle / 1e12)[number]
            for n in range(count)
        ]
        for n, push in enumerate(mc1241a_accelerations(aims, segment)):
            start = begin + n * segment * cycle
            axis.long(start - 2 * cycle, Mc1241a.SET_ACC, push)
            axis.packet(start, Mc1241a.UPDATE)
            axis.packet(start + 4 * cycle, Mc1241a.GET_ACTL_POS, read=2)
        axis.packet(begin + count * segment * cycle, Mc1241a.GET_CAPT, read=2)


def score() -> Score:
    """Return what the hosts of all nodes do."""
    made = Score()
    for pen in (blue, red, green):
        pen(made)
    return made


def result(cycles: Mapping[str, list[Cycle]]) -> tuple[list[str], Picture]:
    """Return what is to be said of a run, and its plot."""
    x_of_red = _positions("red", cycles["red_x"])
    picture = Picture("A rose by six axes on three nodes", "X (mm)", "Y (mm)", "error (counts)")
    lines = []
    for number, pen in enumerate(PENS):
        way = petal(number)
        x, y = (_positions(pen, cycles[f"{pen}_{axis}"]) for axis in ("x", "y"))
        track = [
            ((a.when - BEGIN) / 1e12, (float(a.counts), float(b.counts)))
            for a, b in zip(x, y, strict=True)
        ]
        found = [distance for distance, _ in nearest(track, way)]
        picture.path(f"{pen}, programmed", [_mm(way(n * TURN / 240)) for n in range(241)], True)
        picture.path(pen, [_mm(point) for _, point in track])
        picture.curve(pen, [(t, d) for (t, _), d in zip(track, found, strict=True)])
        jammed = [JAMMED[0] <= BEGIN + t * 1e12 < JAMMED[1] and pen == "red" for t, _ in track]
        calm = [d for d, off in zip(found, jammed, strict=True) if not off]
        lines.append(of_distances(calm).line(f"{pen}: contour error", "mm", COUNTS_PER_MM))
        if any(jammed):
            pushed = [d for d, off in zip(found, jammed, strict=True) if off]
            lines.append(of_distances(pushed).line(f"{pen}, jammed for 60 ms", "mm", COUNTS_PER_MM))
    passed = next(each for each in x_of_red if each.counts <= BREAKPOINT)
    captured = Mc1241a.capture(cycles["green_x"])[0].counts
    lines.append(
        f"red passed X = {BREAKPOINT / COUNTS_PER_MM:g} mm before {passed.when / MS:.1f} ms;"
        f" green's X was captured at {captured / COUNTS_PER_MM:.4f} mm"
    )
    return lines, picture


def _positions(pen: str, cycles: list[Cycle]) -> list[Reading]:
    if pen == "blue":
        return Lm629.positions(cycles)
    if pen == "red":
        return Mcp1200.values(cycles, Mcp1200.ACTUAL)
    return Mc1241a.positions(cycles, 1)


def _mm(point: Point) -> tuple[float, float]:
    return point[0] / COUNTS_PER_MM, point[1] / COUNTS_PER_MM


if __name__ == "__main__":
    main(
        Accident(
            name="rose_six_axes",
            folder=Path(__file__).parent,
            title="A rose by six axes on three nodes; one of them is killed on the way.",
            score=score,
            result=result,
            killed="red",
            kill_at=700 * MS,
        )
    )
