"""The cycle: its length, its order, and the conversions made with it (PMD-CYC)."""

import pytest

from tests.conformance.mc1241a.conftest import CYCLE, SLOT, Bench
from vbus.chips.mc1241a.datasheet import CYCLE_CLK, FRAME_CLK
from vbus.core.kernel import NS

spec = pytest.mark.spec


@spec("PMD-CYC-2", "PMD-AMB-15", "PMD-T-7")
def test_a_cycle_is_542_72_us(chip: Bench) -> None:
    assert CYCLE_CLK * 40 * NS == 542_720 * NS == CYCLE
    assert round(1 / 542.72e-6, 2) == 1842.57
    for number in (1, 2, 1000):
        chip.run_until(number * 542_720 * NS - 1)
        assert chip.seen_time() == number - 1
        chip.run_until(number * 542_720 * NS)
        assert chip.seen_time() == number


@spec("PMD-T-7")
def test_the_pwm_frame_is_256_clocks() -> None:
    assert FRAME_CLK == 256
    assert round(25_000_000 / FRAME_CLK, 1) == 97_656.2


@spec("PMD-CYC-2")
@pytest.mark.parametrize("hz", [6_700_000, 25_000_000, 25_600_000])
def test_cycles_do_not_drift_at_any_clock(hz: int) -> None:
    bench = Bench(hz=hz)
    bench.run_until(100_000 * 13_568 * 10**12 // hz - 1)
    assert bench.seen_time() == 99_999
    bench.run_for(1)
    assert bench.seen_time() == 100_000


@spec("PMD-CYC-1", "PMD-UPD-3", "PMD-T-15")
def test_update_breakpoint_limit_and_profile_follow_each_other_in_one_cycle(chip: Bench) -> None:
    """3 update, 4 breakpoint, 5 limits, 6 profile, 9 events: all in the first cycle."""
    chip.load(pos=1000, vel=5 << 16, acc=5 << 16)
    chip.send("SET_NEG_BRK")  # value 0: met at once
    chip.next_cycle()
    assert chip.seen("target") == 5
    assert chip.status() == 0x0704


@spec("PMD-CYC-1")
def test_a_limit_hit_stops_the_profile_in_the_same_cycle(chip: Bench) -> None:
    chip.move(pos=1000, vel=5 << 16, acc=5 << 16)
    chip.next_cycle()
    assert chip.seen("target") == 5
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    assert chip.seen("target") == 5
    assert chip.status() == 0x0321


@spec("PMD-CYC-1")
def test_the_encoder_is_read_before_the_breakpoint_test(chip: Bench) -> None:
    chip.send("SET_BRK_PNT", 1)
    chip.send("SET_ACTL_POS_BRK")
    chip.next_cycle()
    chip.drive("QuadA1", 1)
    chip.run_for(10_000 * NS)
    assert chip.status() == 0x0300
    chip.next_cycle()
    assert chip.status() == 0x0304


@spec("PMD-CYC-1")
def test_a_capture_is_told_in_the_cycle_that_reads_the_encoder(chip: Bench) -> None:
    chip.send("SET_CAPT_HOME")
    chip.next_cycle()
    chip.drive("~Home1", 0)
    chip.run_for(10_000 * NS)
    assert chip.status() == 0x0300
    chip.next_cycle()
    assert chip.status() == 0x0308


@spec("PMD-CYC-1")
def test_axis_1_is_served_before_axis_2_and_slots_come_last(chip: Bench) -> None:
    chip.send("SET_MTR_CMD", 0x7FFF)
    chip.load(buf_mtr_cmd=0x7FFF)
    chip.move(pos=1000, vel=64 << 16, acc=64 << 16)
    at = (chip.now // CYCLE + 1) * CYCLE
    chip.run_until(at - 1)
    assert chip.seen("phase A") == 0
    chip.run_until(at)  # slot 1: an eighth of 64 microsteps
    assert chip.seen("phase A") == 6393
    chip.run_until(at + SLOT - 1)
    assert chip.seen("phase A") == 6393
    chip.run_until(at + SLOT)
    assert chip.seen("phase A") == 12539
