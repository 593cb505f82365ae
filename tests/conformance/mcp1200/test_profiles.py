"""Trapezoid (MCP-TRP) and S-curve (MCP-SCV) moves, sample by sample."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mcp1200.conftest import Bench


def prepare(
    bench: Bench, final: int, velocity: int = 10, accel: int = 0x180, jerk: int | None = None
) -> None:
    """Set up a move in control mode; ``velocity`` in counts, ``accel`` in 1/256."""
    if jerk is not None:
        bench.extended()
        bench.put("JERK", jerk)
        bench.write(0x01, 0x10)
    bench.put("FINAL_POSITION", final & 0xFFFFFF)
    bench.put("PROFILE_VELOCITY", velocity)
    bench.put("ACCELERATION", accel)
    bench.control()


def start(bench: Bench) -> None:
    bench.write(0x00, 0x08)


def run(bench: Bench, most: int = 5000) -> list[int]:
    """Return the command position after each sample until F0 falls."""
    course = []
    for _ in range(most):
        bench.samples(1)
        course.append(bench.seen("COMMAND_POSITION"))
        if not bench.seen("FLAG") & 1:
            return course
    raise AssertionError("the profile never ended")


T_10 = [1, 4, 9, 15, 22, 31, 41, 51, 61, 71, 80, 87, 92, 96, 99, 100]


@pytest.mark.spec("MCP-TRP-1", "MCP-TRP-2", "MCP-TRP-3", "MCP-T-10", "MCP-T-19")
def test_the_manual_move_in_sixteen_samples(bench: Bench) -> None:
    prepare(bench, 100)
    assert (bench.read(0x27), bench.read(0x26)) == (1, 0x80)
    start(bench)
    assert run(bench) == T_10
    assert (bench.seen("FLAG"), bench.seen("PHASE"), bench.pin("PROF")) == (0, 0, 0)
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == 100


@pytest.mark.spec("MCP-TRP-1")
@pytest.mark.parametrize("velocity", [0x000A00, -0x000A00])
def test_high_resolution_velocity_counts_by_its_magnitude(bench: Bench, velocity: int) -> None:
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", velocity & 0xFFFFFF)
    prepare(bench, 100, velocity=1)
    start(bench)
    assert run(bench) == T_10


@pytest.mark.spec("MCP-TRP-1", "MCP-REG-26", "MCP-REG-25")
def test_the_top_bits_of_velocity_and_acceleration_are_ignored(bench: Bench) -> None:
    prepare(bench, 100, velocity=0x8A, accel=0x8180)
    start(bench)
    assert run(bench) == T_10


@pytest.mark.spec("MCP-TRP-1")
def test_a_move_starts_from_the_command_position_even_if_the_motor_is_elsewhere(
    bench: Bench,
) -> None:
    bench.put("COMMAND_POSITION", 1000)
    bench.probe.set_position(77, bench.cycle)
    prepare(bench, 1100)
    start(bench)
    assert run(bench) == [1000 + place for place in T_10]


@pytest.mark.spec("MCP-TRP-4", "MCP-REG-7")
def test_phases_of_a_trapezoid_and_of_a_triangle(bench: Bench) -> None:
    prepare(bench, 100)
    start(bench)
    assert bench.trace("PHASE", 16) == [2] * 7 + [4] * 3 + [6] * 5 + [0]
    bench.put("FINAL_POSITION", 116)
    bench.put("PROFILE_VELOCITY", 100)
    bench.put("ACCELERATION", 0x0100)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 7) == [101, 103, 106, 110, 113, 115, 116]
    bench.put("FINAL_POSITION", 132)
    start(bench)
    assert bench.trace("PHASE", 7) == [2, 2, 2, 2, 6, 6, 0]


@pytest.mark.spec("MCP-TRP-4", "MCP-TRP-8")
def test_a_sample_that_does_not_accelerate_is_no_part_of_the_acceleration(bench: Bench) -> None:
    prepare(bench, 100, 1, 0x0100)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 3) == [1, 2, 3]
    assert (bench.seen("PHASE"), bench.seen("ACCEL_DELTA")) == (4, 1)
    bench.put("PROFILE_VELOCITY", 50)
    bench.put("FINAL_POSITION", 4)
    assert run(bench) == [4]
    assert bench.seen("ACCEL_DELTA") == 1


@pytest.mark.spec("MCP-TRP-5")
def test_a_move_to_where_it_stands_ends_in_its_first_sample(bench: Bench) -> None:
    prepare(bench, 0)
    start(bench)
    assert bench.seen("FLAG") & 1
    assert run(bench) == [0]


@pytest.mark.spec("MCP-TRP-5")
@pytest.mark.parametrize(("velocity", "accel"), [(0, 0x180), (10, 0)])
def test_without_velocity_or_acceleration_the_flag_stays_until_there_is_one(
    bench: Bench, velocity: int, accel: int
) -> None:
    prepare(bench, 100, velocity, accel)
    start(bench)
    bench.samples(5)
    assert (bench.seen("FLAG"), bench.seen("COMMAND_POSITION")) == (0x05, 0)
    assert bench.seen("PHASE") == 0, "no move has begun"
    bench.put("PROFILE_VELOCITY", 10)
    bench.put("ACCELERATION", 0x180)
    assert run(bench) == T_10


@pytest.mark.spec("MCP-TRP-6", "MCP-AMB-31")
@pytest.mark.parametrize("ahead", [29, 33, 38, 60])
def test_a_move_can_be_lengthened_and_shortened_while_the_end_is_in_reach(
    bench: Bench, ahead: int
) -> None:
    prepare(bench, 100)
    start(bench)
    bench.samples(8)
    assert bench.seen("PHASE") == 4
    bench.put("FINAL_POSITION", 200)
    course = run(bench)
    assert course[-1] == 200
    assert max(b - a for a, b in pairwise(course)) == 10
    bench.put("FINAL_POSITION", 1000)
    start(bench)
    bench.samples(10)
    here = bench.seen("COMMAND_POSITION")
    # Stopping from 10 by 1.5: 8.5 + 7 + 5.5 + 4 + 2.5 + 1 = 28.5 counts.
    bench.put("FINAL_POSITION", here + ahead)
    assert run(bench)[-1] == here + ahead


@pytest.mark.spec("MCP-TRP-6")
@pytest.mark.parametrize("final", [28, -500])
def test_an_end_too_near_or_behind_stops_the_move_at_once(bench: Bench, final: int) -> None:
    prepare(bench, 1000)
    start(bench)
    bench.samples(10)
    here = bench.seen("COMMAND_POSITION")
    assert here == 71
    bench.put("FINAL_POSITION", (here + final) & 0xFFFFFF)
    # From 71.5: 8.5, 7, 5.5, 4, 2.5, 1 and then rest.
    assert run(bench) == [80, 87, 92, 96, 99, 100, 100]
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == 100


@pytest.mark.spec("MCP-TRP-6", "MCP-TRP-5")
@pytest.mark.parametrize("way", [1, -1], ids=["forwards", "backwards"])
@pytest.mark.parametrize("ahead", [43, -43, 0, 1, -1, 3000])
def test_at_rest_in_the_middle_of_a_move_every_end_can_be_reached(
    bench: Bench, way: int, ahead: int
) -> None:
    bench.write(0x04, 0x00)
    bench.write(0x27, 0x01)
    bench.write(0x26, 0x00)
    bench.write(0x28, 0x01)
    bench.put("FINAL_POSITION", 100_000 * way & 0xFFFFFF)
    bench.control()
    start(bench)
    bench.samples(6)
    bench.write(0x28, 0x00)
    bench.samples(3)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("PHASE")) == (6 * way, 4)
    end = (6 + ahead) * way
    bench.put("FINAL_POSITION", end & 0xFFFFFF)
    if ahead:
        bench.samples(4)
        assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG")) == (6 * way, 0x05)
        bench.write(0x28, 0x01)
    course = run(bench)
    assert course[-1] == end
    assert len(course) == max(abs(ahead), 1)


@pytest.mark.spec("MCP-TRP-5")
def test_a_trapezoid_that_takes_over_without_a_velocity_shows_no_phase(bench: Bench) -> None:
    prepare(bench, 1000, jerk=0x0100)
    start(bench)
    bench.samples(5)
    assert bench.seen("PHASE") != 0
    bench.put("PROFILE_VELOCITY", 0)
    bench.write(0x01, 0x00)
    bench.samples(1)
    assert (bench.seen("PHASE"), bench.seen("FLAG") & 1) == (0, 1)


@pytest.mark.spec("MCP-TRP-6")
@pytest.mark.parametrize("way", [1, -1], ids=["forwards", "backwards"])
@pytest.mark.parametrize(("ahead", "reached"), [(20, True), (19, False), (0, False), (-43, False)])
def test_in_motion_an_end_must_be_a_stopping_distance_ahead(
    bench: Bench, way: int, ahead: int, reached: bool
) -> None:
    prepare(bench, 1000 * way, accel=0x0200)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 6) == [place * way for place in (2, 6, 12, 20, 30, 40)]
    bench.put("FINAL_POSITION", (40 + ahead) * way & 0xFFFFFF)
    # 8 + 6 + 4 + 2 counts to standstill; a move that is stopped rests for one sample more.
    course = [48, 54, 58, 60] if reached else [48, 54, 58, 60, 60]
    assert run(bench) == [place * way for place in course]


@pytest.mark.spec("MCP-TRP-6", "MCP-TRP-8")
@pytest.mark.parametrize("way", [1, -1], ids=["forwards", "backwards"])
def test_where_a_slow_axis_is_just_now_is_no_longer_ahead_of_it(bench: Bench, way: int) -> None:
    prepare(bench, 1000 * way, velocity=1, accel=0x0200)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 3) == [way, 2 * way, 3 * way]
    bench.put("FINAL_POSITION", 3 * way & 0xFFFFFF)
    assert run(bench) == [3 * way]
    # It was stopped there; it did not arrive.
    assert bench.seen("DECEL_POSITION") == 3 * way


@pytest.mark.spec("MCP-TRP-4")
@pytest.mark.parametrize("way", [1, -1], ids=["forwards", "backwards"])
@pytest.mark.parametrize(
    ("velocity", "final", "phase"), [(0x1FF, 2, 6), (0x100, 1, 6), (0x101, 1, 2)]
)
def test_a_move_begun_too_fast_decelerates_unless_its_end_is_behind(
    bench: Bench, way: int, velocity: int, final: int, phase: int
) -> None:
    """1/256 count before its end, on it, and 1/256 count beyond it."""
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", velocity * way & 0xFFFFFF)
    bench.put("ACCELERATION", 0x7FFF)
    bench.write(0x00, 0x0D)
    bench.control()
    bench.samples(1)
    bench.put("ACCELERATION", 0x80)
    bench.put("FINAL_POSITION", final * way & 0xFFFFFF)
    bench.write(0x00, 0x05)
    start(bench)
    bench.samples(1)
    assert (bench.seen("FLAG"), bench.seen("PHASE")) == (0x05, phase)


@pytest.mark.spec("MCP-TRP-6")
def test_in_deceleration_a_new_end_is_ignored(bench: Bench) -> None:
    prepare(bench, 100)
    start(bench)
    bench.samples(12)
    assert bench.seen("PHASE") == 6
    bench.put("FINAL_POSITION", 5000)
    assert run(bench)[-1] == 100
    start(bench)
    assert run(bench)[-1] == 5000


@pytest.mark.spec("MCP-TRP-7")
def test_repeated_extension_may_pass_24_bits(bench: Bench) -> None:
    bench.put("COMMAND_POSITION", 0x7FFF00)
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", 0x7F0000)
    prepare(bench, 0x7FFFFF, accel=0x7FFF)
    start(bench)
    travelled, last = 0, 0x7FFF00
    for _ in range(800):
        bench.put("FINAL_POSITION", (last + 0x700000) & 0xFFFFFF)
        bench.samples(1)
        here = bench.seen("COMMAND_POSITION")
        travelled += (here - last) & 0xFFFFFF
        last = here
    assert bench.seen("PHASE") in (2, 4)
    assert travelled > 1 << 24


@pytest.mark.spec("MCP-TRP-8", "MCP-REG-30", "MCP-REG-32")
def test_acceleration_distance_and_deceleration_position(bench: Bench) -> None:
    prepare(bench, 100)
    start(bench)
    assert bench.trace("ACCEL_DELTA", 9) == [1, 4, 9, 15, 22, 31, 41, 41, 41]
    assert bench.get("DECEL_POSITION") == 0
    bench.samples(2)
    assert bench.get("DECEL_POSITION") == 71
    run(bench)
    assert (bench.get("ACCEL_DELTA"), bench.get("DECEL_POSITION")) == (41, 71)


@pytest.mark.spec("MCP-TRP-8")
@pytest.mark.parametrize(
    ("final", "accel", "samples", "distance", "position"),
    [(5, 0x600, 1, 5, 0), (8, 0x600, 2, 6, 6), (-8, 0x600, 2, 6, -6)],
)
def test_the_last_sample_of_a_move_accelerates_or_decelerates_as_any_other(
    bench: Bench, final: int, accel: int, samples: int, distance: int, position: int
) -> None:
    prepare(bench, final, accel=accel)
    start(bench)
    assert len(run(bench)) == samples
    assert (bench.get("ACCEL_DELTA"), bench.get("DECEL_POSITION")) == (distance, position)


@pytest.mark.spec("MCP-TRP-5")
def test_a_move_without_velocity_to_where_it_stands_ends_in_its_first_sample(
    bench: Bench,
) -> None:
    bench.write(0x3C, 5)
    prepare(bench, 0, velocity=0)
    bench.write(0x00, 0x0D)
    assert bench.trace("COMMAND_POSITION", 4) == [1, 4, 9, 14]
    bench.write(0x29, 14)
    bench.write(0x00, 0x05)
    start(bench)
    bench.samples()
    assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG")) == (14, 0)


@pytest.mark.spec("MCP-TRP-1", "MCP-VEL-1")
def test_a_move_from_a_position_the_host_has_written_begins_at_that_whole_count(
    bench: Bench,
) -> None:
    bench.write(0x3C, 0x40)
    prepare(bench, 200, accel=0x80)
    bench.write(0x00, 0x0D)
    bench.samples()
    bench.put("COMMAND_POSITION", 100)
    bench.write(0x00, 0x05)
    start(bench)
    # At half a count a sample: half a count had been covered, which the host has overwritten.
    assert bench.trace("COMMAND_POSITION", 3) == [101, 102, 104]


@pytest.mark.spec("MCP-TRP-8")
def test_the_acceleration_distance_is_a_magnitude(bench: Bench) -> None:
    prepare(bench, -100)
    start(bench)
    run(bench)
    assert bench.seen("ACCEL_DELTA") == 42
    assert bench.seen("DECEL_POSITION") == -72


@pytest.mark.spec("MCP-TRP-3")
def test_clearing_the_flag_leaves_the_command_where_it_is(bench: Bench) -> None:
    prepare(bench, 100)
    start(bench)
    bench.samples(5)
    bench.write(0x00, 0x00)
    bench.samples(3)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("PHASE")) == (22, 0)
    start(bench)
    assert run(bench)[-1] == 100


@pytest.mark.spec("MCP-TRP-3")
def test_a_move_set_off_again_within_a_sample_begins_anew(bench: Bench) -> None:
    prepare(bench, 100)
    start(bench)
    bench.samples(8)
    bench.write(0x00, 0x00)
    start(bench)
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == 51 + 1


# -- S-curve ----------------------------------------------------------------------------------


@pytest.mark.spec("MCP-SCV-1", "MCP-SCV-2", "MCP-SCV-4", "MCP-T-11", "MCP-AMB-1", "MCP-AMB-2")
def test_the_s_curve_of_the_numeric_case(bench: Bench) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 12) == [0, 0, 1, 2, 4, 6, 9, 12, 16, 20, 25, 30]
    bench.samples(12)
    assert (bench.seen("COMMAND_POSITION"), bench.get("ACCEL_DELTA")) == (130, 0x82)
    rest = run(bench)
    assert (len(rest), rest[-1], bench.get("DECEL_POSITION")) == (122 - 24, 1000, 890)
    assert bench.get("ACCEL_DELTA") == 0x82


@pytest.mark.spec("MCP-SCV-2", "MCP-TRP-4")
def test_an_s_curve_passes_all_seven_phases(bench: Bench) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    phases = bench.trace("PHASE", 122)
    assert phases == [1] * 4 + [2] * 16 + [3] * 4 + [4] * 76 + [5] * 4 + [6] * 16 + [7] + [0]


@pytest.mark.spec("MCP-SCV-1", "MCP-SCV-3", "MCP-SCV-5")
def test_an_s_curve_whose_way_is_no_multiple_of_its_velocity_is_one_sample_longer(
    bench: Bench,
) -> None:
    prepare(bench, 1003, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    bench.samples(24)
    # The peak is 1003 / 101: 13 of it while accelerating, 11 while decelerating.
    assert (bench.seen("COMMAND_POSITION"), bench.get("ACCEL_DELTA")) == (129, 129)
    phases = bench.trace("PHASE", 99)
    assert phases == [4] * 77 + [5] * 4 + [6] * 16 + [7] + [0]
    assert (bench.seen("COMMAND_POSITION"), bench.get("DECEL_POSITION")) == (1003, 893)


@pytest.mark.spec("MCP-SCV-2")
def test_an_s_curve_backwards_is_the_mirror_image(bench: Bench) -> None:
    prepare(bench, -1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 8) == [0, 0, -1, -2, -4, -6, -9, -12]
    assert run(bench)[-1] == -1000
    assert bench.seen("DECEL_POSITION") == -890


@pytest.mark.spec("MCP-SCV-5", "MCP-TRP-8")
def test_the_last_sample_of_an_s_curve_accelerates_or_decelerates_as_any_other(
    bench: Bench,
) -> None:
    prepare(bench, 1, velocity=10, accel=0x500, jerk=0xFFFF)
    start(bench)
    assert run(bench) == [0, 1]
    assert (bench.get("ACCEL_DELTA"), bench.get("DECEL_POSITION")) == (1, 0)
    # Velocities 1/6, 1/3, 1/3, 1/6: 100 and 5/6 is where the last one begins.
    bench.put("COMMAND_POSITION", 100)
    bench.put("FINAL_POSITION", 101)
    bench.put("ACCELERATION", 0x40)
    bench.put("JERK", 0x8000)
    start(bench)
    assert run(bench) == [100, 100, 100, 101]
    assert (bench.get("ACCEL_DELTA"), bench.get("DECEL_POSITION")) == (0, 100)


@pytest.mark.spec("MCP-SCV-6", "MCP-TRP-4")
def test_a_change_between_trapezoid_and_s_curve_begins_the_move_anew(bench: Bench) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    assert bench.trace("COMMAND_POSITION", 5) == [0, 0, 1, 2, 4]
    # A trapezoid goes on at the velocity it finds, here 1.75; an S-curve begins at rest.
    bench.write(0x01, 0x00)
    assert bench.trace("COMMAND_POSITION", 3) == [6, 9, 12]
    assert (bench.seen("PHASE"), bench.get("ACCEL_DELTA")) == (2, 8)
    bench.write(0x01, 0x10)
    assert bench.trace("COMMAND_POSITION", 5) == [12, 12, 13, 14, 16]
    assert (bench.seen("PHASE"), bench.get("ACCEL_DELTA")) == (2, 4)
    bench.write(0x01, 0x00)
    bench.samples()
    bench.put("JERK", 0)
    bench.write(0x01, 0x10)
    bench.samples(2)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG"), bench.seen("PHASE")) == (18, 5, 0)
    bench.write(0x28, 0)
    bench.write(0x01, 0x00)
    bench.samples(2)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG"), bench.seen("PHASE")) == (18, 5, 0)


@pytest.mark.spec("MCP-SCV-5", "MCP-TRP-6", "MCP-EXC-2")
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("forced", [False, True])
def test_an_s_curve_stops_from_its_velocity_cut_down(bench: Bench, forced: bool, sign: int) -> None:
    # Faster by 96 / 158 / 157, which is 0.99 / 256, in each sample.
    prepare(bench, 96 * sign, velocity=20, accel=1, jerk=0x5EE2)
    start(bench)
    bench.samples(4)
    if forced:
        bench.put("FORCED_EXCEPTION", 2)
    else:
        bench.put("FINAL_POSITION", 22 * sign & 0xFFFFFF)
    # Velocity 3.96 / 256, of which the stop makes 2, 1 and 0.
    assert [value & 5 for value in bench.trace("FLAG", 3)] == [5, 5, 0]
    assert bench.seen("COMMAND_POSITION") == (0 if sign > 0 else -1)


@pytest.mark.spec("MCP-SCV-4")
@pytest.mark.parametrize(("velocity", "accel", "jerk"), [(0, 1, 1), (1, 0, 1), (1, 1, 0)])
def test_an_s_curve_needs_jerk_acceleration_and_velocity(
    bench: Bench, velocity: int, accel: int, jerk: int
) -> None:
    prepare(bench, 1000, velocity, accel, jerk)
    start(bench)
    bench.samples(5)
    assert (bench.seen("FLAG"), bench.seen("COMMAND_POSITION")) == (0x05, 0)


@pytest.mark.spec("MCP-SCV-5")
@pytest.mark.parametrize("sample", [2, 10, 22, 60])
def test_an_s_curve_can_be_lengthened_until_it_decelerates(bench: Bench, sample: int) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    bench.samples(sample)
    bench.put("FINAL_POSITION", 1203)
    course = run(bench)
    assert course[-1] == 1203
    assert max(b - a for a, b in pairwise(course)) <= 10


@pytest.mark.spec("MCP-SCV-5", "MCP-POS-2")
@pytest.mark.parametrize(("final", "here"), [(0x7FF000, 1000), (-0x7FF000, -1000)])
def test_an_s_curve_can_be_lengthened_by_half_the_range(
    bench: Bench, final: int, here: int
) -> None:
    prepare(bench, here, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    bench.samples(40)
    bench.put("FINAL_POSITION", final & 0xFFFFFF)
    bench.samples(200)
    assert (bench.seen("PHASE"), bench.seen("FLAG") & 1) == (4, 1)


@pytest.mark.spec("MCP-SCV-5")
def test_an_s_curve_can_be_shortened_only_at_its_top_velocity(bench: Bench) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    bench.samples(40)
    here = bench.seen("COMMAND_POSITION")
    assert bench.seen("PHASE") == 4
    bench.put("FINAL_POSITION", here + 110)
    assert run(bench)[-1] == here + 110


@pytest.mark.spec("MCP-SCV-5", "MCP-TRP-6")
@pytest.mark.parametrize(("sample", "final"), [(40, 109), (40, -50), (10, 700)])
def test_an_s_curve_that_cannot_be_shortened_stops_with_its_acceleration(
    bench: Bench, sample: int, final: int
) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0x2000)
    start(bench)
    bench.samples(sample)
    here = bench.seen("COMMAND_POSITION")
    bench.put("FINAL_POSITION", (here + final) & 0xFFFFFF)
    course = [here, *run(bench)]
    steps = [b - a for a, b in pairwise(course)]
    assert all(b <= a + 1 for a, b in pairwise(steps))
    assert steps[-1] == 0
    speed = 10 if sample == 40 else (30 - 0) / 12
    assert abs((course[-1] - here) - speed * speed) < 12


@pytest.mark.spec("MCP-SCV-6")
def test_with_the_largest_jerk_an_s_curve_is_nearly_the_trapezoid(bench: Bench) -> None:
    prepare(bench, 1000, velocity=10, accel=0x80, jerk=0xFFFF)
    start(bench)
    course = run(bench)
    assert course[-1] == 1000
    other = Bench()
    prepare(other, 1000, velocity=10, accel=0x80)
    start(other)
    assert abs(len(run(other)) - len(course)) <= 2


@pytest.mark.spec("MCP-SCV-1", "MCP-SCV-3", "MCP-TRP-2")
@settings(max_examples=40, deadline=None)
@given(
    final=st.integers(-3000, 3000),
    velocity=st.integers(1, 127),
    accel=st.integers(1, 0x7FFF),
    jerk=st.one_of(st.none(), st.integers(16, 0xFFFF)),
)
def test_every_move_lands_exactly_and_keeps_its_limits(
    final: int, velocity: int, accel: int, jerk: int | None
) -> None:
    bench = Bench()
    # Short samples, so that many fit into the test.
    bench.put("SAMPLE_TIMER", 39)
    accel = max(accel, abs(final) // 100)
    prepare(bench, final, velocity, accel, jerk)
    start(bench)
    command = bench.probe
    place = speed = 0
    for _ in range(20_000):
        bench.samples(1)
        moved = bench.seen("COMMAND_POSITION") - place
        place += moved
        assert abs(moved) <= velocity + 1
        assert abs(command.command_velocity) <= velocity << 8
        if jerk is None:
            assert abs(command.command_velocity - speed) <= accel
        speed = command.command_velocity
        if not bench.seen("FLAG") & 1:
            break
    assert bench.seen("COMMAND_POSITION") == final
    assert bench.seen("PHASE") == 0
