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
@pytest.mark.parametrize(("control", "loads"), [(0x0000, {"position": 100}), (0x0200, {})])
def test_a_motor_turned_on_before_udf_is_found(bench, control, loads):
    bench.command("LFIL", 0x08, 10)
    bench.move(control, accel=ONE, velocity=ONE, **loads)
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
    bench.move(0x1800, accel=400, velocity=velocities[0])
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
    bench.load(0x1800, accel=400)
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


@pytest.mark.spec("LM-PID-5")
@pytest.mark.parametrize(("ki", "expected"), [(0, [("no-integral", "note")]), (1, [])])
def test_a_limit_without_an_integral_coefficient_is_noted(bench, ki, expected):
    bench.filter(kp=10, ki=ki, il=5)
    bench.move(0, accel=ONE, velocity=ONE, position=0)
    assert found(bench) == expected


@pytest.mark.spec("LM-TRJ-15")
@pytest.mark.parametrize("control", [0x0000, 0x1800])
def test_an_acceleration_above_the_velocity_is_found(bench, control):
    bench.filter(kp=10)
    bench.move(control, accel=ONE + 1, velocity=ONE)
    assert found(bench) == [("hasty", "warning")]
    assert bench.violations[0].detail == "STT with acceleration 00010001H, velocity 00010000H"


@pytest.mark.spec("LM-TRJ-15")
def test_slower_velocities_with_the_acceleration_of_the_move_before_are_right(bench):
    bench.filter(kp=10)
    bench.move(0x1800, accel=ONE, velocity=ONE)
    for velocity in (0, 100, 2 * ONE):
        bench.run(2 * SAMPLE)
        bench.move(0x1800, velocity=velocity)
    bench.move(0x1C00, accel=3 * ONE)  # a stop may be as hard as it likes
    bench.run(2 * SAMPLE)
    bench.move(0x0800, accel=ONE, velocity=0)
    assert found(bench) == []


@pytest.mark.spec("LM-TIM-2")
@pytest.mark.parametrize(
    ("velocity", "expected"), [(256 << 16, []), ((256 << 16) + 1, [("too-fast", "note")])]
)
def test_a_velocity_that_no_encoder_input_follows_is_noted(bench, velocity, expected):
    bench.command("LTRJ", 0x000C, 0xFFFF, 0xFF00)  # a relative one has a sign
    bench.command("STT")
    bench.command("LTRJ", 0x0008, velocity >> 16, velocity & 0xFFFF)
    assert found(bench) == expected


@pytest.mark.spec("LM-TRJ-13")
@pytest.mark.parametrize(
    ("control", "loads", "expected"),
    [
        (0x0000, {"velocity": ONE}, [("mode-lost", "note")]),
        (0x1800, {"velocity": ONE}, []),
        (0x0400, {}, []),
        (0x0000, {"velocity": ONE, "position": 90}, []),
    ],
)
def test_an_axis_in_velocity_mode_keeps_it_stops_or_has_a_target(bench, control, loads, expected):
    run(bench)
    bench.move(control, **loads)
    assert found(bench) == expected
    bench.run(100 * SAMPLE)
    bench.move(0, velocity=2 * ONE)
    assert len(found(bench)) == len(expected) + (control == 0x1800)


@pytest.mark.spec("LM-TRJ-13")
def test_velocity_mode_on_the_way_to_a_target_is_noted_and_after_it_is_right(bench):
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=50)
    bench.run(70 * SAMPLE)
    bench.move(0x1800)
    assert found(bench) == []
    bench.move(0x0400)
    bench.run(9 * SAMPLE)
    bench.move(0, position=500)
    bench.run(9 * SAMPLE)
    bench.move(0x1800, velocity=ONE // 2)
    assert found(bench) == [("target-lost", "note")]
    assert bench.violations[0].detail == "velocity mode begins on the way to 500"


@pytest.mark.spec("LM-CMD-7", "LM-RST-2")
@pytest.mark.parametrize("again", [(), ("PORT12",), ("PORT8",)])
@pytest.mark.parametrize("part", ["LM628N-8", "LM629N-8"])
def test_a_port_of_12_bits_is_chosen_again_after_a_reset(make, part, again):
    bench = make(part=part)
    bench.command("PORT12")
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    bench.command("RESET")
    bench.run(3 * MS)
    for name in again:
        bench.command(name)
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    lost = [v.severity for v in bench.violations if v.rule == "lm628.port-lost"]
    assert lost == ["warning"] * (part == "LM628N-8" and not again)


# -- motor off ------------------------------------------------------------------------------------


@pytest.mark.spec("LM-TRJ-10", "LM-CMD-9")
@pytest.mark.parametrize(
    ("reads", "beside", "expected"),
    [
        (["RDDP"], 0, [("desired-off", "note")]),
        (["RDDP", "RDRP"], 0, []),
        (["RDRP"], 0, []),
        (["RDDP"], 1, []),
    ],
)
def test_an_axis_whose_motor_went_off_stands_where_rdrp_says(bench, reads, beside, expected):
    bench.command("LPES", 3)
    bench.filter(kp=0, ki=1)
    bench.move(0, accel=ONE, velocity=ONE, position=500)
    bench.run(20 * SAMPLE)
    assert bench.status() & 0xA0 == 0xA0
    place = {name: bench.report(name) for name in reads}[reads[0]] if reads else 0
    bench.filter(kp=10, ki=0)
    bench.move(0, position=place + beside)
    assert found(bench)[1:] == expected, "beside the note on ki without il"


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


@pytest.mark.spec("LM-TRJ-10", "LM-CMD-1")
def test_a_reset_at_speed_is_noted_and_one_at_rest_is_right(bench):
    run(bench)
    bench.command("RESET")
    assert found(bench) == [("off-at-speed", "note")]
    bench.run(3 * MS)
    bench.command("RESET")
    assert [v.detail for v in bench.violations] == ["RESET at 4 counts per sample"]


@pytest.mark.spec("LM-POS-4", "LM-CMD-3")
def test_home_is_defined_at_rest(bench):
    bench.command("DFH")
    run(bench)
    assert found(bench) == []
    bench.command("DFH")
    assert found(bench) == [("home-in-motion", "note")]
    assert bench.violations[0].detail == "DFH at 4 counts per sample"


@pytest.mark.spec("LM-RST-2", "LM-CMD-1")
@pytest.mark.parametrize(
    "packet", [("LFIL", 0x08, 10), ("LPES", 100), ("MSKI", 0x04), ("PORT12",), ("LFIL", 0x0200)]
)
def test_what_a_reset_sets_back_before_its_use_is_noted(make, packet):
    bench = make(part="LM628N-8")
    bench.command(*packet)
    bench.command("RESET")
    assert found(bench) == [("reset-forgets", "note")]
    bench.run(3 * MS)
    bench.command("RESET")
    assert len(bench.violations) == 1, "nothing was loaded between the two"


@pytest.mark.spec("LM-RST-2", "LM-CMD-1")
def test_a_reset_after_a_move_or_before_any_load_is_right(bench):
    bench.command("RESET")
    bench.run(3 * MS)
    bench.command("LPES", 100)
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    bench.run(MS)
    bench.command("RESET")
    assert found(bench) == []


@pytest.mark.spec("LM-CMD-15", "LM-CMD-16")
def test_lpei_after_lpes_is_noted_and_lpes_after_lpei_is_right(bench):
    bench.command("LPEI", 100)
    bench.command("LPEI", 50)
    bench.command("LPES", 200)
    bench.command("LPES", 300)
    assert found(bench) == []
    bench.command("LPEI", 100)
    assert found(bench) == [("stop-lost", "note")]


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


@pytest.mark.spec("LM-CMD-18")
@pytest.mark.parametrize(
    ("control", "word", "flags"),
    [
        (0x0000, 0x0000, "TRAJECTORY_COMPLETE"),
        (0x0000, 0xFFFB, "TRAJECTORY_COMPLETE"),
        (0x1800, 0x0000, ""),
        (0x0000, 0x0004, ""),
    ],
)
@pytest.mark.parametrize("samples", [0, 3])
def test_rsti_of_the_end_of_a_move_under_way_is_noted(bench, control, word, flags, samples):
    bench.command("RSTI", 0)
    bench.filter(kp=10)
    loads = {} if control else {"position": 30000}
    bench.load(control, accel=ONE, velocity=ONE, **loads)
    bench.next_sample()
    bench.command("STT")
    bench.run(samples * SAMPLE)
    bench.command("RSTI", word)
    assert [v.rule for v in bench.violations] == ["lm628.clears-awaited"] * bool(flags)
    assert all(v.detail.endswith(f"still to come: {flags}") for v in bench.violations)


@pytest.mark.spec("LM-CMD-18", "LM-POS-3", "LM-POS-5")
@pytest.mark.parametrize(
    ("packet", "flag"), [(("SIP",), "INDEX"), (("SBPA", 0, 100), "BREAKPOINT")]
)
def test_rsti_of_an_index_or_a_breakpoint_that_waits_is_noted_in_motion(bench, packet, flag):
    bench.command(*packet)
    bench.command("RSTI", 0xFF81)
    assert found(bench) == []
    run(bench)
    bench.command("RSTI", 0xFF81)
    assert found(bench) == [("clears-awaited", "note")]
    assert bench.violations[0].detail == f"RSTI FF81H clears what is still to come: {flag}"


@pytest.mark.spec("LM-CMD-18")
def test_rsti_of_a_stop_is_noted_from_stt_on(bench):
    bench.command("RSTI", 0)
    run(bench)
    bench.load(0x1C00)
    bench.command("RSTI", 0)
    assert found(bench) == []
    bench.next_sample()
    bench.command("STT")
    bench.command("RSTI", 0)
    assert found(bench) == [("clears-awaited", "note")]


@pytest.mark.spec("LM-CMD-17")
@pytest.mark.parametrize(("word", "expected"), [(0xFF81, 1), (0x0081, 1), (0xFF04, 0), (0, 0)])
def test_an_interrupt_mask_of_bits_that_do_nothing_is_noted(bench, word, expected):
    bench.command("MSKI", word)
    assert found(bench) == [("idle-bits", "note")] * expected


@pytest.mark.spec("LM-CMD-17", "LM-CMD-18", "LM-CMD-19")
@pytest.mark.parametrize(
    ("command", "word", "expected"),
    [("MSKI", 0x0400, 1), ("MSKI", 0x0404, 0), ("RSTI", 0x7A00, 1), ("RSTI", 0xFB00, 1),
     ("RSTI", 0xFF00, 0), ("RSTI", 0, 0), ("LFIL", 0x0010, 1), ("LFIL", 0x0180, 1),
     ("LFIL", 0x0100, 0)],
)  # fmt: skip
def test_flags_or_an_interval_in_bits_that_do_nothing_are_found(bench, command, word, expected):
    bench.command(command, word)
    assert found(bench) == [("misplaced", "warning")] * expected


@pytest.mark.spec("LM-CMD-20")
@pytest.mark.parametrize(
    ("control", "loads", "expected"),
    [
        (0x0000, {"velocity": 2 * ONE}, 1),
        (0x0000, {"velocity": ONE}, 0),  # the same value again
        (0x0000, {"accel": ONE, "position": 7}, 0),
        (0x0400, {}, 0),
    ],
)
@pytest.mark.parametrize("started", [False, True])
def test_a_value_that_another_one_replaces_before_stt_is_noted(
    bench, control, loads, expected, started
):
    bench.filter(kp=10)
    bench.load(0, velocity=ONE)
    if started:
        bench.command("STT")
    bench.load(control, **loads)
    assert found(bench)[started:] == [("load-lost", "note")] * (expected and not started)


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


@pytest.mark.spec("LM-CMD-5")
@pytest.mark.parametrize("when", ["before", "under way", "not over", "breakpoint", "taken"])
def test_gains_loaded_before_a_move_and_not_taken_when_it_is_over_are_found_at_the_end(bench, when):
    bench.filter(kp=10)
    if when != "under way":
        bench.command("LFIL", 0x08, 20)
    if when == "breakpoint":
        bench.command("SBPA", 0, 100)
    bench.move(0, accel=ONE, velocity=ONE, position=9000 if when == "not over" else 3)
    if when == "under way":
        bench.command("LFIL", 0x08, 20)
    bench.run(9 * SAMPLE)
    if when == "taken":
        bench.command("UDF")
        bench.command("LFIL", 0x08, 30)
    rules = [rule for rule, _ in left(bench) if rule != "left-armed"]
    assert rules == ["update-waits" if when == "before" else "left-loaded"]
    bench.command("UDF")
    assert [rule for rule, _ in left(bench) if rule != "left-armed"] == []


@pytest.mark.spec("LM-CMD-20", "LM-TRJ-10")
@pytest.mark.parametrize(
    ("control", "what"), [(0x0100, "stop"), (0x0C00, "stop"), (0x0800, "trajectory")]
)
def test_a_stop_or_a_mode_that_stt_has_not_taken_is_noted_at_the_end(bench, control, what):
    bench.filter(kp=10)
    bench.load(control)
    assert left(bench) == [("left-loaded", f"LTRJ has loaded a {what} that no STT has taken")]
    bench.command("STT")
    assert left(bench) == []


@pytest.mark.spec("LM-TRJ-10")
@pytest.mark.parametrize(
    ("control", "at_rest", "rule"),
    [(0x0100, True, "off-waits"), (0x0100, False, "left-loaded"), (0x0400, True, "left-loaded")],
)
def test_a_motor_off_loaded_at_rest_is_taken_before_the_end(bench, control, at_rest, rule):
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=ONE, position=3)
    if at_rest:
        bench.run(MS)
    bench.command("LTRJ")
    for byte in (control >> 8, control & 0xFF):
        bench.write(1, byte)
    assert left(bench) == [(rule, "LTRJ has loaded a stop that no STT has taken")], "under way"
    bench.ready()
    assert left(bench) == [(rule, "LTRJ has loaded a stop that no STT has taken")]
    bench.command("STT")
    bench.run(MS)
    bench.load(control)
    if control == 0x0100:
        assert left(bench) == [("left-loaded", "LTRJ has loaded a stop that no STT has taken")], (
            "the motor is off"
        )


@pytest.mark.spec("LM-PID-5")
@pytest.mark.parametrize(("moves", "holds"), [(1, False), (2, True), (2, False)])
def test_an_integral_term_that_is_0_in_several_moves_is_found_at_the_end(bench, moves, holds):
    for target in range(moves):
        bench.filter(kp=10, ki=5, il=0)
        bench.move(0, accel=ONE, velocity=ONE, position=target + 1)
        bench.run(2 * MS)
        if holds:
            bench.filter(kp=10, ki=5, il=100)
    found = [("vain-integral", "2 moves with ki above 0, and il 0 in all of them")]
    assert left(bench) == (found if moves == 2 and not holds else [])
    bench.command("RESET")
    bench.run(3 * MS)
    assert left(bench) == []


@pytest.mark.spec("LM-TRJ-13")
def test_velocity_mode_that_runs_at_the_end_is_noted(bench):
    run(bench)
    assert left(bench) == [("left-running", "velocity mode runs on at 4 counts per sample")]
    bench.load(0x1C00)
    bench.write(0, 0x01)
    assert left(bench) == [], "STT is under way"
    bench.run(3 * SAMPLE)
    bench.move(0x0000, position=1000)
    assert left(bench) == [], "a move ends by itself"


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


@pytest.mark.spec("LM-TRJ-1", "LM-TRJ-5", "LM-TRJ-13")
@pytest.mark.parametrize(
    ("control", "why"),
    [
        (0x182A, "it loads a position, which neither velocity mode nor a stop goes to"),
        (0x0402, "it loads a position, which neither velocity mode nor a stop goes to"),
        (0x102A, "bit 12 gives a direction to velocity mode alone"),
    ],
)
def test_a_position_or_a_direction_that_the_mode_has_not_is_noted(bench, control, why):
    bench.command("LTRJ", control)
    assert found(bench) == [("idle-bits", "note")]
    assert bench.violations[0].detail == f"LTRJ {control:04X}H: {why}"


@pytest.mark.spec("LM-TRJ-1", "LM-PID-1")
def test_bits_that_do_something_are_what_the_rule_asks_for(bench):
    bench.command("LTRJ", 0x003F, 0, 1, 0, 1, 0, 1)
    bench.command("LTRJ", 0x183C, 0, 1, 0, 1)
    bench.command("LTRJ", 0x1C30, 0, 1)
    bench.command("LFIL", 0xFF0F, 1, 2, 3, 4)
    assert found(bench) == []


@pytest.mark.spec("LM-PID-1")
def test_an_unused_bit_of_the_filter_control_word_is_noted(bench):
    bench.command("LFIL", 0x00F0)
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


@pytest.mark.spec("LM-POS-5")
def test_a_breakpoint_that_has_not_come_is_noted_at_the_end(bench):
    bench.command("SBPA", 0xFFFF, 0xFF9C)
    bench.run(MS)
    assert left(bench) == [("left-armed", "a breakpoint waits at -100, and the axis is at 0")]
    bench.command("SBPA", 0, 0)
    bench.run(MS)
    assert left(bench) == []


@pytest.mark.spec("LM-CMD-21", "LM-CMD-22")
@pytest.mark.parametrize("packet", [("SBPA", 0x4000, 0), ("SBPR", 0xBFFF, 0xFFFF)])
def test_a_breakpoint_out_of_range_is_found(bench, packet):
    bench.command("SBPA", 0x3FFF, 0xFFFF)
    bench.command("SBPR", 0xC000, 0)
    assert found(bench) == []
    bench.command(*packet)
    assert found(bench) == [("range", "warning")]


@pytest.mark.spec("LM-CMD-10", "LM-POS-3")
def test_an_index_position_read_before_the_index_has_come_is_noted(bench):
    bench.report("RDIP")
    bench.command("SIP")
    assert found(bench) == []
    bench.report("RDIP")
    assert found(bench) == [("early-index", "note")]
