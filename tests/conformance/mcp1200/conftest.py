"""An MCP-1200 on a bench: registers over whole cycles or strobes, time by the clock."""

import pytest

from tests.probe import Probe, probe
from vbus.chips.mcp1200.chip import MCP1200
from vbus.chips.mcp1200.datasheet import DATA, REGISTERS
from vbus.core.kernel import SECOND, Clock, Kernel
from vbus.core.options import Value
from vbus.core.signals import LOW, Observer, Pin, Plant, Policy, Violation

RESET_CLK = 320


class Edges(Observer):
    """Notes every edge of the nets it watches: ``(cycle, name, level)``."""

    def __init__(self, hz: int) -> None:
        self.hz = hz
        self.seen: list[tuple[int, str, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((-(-when * self.hz // SECOND), net.partition(".")[2], level))

    def of(self, name: str, level: int) -> list[int]:
        """Return the cycles of the edges of net ``name`` to ``level``."""
        return [cycle for cycle, net, to in self.seen if net == name and to == level]


class Rail(Plant):
    """Moves evenly, whatever the motor does: :attr:`speed` counts a second, set by the test."""

    TAKES = ("drive", "pulses")
    STATE = ("count", "_place: float", "_start: float", "_travel: float")

    def __init__(self, index_every: int = 0) -> None:
        super().__init__()
        self.speed = 0.0
        self.commands: list[float] = []
        self.steps = 0
        self.index_every = index_every
        self._period = 0.0
        self._place = 0.0
        self._start = 0.0
        self._first = 0
        self._travel = 0.0

    def prepare(self, period: float) -> None:
        self._period = period

    def _run(self) -> int:
        self._first = self.count
        self._start = self._place
        self._travel = self.speed * self._period
        self._place += self._travel
        self.count = round(self._place // 1)
        return self.count

    def drive(self, command: float, error: int) -> int:
        self.commands.append(command)
        return self._run()

    def pulses(self, steps: int) -> int:
        self.steps += steps
        return self._run()

    def count_at(self, fraction: float) -> int:
        return round((self._start + fraction * self._travel) // 1)

    def fraction_at(self, count: int) -> float:
        # Going down, a count is reached when the place falls below the next one.
        place = count if self._travel > 0 else count + 1
        return (place - self._start) / self._travel

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        step = 1 if end > start else -1
        for count in range(start + step, end + step, step):
            if self.index_every and count % self.index_every == 0:
                return True, count
        return False, 0

    def resting(self) -> bool:
        return self.speed == 0


class Follower(Plant):
    """Is where the loop wants it at the end of every period; :attr:`lag` counts behind."""

    STATE = ("count", "_first")

    def __init__(self) -> None:
        super().__init__()
        self.lag = 0
        self.stuck = False
        self.commands: list[float] = []
        self._first = 0

    def prepare(self, period: float) -> None:
        pass

    def drive(self, command: float, error: int) -> int:
        self.commands.append(command)
        self._first = self.count
        if not self.stuck and error:
            self.count += error - self.lag
        return self.count

    def count_at(self, fraction: float) -> int:
        return self._first + int((self.count - self._first) * fraction)

    def fraction_at(self, count: int) -> float:
        return (count - self._first) / (self.count - self._first)

    def resting(self) -> bool:
        return False


class Bench:
    """One chip, its reset over at instant 0, with a host of its own.

    Args:
        way: ``"cycle"`` or ``"strobe"``: how bytes reach the chip.
        hz: clock frequency.
        plant: mechanics.
        policy: for violations.
        done: start after the reset.
        settings: of the chip.
    """

    def __init__(
        self,
        way: str = "cycle",
        hz: int = 8_000_000,
        plant: Plant | None = None,
        policy: Policy | None = None,
        done: bool = True,
        kernel: Kernel | None = None,
        name: str = "x",
        **settings: Value,
    ) -> None:
        self.way = way
        self.kernel = kernel if kernel is not None else Kernel()
        self.clock = Clock(hz)
        self.violations: list[Violation] = []
        self.chip = MCP1200(
            name, "MCP-1200", self.kernel, self.clock, settings, policy, self.violations.append
        )
        if plant is not None:
            self.chip.connect(0, plant)
        self._host: dict[str, Pin] = {}
        self.chip.power_on(done)

    @property
    def probe(self) -> Probe:
        """The inside of the chip."""
        return probe(self.chip)

    # -- time ---------------------------------------------------------------------------------

    @property
    def cycle(self) -> int:
        """Clock cycle now."""
        return self.clock.cycle_at(self.kernel.now)

    def until(self, cycle: int) -> None:
        """Let time pass to the start of clock ``cycle``."""
        self.until_ps(self.clock.ps(cycle))

    def until_ps(self, when: int) -> None:
        self.kernel.run_until(when)
        self.chip.advance()
        self.kernel.settle()

    def wait(self, clocks: int) -> None:
        self.until(self.cycle + clocks)

    def wait_ps(self, duration: int) -> None:
        self.until_ps(self.kernel.now + duration)

    @property
    def period(self) -> int:
        """Clocks of the present sample period."""
        return self.probe.sample_period

    def sample_start(self) -> int:
        """Cycle of the next sample start."""
        return self.probe.sample_start + self.probe.sample_period

    def results(self) -> int:
        """Come to the end of BUSY of the next sample that begins; return that cycle."""
        start = self.sample_start()
        self.until(start)
        while self.pin("BUSY"):
            self.wait(1)
        return self.cycle

    def samples(self, count: int = 1) -> None:
        """Let ``count`` samples begin and end their work."""
        for _ in range(count):
            start = self.sample_start()
            self.until(start)
        self.until(start + min(2450, self.period - 1))

    # -- pins ---------------------------------------------------------------------------------

    def drive(self, name: str, level: int) -> None:
        """Move a pin of the host, or of anything outside; -1 lets go."""
        pin = self._host.get(name)
        if pin is None:
            pin = self._host[name] = self.chip.pins[name].net.solder(f"host:{name}")
        pin.drive(level)
        self.kernel.settle()

    def pin(self, name: str) -> int:
        """Level of a pin now."""
        self.chip.advance()
        self.kernel.settle()
        return self.chip.pins[name].value

    def watch(self, *names: str) -> Edges:
        """Note every edge of some pins from now on."""
        edges = Edges(self.clock.hz)
        for name in names:
            self.chip.pins[name].net.observe(edges)
        return edges

    # -- bytes --------------------------------------------------------------------------------

    def write(self, address: int, *data: int) -> None:
        """Write bytes to successive addresses; each is visible when this returns."""
        for byte in data:
            when = self.clock.ps(self.cycle + 4)
            if self.way == "cycle":
                self.kernel.run_until(when)
                self.chip.write(address, byte)
                self.kernel.settle()
            else:
                self._play(True, address, byte, when)
            self.until(self.clock.cycle_at(when) + 4)
            address += 1

    def read(self, address: int) -> int:
        """Read a byte: what it is two clocks from now."""
        when = self.clock.ps(self.cycle + 2)
        if self.way == "cycle":
            self.kernel.run_until(max(when - self.chip.read_low_ps, self.kernel.now))
            self.chip.begin_read(address)
            self.kernel.run_until(when)
            data = self.chip.end_read()
            self.kernel.settle()
            return data
        return self._play(False, address, 0, when)

    def _play(self, write: bool, address: int, byte: int, when: int) -> int:
        value = 0
        for offset, name, level in self.chip.strobes(write, address, byte):
            self.kernel.run_until(max(when + offset, self.kernel.now))
            self.chip.advance()
            self.kernel.settle()
            if offset == 0 and not write:
                value = self.chip.bus_net.value
            self.drive(name, level)
        self.drive(DATA, -1)
        return value

    def put(self, name: str, value: int) -> None:
        """Write a register by name: most significant byte first."""
        row = REGISTERS[name]
        for place, address in enumerate(row.addresses):
            self.write(address, value >> 8 * (len(row.addresses) - 1 - place) & 0xFF)

    def get(self, name: str) -> int:
        """Read a register by name: least significant byte first."""
        row = REGISTERS[name]
        value = 0
        for place, address in enumerate(reversed(row.addresses)):
            value |= self.read(address) << 8 * place
        if row.signed and value >> (row.bits - 1):
            value -= 1 << row.bits
        return value

    def seen(self, name: str) -> int:
        """Return a register's value without a bus cycle."""
        self.chip.advance()
        return int(getattr(self.probe, name.lower()))

    @property
    def position(self) -> int:
        """The actual position now, without a bus cycle."""
        self.chip.advance()
        return self.probe.position_at(self.cycle)

    def extended(self) -> None:
        """Address all 128 registers."""
        self.write(0x02, self.seen("CONFIG") | 0x01)

    def control(self) -> None:
        """Go to control mode, from the next sample on."""
        self.write(0x05, 0x03)

    def trace(self, name: str, samples: int) -> list[int]:
        """Return a register after each of the coming samples."""
        values = []
        for _ in range(samples):
            self.samples()
            values.append(self.seen(name))
        return values

    def rules(self) -> list[str]:
        """Names of the rules broken so far, without the family."""
        return [violation.rule.partition(".")[2] for violation in self.violations]


@pytest.fixture(params=["cycle", "strobe"])
def bench(request: pytest.FixtureRequest) -> Bench:
    """The chip over whole bus cycles and over strobes."""
    return Bench(request.param)


@pytest.fixture
def chip() -> Bench:
    """The chip over whole bus cycles, for what does not depend on the way in."""
    return Bench()


def low_pulse(bench: Bench, name: str, duration: int) -> None:
    """Pull an input low for ``duration`` ps."""
    bench.drive(name, LOW)
    bench.wait_ps(duration)
    bench.drive(name, 1)
