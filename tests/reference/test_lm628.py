"""The LM628 and LM629 beside their reference model, over random hosts, sample by sample.

Every host talks to the chip through its bus and tells the model the same: what it reads, what the
pins show and what the motor is driven with must be the same in every sample. A run depends on its
seed alone; ``run(seed, samples)`` does it again.

100,000 samples are run. ``VBUS_REFERENCE=10_000_000`` in the environment asks for that many.
"""

import os
from collections import deque
from collections.abc import Iterator
from itertools import count, cycle, islice
from random import Random

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench
from tests.reference import lm628 as reference
from vbus.core.kernel import NEVER, NS, US
from vbus.core.signals import HIGH, LOW, Plant

SAMPLES = int(os.environ.get("VBUS_REFERENCE", "100_000"))
BOARD_SAMPLES = 500
"""Samples of one seed, which is a board and its host."""
SEEDS_OF_A_TEST = 4

RESET, STT, DFH, SIP, UDF, PORT8, PORT12 = range(7)
RDDV, RDDP, RDIP, RDRP, RDRV, RDSIGS, RDSUM = range(7, 14)
LPES, LPEI, MSKI, RSTI, LFIL, LTRJ, SBPA, SBPR = range(0x1A, 0x22)
REPORTED = {RDDV: 4, RDDP: 4, RDIP: 4, RDRP: 4, RDRV: 2, RDSIGS: 2, RDSUM: 2}
"""Bytes of each report."""
NAMES = ("RDDV", "RDDP", "RDIP", "RDRP", "RDRV", "RDSIGS", "RDSUM")
ROTATING = (RDDP, RDDV, RDRP, RDSUM, RDRV, RDDP, RDSUM, RDIP)
READ = -1
"""In a packet's data: a byte is read, not written."""

Step = tuple[object, ...]
"""What a host does: the name of a method of :class:`Pair`, and its arguments."""


def word(value: int) -> tuple[int, ...]:
    return value >> 8 & 0xFF, value & 0xFF


def long(value: int) -> tuple[int, ...]:
    return *word(value >> 16), *word(value)


def dump(data: tuple[int, ...]) -> str:
    return " ".join("rd" if byte == READ else f"{byte:02X}" for byte in data)


def shown(value: object) -> str:
    return f"{value:X}h" if isinstance(value, int) else str(value)


class Course(Plant):
    """An encoder that goes where it is told, by one leap in the middle of each sample."""

    def __init__(self) -> None:
        super().__init__()
        self.before = 0
        self.plan: deque[tuple[int, int | None]] = deque()
        """Where it will stand at the end of each sample, and at which count it meets an index."""
        self.index: int | None = None
        self.stands = False
        """Whether nothing will be added to the plan any more."""
        self.driven: list[tuple[float, int]] = []

    def prepare(self, period: float) -> None:
        pass

    def drive(self, command: float, error: int) -> int:
        self.driven.append((command, error))
        self.before = self.count
        if self.plan:
            self.count, self.index = self.plan.popleft()
        else:
            assert self.stands
            self.index = None
        return self.count

    def count_at(self, fraction: float) -> int:
        return self.before if fraction < 0.5 else self.count

    def fraction_at(self, count: int) -> float:
        return 0.5

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        index = self.index
        if index is None or not (start < index <= end or end <= index < start):
            return False, 0
        return True, index

    def resting(self) -> bool:
        return self.stands and not self.plan and self.before == self.count


class Pair:
    """The chip and its model, with one host and one encoder."""

    def __init__(self, seed: int) -> None:
        random = Random(seed)
        self.seed = seed
        part = random.choice(("LM628N-8", "LM629N-8"))
        settings = {
            "pid_overflow": random.choice(("saturate", "saturate", "wrap")),
            "integral_limit": random.choice(("term", "sum")),
            "reset_status": random.choice(("84", "84", "C4")),
        }
        self.reset_time = random.randrange(20, 1000) * US + 7
        self.course = Course()
        self.course.plan.append((0, None))
        done = random.random() < 0.8
        self.bench = Bench(
            "cycle",
            part,
            plant=self.course,
            done=done,
            busy_clk=random.choice((1, 8, 50, 120)),
            reset_time=self.reset_time,
            **settings,
        )
        self.chip = self.bench.chip
        self.model = reference.LM628(part, **settings)
        # Time; nothing but the sample itself is at a whole number of clock periods.
        self.sample_at = SAMPLE
        self.index_at = NEVER
        self.reset_at = NEVER
        self.samples = 0
        # Encoder.
        self.count = 0
        self.next_count = 0
        self.next_index: int | None = None
        self.ways = Random(seed)
        self.way, self.way_size = "stand", 0
        self.meets_index = False
        # What the motor is driven with, as the model has it.
        self.drives: list[tuple[float, int]] = [(0.0, 0)]
        self.packets: deque[str] = deque(maxlen=20)
        self.reports = cycle(ROTATING)
        self.poked: tuple[float, str, int] | None = None
        self.polls = random.random() < 0.3
        """Whether the host reads the status byte before each cycle, as drivers do."""
        if not done:
            self.model.reset()
            self.run_reset(0)
        self.run_for(1)

    # -- time ---------------------------------------------------------------------------------

    def run_for(self, duration: int) -> None:
        self.run_to(self.bench.now + duration)

    def run_to(self, when: int, sampled: bool = True) -> None:
        """Come to ``when``; unless ``sampled``, a sample at that instant is still to come."""
        while (due := min(self.sample_at, self.index_at, self.reset_at)) <= when:
            if due == self.reset_at:
                self.model.reset_done(self.count_at(due))
                self.reset_at = NEVER
            elif due == self.index_at:
                assert self.next_index is not None
                self.model.index(self.next_index)
                self.index_at = NEVER
            elif due < when or sampled:
                self.sample()
            else:
                break
        self.bench.at(when)

    def count_at(self, when: int) -> int:
        return self.count if self.sample_at - when > SAMPLE // 2 else self.next_count

    def sample(self) -> None:
        model = self.model
        self.count = self.next_count
        model.sample(self.count)
        self.drives.append(self.drive())
        self.plan()
        if self.next_index is not None:
            self.index_at = self.sample_at + SAMPLE // 2
        self.sample_at += SAMPLE
        self.samples += 1

    def drive(self) -> tuple[float, int]:
        """Return what the motor is driven with, and how far the desired position is away."""
        model = self.model
        if model.motor_off or model.in_reset:
            return 0.0, 0
        if model.lm629:
            command = (-model.magnitude if model.sign else model.magnitude) / 128
        else:
            zero = 1 << model.code_bits - 1
            command = (model.code - zero) / zero
        return command, reference.wrapped((model.desired >> 16) - model.real)

    # -- encoder ------------------------------------------------------------------------------

    def plan(self) -> None:
        """Choose where the encoder goes until the next sample."""
        if self.course.stands:
            self.next_index = None
            return
        step = 0
        match self.way:
            case "walk":
                step = self.ways.randint(-self.way_size, self.way_size)
            case "run":
                step = self.way_size
            case "follow":
                error = reference.wrapped((self.model.desired >> 16) - self.model.real)
                step = error + self.ways.randint(-self.way_size, self.way_size)
            case "lag":
                error = reference.wrapped((self.model.desired >> 16) - self.model.real)
                step = error // (2 + self.way_size)
            case "leap":
                step = self.way_size
                self.way = "stand"
        self.next_count = self.count + step
        self.next_index = None
        if self.meets_index and step:
            first, last = sorted((self.count, self.next_count))
            index = self.ways.randint(first, last)
            self.next_index = index if index != self.count else self.next_count
            self.meets_index = False
        self.course.plan.append((self.next_count, self.next_index))

    def go(self, way: str, size: int) -> None:
        self.way, self.way_size = way, size

    def meet_index(self) -> None:
        self.meets_index = True

    def stand(self) -> None:
        """The encoder stands from now on, for good: a chip at rest may pass samples over."""
        self.course.stands = True

    # -- the host -----------------------------------------------------------------------------

    def access(self, kind: str, byte: int = 0) -> tuple[int, int]:
        """Make one bus cycle at the data or command port, and wait until busy has fallen.

        Returns:
            What the chip and the model gave to be read.
        """
        chip, model = self.chip, self.model
        got = ours = 0
        self.run_for(400 * NS)
        if self.polls:
            self.read_status(0)
        if kind == "command":
            chip.write(0, byte)
        elif kind == "write":
            chip.write(1, byte)
        else:
            chip.begin_read(1)
            ours, busy = model.read()
            got = chip.end_read()
        if kind == "command" and byte == RESET:
            model.command(byte)
            self.run_reset(1)
            return 0, 0
        ready = chip.ready_at()
        is_busy = ready > self.bench.now
        if is_busy:
            self.poke(ready, 1)
            # What ends at the instant of a sample is seen by it (LM-TRJ-17).
            self.run_to(ready, sampled=False)
        if kind == "command":
            model.command(byte)
            busy = True
        elif kind == "write":
            busy = model.write(byte)
        self.run_to(self.bench.now)
        self.agree("busy", is_busy, busy)
        return got, ours

    def poke(self, ready: int, busy: int) -> None:
        """Do what was asked for while the chip is busy: nothing comes of it (LM-BUS-10)."""
        if self.poked is None:
            return
        fraction, kind, byte = self.poked
        self.poked = None
        now = self.bench.now
        self.run_to(now + int((ready - now) * fraction))
        if kind == "status":
            self.read_status(busy)
        elif kind == "read":
            self.chip.begin_read(1)
            self.agree("data while busy", self.chip.end_read(), self.model.last_byte)
        else:
            self.chip.write(kind == "write", byte)

    def plan_poke(self, fraction: float, kind: str, byte: int) -> None:
        self.poked = fraction, kind, byte

    def packet(self, code: int, *data: int) -> None:
        """A command byte, and data bytes written or read."""
        self.packets.append(f"{self.samples}: {dump((code, *data))}")
        self.access("command", code)
        self.data(*data)

    def data(self, *data: int) -> None:
        for byte in data:
            if byte == READ:
                self.agree("data", *self.access("read"))
            else:
                self.access("write", byte)

    def stray(self, *data: int) -> None:
        """Data bytes without a command."""
        self.packets.append(f"{self.samples}: data {dump(data)}")
        self.data(*data)

    def breakpoint_ahead(self, offset: int) -> None:
        """SBPA near where the motor is."""
        self.packet(SBPA, *long(reference.wrapped(self.model.real + offset)))

    def go_near(self, control: int, offset: int, *rates: int) -> None:
        """LTRJ to a position near the desired one, and STT."""
        position = reference.wrapped((self.model.desired >> 16) + offset)
        self.packet(LTRJ, *word(control), *rates, *long(position))
        self.packet(STT)

    def reset_pin(self, low: int) -> None:
        self.packets.append(f"{self.samples}: /RST")
        self.bench.set(**{"/RST": LOW})
        self.run_for(low)
        self.bench.set(**{"/RST": HIGH})
        self.model.reset()
        self.run_reset(0)

    def run_reset(self, busy: int) -> None:
        """Wait for the end of the reset that begins now (LM-RST-4), and look at its result."""
        ready = self.reset_at = self.chip.ready_at()
        self.agree("length of the reset", ready - self.bench.now, self.reset_time)
        self.poke(ready, busy)
        self.run_to((self.bench.now + ready) // 2)
        self.read_status(busy)
        self.compare_pins()
        self.run_to(ready)
        self.read_status(0)
        self.compare_pins()
        for code in REPORTED:
            self.report(code)

    def edge(self, before: int) -> None:
        """Wait until so much before the next sample."""
        self.run_to(max(self.bench.now, self.sample_at - before))

    def passes(self, samples: int) -> None:
        """Look after each of these samples."""
        for _ in range(samples):
            self.run_to(self.sample_at + 1)
            self.look()

    def skip(self, samples: int) -> None:
        """Look after these samples."""
        self.run_to(self.sample_at + (samples - 1) * SAMPLE + 1)
        self.look()

    # -- comparison ---------------------------------------------------------------------------

    def look(self) -> None:
        """Compare everything."""
        self.read_status(0)
        self.compare_pins()
        self.compare_drives()
        if not self.model.to_write and not self.model.to_read:
            self.report(RDSIGS)
            self.report(next(self.reports))

    def report(self, code: int) -> None:
        self.access("command", code)
        both = [self.access("read") for _ in range(REPORTED[code])]
        got, ours = (int.from_bytes(data, "big") for data in zip(*both, strict=True))
        self.agree(NAMES[code - RDDV], got, ours)

    def read_status(self, busy: int) -> None:
        self.chip.begin_read(0)
        self.agree("status", self.chip.end_read(), self.model.status() | busy)

    def compare_pins(self) -> None:
        """Compare HI and, where they are steady, the pins of the motor command."""
        pin, model = self.bench.pin, self.model
        self.agree("HI", pin("HI"), int(model.hi()))
        if model.lm629:
            self.agree("SIGN", pin("SIGN"), int(model.sign))
        elif model.code_bits == 8:
            code = sum(pin(f"DAC{bit}") << bit for bit in range(8))
            self.agree("DAC7 to DAC0", code, model.code)

    def compare_drives(self) -> None:
        self.chip.advance()
        chip, ours = self.course.driven, self.drives
        if self.course.stands:
            chip, ours = chip[-1:], ours[-1:]
        self.agree("drive", chip, ours)
        self.course.driven, self.drives = chip[-1:], ours[-1:]

    def agree(self, what: str, chip: object, ours: object) -> None:
        if chip != ours:
            packets = "\n".join(self.packets)
            raise AssertionError(
                f"seed {self.seed}, sample {self.samples}: {what} is {shown(chip)}, in the "
                f"reference {shown(ours)}\n{self.chip.part}, {self.chip.settings}\n"
                f"last packets (sample: bytes, rd = read):\n{packets}"
            )


class Host:
    """A random host: what it does, step by step."""

    def __init__(self, seed: int) -> None:
        self.random = random = Random(~seed)
        self.sane = random.random() < 0.6
        self.a = 1 << random.randrange(8, 20)
        self.v = self.a * random.choice((1, 2, 5, 20))
        self.far = random.random() < 0.3
        self.winds_up = random.random() < 0.06
        self.stands_after = random.randrange(60) if random.random() < 0.1 else -1
        """Packets or so after which the encoder stands for good."""

    def steps(self) -> Iterator[Step]:
        random = self.random
        if self.far:
            yield "go", "leap", random.choice((1 << 30, -(1 << 30))) + random.randint(-2000, 2000)
            yield "passes", 2
            yield "packet", RSTI, 0, 0
            yield from self.across()
        if self.winds_up:
            yield from self.wind_up()
        if self.sane:
            yield from self.filter()
            yield from self.course()
            yield from self.move()
        kinds = (
            (self.move, 8), (self.near, 3), (self.stop, 3), (self.start, 3), (self.filter, 3),
            (self.filters, 1), (self.threshold, 1), (self.breakpoint, 3), (self.interrupts, 3),
            (self.simple, 4), (self.report, 3), (self.wrong, 2), (self.cut, 2), (self.poke, 2),
            (self.edge, 2), (self.course, 5), (self.index, 2), (self.recover, 2),
        )  # fmt: skip
        methods = [method for method, weight in kinds for _ in range(weight)]
        if self.far:
            methods += [self.across] * 2
        for number in count():
            yield from random.choice(methods)()
            if random.random() < 0.6:
                yield "passes", random.choice((1, 1, 2, 3, 5, 12))
            elif random.random() < 0.1:
                yield "skip", random.choice((2, 5, 30))
            if number == self.stands_after:
                yield ("stand",)
            elif number > self.stands_after >= 0 and random.random() < 0.2:
                yield "skip", random.randrange(20, 120)

    def across(self) -> Iterator[Step]:
        """At a constant velocity, one way or the other, from where the motor is."""
        random = self.random
        yield "packet", LTRJ, *word(0x0200)
        yield "packet", STT
        control = random.choice((0x0828, 0x1828))
        speed = random.randrange(10 << 16, 400 << 16)
        yield "packet", LTRJ, *word(control), *long(random.randrange(speed)), *long(speed)
        yield "packet", STT
        yield "go", random.choice(("follow", "follow", "lag")), random.randrange(3)
        yield "passes", random.randrange(1, 20)

    def wind_up(self) -> Iterator[Step]:
        """An integrator filled to its 24 bits, and part of the way back."""
        random = self.random
        leap = random.choice((1 << 20, -(1 << 20)))
        data = word(0x000F) + word(random.randrange(9)) + word(random.choice((0, 1, 255, 256)))
        yield "packet", LFIL, *data, *word(0), *word(random.choice((0x7FFF, 0x7FFE)))
        yield "packet", UDF
        yield "packet", STT
        yield "go", "leap", leap
        yield "skip", random.randrange(250, 270)
        yield "passes", 5
        yield "go", "leap", -2 * leap
        yield "passes", 5

    # -- numbers ------------------------------------------------------------------------------

    def any_word(self) -> int:
        random = self.random
        if random.random() < 0.2:
            return random.choice((0, 1, 0x7FFF, 0x8000, 0xFFFF))
        return random.randrange(1 << random.randrange(1, 17))

    def any_long(self) -> int:
        random = self.random
        if random.random() < 0.2:
            return random.choice((0, 1, 0x3FFFFFFF, 0x40000000, 0x80000000, 0xC0000000, 0xFFFFFFFF))
        value = random.randrange(1 << random.randrange(1, 33))
        return random.choice((value, -value)) & 0xFFFFFFFF

    def rate(self, usual: int, relative: int) -> int:
        random = self.random
        if not self.sane or random.random() < 0.05:
            return self.any_long()
        if relative:
            return random.randint(-usual, usual)
        return random.choice((usual, random.randrange(2 * usual)))

    def distance(self) -> int:
        random = self.random
        reach = max(2, (self.v >> 16) * random.choice((2, 10, 40)))
        return random.randint(-reach, reach)

    # -- packets ------------------------------------------------------------------------------

    def trajectory(self, control: int) -> tuple[int, ...]:
        """The data of LTRJ."""
        data = word(control)
        if control & 0x20:
            data += long(self.rate(self.a, control & 0x10))
        if control & 0x08:
            data += long(self.rate(self.v, control & 0x04))
        if control & 0x02:
            position = self.distance()
            if not self.sane or self.random.random() < 0.05:
                position = self.any_long()
            data += long(position)
        return data

    def control(self) -> int:
        """A control word without stop bits."""
        random = self.random
        control = random.choice((0, 0, 0, 0x0800, 0x1800, 0x1000))
        control |= random.choice((0x2A, 0x0A, 0x0A, 0x02, 0x02, 0x08, 0x20, 0x22, 0x28, 0))
        if random.random() < 0.4:
            control |= random.choice((0x01, 0x01, 0x15, 0x05, 0x10, 0x04))
        if random.random() < 0.05:
            control |= random.randrange(1 << 16) & 0xE0C0
        return control

    def move(self) -> Iterator[Step]:
        random = self.random
        yield "packet", LTRJ, *self.trajectory(self.control())
        if random.random() < 0.1:
            yield "passes", 1
        if random.random() < 0.85:
            yield "packet", STT
            if random.random() < 0.1:
                yield "packet", LTRJ, *self.trajectory(self.control())
            if random.random() < 0.15:
                yield "packet", STT

    def near(self) -> Iterator[Step]:
        random = self.random
        rates: tuple[int, ...] = ()
        control = random.choice((0x0002, 0x0002, 0x000A, 0x002A))
        if control & 0x20:
            rates += long(self.rate(self.a, 0))
        if control & 0x08:
            rates += long(self.rate(self.v, 0))
        yield "go_near", control, self.distance(), *rates

    def stop(self) -> Iterator[Step]:
        random = self.random
        control = random.choice((0x100, 0x200, 0x400, 0x400, 0x600, 0x500, 0x700))
        control |= random.choice((0, 0, 0, 0x0800, 0x1800))
        if random.random() < 0.3:
            control |= self.control() & 0x3F
        yield "packet", LTRJ, *self.trajectory(control)
        if random.random() < 0.9:
            yield "packet", STT
        if random.random() < 0.4:
            yield "passes", random.choice((1, 2, 6))
            yield from random.choice((self.relative, self.start, self.breakpoint, self.relative))()

    def relative(self) -> Iterator[Step]:
        control = self.random.choice((0x0003, 0x000B, 0x000F, 0x0803))
        yield "packet", LTRJ, *self.trajectory(control)
        yield "packet", STT

    def start(self) -> Iterator[Step]:
        yield "packet", STT
        if self.random.random() < 0.1:
            yield "packet", STT

    def recover(self) -> Iterator[Step]:
        """Motor on, and the profile as a host begins it that lost its way."""
        yield "packet", LTRJ, *word(0x0100)
        yield "packet", STT
        yield "passes", 1
        yield "packet", LTRJ, *self.trajectory(0x002A)
        yield "packet", STT

    def filter(self) -> Iterator[Step]:
        random = self.random
        control = random.choice((0x0F, 0x0F, 0x08, 0x01, 0x06, random.randrange(256)))
        if random.random() < 0.5:
            control |= random.choice((0x0100, 0x0300, 0xFF00, random.randrange(256) << 8))
        data = word(control)
        for bit, usual in ((8, 300), (4, 60), (2, 2000), (1, 3000)):
            if control & bit:
                data += word(random.randrange(usual) if self.sane else self.any_word())
        yield "packet", LFIL, *data
        if random.random() < 0.85:
            yield "packet", UDF

    def filters(self) -> Iterator[Step]:
        for _ in range(self.random.randint(2, 4)):
            yield from self.filter()

    def threshold(self) -> Iterator[Step]:
        random = self.random
        value = random.choice((self.any_word(), random.randrange(300)))
        yield "packet", random.choice((LPES, LPEI)), *word(value)
        if random.random() < 0.6:
            yield "passes", random.choice((1, 4))
            yield "packet", LPEI, *word(0x7FFF)

    def breakpoint(self) -> Iterator[Step]:
        random = self.random
        offset = random.choice((0, 1, -1, self.distance(), self.any_long()))
        if random.random() < 0.5:
            yield "breakpoint_ahead", offset
        else:
            yield "packet", random.choice((SBPA, SBPR, SBPR)), *long(offset)

    def interrupts(self) -> Iterator[Step]:
        random = self.random
        value = random.choice((0, 0, self.any_word(), 1 << random.randrange(8)))
        yield "packet", random.choice((RSTI, RSTI, MSKI)), *word(value)

    def simple(self) -> Iterator[Step]:
        code = self.random.choice((DFH, DFH, SIP, UDF, PORT8, PORT12))
        yield "packet", code

    def report(self) -> Iterator[Step]:
        code = self.random.choice(tuple(REPORTED))
        yield "packet", code, *(READ,) * REPORTED[code]

    # -- what a host should not do ------------------------------------------------------------

    def wrong(self) -> Iterator[Step]:
        random = self.random
        match random.randrange(6):
            case 0:
                yield "packet", random.choice((0x0E, 0x10, 0x19, 0x22, 0x80, 0xFF))
            case 1:
                yield "stray", READ
            case 2:
                yield "stray", random.randrange(256)
            case 3:
                code = random.choice(tuple(REPORTED))
                data = [READ] * REPORTED[code]
                data.insert(random.randint(0, len(data)), random.choice((0x55, 0xAA, READ)))
                yield "packet", code, *data
            case 4:
                data = list(self.trajectory(self.control()))
                data.insert(random.randint(0, len(data)), READ)
                yield "packet", LTRJ, *data
            case 5:
                if random.random() < 0.3:
                    yield "packet", RESET
                elif random.random() < 0.3:
                    yield "reset_pin", random.randrange(1, 600) * US

    def cut(self) -> Iterator[Step]:
        """A packet that is not finished, sometimes with a rest that comes later."""
        random = self.random
        makers = (self.move, self.stop, self.filter, self.breakpoint, self.threshold, self.report)
        step = next(iter(random.choice(makers)()))
        if step[0] != "packet":
            yield step
            return
        _, code, *data = step
        where = random.randint(0, len(data))
        yield "packet", code, *data[:where]
        if random.random() < 0.3:
            yield "passes", random.randint(1, 3)
            yield "stray", *data[where:]

    def poke(self) -> Iterator[Step]:
        random = self.random
        kind = random.choice(("status", "read", "write", "command"))
        yield "plan_poke", random.random() * 0.99, kind, random.randrange(256)

    def edge(self) -> Iterator[Step]:
        yield "edge", self.random.randrange(2, 40_000) * NS
        if self.random.random() < 0.5:
            yield from self.start()

    # -- encoder ------------------------------------------------------------------------------

    def course(self) -> Iterator[Step]:
        random = self.random
        size = 1 << random.randrange(12)
        match random.choice(("follow", "follow", "lag", "lag", "walk", "run", "stand", "leap")):
            case "run":
                yield "go", "run", random.choice((size, -size))
            case "leap":
                way = 1 << random.randrange(31)
                yield "go", "leap", random.choice((way, -way)) + random.randint(-9, 9)
            case "follow":
                yield "go", "follow", random.choice((0, 0, 1, 5, size))
            case "lag":
                yield "go", "lag", random.randrange(20)
            case way:
                yield "go", way, size

    def index(self) -> Iterator[Step]:
        yield "packet", SIP
        if self.random.random() < 0.5:
            yield "passes", 1
        yield ("meet_index",)


def run(seed: int, samples: int) -> None:
    """Run one host on one board."""
    pair = Pair(seed)
    for name, *arguments in Host(seed).steps():
        getattr(pair, str(name))(*arguments)
        if pair.samples >= samples:
            break


@pytest.mark.spec("LM-BUS-5", "LM-BUS-9", "LM-BUS-10", "LM-BUS-11", "LM-BUS-12", "LM-BUS-13")
@pytest.mark.spec("LM-RST-2", "LM-RST-4", "LM-RST-5", "LM-RST-6", "LM-CMD-2", "LM-CMD-5")
@pytest.mark.spec("LM-CMD-12", "LM-CMD-14", "LM-CMD-18", "LM-CMD-22", "LM-CMD-24", "LM-CMD-25")
@pytest.mark.spec("LM-STA-3", "LM-STA-4", "LM-STA-5", "LM-STA-6", "LM-STA-7", "LM-STA-8")
@pytest.mark.spec("LM-STA-9", "LM-TRJ-2", "LM-TRJ-3", "LM-TRJ-4", "LM-TRJ-5", "LM-TRJ-6")
@pytest.mark.spec("LM-TRJ-7", "LM-TRJ-8", "LM-TRJ-9", "LM-TRJ-10", "LM-TRJ-12", "LM-TRJ-13")
@pytest.mark.spec("LM-TRJ-17", "LM-PID-2", "LM-PID-3", "LM-PID-4", "LM-PID-5", "LM-PID-6")
@pytest.mark.spec("LM-PID-7", "LM-PID-8", "LM-POS-2", "LM-POS-3", "LM-POS-4", "LM-POS-5")
@pytest.mark.spec("LM-POS-6")
@pytest.mark.parametrize("first", range(0, max(1, SAMPLES // BOARD_SAMPLES), SEEDS_OF_A_TEST))
def test_chip_and_reference_agree(first: int) -> None:
    for seed in range(first, first + SEEDS_OF_A_TEST):
        run(seed, BOARD_SAMPLES)


def test_the_same_seed_makes_the_same_host() -> None:
    first, second = (list(islice(Host(5).steps(), 500)) for _ in range(2))
    assert first == second
    assert first != list(islice(Host(6).steps(), 500))


def test_a_difference_is_told_with_all_it_takes_to_find_it() -> None:
    pair = Pair(7)
    for number in range(30):
        pair.packet(SBPA, *long(number))
    pair.packet(RDSIGS, READ, READ)
    pair.passes(3)
    sample = pair.samples
    pair.model.real += 0x1234
    with pytest.raises(AssertionError) as told:
        pair.report(RDRP)
    lines = str(told.value).splitlines()
    assert lines[0] == f"seed 7, sample {sample}: RDRP is 0h, in the reference 1234h"
    assert "pid_overflow" in lines[1]
    assert len(lines) == 3 + 20
    shown = [line.partition(": ")[2] for line in lines[-3:]]
    assert shown == ["20 00 00 00 1C", "20 00 00 00 1D", "0C rd rd"]
