"""Whatever a host does: HostRdy returns, checksums add up, axes stay apart (PMD-BUS, PMD-PKT)."""

from typing import ClassVar

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from tests.conformance.mc1241a.conftest import BUSY, COMMAND, CYCLE, DATA, Bench
from tests.probe import probe
from vbus.chips.mc1241a.datasheet import COMMANDS, ILLEGAL_CODES
from vbus.core.kernel import MS, US
from vbus.core.state import save

ROWS = {row.code: row for row in COMMANDS}
LEGAL = {*ROWS, 0x49}
AXES = [0x02, 0x01] * 15
"""Changes of the current axis, often enough to matter."""


class Packet:
    """What a host that knows the manual expects of the packet under way."""

    def __init__(self, code: int) -> None:
        row = ROWS.get(code)
        self.code = code
        self.legal = code in LEGAL
        self.to_write = row.write if row else 0
        self.to_read = row.read if row else 0
        self.reset = code == 0x39
        self.sum = code if self.legal and not self.reset else 0

    def wrote(self, word: int) -> None:
        if self.legal and self.to_write:
            self.to_write -= 1
            self.sum = self.sum + word & 0xFFFF

    def begin_read(self) -> int | None:
        """Return the word the host must get, None for data."""
        if not self.legal or self.reset or self.to_write:
            return 0
        return None if self.to_read else self.sum

    def read(self, word: int, expected: int | None) -> None:
        if expected is None:
            self.to_read -= 1
            self.sum = self.sum + word & 0xFFFF
        else:
            assert word == expected, f"{self.code:02X}H"


class AnyHost(RuleBasedStateMachine):
    """Sends legal and illegal bytes in any order, ready or not."""

    settings_of_chip: ClassVar[dict[str, str]] = {}
    part = "MC1241A"

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench("cycle", self.part, **self.settings_of_chip)
        self.packet = Packet(0x00)
        self.packet.legal = False  # nothing sent yet: reads give 0
        self.high: int | None = None
        self.first: int | None = None
        self.expected: int | None = None
        self.current = 0
        self.other: tuple[object, ...] = ()

    @property
    def ready(self) -> bool:
        return bool(self.bench.level("HostRdy"))

    def untouched(self) -> tuple[object, ...]:
        """What the host may change of the axis that is not current."""
        if self.bench.chip.axis_count == 1:
            return ()
        other = probe(self.bench.chip, 2 - self.bench.probe.current_axis)
        return (
            save(other.buffer), other.interrupt_mask, other.breakpoint_value,
            other.position_error_limit, other.step_ratio, other.start_velocity, other.auto_stop,
            other.auto_update, other.two_phase, other.profile_mode,
        )  # fmt: skip

    @rule(wait=st.sampled_from([0, 20 * US, 67 * US, BUSY, 100 * US, CYCLE, 3 * MS]))
    def pause(self, wait: int) -> None:
        self.bench.run_for(wait)

    @rule(code=st.one_of(st.sampled_from(sorted(LEGAL)), st.integers(0, 255)))
    def command(self, code: int) -> None:
        ready = self._after_edge()
        before = self.untouched()
        current = self.bench.probe.current_axis
        self.bench.byte_out(COMMAND, code)
        if not ready:
            return
        self.packet = Packet(code)
        self.high = self.first = None
        if code == 0x39:
            return
        self.bench.run_for(BUSY)
        if self.bench.probe.current_axis == current:
            assert self.untouched() == before

    def _after_edge(self) -> bool:
        """Tell whether HostRdy will be high at the latching edge, one microsecond from now."""
        return self.bench.chip.ready_at() <= self.bench.now + US

    @rule(byte=st.integers(0, 255))
    def write_byte(self, byte: int) -> None:
        ready = self._after_edge()
        before = self.untouched()
        self.bench.byte_out(DATA, byte)
        if not ready:
            return
        if self.high is None:
            self.high = byte
            return
        word, self.high = self.high << 8 | byte, None
        self.packet.wrote(word)
        self.bench.run_for(BUSY)
        assert self.untouched() == before

    @rule()
    def read_byte(self) -> None:
        start = self.bench.now + US - self.bench.chip.read_low_ps
        ready = self.bench.chip.ready_at() <= start
        last = self.bench.probe.last_driven
        byte = self.bench.byte_in()
        if not ready:
            assert byte == last
            return
        if self.first is None:
            self.first = byte
            self.expected = self.packet.begin_read()
            return
        word, self.first = self.first << 8 | byte, None
        self.packet.read(word, self.expected)

    @precondition(lambda self: self.ready)
    @rule(value=st.integers(0, 2**32 - 1), code=st.sampled_from([*sorted(ROWS), *AXES]))
    def whole_packet(self, value: int, code: int) -> None:
        row = ROWS[code]
        self.bench.wait_ready()
        self.command(code)
        self.bench.wait_ready()
        for word in range(row.write):
            for byte in (value >> 16 * word + 8 & 0xFF, value >> 16 * word & 0xFF):
                self.bench.wait_ready()
                self.write_byte(byte)
        for _ in range(2 * (row.read + 1)):
            self.bench.wait_ready()
            self.read_byte()

    @rule(
        pin=st.sampled_from(["QuadA1", "QuadB1", "~Home1", "~Index1", "PosLimit1", "NegLimit1"]),
        level=st.sampled_from([0, 1]),
    )
    def input_moves(self, pin: str, level: int) -> None:
        self.bench.drive(pin, level)

    @invariant()
    def host_rdy_returns(self) -> None:
        assert self.bench.chip.ready_at() <= self.bench.now + 2 * MS
        assert self.ready == (self.bench.chip.ready_at() <= self.bench.now)

    @invariant()
    def the_interrupt_line_shows_the_latch(self) -> None:
        low = self.bench.level("~HostIntrpt") == 0
        assert low == (self.bench.probe.interrupting_axis >= 0)

    def teardown(self) -> None:
        self.bench.run_for(3 * MS)
        assert self.ready
        assert self.bench.send("GET_VRSN") in (0x4A10, 0x4210)


class AnyHostOneAxis(AnyHost):
    part = "MC1141A"


class AnyHostSlots(AnyHost):
    settings_of_chip: ClassVar[dict[str, str]] = {"host_busy": "slot"}


pytestmark = pytest.mark.spec("PMD-PKT-1", "PMD-PKT-2", "PMD-PKT-4", "PMD-BUS-8", "PMD-BUS-11")
bounds = settings(deadline=None, max_examples=60, stateful_step_count=50)
TestAnyHost = AnyHost.TestCase
TestAnyHost.settings = bounds
TestAnyHostOneAxis = AnyHostOneAxis.TestCase
TestAnyHostOneAxis.settings = bounds
TestAnyHostSlots = AnyHostSlots.TestCase
TestAnyHostSlots.settings = bounds


def test_the_illegal_codes_are_those_of_the_manual() -> None:
    assert {0x00, 0x03, 0x04, 0x22} | set(range(0x80, 0x100)) == ILLEGAL_CODES
