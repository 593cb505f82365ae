"""Breakpoint compare with the TRIG pin (MCP-BRK), capture by INDEX and TRIG (MCP-CAP)."""

import itertools

import pytest

from tests.conformance.mcp1200.conftest import Bench, Rail, low_pulse
from vbus.core.kernel import US
from vbus.core.signals import HIGH, LOW, Switch, Z

# 1 000 000 counts a second at 8 MHz: a count every 8 clocks.
SPEED = 1_000_000.0
PERIOD = 4160


def moving(index_every: int = 0, speed: float = SPEED, **settings: str) -> tuple[Bench, Rail]:
    rail = Rail(index_every)
    rail.speed = speed
    return Bench(plant=rail, **settings), rail


def arm(bench: Bench, place: int, repeat: int = 0) -> None:
    """Set up the breakpoint as the manual's usage example does."""
    bench.write(0x04, 0x00)
    bench.write(0x02, 0x10)
    bench.put("BREAKPOINT", place & 0xFFFFFF)
    bench.samples(2)
    bench.write(0x07, 0)
    if repeat:
        bench.write(0x02, 0x30)
        bench.put("BREAKPOINT", repeat & 0xFFFFFF)


@pytest.mark.spec("MCP-BRK-1", "MCP-BRK-2")
@pytest.mark.parametrize("control", [False, True])
def test_flag_and_pin_fall_in_the_clock_in_which_the_count_is_reached(control: bool) -> None:
    bench, _ = moving()
    if control:
        bench.control()
    arm(bench, 3000)
    bench.until(3000 * 8 - 1)
    assert (bench.position, bench.pin("TRIG"), bench.seen("STATUS") & 0x20) == (2999, 1, 0x20)
    bench.until(3000 * 8)
    assert (bench.position, bench.pin("TRIG"), bench.seen("STATUS") & 0x20) == (3000, 0, 0)
    bench.samples(5)
    assert bench.pin("TRIG") == 0
    bench.write(0x07, 0)
    assert (bench.pin("TRIG"), bench.seen("STATUS") & 0x20) == (1, 0x20)


@pytest.mark.spec("MCP-BRK-1")
def test_every_count_is_compared_however_fast_it_goes_by() -> None:
    rail = Rail()
    rail.speed = 8_000_000.0
    bench = Bench(plant=rail)
    bench.write(0x02, 0x10)
    bench.put("BREAKPOINT", 54_321)
    bench.until(54_320)
    assert bench.pin("TRIG") == 1
    bench.until(54_321)
    assert bench.pin("TRIG") == 0


@pytest.mark.spec("MCP-BRK-1")
def test_a_count_between_two_clocks_is_seen_by_the_second() -> None:
    bench, _ = moving(speed=700_000.0)
    arm(bench, 3000)
    # 3000 counts at 700 kHz take 34285.7 clocks.
    bench.until(34_285)
    assert (bench.position, bench.pin("TRIG")) == (2999, 1)
    bench.until(34_286)
    assert (bench.position, bench.pin("TRIG")) == (3000, 0)


@pytest.mark.spec("MCP-BRK-1")
def test_all_24_bits_are_compared_and_the_counter_may_wrap() -> None:
    bench, _ = moving()
    bench.probe.set_position(0x7FFFFF - 2000, bench.cycle)
    arm(bench, 0x800001)
    bench.until((2000 + 2) * 8 - 1)
    assert bench.pin("TRIG") == 1
    bench.until((2000 + 2) * 8)
    assert (bench.pin("TRIG"), bench.position) == (0, -0x7FFFFF)


@pytest.mark.spec("MCP-BRK-1")
def test_backwards_and_with_swapped_channels() -> None:
    for swap, speed in ((0, -SPEED), (0x80, SPEED)):
        bench, _ = moving(speed=0.0)
        bench.write(0x1A, swap)
        bench.probe.plant.speed = speed  # type: ignore[union-attr]
        bench.until(PERIOD)
        arm(bench, -3000)
        edges = bench.watch("TRIG")
        bench.samples(12)
        assert len(edges.of("TRIG", 0)) == 1
        assert bench.seen("STATUS") & 0x20 == 0
        # Going down from 0, the count -3000 is entered just after place -2999 was left.
        assert edges.of("TRIG", 0)[0] == pytest.approx(PERIOD + 2999 * 8, abs=10)


@pytest.mark.spec("MCP-BRK-2")
def test_in_single_mode_the_compare_register_is_loaded_67_clocks_after_a_sample_start() -> None:
    bench, _ = moving(speed=0.0)
    bench.write(0x02, 0x10)
    bench.probe.set_position(50, bench.cycle)
    bench.put("BREAKPOINT", 50)
    start = bench.sample_start()
    bench.until(start + 66)
    assert bench.pin("TRIG") == 1
    bench.until(start + 67)
    assert bench.pin("TRIG") == 0


@pytest.mark.spec("MCP-BRK-2", "MCP-REG-34", "MCP-REG-48")
def test_the_three_bytes_of_the_breakpoint_are_taken_at_the_sample_start() -> None:
    bench, _ = moving(speed=0.0)
    bench.write(0x02, 0x10)
    bench.write(0x3F, 0x12)
    bench.samples(1)
    bench.write(0x3E, 0x34)
    bench.until(bench.sample_start() + 1)
    bench.write(0x3D, 0x56)
    bench.wait(100)
    assert bench.probe.compared == 0x123400
    bench.samples(1)
    assert bench.probe.compared == 0x123456


@pytest.mark.spec("MCP-BRK-1", "MCP-BRK-3", "MCP-T-15", "MCP-AMB-23")
def test_a_pulse_at_15000_and_every_2500_counts_after_it() -> None:
    bench, _ = moving(speed=0.0)
    bench.control()
    arm(bench, 15_000, 2_500)
    rail = bench.probe.plant
    edges = bench.watch("TRIG")
    bench.until(bench.sample_start())
    begun = bench.cycle
    assert isinstance(rail, Rail)
    rail.speed = SPEED
    bench.until(begun + 23_000 * 8 + PERIOD)
    first = edges.of("TRIG", 0)
    # The rail moves from the next period of the plant, 1000 clocks after the sample start.
    ways = [fall - (begun + 1000) for fall in first]
    assert ways == [15_000 * 8, 17_500 * 8, 20_000 * 8, 22_500 * 8]
    rises = edges.of("TRIG", 1)
    assert len(rises) == 4
    for fall, rise in zip(first, rises, strict=True):
        assert 67 <= rise - fall <= PERIOD + 67
        assert (rise - begun - 67) % PERIOD == 0
    assert bench.seen("STATUS") & 0x20


@pytest.mark.spec("MCP-BRK-3")
def test_repeat_backwards_with_a_negative_step() -> None:
    bench, rail = moving(speed=0.0)
    arm(bench, -10_000, -2_500)
    edges = bench.watch("TRIG")
    rail.speed = -SPEED
    bench.wait(21_000 * 8)
    falls = edges.of("TRIG", 0)
    assert len(falls) == 5
    assert {b - a for a, b in itertools.pairwise(falls)} == {20_000}


@pytest.mark.spec("MCP-BRK-3")
def test_repeated_breakpoints_wrap_with_the_counter() -> None:
    bench, rail = moving(speed=0.0)
    bench.probe.set_position(0x7FFF00, bench.cycle)
    arm(bench, 0x7FFFF0, 0x1000)
    edges = bench.watch("TRIG")
    rail.speed = SPEED
    bench.wait(10_000 * 8)
    assert len(edges.of("TRIG", 0)) == 3
    assert bench.probe.compared == -0x800000 + 3 * 0x1000 - 0x10


@pytest.mark.spec("MCP-BRK-3", "MCP-STA-2")
def test_writing_status_in_repeat_mode_does_not_lose_the_next_breakpoint() -> None:
    bench, rail = moving(speed=0.0)
    arm(bench, 10_000, 2_500)
    edges = bench.watch("TRIG")
    rail.speed = SPEED
    while not edges.of("TRIG", 0):
        bench.wait(10)
    bench.write(0x07, 0)
    bench.wait(6_000 * 8)
    assert len(edges.of("TRIG", 0)) == 3


@pytest.mark.spec("MCP-BRK-3")
def test_no_repeat_pulse_is_shorter_than_67_clocks() -> None:
    """A step that matches again and again, at every phase of the sample."""
    bench, rail = moving(speed=0.0)
    arm(bench, 1_000, 533)
    edges = bench.watch("TRIG")
    rail.speed = SPEED
    bench.wait(60_000 * 8)
    widths = [
        rise - fall for fall, rise in zip(edges.of("TRIG", 0), edges.of("TRIG", 1), strict=False)
    ]
    assert len(widths) > 50
    assert 67 <= min(widths) < 200
    assert 4000 < max(widths) <= PERIOD + 67


@pytest.mark.spec("MCP-BRK-2", "MCP-BRK-3")
def test_leaving_repeat_mode_forgets_a_match_the_routine_has_not_seen() -> None:
    bench, _ = moving(speed=0.0)
    arm(bench, 5, 100)
    bench.put("PRESET_POSITION", 5)
    assert bench.pin("TRIG") == 0
    bench.write(0x02, 0x10)
    bench.samples(1)
    # Single mode: the register is the breakpoint, and the flag waits for the host.
    assert (bench.probe.compared, bench.pin("TRIG")) == (100, 0)
    bench.write(0x02, 0x30)
    bench.samples(2)
    assert (bench.probe.compared, bench.pin("TRIG")) == (100, 0)
    bench.write(0x07, 0)
    bench.put("PRESET_POSITION", 100)
    assert bench.pin("TRIG") == 0
    bench.samples(1)
    assert (bench.probe.compared, bench.pin("TRIG")) == (200, 1)


@pytest.mark.spec("MCP-BRK-2", "MCP-BRK-3", "MCP-SMP-2")
def test_leaving_repeat_mode_before_its_routine_has_come_loads_the_breakpoint() -> None:
    bench, _ = moving(speed=0.0)
    arm(bench, 5, 100)
    bench.put("PRESET_POSITION", 5)
    start = bench.sample_start()
    bench.until(start + 10)
    # The sample has seen the match; /SYNC holds its routine off for good.
    bench.drive("/SYNC", LOW)
    bench.write(0x02, 0x10)
    bench.until(start + 2 * PERIOD)
    assert (bench.probe.compared, bench.pin("TRIG")) == (5, 0)
    bench.drive("/SYNC", HIGH)
    bench.samples(1)
    assert (bench.probe.compared, bench.pin("TRIG")) == (100, 0)


@pytest.mark.spec("MCP-BRK-4")
def test_clearing_the_flag_on_the_spot_does_not_trigger_again_but_returning_does() -> None:
    bench, _ = moving(speed=0.0)
    arm(bench, 5)
    bench.probe.set_position(4, bench.cycle)
    bench.write(0x15, 0, 0, 5)
    assert bench.pin("TRIG") == 0
    bench.write(0x07, 0)
    bench.samples(3)
    assert bench.pin("TRIG") == 1
    bench.write(0x15, 0, 0, 6)
    bench.write(0x15, 0, 0, 5)
    assert bench.pin("TRIG") == 0


@pytest.mark.spec("MCP-BRK-4")
def test_enabling_while_equal_triggers() -> None:
    bench, _ = moving(speed=0.0)
    bench.put("BREAKPOINT", 0)
    bench.samples(1)
    assert bench.seen("STATUS") & 0x20
    bench.write(0x02, 0x10)
    assert (bench.pin("TRIG"), bench.seen("STATUS") & 0x20) == (0, 0)


@pytest.mark.spec("MCP-BRK-4")
def test_a_counter_loaded_within_a_sample_matches_in_the_clock_in_which_it_gets_there() -> None:
    bench, _ = moving()
    arm(bench, 0x050000)
    bench.until(bench.sample_start())
    bench.write(0x15, 0x04, 0xFF, 0xE0)
    following = bench.sample_start()
    while bench.position != 0x050000:
        assert bench.pin("TRIG") == 1
        bench.until(bench.cycle + 1)
    assert bench.cycle < following
    assert bench.pin("TRIG") == 0


@pytest.mark.spec("MCP-BRK-5", "MCP-REG-3")
def test_without_the_feature_nothing_is_compared_and_the_pin_is_released() -> None:
    bench, _ = moving()
    bench.put("BREAKPOINT", 3000)
    bench.until(3010 * 8)
    assert (bench.pin("TRIG"), bench.seen("STATUS") & 0x20) == (1, 0x20)
    arm(bench, 6000)
    bench.until(6001 * 8)
    assert bench.pin("TRIG") == 0
    bench.write(0x02, 0x00)
    assert (bench.pin("TRIG"), bench.seen("STATUS") & 0x20) == (1, 0)


@pytest.mark.spec("MCP-CAP-4")
def test_as_an_input_trig_is_not_driven_by_the_breakpoint() -> None:
    bench, _ = moving()
    bench.write(0x03, 0x04)
    arm(bench, 3000)
    bench.until(3001 * 8)
    assert bench.seen("STATUS") & 0x20 == 0
    assert bench.chip.pins["TRIG"].level == Z
    bench.write(0x03, 0x00)
    assert bench.pin("TRIG") == 0


# -- capture --------------------------------------------------------------------------------------


@pytest.mark.spec("MCP-CAP-2", "MCP-CAP-3", "MCP-REG-29", "MCP-AMB-15")
def test_a_trigger_edge_captures_the_position_of_its_instant() -> None:
    bench, _ = moving()
    bench.write(0x03, 0x06)
    bench.until(1000 * 8 + 3)
    bench.drive("TRIG", LOW)
    assert bench.read(0x03) == 0x07
    assert bench.get("CAPTURE") == 1000
    bench.drive("TRIG", HIGH)
    bench.wait(800)
    low_pulse(bench, "TRIG", US)
    assert bench.get("CAPTURE") == 1000
    bench.write(0x03, 0x06)
    assert bench.read(0x03) == 0x06
    bench.until(3000 * 8)
    bench.drive("TRIG", LOW)
    assert (bench.get("CAPTURE"), bench.read(0x03)) == (3000, 0x07)


@pytest.mark.spec("MCP-CAP-2", "MCP-CAP-3")
def test_the_latches_work_without_capture_enabled() -> None:
    bench, _ = moving()
    bench.write(0x03, 0x04)
    low_pulse(bench, "TRIG", US)
    low_pulse(bench, "INDEX", 2 * US)
    assert bench.read(0x03) == 0x0D
    assert bench.get("CAPTURE") == 0
    bench.write(0x03, 0x0D)
    assert bench.read(0x03) == 0x0D
    bench.write(0x03, 0x0C)
    assert bench.read(0x03) == 0x0C
    bench.write(0x03, 0x05)
    assert bench.read(0x03) == 0x04


@pytest.mark.spec("MCP-CAP-2")
def test_a_trigger_needs_the_pin_to_be_an_input() -> None:
    bench, _ = moving()
    bench.write(0x03, 0x02)
    low_pulse(bench, "TRIG", US)
    assert bench.read(0x03) == 0x02
    assert bench.get("CAPTURE") == 0


@pytest.mark.spec("MCP-CAP-2", "MCP-CAP-3")
@pytest.mark.parametrize(("level", "rising", "at"), [
    ("low", 0x00, 2000), ("low", 0x20, 2001), ("high", 0x20, 2000), ("high", 0x00, 2001),
])  # fmt: skip
def test_the_selected_edge_of_the_plant_s_index_captures(level: str, rising: int, at: int) -> None:
    bench, _ = moving(index_every=2000, index=level)
    bench.wait(160)
    bench.write(0x03, 0x10 | rising)
    bench.until(at * 8 - 1)
    assert bench.seen("CAPTURE_CONTROL") & 0x08 == 0
    bench.until(at * 8)
    assert bench.seen("CAPTURE_CONTROL") & 0x08
    assert bench.seen("CAPTURE") == at
    bench.until(6000 * 8)
    assert bench.seen("CAPTURE") == at
    bench.write(0x03, 0x10 | rising)
    bench.until(8001 * 8)
    assert bench.seen("CAPTURE") == 8000 + at - 2000


@pytest.mark.spec("MCP-CAP-3")
def test_both_sources_store_into_the_same_registers() -> None:
    bench, _ = moving(index_every=2000)
    bench.wait(160)
    bench.write(0x03, 0x16)
    bench.until(1000 * 8)
    bench.drive("TRIG", LOW)
    assert bench.get("CAPTURE") == 1000
    bench.until(2001 * 8)
    assert bench.get("CAPTURE") == 2000
    assert bench.read(0x03) == 0x1F


@pytest.mark.spec("MCP-CAP-3")
def test_the_captured_position_is_static_and_survives_a_soft_reset() -> None:
    bench, _ = moving()
    bench.write(0x03, 0x06)
    bench.until(1000 * 8)
    bench.drive("TRIG", LOW)
    bench.write(0x05, 0x00)
    bench.wait(400)
    assert [bench.read(address) for address in (0x30, 0x2E, 0x2F)] == [0x00, 0xE8, 0x03]
    assert bench.read(0x03) == 0x07


@pytest.mark.spec("MCP-CAP-3")
@pytest.mark.parametrize(("wire", "latch"), [("INDEX", 0x08), ("TRIG", 0x01)])
def test_the_home_switch_may_be_wired_to_a_capture_input(wire: str, latch: int) -> None:
    rail = Rail()
    rail.switches["home"] = Switch(1500, 2500)
    rail.speed = SPEED
    bench = Bench(plant=rail, home_switch=wire)
    bench.write(0x03, 0x16)
    bench.until(1500 * 8 - 1)
    assert bench.seen("CAPTURE_CONTROL") & latch == 0
    bench.until(1500 * 8)
    assert bench.seen("CAPTURE_CONTROL") & latch
    assert bench.seen("CAPTURE") == 1500


@pytest.mark.spec("MCP-EXC-7", "MCP-STA-1")
def test_limit_switches_of_the_axis_pull_limit_low() -> None:
    rail = Rail()
    rail.switches["limit+"] = Switch(1500, 2500)
    rail.switches["limit-"] = Switch(-2500, -1500)
    rail.speed = SPEED
    bench = Bench(plant=rail)
    bench.write(0x04, 0x00)
    bench.until(1500 * 8 - 1)
    assert bench.seen("STATUS") & 0x80
    bench.until(1500 * 8)
    assert not bench.seen("STATUS") & 0x80
    bench.write(0x07, 0)
    assert not bench.seen("STATUS") & 0x80
    bench.until(2500 * 8)
    bench.write(0x07, 0)
    assert bench.seen("STATUS") & 0x80
    free = Bench(plant=rail, limit_switches=False)
    free.until(20_000)
    assert free.seen("STATUS") & 0x80


@pytest.mark.spec("MCP-EXC-7", "MCP-STA-1")
def test_a_switch_opens_and_closes_at_its_bounds_going_down() -> None:
    rail = Rail()
    rail.switches["limit-"] = Switch(-2500, -1500)
    rail.speed = -SPEED
    bench = Bench(plant=rail)
    bench.write(0x04, 0x00)
    # The highest closed count is -1501, the first open one below is -2501.
    bench.until(1500 * 8 - 1)
    assert bench.seen("STATUS") & 0x80
    bench.until(1500 * 8 + 1)
    assert not bench.seen("STATUS") & 0x80
    bench.until(2500 * 8 - 20)
    bench.write(0x07, 0)
    assert not bench.seen("STATUS") & 0x80
    bench.until(2500 * 8 + 1)
    bench.write(0x07, 0)
    assert bench.seen("STATUS") & 0x80


@pytest.mark.spec("MCP-EXC-7", "MCP-STA-1")
def test_a_home_switch_on_stop() -> None:
    rail = Rail()
    rail.switches["home"] = Switch(1500, 2500)
    rail.speed = SPEED
    bench = Bench(plant=rail, home_switch="/STOP")
    bench.until(1499 * 8)
    assert bench.seen("STATUS") & 0x40
    bench.until(1500 * 8)
    assert not bench.seen("STATUS") & 0x40
