"""The MCP-1200 beside a reference model that knows nothing of it (mcp1200.py).

Random hosts drive one chip over its bus: every mode, changes on the fly, extremes, wraps, several
writes in one sample, faults during everything. After every sample status, flags and command
position are compared, a few other registers in turn, pins, and what the plant was driven with.

``VBUS_REFERENCE=10000000`` in the environment asks for that many samples instead of 100000. A host
is its seed: the same seed always does the same.
"""

import os
from collections.abc import Callable
from random import Random

import pytest

from tests.reference.mcp1200 import CONTROL, HALTED, IDLE, RESET, RESET_CLK, Reference
from vbus.chips.mcp1200.chip import MCP1200
from vbus.core.kernel import Clock, Kernel
from vbus.core.signals import OFF, Plant, Policy

SAMPLES = int(os.environ.get("VBUS_REFERENCE", "100000"))
EACH = 500
"""Samples of one host."""
SEEDS_OF_A_TEST = 4
HZ = 8_000_000
MOVING = 0.9
"""The encoder moves in the last part of a period only, after the host's accesses."""

STEP_MODE = 0x02
TIMER_REGISTERS = (0x0F, 0x10, 0x11)
PERIODS = (
    (0x40, 0x003F), (0x40, 0x003F), (0x26, 0x003F), (0x1F, 0x001F), (0xFF, 0x000F), (0x00, 0x0FFF),
    (0x63, 0x0027), (0x02, 0x0600),
)  # fmt: skip
"""Sample timer and pre-scaler; some are too short for what the core has to do (MCP-SMP-4)."""


class Mover(Plant):
    """Goes where the drive or chance sends it."""

    TAKES = ("drive", "pulses")

    def __init__(self, random: Random) -> None:
        super().__init__()
        self.random = random
        self.kind = random.choice(("follows", "motor", "walks", "still", "wild"))
        self.before = 0
        self.speed = 0
        self.moves: list[int] = []
        """What it has moved since the test last looked, period by period."""
        self.driven: list[float] = []

    def prepare(self, period: float) -> None:
        pass

    def drive(self, command: float, error: int) -> int:
        self.driven.append(command)
        random = self.random
        if self.kind == "follows":
            return self._go(max(-40000, min(40000, error)))
        if self.kind == "motor":
            self.speed += int(command * 12) - self.speed // 8
            return self._go(self.speed)
        if self.kind == "walks":
            return self._go(random.choice((0, 0, 1, -1, 2, -3, 30, -31)))
        if self.kind == "wild":
            most = 1 << random.randrange(19)
            return self._go(random.randrange(-most, most))
        return self._go(0)

    def pulses(self, steps: int) -> int:
        self.driven.append(steps)
        return self._go(self.random.choice((steps, steps, steps - 1, 0)))

    def _go(self, counts: int) -> int:
        self.moves.append(counts)
        self.before = self.count
        self.count += counts
        return self.count

    def count_at(self, fraction: float) -> int:
        part = min(max((fraction - MOVING) / 0.09, 0.0), 1.0)
        return self.before + int((self.count - self.before) * part)

    def fraction_at(self, count: int) -> float:
        return MOVING + 0.09 * ((count - self.before) / (self.count - self.before))


class Host:
    """One random host, its chip, and the model beside it."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        random = self.random = Random(seed)
        self.steps = random.random() < 0.25
        self.dac = random.random() < 0.5
        unipolar = random.choice(("magnitude", "clip"))
        self.kernel, self.clock = Kernel(), Clock(HZ)
        self.chip = MCP1200(
            "x", "MCP-1200", self.kernel, self.clock,
            {"drive": "dac" if self.dac else "pwm", "unipolar": unipolar},
            Policy(OFF), lambda _: None,
        )  # fmt: skip
        self.plant = Mover(random)
        self.chip.connect(0, self.plant)
        # With somebody at TRIG, an output too, the chip has to act at every edge: slow.
        inputs = ["/LIMIT", "/STOP", "/RESET", "INDEX"] + ["TRIG"] * (random.random() < 0.15)
        self.pins = {name: self.chip.pins[name].net.solder(f"host:{name}") for name in inputs}
        self.chip.power_on(True)
        for pin in self.pins.values():
            pin.drive(1)
        self.chip.advance()
        self.kernel.settle()
        self.model = Reference(unipolar)
        self.still_to_come = self.plant.moves.copy()
        """Moves of the period under way, which ends at the next sample's start."""
        self.plant.moves.clear()
        self.cycle = 0
        self.period = (0, 0)
        """The plant's period under way in the accesses: where it begins and ends."""
        self.sample = 0
        self.written: list[str] = []
        self.seen: set[str] = set()
        self.size = random.choice((2, 6, 10, 16, 22))
        """How large the numbers of this host's moves are, in bits."""

    # -- the bus -------------------------------------------------------------------------------

    def to(self, cycle: int) -> None:
        self.cycle = cycle
        self.kernel.run_until(self.clock.ps(cycle))

    def write(self, address: int, data: int) -> None:
        """A byte is visible inside four clocks after the bus cycle (MCP-BUS-5)."""
        data &= 0xFF
        if self.unsettled(address, data):
            return
        self.to(self.cycle + 4)
        self.chip.write(address, data)
        self.model.write(address, data, self.cycle + 4)
        self.written.append(f"{address:02X}<-{data:02X}")
        if self.model.state == RESET and self.model.started > self.cycle + 4:
            self.reset()

    def unsettled(self, address: int, data: int) -> bool:
        """Whether this is a reset that cannot be told apart from the plant's period under way."""
        model = self.model
        register = address if model.r[0x02] & 1 else address & 0x3F
        if register != 0x05 or data or model.state != IDLE:
            return False
        end = self.cycle + 4 + RESET_CLK
        first = end + 0x41 * (model.word(0x10, 0x11) + 1)
        return self.cut(end, end, first)

    def cut(self, earliest: int, latest: int, first: int) -> bool:
        """Whether the plant's period outlasts a reset and the sample after it, or moves at its end.

        The period under way in idle mode goes on in a reset (NOTES 5); what the encoder moves
        before its end is lost, and which part of a move that is the model does not know.

        Args:
            earliest: cycle in which the reset ends,
            latest: or this, or one between them.
            first: start of the first sample after it.
        """
        begin, end = self.period
        moves = begin + int(MOVING * (end - begin))
        return end > first or (moves <= latest and earliest < end)

    def reset(self) -> None:
        """A reset that has just begun; sometimes the host writes into it."""
        random = self.random
        end = self.model.started
        under_way = len(self.plant.moves) - 1
        while random.random() < 0.3 and self.cycle < end - 20:
            self.to(self.cycle + 4)
            address = random.randrange(0x80)
            data = self.byte(address)
            if address & 0x3F in TIMER_REGISTERS:
                continue
            self.chip.write(address, data)
            self.model.write(address, data, self.cycle + 4)
            self.written.append(f"{address:02X}<-{data:02X} in reset")
        self.advance(end)
        for counts in self.plant.moves[under_way:-1]:
            self.model.count(counts)
        self.model.end_reset()

    def put(self, addresses: tuple[int, ...], value: int) -> None:
        """Write a register of several bytes, in the order of ``addresses``."""
        for place, address in enumerate(addresses):
            self.write(address, value >> 8 * (len(addresses) - 1 - place))

    def compare(self, address: int) -> None:
        self.to(self.cycle + 2)
        self.chip.begin_read(address)
        got, expected = self.chip.end_read(), self.model.read(address, self.cycle)
        if got != expected:
            self.differ(f"R{address:02X}", f"{got:02X}", f"{expected:02X}")

    def drive(self, name: str, level: int) -> None:
        """Move an input, and let the filter of INDEX pass it on."""
        self.to(self.cycle + 4)
        self.chip.advance()
        self.pins[name].drive(level)
        self.kernel.settle()
        self.written.append(f"{name}={level}")
        if name == "INDEX":
            self.model.index(level, self.cycle + 3)
            self.to(self.cycle + 4)
        elif name != "/RESET":
            self.model.pin(name, level, self.cycle)

    def differ(self, what: str, got: object, expected: object) -> None:
        raise AssertionError(
            f"seed {self.seed}, sample {self.sample}: {what} is {got}, the model has {expected}; "
            f"the last writes, '|' is a sample: {' '.join(self.written[-30:])}"
        )

    # -- one sample ----------------------------------------------------------------------------

    def one(self) -> None:
        self.sample += 1
        self.written.append("|")
        model, plant = self.model, self.plant
        start = model.next_start
        self.advance(start - 1)
        for counts in *self.still_to_come, *plant.moves:
            model.count(counts)
        plant.moves.clear()
        work = model.start()
        self.driven = self.amplifier()
        too_short = work > model.period
        if work and self.random.random() < 0.1:
            self.busy()
        self.advance(start + (300 if too_short else work or 300))
        done = bool(work) and not too_short
        if len(plant.moves) != 1 + done:
            self.differ("number of the plant's periods", len(plant.moves), 1 + done)
        if done:
            model.count(plant.moves[0])
            model.results()
        if model.state == RESET:
            self.reset()
        else:
            if done:
                self.driven = self.amplifier()
            self.look(done)
            self.accesses()
        self.still_to_come = plant.moves[-1:]
        plant.moves.clear()

    def advance(self, cycle: int) -> None:
        self.to(cycle)
        self.chip.advance()
        self.kernel.settle()

    def busy(self) -> None:
        """While BUSY is high everything is as it was."""
        self.to(self.model.started + 200)
        for address in (0x07, 0x0E, 0x08, self.random.choice(REST)):
            self.compare(address)

    def amplifier(self) -> float:
        """What a servo's amplifier gets: a fraction of full scale."""
        r = self.model.r
        pwm = ((r[0x09] << 4 | r[0x4D] >> 4) ^ 0x800) - 0x800
        if not self.dac:
            return max(-1.0, min(1.0, pwm / 1600))
        code = (r[0x08] << 4 | r[0x4C] >> 4) - 0x800
        # A unipolar amplifier gets its direction from the Sign pin (NOTES 22).
        magnitude = r[0x01] & 0x04 and self.model.unipolar == "magnitude"
        return (-code if magnitude and pwm < 0 else code) / 0x800

    def look(self, done: bool) -> None:
        """Compare, after the sample's results or in the middle of an idle one."""
        random, model = self.random, self.model
        for address in (0x00, 0x07, 0x0C, 0x0D, 0x0E):
            self.compare(address)
        for _ in range(4):
            self.compare(random.choice(REST))
        if not model.r[0x02] & STEP_MODE:
            if self.plant.driven[-1] != self.driven:
                self.differ("the plant's drive", self.plant.driven[-1], self.driven)
        elif done and self.plant.driven[-1] != model.ahead:
            self.differ("steps to the plant", self.plant.driven[-1], model.ahead)
        name = random.choice(("PROF", "IDLE", "TRIG", "MC0-MC11", "BUSY"))
        got, expected = self.chip.pins[name].value, self.level(name)
        if got != expected:
            self.differ(f"pin {name}", got, expected)
        self.note(done)

    def level(self, name: str) -> int:
        model = self.model
        if name == "PROF":
            return int(model.prof)
        if name == "IDLE":
            return int(model.state == IDLE)
        if name == "TRIG":
            return int(model.trig and model.trig_level)
        if name == "BUSY":
            return model.busy(self.cycle)
        return model.r[0x08] << 4 | model.r[0x4C] >> 4

    def note(self, done: bool) -> None:
        """Keep what this host has brought about."""
        model = self.model
        if done:
            self.seen.add(f"mode {model.mode}")
            self.seen.add(f"action {model.action}")
            self.seen.add(f"mode {model.mode} action {model.action}")
        self.seen.add(f"state {model.state}")
        self.seen.add(f"phase {model.r[0x06]}")
        for bit in range(3, 8):
            if not model.r[0x07] >> bit & 1:
                self.seen.add(f"status {bit}")

    # -- what hosts do -------------------------------------------------------------------------

    def accesses(self) -> None:
        """What the host does in this sample; the encoder does not move meanwhile."""
        random, model = self.random, self.model
        begun = max(model.busy_until, model.started)
        self.period = (begun, model.next_start)
        room = begun + int(MOVING * (model.next_start - begun)) - 200
        for _ in range(random.choice((0, 0, 0, 1, 1, 2, 4))):
            if self.cycle < room:
                random.choice(HABITS)(self)

    def number(self, bits: int) -> int:
        """Any number of so many bits: extremes and small ones more often than the rest."""
        random = self.random
        if random.randrange(8) == 0:
            return random.choice((0, 0, 1, (1 << bits) - 1, 1 << bits - 1, (1 << bits - 1) - 1))
        return random.randrange(1 << random.randrange(1, bits + 1))

    def byte(self, address: int) -> int:
        """Any byte for a register; R1A's filter stays off, which would make INDEX late."""
        return self.random.randrange(0x100) & (0x8F if address & 0x3F == 0x1A else 0xFF)

    def near(self) -> int:
        """A small number of either sign."""
        random = self.random
        most = 1 << random.randrange(1, self.size + 1)
        return random.randrange(-most, most)

    def place(self, around: int) -> int:
        return around + self.near() if self.random.random() < 0.8 else self.number(24)

    def flags(self) -> None:
        random = self.random
        if random.random() < 0.5:
            self.write(0x00, random.choice((0x08, 0x08, 0x0B, 0x0C, 0x0D)))
        else:
            self.write(0x00, random.randrange(0x100))

    def switch(self) -> None:
        """Go from one mode to another, whichever flag is written first."""
        old, new = self.random.sample((0, 3, 4, 5), 2)
        for byte in self.random.sample((old, new | 8), 2):
            self.write(0x00, byte)

    def mode(self) -> None:
        self.write(0x05, self.random.choice((0, 1, 1, 2, 3, 3, 3, 3, 3, 9)))

    def hard_reset(self) -> None:
        end = self.cycle + RESET_CLK
        if self.random.random() < 0.9 or self.cut(end, end + 50, end + 0x1040):
            return
        self.drive("/RESET", 0)
        self.to(self.cycle + self.random.randrange(2, 40))
        self.drive("/RESET", 1)
        self.model.hard_reset(self.cycle)
        self.reset()

    def start_up(self) -> None:
        """What a sane host does to get going."""
        self.write(0x46, 0)
        self.let_go()
        self.write(0x05, 3)

    def travel(self) -> None:
        self.final()
        self.write(0x28, self.random.randrange(1, 128))
        self.put((0x27, 0x26), self.random.randrange(1, 1 << self.random.choice((8, 10, 12))))
        self.put((0x55, 0x54), self.number(16) or 1)
        self.write(0x00, 0x08)

    def final(self) -> None:
        self.put((0x2B, 0x2A, 0x29), self.place(self.model.command))

    def motion(self) -> None:
        random = self.random
        kind = random.randrange(6)
        if kind == 0:
            self.write(0x28, self.number(8))
        elif kind == 1:
            self.put((0x27, 0x26), self.number(random.choice((8, 10, 16))))
        elif kind == 2:
            sign = random.choice((1, -1))
            self.put((0x23, 0x24, 0x25), sign * self.number(random.choice((10, 14, 24))))
        elif kind == 3:
            self.write(0x3C, self.near())
        elif kind == 4:
            self.put((0x55, 0x54), self.number(16))
        else:
            self.write(0x18, random.choice((0, 0, 1, 2, 3, random.randrange(256))))

    def positions(self) -> None:
        kind = self.random.randrange(5)
        if kind < 2:
            self.write(0x0B, self.near())
        elif kind == 2:
            self.put((0x0C, 0x0D, 0x0E), self.place(self.model.command))
        elif kind == 3:
            self.put((0x15, 0x16, 0x17), self.place(self.model.actual))
        else:
            self.write(0x13, 0)

    def breakpoint(self) -> None:
        self.put((0x3F, 0x3E, 0x3D), self.place(self.random.choice((0, self.model.actual))))

    def faults(self) -> None:
        random = self.random
        kind = random.randrange(5)
        if kind == 0:
            self.write(0x04, random.randrange(256))
        elif kind == 1:
            self.write(0x46, random.choice((0, 0, random.randrange(256))))
        elif kind == 2:
            self.put((0x4A, 0x49), self.number(16))
        else:
            self.write(0x07, random.randrange(256))

    def pull(self) -> None:
        random = self.random
        name = random.choice(("/LIMIT", "/STOP"))
        self.drive(name, 0)
        if random.random() < 0.6:
            self.drive(name, 1)

    def let_go(self) -> None:
        for name in ("/LIMIT", "/STOP"):
            self.drive(name, 1)
        self.write(0x07, 0)

    def capture(self) -> None:
        random = self.random
        if random.random() < 0.5:
            self.write(0x03, random.randrange(256))
        name = random.choice(list(self.pins)[3:])
        for level in random.choice(((0,), (1,), (0, 1))):
            self.drive(name, level)

    def filters(self) -> None:
        random = self.random
        address = random.choice((
            0x0A, 0x20, 0x21, 0x22, 0x44, 0x45, 0x4B, 0x56, 0x57, 0x61, 0x62, 0x63, 0x64, 0x64,
            0x65, 0x66, 0x69, 0x6A,
        ))  # fmt: skip
        self.write(address, random.choice((self.number(8), 0, random.randrange(9))))

    def features(self) -> None:
        random = self.random
        bit = random.choice((random.randrange(8), 3, 4))
        self.write(0x01, self.model.r[0x01] ^ 1 << bit)

    def configuration(self) -> None:
        """Any bit; extended addressing is rarely off for long."""
        random = self.random
        bit = random.choice((0, 2, 3, 4, 4, 5, 6, 7))
        self.write(0x02, self.model.r[0x02] ^ 1 << bit | (random.random() < 0.9))

    def timer(self) -> None:
        if self.random.random() < 0.1:
            timer, prescaler = self.random.choice(PERIODS)
            self.put((0x10, 0x11), prescaler)
            self.write(0x0F, timer)

    def ratio(self) -> None:
        if self.steps:
            self.put((0x1C, 0x1D), self.random.choice((0, self.number(9), self.number(16), 0x100)))

    def any_byte(self) -> None:
        random = self.random
        address = random.randrange(0x80)
        register = address if self.model.r[0x02] & 1 else address & 0x3F
        # These have habits of their own.
        if register not in (0x02, 0x05, *TIMER_REGISTERS):
            self.write(address, self.byte(address))


HABITS: tuple[Callable[[Host], None], ...] = (
    *[Host.travel] * 3, *[Host.start_up] * 2, *[Host.motion] * 3, *[Host.final] * 2,
    *[Host.faults] * 2, *[Host.filters] * 2, Host.flags, Host.switch, Host.mode, Host.positions,
    Host.breakpoint, Host.pull, Host.let_go, Host.capture, Host.features, Host.configuration,
    Host.timer, Host.ratio, Host.any_byte, Host.hard_reset,
)  # fmt: skip

REST = tuple(address for address in range(0x80) if address != 0x07)


def run(seed: int, samples: int = EACH) -> Host:
    """Run one host."""
    host = Host(seed)
    for _ in range(samples):
        host.one()
    return host


@pytest.mark.spec("MCP-RST-1", "MCP-RST-3", "MCP-RST-4", "MCP-RST-5", "MCP-MOD-1", "MCP-MOD-2")
@pytest.mark.spec("MCP-MOD-4", "MCP-MOD-5", "MCP-MOD-6", "MCP-MOD-7", "MCP-MOD-8", "MCP-MOD-9")
@pytest.mark.spec("MCP-FLG-1", "MCP-FLG-2", "MCP-FLG-4", "MCP-FLG-5", "MCP-STA-1", "MCP-STA-2")
@pytest.mark.spec("MCP-STA-3", "MCP-STA-4", "MCP-SMP-1", "MCP-SMP-3", "MCP-SMP-4", "MCP-SMP-5")
@pytest.mark.spec("MCP-SMP-6", "MCP-POS-1", "MCP-POS-2", "MCP-ERR-1", "MCP-ERR-2", "MCP-ERR-3")
@pytest.mark.spec("MCP-ERR-4", "MCP-TRP-1", "MCP-TRP-2", "MCP-TRP-3", "MCP-TRP-4", "MCP-TRP-5")
@pytest.mark.spec("MCP-TRP-6", "MCP-TRP-7", "MCP-TRP-8", "MCP-SCV-1", "MCP-SCV-2", "MCP-SCV-3")
@pytest.mark.spec("MCP-SCV-4", "MCP-SCV-5", "MCP-VEL-1", "MCP-VEL-3", "MCP-VEL-4", "MCP-INT-1")
@pytest.mark.spec("MCP-INT-2", "MCP-INT-3", "MCP-INT-4", "MCP-INT-5", "MCP-INT-6", "MCP-EXC-1")
@pytest.mark.spec("MCP-EXC-2", "MCP-EXC-3", "MCP-EXC-4", "MCP-EXC-5", "MCP-EXC-6", "MCP-EXC-7")
@pytest.mark.spec("MCP-BRK-1", "MCP-BRK-2", "MCP-BRK-3", "MCP-BRK-4", "MCP-BRK-5", "MCP-CAP-2")
@pytest.mark.spec("MCP-CAP-3", "MCP-FLT-2", "MCP-FLT-3", "MCP-FLT-4", "MCP-FLT-5", "MCP-OUT-1")
@pytest.mark.spec("MCP-OUT-2", "MCP-OUT-3", "MCP-OUT-4", "MCP-OUT-9", "MCP-STP-1", "MCP-STP-2")
@pytest.mark.spec("MCP-STP-4")
@pytest.mark.parametrize("first", range(0, max(1, SAMPLES // EACH), SEEDS_OF_A_TEST))
def test_chip_and_model_agree(first: int) -> None:
    for seed in range(first, first + SEEDS_OF_A_TEST):
        run(seed)


def test_the_same_seed_makes_the_same_host() -> None:
    first, again, other = (run(seed, 50).written for seed in (5, 5, 6))
    assert first == again
    assert first != other


def test_a_few_hosts_bring_about_every_mode_phase_state_and_fault() -> None:
    seen: set[str] = set().union(*(run(seed).seen for seed in range(4)))
    wanted = {f"mode {mode} action {action}" for mode in range(5) for action in (0, 2)}
    wanted |= {"mode 0 action 3", *(f"state {state}" for state in (IDLE, HALTED, CONTROL))}
    wanted |= {f"phase {phase}" for phase in range(7)} | {f"status {bit}" for bit in range(3, 8)}
    assert wanted <= seen


def test_a_difference_is_told_with_all_it_takes_to_find_it() -> None:
    host = run(7, 20)
    host.model.command += 0x1234
    told = "seed 7, sample 21: R07 is FC, the model has F8; the last writes, .* 64<-03 [|] [|]$"
    with pytest.raises(AssertionError, match=told):
        host.one()
