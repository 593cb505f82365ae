"""A resting axis is passed over in one step, and nobody can tell: not a bit is different.

Two boards from one file, with one host each that does the same. On one the plants say when they
rest, as ever, and time passes in long strides. On the other they never admit it, so that every
sample is run, and somebody looks in between.
"""

from contextlib import suppress
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.differential.drive import MOTION, Host
from vbus.chips.lm628.chip import LM628
from vbus.chips.lm628.datasheet import COMMANDS as LM
from vbus.chips.mc1241a.datasheet import COMMANDS as PMD
from vbus.core.kernel import MS, SECOND, US
from vbus.core.signals import Plant
from vbus.core.state import save
from vbus.protocols.port import PortError

FAMILIES = sorted(("mcp1200", *MOTION))


class Counted(Plant):
    """A plant as it is, but for the periods it has run, and maybe without its rest."""

    STATE = ("inner: part",)

    def __init__(self, inner: Plant, restless: bool) -> None:
        super().__init__()
        self.inner = inner
        self.restless = restless
        self.periods = 0
        self.switches = inner.switches
        self.count = inner.count

    def prepare(self, period: float) -> None:
        self.inner.prepare(period)

    def ran(self, count: int) -> int:
        self.periods += 1
        self.count = count
        return count

    def drive(self, command: float, error: int) -> int:
        return self.ran(self.inner.drive(command, error))

    def pulses(self, steps: int) -> int:
        return self.ran(self.inner.pulses(steps))

    def phases(self, a: float, b: float, c: float) -> int:
        return self.ran(self.inner.phases(a, b, c))

    def count_at(self, fraction: float) -> int:
        return self.inner.count_at(fraction)

    def fraction_at(self, count: int) -> float:
        return self.inner.fraction_at(count)

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        return self.inner.index_between(start, end)

    def resting(self) -> bool:
        return not self.restless and self.inner.resting()

    def after_load(self) -> None:
        self.count = self.inner.count


class Machine(Host):
    """A random host on a random board, whose plants count their periods."""

    def __init__(self, family: str, seed: int, restless: bool) -> None:
        super().__init__(family, seed)
        self.chip = self.board.chips[0]
        self.counted: list[Counted] = []
        for axis, plant in enumerate(self.board.plants):
            kind = type("Counted", (Counted,), {"TAKES": plant.TAKES})
            self.counted.append(kind(plant, restless))
            self.chip.connect(axis, self.counted[-1])
        self.board.power_on(True)

    def look(self) -> object:
        """Look in all ways but those that ask how long something stays: that is a promise, and
        who knows of rest can promise more."""
        kind = self.random.randrange(3)
        if kind == 0:
            return self.port.sample()
        return sorted(self.chip.telemetry().items()) if kind == 1 else self.port.sync()[0]

    def command(self, row: object, *words: int) -> None:
        code, data = (1, 0) if self.family == "mc1241a" else (0, 1)
        self.port.wait(5 * MS)
        self.port.write(code, row.code)  # type: ignore[attr-defined]
        for word in words:
            self.port.wait(5 * MS)
            self.port.write(data, word >> 8)
            self.port.write(data, word & 0xFF)

    def hold(self) -> None:
        """Close the loop, move a little, and stay there."""
        random = self.random
        if self.family == "lm628":
            gains = [random.randrange(1, 300), *(random.randrange(200) for _ in range(3))]
            self.command(LM["LFIL"], random.randrange(4) << 8 | 0xF, *gains)
            self.command(LM["UDF"])
            self.command(LM["LTRJ"], 0x2A, 1, 0, 4, 0, 0, random.randrange(50))
            self.command(LM["STT"])
        elif self.family == "mcp1200":
            steps = random.randrange(40)
            for register, value in (
                (0x01, 0x08), (0x26, random.randrange(60)), (0x28, random.randrange(9)),
                (0x05, 3), (0x0E, steps), (0x0D, 0), (0x0C, 0),
            ):  # fmt: skip
                self.port.write(register, value)
                self.port.delay(20 * US)
        else:
            self.command(PMD["SET_1"] if random.random() < 0.5 else PMD["SET_2"])
            self.command(PMD["SET_MTR_CMD"], random.randrange(0x7FFF))
            self.command(PMD["SET_POS"], 0, random.randrange(60))
            self.command(PMD["SET_VEL"], random.randrange(8), 0)
            self.command(PMD["SET_ACC"], 0, random.randrange(1, 9999))
            self.command(PMD["UPDATE"])

    def rest(self, duration: int, looks: list[float]) -> None:
        begun = self.board.now
        for part in sorted(looks):
            self.port.delay(begun + int(duration * part) - self.board.now)
            self.board.chips[0].telemetry()
        self.port.delay(begun + duration - self.board.now)

    def seen(self) -> tuple[object, ...]:
        """Everything there is but the notes a chip makes on its own rest."""
        self.chip.advance()
        state = save(self.chip)
        if isinstance(self.chip, LM628):
            state = {name: state[name] for name in state if name not in ("_course", "_still")}
        return (
            self.board.now, self.replies.hexdigest(), state, list(self.board.violations),
            [save(plant) for plant in self.counted],
            {name: pin.value for name, pin in self.chip.pins.items()},
        )  # fmt: skip


def pair(family: str, seed: int) -> tuple[Machine, Machine]:
    return Machine(family, seed, False), Machine(family, seed, True)


def reached(machine: Machine, operations: int) -> None:
    for _ in range(operations):
        machine.operation()


rests = st.lists(
    st.tuples(
        st.floats(5, 10.6).map(lambda power: int(10**power)),
        st.lists(st.floats(0, 1), max_size=4),
        st.integers(0, 4),
    ),
    min_size=1,
    max_size=5,
)


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), before=st.integers(0, 12), held=st.booleans(), course=rests)
def test_what_is_passed_over_is_what_stepping_gives(
    family: str, seed: int, before: int, held: bool, course: list[tuple[int, list[float], int]]
) -> None:
    striding, stepping = pair(family, seed)
    for machine in (striding, stepping):
        reached(machine, before)
        if held:
            with suppress(PortError):  # in the middle of something; so is the other one
                machine.hold()
    assert striding.seen() == stepping.seen()
    for duration, looks, operations in course:
        striding.rest(duration, [])
        stepping.rest(duration, looks)
        assert striding.seen() == stepping.seen()
        for machine in (striding, stepping):
            reached(machine, operations)
        assert striding.seen() == stepping.seen()


@pytest.mark.parametrize("held", [False, True], ids=["motor off", "holding"])
@pytest.mark.parametrize("family", FAMILIES)
def test_an_axis_that_rests_is_passed_over_by_the_hour(family: str, held: bool) -> None:
    skipped = 0
    for seed in range(12):
        machine = Machine(family, seed, False)
        if held:
            machine.hold()
        machine.rest(SECOND // 4, [])
        machine.chip.advance()
        before = sum(plant.periods for plant in machine.counted)
        if not all(plant.inner.resting() for plant in machine.counted):
            continue  # a load turns it, or it swings for ever
        machine.rest(3600 * SECOND, [Random(seed).random() for _ in range(3)])
        machine.chip.advance()
        skipped += 1
        assert sum(plant.periods for plant in machine.counted) - before < 20_000  # of millions
    assert skipped >= 3
