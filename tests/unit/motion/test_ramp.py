"""The velocity ramp."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.chips.motion.trapezoid import toward


def ramp(velocity: int, goal: int, accel: int, start: int = 0) -> list[int]:
    """Every velocity until the goal is reached."""
    velocities = []
    while velocity != goal:
        velocity = toward(velocity, goal, accel, start)
        velocities.append(velocity)
        assert len(velocities) < 1000
    return velocities


@pytest.mark.spec("LM-TRJ-13", "MCP-VEL-1", "PMD-TRJ-6")
@pytest.mark.parametrize(
    ("velocity", "goal", "accel", "course"),
    [
        (0, 10, 4, [4, 8, 10]),
        (0, -10, 4, [-4, -8, -10]),
        (10, 3, 4, [6, 3]),
        (5, -5, 4, [1, -3, -5]),
        (-9, 0, 4, [-5, -1, 0]),
        (7, 7, 4, []),
    ],
)
def test_the_velocity_goes_to_the_goal_by_at_most_the_acceleration(velocity, goal, accel, course):
    assert ramp(velocity, goal, accel) == course


@pytest.mark.spec("MCP-T-12", "MCP-VEL-1")
def test_a_reversed_goal_takes_the_printed_course():
    velocity = position = 0
    course = []
    for sample in range(1, 21):
        velocity = toward(velocity, (3 if sample < 11 else -2) << 8, 0x80)
        position += velocity
        course.append(position >> 8)
    assert course == [
        0, 1, 3, 5, 7, 10, 13, 16, 19, 22, 25, 27, 28, 29, 30, 30, 29, 28, 27, 25,
    ]  # fmt: skip


@pytest.mark.spec("PMD-TRJ-6")
@pytest.mark.parametrize(
    ("velocity", "goal", "course"),
    [
        (0, 50, [20, 28, 36, 44, 50]),
        (0, -50, [-20, -28, -36, -44, -50]),
        (0, 10, [10]),
        (36, -30, [28, 20, 0, -20, -28, -30]),
        (-36, 30, [-28, -20, 0, 20, 28, 30]),
        (36, 0, [28, 20, 0]),
        (36, 22, [28, 22]),
        (36, 10, [28, 20, 12, 10]),
    ],
)
def test_with_a_start_velocity_it_jumps_from_rest_and_rests_while_reversing(velocity, goal, course):
    assert ramp(velocity, goal, 8, 20) == course


@pytest.mark.spec("MCP-VEL-4", "PMD-TRJ-6")
@pytest.mark.parametrize("start", [0, 20])
@pytest.mark.parametrize("velocity", [-30, 0, 30])
def test_without_acceleration_the_velocity_is_constant(velocity, start):
    assert toward(velocity, 100, 0, start) == velocity


@pytest.mark.spec("LM-TRJ-13", "MCP-VEL-1")
@given(
    velocity=st.integers(-(1 << 31), 1 << 31),
    goal=st.integers(-(1 << 31), 1 << 31),
    accel=st.integers(1, 1 << 31),
)
def test_each_step_is_within_the_acceleration_and_never_beyond_the_goal(velocity, goal, accel):
    step = toward(velocity, goal, accel)
    assert abs(step - velocity) <= accel
    assert min(velocity, goal) <= step <= max(velocity, goal)
    assert step == goal or abs(step - velocity) == accel
