"""The command set, the status byte, the signals register and the host interrupt."""

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench, Course, Follower, Log
from vbus.chips.lm628.datasheet import COMMANDS
from vbus.core.kernel import NS
from vbus.core.signals import HIGH, LOW
from vbus.core.state import load, save

ONE = 1 << 16
"""One count per sample, or per sample squared."""


@pytest.mark.spec("LM-CMD-2", "LM-STA-9", "LM-TRJ-17", "LM-STA-2")
def test_stt_is_taken_exactly_at_the_next_sample(bench):
    bench.next_sample()
    bench.load(0x1800, accel=ONE, velocity=ONE)
    bench.write(0, COMMANDS["STT"].code)

    bench.at(2 * SAMPLE - 1)
    assert bench.probe.signals_register & 0xFC80 == 0xC080, "nothing but acceleration loaded"
    assert bench.probe.desired_velocity == 0
    bench.at(2 * SAMPLE)
    assert bench.probe.signals_register & 0x7C80 == 0x1800
    assert bench.probe.desired_velocity == ONE


@pytest.mark.spec("LM-CMD-2")
def test_stt_whose_busy_ends_with_the_sample_is_taken_by_it(bench):
    bench.load(0x1800, accel=ONE, velocity=ONE)
    bench.next_sample()
    end = bench.now + SAMPLE
    bench.at(end - 15_000 * NS - 210 * NS)
    bench.write(0, COMMANDS["STT"].code)
    assert bench.chip.ready_at() == end

    bench.at(end)
    assert bench.probe.desired_velocity == ONE


@pytest.mark.spec("LM-CMD-5", "LM-PID-1")
def test_udf_copies_the_filter_at_the_next_sample_and_shows_in_bit_13_until_then(bench):
    bench.command("LFIL", 0x070F, 1, 2, 3, 4)
    pid = bench.probe
    bench.next_sample()
    assert (pid.kp, pid.ki, pid.kd, pid.il, pid.ds) == (0, 0, 0, 0, 0)
    assert not bench.probe.signals_register & 0x2000

    sample = bench.now + SAMPLE
    bench.command("UDF")
    bench.at(sample - 1)
    assert bench.probe.signals_register & 0x2000
    assert pid.kp == 0
    bench.at(sample)
    assert not bench.probe.signals_register & 0x2000
    assert (pid.kp, pid.ki, pid.kd, pid.il, pid.ds) == (1, 2, 3, 4, 7)


@pytest.mark.spec("LM-CMD-5", "LM-PID-1")
def test_udf_takes_what_is_loaded_when_it_is_executed_and_leaves_later_data_for_the_next(bench):
    bench.next_sample()
    bench.command("LFIL", 0x0008, 200)
    bench.command("UDF")
    bench.command("LFIL", 0x0708, 1000)
    pid = bench.probe
    assert bench.probe.udf_waiting, "all of this within one sample"
    bench.next_sample()
    assert (pid.kp, pid.ds) == (200, 0)
    assert not bench.probe.signals_register & 0x2000
    bench.next_sample()
    assert (pid.kp, pid.ds) == (200, 0)
    bench.command("UDF")
    bench.next_sample()
    assert (pid.kp, pid.ds) == (1000, 7)


@pytest.mark.spec("LM-CMD-5")
def test_of_several_udfs_in_one_sample_the_last_counts(bench):
    bench.next_sample()
    for kp in (200, 1000):
        bench.command("LFIL", 0x0008, kp)
        bench.command("UDF")
    bench.command("LFIL", 0x0008, 5)
    assert bench.probe.udf_waiting, "all of this within one sample"
    bench.next_sample()
    assert bench.probe.kp == 1000


@pytest.mark.spec("LM-CMD-5")
@pytest.mark.parametrize("bit", [0x0008, 0x0004, 0x0002])
def test_a_filter_that_udf_has_not_taken_is_no_filter_yet(bench, bit):
    bench.command("LFIL", 0x0F01, 5)  # the sampling interval and il drive nothing
    assert bench.chip.undriven(0) == "it has no filter: all coefficients are 0 until LFIL and UDF"
    bench.command("LFIL", bit, 5)
    assert bench.chip.undriven(0) == "its filter has not taken effect: UDF has not followed LFIL"
    bench.command("UDF")
    bench.next_sample()
    assert bench.chip.undriven(0) == ""


@pytest.mark.spec("LM-CMD-5", "LM-BUS-9")
def test_udf_takes_what_is_loaded_when_its_busy_time_ends(bench):
    bench.command("LFIL", 0x0008, 200)
    bench.next_sample()
    bench.write(0, COMMANDS["UDF"].code)
    end = bench.chip.ready_at()
    bench.at(end - 1)
    assert not bench.probe.udf_waiting
    bench.at(end)
    assert bench.probe.udf_waiting
    bench.next_sample()
    assert bench.probe.kp == 200


@pytest.mark.spec("LM-CMD-5")
@pytest.mark.parametrize("later", [[], [1000], [1000, 200]])
def test_what_udf_has_taken_outlives_a_snapshot(make, later):
    bench, other = make(), make()
    bench.next_sample()
    bench.command("LFIL", 0x0008, 200)
    bench.command("UDF")
    for kp in later:
        bench.command("LFIL", 0x0008, kp)
    other.at(bench.now)
    load(other.chip, save(bench.chip))
    for one in (bench, other):
        one.command("LFIL", 0x0008, 50)
        assert one.probe.udf_waiting, "all of this within one sample"
        one.next_sample()
        assert one.probe.kp == 200


@pytest.mark.spec("LM-CMD-6", "LM-CMD-7", "LM-STA-2")
def test_the_port_size_commands_set_signals_bit_8(bench):
    assert bench.report("RDSIGS") & 0x0100
    bench.command("PORT12")
    assert not bench.report("RDSIGS") & 0x0100
    bench.command("PORT8")
    assert bench.report("RDSIGS") & 0x0100
    assert bench.violations == []


@pytest.mark.spec("LM-CMD-7", "LM-AMB-16")
def test_port12_on_a_lm629_is_reported_and_changes_only_the_flag(make):
    bench = make(part="LM629N-8")
    bench.filter(kp=100)
    bench.command("PORT12")
    assert bench.rules() == ["port12-on-lm629"]
    assert not bench.report("RDSIGS") & 0x0100

    bench.probe.hold(0)
    bench.move(0)
    bench.next_sample()
    bench.probe.desired_position = 130 << 16
    bench.next_sample()
    assert bench.probe.output_command == 50 / 128


@pytest.mark.spec("LM-AMB-11")
@pytest.mark.parametrize("name", ["PORT8", "PORT12"])
def test_port_size_commands_in_motion_are_executed_and_reported(bench, name):
    bench.probe.port8 = name == "PORT12"
    bench.move(0x1800, accel=ONE, velocity=ONE)
    bench.next_sample()
    bench.command(name)

    assert bench.rules() == ["port-in-motion"]
    assert bench.probe.port8 == (name == "PORT8")


@pytest.mark.spec("LM-CMD-8", "LM-CMD-9")
def test_desired_velocity_is_signed_16_16_and_desired_position_whole_counts(bench):
    bench.move(0x0800, accel=0x18000, velocity=0x18000)
    bench.next_sample()
    assert bench.report("RDDV") == -0x18000
    assert bench.report("RDDP") == -2, "minus one and a half, rounded down"


@pytest.mark.spec("LM-CMD-11", "LM-CMD-12")
def test_real_position_and_its_change_over_the_last_sample(make):
    bench = make(plant=Course([10, -300, -300, 20_000, -20_000, 16_383]))
    for real, change in [
        (10, 10), (-300, -310), (-300, 0), (20_000, 16_383), (-20_000, -16_384),
    ]:  # fmt: skip
        bench.next_sample()
        assert bench.report("RDRP") == real
        assert bench.report("RDRV") == change


@pytest.mark.spec("LM-CMD-13")
def test_signals_are_read_as_one_word(bench):
    assert bench.report("RDSIGS") == 0x8184
    bench.load(0x1800, accel=ONE, velocity=ONE)
    assert bench.report("RDSIGS") == 0xC184, "acceleration loaded"
    bench.command("STT")
    bench.next_sample()
    assert bench.report("RDSIGS") == 0x9904, "velocity mode, forward"
    bench.command("MSKI", 0x7A)
    assert bench.report("RDSIGS") == 0x1904, "the flag that is up is not enabled"


@pytest.mark.spec("LM-CMD-15", "LM-CMD-16", "LM-STA-2")
def test_lpes_and_lpei_load_the_threshold_and_choose_whether_to_stop(bench):
    bench.command("LPES", 0x1234)
    assert bench.probe.error_threshold == 0x1234
    assert bench.report("RDSIGS") & 0x0200
    bench.command("LPEI", 0x0007)
    assert bench.probe.error_threshold == 0x0007
    assert not bench.report("RDSIGS") & 0x0200
    assert bench.rules() == ["stop-lost"]


@pytest.mark.spec("LM-CMD-15", "LM-CMD-16")
@pytest.mark.parametrize("name", ["LPEI", "LPES"])
@pytest.mark.parametrize("bit", range(15))
def test_each_bit_of_a_threshold_counts(bench, name, bit):
    for threshold in (1 << bit, 0x7FFF ^ 1 << bit):
        bench.command(name, threshold)
        assert bench.probe.error_threshold == threshold
    assert bench.violations == []


@pytest.mark.spec("LM-CMD-25", "LM-CMD-15", "LM-CMD-16", "LM-TRJ-2")
@pytest.mark.parametrize("name", ["LPEI", "LPES"])
def test_bit_15_of_a_threshold_is_ignored_and_reported(bench, name):
    bench.command(name, 0x8123)

    assert bench.probe.error_threshold == 0x0123
    assert bench.rules() == ["range"]
    assert bench.violations[0].detail == f"{name} 8123H: at most 7FFFH, bit 15 is ignored"


@pytest.mark.spec("LM-CMD-17", "LM-STA-7", "LM-T-12", "LM-AMB-13")
def test_mski_moves_hi_as_a_level_when_busy_falls(bench):
    bench.command("MSKI")
    bench.write(1, 0)
    bench.write(1, 0)
    end = bench.chip.ready_at()
    bench.at(end - 1)
    assert bench.pin("HI") == HIGH
    bench.at(end)
    assert bench.pin("HI") == LOW
    assert bench.status() == 0x84, "the flag is still there"
    assert not bench.report("RDSIGS") & 0x8000

    bench.command("MSKI", 0x0004)
    assert bench.pin("HI") == HIGH
    assert bench.report("RDSIGS") & 0x8000


@pytest.mark.spec("LM-CMD-17", "LM-STA-7")
@pytest.mark.parametrize("bit", range(8))
def test_each_mask_bit_enables_its_flag_and_bits_7_and_0_none(bench, bit):
    axis = bench.probe
    axis.flags = 0x7E
    bench.command("MSKI", 0xFF81 | 1 << bit)

    assert bench.pin("HI") == (HIGH if 1 <= bit <= 6 else LOW)
    assert axis.status_without_busy() == 0xFE


@pytest.mark.spec("LM-STA-7")
@pytest.mark.parametrize("on_node", [False, True])
def test_hi_rises_at_the_very_sample_that_raises_a_flag_whatever_masked_flag_is_up(on_node):
    bench = Bench("strobe")
    bench.chip.on_node = on_node
    bench.command("RSTI", 0)
    bench.command("MSKI", 0x0004)
    bench.write(1, 0)
    bench.ready()
    assert bench.chip.status() & 0x7F == 0x02, "a command error, which is masked"
    bench.move(0, accel=ONE, velocity=ONE, position=3)
    bench.next_sample()
    log = Log()
    bench.chip.pins["HI"].net.observe(log)
    first = bench.now
    bench.run(5 * SAMPLE)
    assert log.edges == [(first + 2 * SAMPLE, "x.HI", HIGH)]


@pytest.mark.spec("LM-CMD-18", "LM-STA-3")
@pytest.mark.parametrize("bit", range(1, 7))
def test_rsti_clears_the_flags_whose_bits_are_zero_and_keeps_the_others(bench, bit):
    bench.probe.flags = 0x7E
    bench.command("RSTI", ~(1 << bit) & 0xFFFF)
    assert bench.status() == 0xFE & ~(1 << bit)
    bench.command("RSTI", 0xFF00 | 1 << (bit % 6 + 1))
    assert bench.status() == 0x80 | 1 << (bit % 6 + 1), "the upper byte and bit 7 do nothing"


@pytest.mark.spec("LM-CMD-24")
def test_both_words_of_a_report_are_of_the_sample_in_which_it_was_asked_for(make):
    bench = make(plant=Course([0x0001FFFF, 0x00020000]))
    bench.next_sample()
    bench.command("RDRP")
    high = bench.read(1) << 8 | bench.read(1)
    bench.next_sample()
    bench.next_sample()
    low = bench.read(1) << 8 | bench.read(1)

    assert (high, low) == (0x0001, 0xFFFF)
    bench.ready()
    assert bench.report("RDRP") == 0x00020000


@pytest.mark.spec("LM-STA-1", "LM-STA-2")
def test_the_signals_register_repeats_the_flags_and_shows_sip_in_place_of_busy(bench):
    bench.probe.flags = 0x2A
    assert bench.status() == 0xAA
    assert bench.report("RDSIGS") == 0x81AA
    bench.command("SIP")
    assert bench.status() == 0xAA
    assert bench.report("RDSIGS") == 0x81AB


@pytest.mark.spec("LM-STA-2")
@pytest.mark.parametrize(
    ("control", "bits"),
    [(0x1800, 0x1800), (0x0800, 0x0800), (0x1000, 0x1000), (0x0000, 0x0000)],
)
def test_direction_and_mode_bits_show_the_active_control_word(bench, control, bits):
    bench.move(control, velocity=ONE, position=100)
    bench.next_sample()

    assert bench.report("RDSIGS") & 0x1800 == bits


@pytest.mark.spec("LM-STA-3")
def test_masking_never_changes_a_flag(bench):
    bench.probe.flags = 0x7E
    bench.command("MSKI", 0)
    bench.command("MSKI", 0x7E)
    assert bench.status() == 0xFE


@pytest.mark.spec("LM-STA-4", "LM-AMB-2")
def test_trajectory_complete_is_an_edge_that_can_be_reset_while_its_cause_lasts(bench):
    bench.command("RSTI", 0)
    for _ in range(3):
        bench.next_sample()
    assert bench.status() == 0x80, "motor-off is still there"

    bench.move(0, accel=ONE, velocity=ONE, position=10)
    bench.next_sample()
    assert bench.status() == 0x00, "STT lowers motor-off; that is no rising edge"
    while not bench.probe.on_target:
        bench.next_sample()
    assert bench.status() == 0x04
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x00, "on-target is still there"


@pytest.mark.spec("LM-STA-4")
def test_stt_does_not_clear_trajectory_complete(bench):
    assert bench.status() == 0x84
    bench.move(0x1800, accel=ONE, velocity=ONE)
    bench.next_sample()
    assert bench.status() == 0x04


@pytest.mark.spec("LM-STA-4", "LM-TRJ-10")
def test_turning_the_motor_off_completes_a_motion_but_not_twice(bench):
    bench.move(0x1800, accel=ONE, velocity=ONE)
    bench.next_sample()
    bench.command("RSTI", 0)
    bench.move(0x0100)
    bench.next_sample()
    assert bench.status() == 0x84, "in motion: motor-off is a rising edge"

    bench.move(0, position=0)
    bench.next_sample()
    bench.next_sample()
    assert bench.probe.on_target
    bench.command("RSTI", 0)
    bench.move(0x0100)
    bench.next_sample()
    assert bench.status() == 0x80, "on target before: nothing rose"
    assert bench.report("RDSIGS") & 0x0400, "on-target is left as it is"


@pytest.mark.spec("LM-STA-5")
def test_on_target_is_set_by_the_end_of_the_profile_and_cleared_by_the_next_stt(bench):
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    bench.next_sample()
    assert not bench.report("RDSIGS") & 0x0400
    bench.next_sample()
    assert bench.report("RDSIGS") & 0x0400

    bench.move(0, position=50)
    assert bench.probe.on_target, "until the sample that takes the STT"
    bench.next_sample()
    assert not bench.report("RDSIGS") & 0x0400


@pytest.mark.spec("LM-STA-5")
def test_in_velocity_mode_only_a_stop_brings_the_axis_on_target(bench):
    bench.move(0x1800, accel=2 * ONE, velocity=4 * ONE)
    for _ in range(10):
        bench.next_sample()
        assert not bench.probe.on_target
    bench.move(0x1C00)
    bench.next_sample()
    assert not bench.probe.on_target
    bench.next_sample()
    assert bench.probe.on_target


@pytest.mark.spec("LM-STA-6")
def test_motor_off_is_cleared_by_any_stt_that_does_not_turn_it_off(bench):
    bench.move(0x0100)
    bench.next_sample()
    assert bench.status() & 0x80
    for control in (0x0000, 0x0800, 0x0400, 0x0200):
        bench.move(0x0100)
        bench.next_sample()
        assert bench.status() & 0x80
        bench.move(control)
        bench.next_sample()
        assert not bench.status() & 0x80


@pytest.mark.spec("LM-STA-8")
def test_acceleration_loaded_is_set_by_its_words_and_cleared_by_the_stt(bench):
    bench.load(0, velocity=ONE, position=9)
    assert not bench.report("RDSIGS") & 0x4000
    bench.load(0, accel=ONE)
    assert bench.report("RDSIGS") & 0x4000
    bench.command("STT")
    assert bench.probe.acceleration_waiting
    bench.next_sample()
    assert not bench.report("RDSIGS") & 0x4000


@pytest.mark.spec("LM-CMD-14", "LM-AMB-9")
def test_rdsum_reads_the_limited_term_and_not_the_sum_on_request(make):
    plant = Course()
    bench = make(plant=plant, integral_limit="term")
    bench.filter(ki=20, il=50)
    bench.move(0)
    plant.counts = [-300] * 5
    for expected in (0, 20, 40, 50, 50):
        bench.next_sample()
        assert bench.report("RDSUM") == expected
    plant.counts = [900] * 12
    for _ in range(6):
        bench.next_sample()
    assert bench.report("RDSUM") == -50


@pytest.mark.spec("LM-CMD-14", "LM-AMB-9")
@pytest.mark.parametrize("ki", [0, 20])
def test_rdsum_reads_the_limited_summation_whatever_ki_is(make, ki):
    plant = Course()
    bench = make(plant=plant)
    bench.filter(ki=ki, il=2)
    bench.move(0)
    plant.counts = [-300] * 5
    for expected in (0, 1, 2, 3, 2, 2):
        bench.next_sample()
        assert bench.report("RDSUM") == expected
        # 3 is what was added; the filter has the limit already.
        assert bench.probe.motor_command == ki * min(expected, 2)
    plant.counts = [800] * 12
    for expected in (2, -1, -4, -2):
        bench.next_sample()
        assert bench.report("RDSUM") == expected
        assert bench.probe.motor_command == ki * max(expected, -2)


def test_every_row_of_the_command_table_has_its_hook_or_its_parameter(bench):
    for row in COMMANDS:
        assert bool(row.hook) != bool(row.parameter), row.name
        assert row.hook or bench.probe.parameter(row) is not None
    assert len(COMMANDS) == 22, "Table 2 without RDSTAT, which needs no code"


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [pytest.param(*row, marks=pytest.mark.spec(COMMANDS[row[0]].clause), id=row[0]) for row in (
        ("RESET", 0x00, 0), ("PORT8", 0x05, 0), ("PORT12", 0x06, 0), ("DFH", 0x02, 0),
        ("SIP", 0x03, 0), ("LPEI", 0x1B, 1), ("LPES", 0x1A, 1), ("SBPA", 0x20, 2),
        ("SBPR", 0x21, 2), ("MSKI", 0x1C, 1), ("RSTI", 0x1D, 1), ("LFIL", 0x1E, 1),
        ("UDF", 0x04, 0), ("LTRJ", 0x1F, 1), ("STT", 0x01, 0), ("RDSIGS", 0x0C, -1),
        ("RDIP", 0x09, -2), ("RDDP", 0x08, -2), ("RDRP", 0x0A, -2), ("RDDV", 0x07, -2),
        ("RDRV", 0x0B, -1), ("RDSUM", 0x0D, -1),
    )],
)  # fmt: skip
def test_each_code_takes_or_gives_its_number_of_words(bench, name, code, words):
    bench.write(0, code)
    bench.ready()
    for _ in range(max(words, 0)):
        bench.word(0)
    for _ in range(max(-words, 0)):
        bench.read(1), bench.read(1)
        bench.ready()
    if name in ("LFIL", "LTRJ"):
        assert bench.probe.words_due == 0, "a control word of 0 asks for nothing more"
    assert bench.status() & 2 == 0
    assert bench.rules() == (["no-trajectory"] if name == "STT" else [])

    bench.write(1, 0)
    assert bench.status() & 2, "one byte too many"


@pytest.mark.spec("LM-CMD-4")
def test_sip_shows_in_signals_bit_0_until_the_index_came(make):
    bench = make(plant=Course([0, 0, 0, 50], turn=40))
    bench.command("SIP")
    assert bench.report("RDSIGS") & 1
    bench.sample(4)
    assert bench.report("RDSIGS") & 1 == 0


def test_telemetry_names_what_a_live_view_shows(make):
    bench = make(plant=Follower())
    bench.filter(kp=100)
    bench.move(0x1800, accel=ONE, velocity=3 * ONE)
    for _ in range(8):
        bench.next_sample()
    shown = bench.chip.telemetry()

    assert shown["velocity"] == 3
    assert shown["desired"] - shown["real"] == shown["error"] == 3
    assert shown["command"] == 300
    assert shown["output"] == 1 / 128
    assert shown["status"] == 0x04
    assert shown["signal_names"] == (
        "HOST_INTERRUPT FORWARD VELOCITY_MODE PORT8 TRAJECTORY_COMPLETE"
    )


def test_an_unknown_part_and_a_plant_that_takes_no_servo_command_are_refused():
    class Steps(Course):
        TAKES = ("pulses",)

    with pytest.raises(ValueError, match=r"^part 'LM630': allowed are LM628N-6, LM628N-8, LM629N"):
        Bench(part="LM630")
    with pytest.raises(ValueError, match="gives servo commands; this plant takes step pulses"):
        Bench(plant=Steps())
    for axis in (1, -1):
        with pytest.raises(ValueError, match=rf"^the LM628N-8 has no axis {axis + 1}; it has 1$"):
            Bench().chip.connect(axis, Course())
