"""Status word, events, interrupts (PMD-STA, PMD-INT)."""

import pytest

from tests.conformance.mc1241a.conftest import BUSY, CLK, CYCLE, Bench
from vbus.core.kernel import US
from vbus.core.signals import Observer

spec = pytest.mark.spec


def stop(bench: Bench, axis: int = 1) -> None:
    """Make motion complete (bit 0) on an axis, in the next cycle."""
    bench.send(f"SET_{axis}")
    bench.send("STOP")
    bench.send("UPDATE")


@spec("PMD-STA-1", "PMD-CMD-47")
def test_bits_of_the_status_word_at_rest_and_in_motion(bench: Bench) -> None:
    assert bench.status() == 0x0300
    bench.move(pos=100_000, vel=1 << 16, acc=1 << 16)
    bench.next_cycle()
    assert bench.status() == 0x0700
    bench.send("MTR_OFF")
    assert bench.status() == 0x0201  # motor off, not in motion, motion complete
    bench.send("SET_2")
    assert bench.status() == 0x1300


@spec("PMD-STA-2", "PMD-CMD-45", "PMD-CMD-46")
def test_events_stay_until_the_host_clears_them(chip: Bench) -> None:
    stop(chip)
    chip.next_cycle(50)
    assert chip.status() == 0x0301
    chip.send("RST_STATUS", 0xFF01)
    assert chip.status() == 0x0301
    chip.send("RST_STATUS", 0x00FE)
    assert chip.status() == 0x0300
    stop(chip)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    assert chip.status() == 0x0300
    chip.next_cycle(5)
    assert chip.status() == 0x0300


@spec("PMD-STA-2", "PMD-CMD-45", "PMD-CMD-46")
@pytest.mark.parametrize("bit", range(8))
def test_a_zero_clears_its_event_and_a_one_leaves_it(chip: Bench, bit: int) -> None:
    axis = chip.probe
    axis.events = 0xFF
    chip.send("RST_STATUS", 0xFF00 | 1 << bit)
    assert chip.status() == 0x0300 | 1 << bit
    axis.events = 0xFF
    chip.send("RST_STATUS", ~(1 << bit) & 0xFFFF)
    assert chip.status() == 0x03FF & ~(1 << bit)
    chip.send("CLR_STATUS")
    assert chip.status() == 0x0300


@spec("PMD-STA-2")
def test_clearing_is_for_the_current_axis(chip: Bench) -> None:
    stop(chip, 2)
    stop(chip, 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    assert chip.status() == 0x0300
    assert chip.send("SET_2") == 0x1301


@spec("PMD-STA-3")
@pytest.mark.parametrize(
    ("mode", "in_motion"),
    [("SET_PRFL_TRAP", True), ("SET_PRFL_S_CRV", True), ("SET_PRFL_VEL", True)],
)
def test_in_motion_is_kept_in_three_modes(chip: Bench, mode: str, in_motion: bool) -> None:
    chip.send(mode)
    chip.move(pos=1000, vel=4 << 16, acc=1 << 15, max_acc=1 << 14, jerk=1 << 28)
    chip.next_cycle(3)
    assert bool(chip.status() & 0x0400) is in_motion


@spec("PMD-STA-3", "PMD-TRJ-8")
def test_in_gear_mode_bit_10_is_0_and_motion_sets_no_bit_0(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=10 << 16)
    chip.next_cycle()
    for a, b in ((1, 0), (1, 1), (0, 1), (0, 0)):
        chip.drive("QuadA1", a)
        chip.drive("QuadB1", b)
        chip.run_for(1 * US)
    chip.next_cycle()
    assert chip.seen("target") == 40
    assert chip.status() == 0x0300
    chip.next_cycle(3)
    assert chip.status() == 0x0300


def _fail(bench: Bench, axis: int = 1) -> None:
    """Give an axis a position error of 10 counts over its limit of 5 (motion error)."""
    bench.send(f"SET_{axis}")
    bench.send("SET_STEP_RATIO", 256)
    bench.send("SET_POS_ERR", 5)
    bench.move(pos=10, vel=10 << 16, acc=10 << 16)


@spec("PMD-STA-4", "PMD-CYC-1")
def test_a_motion_error_cannot_be_cleared_while_it_lasts(chip: Bench) -> None:
    _fail(chip)
    chip.next_cycle()
    assert chip.status() & 0x0010
    chip.send("CLR_STATUS")
    assert chip.status() & 0x00FF == 0x0010
    chip.send("RST_STATUS", 0x00EF)
    assert chip.status() & 0x00FF == 0x0010
    chip.send("SET_POS_ERR", 10)
    chip.send("CLR_STATUS")
    assert chip.status() & 0x00FF == 0


@spec("PMD-STA-5", "PMD-CMD-48")
def test_mode_word_bits(chip: Bench) -> None:
    chip.send("SET_PRFL_S_CRV")
    assert chip.send("GET_MODE") == 0x1080
    chip.move(pos=2000, vel=10 << 16, max_acc=0x2000, jerk=0x01000000)
    chip.next_cycle(5)
    assert chip.send("GET_MODE") == 0x3080  # phase 1
    chip.next_cycle(400)
    assert chip.send("GET_MODE") == 0x1080


# -- interrupts -------------------------------------------------------------------------------


@spec("PMD-INT-1")
def test_a_masked_in_event_pulls_the_line_in_its_cycle(bench: Bench) -> None:
    bench.send("SET_INTRPT_MASK", 0x0001)
    stop(bench)
    bench.run_until((bench.now // CYCLE + 1) * CYCLE - 1)
    assert bench.level("~HostIntrpt") == 1
    bench.run_for(1)
    assert bench.level("~HostIntrpt") == 0


@spec("PMD-INT-1")
def test_an_event_that_is_masked_out_does_not(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 0x00FE)
    stop(chip)
    chip.next_cycle()
    assert chip.level("~HostIntrpt") == 1


@spec("PMD-INT-1", "PMD-CMD-3", "PMD-CMD-42")
def test_axis_1_comes_first_when_both_interrupt_at_once(chip: Bench) -> None:
    for axis in (1, 2):
        chip.send(f"SET_{axis}")
        chip.send("SET_INTRPT_MASK", 1)
        chip.send("STOP")
    chip.send("MULTI_UPDATE", 3)
    chip.next_cycle()
    assert chip.send("GET_INTRPT") == 0x0301
    assert chip.send("SET_I") == 0x0301
    chip.send("RST_INTRPT", 0x00FE)
    assert chip.send("SET_I") == 0x1301
    assert chip.status() == 0x1301


@spec("PMD-INT-1")
def test_while_one_axis_is_latched_no_other_takes_its_place(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 1)
    chip.send("SET_2")
    chip.send("SET_INTRPT_MASK", 1)
    stop(chip, 2)
    chip.next_cycle()
    assert chip.send("GET_INTRPT") == 0x1301
    stop(chip, 1)
    chip.next_cycle()
    assert chip.send("GET_INTRPT") == 0x1301


@spec("PMD-INT-2")
def test_a_mask_let_in_later_interrupts_for_an_event_of_long_ago(chip: Bench) -> None:
    stop(chip)
    chip.next_cycle(10)
    assert chip.level("~HostIntrpt") == 1
    chip.send("SET_INTRPT_MASK", 1)
    assert chip.level("~HostIntrpt") == 0


@spec("PMD-INT-2")
@pytest.mark.parametrize(("axis", "other"), [(1, 1), (1, 2), (2, 1), (2, 2)])
def test_an_old_event_interrupts_as_soon_as_none_stands(chip: Bench, axis: int, other: int) -> None:
    """Another event came first and is dealt with: the old one was set and enabled all along."""
    for one, mask in {axis: 0x0020, other: 0x0001 | (axis == other) << 5}.items():
        chip.send(f"SET_{one}")
        chip.send("SET_INTRPT_MASK", mask)
    chip.drive(f"PosLimit{axis}", 1)
    chip.next_cycle()
    chip.send("SET_I")
    stop(chip, other)
    chip.next_cycle(10)
    chip.send("SET_I")
    chip.send("RST_INTRPT", 0x00DF)
    chip.run_for(2 * CLK)
    assert chip.level("~HostIntrpt") == 0
    assert chip.send("SET_I") & 0x3021 == (other - 1) << 12 | 0x0001
    chip.send("RST_INTRPT", 0x00FE)
    chip.next_cycle(3)
    assert chip.level("~HostIntrpt") == 1


@spec("PMD-INT-2")
def test_an_event_that_is_enabled_again_interrupts_again(chip: Bench) -> None:
    stop(chip)
    chip.send("SET_INTRPT_MASK", 0x0001)
    chip.next_cycle()
    assert chip.level("~HostIntrpt") == 0
    chip.send("SET_INTRPT_MASK", 0x0020)
    chip.send("RST_INTRPT", 0x00FF)  # nothing is cleared, nothing else is enabled
    chip.next_cycle(3)
    assert (chip.level("~HostIntrpt"), chip.status() & 0x00FF) == (1, 0x0001)
    chip.send("SET_INTRPT_MASK", 0x0021)
    assert chip.level("~HostIntrpt") == 0


@spec("PMD-INT-3", "PMD-CMD-43", "PMD-T-8", "PMD-AMB-18")
def test_the_manual_s_interrupt_example(bench: Bench) -> None:
    bench.send("SET_2")
    bench.send("SET_INTRPT_MASK", 0x0030)
    _fail(bench, 2)
    bench.next_cycle()
    bench.send("SET_ACTL_POS", 0)  # the error is mended
    bench.send("MTR_ON")
    bench.drive("PosLimit2", 1)
    bench.next_cycle()
    bench.send("SET_1")
    assert bench.level("~HostIntrpt") == 0
    assert bench.send("SET_I") & 0x30FF == 0x1031
    bench.send("RST_INTRPT", 0x00EF)
    assert bench.send("GET_STATUS") & 0x00FF == 0x0021
    assert bench.level("~HostIntrpt") == 0  # again, for the limit switch
    assert bench.send("SET_I") & 0x30FF == 0x1021
    bench.send("RST_INTRPT", 0x00DF)
    assert bench.send("GET_STATUS") & 0x00FF == 0x0001
    assert bench.level("~HostIntrpt") == 1


@spec("PMD-INT-3")
def test_several_bits_can_be_cleared_at_once(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 0x0021)
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.send("RST_INTRPT", 0x0000)
    assert chip.status() == 0x0300
    assert chip.level("~HostIntrpt") == 1


@spec("PMD-INT-3")
def test_the_line_is_high_for_a_clock_before_it_falls_again(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 0x0021)
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.command(0x32)
    chip.write_word(0x00DF)
    at = chip.now + BUSY
    chip.run_until(at - 1)
    assert chip.level("~HostIntrpt") == 0
    chip.run_until(at)
    assert chip.level("~HostIntrpt") == 1
    chip.run_until(at + CLK - 1)
    assert chip.level("~HostIntrpt") == 1
    chip.run_until(at + CLK)
    assert chip.level("~HostIntrpt") == 0


@spec("PMD-INT-1", "PMD-INT-3")
def test_who_interrupts_next_is_found_when_the_line_falls_again(chip: Bench) -> None:
    for axis in (1, 2):
        chip.send(f"SET_{axis}")
        chip.send("SET_INTRPT_MASK", 0x0001)
    stop(chip, 2)
    chip.next_cycle()
    stop(chip, 1)
    chip.command(0x32)
    chip.wait_ready()
    # RST_INTRPT acts at the instant of the cycle in which axis 1 stops; axis 2's event stays.
    boundary = chip.probe.cycle_boundary
    chip.byte_out(0, 0x00)
    chip.run_until(boundary + 7 * CYCLE // 8 - BUSY)
    chip.byte_out(0, 0x01)
    chip.run_until(chip.now + BUSY + CLK - 1)
    assert chip.level("~HostIntrpt") == 1
    chip.run_until(chip.now + 1)
    assert chip.level("~HostIntrpt") == 0
    assert chip.send("GET_INTRPT") == 0x0301


@spec("PMD-INT-3", "PMD-CMD-43")
def test_rst_intrpt_without_an_interrupt_does_nothing(chip: Bench) -> None:
    stop(chip)
    chip.next_cycle()
    chip.send("RST_INTRPT", 0x0000)
    assert chip.status() == 0x0301


@spec("PMD-INT-4")
def test_only_rst_intrpt_and_reset_release_the_line(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 1)
    stop(chip)
    chip.next_cycle()
    for name in ("CLR_STATUS", "RST_STATUS", "SET_INTRPT_MASK"):
        chip.send(name, 0)
        assert chip.level("~HostIntrpt") == 0
    chip.next_cycle(3)
    assert chip.level("~HostIntrpt") == 0
    assert chip.send("GET_INTRPT") == 0x0300
    chip.send("RST_INTRPT", 0)
    assert chip.level("~HostIntrpt") == 1


@spec("PMD-INT-4", "PMD-RST-2")
def test_reset_forgets_the_interrupting_axis(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 1)
    stop(chip)
    chip.next_cycle()
    chip.send("RESET")
    assert chip.level("~HostIntrpt") == 1
    assert chip.send("SET_2") == 0x1300
    assert chip.send("GET_INTRPT") == 0x1300
    chip.send("SET_INTRPT_MASK", 1)
    stop(chip, 2)
    chip.run_for(2 * CYCLE)
    assert chip.level("~HostIntrpt") == 0


@spec("PMD-INT-5")
def test_get_intrpt_and_rst_intrpt_leave_the_current_axis(chip: Bench) -> None:
    chip.send("SET_2")
    chip.send("SET_INTRPT_MASK", 1)
    stop(chip, 2)
    chip.next_cycle()
    chip.send("SET_1")
    assert chip.send("GET_INTRPT") == 0x1301
    assert chip.status() == 0x0300
    chip.send("RST_INTRPT", 0)
    assert chip.status() == 0x0300


@spec("PMD-CMD-3", "PMD-CMD-42")
def test_without_an_interrupt_the_current_axis_answers(chip: Bench) -> None:
    chip.send("SET_2")
    assert chip.send("GET_INTRPT") == 0x1300
    assert chip.send("SET_I") == 0x1300
    assert chip.status() == 0x1300


class _Line(Observer):
    """Notes when the interrupt line falls."""

    def __init__(self, bench: Bench) -> None:
        self.fell: list[int] = []
        bench.chip.pins["~HostIntrpt"].net.observe(self)

    def edge(self, when: int, net: str, level: int) -> None:
        if level == 0:
            self.fell.append(when)


@spec("PMD-INT-1")
@pytest.mark.parametrize(
    ("setup", "pin", "level"),
    [
        ("SET_CAPT_HOME", "~Home1", 0),
        ("SET_CAPT_HOME", "PosLimit1", 1),
        ("SET_EXT_BRK", "~Home1", 0),
        ("SET_ACTL_POS_BRK", "QuadA1", 1),
    ],
)
def test_an_input_interrupts_a_resting_chip_that_nobody_looks_at(
    chip: Bench, setup: str, pin: str, level: int
) -> None:
    chip.send("SET_BRK_PNT", 1)
    chip.send("SET_INTRPT_MASK", 0x002C)
    chip.send(setup)
    line = _Line(chip)
    chip.kernel.run_until(1000 * CYCLE + 7)
    chip.drive(pin, level)
    chip.kernel.run_until(1010 * CYCLE)
    assert line.fell == [1001 * CYCLE]


@spec("PMD-INT-1", "PMD-STL-1", "PMD-CMD-55")
def test_a_lower_limit_finds_the_error_of_a_resting_axis_in_the_next_cycle(chip: Bench) -> None:
    chip.send("SET_AUTO_STOP_OFF")
    chip.send("SET_STEP_RATIO", 256)
    chip.send("SET_INTRPT_MASK", 0x0010)
    chip.move(pos=20, vel=4 << 16, acc=4 << 16)
    line = _Line(chip)
    chip.kernel.run_until(1000 * CYCLE + 7)
    chip.send("SET_POS_ERR", 20)
    chip.kernel.run_until(2000 * CYCLE + 7)
    assert line.fell == []
    chip.send("SET_POS_ERR", 19)
    due = (chip.now // CYCLE + 1) * CYCLE
    chip.kernel.run_until(due + 10 * CYCLE)
    assert line.fell == [due]


@spec("PMD-INT-1")
def test_a_command_error_interrupts_when_the_command_acts(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 0x0080)
    chip.move(pos=10_000, vel=1 << 16, acc=1 << 16)
    chip.next_cycle()
    chip.command(0x6A)  # SET_START_VEL in motion
    chip.write_word(0)
    chip.write_word(1)
    at = chip.now + BUSY
    chip.run_until(at - 1)
    assert chip.level("~HostIntrpt") == 1
    chip.run_until(at)
    assert chip.level("~HostIntrpt") == 0
