"""The console log of two real LM629s, line by line (NOTES 35).

slgrobotics/Misc on GitHub, commit a751bbb2, Arduino/Sketchbook/LM629_v3/operation.txt. Both parts
are of the C4 kind. The motors are stand-ins: what they do between the lines is not in the log.
"""

from collections.abc import Callable

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench, Course
from vbus.core.kernel import MS, US

REST = ("RDSUM", "RDSIGS")


class Motor(Course):
    """A motor without inertia: a speed (counts per sample) for each motor command (-1 to 1)."""

    def __init__(self, speed: Callable[[float], float], place: float = 0.0) -> None:
        super().__init__()
        self.speed = speed
        self.place = place

    def move(self, error: int) -> int:
        self.place += self.speed(self.commands[-1])
        return round(self.place)

    def resting(self) -> bool:
        return False


def real_part(plant: Course | None = None, **settings) -> Bench:
    return Bench(part="LM629N-8", plant=plant, done=False, reset_status="C4", **settings)


def started(motor: Motor, *gains: int, **settings) -> Bench:
    """A part after its reset, with ``kp``, ``ki``, ``kd`` and ``il`` as they were loaded."""
    bench = real_part(motor, **settings)
    bench.run(2 * MS)
    bench.command("RSTI", 0)
    bench.filter(*gains)
    return bench


@pytest.mark.spec("LM-RST-5", "LM-RST-6", "LM-AMB-3")
def test_start_up():
    bench = real_part()
    bench.run(100 * US)
    assert bench.status() == 0x00
    bench.run(2 * MS)
    assert bench.status() == 0xC4
    bench.command("RSTI", 0x0000)
    assert bench.status() == 0xC0
    bench.command("LFIL", 0x000F, 20, 4, 64, 4000)
    bench.command("UDF")
    bench.next_sample()
    assert bench.status() == 0xC0
    assert bench.report("RDSIGS") == 0x01C0
    bench.move(0, accel=2000, velocity=700_000, position=-100_000)
    bench.next_sample()
    assert bench.status() == 0x40
    bench.command("RESET")
    bench.run(2 * MS)
    assert bench.status() == 0xC4


@pytest.mark.spec("LM-TRJ-12", "LM-PID-5", "LM-AMB-1", "LM-CMD-14")
def test_chip_1_on_its_way_to_minus_100000():
    # It moves toward its target, as fast at e = -4169 as at e = -53916.
    motor = Motor(lambda command: 4.93 * command)
    bench = started(motor, 20, 4, 64, 4000)
    bench.move(0, accel=2000, velocity=700_000, position=-100_000)
    bench.next_sample()
    first = bench.now
    lines = []
    # Registers of a line are read one after the other, a millisecond or two apart.
    for place, velocity, rest in (
        (739, 747, 755), (5258, 5266, 5274), (9697, 9706, 9714), (13_600, 13_608, 13_616),
    ):  # fmt: skip
        line = []
        for sample, names in ((place, ("RDDP",)), (velocity, ("RDRV", "RDDV")), (rest, REST)):
            bench.at(first + (sample - 1) * SAMPLE)
            line += [bench.report(name) for name in names]
        lines.append([*line, bench.status()])

    assert {line.pop(1) for line in lines} <= {-5, -4}
    assert lines == [
        [-6030, -700_000, -4000, 0x0140, 0x40],
        [-54298, -700_000, -4000, 0x0140, 0x40],
        [-99997, -14_000, -4000, 0x8544, 0x44],
        [-100_000, 0, -4000, 0x8544, 0x44],
    ]


LINES = [-15, -224, -434, -642, -838, -1006, -1150, -1272, -1377]
LINE = 4000
"""Samples from one line to the next: 1.02 s."""
FASTEST = 211.0
"""Counts of a line at full command."""
FRICTION = 0.21
"""Part of the full command below which the motor stands."""


def crawl(fastest: float = FASTEST, friction: float = FRICTION, **settings) -> list[list[int]]:
    """Chip 2: its motor turns as fast as what the filter puts out exceeds friction."""

    def speed(command: float) -> float:
        return (
            fastest / LINE * (command + friction) / (1 - friction) if command < -friction else 0.0
        )

    motor = Motor(speed)
    bench = started(motor, 20, 3, 0, 2000, **settings)
    bench.move(0, accel=1 << 20, velocity=1 << 26, position=-2000)
    while bench.report("RDRP") > LINES[0]:
        bench.next_sample()
    lines = []
    start = bench.now
    for number in range(len(LINES)):
        bench.at(start + number * LINE * SAMPLE)
        names = ("RDRP", "RDDP", "RDRV", "RDDV", *REST)
        lines.append([*(bench.report(name) for name in names), bench.status()])
    return lines


def off(lines: list[list[int]]) -> int:
    """Return by how many counts the real position leaves the log at most."""
    return max(abs(line[0] - printed) for line, printed in zip(lines, LINES, strict=True))


@pytest.mark.spec("LM-PID-5", "LM-PID-6", "LM-AMB-1", "LM-AMB-9")
def test_chip_2_creeps_toward_its_target():
    lines = crawl()
    assert off(lines) <= 2
    for real, desired, real_velocity, velocity, summation, signals, status in lines:
        assert real > desired == -2000
        assert real_velocity in (-1, 0)
        assert (velocity, summation, signals, status) == (0, -2000, 0x8544, 0x44)


@pytest.mark.spec("LM-PID-5")
@pytest.mark.parametrize("friction", [0.0, FRICTION])
def test_with_a_limited_term_chip_2_would_creep_otherwise(friction: float):
    assert off(crawl(friction=friction, integral_limit="term")) > 10
