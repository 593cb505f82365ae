"""Reset: by pin, by command and at power-on (manual: pin 27, RESET)."""

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench, Course, Follower, Log
from vbus.core.kernel import MS, NEVER, NS, US
from vbus.core.signals import HIGH, LOW


def pulse(bench: Bench, low: int = 2 * US) -> int:
    """Pull /RST low; return the instant at which it rose."""
    bench.set(**{"/RST": LOW})
    bench.run(low)
    bench.set(**{"/RST": HIGH})
    return bench.now


def dirty(bench: Bench) -> None:
    """Leave nothing at its reset value."""
    bench.filter(kp=11, ki=12, kd=13, il=14, ds=15)
    bench.command("LFIL", 0x100F, 21, 22, 23, 24)
    bench.move(0x1000, accel=1 << 16, velocity=2 << 16, position=300)
    bench.next_sample()
    bench.next_sample()
    bench.load(0x1800, accel=3 << 16, velocity=4 << 16, position=500)
    bench.command("LPES", 0x123)
    bench.command("MSKI", 0x40)
    bench.command("SBPA", 0, 7)
    bench.command("SIP")
    bench.command("PORT12")
    axis = bench.probe
    axis.index_position = 77
    axis.flags |= 0x6A


@pytest.mark.spec("LM-RST-1")
def test_the_reset_pin_acts_when_it_rises_and_not_while_it_is_low():
    bench = Bench("strobe")
    bench.command("SIP")
    bench.set(**{"/RST": LOW})
    bench.run(100 * US)
    assert bench.status() == 0x84
    assert bench.probe.sip

    bench.set(**{"/RST": HIGH})
    assert bench.status() == 0x00
    assert not bench.probe.sip


@pytest.mark.spec("LM-RST-1")
def test_a_pulse_without_duration_resets_too_if_times_are_not_judged():
    bench = Bench("cycle")
    pulse(bench, 0)
    assert bench.chip.status() == 0x00
    assert bench.violations == []


@pytest.mark.spec("LM-RST-2", "LM-RST-8", "LM-CMD-1")
@pytest.mark.parametrize("how", ["pin", "command"])
def test_reset_brings_back_the_state_after_power_on(make, how):
    bench = make(plant=Follower())
    dirty(bench)
    assert bench.probe.in_motion(), "RESET is legal in motion"
    if how == "pin":
        pulse(bench)
    else:
        bench.write(0, 0x00)
    bench.ready()

    axis = bench.probe
    assert (axis.kp, axis.ki, axis.kd, axis.il, axis.ds) == (0, 0, 0, 0, 0)
    assert axis.filter_loaded == [0, 0, 0, 0, 0]
    assert (axis.acceleration, axis.velocity, axis.target_position) == (0, 0, 0)
    assert (axis.trajectory_loaded, axis.trajectory_control_word) == ([0, 0, 0], 0)
    assert (axis.error_threshold, axis.stop_on_error) == (0x7FFF, False)
    assert axis.interrupt_mask == 0x3E
    assert axis.real_position == 0
    assert axis.port8
    assert (axis.motor_off, axis.motor_command) == (True, 0)
    assert (axis.desired_position, axis.desired_velocity) == (0, 0)
    assert axis.index_position == 0
    assert (axis.error_sum, axis.integration_sum) == (0, 0)
    assert not axis.breakpoint_armed
    assert bench.report("RDSIGS") == 0x8184, "SIP, acceleration-loaded, on-target, mode: clear"
    assert bench.report("RDDP") == 0
    assert bench.report("RDIP") == 0


@pytest.mark.spec("LM-RST-2")
def test_reset_forgets_half_a_word(bench):
    bench.command("LPES")
    bench.write(1, 0x55)
    pulse(bench)
    bench.ready()
    bench.command("LPES", 0x0102)

    assert bench.probe.error_threshold == 0x0102


@pytest.mark.spec("LM-RST-2")
def test_reset_forgets_what_was_to_be_read(bench):
    bench.probe.index_position = 0x11223344
    bench.command("RDIP")
    bench.read(1)
    pulse(bench)
    bench.ready()
    assert bench.read(1) == 0x00
    assert bench.status() == 0x86, "nothing is offered: command error"


@pytest.mark.spec("LM-RST-2")
def test_the_end_of_a_data_read_that_a_reset_has_interrupted_is_no_command_error():
    bench = Bench("strobe")
    bench.set(**{"/PS": HIGH, "/CS": LOW})
    bench.run(US)
    bench.set(**{"/RD": LOW})
    bench.run(US)
    pulse(bench)
    bench.run(2 * MS)
    bench.set(**{"/RD": HIGH})
    bench.run(US)
    bench.set(**{"/CS": HIGH})
    bench.run(US)
    assert bench.status() == 0x84


@pytest.mark.spec("LM-RST-2")
def test_position_is_zero_where_the_motor_is_when_the_reset_ends(make):
    bench = make(plant=Course([0, 0, 0, 100, 200, 300, 400, 500, 600, 700]), done=False)
    bench.chip.advance()
    # The reset ends at 1 ms, between sample 3 (at 0) and sample 4 (at 100): at 90 counts.
    bench.at(MS)
    assert (bench.probe.real_position, bench.probe.encoder_count) == (0, 90)
    bench.sample(4)
    assert bench.probe.real_position == 100 - 90
    bench.sample(5)
    assert bench.probe.real_position == 110


@pytest.mark.spec("LM-RST-1", "LM-RST-3")
def test_reset_zeroes_a_12_bit_converter_and_then_an_8_bit_one():
    bench = Bench("strobe")
    bench.run(100 * US)
    log = Log()
    for n in range(8):
        bench.chip.pins[f"DAC{n}"].net.observe(log)

    assert [bench.pin(f"DAC{n}") for n in range(7, -1, -1)] == [1, 0, 0, 0, 0, 0, 0, 0]
    rose = pulse(bench)
    start = -(-rose // (125 * NS)) * 125 * NS
    bench.ready()

    clocks = [(when - start, net[2:], level) for when, net, level in log.edges]
    assert clocks == [
        (0, "DAC7", 0),
        (1000 * NS, "DAC0", 1),
        (2000 * NS, "DAC0", 0),
        (3000 * NS, "DAC1", 1),
        (3000 * NS, "DAC7", 1),
        (4000 * NS, "DAC0", 1),
        (5000 * NS, "DAC0", 0),
        (6000 * NS, "DAC1", 0),
    ], "low word 000000 and strobe, high word 100000 and strobe, then 80h"


@pytest.mark.spec("LM-RST-4", "LM-RST-5", "LM-T-7", "LM-AMB-4")
def test_after_a_reset_by_pin_status_is_00_for_one_millisecond_and_then_84(make):
    bench = make()
    rose = pulse(bench)
    assert bench.status() == 0x00

    bench.at(rose + MS - 1)
    bench.chip.advance()
    assert bench.chip.status() == 0x00
    bench.at(rose + MS)
    bench.chip.advance()
    assert bench.chip.status() == 0x84


@pytest.mark.spec("LM-RST-4", "LM-RST-8", "LM-AMB-4")
def test_after_the_reset_command_status_is_01_from_its_strobe_on(make):
    bench = make()
    bench.write(0, 0x00)
    latched = bench.edge
    assert bench.status() == 0x01
    assert bench.chip.ready_at() == latched + MS

    bench.at(latched + MS - 1)
    bench.chip.advance()
    assert bench.chip.status() == 0x01
    bench.at(latched + MS)
    bench.chip.advance()
    assert bench.chip.status() == 0x84


@pytest.mark.spec("LM-RST-4")
@pytest.mark.parametrize("how", ["pin", "command"])
def test_during_reset_writes_are_ignored_and_data_reads_as_00(make, how):
    bench = make()
    bench.report("RDSIGS")
    if how == "pin":
        pulse(bench)
    else:
        bench.write(0, 0x00)
    bench.run(US)
    bench.write(0, 0x03)
    bench.write(1, 0x03)
    bench.status()  # so that a data read does not follow another one
    assert [bench.read(1), bench.read(1)] == [0, 0]
    assert bench.rules() == ["reset-write", "reset-write"]

    bench.ready()
    assert bench.status() == 0x84
    assert not bench.probe.sip


@pytest.mark.spec("LM-RST-4")
def test_reset_time_can_be_set(make):
    bench = make(done=False, reset_time=1_400_000_000)

    bench.at(1_400_000_000 - 1)
    bench.chip.advance()
    assert bench.chip.status() == 0x00
    bench.at(1_400_000_000)
    bench.chip.advance()
    assert bench.chip.status() == 0x84


@pytest.mark.spec("LM-RST-5", "LM-RST-6", "LM-AMB-3")
def test_the_c4_part_raises_its_breakpoint_flag_again_until_a_breakpoint_was_loaded(make):
    bench = make(reset_status="C4")
    assert bench.status() == 0xC4
    bench.command("RSTI", 0x0000)
    assert bench.status() == 0xC0
    bench.command("RSTI", 0xFFFF)
    assert bench.status() == 0xC0

    bench.command("SBPA", 0x0001, 0x0000)
    assert bench.status() == 0xC0, "a latch like any other now"
    bench.command("RSTI", 0x0000)
    assert bench.status() == 0x80


@pytest.mark.spec("LM-RST-6")
def test_half_a_breakpoint_does_not_free_the_flag(make):
    bench = make(reset_status="C4")
    bench.command("SBPR", 0x0001)
    bench.command("RSTI", 0x0000)
    assert bench.status() == 0xC0


@pytest.mark.spec("LM-RST-5", "LM-RST-6", "LM-T-7")
def test_reset_as_drivers_check_it(make):
    bench = make(done=False)
    assert bench.status() == 0x00
    bench.at(1_500 * US)
    assert bench.status() == 0x84
    assert bench.report("RDSIGS") == 0x8184
    bench.command("RSTI", 0x0000)
    assert bench.status() == 0x80
    assert bench.report("RDSIGS") == 0x0180


@pytest.mark.spec("LM-RST-7")
@pytest.mark.parametrize("silence", ["RSTI", "MSKI"])
def test_hi_is_up_after_reset_until_the_flag_is_reset_or_masked(make, silence):
    bench = make(done=False)
    assert bench.pin("HI") == LOW
    bench.at(MS - 1)
    assert bench.pin("HI") == LOW
    bench.at(MS)
    assert bench.pin("HI") == HIGH

    bench.command(silence, 0x0000)
    assert bench.pin("HI") == LOW


@pytest.mark.spec("LM-RST-9")
def test_resets_that_fail_leave_00_until_the_pin_is_pulsed_again(make):
    bench = make(done=False, reset_fail=2)
    for _ in range(2):
        bench.run(10 * MS)
        assert bench.status() == 0x00
        assert bench.chip.ready_at() == NEVER
        pulse(bench)

    bench.run(MS)
    assert bench.status() == 0x84


@pytest.mark.spec("LM-RST-9")
def test_a_failed_reset_command_reads_00_as_well(make):
    bench = make(reset_fail=1)
    bench.write(0, 0x00)
    bench.run(10 * MS)
    assert bench.status() == 0x00


def test_before_power_on_the_chip_says_nothing_and_a_held_reset_pin_holds_it():
    bench = Bench("strobe", done=None)
    bench.run(MS)
    assert bench.status() == 0x00
    assert bench.chip.ready_at() == NEVER

    bench.set(**{"/RST": LOW})
    bench.chip.power_on(False)
    bench.run(10 * MS)
    assert bench.status() == 0x00

    bench.set(**{"/RST": HIGH})
    bench.run(MS)
    assert bench.status() == 0x84


def test_a_chip_switched_on_again_with_its_reset_held_stays_in_reset():
    bench = Bench("strobe", done=False)
    bench.run(500 * US)
    bench.set(**{"/RST": LOW})
    bench.chip.power_on(False)
    bench.run(10 * MS)
    assert bench.status() == 0x00


def test_power_on_done_starts_as_if_the_reset_had_just_ended(make):
    bench = make(done=True)
    assert bench.status() == 0x84
    assert bench.pin("HI") == HIGH
    bench.sample(1)
    assert bench.now == SAMPLE


@pytest.mark.spec("LM-RST-4", "LM-BUS-5")
def test_a_status_read_goes_on_through_a_reset():
    bench = Bench("strobe")
    bench.set(**{"/PS": LOW, "/CS": LOW})
    bench.run(US)
    bench.set(**{"/RD": LOW})
    bench.run(US)
    bench.set(**{"/RST": LOW})
    bench.run(10 * US)
    bench.set(**{"/RST": HIGH})
    assert bench.data() == 0x00
    bench.run(2000 * US)
    assert bench.data() == 0x84


@pytest.mark.spec("LM-RST-1")
def test_the_amplifier_gets_nothing_before_power_comes_on():
    assert Bench(done=None).chip.telemetry()["output"] == 0.0
