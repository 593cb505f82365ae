"""The host bus: address latch, data latch, output latch, the three orders (MCP-BUS)."""

import pytest

from tests.conformance.mcp1200.conftest import Bench
from vbus.chips.mcp1200.datasheet import DATA
from vbus.core.kernel import NS, US
from vbus.core.signals import STRICT, Policy, Z

PLAIN = 0x20
"""A register without side effects: R20, the lead filter's zero."""

SEPARATE, OVERLAPPED, INSIDE = "separate", "overlapped", "inside"


class Strober:
    """Moves single strobes of a bench, 20 ns apart."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench

    def set(self, **levels: int) -> None:
        """Move ``ale``, ``cs``, ``oe``, ``rw`` and ``bus`` together, then wait 20 ns."""
        names = {"ale": "/ALE", "cs": "/CS", "oe": "/OE", "rw": "R/W", "bus": DATA}
        for key, level in levels.items():
            pin = names[key]
            if pin not in self.bench._host:
                self.bench.drive(pin, self.bench.chip.pins[pin].value)
            self.bench._host[pin].drive(level)
        self.bench.kernel.settle()
        self.bench.wait_ps(20 * NS)

    def begin(self, order: str, address: int, rw: int) -> None:
        """Latch the address and have /CS low, in one of the three orders."""
        self.set(rw=rw)
        if order == INSIDE:
            self.set(cs=0)
        self.set(bus=address, ale=0)
        if order == OVERLAPPED:
            self.set(cs=0)
        self.set(ale=1)
        if order == SEPARATE:
            self.set(cs=0)

    def write(self, order: str, address: int, data: int) -> None:
        self.begin(order, address, 0)
        self.set(bus=data)
        self.set(cs=1)
        self.set(bus=Z)

    def read(self, order: str, address: int) -> int:
        self.begin(order, address, 1)
        self.set(bus=Z)
        self.set(cs=1)
        self.set(oe=0)
        value = self.bench.chip.bus_net.value
        self.set(oe=1)
        return value


@pytest.fixture
def strobes(chip: Bench) -> Strober:
    return Strober(chip)


@pytest.mark.spec("MCP-BUS-3")
@pytest.mark.parametrize("order", [SEPARATE, OVERLAPPED, INSIDE])
def test_the_three_orders_of_ale_and_cs_all_make_a_cycle(strobes: Strober, order: str) -> None:
    strobes.write(order, PLAIN, 0x5A)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0x5A
    assert strobes.read(order, PLAIN) == 0x5A


@pytest.mark.spec("MCP-BUS-13")
@pytest.mark.parametrize("together", [True, False])
def test_a_byte_latched_from_a_floating_bus_is_taken_and_found(
    strobes: Strober, together: bool
) -> None:
    strobes.begin(SEPARATE, PLAIN, 0)
    strobes.set(bus=0x5A)
    if together:
        strobes.set(bus=Z, cs=1)
    else:
        strobes.set(bus=Z)
        strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0x5A

    assert [(v.rule, v.clause, v.severity, v.detail) for v in strobes.bench.violations] == (
        []
        if together
        else [
            (
                "mcp1200.floating-write", "MCP-BUS-13", "warning",
                "no pin drives DB0-DB7: 5AH is taken",
            )
        ]
    )  # fmt: skip


@pytest.mark.spec("MCP-BUS-2")
def test_the_address_latch_follows_the_bus_until_ale_rises(strobes: Strober) -> None:
    strobes.set(rw=0, bus=0x22, ale=0)
    strobes.set(bus=PLAIN)
    strobes.set(ale=1)
    strobes.set(bus=0x21)
    strobes.set(cs=0)
    strobes.set(bus=0x77)
    strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0x77


@pytest.mark.spec("MCP-BUS-2")
def test_cs_falling_inside_ale_closes_the_latch_and_ale_rising_closes_it_no_more(
    strobes: Strober,
) -> None:
    strobes.set(rw=0, bus=PLAIN, ale=0)
    strobes.set(cs=0)
    strobes.set(bus=0x21)
    strobes.set(ale=1)
    strobes.set(bus=0x66)
    strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0x66
    assert strobes.bench.seen("LEAD_POLE") == 0x40


@pytest.mark.spec("MCP-BUS-2")
@pytest.mark.parametrize("order", [SEPARATE, OVERLAPPED, INSIDE])
@pytest.mark.parametrize("driven", [True, False])
def test_an_address_that_nobody_drives_when_the_latch_closes_is_found(
    strobes: Strober, order: str, driven: bool
) -> None:
    strobes.bench.chip.timing_checked = True
    strobes.begin(order, PLAIN if driven else Z, 1)
    closing = "tASR" if order == OVERLAPPED else "tASR1"
    assert (closing in strobes.bench.rules()) != driven


@pytest.mark.spec("MCP-BUS-2")
def test_an_address_that_moves_with_ale_comes_too_late(strobes: Strober) -> None:
    strobes.set(rw=0, bus=PLAIN, ale=0)
    strobes.set(ale=1, bus=0x21)
    strobes.set(cs=0, bus=0x33)
    strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0x33


@pytest.mark.spec("MCP-BUS-4")
def test_data_counts_as_it_is_before_cs_rises(strobes: Strober) -> None:
    strobes.begin(SEPARATE, PLAIN, 0)
    strobes.set(bus=0x11)
    strobes.set(bus=0x22)
    strobes.set(cs=1, bus=0x99)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0x22


@pytest.mark.spec("MCP-BUS-4")
@pytest.mark.parametrize(("late", "stored"), [(0, 0x55), (1, 0xE5)])
def test_the_direction_is_that_of_r_w_when_cs_rises(
    strobes: Strober, late: int, stored: int
) -> None:
    strobes.begin(SEPARATE, PLAIN, 1 - late)
    strobes.set(bus=0x55)
    strobes.set(rw=late)
    strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == stored


@pytest.mark.spec("MCP-BUS-4")
@pytest.mark.parametrize("rw", [0, 1])
def test_r_w_that_moves_with_cs_comes_too_late(strobes: Strober, rw: int) -> None:
    strobes.begin(SEPARATE, PLAIN, rw)
    strobes.set(bus=0x55)
    strobes.set(cs=1, rw=1 - rw)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == (0xE5 if rw else 0x55)


@pytest.mark.spec("MCP-BUS-4")
def test_without_a_closed_address_there_is_no_access(strobes: Strober) -> None:
    strobes.set(rw=0, cs=0)
    strobes.set(bus=PLAIN, ale=0)
    strobes.set(cs=1)
    strobes.set(ale=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.seen("LEAD_ZERO") == 0xE5
    assert strobes.bench.seen("FLAG") == 0x02


@pytest.mark.spec("MCP-BUS-5")
@pytest.mark.parametrize("hz", [2_000_000, 8_000_000, 20_000_000])
def test_a_written_byte_is_visible_four_clocks_after_cs_rises(hz: int) -> None:
    bench = Bench(hz=hz)
    bench.until(100)
    bench.chip.write(PLAIN, 0x42)
    bench.until_ps(bench.clock.ps(104) - 1)
    assert bench.seen("LEAD_ZERO") == 0xE5
    bench.until_ps(bench.clock.ps(104))
    assert bench.seen("LEAD_ZERO") == 0x42


@pytest.mark.spec("MCP-BUS-5")
def test_the_core_sees_a_write_that_becomes_visible_with_the_sample_start(chip: Bench) -> None:
    chip.control()
    start = chip.sample_start()
    chip.until(start - 4)
    chip.chip.write(0x0B, 7)
    chip.until(start + chip.period - 1)
    assert chip.seen("COMMAND_POSITION") == 7


@pytest.mark.spec("MCP-BUS-5")
def test_a_write_one_clock_later_waits_for_the_next_sample(chip: Bench) -> None:
    chip.control()
    start = chip.sample_start()
    chip.until(start - 3)
    chip.chip.write(0x0B, 7)
    chip.until(start + chip.period - 1)
    assert chip.seen("COMMAND_POSITION") == 0
    chip.until(start + 2 * chip.period - 1)
    assert chip.seen("COMMAND_POSITION") == 7


@pytest.mark.spec("MCP-BUS-6", "MCP-BUS-7")
def test_the_output_latch_follows_the_register_until_cs_rises(strobes: Strober) -> None:
    bench = strobes.bench
    bench.control()
    strobes.begin(SEPARATE, 0x07, 1)
    strobes.set(bus=Z, oe=0)
    bench.until(bench.sample_start() + 10)
    assert bench.chip.bus_net.value & 1 == 1
    while bench.pin("BUSY"):
        bench.wait(100)
    assert bench.chip.bus_net.value & 1 == 0
    strobes.set(cs=1)
    bench.until(bench.sample_start() + 10)
    assert bench.pin("BUSY") == 1
    assert bench.chip.bus_net.value & 1 == 0


@pytest.mark.spec("MCP-BUS-6", "MCP-STA-4")
def test_in_position_shows_on_the_bus_in_the_clock_in_which_it_changes(strobes: Strober) -> None:
    """In idle mode, where no other output moves with the samples."""
    bench = strobes.bench
    edges = bench.watch(DATA)
    strobes.begin(SEPARATE, 0x07, 1)
    strobes.set(bus=Z, oe=0)
    assert (bench.pin("IDLE"), bench.chip.bus_net.value) == (1, 0xF8)
    start = bench.sample_start()
    bench.kernel.run_until(bench.clock.ps(start + 3000))
    assert edges.seen[-1] == (start, DATA, 0xFC)


@pytest.mark.spec("MCP-BUS-6")
def test_a_live_register_moves_on_the_bus_while_it_is_read(strobes: Strober) -> None:
    bench = strobes.bench
    bench.until(bench.sample_start())
    strobes.begin(SEPARATE, 0x0F, 1)
    strobes.set(bus=Z, oe=0)
    assert bench.chip.bus_net.value == 0x40
    bench.wait(64)
    assert bench.chip.bus_net.value == 0x3F
    strobes.set(cs=1)
    bench.wait(64)
    assert bench.chip.bus_net.value == 0x3F


@pytest.mark.spec("MCP-BUS-6")
def test_reading_has_its_effect_when_cs_rises(strobes: Strober) -> None:
    bench = strobes.bench
    strobes.begin(SEPARATE, 0x14, 1)
    bench.probe.set_position(0x123456, bench.cycle)
    assert bench.seen("ACTUAL_POSITION") == 0
    strobes.set(cs=1)
    assert bench.seen("ACTUAL_POSITION") == 0x123456


@pytest.mark.spec("MCP-BUS-7")
def test_oe_puts_the_output_latch_on_the_bus_as_often_as_asked(strobes: Strober) -> None:
    strobes.begin(SEPARATE, PLAIN, 1)
    strobes.set(bus=Z)
    strobes.set(cs=1)
    pin = strobes.bench.chip.data_pin
    assert pin.level == Z
    for _ in range(2):
        strobes.set(oe=0)
        assert pin.level == 0xE5
        strobes.set(oe=1)
        assert pin.level == Z
    strobes.bench.wait_ps(US)
    strobes.write(SEPARATE, PLAIN, 0x10)
    strobes.set(oe=0)
    assert pin.level == 0xE5


@pytest.mark.spec("MCP-BUS-2", "MCP-BUS-6")
@pytest.mark.parametrize("order", [SEPARATE, OVERLAPPED, INSIDE])
def test_a_read_shows_the_register_before_cs_rises(strobes: Strober, order: str) -> None:
    strobes.bench.write(PLAIN, 0x5A)
    strobes.begin(order, PLAIN, 1)
    strobes.set(bus=Z, oe=0)
    assert strobes.bench.chip.bus_net.value == 0x5A


@pytest.mark.spec("MCP-BUS-8")
def test_oe_low_in_a_write_is_contention_and_the_host_byte_is_taken(strobes: Strober) -> None:
    strobes.begin(SEPARATE, PLAIN, 0)
    strobes.set(bus=0x3C)
    strobes.set(oe=0)
    strobes.set(cs=1)
    strobes.set(bus=Z, oe=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.rules() == ["contention"]
    assert strobes.bench.seen("LEAD_ZERO") == 0x3C


@pytest.mark.spec("MCP-BUS-8")
def test_oe_low_before_a_write_begins_is_contention_too(strobes: Strober) -> None:
    strobes.set(rw=0)
    strobes.set(bus=PLAIN, ale=0)
    strobes.set(ale=1)
    strobes.set(bus=Z, oe=0)
    strobes.set(cs=0)
    strobes.set(bus=0x3C)
    strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    assert strobes.bench.rules() == ["contention"]
    assert strobes.bench.seen("LEAD_ZERO") == 0x3C


@pytest.mark.spec("MCP-BUS-8")
def test_a_read_that_becomes_a_write_with_oe_low_is_contention(strobes: Strober) -> None:
    strobes.begin(SEPARATE, PLAIN, 1)
    strobes.set(bus=Z, oe=0)
    strobes.set(rw=0)
    assert strobes.bench.rules() == ["contention"]


@pytest.mark.spec("MCP-BUS-9", "MCP-T-22")
def test_bit_6_of_the_address_counts_only_with_extended_addressing(bench: Bench) -> None:
    bench.write(0x4B, 0x55)
    assert bench.seen("COMMAND_INCREMENT") == 0x55
    assert bench.seen("SATURATION") == 0xF0
    assert bench.read(0x4B) == bench.read(0x0B) == 0x55
    bench.write(0x02, 0x01)
    bench.write(0x4B, 0x66)
    assert bench.seen("SATURATION") == 0x66
    assert bench.seen("COMMAND_INCREMENT") == 0x55
    assert bench.read(0x4B) == 0x66


@pytest.mark.spec("MCP-BUS-10")
def test_an_unlisted_address_reads_zero_and_is_reported_once(bench: Bench) -> None:
    bench.extended()
    for address in (0x1E, 0x36, 0x7F):
        bench.write(address, 0xFF)
        assert bench.read(address) == 0
        assert bench.read(address) == 0
    assert bench.rules() == ["reserved"] * 3


@pytest.mark.spec("MCP-BUS-11", "MCP-AMB-16")
@pytest.mark.parametrize("write", [False, True])
@pytest.mark.parametrize(("stall", "late"), [(0, 0), (1, 3), (4, 12)])
def test_an_access_stalls_the_core_only_if_the_board_says_so(
    stall: int, late: int, write: bool
) -> None:
    bench = Bench(io_stall_clk=stall)
    bench.control()
    start = bench.sample_start()
    bench.until(start + 10)
    for _ in range(3):
        if write:
            bench.write(PLAIN, 0x77)
        else:
            bench.read(PLAIN)
    bench.until(start + 1000 + late - 1)
    assert bench.pin("BUSY") == 1
    bench.until(start + 1000 + late)
    assert bench.pin("BUSY") == 0


@pytest.mark.spec("MCP-BUS-11")
def test_an_access_stalls_nothing_while_no_sample_is_computed() -> None:
    bench = Bench(io_stall_clk=1)
    bench.samples(1)
    bench.read(PLAIN)
    bench.samples(1)
    assert bench.read(0x07) == 0xFC


@pytest.mark.spec("MCP-BUS-12")
@pytest.mark.parametrize(("write", "clocks"), [(True, 4), (False, 2)])
def test_the_recovery_time_between_accesses(write: bool, clocks: int) -> None:
    for wait, broken in ((clocks * 125_000, []), (clocks * 125_000 - 1, ["recovery"])):
        bench = Bench()
        bench.until_ps(10 * US)
        bench.chip.begin_read(PLAIN)
        bench.chip.end_read()
        bench.until_ps(10 * US + wait)
        if write:
            bench.chip.write(PLAIN, 0x77)
        else:
            bench.chip.begin_read(PLAIN)
            bench.chip.end_read()
        assert bench.rules() == broken
        bench.wait_ps(US)
        if write:
            assert bench.seen("LEAD_ZERO") == 0x77


@pytest.mark.spec("MCP-BUS-12")
def test_a_strict_board_loses_the_access_that_came_too_soon() -> None:
    bench = Bench(policy=Policy(STRICT))
    bench.until_ps(10 * US)
    bench.chip.write(PLAIN, 0x77)
    bench.until_ps(10 * US + 300 * NS)
    bench.chip.write(0x21, 0x78)
    bench.until_ps(20 * US)
    assert bench.seen("LEAD_ZERO") == 0x77
    assert bench.seen("LEAD_POLE") == 0x40
    assert bench.read(PLAIN) == 0x77
    bench.chip.begin_read(0x21)
    bench.wait_ps(100 * NS)
    assert bench.chip.end_read() == 0x77
    assert bench.rules() == ["recovery", "recovery"]


@pytest.mark.spec("MCP-BUS-12")
def test_the_chip_is_ready_when_its_recovery_time_is_over() -> None:
    bench = Bench()
    bench.until_ps(10 * US)
    assert bench.chip.ready_at() <= bench.kernel.now
    bench.chip.write(PLAIN, 1)
    assert bench.chip.ready_at() == 10 * US + 500 * NS


@pytest.mark.spec("MCP-BUS-1")
def test_ad6_is_pulled_up_on_a_floating_bus(strobes: Strober) -> None:
    strobes.bench.extended()
    strobes.set(rw=0, bus=0x01, ale=0)
    strobes.set(bus=Z)
    strobes.set(ale=1)
    strobes.set(cs=0)
    strobes.set(bus=0x5A)
    strobes.set(cs=1)
    strobes.bench.wait_ps(US)
    # 01H floated with AD6 high is 41H, which is not listed; R01 keeps its value.
    assert strobes.bench.seen("FEATURE") == 0
    assert [v.measured for v in strobes.bench.violations] == [0x41]


@pytest.mark.spec("MCP-BUS-1", "MCP-BUS-2")
def test_edges_of_a_whole_cycle() -> None:
    chip = Bench().chip
    latch = [(-70_000, DATA, 0x2A), (-70_000, "/ALE", 0), (-60_000, "/ALE", 1)]
    assert chip.strobes(True, 0x2A, 0x5A) == [
        (-70_000, "R/W", 0), *latch,
        (-50_000, DATA, 0x5A), (-50_000, "/CS", 0),
        (0, "/CS", 1),
        (10_000, DATA, Z), (10_000, "R/W", 1),
    ]  # fmt: skip
    assert chip.strobes(False, 0x2A, 0) == [
        (-70_000, "R/W", 1), *latch,
        (-50_000, DATA, Z), (-50_000, "/CS", 0), (-45_000, "/OE", 0),
        (0, "/CS", 1), (10_000, "/OE", 1),
    ]  # fmt: skip


@pytest.mark.spec("MCP-BUS-1")
def test_the_bus_has_four_strobes_and_one_bundle_of_eight(chip: Bench) -> None:
    pins = chip.chip.pins
    assert [pin.name for pin in chip.chip.bus_pins] == ["/ALE", "/CS", "/OE", "R/W", "DB0-DB7"]
    assert pins[DATA].net.width == 8
    assert pins["MC0-MC11"].net.width == 12


@pytest.mark.spec("MCP-BUS-6")
def test_a_read_that_does_not_take_place_leaves_the_latch(chip: Bench) -> None:
    chip.write(0x20, 0x5A)
    assert chip.read(0x20) == 0x5A
    chip.write(0x21, 0x33)
    chip.chip.begin_read(0x21)
    chip.chip.drop_read()
    assert chip.chip.end_read() == 0x5A
    chip.chip.begin_read(0x21)
    assert chip.chip.end_read() == 0x33


@pytest.mark.spec("MCP-SMP-5")
def test_an_axis_that_moves_does_not_rest_though_nothing_is_connected(chip: Bench) -> None:
    chip.control()
    chip.samples(3)
    assert chip.chip.resting()
    chip.put("VELOCITY_COMMAND", 5)
    chip.write(0x00, 0x0D)
    chip.samples(1)
    assert not chip.chip.resting()
