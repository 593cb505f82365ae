"""A chip alone on a bench: bus cycles both ways in, time, and small mechanics."""

from tests.probe import Probe, probe
from vbus.chips.lm628.chip import LM628
from vbus.chips.lm628.datasheet import AC, COMMANDS
from vbus.core.kernel import NS, US, Clock, Kernel
from vbus.core.signals import HIGH, LOW, Observer, Plant, Policy, Violation, Z

SETUP = 30 * NS
LOW_TIME = 180 * NS
AFTER = 180 * NS
SAMPLE = 256 * US
"""Servo sample at 8 MHz."""
BUSY = 15 * US
"""Busy at 8 MHz."""


class Log(Observer):
    """Edges of the nets it observes: (instant, net, level)."""

    def __init__(self) -> None:
        self.edges: list[tuple[int, str, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.edges.append((when, net, level))


class Course(Plant):
    """A plant whose counts at the sample boundaries are given; then it stands.

    The drive of a sample is answered with the count of the next one: counts appended now are read
    from the sample after the next on. An index lies every ``turn`` counts.
    """

    STATE = ("count", "before", "at")

    def __init__(self, counts=(), turn: int = 0) -> None:
        super().__init__()
        self.counts = list(counts)
        self.turn = turn
        self.before = 0
        self.commands: list[float] = []
        self.at = 0

    def prepare(self, period: float) -> None:
        self.period = period

    def move(self, error: int) -> int:
        if self.at < len(self.counts):
            self.at += 1
            return self.counts[self.at - 1]
        return self.count

    def drive(self, command: float, error: int) -> int:
        self.commands.append(command)
        self.before = self.count
        self.count = self.move(error)
        return self.count

    def count_at(self, fraction: float) -> int:
        return self.before + int((self.count - self.before) * fraction)

    def fraction_at(self, count: int) -> float:
        return (count - self.before) / (self.count - self.before)

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        if self.turn and end > start:
            count = start // self.turn * self.turn + self.turn
            return (True, count) if count <= end else (False, 0)
        if self.turn and end < start:
            count = -(-start // self.turn) * self.turn - self.turn
            return (True, count) if count >= end else (False, 0)
        return False, 0

    def resting(self) -> bool:
        return self.at == len(self.counts)


class Follower(Course):
    """Mechanics that stand where the chip wanted them, one sample later."""

    def move(self, error: int) -> int:
        return self.count + error

    def resting(self) -> bool:
        return self.count == self.before


class Bench:
    """An LM628 whose host cycles have the same instants whichever way they come in.

    ``mode`` is ``"cycle"`` (whole bus cycles) or ``"strobe"`` (edges on the nets). Power comes on
    at once, with the reset ``done`` or beginning; with None the test switches it on.
    """

    def __init__(
        self,
        mode: str = "cycle",
        part: str = "LM628N-8",
        hz: int = 8_000_000,
        plant: Plant | None = None,
        policy: Policy | None = None,
        done: bool | None = True,
        **settings,
    ) -> None:
        self.mode = mode
        self.kernel = Kernel()
        self._violations: list[Violation] = []
        self.chip = LM628(
            "x", part, self.kernel, Clock(hz), settings, policy, self._violations.append
        )
        self.plant = plant
        if plant is not None:
            self.chip.connect(0, plant)
        self.host = {
            name: self.chip.pins[name].net.solder(f"host {name}")
            for name in ("/CS", "/PS", "/RD", "/WR", "D0-D7", "/RST", "A", "B", "/IN")
        }
        self.chip.timing_checked = mode == "strobe"
        self.edge = 0
        """Latching edge of the last cycle."""
        if done is not None:
            self.chip.power_on(done)

    # -- time ---------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        return self.kernel.now

    @property
    def probe(self) -> Probe:
        """The inside of the chip as it is now."""
        self.chip.advance()
        return probe(self.chip)

    def at(self, when: int) -> None:
        self.kernel.run_until(when)

    def run(self, duration: int) -> None:
        self.kernel.run_for(duration)

    def ready(self) -> None:
        """Let time pass until busy has fallen."""
        self.chip.advance()
        self.at(max(self.chip.ready_at(), self.now))
        self.chip.advance()

    def sample(self, number: int) -> None:
        """Go to the instant of sample ``number`` (1 is the first)."""
        self.at(self.chip.clock.ps(2048 * number))
        self.chip.advance()

    def next_sample(self) -> None:
        self.chip.advance()
        clock = self.chip.clock
        self.sample(clock.cycle_at(self.now) // 2048 + 1)

    # -- bus cycles ---------------------------------------------------------------------------

    def write(self, port: int, data: int) -> None:
        start = self.now
        self.edge = start + SETUP + LOW_TIME
        if self.mode == "strobe":
            self.set(**{"/PS": port, "/CS": LOW})
            self.at(start + SETUP)
            self.set(**{"/WR": LOW, "D0-D7": data})
            self.at(self.edge)
            self.set(**{"/WR": HIGH})
            self.at(self.edge + SETUP)
            self.set(**{"/CS": HIGH})
            self.at(self.edge + 120 * NS)
            self.set(**{"D0-D7": Z})
        else:
            self.at(self.edge)
            self.chip.write(port, data)
        self.at(self.edge + AFTER)

    def read(self, port: int) -> int:
        start = self.now
        self.edge = start + SETUP + LOW_TIME
        if self.mode == "strobe":
            self.set(**{"/PS": port, "/CS": LOW})
            self.at(start + SETUP)
            self.set(**{"/RD": LOW})
            self.at(self.edge)
            data = self.data()
            self.set(**{"/RD": HIGH})
            self.at(self.edge + SETUP)
            self.set(**{"/CS": HIGH})
        else:
            self.at(start + SETUP)
            self.chip.begin_read(port)
            self.at(self.edge)
            data = self.chip.end_read()
        self.at(self.edge + AFTER)
        return data

    def set(self, **levels: int) -> None:
        """Move host pins, all in one batch."""
        for name, level in levels.items():
            self.host[name].drive(level)
        self.kernel.settle()

    def data(self) -> int:
        """Look at D0-D7."""
        self.chip.advance()
        self.kernel.settle()
        return self.chip.bus_net.value

    def pin(self, name: str) -> int:
        """Look at a pin of the chip."""
        self.chip.advance()
        return self.chip.pins[name].value

    # -- packets ------------------------------------------------------------------------------

    def command(self, name: str, *words: int) -> None:
        """Write a command and its data words, waiting out busy after each."""
        self.write(0, COMMANDS[name].code)
        self.ready()
        for word in words:
            self.word(word)

    def word(self, word: int) -> None:
        self.write(1, word >> 8 & 0xFF)
        self.write(1, word & 0xFF)
        self.ready()

    def report(self, name: str) -> int:
        """Run a reporting command; return its value, signed as the table says."""
        row = COMMANDS[name]
        self.command(name)
        value = 0
        for _ in range(row.read):
            value = value << 16 | self.read(1) << 8 | self.read(1)
            self.ready()
        half = 1 << (16 * row.read - 1)
        return value - 2 * half if row.signed and value & half else value

    def status(self) -> int:
        return self.read(0)

    def move(
        self, control: int, accel: int | None = None, velocity: int | None = None,
        position: int | None = None,
    ) -> None:  # fmt: skip
        """LTRJ with the load bits of what is given, and STT."""
        self.load(control, accel, velocity, position)
        self.command("STT")

    def load(
        self, control: int, accel: int | None = None, velocity: int | None = None,
        position: int | None = None,
    ) -> None:  # fmt: skip
        words = []
        for bit, value in ((0x20, accel), (0x08, velocity), (0x02, position)):
            if value is not None:
                control |= bit
                words += [value >> 16 & 0xFFFF, value & 0xFFFF]
        self.command("LTRJ", control, *words)

    def filter(self, kp: int = 0, ki: int = 0, kd: int = 0, il: int = 0, ds: int = 0) -> None:
        """LFIL with everything, and UDF."""
        self.command("LFIL", ds << 8 | 0x0F, kp, ki, kd, il)
        self.command("UDF")

    # -- findings -----------------------------------------------------------------------------

    @property
    def violations(self) -> list[Violation]:
        """What was filed so far."""
        self.chip.advance()
        return self._violations

    def rules(self) -> list[str]:
        """Names of the rules broken so far, in order, without the family."""
        return [violation.rule.partition(".")[2] for violation in self.violations]

    def ac_rules(self) -> list[str]:
        return [rule for rule in self.rules() if rule in {row.symbol for row in AC}]
