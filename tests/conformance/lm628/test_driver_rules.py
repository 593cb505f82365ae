"""Rules for what a driver does: each with its mistake, and with what looks like it and is right."""

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench
from vbus.core.kernel import MS

ONE = 1 << 16


def found(bench: Bench) -> list[tuple[str, str]]:
    """Return the rules broken so far, each with its severity."""
    return [(v.rule.partition(".")[2], v.severity) for v in bench.violations]


def left(bench: Bench) -> list[tuple[str, str]]:
    """Return what a run that ended now would leave."""
    return [(rule.name.partition(".")[2], text) for rule, text in bench.chip.left_over()]


def run(bench: Bench) -> None:
    """Have the axis run in velocity mode at 4 counts per sample."""
    bench.filter(kp=10)
    bench.move(0x1800, accel=4 * ONE, velocity=4 * ONE)
    bench.run(3 * SAMPLE)


# -- LFIL and UDF ---------------------------------------------------------------------------------


@pytest.mark.spec("LM-CMD-5")
@pytest.mark.parametrize("control", [0x0000, 0x0200])
def test_a_motor_turned_on_before_udf_is_found(bench, control):
    bench.command("LFIL", 0x08, 10)
    bench.move(control, accel=ONE, velocity=ONE, position=100)
    assert found(bench) == [("filter-waits", "warning")]
    assert "UDF has not followed LFIL" in bench.violations[0].detail


@pytest.mark.spec("LM-CMD-5")
def test_udf_before_stt_is_what_the_rule_asks_for(bench):
    bench.command("LFIL", 0x08, 10)
    bench.command("UDF")
    bench.move(0, accel=ONE, velocity=ONE, position=100)
    bench.run(MS)
    assert found(bench) == []


@pytest.mark.spec("LM-CMD-5")
def test_gains_loaded_ahead_of_their_use_in_motion_are_no_mistake(bench):
    run(bench)
    bench.command("LFIL", 0x08, 20)
    bench.move(0x1800, velocity=5 * ONE)
    bench.run(MS)
    bench.command("UDF")
    assert found(bench) == []


@pytest.mark.spec("LM-CMD-5")
def test_an_open_loop_without_any_filter_is_no_mistake(bench):
    bench.move(0, accel=ONE, velocity=ONE, position=3)
    bench.filter()
    bench.run(10 * SAMPLE)
    bench.command("LFIL", 0x08, 10)
    bench.move(0x0100)  # the motor off
    assert found(bench) == []


# -- STT ------------------------------------------------------------------------------------------


@pytest.mark.spec("LM-CMD-2")
def test_stt_before_ltrj_is_noted(bench):
    bench.filter(kp=10)
    bench.command("STT")
    assert found(bench) == [("no-trajectory", "note")]


@pytest.mark.spec("LM-CMD-2", "LM-TRJ-5")
@pytest.mark.parametrize("control", [0x0100, 0x0200, 0x0400])
def test_stt_of_a_stop_needs_no_trajectory(bench, control):
    bench.filter(kp=10)
    bench.move(control)
    bench.run(MS)
    assert found(bench) == []


@pytest.mark.spec("LM-CMD-2", "LM-TRJ-5")
def test_stt_given_again_goes_on_to_what_is_buffered(bench):
    run(bench)
    bench.move(0x1C00)
    bench.run(3 * SAMPLE)
    bench.command("STT")
    bench.run(3 * SAMPLE)
    assert found(bench) == []


@pytest.mark.spec("LM-TRJ-12")
@pytest.mark.parametrize(
    ("control", "loads"),
    [(0, {"velocity": ONE, "position": 100}), (0x1, {"position": -7}), (0x1800, {"velocity": ONE})],
)
def test_a_move_with_acceleration_0_is_found(bench, control, loads):
    bench.filter(kp=10)
    bench.move(control, **loads)
    bench.run(4 * SAMPLE)
    assert found(bench) == [("no-acceleration", "warning")]
    assert bench.probe.desired_velocity == 0


@pytest.mark.spec("LM-TRJ-12")
def test_a_move_with_the_acceleration_of_the_one_before_is_right(bench):
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    bench.run(10 * SAMPLE)
    bench.move(0, position=4)
    bench.run(10 * SAMPLE)
    assert found(bench) == []


@pytest.mark.spec("LM-TRJ-12")
def test_holding_an_axis_where_it_stands_needs_no_acceleration(bench):
    bench.filter(kp=10)
    bench.move(0, position=0)
    bench.move(0x1, position=0)
    bench.move(0x0800, velocity=0)
    assert found(bench) == []


@pytest.mark.spec("LM-TRJ-12")
def test_a_move_with_velocity_0_is_noted(bench):
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=0, position=100)
    bench.run(4 * SAMPLE)
    assert found(bench) == [("no-velocity", "note")]


@pytest.mark.spec("LM-TRJ-12")
def test_velocity_mode_at_0_and_a_move_that_is_there_need_no_velocity(bench):
    bench.filter(kp=10)
    bench.move(0x1800, accel=ONE, velocity=0)
    bench.run(2 * SAMPLE)
    bench.move(0, position=0)
    assert found(bench) == []


@pytest.mark.spec("LM-TRJ-2")
@pytest.mark.parametrize(
    "velocities",
    [
        (20000, 40000, 60000, 14464),
        (0x8000, 0xC000, 0x0000),
        (1000, 33000, 464),
        (25000, 50000, 34464),
    ],
)
def test_a_velocity_that_has_lost_its_high_word_is_found(bench, velocities):
    bench.filter(kp=10)
    bench.move(0x1800, accel=ONE, velocity=velocities[0])
    bench.run(SAMPLE)
    for value in velocities[1:]:
        assert found(bench) == []
        bench.move(0x1800, velocity=value)
        bench.run(SAMPLE)
    assert found(bench) == [("velocity-wraps", "warning")]


@pytest.mark.spec("LM-TRJ-2")
@pytest.mark.parametrize(
    "velocities",
    [
        (20000, 40000, 60000, 80000, 14464),  # slowed down, and the high word is there
        (20000, 40000, 20000, 40000),
        (40000, 20000, 10000, 5000),
        (30000, 60000, 30000, 0),
        (5000, 60000, 60000, 60000),
    ],
)
def test_velocities_that_rise_and_fall_are_right(bench, velocities):
    bench.filter(kp=10)
    bench.load(0x1800, accel=ONE)
    for value in velocities:
        bench.move(0x1800, velocity=value)
        bench.run(SAMPLE)
    assert found(bench) == []


@pytest.mark.spec("LM-PID-5")
@pytest.mark.parametrize(("il", "expected"), [(0, [("no-integral", "note")]), (1, [])])
def test_an_integral_coefficient_without_a_limit_is_noted(bench, il, expected):
    bench.filter(kp=10, ki=5, il=il)
    bench.move(0, accel=ONE, velocity=ONE, position=0)
    assert found(bench) == expected


# -- motor off ------------------------------------------------------------------------------------


@pytest.mark.spec("LM-TRJ-10")
def test_the_motor_off_at_speed_is_noted(bench):
    run(bench)
    bench.move(0x0100)
    bench.run(SAMPLE)
    assert found(bench) == [("off-at-speed", "note")]
    assert bench.violations[0].detail == "STT with bit 8 at 4 counts per sample"


@pytest.mark.spec("LM-TRJ-10")
@pytest.mark.parametrize("stop", [0x0200, 0x0400])
def test_the_motor_off_after_a_stop_is_right(bench, stop):
    run(bench)
    bench.move(stop)
    bench.run(3 * SAMPLE)
    bench.move(0x0100)
    bench.run(SAMPLE)
    bench.move(0x0100)
    assert found(bench) == []


# -- RSTI -----------------------------------------------------------------------------------------


@pytest.mark.spec("LM-CMD-18")
@pytest.mark.parametrize("word", [0x007E, 0xFFFF, 0x00FF])
def test_rsti_of_ones_is_found(bench, word):
    bench.command("RSTI", word)
    assert found(bench) == [("resets-nothing", "warning")]


@pytest.mark.spec("LM-CMD-18")
def test_rsti_that_leaves_every_flag_that_is_set_is_noted(bench):
    bench.command("RSTI", 0x0004)
    assert bench.status() & 0x7E == 0x04
    assert found(bench) == [("leaves-flags", "note")]
    assert bench.violations[0].detail == (
        "RSTI 0004H leaves all flags that are set: TRAJECTORY_COMPLETE"
    )


@pytest.mark.spec("LM-CMD-18", "LM-RST-5")
def test_rsti_leaves_a_flag_that_is_stuck_and_no_host_can_clear_it(make):
    bench = make(reset_status="C4")
    bench.command("RSTI", 0x0000)
    bench.command("RSTI", 0xFFFB)
    assert bench.status() & 0x7E == 0x40
    assert found(bench) == []


@pytest.mark.spec("LM-CMD-18")
@pytest.mark.parametrize("word", [0x0000, 0xFF81, 0x007A, 0xFFFB])
def test_rsti_that_clears_is_right_and_so_is_one_before_anything_is_set(bench, word):
    bench.command("RSTI", word)
    bench.command("RSTI", word)
    assert bench.status() & 0x7E == 0
    assert found(bench) == []


# -- the end of a run -----------------------------------------------------------------------------


@pytest.mark.spec("LM-CMD-19", "LM-CMD-20")
def test_what_is_loaded_and_never_taken_is_noted_at_the_end(bench):
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=3)
    bench.run(MS)
    assert left(bench) == []
    bench.command("LFIL", 0x08, 20)
    bench.load(0, position=5)
    assert left(bench) == [
        ("left-loaded", "LFIL has loaded a filter that no UDF has taken"),
        ("left-loaded", "LTRJ has loaded a trajectory that no STT has taken"),
    ]
    bench.command("UDF")
    bench.command("STT")
    assert left(bench) == []
    assert found(bench) == []


@pytest.mark.spec("LM-STA-7")
def test_an_interrupt_that_stands_at_the_end_is_noted_where_hi_is_wired(bench):
    assert bench.pin("HI") == 1
    assert left(bench) == [], "a host that polls need not reset a flag"
    watched = []
    bench.chip.pins["HI"].net.watch(_watcher(bench, watched))
    assert [rule for rule, _ in left(bench)] == ["hi-stands"]
    bench.status()
    assert left(bench) == [
        ("hi-stands", "HI is high at the end: TRAJECTORY_COMPLETE; RSTI lets it fall")
    ]
    bench.command("RSTI", 0)
    assert left(bench) == []
    assert watched


@pytest.mark.spec("LM-STA-7", "LM-CMD-17")
def test_an_interrupt_that_mski_has_enabled_is_meant_to_be_answered(bench):
    bench.command("RSTI", 0)
    bench.command("MSKI", 0x04)
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    bench.run(MS)
    assert left(bench) == [
        (
            "hi-stands",
            "HI is high at the end, and no status byte was read since it rose:"
            " TRAJECTORY_COMPLETE; RSTI lets it fall",
        )
    ]
    bench.command("MSKI", 0)
    assert left(bench) == []


@pytest.mark.spec("LM-STA-1")
def test_errors_that_stand_at_the_end_are_noted(bench):
    bench.write(1, 0)
    assert left(bench) == [("errors-stand", "at the end: COMMAND_ERROR")]
    bench.command("RSTI", 0)
    assert left(bench) == []


def _watcher(bench, seen):
    from vbus.core.signals import Watcher

    return Watcher(bench.kernel, lambda: seen.append(bench.now))


@pytest.mark.spec("LM-CMD-19", "LM-CMD-20", "LM-CMD-18", "LM-BUS-9")
def test_what_ends_when_busy_falls_has_ended_in_a_run_that_ends_before(bench):
    bench.command("LFIL", 0x08)
    bench.write(1, 0)
    bench.write(1, 20)
    assert [rule for rule, _ in left(bench)] == ["left-loaded"], "the word is under way"
    bench.ready()
    bench.write(0, 0x04)
    assert left(bench) == [], "UDF is"
    bench.ready()
    bench.load(0, accel=ONE, velocity=ONE, position=5)
    assert [rule for rule, _ in left(bench)] == ["left-loaded"]
    bench.write(0, 0x01)
    assert left(bench) == []
    bench.ready()
    bench.command("MSKI", 0x04)
    assert [rule for rule, _ in left(bench)] == ["hi-stands"]
    bench.command("RSTI")
    bench.write(1, 0)
    bench.write(1, 0)
    assert left(bench) == []


@pytest.mark.spec("LM-CMD-9", "LM-CMD-11")
def test_a_host_that_reads_the_desired_position_alone_is_noted(bench):
    bench.command("RDDP")
    assert left(bench) == [
        ("desired-alone", "RDDP was read, which the motor does not change, and RDRP never")
    ]
    bench.command("RDRP")
    assert left(bench) == []
    bench.command("RESET")
    bench.run(3 * MS)
    bench.command("RDRP")
    assert left(bench) == [], "a host that reads where the axis is alone is right"


# -- control words, breakpoints -------------------------------------------------------------------


@pytest.mark.spec("LM-TRJ-1")
@pytest.mark.parametrize(
    "control", [0x0010, 0x0004, 0x0001, 0x2000, 0x4000, 0x8000, 0x0080, 0x0040]
)
def test_a_bit_of_a_control_word_that_does_nothing_is_noted(bench, control):
    bench.command("LTRJ", control)
    assert found(bench) == [("idle-bits", "note")]
    assert f"bits {control:04X}H do nothing" in bench.violations[0].detail


@pytest.mark.spec("LM-TRJ-1", "LM-PID-1")
def test_bits_that_do_something_are_what_the_rule_asks_for(bench):
    bench.command("LTRJ", 0x183F, 0, 1, 0, 1, 0, 1)
    bench.command("LFIL", 0xFF0F, 1, 2, 3, 4)
    assert found(bench) == []


@pytest.mark.spec("LM-PID-1")
def test_an_unused_bit_of_the_filter_control_word_is_noted(bench):
    bench.command("LFIL", 0x0080)
    assert found(bench) == [("idle-bits", "note")]


@pytest.mark.spec("LM-PID-1")
def test_a_derivative_interval_that_the_next_lfil_takes_back_is_noted(bench):
    bench.command("LFIL", 0x020F, 1, 2, 3, 4)
    bench.command("LFIL", 0x0208, 10)
    bench.command("LFIL", 0x0308, 10)
    assert found(bench) == []
    bench.command("LFIL", 0x0008, 10)
    assert found(bench) == [("interval-lost", "note")]
    assert bench.violations[0].detail.endswith("an interval of 1 sample; before it was 4")


@pytest.mark.spec("LM-CMD-22", "LM-AMB-5")
def test_a_relative_breakpoint_before_the_sample_that_takes_stt_is_found(bench):
    bench.filter(kp=10)
    bench.command("LTRJ", 0x2A, 1, 0, 1, 0, 0, 1000)
    bench.next_sample()
    bench.command("STT")
    bench.command("SBPR", 0xFFFF, 0xFF9C)
    assert found(bench) == [("early-breakpoint", "warning")]
    assert bench.violations[0].detail.startswith("SBPR -100 counts from 0")


@pytest.mark.spec("LM-CMD-22", "LM-AMB-5")
def test_a_relative_breakpoint_after_that_sample_is_right_and_so_is_an_absolute_one(bench):
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=1000)
    bench.command("SBPA", 0, 900)
    bench.run(2 * SAMPLE)
    bench.command("SBPR", 0xFFFF, 0xFF9C)
    assert found(bench) == []


@pytest.mark.spec("LM-POS-3")
def test_an_index_that_has_not_come_is_noted_at_the_end(bench):
    bench.command("SIP")
    bench.run(MS)
    assert left(bench) == [("left-armed", "SIP waits for an index pulse, and none has come")]
