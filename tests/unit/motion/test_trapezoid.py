"""The trapezoid step: the manuals' worked moves, the closed form, and what every move keeps."""

from math import isqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.chips.motion.trapezoid import arrived, next_velocity, stopping_distance


def move(
    target: int, top: int, accel: int, start: int = 0, position: int = 0, velocity: int = 0
) -> tuple[list[int], list[int]]:
    """Run a move until it has arrived; return positions and velocities sample by sample."""
    positions, velocities = [], []
    while True:
        velocity = next_velocity(target - position, velocity, top, accel, start)
        position += velocity
        positions.append(position)
        velocities.append(velocity)
        if arrived(target - position, velocity, accel, start):
            return positions, velocities
        assert len(positions) < 100_000, "the move does not end"


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
def test_a_short_move_takes_the_printed_course():
    positions, _ = move(20 << 16, 4 << 16, 1 << 16)
    assert [p >> 16 for p in positions] == [1, 3, 6, 10, 14, 17, 19, 20]


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
def test_a_move_that_does_not_divide_evenly_spreads_the_rest_over_the_deceleration():
    positions, velocities = move(11 << 16, 0x28000, 0x8000)
    assert velocities == [
        0x8000, 0x10000, 0x18000, 0x20000, 0x23333, 0x1B333, 0x13333, 0xB333, 0x3334,
    ]  # fmt: skip
    assert [p >> 16 for p in positions] == [0, 1, 3, 5, 7, 8, 10, 10, 11]


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
@pytest.mark.parametrize(("velocity", "over"), [(10, True), (11, False), (-10, True), (-11, False)])
def test_a_move_is_over_on_its_target_if_one_acceleration_stops_it(velocity: int, over: bool):
    assert arrived(0, velocity, 10) is over
    assert not arrived(1, velocity, 10)
    assert arrived(0, velocity + (2 if velocity > 0 else -2), 10, 2) is over


@pytest.mark.spec("MCP-TRP-2")
def test_a_move_of_100_revolutions_peaks_halfway():
    positions, velocities = move(200_000 << 16, 0x6D1EC, 15)
    assert max(velocities) == 443_400 == 0x6C408
    assert velocities.index(443_400) == 29_560 - 1
    assert positions[29_560 - 1] >> 16 == 100_001
    assert len(positions) == 59_120
    assert positions[-1] == 200_000 << 16


@pytest.mark.spec("MCP-T-10", "MCP-TRP-2")
def test_an_mcp1200_move_in_eighths_of_a_byte_takes_the_printed_course():
    positions, _ = move(100 << 8, 10 << 8, 0x180)
    assert [p >> 8 for p in positions] == [
        1, 4, 9, 15, 22, 31, 41, 51, 61, 71, 80, 87, 92, 96, 99, 100,
    ]  # fmt: skip


@pytest.mark.spec("PMD-T-9", "PMD-TRJ-2")
@pytest.mark.parametrize(
    ("target", "top", "start", "course"),
    [
        (20, 4, 0, [1, 3, 6, 10, 14, 17, 19, 20]),
        (30, 5, 2, [2, 5, 9, 14, 19, 23, 27, 30]),
    ],
)
def test_a_pmd_move_with_and_without_start_velocity_takes_the_printed_course(
    target, top, start, course
):
    positions, _ = move(target << 16, top << 16, 1 << 16, start << 16)
    assert [p >> 16 for p in positions] == course


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
def test_backward_moves_mirror_forward_moves():
    forward, _ = move(11 << 16, 0x28000, 0x8000)
    backward, _ = move(-(11 << 16), 0x28000, 0x8000)
    assert backward == [-p for p in forward]


@pytest.mark.spec("MCP-TRP-5")
def test_a_move_to_where_it_stands_is_over_in_its_first_sample():
    assert move(0, 1000, 10) == ([0], [0])


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
@pytest.mark.parametrize(("slowness", "start"), [((), 0), ((3,), 3)])
def test_a_move_is_over_on_the_target_and_within_one_acceleration_of_rest(slowness, start):
    for sign in (1, -1):
        assert arrived(0, sign * (10 + start), 10, *slowness)
        assert not arrived(0, sign * (11 + start), 10, *slowness)
        assert not arrived(sign, 0, 10, *slowness)


@pytest.mark.spec("MCP-TRP-2")
def test_on_the_target_but_too_fast_it_passes_through_and_comes_back():
    assert next_velocity(0, 50, 100, 10) == 40
    assert next_velocity(0, -50, 100, 10) == -40
    positions, _ = move(0, 100, 10, velocity=50)
    assert max(positions) == 100
    assert positions[-1] == 0


@pytest.mark.spec("MCP-TRP-2")
def test_without_acceleration_the_velocity_stays():
    assert next_velocity(1000, -7, 100, 0) == -7
    assert next_velocity(0, 5, 100, 0, 3) == 5


@pytest.mark.spec("MCP-TRP-2")
def test_an_acceleration_above_the_top_velocity_reaches_it_in_one_sample():
    assert move(35, 10, 400)[1] == [10, 10, 10, 5]


@pytest.mark.spec("PMD-ERR-4")
def test_a_start_velocity_above_the_top_velocity_starts_at_the_top_velocity():
    assert next_velocity(1000, 0, 10, 3, 40) == 10


@pytest.mark.spec("PMD-TRJ-2")
def test_with_a_start_velocity_a_reversal_rests_one_sample():
    assert next_velocity(1000, -25, 100, 10, 20) == 0
    assert next_velocity(1000, 0, 100, 10, 20) == 20


@pytest.mark.spec("PMD-TRJ-2")
@pytest.mark.parametrize("sign", [1, -1])
def test_a_reversal_still_runs_at_exactly_the_start_velocity_before_it_rests(sign):
    velocities = [sign * -40]
    for _ in range(4):
        velocities.append(next_velocity(sign * 1000, velocities[-1], 100, 10, 20))
    assert velocities == [sign * v for v in (-40, -30, -20, 0, 20)]


def literal_fastest(r: int, a: int, vs: int) -> int:
    """The formula of PMD-TRJ-2 (with vs = 0: MCP-TRP-2) as it is written there."""
    if r < vs:
        return r
    b = a + 2 * vs
    n = (isqrt(b * b + 8 * a * (r - vs)) - b) // (2 * a)
    s = (r + a * n * (n + 1) // 2) // (n + 1)
    return min(s, vs + (n + 1) * a - 1) if vs > 0 else s


def literal_way(v: int, a: int, vs: int) -> int:
    """The way from the coming sample on, if it has ``v``, until less than ``vs`` would be left."""
    n = max(0, v - vs) // a
    return (n + 1) * v - a * (n * (n + 1) // 2)


def literal_step(remaining: int, v: int, top: int, a: int, vs: int) -> int:
    """The rule of PMD-TRJ-2 (with vs = 0: MCP-TRP-2) as it is written there."""
    d = (remaining > 0) - (remaining < 0) or (v < 0) - (v > 0)
    u, r = v * d, abs(remaining)
    if a == 0:
        return v
    if u < 0:
        u += a
        if vs > 0:
            u = 0 if u > -vs else u
        elif u > 0:
            u = min(u, top, literal_fastest(r, a, vs))
    else:
        up = vs if u == 0 and vs > 0 else u + a
        floor = u - a
        if vs > 0 and floor < vs:
            floor = 0
        u = max(min(top, literal_fastest(r, a, vs), up), floor)
    return u * d


# The bounds within which every number of the step fits a machine word.
WIDE = st.one_of(st.integers(0, (1 << 31) - 1), st.just((1 << 31) - 1))
FARTHEST = 1 << 61
NARROW = st.integers(0, 40)
STARTS = st.one_of(st.just(0), NARROW, WIDE)
SPEEDS = st.one_of(NARROW, WIDE)
SIGNED = st.one_of(st.integers(-60, 60), WIDE, WIDE.map(int.__neg__))
DISTANCES = st.one_of(
    st.integers(-400, 400),
    st.integers(-(1 << 48), 1 << 48),
    st.integers(-FARTHEST, FARTHEST),
    st.sampled_from((-FARTHEST, FARTHEST)),
)


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
@given(remaining=DISTANCES, velocity=SIGNED, top=SPEEDS, accel=SPEEDS, start=STARTS)
def test_the_step_without_square_root_equals_the_rule_with_it(
    remaining, velocity, top, accel, start
):
    assert next_velocity(remaining, velocity, top, accel, start) == literal_step(
        remaining, velocity, top, accel, start
    )


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
@given(
    velocity=st.integers(0, 1 << 30),
    accel=st.integers(1, 1 << 30),
    start=STARTS,
    nudge=st.integers(-3, 3),
)
def test_step_and_rule_agree_where_deceleration_has_to_begin(velocity, accel, start, nudge):
    near = max(0, literal_way(velocity, accel, start) + nudge)
    for top in (velocity, velocity // 2, 1 << 30):
        assert next_velocity(near, velocity, top, accel, start) == literal_step(
            near, velocity, top, accel, start
        )


@pytest.mark.spec("MCP-TRP-2", "PMD-TRJ-2")
@given(r=st.integers(0, 1 << 50), accel=st.integers(1, (1 << 30) - 1), start=STARTS)
def test_the_fastest_speed_can_be_stopped_from_and_one_more_cannot(r, accel, start):
    speed = literal_fastest(r, accel, start)
    assert literal_way(speed, accel, start) <= r
    assert literal_way(speed + 1, accel, start) > r


@pytest.mark.spec("MCP-TRP-6")
@given(velocity=st.integers(0, 3000), accel=st.integers(1, 4000))
def test_the_stopping_distance_is_the_sum_of_all_samples_until_rest(velocity, accel):
    assert stopping_distance(velocity, accel) == sum(range(velocity, 0, -accel))


LEGS = st.lists(
    st.tuples(st.integers(-5000, 5000), st.integers(1, 400), st.integers(0, 60)),
    min_size=1,
    max_size=5,
)


@pytest.mark.spec("MCP-TRP-2")
@given(legs=LEGS, accel=st.integers(1, 90))
def test_every_move_keeps_its_limits_and_lands_exactly_also_after_retargeting(legs, accel):
    position = velocity = 0
    ceiling = 0
    for number, (target, top, samples) in enumerate(legs):
        last = number == len(legs) - 1
        done = False
        while not done and (last or samples > 0):
            samples -= 1
            before = velocity
            velocity = next_velocity(target - position, velocity, top, accel)
            position += velocity
            assert abs(velocity - before) <= accel
            # Faster than the top velocity only while coming down from an older, higher one.
            assert abs(velocity) <= max(top, abs(before) - accel)
            ceiling = max(ceiling, abs(velocity))
            done = arrived(target - position, velocity, accel)
            if done:
                velocity = 0
            assert samples > -20_000, "the move does not end"
    assert position == legs[-1][0]
    assert velocity == 0
    assert ceiling <= max(top for _, top, _ in legs)


@pytest.mark.spec("MCP-TRP-2")
@given(target=st.integers(1, 20_000), top=st.integers(1, 500), accel=st.integers(1, 90))
def test_a_move_from_rest_has_a_single_peak(target, top, accel):
    _, velocities = move(target, top, accel)
    peak = velocities.index(max(velocities))
    assert velocities[: peak + 1] == sorted(velocities[: peak + 1])
    assert velocities[peak:] == sorted(velocities[peak:], reverse=True)


@pytest.mark.spec("PMD-TRJ-2")
@given(legs=LEGS, accel=st.integers(1, 90), start=st.integers(1, 120))
def test_with_a_start_velocity_at_most_two_samples_run_below_it_at_the_end(legs, accel, start):
    position = velocity = 0
    below = 0
    for number, (target, extra, samples) in enumerate(legs):
        top = start + extra
        last = number == len(legs) - 1
        done = False
        while not done and (last or samples > 0):
            samples -= 1
            before = velocity
            velocity = next_velocity(target - position, velocity, top, accel, start)
            position += velocity
            if abs(velocity) >= start and abs(before) >= start:
                assert abs(velocity - before) <= accel
            if last:
                below = below + 1 if abs(velocity) < start and velocity != 0 else 0
                assert below <= 2
            done = arrived(target - position, velocity, accel, start)
            if done:
                velocity = 0
            assert samples > -20_000, "the move does not end"
    assert position == legs[-1][0]
