"""S-curve point to point (PMD-TRJ-4, PMD-TRJ-5, PMD-TRJ-10, PMD-ERR-2)."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mc1241a.conftest import Bench
from vbus.chips.mc1241a.chipset import ProfileRegisters
from vbus.chips.mc1241a.profile import Profile

spec = pytest.mark.spec


def s_curve(bench: Bench, pos: int, **changes: int) -> None:
    values = {"vel": 10 << 16, "max_acc": 0x2000, "jerk": 0x01000000, **changes}
    bench.send("SET_PRFL_S_CRV")
    bench.move(pos=pos, **values)


def phase(bench: Bench) -> int:
    return bench.seen("mode") >> 13


@spec("PMD-TRJ-4", "PMD-T-10")
def test_the_move_of_2000(chip: Bench) -> None:
    s_curve(chip, 2000)
    now, seen = 0, []
    for cycle in (32, 80, 112, 200, 232, 280):
        chip.next_cycle(cycle - now)
        now = cycle
        seen.append((chip.seen("target"), phase(chip)))
    assert seen == [(23, 1), (269, 2), (570, 3), (1450, 4), (1746, 5), (1980, 6)]
    chip.next_cycle(309 - now)
    assert phase(chip) == 7
    assert chip.status() == 0x0700
    chip.next_cycle()
    assert chip.seen("target") == 2000
    assert chip.status() == 0x0301
    assert phase(chip) == 0


@spec("PMD-TRJ-4", "PMD-T-10")
def test_a_short_move_does_not_reach_its_velocity(chip: Bench) -> None:
    s_curve(chip, 1000)
    chip.next_cycle()
    curve = chip.probe.curve
    assert (curve.rise, curve.flat, curve.hold) == (32, 43, 0)
    speeds = [chip.probe.profile_velocity]
    for _ in range(210):
        chip.next_cycle()
        speeds.append(chip.probe.profile_velocity)
    assert max(speeds) == (1000 << 32) // 107
    chip.next_cycle()
    assert chip.status() == 0x0301
    assert chip.seen("target") == 1000


@spec("PMD-TRJ-4", "PMD-T-10")
def test_the_move_of_2003_is_one_cycle_longer_and_a_little_slower(bench: Bench) -> None:
    s_curve(bench, 2003)
    now, seen = 0, []
    for cycle in (32, 80, 112, 201, 233, 281):
        bench.next_cycle(cycle - now)
        now = cycle
        seen.append((bench.seen("target"), phase(bench)))
        if cycle in (112, 201):
            assert bench.send("GET_TRGT_VEL") == (2003 << 16) // 201
    assert seen == [(23, 1), (268, 2), (568, 3), (1454, 4), (1750, 5), (1983, 6)]
    bench.next_cycle(310 - now)
    assert bench.status() == 0x0700
    bench.next_cycle()
    assert bench.seen("target") == 2003
    assert bench.status() == 0x0301


@spec("PMD-TRJ-4")
def test_a_curve_begins_though_its_first_velocity_is_below_every_unit(chip: Bench) -> None:
    """m = 444, so that the first cycle moves 3/197136 of 1/65536 ustep."""
    s_curve(chip, 3, vel=3, max_acc=0x7FFF, jerk=1)
    chip.next_cycle()
    assert (chip.seen("status"), chip.probe.profile_position) == (0x0700, 0)
    chip.next_cycle(1000)
    assert chip.send("GET_TRGT_VEL") == 3


@spec("PMD-TRJ-4")
def test_backwards_ends_on_the_destination_too(chip: Bench) -> None:
    s_curve(chip, -2000)
    chip.next_cycle(310)
    assert chip.seen("target") == -2000
    assert chip.status() == 0x0301


@spec("PMD-TRJ-4")
def test_the_start_velocity_is_not_used(chip: Bench) -> None:
    chip.send("SET_START_VEL", 5 << 16)
    s_curve(chip, 2000)
    chip.next_cycle(32)
    assert chip.seen("target") == 23


@spec("PMD-TRJ-4", "PMD-TRJ-8", "PMD-TRJ-12", "PMD-ERR-2")
@pytest.mark.parametrize(
    ("missing", "value"), [("vel", 10 << 16), ("max_acc", 0x2000), ("jerk", 0x01000000)]
)
def test_without_velocity_acceleration_or_jerk_nothing_is_in_motion(
    bench: Bench, missing: str, value: int
) -> None:
    s_curve(bench, 2000, **{missing: 0})
    bench.next_cycle(50)
    assert bench.seen("target") == 0
    assert bench.status() == 0x0300
    bench.move(**{missing: value})
    bench.next_cycle(309)
    assert bench.status() == 0x0700
    bench.next_cycle()
    assert bench.seen("target") == 2000
    assert bench.status() == 0x0301
    assert bench.rules() == ["without-current"]


@spec("PMD-TRJ-8", "PMD-TRJ-10")
def test_smooth_stop_of_a_move_that_could_not_begin_completes_motion(chip: Bench) -> None:
    s_curve(chip, 2000, jerk=0)
    chip.next_cycle(3)
    chip.send("SMOOTH_STOP")
    chip.move(jerk=0x01000000)
    chip.next_cycle()
    assert chip.status() == 0x0301
    chip.next_cycle(50)
    assert chip.seen("target") == 0
    chip.move()
    chip.next_cycle(310)
    assert chip.seen("target") == 2000


@spec("PMD-TRJ-5")
@pytest.mark.parametrize(("at", "pos"), [(10, 2500), (50, 3000), (90, 2100), (150, 2500)])
def test_a_new_position_ahead_is_taken_in_phases_1_to_4(chip: Bench, at: int, pos: int) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(at)
    chip.move(pos=pos)
    chip.next_cycle(600)
    assert chip.seen("target") == pos
    assert chip.status() == 0x0301


@spec("PMD-TRJ-5")
@pytest.mark.parametrize(("at", "pos"), [(150, 500), (250, 2500), (50, -100)])
def test_a_position_out_of_reach_is_kept_for_another_update(chip: Bench, at: int, pos: int) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(at)
    chip.move(pos=pos)
    chip.next_cycle(600)
    assert chip.seen("target") == 2000
    assert chip.status() == 0x0301
    chip.send("UPDATE")
    chip.next_cycle(600)
    assert chip.seen("target") == pos


@spec("PMD-ERR-2", "PMD-TRJ-5", "PMD-CMD-11", "PMD-CMD-12")
@pytest.mark.parametrize("what", [{"vel": 1 << 16}, {"max_acc": 1}, {"jerk": 1}])
def test_new_limits_in_motion_are_a_command_error_and_only_the_position_counts(
    chip: Bench, what: dict[str, int]
) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(20)
    chip.move(pos=2500, acc=9 << 16, ratio=7, buf_mtr_cmd=99, **what)
    chip.next_cycle()
    assert chip.status() == 0x0780
    active = chip.probe
    assert (active.velocity, active.max_acceleration, active.jerk) == (
        10 << 16, 0x2000, 0x01000000,
    )  # fmt: skip
    assert (active.acceleration, active.gear_ratio, active.motor_command) == (9 << 16, 7, 99)
    assert "command-error" in chip.rules()
    chip.next_cycle(600)
    assert chip.seen("target") == 2500


@spec("PMD-ERR-2")
def test_writing_the_same_limits_again_is_no_error(chip: Bench) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(20)
    chip.move(vel=10 << 16, max_acc=0x2000, jerk=0x01000000)
    chip.next_cycle()
    assert chip.status() == 0x0700


@spec("PMD-TRJ-10")
@pytest.mark.parametrize(
    ("at", "phases"),
    [(10, {3, 5, 7}), (50, {3, 5, 6, 7}), (100, {3, 5, 6, 7}), (150, {5, 6, 7})],
)
def test_smooth_stop_mirrors_the_acceleration_so_far(
    chip: Bench, at: int, phases: set[int]
) -> None:
    s_curve(chip, 5000)
    chip.next_cycle(at)
    profile = chip.probe
    rising = []
    chip.send("SMOOTH_STOP")
    chip.move()
    seen: set[int] = set()
    while True:
        chip.next_cycle()
        if not profile.in_motion():
            break
        seen.add(phase(chip))
        rising.append(profile.profile_velocity)
    assert seen - {phase(chip)} == phases
    peak = rising.index(max(rising))
    falls = [a - b for a, b in zip(rising[peak:], rising[peak + 1 :], strict=False)]
    assert max(falls) <= 0x2000 << 16
    assert chip.status() == 0x0301
    assert profile.profile_velocity == 0


@spec("PMD-TRJ-10", "PMD-TRJ-12")
@pytest.mark.parametrize("cycles", [1, 2, 3])
def test_smooth_stop_of_a_curve_that_rises_in_one_cycle_comes_to_rest(
    bench: Bench, cycles: int
) -> None:
    """Its deceleration is a cycle of velocity 0, or a cycle of the peak velocity before that."""
    s_curve(bench, 1, vel=1, max_acc=1, jerk=0x10000)
    bench.next_cycle(cycles)
    assert (bench.seen("status"), phase(bench)) == (0x0700, (1, 3, 4)[cycles - 1])
    bench.send("SMOOTH_STOP")
    bench.move()
    bench.next_cycle()
    assert (bench.seen("status"), phase(bench)) == (0x0301, 0)
    assert bench.send("GET_TRGT_VEL") == 0
    assert bench.probe.profile_position == max(2, cycles) << 16
    bench.next_cycle(5)
    assert bench.probe.profile_position == max(2, cycles) << 16


@spec("PMD-TRJ-10")
def test_smooth_stop_while_slowing_down_anyway_changes_nothing(chip: Bench) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(250)
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle(100)
    assert chip.seen("target") == 2000


@spec("PMD-TRJ-9", "PMD-TRJ-10")
def test_after_a_stop_a_plain_update_goes_on_to_the_buffered_position(chip: Bench) -> None:
    for stop in ("STOP", "SMOOTH_STOP"):
        chip.send("SET_ACTL_POS", 0)
        s_curve(chip, 2000)
        chip.next_cycle(60)
        chip.send(stop)
        chip.move()
        chip.next_cycle(200)
        assert 0 < chip.seen("target") < 1000
        assert chip.status() == 0x0301
        chip.send("UPDATE")
        chip.next_cycle(400)
        assert chip.seen("target") == 2000


@spec("PMD-TRJ-9", "PMD-TRJ-10")
def test_a_smooth_stop_after_a_stop_moves_nothing(chip: Bench) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(60)
    chip.send("STOP")
    chip.move()
    chip.next_cycle()
    at = chip.seen("target")
    chip.send("CLR_STATUS")
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle(50)
    assert (chip.seen("target"), chip.status()) == (at, 0x0301)


@spec("PMD-TRJ-13", "PMD-TRJ-10")
def test_an_s_curve_that_was_left_is_forgotten(chip: Bench) -> None:
    s_curve(chip, 2000)
    chip.next_cycle(60)
    chip.send("SET_PRFL_TRAP")
    chip.send("STOP")
    chip.move()
    chip.next_cycle()
    at = chip.seen("target")
    chip.send("CLR_STATUS")
    chip.send("SET_PRFL_S_CRV")
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle(5)
    assert chip.seen("target") == at
    assert chip.status() == 0x0301


@spec("PMD-TRJ-13", "PMD-CMD-4")
def test_s_curve_selected_in_motion_stops_the_axis_and_is_reported(chip: Bench) -> None:
    chip.move(pos=10_000, vel=4 << 16, acc=1 << 16)
    chip.next_cycle(10)
    at = chip.seen("target")
    chip.send("SET_PRFL_S_CRV")
    assert chip.status() == 0x0300
    chip.next_cycle(3)
    assert chip.seen("target") == at
    assert chip.rules() == ["mode-in-motion"]


@spec("PMD-TRJ-1", "PMD-TRJ-5", "PMD-CMD-69")
def test_a_curve_that_has_come_round_and_got_another_number_takes_a_new_end(bench: Bench) -> None:
    s_curve(bench, 1000, vel=0x54B6, max_acc=0x60D, jerk=0x1230000)
    bench.next_cycle(100)
    bench.send("SET_ACTL_POS", (1 << 30) - 1)
    bench.next_cycle(10)
    assert bench.seen("status") == 0x0702
    bench.send("SET_ACTL_POS", 20_000)
    bench.next_cycle(3)
    bench.move(pos=20_100)
    bench.next_cycle(400)
    assert (bench.seen("target"), bench.seen("status")) == (20_100, 0x0303)


@spec("PMD-TRJ-1", "PMD-TRJ-5")
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("same", [True, False])
def test_a_destination_beyond_the_end_of_the_range_can_be_had_after_coming_round(
    chip: Bench, sign: int, same: bool
) -> None:
    goal = -sign * ((1 << 30) - 3000)
    first = goal if same else 2000 * sign
    chip.send("SET_ACTL_POS", first - 2000 * sign)
    s_curve(chip, first)
    chip.next_cycle(120)
    chip.send("SET_ACTL_POS", sign * ((1 << 30) - 100))
    chip.next_cycle(15)
    assert chip.seen("status") == 0x0702
    chip.move(pos=goal)
    chip.next_cycle(600)
    assert (chip.seen("target"), chip.seen("status")) == (goal, 0x0303)


@spec("PMD-TRJ-4")
@settings(deadline=None, max_examples=100)
@given(
    goal=st.integers(-20_000, 20_000),
    top=st.integers(4 << 16, 1000 << 16),
    accel=st.integers(1000, 32767),
    jerk=st.integers(1 << 23, 2**31 - 1),
)
def test_every_s_curve_ends_on_its_destination_within_its_limits(
    goal: int, top: int, accel: int, jerk: int
) -> None:
    profile, active = Profile(), ProfileRegisters()
    active.position, active.velocity = goal, top
    active.max_acceleration, active.jerk = accel, jerk
    profile.set_mode(2, 0)
    done = profile.start(active, True)
    ways = [0, 0]
    while not done:
        assert profile.in_motion()
        done = profile.step(active, 0, 0) != 0
        ways.append(profile.moved)
        assert len(ways) < 30_000
    assert profile.position == goal << 32
    # Positions are cut down to 2^-32 ustep, so each way is off by less than 1.
    ways += [0, 0]
    assert max(map(abs, ways)) <= top << 16
    accelerations = [b - a for a, b in pairwise(ways)]
    assert max(map(abs, accelerations)) <= (accel << 16) + 1
    assert max(abs(b - a) for a, b in pairwise(accelerations)) <= jerk + 3
