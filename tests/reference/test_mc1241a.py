"""The MC1241A does what its reference model does, whatever a host tells it.

Random hosts tell both the same over the bus, while plants turn the encoders, cross indices and
close switches. Every word read, checksums, HostRdy, ~HostIntrpt and all 16 microstep look-ups of
each cycle must be equal. 100,000 cycles of 542.72 us are compared; ``VBUS_REFERENCE=10000000`` in
the environment asks for that many, on more seeds. The same seed is the same run.
"""

import os
from bisect import bisect_right
from collections import deque
from itertools import pairwise
from random import Random

import pytest

from tests.reference import mc1241a as reference
from tests.reference.mc1241a import COMMANDS, SINE, SINE_120, dac_word, pwm, scaled
from vbus.chips.mc1241a.chip import MC1241A
from vbus.core.kernel import NS, Clock, Kernel
from vbus.core.signals import LOW, OFF, Observer, Pin, Plant, Policy, Switch

CYCLES = int(os.environ.get("VBUS_REFERENCE", "100_000"))
CYCLES_OF_A_SEED = 2000

CLK = 40 * NS
SLOT = 1696 * CLK
HALF_SLOT = SLOT // 2
CYCLE = 8 * SLOT
BUSY = 67_500 * NS
RESET = 2_000_000 * NS
FILTER = 480 * NS
DATA, COMMAND = 0, 1

CODES = {name: code for code, (name, _, _) in COMMANDS.items()}
ODD_CODES = sorted(set(range(256)) - set(COMMANDS))
"""Illegal codes, undocumented ones, and 49H."""


# -- mechanics ------------------------------------------------------------------------------------


class Script(Plant):
    """Counts told in advance, one for the end of each slot; they change in the slot's middle."""

    TAKES = ("phases",)

    def __init__(self, turn: int) -> None:
        super().__init__()
        self.turn = turn
        self.planned: deque[int] = deque()
        self.driven: list[tuple[float, float, float]] = []
        self.before = 0

    def prepare(self, period: float) -> None:
        pass

    def phases(self, a: float, b: float, c: float) -> int:
        self.driven.append((a, b, c))
        self.before = self.count
        if self.planned:
            self.count = self.planned.popleft()
        return self.count

    def count_at(self, fraction: float) -> int:
        return self.before if fraction < 0.5 else self.count

    def fraction_at(self, count: int) -> float:
        return 0.5

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        way = 1 if end > start else -1
        for count in range(start + way, end + way, way):
            if count % self.turn == 0:
                return True, count
        return False, 0


class Mechanics:
    """What turns one encoder: it stands, goes somewhere, or follows the model's target."""

    def __init__(self, random: Random, axis: reference.Axis) -> None:
        self.random = random
        self.axis = axis
        self.script = Script(random.choice((400, 500, 1000)))
        self.switches = {
            "home": Switch(random.randrange(-200, 0), random.randrange(1, 100)),
            "limit+": Switch(random.randrange(500, 900), random.randrange(1000, 1500), 1),
            "limit-": Switch(random.randrange(-1500, -1000), random.randrange(-900, -500), 1),
        }
        self.count = 0
        self.goal = 0
        self.rate = 0
        self.follows = False
        self.held = False

    def levels(self) -> tuple[int, int, int]:
        """Return the levels of home, positive and negative limit."""
        home, positive, negative = (each.level(self.count) for each in self.switches.values())
        return home, positive, negative

    def plan(self) -> list[int]:
        """Return the count at the end of each slot of the coming cycle."""
        random = self.random
        if random.random() < 0.02:
            self.follows = random.random() < 0.3
            self.goal = random.randrange(-2000, 2000)
            self.rate = random.choice((0, 1, 1, 3, 10, 30, 118))
        if self.follows:
            # As far as the position error says, but for a few counts.
            self.goal = self.count + self.axis.error + random.randrange(-3, 4)
        rate = 0 if self.held else self.rate
        ends = []
        at = self.count
        for _ in range(8):
            at += max(-rate, min(rate, self.goal - at))
            ends.append(at)
        self.script.planned.extend(ends)
        return ends


# -- chip and model side by side ------------------------------------------------------------------


class Different(AssertionError):
    """Chip and model do not agree."""


class Pair:
    """A chip set and its model.

    Args:
        seed: of everything at random.
        part: part number.
        pins: the switches of the last axis are wired to its pins, not to its plant.
        settings: of the chip.
    """

    def __init__(
        self, seed: int, part: str = "MC1241A", pins: bool = False, **settings: str
    ) -> None:
        self.seed = seed
        self.random = Random(seed)
        self.kernel = Kernel()
        policy = Policy(OFF)
        self.chip = MC1241A("m", part, self.kernel, Clock(25_000_000), settings, policy)
        self.slots = settings.get("host_busy") == "slot"
        self.model = reference.MC1241A(1 if part == "MC1141A" else 2)
        self.mechanics = [
            Mechanics(Random(f"{seed} {axis.number}"), axis) for axis in self.model.axes
        ]
        self.wired: list[Pin] = []
        for number, mechanics in enumerate(self.mechanics):
            if pins and number + 1 == len(self.mechanics):
                self.wired = [
                    self.chip.pins[f"{name}{number + 1}"].net.solder(name)
                    for name in ("~Home", "PosLimit", "NegLimit")
                ]
            else:
                mechanics.script.switches.update(mechanics.switches)
            self.chip.connect(number, mechanics.script)
        # The instant of the first slot, and the half slots that have begun since.
        self.origin = 0
        self.halves = 0
        self.cycles = 0
        self.plans: list[list[int]] = []
        self.still = True
        self.outputs: list[list[tuple[float, float, float]]] = [[] for _ in self.model.axes]
        # When the chip is ready again, and what the model is told by then.
        self.ready = 0
        self.effect: tuple[str, int] | None = None
        # How long ~HostIntrpt stays high after a RST_INTRPT.
        self.rests_until = 0
        self.last_byte = 0
        self.packets: deque[str] = deque(maxlen=30)
        for pin, level in zip(self.wired, self.mechanics[-1].levels(), strict=False):
            pin.drive(level)
        self.kernel.settle()
        self.start()
        self.chip.power_on(True)

    def start(self) -> None:
        """Slot 0 begins: the reset is over. In the first cycle the encoders stand."""
        self.halves = 0
        self.still = True
        for axis, mechanics in zip(self.model.axes, self.mechanics, strict=True):
            axis.home, axis.positive, axis.negative = mechanics.levels()
            mechanics.axis = axis
            mechanics.script.planned.extend([mechanics.count] * 8)
        self.catch_up(self.origin)

    # -- the model's time -------------------------------------------------------------------------

    def catch_up(self, now: int) -> None:
        """Let everything happen to the model that happens up to ``now``."""
        while True:
            when = self.origin + self.halves * HALF_SLOT
            # What a command asks for at an instant comes before the look-up of that instant.
            if self.effect and self.ready <= now and self.ready <= when:
                kind, value = self.effect
                self.effect = None
                if kind == "command":
                    self.model.command(value)
                elif kind == "write":
                    self.model.write(value)
                else:
                    self.model.read()
                self.rests_until = self.ready + CLK
                continue
            if self.model.line_rests and self.rests_until <= now and self.rests_until <= when:
                self.model.line_has_rested()
                continue
            if when > now:
                return
            slot, middle = divmod(self.halves, 2)
            if middle:
                self.turn(slot % 8, when)
            else:
                self.slot(slot)
            # Nothing turns in the middle of a slot in which all encoders stand.
            self.halves += 2 if self.still and not middle else 1

    def slot(self, slot: int) -> None:
        if slot and slot % 8 == 0:
            self.cycles += 1
            self.model.cycle()
            self.plans = [mechanics.plan() for mechanics in self.mechanics]
            self.still = all(
                plan[-1] == mechanics.count
                for plan, mechanics in zip(self.plans, self.mechanics, strict=True)
            )
        looked_up = self.model.look_up(slot % 8 + 1)
        self.note(slot, looked_up)
        for axis, outputs, (a, b) in zip(self.model.axes, self.outputs, looked_up, strict=True):
            c = 0 if axis.two_phase else -a - b
            outputs.append((a / 32767, b / 32767, c / 32767))

    def note(self, slot: int, looked_up: list[tuple[int, int]]) -> None:
        """Called with the outputs of each slot."""

    def turn(self, slot: int, when: int) -> None:
        """Turn the encoders in the middle of a slot."""
        for axis, mechanics, plan in zip(self.model.axes, self.mechanics, self.plans, strict=True):
            start, end = mechanics.count, plan[slot]
            if start == end:
                continue
            crossed, place = mechanics.script.index_between(start, end)
            if crossed:
                self.model.trigger(axis.number, False, place)
            changed, place = mechanics.switches["home"].change_between(start, end)
            closed = changed and mechanics.switches["home"].level(place) == LOW
            mechanics.count = axis.count = end
            levels = mechanics.levels()
            if self.wired and mechanics is self.mechanics[-1]:
                # A pin is seen to move at an instant, not at a count; ~Home passes a filter.
                closed, place = levels[0] < axis.home, end
                self.kernel.run_until(when)
                for pin, level in zip(self.wired, levels, strict=True):
                    pin.drive(level)
                self.kernel.settle()
            if closed:
                self.model.trigger(axis.number, True, place)
            axis.home, axis.positive, axis.negative = levels

    def run_until(self, when: int) -> None:
        cycles = self.cycles
        self.catch_up(when)
        self.kernel.run_until(when)
        if self.cycles != cycles:
            self.check_outputs()

    def wait(self, duration: int) -> None:
        self.run_until((self.kernel.now + duration) | 1)

    # -- the bus ----------------------------------------------------------------------------------

    def free(self) -> None:
        """Come to an instant at which the chip is ready."""
        if self.kernel.now < self.ready:
            self.run_until(self.ready)

    def later(self) -> int:
        """Return an instant a little later: between clock edges, or BUSY before a slot begins."""
        now = self.kernel.now + self.random.randrange(300, 700) * NS
        if not self.slots and self.random.random() < 0.005:
            return now + (self.origin - BUSY - now) % SLOT
        return now | 1

    def busy(self, kind: str, value: int) -> None:
        """The chip is busy from now on; the model does the same when it is ready."""
        self.kernel.settle()
        now = self.kernel.now
        self.ready = now + (self.origin - now) % SLOT if self.slots else now + BUSY
        if (got := self.chip.ready_at()) != self.ready:
            self.differ("ready at", got, self.ready)
        self.effect = (kind, value)

    def command(self, code: int) -> None:
        self.free()
        self.run_until(self.later())
        self.chip.write(COMMAND, code)
        self.busy("command", code)

    def write_byte(self, byte: int) -> None:
        self.free()
        self.run_until(self.later())
        self.chip.write(DATA, byte)
        self.kernel.settle()

    def write(self, word: int) -> None:
        self.write_byte(word >> 8)
        self.write_byte(word & 0xFF)
        self.busy("write", word)

    def read_byte(self) -> int:
        self.free()
        self.chip.begin_read(DATA)
        self.run_until(self.later())
        self.last_byte = self.chip.end_read()
        self.kernel.settle()
        return self.last_byte

    def read(self, what: str) -> int:
        """Read a word of both; they must be equal."""
        self.free()
        expected = self.model.word()
        word = self.read_byte() << 8
        word |= self.read_byte()
        self.busy("read", word)
        if word != expected:
            self.differ(what, f"{word:04X}", f"{expected:04X}")
        return word

    def send(self, name: str, value: int = 0, checksum: bool = False) -> int:
        """Send a packet to both; return what it reads."""
        code = CODES[name]
        _, write, read = COMMANDS[code]
        words = [value >> 16 * n & 0xFFFF for n in reversed(range(write))]
        self.tell(f"{name} {code:02X}" + "".join(f" {word:04X}" for word in words))
        if name == "RESET":
            self.reset()
            return 0
        self.command(code)
        for word in words:
            self.write(word)
        answer = 0
        for _ in range(read):
            answer = answer << 16 | self.read(name)
        if read:
            self.packets[-1] += f" -> {answer:0{4 * read}X}"
        if checksum:
            self.read(f"checksum of {name}")
        return answer

    def reset(self) -> None:
        """Send RESET and come to its end. Meanwhile the encoders stand."""
        for mechanics in self.mechanics:
            mechanics.held = True
        self.wait(2 * CYCLE)
        self.free()
        self.run_until(self.later())
        edge = self.kernel.now
        self.chip.write(COMMAND, CODES["RESET"])
        self.kernel.settle()
        # It acts at the end of the ordinary busy time, and counting starts at a clock edge.
        acts = edge + (self.origin - edge) % SLOT if self.slots else edge + BUSY
        self.run_until(acts - 1)
        self.check_outputs()
        for mechanics in self.mechanics:
            mechanics.held = False
            mechanics.script.planned.clear()
        self.model.command(CODES["RESET"])
        self.ready = edge + RESET
        self.origin = -(-self.ready // CLK) * CLK
        self.kernel.run_until(self.origin)
        self.chip.advance()
        self.start()
        for mechanics in self.mechanics:
            # Look-ups while the reset ran had no current; the last one is slot 0.
            del mechanics.script.driven[:-1]
            mechanics.script.planned.popleft()

    # -- comparison -------------------------------------------------------------------------------

    def check_outputs(self) -> None:
        """All look-ups so far have driven the plants with what the model gives."""
        self.chip.advance()
        for number, (mechanics, outputs) in enumerate(
            zip(self.mechanics, self.outputs, strict=True)
        ):
            driven = mechanics.script.driven
            if driven != outputs:
                self.differ_in_outputs(number, driven, outputs)
            driven.clear()
            outputs.clear()

    def differ_in_outputs(
        self,
        number: int,
        driven: list[tuple[float, float, float]],
        outputs: list[tuple[float, float, float]],
    ) -> None:
        if len(driven) != len(outputs):
            self.differ(f"look-ups of axis {number + 1}", len(driven), len(outputs))
        first = next(n for n in range(len(driven)) if driven[n] != outputs[n])
        slot = (self.halves + 1) // 2 - len(outputs) + first
        got, expected = (
            [round(32767 * part) for part in phases] for phases in (driven[first], outputs[first])
        )
        place = f"{len(outputs) - first} look-ups ago, in slot {slot % 8 + 1}"
        self.differ(f"outputs of axis {number + 1}, {place}", got, expected)

    def check_interrupt(self) -> None:
        self.chip.advance()
        line = self.chip.pins["~HostIntrpt"].value
        if line != (self.model.interrupting is None):
            self.differ("~HostIntrpt", line, int(self.model.interrupting is None))

    def tell(self, packet: str) -> None:
        """Note a packet for the message of a failure."""
        self.packets.append(f"{self.cycles}: {packet}")

    def differ(self, what: str, chip: object, model: object) -> None:
        packets = "\n    ".join(self.packets)
        raise Different(
            f"seed {self.seed}, cycle {self.cycles}, {what}: chip {chip}, model {model};"
            f" the last packets, each with its cycle:\n    {packets}"
        )


# -- random hosts ---------------------------------------------------------------------------------

GETS = (
    "GET_TRGT_POS", "GET_TRGT_VEL", "GET_MODE", "GET_ACTL_POS", "GET_ACTL_POS_ERR", "GET_MTR_CMD",
    "GET_CAPT", "GET_INTRPT", "GET_TRGT_POS", "GET_TRGT_VEL", "GET_POS", "GET_VEL", "GET_ACC",
    "GET_MAX_ACC", "GET_JERK", "GET_RATIO", "GET_START_VEL", "GET_BRK_PNT", "GET_INTRPT_MASK",
    "GET_STEP_RATIO", "GET_POS_ERR", "GET_BUF_MTR_CMD", "GET_OUTPUT_MODE", "GET_LMT_SWTCH",
    "GET_HOME", "GET_TIME", "GET_PHASE_INFO", "GET_VRSN", "GET_STATUS", "SET_I",
)  # fmt: skip
"""What is read in turn, beside the status of both axes."""

PROFILES = ("SET_PRFL_TRAP", "SET_PRFL_VEL", "SET_PRFL_S_CRV", "SET_PRFL_GEAR")
BREAKS = (
    "SET_TIME_BRK", "SET_POS_BRK", "SET_NEG_BRK", "SET_ACTL_POS_BRK", "SET_ACTL_NEG_BRK",
    "SET_MTN_CMPLT_BRK", "SET_EXT_BRK", "SET_BRK_OFF",
)  # fmt: skip
STOPS = ("STOP", "SMOOTH_STOP", "SYNCH_PRFL")
STATUS = ("CLR_STATUS", "RST_STATUS", "RST_INTRPT", "SET_INTRPT_MASK")

THEMES: tuple[tuple[str, ...], ...] = (
    ("SET_PRFL_TRAP", "SET_POS", "SET_POS", "SET_VEL", "SET_ACC", "SET_START_VEL", *STOPS),
    ("SET_PRFL_TRAP", "SET_POS", "SET_POS", "SET_VEL", "CLR_STATUS"),
    ("SET_PRFL_VEL", "SET_VEL", "SET_ACC", "SET_ACC", "SET_START_VEL", *STOPS),
    ("SET_PRFL_S_CRV", "SET_POS", "SET_POS", "SET_VEL", "SET_MAX_ACC", "SET_JERK"),
    ("SET_PRFL_S_CRV", "SET_POS", "SET_POS", *STOPS, "CLR_STATUS", "SET_ACTL_POS"),
    ("SET_PRFL_GEAR", "SET_RATIO", "SET_RATIO", *STOPS),
    (*PROFILES, "SET_POS", *STOPS),
    (*BREAKS, "SET_BRK_PNT", "SET_BRK_PNT", "SET_POS", "SET_VEL", *STOPS, *STATUS),
    (*BREAKS, "SET_AUTO_UPDATE_ON", "SET_AUTO_UPDATE_OFF", "SET_BRK_PNT", "SET_POS", *STOPS),
    ("SET_LMT_SENSE", "LMTS_ON", "LMTS_OFF", *STATUS, "CLR_STATUS", "SET_POS"),
    ("SET_STEP_RATIO", "SET_POS_ERR", "SET_AUTO_STOP_ON", "SET_AUTO_STOP_OFF", "MTR_ON", "MTR_ON",
     "MTR_OFF", *STATUS, "SET_POS", "SYNCH_PRFL"),
    ("SET_ACTL_POS", "SET_PRFL_VEL", "SET_VEL", "SET_ACC", "SYNCH_PRFL", *STATUS),
    ("SET_CAPT_INDEX", "SET_CAPT_HOME", "GET_CAPT", "GET_CAPT", "CLR_STATUS", "SET_ACTL_POS"),
    ("SET_MTR_CMD", "SET_BUF_MTR_CMD", "SET_PHASE_2", "SET_PHASE_3", "SET_OUTPUT_PWM",
     "SET_OUTPUT_DAC16", "SET_POS"),
    STATUS,
    tuple(CODES),
)  # fmt: skip
"""What a host is busy with for a while; UPDATE and MULTI_UPDATE come beside all of it."""


class Host(Pair):
    """A random host of a chip set and its model, built as the seed says."""

    def __init__(self, seed: int) -> None:
        part = "MC1141A" if seed % 8 == 7 else "MC1241A"
        busy = "slot" if seed % 8 == 3 else "fixed"
        super().__init__(seed, part, seed % 4 == 2, host_busy=busy)

    def play(self, cycles: int) -> None:
        """Go on until so many cycles have been compared."""
        random = self.random
        theme = random.choice(THEMES)
        self.settle()
        while self.cycles < cycles:
            if random.random() < 0.03:
                theme = random.choice(THEMES)
            kind = random.random()
            if kind < 0.30:
                self.look()
            elif kind < 0.60:
                self.say(random.choice(theme))
            elif kind < 0.72:
                self.say("UPDATE")
            elif kind < 0.75:
                self.say("MULTI_UPDATE")
            elif kind < 0.80:
                # Several things at once, updates among them.
                for _ in range(random.randrange(2, 6)):
                    self.say(random.choice((*theme, "UPDATE", "UPDATE")))
            elif kind < 0.82:
                self.settle()
            elif kind < 0.84:
                self.misbehave()
            elif kind < 0.94:
                self.wait(random.randrange(CYCLE))
            else:
                self.wait(random.randrange(12 * CYCLE))

    def look(self) -> None:
        """Read the status of both axes, and what is next in turn."""
        self.check_interrupt()
        for name in self.random.sample(("SET_1", "SET_2"), 2):
            self.send(name)
        self.send(self.random.choice(GETS), checksum=self.random.random() < 0.1)

    def say(self, name: str) -> None:
        if name == "RESET" and self.random.random() < 0.8:
            return
        self.send(name, self.value(name), checksum=self.random.random() < 0.1)

    def settle(self) -> None:
        """Load what moves an axis at a pleasant pace."""
        random = self.random
        self.send(random.choice(("SET_1", "SET_2")))
        if random.random() < 0.9:
            self.send("MTR_ON")
        self.send("SET_VEL", random.randrange(1 << random.randrange(12, 23)))
        self.send("SET_ACC", random.randrange(1 << random.randrange(8, 20)))
        self.send("SET_MAX_ACC", random.randrange(1 << random.randrange(6, 16)))
        self.send("SET_JERK", random.randrange(1 << random.randrange(16, 32)))
        self.send("SET_BUF_MTR_CMD", random.randrange(1 << 16))
        if random.random() < 0.5:
            self.send("SET_POS", self.value("SET_POS"))
            self.send("UPDATE")

    def value(self, name: str) -> int:
        """Return data for a command: likely ones mostly, any now and then."""
        random = self.random
        axis = self.model.current
        if name in ("SET_POS", "SET_ACTL_POS", "SET_BRK_PNT"):
            here = axis.target >> 32
            near = random.choice((here, here, axis.actual, 0, axis.active["POS"]))
            kind = random.random()
            if name == "SET_BRK_PNT" and kind < 0.3:
                return self.model.time + random.randrange(12)
            if kind < 0.1:
                return near
            if kind < 0.9:
                spread = 1 << random.randrange(1, 16)
                return near + random.randrange(-spread, spread)
            edge = random.choice((-(1 << 30), (1 << 30) - 1, random.randrange(1 << 32)))
            return edge + random.randrange(-20, 20)
        if name in ("SET_VEL", "SET_START_VEL"):
            if random.random() < (0.05 if name == "SET_VEL" else 0.6):
                return 0
            return random.randrange(1 << random.choice((12, 16, 17, 18, 19, 20, 24, 30, 32)))
        if name in ("SET_ACC", "SET_RATIO"):
            size = random.randrange(1 << random.choice((0, 8, 12, 14, 16, 17, 18, 20, 30, 31)))
            return random.choice((size, size, -size if axis.mode & 1 else size))
        if name == "SET_JERK":
            return random.randrange(1 << random.choice((0, 8, 16, 20, 24, 26, 28, 31, 32)))
        if name == "SET_MAX_ACC":
            return random.randrange(1 << random.choice((0, 4, 8, 10, 12, 14, 15, 16)))
        if name == "SET_STEP_RATIO":
            return random.choice((0, 1, 80, 256, random.randrange(1 << 16)))
        if name == "SET_POS_ERR":
            return random.randrange(1 << random.choice((1, 4, 6, 10, 16)))
        if name == "MULTI_UPDATE":
            return random.randrange(4)
        if name in ("RST_STATUS", "RST_INTRPT", "SET_INTRPT_MASK"):
            return random.choice((0, 0xFF, random.randrange(1 << 8), random.randrange(1 << 16)))
        if name == "SET_LMT_SENSE":
            return random.choice((0, 0, random.randrange(16)))
        return random.randrange(1 << 16)

    def misbehave(self) -> None:
        """Do what a host should not."""
        random = self.random
        kind = random.randrange(6)
        if kind == 0:
            code = random.choice(ODD_CODES)
            self.tell(f"code {code:02X}")
            self.command(code)
        elif kind == 1:
            # A packet that is cut short by the next, maybe within a word.
            name = random.choice(("SET_POS", "SET_VEL", "SET_BRK_PNT", "SET_ACTL_POS"))
            self.tell(f"{name} {CODES[name]:02X}, cut short")
            self.command(CODES[name])
            for _ in range(random.randrange(2)):
                self.write(random.randrange(1 << 16))
            if random.random() < 0.5:
                self.write_byte(random.randrange(256))
            self.look()
        elif kind == 2:
            name = random.choice(GETS)
            self.tell(f"{name} {CODES[name]:02X}, cut short")
            self.command(CODES[name])
            self.free()
            expected = self.model.word() >> 8
            if (got := self.read_byte()) != expected:
                self.differ(f"first byte of {name}", got, expected)
            self.look()
        elif kind == 3:
            # Written between the bytes of a word that is read: it stays as it was.
            self.send("SET_1")
            self.free()
            expected = self.model.word()
            word = self.read_byte() << 8
            self.tell("a word written within one that is read")
            self.write(random.randrange(1 << 16))
            word |= self.read_byte()
            self.busy("read", word)
            if word != expected:
                self.differ("a word read in two parts", word, expected)
        elif kind == 4:
            self.say(random.choice(tuple(CODES)))
            if self.kernel.now < self.ready:
                self.early()
        for _ in range(random.randrange(4)):
            if random.random() < 0.5:
                word = random.randrange(1 << 16)
                self.tell(f"word {word:04X}")
                self.write(word)
            else:
                self.tell("a word read")
                self.read("a word nobody asked for")

    def early(self) -> None:
        """Use the port while the chip is busy: nothing comes of it (PMD-BUS-8)."""
        self.tell("port used while busy")
        for _ in range(3):
            self.run_until(min(self.kernel.now + 700 * NS | 1, self.ready - 1))
            kind = self.random.randrange(3)
            if kind < 2:
                self.chip.write((DATA, COMMAND)[kind], self.random.randrange(256))
            else:
                self.chip.begin_read(DATA)
                if (got := self.chip.end_read()) != self.last_byte:
                    self.differ("the last byte once more", got, self.last_byte)
            self.kernel.settle()


@pytest.mark.spec(
    "PMD-TRJ-1", "PMD-TRJ-2", "PMD-TRJ-3", "PMD-TRJ-4", "PMD-TRJ-5", "PMD-TRJ-6", "PMD-TRJ-7",
    "PMD-TRJ-8", "PMD-TRJ-9", "PMD-TRJ-10", "PMD-TRJ-11", "PMD-TRJ-12", "PMD-TRJ-13",
    "PMD-UPD-1", "PMD-UPD-2", "PMD-UPD-3", "PMD-ERR-1", "PMD-ERR-2", "PMD-ERR-3", "PMD-LIM-1",
    "PMD-LIM-2", "PMD-LIM-3", "PMD-LIM-4", "PMD-CAP-1", "PMD-CAP-2", "PMD-STL-1", "PMD-STL-2",
    "PMD-MTR-1", "PMD-MTR-2", "PMD-STA-1", "PMD-STA-2", "PMD-STA-3", "PMD-STA-4", "PMD-STA-5",
    "PMD-INT-1", "PMD-INT-2", "PMD-INT-3", "PMD-INT-4", "PMD-INT-5", "PMD-CYC-1", "PMD-USTP-1",
    "PMD-USTP-2", "PMD-USTP-3", "PMD-USTP-4", "PMD-PKT-2", "PMD-PKT-3", "PMD-PKT-7", "PMD-BUS-7",
    "PMD-BUS-8", "PMD-BUS-9", "PMD-BUS-10", "PMD-BUS-11", "PMD-RST-1", "PMD-RST-2",
)  # fmt: skip
@pytest.mark.parametrize("seed", range(-(-CYCLES // CYCLES_OF_A_SEED)))
def test_random_hosts_get_the_same_from_chip_and_model(seed: int) -> None:
    Host(seed).play(min(CYCLES, CYCLES_OF_A_SEED))


# -- output pins ----------------------------------------------------------------------------------


class Edges(Observer):
    """What the output pins of a chip did: each pin's edges, and the words written to the DACs."""

    def __init__(self, chip: MC1241A) -> None:
        names = ["DAC16Addr0-1", "Data0-11", "DACLow0-3", "DACSlct", "I/OAddr0-3", "~I/OWrite"]
        names += [name for name in chip.pins if name.startswith("PWM")]
        self.levels = {name: chip.pins[name].value for name in names}
        self.edges = {name: [(0, level)] for name, level in self.levels.items()}
        self.words: list[tuple[int, int, int]] = []
        for name in names:
            chip.pins[name].net.observe(self)

    def edge(self, when: int, net: str, level: int) -> None:
        name = net.partition(".")[2]
        levels = self.levels
        taken = (levels["DAC16Addr0-1"], levels["Data0-11"] << 4 | levels["DACLow0-3"])
        selected = self.selected()
        levels[name] = level
        self.edges[name].append((when, level))
        if selected and not self.selected():
            self.words.append((when, *taken))

    def selected(self) -> bool:
        """Tell whether a word lies at a DAC ("DAC16 Decoding")."""
        levels = self.levels
        return bool(levels["DACSlct"] and levels["I/OAddr0-3"] == 15 and not levels["~I/OWrite"])

    def at(self, name: str, when: int) -> int:
        """Return the level of a pin at an instant."""
        edges = self.edges[name]
        return edges[bisect_right(edges, (when, 1)) - 1][1]

    def high(self, name: str, start: int, end: int) -> int:
        """Return for how long a pin was high between two instants."""
        edges = self.edges[name]
        within = edges[bisect_right(edges, (start, 1)) : bisect_right(edges, (end, 1))]
        time = 0
        for (when, level), (until, _) in pairwise(
            [(start, self.at(name, start)), *within, (end, 0)]
        ):
            time += level * (until - when)
        return time


class Watched(Host):
    """A host of a chip whose output pins are watched."""

    def __init__(self, seed: int) -> None:
        self.looked_up: list[tuple[int, int, list[int]]] = []
        super().__init__(seed)
        self.pins = Edges(self.chip)

    def note(self, slot: int, looked_up: list[tuple[int, int]]) -> None:
        outs = [out for pair in looked_up for out in pair]
        self.looked_up.append((slot, self.model.output_mode, outs))

    def say(self, name: str) -> None:
        if name != "RESET":
            super().say(name)


@pytest.mark.spec("PMD-USTP-5", "PMD-USTP-6", "PMD-USTP-7")
@pytest.mark.parametrize("seed", [0, 1, 7])
def test_output_pins_carry_the_words_and_pulses_of_the_model(seed: int) -> None:
    host = Watched(seed)
    host.send("SET_MTR_CMD", 30000)
    host.send("SET_OUTPUT_DAC16")
    host.play(25)
    host.send("SET_OUTPUT_PWM")
    host.play(50)
    pins = host.pins
    expected = [
        (slot, phase, dac_word(out))
        for slot, mode, outs in host.looked_up
        if mode == 2
        for phase, out in enumerate(outs)
    ]
    assert expected
    assert [(when // SLOT, phase, word) for when, phase, word in pins.words] == expected
    magnitudes = [name for name in pins.edges if name.startswith("PWMMag")]
    frame = 256 * CLK
    checked = 0
    for (slot, mode, outs), (_, after, _) in pairwise(host.looked_up):
        if mode or after:
            continue
        # A frame that lies within the slot as a whole.
        start = -(-slot * SLOT // frame) * frame
        for name, out in zip(magnitudes, outs, strict=False):
            pulse, sign = pwm(out)
            assert pins.high(name, start, start + frame) == pulse * CLK
            assert pins.at(name.replace("Mag", "Sign"), start + CLK) == sign
            checked += 1
    assert checked > 100


# -- the model alone ------------------------------------------------------------------------------


class Model(reference.MC1241A):
    """The model with a host of its own."""

    def send(self, name: str, value: int = 0) -> int:
        code = CODES[name]
        _, write, read = COMMANDS[code]
        self.command(code)
        for n in reversed(range(write)):
            self.write(value >> 16 * n & 0xFFFF)
        answer = 0
        for _ in range(read):
            answer = answer << 16 | self.read()
        if self.line_rests:
            self.line_has_rested()
        return answer

    def load(self, **values: int) -> None:
        for name, value in values.items():
            self.send("SET_" + name, value)

    def run(self, cycles: int) -> list[int]:
        """Return the target after each cycle."""
        targets = []
        for _ in range(cycles):
            self.cycle()
            targets.append(reference.signed(self.send("GET_TRGT_POS"), 32))
        return targets


def test_a_difference_names_seed_cycle_packets_and_both_values() -> None:
    pair = Pair(5)
    pair.wait(3 * CYCLE)
    pair.send("SET_VEL", 0x12345)
    pair.free()
    pair.model.current.buffered["VEL"] += 1
    with pytest.raises(Different) as failure:
        pair.send("GET_VEL")
    assert str(failure.value) == (
        "seed 5, cycle 3, GET_VEL: chip 2345, model 2346; the last packets, each with its cycle:"
        "\n    3: SET_VEL 11 0001 2345\n    3: GET_VEL 4B"
    )


@pytest.mark.spec("PMD-CMD-81")
def test_the_model_has_eighty_commands() -> None:
    assert len(COMMANDS) == 80


@pytest.mark.spec("PMD-T-1", "PMD-T-14", "PMD-T-16", "PMD-PKT-2", "PMD-PKT-4", "PMD-PKT-5")
def test_checksums_of_the_model() -> None:
    model = Model()
    model.send("SET_VEL", 0xFEDCBA98)
    assert model.read() == 0xB985
    model.command(0x22)
    model.write(0x1234)
    model.write(0x5678)
    assert model.read() == 0
    model.command(0x49)
    assert model.read() == 0x49
    status = model.send("SET_1")
    assert status >> 12 & 3 == 0
    assert model.read() == 1 + status


@pytest.mark.spec("PMD-T-3", "PMD-T-4")
def test_numbers_of_the_manual_come_back_from_the_model() -> None:
    model = Model()
    model.command(CODES["SET_POS"])
    model.write(0x0012)
    model.write(0xD687)
    assert model.send("GET_POS") == 1_234_567
    model.send("SET_JERK", 32_212_256)
    assert model.send("GET_JERK") == 0x1EB8520


@pytest.mark.spec("PMD-T-8", "PMD-INT-3")
def test_interrupt_example_on_the_model() -> None:
    model = Model()
    model.load(INTRPT_MASK=0x30, STEP_RATIO=256, POS_ERR=10)
    model.axes[0].count = 100
    model.axes[0].positive = 1
    model.cycle()
    assert model.interrupting is model.axes[0]
    assert model.send("SET_I") & 0x30 == 0x30
    model.send("SET_STEP_RATIO", 256)
    model.send("RST_INTRPT", 0xEF)
    assert model.interrupting is model.axes[0]
    assert model.send("SET_I") & 0x30 == 0x20
    model.send("RST_INTRPT", 0xDF)
    assert model.interrupting is None


@pytest.mark.spec("PMD-T-9", "PMD-TRJ-2")
def test_trapezoids_of_the_model() -> None:
    model = Model()
    model.load(POS=20, VEL=4 << 16, ACC=1 << 16)
    model.send("UPDATE")
    assert model.run(7) == [1, 3, 6, 10, 14, 17, 19]
    assert model.send("GET_STATUS") == 0x0700
    assert model.run(1) == [20]
    assert model.send("GET_STATUS") == 0x0301
    model = Model()
    model.load(POS=30, VEL=5 << 16, ACC=1 << 16, START_VEL=2 << 16)
    model.send("UPDATE")
    assert model.run(8) == [2, 5, 9, 14, 19, 23, 27, 30]


@pytest.mark.spec("PMD-T-10", "PMD-TRJ-4")
def test_s_curves_of_the_model() -> None:
    model = Model()
    model.send("SET_PRFL_S_CRV")
    model.load(POS=2000, VEL=10 << 16, MAX_ACC=0x2000, JERK=0x01000000)
    model.send("UPDATE")
    targets, phases, status = [0], [0], [0]
    for _ in range(310):
        targets += model.run(1)
        phases.append(model.send("GET_MODE") >> 13)
        status.append(model.send("GET_STATUS"))
    cycles = (32, 80, 112, 200, 232, 280)
    assert [targets[n] for n in cycles] == [23, 269, 570, 1450, 1746, 1980]
    assert [phases[n] for n in cycles] == [1, 2, 3, 4, 5, 6]
    assert (targets[310], status[309], status[310]) == (2000, 0x0700, 0x0301)
    short = reference.SCurve(0, 1000 << 32, 10 << 32, 0x2000 << 16, 0x01000000)
    assert (short.m, short.t, short.samples) == (32, 43, 107)
    # The way is no multiple of the velocity: 201 samples' worth at 2003/201.
    odd = reference.SCurve(0, 2003 << 32, 10 << 32, 0x2000 << 16, 0x01000000)
    assert (odd.m, odd.t, odd.samples, odd.length[4]) == (32, 48, 201, 89)


@pytest.mark.spec("PMD-T-11", "PMD-T-12", "PMD-USTP-3", "PMD-USTP-4")
def test_waveforms_of_the_model() -> None:
    def words(i: int) -> tuple[int, int]:
        a, b = (scaled(32767, SINE[n % 256]) for n in (i, i + 64))
        return dac_word(a), dac_word(b)

    assert [words(i) for i in (0, 64, 192, 32)] == [
        (32768, 65535), (65535, 32768), (1, 32768), (55938, 55938),
    ]  # fmt: skip
    assert dac_word(scaled(32767, SINE_120[0])) == 61145
    assert (SINE_120[64], SINE_120[192]) == (-16384, 16384)
    assert [pwm(out) for out in (32767, 16384, 0, -16384)] == [
        (256, 0), (128, 0), (0, 0), (128, 1),
    ]  # fmt: skip


@pytest.mark.spec("PMD-T-13", "PMD-T-2", "PMD-VER-2", "PMD-RST-3")
def test_words_of_the_model_after_reset() -> None:
    model = Model()
    assert model.send("GET_STATUS") == 0x0300
    assert model.send("SET_2") == 0x1300
    assert model.send("GET_MODE") == 0x0080
    assert model.send("GET_POS_ERR") == 0x7FFF
    assert model.send("GET_OUTPUT_MODE") == 0
    assert (model.send("GET_VRSN"), Model(1).send("GET_VRSN")) == (0x4A10, 0x4210)


@pytest.mark.spec("PMD-T-15", "PMD-AMB-30")
def test_homing_sequence_on_the_model() -> None:
    model = Model()
    model.load(POS=12345, VEL=23456, ACC=345)
    for name in ("UPDATE", "SET_EXT_BRK", "STOP"):
        model.send(name)
    assert model.run(100)[-1] > 0
    model.axes[0].home = 0
    place = model.send("GET_TRGT_POS")
    assert model.run(1) == [place]
    assert (model.send("GET_STATUS"), model.send("GET_TRGT_VEL")) == (0x0305, 0)


@pytest.mark.spec("PMD-T-17", "PMD-TRJ-1")
def test_the_target_of_the_model_wraps() -> None:
    model = Model()
    model.send("SET_ACTL_POS", (1 << 30) - 1)
    model.send("SET_PRFL_VEL")
    model.load(VEL=1 << 16, ACC=1 << 16)
    model.send("UPDATE")
    assert model.run(1) == [-(1 << 30)]
    assert model.send("GET_STATUS") == 0x0702


@pytest.mark.spec("PMD-T-18", "PMD-UPD-1")
def test_motor_commands_of_the_model() -> None:
    model = Model()
    model.send("SET_BUF_MTR_CMD", 0x4000)
    assert (model.send("GET_MTR_CMD"), model.send("GET_BUF_MTR_CMD")) == (0, 0x4000)
    model.send("UPDATE")
    model.cycle()
    assert (model.send("GET_MTR_CMD"), model.send("GET_BUF_MTR_CMD")) == (0x4000, 0x4000)
    # What SET_MTR_CMD has set outlives an update (NOTES 6).
    model.send("SET_MTR_CMD", 0x1000)
    model.send("UPDATE")
    model.cycle()
    assert model.send("GET_MTR_CMD") == 0x1000
