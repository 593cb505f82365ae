"""The S-curve: the manuals' worked moves, what every move keeps, retargeting and smooth stops."""

from fractions import Fraction
from itertools import accumulate, pairwise
from math import floor

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from vbus.chips.motion.scurve import SCurve
from vbus.core import state


def planned(distance: int, top: int, accel: int, jerk: int) -> SCurve:
    curve = SCurve()
    curve.plan(distance, top, accel, jerk)
    return curve


def mcp(final: int, top: int = 10, accel: int = 1 << 15, jerk: int = 0x2000) -> SCurve:
    """A move in the MCP-1200's unit of 2^-16 count; defaults are those of MCP-T-11."""
    return planned(final << 16, top << 16, accel, jerk)


def pmd(destination: int, top: int = 10, accel: int = 0x2000, jerk: int = 0x0100_0000) -> SCurve:
    """A move in the MC1241A's unit of 2^-32 microstep; defaults are those of PMD-T-10."""
    return planned(destination << 32, top << 32, accel << 16, jerk)


def run(curve: SCurve, samples: int = 1_000_000) -> list[int]:
    """Step until done, at most ``samples`` times; return the offsets."""
    offsets = []
    while not curve.done and len(offsets) < samples:
        offsets.append(curve.step())
    return offsets


def ways(offsets: list[int], before: int = 0) -> list[int]:
    """What each sample moved; ``before`` is the offset before the first of them."""
    return [b - a for a, b in pairwise([before, *offsets])]


@pytest.mark.spec("MCP-T-11", "MCP-SCV-1", "MCP-SCV-2", "MCP-SCV-4", "MCP-SCV-5", "MCP-TRP-8")
def test_an_mcp1200_move_takes_the_printed_course():
    curve = mcp(1000)
    assert (curve.rise, curve.flat, curve.hold) == (4, 16, 76)
    assert 1000 - (curve.deceleration_distance >> 16) == 890
    offsets = run(curve)
    assert [offset >> 16 for offset in offsets[:12]] == [0, 0, 1, 2, 4, 6, 9, 12, 16, 20, 25, 30]
    assert offsets[24 - 1] >> 16 == 130
    assert offsets[24 + 76 - 1] >> 16 == 890
    assert len(offsets) == 122
    assert offsets[-1] == 1000 << 16


@pytest.mark.spec("PMD-T-10", "PMD-TRJ-4")
def test_an_mc1241a_move_takes_the_printed_course():
    curve = pmd(2000)
    assert (curve.rise, curve.flat, curve.hold) == (32, 48, 88)
    seen = []
    for cycle in range(1, 311):
        assert not curve.done
        offset = curve.step()
        if cycle in (32, 80, 112, 200, 232, 280):
            seen.append((offset >> 32, curve.phase))
    assert seen == [(23, 1), (269, 2), (570, 3), (1450, 4), (1746, 5), (1980, 6)]
    assert curve.done
    assert (curve.offset, curve.velocity, curve.phase) == (2000 << 32, 0, 0)


@pytest.mark.spec("PMD-T-10", "PMD-TRJ-4", "MCP-SCV-1")
def test_a_move_too_short_for_its_top_velocity_peaks_lower():
    curve = pmd(1000)
    assert (curve.rise, curve.flat, curve.hold) == (32, 43, 0)
    offsets = run(curve)
    peak = max(ways(offsets))
    assert peak == -(-(1000 << 32) // 107)
    assert offsets[-1] == 1000 << 32


@pytest.mark.spec("PMD-T-10", "MCP-SCV-1")
def test_a_distance_that_is_no_multiple_of_the_top_velocity_takes_one_sample_more():
    curve = pmd(2003)
    assert (curve.rise, curve.flat, curve.hold) == (32, 48, 89)
    offsets = run(curve)
    assert len(offsets) == 311
    assert max(ways(offsets)) == -(-(2003 << 32) // 201)
    ends = (32, 80, 112, 201, 233, 281, 311)
    assert [offsets[cycle - 1] >> 32 for cycle in ends] == [23, 268, 568, 1454, 1750, 1983, 2003]


@pytest.mark.spec("MCP-SCV-1")
def test_what_would_be_left_over_lowers_every_velocity_alike():
    curve = planned(1000, 90, 30, 15)
    assert (curve.rise, curve.flat, curve.hold) == (2, 1, 7)
    # The peak is 1000 / 12, and the acceleration takes 1, 3, 5 and 6 of its six parts.
    course = [13, 55, 125, 208, 291, 375, 458, 541, 625, 708, 791, 875, 944, 986, 1000]
    assert run(curve) == course


@pytest.mark.spec("MCP-SCV-1")
@pytest.mark.parametrize(
    ("move", "shape"),
    [
        # More acceleration than the jerk can reach on the way to the top velocity.
        ((10_000, 100, 12, 1), (10, 0, 80)),
        ((10_000, 101, 12, 1), (11, 0, 78)),
        # Just long enough for the top velocity, and one unit too short.
        ((2121, 101, 10, 1), (10, 1, 0)),
        ((2120, 101, 10, 1), (11, 0, 0)),
        # Just long enough for the top velocity, which holds for no sample.
        ((6, 2, 1, 1), (1, 1, 0)),
        # Too short for the top velocity: the cube root of 54 / 2, and a little more.
        ((54, 1000, 1000, 1), (3, 0, 0)),
        ((55, 1000, 1000, 1), (4, 0, 0)),
        *(((2 * m**3, 1 << 62, 1 << 62, 1), (m, 0, 0)) for m in (1000, 77_777, 123_456)),
        *(((2 * m**3 + 1, 1 << 62, 1 << 62, 1), (m + 1, 0, 0)) for m in (1000, 77_777, 123_456)),
        # Too short, and the acceleration is reached: 3 * (3 + t) * (6 + t) is at least 200.
        ((200, 1000, 3, 1), (3, 4, 0)),
        ((210, 1000, 3, 1), (3, 4, 0)),
        ((211, 1000, 3, 1), (3, 5, 0)),
    ],
)
def test_the_shape_is_the_shortest_that_keeps_the_limits(move, shape):
    curve = planned(*move)
    assert (curve.rise, curve.flat, curve.hold) == shape


@pytest.mark.spec("MCP-SCV-4")
@pytest.mark.parametrize("zero", [1, 2, 3])
def test_without_velocity_acceleration_or_jerk_nothing_moves(zero):
    arguments = [1000, 10, 5, 1]
    arguments[zero] = 0
    curve = SCurve()
    assert not curve.plan(*arguments)
    assert run(curve, 5) == [0] * 5
    assert (curve.done, curve.velocity, curve.phase) == (False, 0, 0)


@pytest.mark.spec("MCP-TRP-5")
def test_a_move_to_where_it_stands_is_done_at_once():
    curve = SCurve()
    assert not curve.plan(0, 10, 5, 1)
    assert curve.done
    assert curve.step() == 0


@pytest.mark.spec("MCP-SCV-2")
def test_velocities_are_cut_down_to_whole_units_for_reading_only():
    curve = planned(100, 7, 3, 1)
    offsets, velocities = [], []
    while not curve.done:
        offsets.append(curve.step())
        velocities.append(curve.velocity)
    assert velocities[-1] == 0
    assert all(0 <= w - v <= 1 for w, v in zip(ways(offsets)[:-1], velocities[:-1], strict=True))
    assert offsets[-1] == 100


VALUES = st.one_of(st.integers(1, 60), st.integers(1, 1 << 20), st.integers(1, 1 << 31))


def moves(longest: int = 3000) -> st.SearchStrategy[tuple[int, int, int, int]]:
    """Moves of any shape that end within ``longest`` samples or so."""

    def short(move: tuple[int, int, int, int]) -> bool:
        distance, top, accel, jerk = move
        return distance < top * longest and top < accel * longest and accel < jerk * longest

    return st.tuples(st.one_of(VALUES, st.integers(1, 1 << 62)), VALUES, VALUES, VALUES).filter(
        short
    )


def velocities_of(curve: SCurve, peak: Fraction) -> list[Fraction]:
    """Return the exact velocity of every sample of a move of this shape, by MCP-SCV-2."""
    rising = [*range(1, curve.rise + 1), *[curve.rise] * curve.flat, *reversed(range(curve.rise))]
    parts = list(accumulate(rising))
    falling = [parts[-1] - part for part in parts]
    parts += [parts[-1]] * curve.hold + falling
    quantum = peak / (curve.rise * (curve.rise + curve.flat))
    return [quantum * part for part in parts]


def peak_of(curve: SCurve) -> Fraction:
    """Return the exact peak velocity of a planned move that has kept its end (MCP-SCV-1)."""
    return Fraction(curve.distance, 2 * curve.rise + curve.flat + curve.hold)


def differences(values: list[Fraction]) -> list[Fraction]:
    """How values change from 0 to the first, from one to the next, and from the last to 0."""
    return [b - a for a, b in pairwise([Fraction(0), *values, Fraction(0)])]


def assert_limits(
    velocities: list[Fraction], move: tuple[int, int, int, int], jerky: bool = False
) -> None:
    """Check every velocity, acceleration and jerk of a move; ``jerky`` leaves out the last."""
    _, top, accel, jerk = move
    assert all(0 <= velocity <= top for velocity in velocities)
    accels = differences(velocities)
    assert all(abs(change) <= accel for change in accels)
    assert jerky or all(abs(change) <= jerk for change in differences(accels))


def assert_course(offsets: list[int], velocities: list[Fraction]) -> None:
    """Check that offsets are the exact places cut down, and end with the last velocity."""
    while velocities[-1] == 0:
        velocities = velocities[:-1]
    assert offsets == [floor(place) for place in accumulate(velocities)]


@pytest.mark.spec("MCP-SCV-1", "MCP-SCV-2", "MCP-SCV-4", "PMD-TRJ-4")
@given(move=moves())
def test_every_move_keeps_its_limits_exactly_and_ends_on_its_target(move):
    curve = planned(*move)
    velocities = velocities_of(curve, peak_of(curve))
    phases, offsets = [], []
    while not curve.done:
        assert len(offsets) < 20_000
        offsets.append(curve.step())
        phases.append(curve.phase)
    assert offsets[-1] == sum(velocities) == move[0]
    assert_course(offsets, velocities)
    assert_limits(velocities, move)
    assert phases[:-1] == sorted(phases[:-1])
    assert phases[-1] == 0


@pytest.mark.spec("MCP-SCV-1", "PMD-TRJ-4")
@given(
    distance=st.one_of(VALUES, st.integers(1, 1 << 63)),
    top=st.one_of(VALUES, st.integers(1, 1 << 46)),
    accel=VALUES,
    jerk=VALUES,
)
@example(distance=(1 << 31) - 1 << 32, top=1 << 16, accel=1 << 16, jerk=1)
@example(distance=(1 << 31) - 1 << 32, top=((1 << 30) - 1) << 16, accel=1 << 16, jerk=1)
@example(distance=1 << 39, top=0xFFFFFF << 8, accel=0xFFFF << 8, jerk=1)
def test_the_longest_moves_are_planned_within_their_limits_too(distance, top, accel, jerk):
    """Those that would take for ever to step through: the peaks say enough."""
    curve = planned(distance, top, accel, jerk)
    peak = peak_of(curve)
    assert curve.hold >= 0
    assert peak <= top
    assert peak / (curve.rise + curve.flat) <= accel
    assert peak / (curve.rise * (curve.rise + curve.flat)) <= jerk
    # One sample less would be too fast, unless there is no hold to take it from.
    assert curve.hold == 0 or distance > top * (2 * curve.rise + curve.flat + curve.hold - 1)


@pytest.mark.spec("MCP-SCV-1", "PMD-TRJ-4")
@given(
    rise=st.integers(1, 40),
    flat=st.integers(0, 40),
    hold=st.integers(0, 40),
    jerk=st.integers(1, 9),
)
def test_a_move_whose_shape_is_given_is_planned_in_that_shape(rise, flat, hold, jerk):
    accel = rise * jerk
    top = accel * (rise + flat)
    curve = planned(top * (2 * rise + flat + hold), top, accel, jerk)
    assert (curve.rise, curve.flat, curve.hold) == (rise, flat, hold)
    velocities = ways(run(curve))
    assert max(velocities) == top
    velocities += [0, 0, 0]
    steps = [b - a for a, b in pairwise([0, *velocities])]
    assert max(steps) == accel == -min(steps)
    assert {abs(b - a) for a, b in pairwise([0, *steps])} <= {0, jerk}


@pytest.mark.spec("MCP-SCV-5", "MCP-TRP-8")
@given(move=moves())
def test_the_deceleration_distance_is_what_the_move_covers(move):
    curve = planned(*move)
    ramp = 2 * curve.rise + curve.flat
    decelerated = curve.deceleration_distance
    offsets = run(curve)
    # The offset where deceleration begins is itself cut down.
    assert curve.distance - offsets[ramp + curve.hold - 1] - decelerated in (0, 1)


@pytest.mark.spec("MCP-SCV-5", "PMD-TRJ-5")
@pytest.mark.parametrize("after", [1, 5, 24, 25, 60, 100])
def test_a_move_is_extended_in_phases_1_to_4_at_the_same_velocity(after):
    curve = mcp(1000)
    before = run(curve, after)[-1]
    assert curve.retarget(1234 << 16)
    offsets = run(curve)
    assert offsets[-1] == 1234 << 16
    assert after + len(offsets) == 122 + 23 + 1
    assert max(ways(offsets, before)) == 10 << 16


@pytest.mark.spec("MCP-SCV-5")
def test_a_move_without_hold_is_extended_at_the_peak_it_reached():
    curve = mcp(100)
    assert curve.hold == 0
    peak = Fraction(100 << 16, 2 * curve.rise + curve.flat)
    before = run(curve, 5)[-1]
    assert curve.retarget(700 << 16)
    offsets = run(curve)
    assert offsets[-1] == 700 << 16
    assert max(ways(offsets, before)) == -(-peak.numerator // peak.denominator)


@pytest.mark.spec("MCP-SCV-5", "PMD-TRJ-5")
def test_a_move_is_shortened_down_to_its_stopping_distance_and_no_further():
    curve = mcp(1000)
    run(curve, 50)
    here = curve.offset
    assert curve.phase == 4
    nearest = here + curve.deceleration_distance
    assert not curve.retarget(nearest - 1)
    assert curve.distance == 1000 << 16
    assert curve.retarget(nearest)
    offsets = run(curve)
    assert curve.phase == 0
    assert offsets[-1] == nearest
    assert len(offsets) == 22


@pytest.mark.spec("MCP-SCV-5", "MCP-TRP-6", "PMD-TRJ-5")
def test_a_move_that_decelerates_is_not_retargeted():
    curve = mcp(1000)
    run(curve, 101)
    assert curve.phase == 5
    assert not curve.retarget(2000 << 16)
    assert run(curve)[-1] == 1000 << 16
    assert not curve.retarget(2000 << 16)


@pytest.mark.spec("MCP-SCV-5", "PMD-TRJ-5")
@given(move=moves(), data=st.data())
def test_a_move_retargeted_any_number_of_times_ends_on_the_last_target(move, data):
    curve = planned(*move)
    for _ in range(data.draw(st.integers(1, 3))):
        run(curve, data.draw(st.integers(0, 400)))
        reach = min(move[1], curve.distance)
        if not curve.retarget(curve.distance + data.draw(st.integers(-reach, reach))):
            break
    goal = curve.distance
    run(curve)
    assert curve.offset == goal


@pytest.mark.spec("MCP-SCV-3", "MCP-SCV-5", "PMD-TRJ-5")
def test_a_changed_end_keeps_the_velocity_and_takes_what_is_left_over_on_the_way_down():
    curve = pmd(2000)
    before = run(curve, 150)
    assert curve.retarget(2003 << 32)
    assert curve.hold == 88
    extra = ways([*before, *run(curve)])
    plain = ways(run(pmd(2000)))
    assert len(extra) == 311
    place = next(i for i in range(310) if extra[i] != plain[i])
    assert extra[place] == 3 << 32
    assert plain[place] <= 3 << 32 < plain[place - 1]
    assert extra[place + 1 :] == plain[place:]


@pytest.mark.spec("MCP-SCV-3")
def test_a_left_over_slower_than_every_sample_is_moved_last():
    curve = planned(990, 90, 30, 15)
    run(curve, 3)
    assert curve.retarget(1000)
    assert ways(run(curve), 135) == [90, 90, *[90] * 6, 75, 45, 15, 10]


@pytest.mark.spec("MCP-SCV-3", "MCP-SCV-5", "PMD-TRJ-5")
@given(move=moves(), data=st.data())
def test_a_changed_end_breaks_no_limit_but_the_jerk_around_its_extra_sample(move, data):
    curve = planned(*move)
    peak = peak_of(curve)
    before = run(curve, data.draw(st.integers(0, 400)))
    reach = min(move[1], curve.distance)
    assume(curve.retarget(curve.distance + data.draw(st.integers(-reach, reach))))
    velocities = velocities_of(curve, peak)
    assert_limits(velocities, move)
    rest = curve.distance - sum(velocities)
    assert 0 <= rest < peak
    if rest:
        ramps = 2 * curve.rise + curve.flat
        place = next(i for i in range(ramps + curve.hold, len(velocities)) if velocities[i] <= rest)
        velocities.insert(place, rest)
        assert_limits(velocities, move, jerky=True)
    assert_course([*before, *run(curve)], velocities)


@pytest.mark.spec("PMD-TRJ-10")
@pytest.mark.parametrize(
    ("after", "phases"),
    [
        (20, [3] * 20 + [5] * 20 + [7] * 18),
        (42, [3] * 32 + [5] * 32 + [6] * 10 + [7] * 30),
        (90, [3] * 22 + [5] * 32 + [6] * 48 + [7] * 30),
        (150, [5] * 32 + [6] * 48 + [7] * 30),
        (220, [5] * 12 + [6] * 48 + [7] * 30),
    ],
)
def test_a_smooth_stop_mirrors_the_acceleration_reached(after, phases):
    curve = pmd(2000)
    run(curve, after)
    curve.stop()
    seen = []
    while not curve.done:
        curve.step()
        seen.append(curve.phase)
    assert seen == [*phases[:-1], 0]
    assert curve.offset == curve.distance


@pytest.mark.spec("PMD-TRJ-10")
def test_before_its_first_sample_a_smooth_stop_is_over_at_once():
    curve = pmd(2000)
    curve.stop()
    assert curve.done
    assert curve.distance == 0


@pytest.mark.spec("PMD-TRJ-10")
@given(move=moves(), after=st.integers(1, 3000))
def test_a_smooth_stop_is_symmetric_and_never_retargeted(move, after):
    curve = planned(*move)
    start = run(curve, after)
    assume(not curve.done and curve.phase <= 4)
    curve.stop()
    assert not curve.retarget(curve.distance + (1 << 40))
    velocities = ways(start + run(curve, 20_000))
    assert curve.done
    assert curve.offset == curve.distance == sum(velocities)
    if (curve.rise, curve.flat) == (1, 0) and after > 1:
        # From the peak to rest within one sample.
        assert velocities.pop() == 0
    # The last two samples of the acceleration run at the peak, those of the mirror image at 0.
    mirrored = velocities[::-1]
    assert all(abs(a - b) <= 1 for a, b in zip(velocities, mirrored, strict=True))


@pytest.mark.spec("MCP-SCV-2")
@given(move=moves(), after=st.integers(0, 3000), stop=st.booleans())
def test_a_saved_move_goes_on_where_it_was(move, after, stop):
    curve = planned(*move)
    run(curve, after)
    if stop:
        curve.stop()
    copy = SCurve()
    state.load(copy, state.save(curve))
    assert state.save(copy) == state.save(curve)
    assert run(copy, 20_000) == run(curve, 20_000)
    assert copy.done is curve.done is True
