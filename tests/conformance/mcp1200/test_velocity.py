"""Integral velocity (MCP-VEL), position and velocity interpolation (MCP-INT)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mcp1200.conftest import Bench
from vbus.core.signals import HIGH


def velocity_mode(bench: Bench, accel: int = 0x80, goal: int = 0) -> None:
    bench.put("ACCELERATION", accel)
    bench.put("VELOCITY_COMMAND", goal & 0xFF)
    bench.write(0x00, 0x0D)
    bench.control()


@pytest.mark.spec("MCP-VEL-1", "MCP-T-12")
def test_velocity_ramps_to_a_goal_that_may_change_at_any_time(bench: Bench) -> None:
    velocity_mode(bench, goal=3)
    course = bench.trace("COMMAND_POSITION", 10)
    bench.put("VELOCITY_COMMAND", 0xFE)
    course += bench.trace("COMMAND_POSITION", 10)
    assert course == [
        0, 1, 3, 5, 7, 10, 13, 16, 19, 22, 25, 27, 28, 29, 30, 30, 29, 28, 27, 25,
    ]  # fmt: skip


@pytest.mark.spec("MCP-VEL-1")
@pytest.mark.parametrize("bit", [0, 1, 2, 3, 4, 6, 7])
def test_only_high_resolution_makes_the_velocity_register_the_goal(bench: Bench, bit: int) -> None:
    bench.write(0x01, 1 << bit)
    bench.put("VELOCITY", 0x000900)
    velocity_mode(bench, accel=0x7FFF, goal=3)
    assert bench.trace("COMMAND_POSITION", 3) == [3, 6, 9]


@pytest.mark.spec("MCP-VEL-1")
def test_velocity_with_a_fraction(bench: Bench) -> None:
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", 0xFFFEC0)
    velocity_mode(bench, accel=0x7FFF, goal=99)
    # -1.25 counts a sample.
    assert bench.trace("COMMAND_POSITION", 5) == [-2, -3, -4, -5, -7]
    bench.put("VELOCITY", 0x000140)
    assert bench.trace("COMMAND_POSITION", 2) == [-5, -4]


@pytest.mark.spec("MCP-VEL-1", "MCP-POS-2")
@pytest.mark.parametrize(
    ("start", "goal", "course"),
    [(0x7FFFFC, 0x0001C0, (0x7FFFFD, 0x7FFFFF, -0x7FFFFF, -0x7FFFFD)),
     (-0x7FFFFD, 0xFFFE40, (-0x7FFFFF, 0x7FFFFF, 0x7FFFFD, 0x7FFFFC))],
)  # fmt: skip
def test_velocity_goes_on_at_the_other_end_of_the_range(
    bench: Bench, start: int, goal: int, course: tuple[int, ...]
) -> None:
    bench.write(0x01, 0x20)
    bench.put("COMMAND_POSITION", start & 0xFFFFFF)
    bench.put("VELOCITY", goal)
    velocity_mode(bench, accel=0x7FFF)
    # 1.75 counts a sample.
    assert tuple(bench.trace("COMMAND_POSITION", 4)) == course


@pytest.mark.spec("MCP-VEL-1")
def test_acceleration_may_change_under_way(bench: Bench) -> None:
    velocity_mode(bench, accel=0x0100, goal=100)
    assert bench.trace("COMMAND_POSITION", 3) == [1, 3, 6]
    bench.put("ACCELERATION", 0x0A00)
    assert bench.trace("COMMAND_POSITION", 2) == [19, 42]


@pytest.mark.spec("MCP-VEL-1", "MCP-REG-25")
@pytest.mark.parametrize("bit", range(16))
def test_each_bit_of_the_acceleration_counts_but_the_sixteenth(bench: Bench, bit: int) -> None:
    for accel in (1 << bit, 0x7FFF ^ 1 << bit):
        bench.write(0x00, 0x05)
        bench.samples(1)
        velocity_mode(bench, accel=accel & 0xFFFF, goal=127)
        command = bench.probe
        before = command.command_velocity
        bench.samples(1)
        assert command.command_velocity - before == min(accel & 0x7FFF, (127 << 8) - before)


@pytest.mark.spec("MCP-VEL-2")
@pytest.mark.parametrize(
    ("first", "second", "told"), [(64, -63, False), (64, -64, True), (-64, 63, False)]
)
def test_goals_more_than_seven_bits_apart_are_reported_and_followed(
    bench: Bench, first: int, second: int, told: bool
) -> None:
    velocity_mode(bench, accel=0x7F00, goal=first)
    bench.samples(3)
    bench.put("VELOCITY_COMMAND", second & 0xFF)
    before = bench.seen("COMMAND_POSITION")
    bench.samples(3)
    assert bench.rules() == (["goal-step"] if told else [])
    if told:
        assert (bench.violations[0].measured, bench.violations[0].limit) == (128, 127)
    # 127 less in the first sample, then the goal.
    speeds = [first - 127 if told else second, second, second]
    assert bench.seen("COMMAND_POSITION") - before == sum(speeds)


@pytest.mark.spec("MCP-VEL-2")
@pytest.mark.parametrize(("second", "told"), [(0x800100, False), (0x800000, True)])
def test_high_resolution_goals_may_be_15_bits_apart(bench: Bench, second: int, told: bool) -> None:
    bench.write(0x01, 0x20)
    velocity_mode(bench)
    bench.samples(2)
    bench.put("VELOCITY", second)
    bench.samples(1)
    found = [(it.rule, it.measured, it.limit) for it in bench.violations]
    assert found == [("mcp1200.goal-step", 32768, 32767)] * told


@pytest.mark.spec("MCP-VEL-3")
def test_clearing_the_flag_under_way_holds_the_present_command(bench: Bench) -> None:
    velocity_mode(bench, accel=0x7F00, goal=50)
    bench.samples(3)
    here = bench.seen("COMMAND_POSITION")
    bench.write(0x00, 0x05)
    assert bench.trace("COMMAND_POSITION", 3) == [here] * 3
    bench.put("ACCELERATION", 0x0100)
    bench.write(0x00, 0x0D)
    assert bench.trace("COMMAND_POSITION", 2) == [here + 1, here + 3]


@pytest.mark.spec("MCP-VEL-4")
@pytest.mark.parametrize("fraction", [False, True])
@pytest.mark.parametrize("goal", [20, 5, 2, 0, -2, -5, -20])
@pytest.mark.parametrize("speed", [5, 0, -5])
def test_without_acceleration_the_velocity_stays(
    bench: Bench, speed: int, goal: int, fraction: bool
) -> None:
    def ask(velocity: int) -> None:
        if fraction:
            bench.put("VELOCITY", velocity << 8 & 0xFFFFFF)
        else:
            bench.put("VELOCITY_COMMAND", velocity & 0xFF)

    bench.write(0x01, 0x20 if fraction else 0)
    ask(speed)
    bench.put("ACCELERATION", 0x0500)
    bench.write(0x00, 0x0D)
    bench.control()
    bench.samples(1)
    bench.put("ACCELERATION", 0)
    ask(goal)
    assert bench.trace("COMMAND_POSITION", 6) == [speed * n for n in range(2, 8)]
    bench.put("ACCELERATION", 0x0100)
    step = (goal > speed) - (goal < speed)
    assert bench.trace("COMMAND_POSITION", 1) == [speed * 8 + step]
    assert bench.rules() == []


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(-127, 127), st.integers(0, 0x7FFF)), min_size=1, max_size=6))
def test_velocity_never_changes_by_more_than_the_acceleration(
    goals: list[tuple[int, int]],
) -> None:
    bench = Bench()
    velocity_mode(bench)
    speed = 0
    command = bench.probe
    for goal, accel in goals:
        bench.put("VELOCITY_COMMAND", goal & 0xFF)
        bench.put("ACCELERATION", accel)
        for _ in range(4):
            bench.samples(1)
            assert abs(command.command_velocity - speed) <= accel
            speed = command.command_velocity
        bench.put("ACCELERATION", 0x7FFF)
        bench.samples(2)
        speed = command.command_velocity
        assert speed == goal << 8


# -- interpolation --------------------------------------------------------------------------------


def points(bench: Bench, first: int, preset: int = 2) -> None:
    """Position interpolation with a first point."""
    bench.put("INTERPOLATOR_PRESET", preset)
    bench.put("FINAL_POSITION", first & 0xFFFFFF)
    bench.write(0x00, 0x0B)
    bench.control()


@pytest.mark.spec("MCP-INT-1", "MCP-T-13")
def test_eight_samples_to_the_first_point(bench: Bench) -> None:
    points(bench, 100)
    assert bench.trace("COMMAND_POSITION", 9) == [12, 25, 37, 50, 62, 75, 87, 100, 100]


@pytest.mark.spec("MCP-INT-1", "MCP-REG-18")
@pytest.mark.parametrize(("preset", "samples"), [(0, 2), (1, 4), (6, 128), (7, 256), (0xFA, 8)])
def test_the_length_of_a_segment(bench: Bench, preset: int, samples: int) -> None:
    points(bench, samples, preset)
    assert bench.trace("COMMAND_POSITION", samples + 1) == [*range(1, samples + 1), samples]


@pytest.mark.spec("MCP-INT-1")
def test_backwards_points_and_points_across_the_end_of_the_range(bench: Bench) -> None:
    bench.put("COMMAND_POSITION", 0x7FFFFE)
    points(bench, -0x7FFFFE, 1)
    assert bench.trace("COMMAND_POSITION", 4) == [0x7FFFFF, -0x800000, -0x7FFFFF, -0x7FFFFE]
    bench.put("FINAL_POSITION", 0x7FFFFF)
    assert bench.trace("COMMAND_POSITION", 4) == [-0x7FFFFF, -0x800000, 0x7FFFFF, 0x7FFFFF]
    bench.samples(1)
    assert (bench.seen("INTERPOLATOR_COUNT"), bench.seen("FLAG")) == (0, 0x08)


@pytest.mark.spec("MCP-INT-2", "MCP-REG-27")
def test_the_busy_latch_is_set_by_the_host_and_cleared_by_the_core(bench: Bench) -> None:
    points(bench, 100)
    assert bench.read(0x03) & 0x80
    bench.samples(1)
    assert not bench.read(0x03) & 0x80
    bench.write(0x2B, 0)
    bench.write(0x2A, 0)
    assert not bench.read(0x03) & 0x80
    bench.write(0x29, 200)
    assert bench.read(0x03) & 0x80
    bench.samples(7)
    assert bench.read(0x03) & 0x80
    bench.samples(1)
    assert not bench.read(0x03) & 0x80
    assert bench.trace("COMMAND_POSITION", 7)[-1] == 200


@pytest.mark.spec("MCP-INT-2")
def test_the_point_is_what_the_registers_held_when_their_lsb_was_written(bench: Bench) -> None:
    points(bench, 100, 1)
    bench.samples(1)
    bench.put("FINAL_POSITION", 0x000200)
    bench.write(0x2A, 0x77)
    bench.samples(7)
    assert bench.seen("COMMAND_POSITION") == 0x200


@pytest.mark.spec("MCP-INT-2", "MCP-INT-4")
@pytest.mark.parametrize(
    ("register", "byte", "way"), [(0x2A, 0x01, 64), (0x2B, 0x01, 0x4000), (0x2B, 0xFF, -0x4000)]
)
def test_one_byte_of_the_final_position_moves_an_axis_that_waits(
    bench: Bench, register: int, byte: int, way: int
) -> None:
    points(bench, 200, 1)
    bench.samples(6)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("INTERPOLATOR_COUNT")) == (200, 0)
    bench.write(register, byte)
    assert not bench.read(0x03) & 0x80
    course = [200 + way * part for part in (1, 2, 3, 4, 4)]
    assert bench.trace("COMMAND_POSITION", 5) == course
    assert (bench.seen("INTERPOLATOR_COUNT"), bench.seen("FLAG")) == (0, 0x08)


@pytest.mark.spec("MCP-INT-2", "MCP-INT-4")
def test_at_a_segment_s_end_the_registers_count_as_they_stand(bench: Bench) -> None:
    points(bench, 100, 1)
    bench.samples(1)
    # Taken: the latch is clear. Two bytes of a point that is never finished.
    bench.write(0x2B, 0)
    bench.write(0x2A, 1)
    assert not bench.read(0x03) & 0x80
    assert bench.trace("COMMAND_POSITION", 3) == [50, 75, 100]
    # 0x0164, from 100: 64 counts a sample.
    assert bench.trace("COMMAND_POSITION", 2) == [164, 228]
    bench.put("FINAL_POSITION", 400)
    assert bench.read(0x03) & 0x80
    assert bench.trace("COMMAND_POSITION", 2) == [292, 356]
    # The captured point comes first, what stands in the registers by then after it.
    bench.write(0x29, 360 & 0xFF)
    bench.write(0x2A, 0x02)
    assert bench.trace("COMMAND_POSITION", 4) == [357, 358, 359, 360]
    assert bench.trace("COMMAND_POSITION", 5) == [424, 488, 552, 616, 616]


def during_busy(bench: Bench, name: str, value: int) -> None:
    """Write a register while the core computes the coming sample, and let it finish."""
    bench.until(bench.sample_start() + 20)
    assert bench.pin("BUSY") == 1
    bench.put(name, value)
    bench.wait(2000)
    assert bench.pin("BUSY") == 0


@pytest.mark.spec("MCP-INT-2")
def test_a_point_written_while_a_segment_begins_from_the_registers_keeps_its_latch(
    bench: Bench,
) -> None:
    points(bench, 100, 0)
    bench.samples(4)
    bench.write(0x2A, 1)
    during_busy(bench, "FINAL_POSITION", 500)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x03) & 0x80) == (228, 0x80)
    assert bench.trace("COMMAND_POSITION", 4) == [356, 428, 500, 500]


@pytest.mark.spec("MCP-INT-2", "MCP-REG-24")
def test_a_velocity_written_while_a_ramp_begins_from_the_registers_keeps_its_latch(
    bench: Bench,
) -> None:
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.write(0x00, 0x0C)
    bench.control()
    bench.samples(4)
    bench.write(0x24, 4)
    during_busy(bench, "VELOCITY", 0x000800)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x03) & 0x80) == (2, 0x80)
    assert bench.trace("COMMAND_POSITION", 4) == [6, 12, 20, 28]


@pytest.mark.spec("MCP-INT-2", "MCP-INT-4", "MCP-INT-5")
def test_one_byte_of_the_velocity_begins_a_ramp_of_an_axis_that_keeps_its_velocity(
    bench: Bench,
) -> None:
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.put("VELOCITY", 0x000400)
    bench.write(0x00, 0x0C)
    bench.control()
    bench.samples(4)
    command = bench.probe
    assert command.command_velocity == 0x400
    bench.write(0x24, 0x08)
    assert not bench.read(0x03) & 0x80
    speeds = []
    for _ in range(3):
        bench.samples(1)
        speeds.append(command.command_velocity)
    assert speeds == [0x600, 0x800, 0x800]
    # With the latch set, what was captured; after it what stands in the registers.
    bench.write(0x25, 0x00)
    bench.write(0x24, 0x04)
    assert bench.read(0x03) & 0x80
    speeds = []
    for _ in range(4):
        bench.samples(1)
        speeds.append(command.command_velocity)
    assert speeds == [0x800, 0x800, 0x600, 0x400]


@pytest.mark.spec("MCP-INT-2")
def test_r25_does_not_set_the_latch_in_position_interpolation_nor_r29_in_the_other(
    bench: Bench,
) -> None:
    points(bench, 0, 0)
    bench.samples(3)
    bench.write(0x25, 0)
    assert not bench.read(0x03) & 0x80
    bench.write(0x00, 0x03)
    bench.write(0x00, 0x0C)
    bench.samples(3)
    bench.write(0x29, 0)
    assert not bench.read(0x03) & 0x80
    bench.write(0x25, 0)
    assert bench.read(0x03) & 0x80


@pytest.mark.spec("MCP-INT-3")
def test_the_first_segment_takes_the_registers_as_they_are(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 0x000100)
    bench.control()
    bench.samples(1)
    bench.write(0x2A, 0x02)
    bench.write(0x18, 0)
    bench.write(0x00, 0x0B)
    assert bench.trace("COMMAND_POSITION", 2) == [0x100, 0x200]


@pytest.mark.spec("MCP-INT-3")
def test_r18_is_read_at_each_segment_start(bench: Bench) -> None:
    points(bench, 80, 1)
    bench.samples(1)
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.put("FINAL_POSITION", 100)
    assert bench.trace("COMMAND_POSITION", 5) == [40, 60, 80, 90, 100]


@pytest.mark.spec("MCP-INT-4", "MCP-REG-19", "MCP-FLG-4")
def test_the_count_down_and_the_hold(bench: Bench) -> None:
    points(bench, 40, 1)
    counts = []
    for _ in range(6):
        bench.samples(1)
        counts.append((bench.seen("INTERPOLATOR_COUNT"), bench.seen("FLAG") & 4))
    assert counts == [(4, 4), (3, 4), (2, 4), (1, 4), (0, 0), (0, 0)]
    assert bench.seen("COMMAND_POSITION") == 40
    bench.put("FINAL_POSITION", 50)
    assert bench.trace("COMMAND_POSITION", 4) == [42, 45, 47, 50]


@pytest.mark.spec("MCP-INT-5", "MCP-T-14")
def test_velocity_interpolation_ramps_evenly(bench: Bench) -> None:
    bench.put("INTERPOLATOR_PRESET", 2)
    bench.put("VELOCITY", 0x000400)
    bench.write(0x00, 0x0C)
    bench.control()
    speeds, course = [], []
    for _ in range(8):
        bench.samples(1)
        speeds.append(bench.probe.command_velocity)
        course.append(bench.seen("COMMAND_POSITION"))
    assert speeds == [0x80 * k for k in range(1, 9)]
    assert course == [0, 1, 3, 5, 7, 10, 14, 18]


@pytest.mark.spec("MCP-INT-4", "MCP-INT-5")
def test_velocity_interpolation_keeps_the_last_velocity(bench: Bench) -> None:
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.put("VELOCITY", 0x000400)
    bench.write(0x00, 0x0C)
    bench.control()
    assert bench.trace("COMMAND_POSITION", 5) == [2, 6, 10, 14, 18]
    assert bench.seen("INTERPOLATOR_COUNT") == 0
    bench.put("VELOCITY", 0xFFFC00)
    assert bench.trace("COMMAND_POSITION", 3) == [18, 14, 10]


@pytest.mark.spec("MCP-FLG-4", "MCP-FLG-5", "MCP-INT-4")
def test_prof_shows_motion_as_long_as_a_held_velocity_is_not_zero(bench: Bench) -> None:
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.put("VELOCITY", 0x000400)
    bench.write(0x00, 0x0C)
    bench.control()
    bench.samples(5)
    assert (bench.seen("INTERPOLATOR_COUNT"), bench.seen("FLAG"), bench.pin("PROF")) == (0, 0x14, 1)
    bench.put("VELOCITY", 0)
    bench.samples(2)
    assert (bench.seen("FLAG"), bench.pin("PROF")) == (0x14, 1)
    bench.samples(1)
    assert (bench.seen("FLAG"), bench.pin("PROF")) == (0x10, 0)


@pytest.mark.spec("MCP-INT-6")
@pytest.mark.parametrize(
    ("name", "value", "code"), [("FINAL_POSITION", 80, 3), ("VELOCITY", 0x1400, 4)]
)
def test_leaving_interpolation_holds_the_present_command(
    bench: Bench, name: str, value: int, code: int
) -> None:
    bench.put("INTERPOLATOR_PRESET", 1)
    bench.put(name, value)
    bench.write(0x00, 8 | code)
    bench.control()
    bench.samples(2)
    here = bench.seen("COMMAND_POSITION")
    assert here > 0
    bench.write(0x00, code)
    assert bench.trace("COMMAND_POSITION", 2) == [here, here]
    assert (bench.seen("INTERPOLATOR_COUNT"), bench.seen("FLAG")) == (0, 0)


@pytest.mark.spec("MCP-INT-2", "MCP-INT-4", "MCP-T-13")
def test_a_host_that_waits_for_the_latch_feeds_a_smooth_path(bench: Bench) -> None:
    """The manual's handshake: write a point whenever R03 bit 7 is clear."""
    points(bench, 10, 1)
    course: list[int] = []
    target = 10
    for _ in range(20):
        bench.samples(1)
        course.append(bench.seen("COMMAND_POSITION"))
        if not bench.read(0x03) & 0x80:
            target += 10
            bench.put("FINAL_POSITION", target)
    assert course == [10 * (k // 4) + (10 * (k % 4)) // 4 for k in range(1, 21)]
    assert bench.pin("PROF") == HIGH


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(-5000, 5000), st.integers(0, 3)), min_size=1, max_size=5))
def test_every_segment_ends_exactly_on_its_point(path: list[tuple[int, int]]) -> None:
    bench = Bench()
    points(bench, path[0][0], path[0][1])
    for place, (target, preset) in enumerate(path):
        bench.samples(1)
        if place + 1 < len(path):
            bench.put("INTERPOLATOR_PRESET", path[place + 1][1])
            bench.put("FINAL_POSITION", path[place + 1][0] & 0xFFFFFF)
        bench.samples((2 << preset) - 1)
        assert bench.seen("COMMAND_POSITION") == target
