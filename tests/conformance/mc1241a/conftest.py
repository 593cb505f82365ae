"""A chip set on a bench: packets over whole cycles or strobes, time by the clock."""

import pytest

from tests.probe import Probe, probe
from vbus.chips.mc1241a.chip import MC1241A
from vbus.chips.mc1241a.datasheet import COMMANDS
from vbus.core.kernel import NS, US, Clock, Kernel
from vbus.core.options import Value
from vbus.core.signals import Pin, Policy, Violation

CYCLE = 542_720 * NS
SLOT = 67_840 * NS
BUSY = 67_500 * NS
CLK = 40 * NS
DATA, COMMAND = 0, 1


def words(value: int, count: int) -> list[int]:
    """Return ``value`` as words, high word first."""
    return [value >> 16 * (count - 1 - n) & 0xFFFF for n in range(count)]


class Bench:
    """One chip set, its reset over at instant 0, with a host of its own.

    Args:
        way: ``"cycle"`` or ``"strobe"``: how bytes reach the chip.
        part: part number.
        policy: for violations.
        settings: of the chip.
    """

    def __init__(
        self,
        way: str = "cycle",
        part: str = "MC1241A",
        policy: Policy | None = None,
        hz: int = 25_000_000,
        **settings: Value,
    ) -> None:
        self.way = way
        self.kernel = Kernel()
        self.violations: list[Violation] = []
        self.chip = MC1241A(
            "m", part, self.kernel, Clock(hz), settings, policy, self.violations.append
        )
        self.chip.power_on(True)
        self._host: dict[str, Pin] = {}

    # -- pins ---------------------------------------------------------------------------------

    def drive(self, name: str, level: int) -> None:
        """Move a pin of the host (or of anything outside); -1 lets go."""
        if name not in self._host:
            self._host[name] = self.chip.pins[name].net.solder(f"host:{name}")
        self._host[name].drive(level)
        self.kernel.settle()

    def level(self, name: str) -> int:
        """Return the level of a pin as it is now."""
        self.chip.advance()
        return self.chip.pins[name].value

    @property
    def probe(self) -> Probe:
        """The inside of the chip."""
        return probe(self.chip)

    # -- time ---------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        return self.kernel.now

    def run_until(self, when: int) -> None:
        self.kernel.run_until(when)
        self.chip.advance()
        self.kernel.settle()

    def run_for(self, duration: int) -> None:
        self.run_until(self.kernel.now + duration)

    def next_cycle(self, count: int = 1) -> None:
        """Come to the instant of the count-th cycle from now, after it has run."""
        self.run_until((self.now // CYCLE + count) * CYCLE)

    # -- bytes --------------------------------------------------------------------------------

    def byte_out(self, address: int, data: int) -> None:
        """Write a byte; the latching edge is one microsecond from now."""
        when = self.now + US
        if self.way == "cycle":
            self.kernel.run_until(when)
            self.chip.write(address, data)
            self.kernel.settle()
        else:
            self.play(True, address, data, when)

    def byte_in(self, address: int = DATA) -> int:
        """Read a byte; the trailing edge of the strobe is one microsecond from now."""
        when = self.now + US
        if self.way == "strobe" and address == DATA:
            return self.play(False, address, 0, when)
        self.kernel.run_until(when - self.chip.read_low_ps)
        self.chip.begin_read(address)
        self.kernel.run_until(when)
        data = self.chip.end_read()
        self.kernel.settle()
        return data

    def play(self, write: bool, address: int, data: int, when: int) -> int:
        value = 0
        for offset, name, level in self.chip.strobes(write, address, data):
            if self.now < when <= when + offset:
                self.kernel.run_until(when)
            if offset == 0 and not write:
                value = self.chip.data_pin.value
            self.kernel.run_until(when + offset)
            self.drive(name, level)
        return value

    # -- words and packets --------------------------------------------------------------------

    def wait_ready(self) -> None:
        self.chip.advance()
        if self.chip.ready_at() > self.now:
            self.run_until(self.chip.ready_at())

    def command(self, code: int) -> None:
        self.wait_ready()
        self.byte_out(COMMAND, code)

    def write_word(self, word: int) -> None:
        self.wait_ready()
        self.byte_out(DATA, word >> 8)
        self.byte_out(DATA, word & 0xFF)

    def read_word(self) -> int:
        self.wait_ready()
        high = self.byte_in()
        return high << 8 | self.byte_in()

    def send(self, name: str, value: int = 0) -> int:
        """Send a packet by mnemonic, wait until it has been carried out, return what it reads."""
        row = COMMANDS[name]
        self.command(row.code)
        for word in words(value, row.write):
            self.write_word(word)
        result = 0
        for _ in range(row.read):
            result = result << 16 | self.read_word()
        self.wait_ready()
        bits = 16 * row.read
        if row.signed and result >> (bits - 1) & 1 if bits else False:
            result -= 1 << bits
        return result

    def checksum(self) -> int:
        """Read the checksum of the packet just sent."""
        word = self.read_word()
        self.wait_ready()
        return word

    # -- what tests ask most ------------------------------------------------------------------

    def status(self) -> int:
        return self.send("GET_STATUS")

    def load(self, **values: int) -> None:
        """Load buffered registers: pos, vel, acc, max_acc, jerk, ratio (as numbers sent)."""
        for name, value in values.items():
            self.send("SET_" + name.upper(), value)

    def move(self, **values: int) -> None:
        """Load registers and update; then come to just before the cycle that acts on it."""
        self.load(**values)
        self.send("UPDATE")

    def seen(self, name: str, axis: int = 1) -> int:
        """Return a number of the live view, which takes no bus cycle and no time."""
        return int(self.chip.telemetry()[f"{name} {axis}"])

    def seen_time(self) -> int:
        """Return the chip set's time (cycles) in the same way."""
        return int(self.chip.telemetry()["time"])

    def trace(self, name: str, cycles: int, axis: int = 1) -> list[int]:
        """Return a number of the live view after each of the coming cycles."""
        values = []
        for _ in range(cycles):
            self.next_cycle()
            values.append(self.seen(name, axis))
        return values

    def rules(self, *accepted: str) -> list[str]:
        """Return the names of the rules broken so far but ``accepted``, without the family."""
        names = [violation.rule.partition(".")[2] for violation in self.violations]
        return [name for name in names if name not in accepted]


@pytest.fixture(params=["cycle", "strobe"])
def bench(request: pytest.FixtureRequest) -> Bench:
    """The MC1241A, tried over whole bus cycles and over strobes."""
    return Bench(request.param)


@pytest.fixture
def chip() -> Bench:
    """The MC1241A over whole bus cycles, for what does not depend on the way in."""
    return Bench()
