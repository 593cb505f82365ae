"""Two geared pairs of axes, by two MC1241A on two nodes; python demo.py --help says what it can."""

import sys
from collections.abc import Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from multi_axis.chips import Cycle, Mc1241a
from multi_axis.command import Demo, main
from multi_axis.picture import Picture
from multi_axis.result import of_distances
from multi_axis.score import MS, US, Score

COUNTS_PER_MM = 400
MICROSTEPS_PER_COUNT = 6.4
CYCLE = 542_720_000
"""The chip set's cycle at 25 MHz (ps)."""
BEGIN = 24 * CYCLE
WAY = 25_600
"""Microsteps of both masters: two turns."""
GEARS = {"p": 4, "q": -8}
"""Microsteps of the slave for each count of its master: 5 to 8, and 5 to 4 backward."""
LOOKS = 330
WIRE = 5 * MS
AMPLITUDE = 32_000
VELOCITY, ACCELERATION, JERK = 14 << 16, 0x0800, 0x0008_0000
"""14 microsteps a cycle, 1/32 a cycle squared, 2^-13 a cycle cubed."""


def score() -> Score:
    """Return what the host does: set up, one MULTI_UPDATE to both, then it only looks."""
    made = Score()
    for name in GEARS:
        pair = Mc1241a(made, name)
        at = pair.packet(1 * MS, Mc1241a.LMTS_OFF)
        for axis in (Mc1241a.SET_2, Mc1241a.SET_1):
            at = pair.packet(at, axis)
            at = pair.packet(at, Mc1241a.SET_PHASE_2)
            at = pair.packet(at, Mc1241a.SET_BUF_MTR_CMD, AMPLITUDE)
            at = pair.packet(at, Mc1241a.SET_AUTO_UPDATE_OFF)
            if axis == Mc1241a.SET_2:
                at = pair.packet(at, Mc1241a.SET_PRFL_GEAR)
                at = pair.long(at, Mc1241a.SET_RATIO, GEARS[name] << 16)
                at = pair.packet(at, Mc1241a.SET_CAPT_HOME)
            else:
                at = pair.packet(at, Mc1241a.SET_PRFL_S_CRV)
                at = pair.long(at, Mc1241a.SET_POS, WAY)
                at = pair.long(at, Mc1241a.SET_VEL, VELOCITY)
                at = pair.packet(at, Mc1241a.SET_MAX_ACC, ACCELERATION)
                at = pair.long(at, Mc1241a.SET_JERK, JERK)
        if name == "p":
            at = pair.long(at, Mc1241a.SET_BRK_PNT, WAY // 2)
            at = pair.packet(at, Mc1241a.SET_POS_BRK)
            at = pair.packet(at, Mc1241a.SET_INTRPT_MASK, 0x04)
        # The second byte of this word has one latching edge on both chips.
        pair.packet(BEGIN, Mc1241a.MULTI_UPDATE, 0x0003)
        for look in range(1, LOOKS):
            # Both positions within one cycle.
            at = BEGIN + 8 * look * CYCLE + 40 * US
            for axis in (Mc1241a.SET_2, Mc1241a.SET_1):
                at = pair.packet(at, axis)
                at = pair.packet(at, Mc1241a.GET_ACTL_POS, read=2)
        if name == "q":
            at = pair.packet(BEGIN + 8 * LOOKS * CYCLE, Mc1241a.SET_2)
            pair.packet(at, Mc1241a.GET_CAPT, read=2)
    return made


def result(cycles: Mapping[str, list[Cycle]]) -> tuple[list[str], Picture]:
    """Return what is to be said of a run, and its plot."""
    lines = []
    picture = Picture(
        "Geared axes by two MC1241A on two nodes", "master (mm)", "slave (mm)", "error (counts)"
    )
    middle = []
    for name, steps in GEARS.items():
        ratio = steps / MICROSTEPS_PER_COUNT
        masters, slaves = (Mc1241a.positions(cycles[name], axis) for axis in (2, 1))
        # Encoder 2 was asked first, and encoder 1 in the same cycle.
        pairs = [(m.when, m.counts, s.counts) for m, s in zip(masters, slaves, strict=True)]
        middle.append([m for _, m, _ in pairs])
        error = of_distances([s - ratio * m for _, m, s in pairs])
        lines.append(error.line(f"gear error of {name}, {ratio:+g}", "mm", COUNTS_PER_MM))
        ends = [(0.0, 0.0), (pairs[-1][1], ratio * pairs[-1][1])]
        picture.path(f"{name} by its ratio", [_mm(*end) for end in ends], programmed=True)
        picture.path(f"{name}: {ratio:+g}", [_mm(m, s) for _, m, s in pairs])
        picture.curve(name, [((t - BEGIN) / 1e12, s - ratio * m) for t, m, s in pairs])
    apart = of_distances([p - q for p, q in zip(*middle, strict=True)])
    lines.append(apart.line("contour error, master to master", "mm", COUNTS_PER_MM))
    captured = Mc1241a.capture(cycles["q"])[0].counts
    lines.append(
        f"half-way, {WIRE / MS:g} ms after p's breakpoint at {WAY // 2} microsteps: master of q"
        f" captured at {captured} counts"
    )
    return lines, picture


def _mm(master: float, slave: float) -> tuple[float, float]:
    return master / COUNTS_PER_MM, slave / COUNTS_PER_MM


if __name__ == "__main__":
    main(
        Demo(
            name="gear_mc1241a",
            folder=Path(__file__).parent,
            title="Two geared pairs of axes by two MC1241A on two nodes.",
            period=CYCLE,
            score=score,
            result=result,
            marks=lambda cycle: (
                cycle.write
                and (cycle.address, cycle.data) == (Mc1241a.COMMAND, Mc1241a.GET_ACTL_POS)
            ),
        )
    )
