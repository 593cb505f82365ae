"""Velocity contouring and electronic gear (PMD-TRJ-6, PMD-TRJ-7, PMD-TRJ-13)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mc1241a.conftest import Bench
from vbus.chips.mc1241a.chipset import ProfileRegisters
from vbus.chips.mc1241a.profile import Profile
from vbus.core.kernel import US

spec = pytest.mark.spec


def speeds(bench: Bench, cycles: int) -> list[float]:
    """Return the target velocity after each of the coming cycles (usteps/cycle)."""
    result = []
    for _ in range(cycles):
        bench.next_cycle()
        result.append(bench.probe.profile_velocity / 2**32)
    return result


def contour(bench: Bench, vel: int, acc: int) -> None:
    bench.send("SET_PRFL_VEL")
    bench.move(vel=vel << 16, acc=acc << 16)


@spec("PMD-TRJ-6", "PMD-CMD-10")
@pytest.mark.parametrize("sign", [1, -1])
def test_the_sign_of_the_acceleration_is_the_direction(chip: Bench, sign: int) -> None:
    contour(chip, 5, 2 * sign)
    assert speeds(chip, 5) == [2 * sign, 4 * sign, 5 * sign, 5 * sign, 5 * sign]
    assert chip.seen("target") == 21 * sign
    assert chip.status() == 0x0700


@spec("PMD-TRJ-6", "PMD-CMD-10")
@pytest.mark.parametrize(
    ("acc", "direction"),
    [(0x1FFF_FFFF, 1), (0x2000_0000, 1), (0x3FFF_FFFF, 1), (-0x2000_0001, -1), (-0x4000_0000, -1)],
)
def test_the_largest_accelerations_keep_their_sign(chip: Bench, acc: int, direction: int) -> None:
    chip.send("SET_PRFL_VEL")
    chip.move(vel=5 << 16, acc=acc)
    assert speeds(chip, 2) == [5 * direction, 5 * direction]


@spec("PMD-TRJ-6")
def test_reversing_goes_through_zero_at_the_same_rate(chip: Bench) -> None:
    contour(chip, 5, 5)
    chip.next_cycle(3)
    chip.move(acc=-(2 << 16))
    assert speeds(chip, 7) == [3, 1, -1, -3, -5, -5, -5]


@spec("PMD-TRJ-6")
def test_no_acceleration_keeps_the_velocity(chip: Bench) -> None:
    contour(chip, 5, 2)
    chip.next_cycle(2)
    chip.move(acc=0, vel=1 << 16)
    assert speeds(chip, 4) == [4, 4, 4, 4]


@spec("PMD-TRJ-6")
def test_a_lower_top_velocity_is_approached_at_the_acceleration(chip: Bench) -> None:
    contour(chip, 10, 5)
    chip.next_cycle(3)
    chip.move(vel=3 << 16, acc=2 << 16)
    assert speeds(chip, 5) == [8, 6, 4, 3, 3]


@spec("PMD-TRJ-6", "PMD-ERR-4")
@pytest.mark.parametrize(("vel", "first"), [(9, 4), (3, 3)])
def test_a_move_from_rest_begins_at_the_start_velocity(chip: Bench, vel: int, first: int) -> None:
    chip.send("SET_START_VEL", 4 << 16)
    contour(chip, vel, -1)
    assert speeds(chip, 1) == [-first]


@spec("PMD-TRJ-6")
def test_while_reversing_the_axis_rests_for_one_cycle_between_start_velocities(
    chip: Bench,
) -> None:
    chip.send("SET_START_VEL", 3 << 16)
    contour(chip, 6, 2)
    assert speeds(chip, 3) == [3, 5, 6]
    chip.move(acc=-(2 << 16))
    assert speeds(chip, 5) == [4, 0, -3, -5, -6]


@spec("PMD-TRJ-12", "PMD-TRJ-8", "PMD-TRJ-6")
def test_motion_is_complete_when_velocity_0_is_reached(chip: Bench) -> None:
    contour(chip, 4, 2)
    chip.next_cycle(3)
    assert chip.seen("status") == 0x0700
    chip.move(vel=0)
    chip.next_cycle()
    assert chip.seen("status") == 0x0700
    chip.next_cycle()
    assert chip.seen("status") == 0x0301
    chip.send("CLR_STATUS")
    chip.next_cycle(3)
    assert chip.seen("status") == 0x0300


@spec("PMD-TRJ-6")
def test_everything_may_change_in_motion_without_an_error(chip: Bench) -> None:
    contour(chip, 4, 1)
    chip.next_cycle(2)
    chip.move(vel=8 << 16, acc=3 << 16)
    chip.next_cycle(5)
    assert chip.status() == 0x0700


@spec("PMD-TRJ-13")
def test_into_velocity_contouring_at_any_time_with_the_velocity_kept(chip: Bench) -> None:
    chip.move(pos=1000, vel=4 << 16, acc=1 << 16)
    chip.next_cycle(10)
    chip.send("SET_PRFL_VEL")
    assert speeds(chip, 2) == [4, 4]
    chip.next_cycle(1000)
    assert chip.seen("target") > 4000  # the destination does not count any more
    assert chip.rules() == []


@spec("PMD-TRJ-13")
def test_back_to_trapezoidal_in_motion_heads_for_the_destination(chip: Bench) -> None:
    chip.load(pos=500)
    contour(chip, 4, 1)
    chip.next_cycle(20)
    chip.send("SET_PRFL_TRAP")
    assert speeds(chip, 2) == [4, 4]
    assert chip.rules() == ["mode-in-motion"]
    chip.next_cycle(200)
    assert chip.seen("target") == 500
    assert chip.status() == 0x0301


@spec("PMD-TRJ-13")
def test_a_mode_change_at_rest_starts_nothing(chip: Bench) -> None:
    chip.move(pos=10, vel=4 << 16, acc=1 << 16)
    chip.next_cycle(20)
    for mode in ("VEL", "TRAP", "S_CRV", "GEAR"):
        chip.send("SET_PRFL_" + mode)
        chip.next_cycle(5)
        assert chip.seen("target") == 10
    assert chip.rules() == ["without-current"]


@spec("PMD-TRJ-6")
@settings(deadline=None, max_examples=200)
@given(
    velocity=st.integers(-(20 << 16), 20 << 16),
    top=st.integers(0, 20 << 16),
    accel=st.one_of(st.just(0), st.integers(1 << 12, 5 << 16), st.integers(-5 << 16, -1 << 12)),
    start=st.integers(0, 3 << 16),
)
def test_the_velocity_comes_to_its_goal_and_stays(
    velocity: int, top: int, accel: int, start: int
) -> None:
    profile, active = Profile(), ProfileRegisters()
    profile.set_mode(1, 0)
    active.velocity, active.acceleration = abs(velocity), velocity
    profile.start(active, False)
    profile.step(active, 0, 0)
    active.velocity, active.acceleration = top, accel
    for _ in range(2 + (20 << 17) // abs(accel) + 3 if accel else 5):
        before = profile.velocity >> 16
        profile.step(active, start, 0)
        after = profile.velocity >> 16
        if start == 0:
            assert abs(after - before) <= abs(accel)
    goal = velocity if accel == 0 else (top if accel > 0 else -top)
    assert profile.velocity == goal << 16


# -- gear -------------------------------------------------------------------------------------


class Crank:
    """Turns encoder 1 by hand."""

    ORDER = ((0, 0), (1, 0), (1, 1), (0, 1))

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.place = 0

    def turn(self, counts: int) -> None:
        for _ in range(abs(counts)):
            self.place += 1 if counts > 0 else -1
            a, b = self.ORDER[self.place % 4]
            self.bench.run_for(1 * US)
            self.bench.drive("QuadA1", a)
            self.bench.drive("QuadB1", b)
        self.bench.run_for(1 * US)


@spec("PMD-TRJ-7", "PMD-CMD-13")
@pytest.mark.parametrize(
    ("ratio", "target"), [(2 << 16, 20), (-(2 << 16), -20), (98304, 15), (-746455, -114)]
)
def test_the_target_follows_the_encoder_times_the_ratio(
    chip: Bench, ratio: int, target: int
) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=ratio)
    chip.next_cycle()
    Crank(chip).turn(10)
    assert chip.seen("target") == 0
    chip.next_cycle()
    assert chip.seen("target") == target
    assert chip.seen("actual") == 10


@spec("PMD-TRJ-7")
def test_the_fraction_is_carried(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=1 << 14)  # a quarter ustep a count
    chip.next_cycle()
    crank = Crank(chip)
    seen = []
    for _ in range(8):
        crank.turn(1)
        chip.next_cycle()
        seen.append(chip.seen("target"))
    assert seen == [0, 0, 0, 1, 1, 1, 1, 2]
    crank.turn(-8)
    chip.next_cycle()
    assert chip.seen("target") == 0


@spec("PMD-TRJ-7")
def test_there_is_no_jump_on_entry_and_a_new_ratio_counts_from_its_cycle(chip: Bench) -> None:
    crank = Crank(chip)
    crank.turn(25)
    chip.next_cycle()
    chip.move(ratio=1 << 16)
    chip.send("SET_PRFL_GEAR")
    chip.next_cycle(3)
    assert chip.seen("target") == 0
    crank.turn(5)
    chip.next_cycle()
    assert chip.seen("target") == 5
    chip.load(ratio=4 << 16)
    chip.next_cycle()
    chip.send("UPDATE")
    crank.turn(2)  # before the cycle that takes the ratio, and counted in it
    chip.next_cycle()
    assert chip.seen("target") == 13


@spec("PMD-TRJ-7")
def test_gear_mode_sets_the_target_velocity_of_each_cycle(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=3 << 16)
    chip.next_cycle()
    Crank(chip).turn(4)
    chip.next_cycle()
    assert chip.send("GET_TRGT_VEL") == 12 << 16
    chip.next_cycle()
    assert chip.send("GET_TRGT_VEL") == 0


@spec("PMD-TRJ-7")
def test_each_axis_follows_its_own_encoder(chip: Bench) -> None:
    chip.send("SET_2")
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=1 << 16)
    chip.next_cycle()
    Crank(chip).turn(4)
    chip.next_cycle()
    assert (chip.seen("target", 2), chip.seen("actual", 2)) == (0, 0)


@spec("PMD-TRJ-10", "PMD-TRJ-6")
@pytest.mark.parametrize("mode", ["TRAP", "VEL"])
def test_an_update_during_a_smooth_stop_brings_the_velocity_back(chip: Bench, mode: str) -> None:
    chip.send(f"SET_PRFL_{mode}")
    chip.move(pos=100_000, vel=8 << 16, acc=1 << 16)
    chip.next_cycle(20)
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle(4)
    chip.move()
    chip.next_cycle(10)
    before = chip.seen("target")
    chip.next_cycle()
    assert chip.seen("target") - before == 8


@spec("PMD-TRJ-9")
def test_stop_pauses_the_gear_until_the_next_update(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=1 << 16)
    chip.next_cycle()
    crank = Crank(chip)
    crank.turn(3)
    chip.send("STOP")
    chip.move()
    chip.next_cycle()
    assert chip.status() == 0x0301
    stopped = chip.seen("target")
    crank.turn(10)
    chip.next_cycle()
    assert chip.seen("target") == stopped
    chip.move()
    chip.next_cycle()
    crank.turn(6)
    chip.next_cycle()
    assert chip.seen("target") == stopped + 6


@spec("PMD-TRJ-9", "PMD-TRJ-7")
def test_a_stopped_axis_does_not_follow_when_gear_is_chosen(chip: Bench) -> None:
    chip.send("STOP")
    chip.move(ratio=1 << 16)
    chip.next_cycle()
    chip.send("SET_PRFL_GEAR")
    Crank(chip).turn(5)
    chip.next_cycle(2)
    assert chip.seen("target") == 0


@spec("PMD-TRJ-11", "PMD-TRJ-13", "PMD-UPD-1")
def test_a_trapezoid_chosen_in_gear_goes_where_the_last_update_said_be_it_a_stop(
    chip: Bench,
) -> None:
    chip.move(pos=1000, vel=8 << 16, acc=8 << 16, ratio=1 << 16)
    chip.next_cycle()
    chip.send("SMOOTH_STOP")
    chip.move(pos=-50)
    chip.next_cycle(3)
    assert (chip.seen("target"), chip.status()) == (8, 0x0301)
    chip.send("SET_PRFL_GEAR")
    Crank(chip).turn(4)
    chip.next_cycle()
    assert chip.seen("target") == 12
    chip.send("SET_PRFL_TRAP")
    chip.next_cycle(12)
    assert (chip.seen("target"), chip.status()) == (-50, 0x0301)


@spec("PMD-TRJ-8", "PMD-TRJ-13")
def test_a_trapezoid_that_turns_round_is_in_motion_when_the_mode_changes(chip: Bench) -> None:
    chip.move(pos=100, vel=2 << 16, acc=1 << 16)
    chip.next_cycle(2)
    chip.move(pos=-100)
    assert speeds(chip, 2) == [1, 0]
    assert chip.status() == 0x0700
    chip.send("SET_PRFL_VEL")
    assert speeds(chip, 3) == [1, 2, 2]


@spec("PMD-ERR-3", "PMD-TRJ-9")
def test_a_refused_update_does_not_set_a_stopped_axis_free(chip: Bench) -> None:
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    chip.move(pos=100, vel=2 << 16, acc=1 << 16, ratio=1 << 16)
    chip.next_cycle()
    assert chip.status() == 0x0380
    chip.send("SET_PRFL_GEAR")
    crank = Crank(chip)
    crank.turn(5)
    chip.next_cycle()
    assert chip.seen("target") == 0
    chip.send("UPDATE")
    chip.next_cycle()
    crank.turn(6)
    chip.next_cycle()
    assert chip.seen("target") == 6


@spec("PMD-TRJ-10", "PMD-MTR-2")
def test_a_smooth_stop_with_the_motor_off_does_not_let_the_gear_follow(chip: Bench) -> None:
    chip.send("MTR_OFF")
    chip.send("SMOOTH_STOP")
    chip.move(ratio=1 << 16)
    chip.next_cycle()
    assert chip.status() == 0x0201
    chip.send("SET_PRFL_GEAR")
    Crank(chip).turn(5)
    chip.next_cycle(2)
    assert chip.seen("target") == 0


@spec("PMD-TRJ-10", "PMD-TRJ-13")
def test_a_smooth_stop_at_rest_is_not_remembered(chip: Bench) -> None:
    chip.load(pos=100, vel=8 << 16, acc=1 << 16, ratio=2 << 16)
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle()
    assert chip.status() == 0x0301
    chip.send("SET_PRFL_GEAR")
    Crank(chip).turn(1)
    chip.next_cycle()
    assert chip.seen("target") == 2
    chip.send("SET_PRFL_TRAP")  # at 2 usteps/cycle
    assert chip.trace("target", 3) == [5, 9, 14]


@spec("PMD-TRJ-10", "PMD-TRJ-13")
def test_a_smooth_stop_asked_for_in_gear_is_not_remembered(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.send("SMOOTH_STOP")
    chip.move(ratio=1 << 16, vel=9 << 16, acc=1 << 14)
    chip.next_cycle()
    Crank(chip).turn(4)
    chip.next_cycle()
    chip.send("SET_PRFL_VEL")
    assert speeds(chip, 2) == [4.25, 4.5]


@spec("PMD-TRJ-10")
def test_smooth_stop_has_no_effect_in_gear_mode(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=1 << 16)
    chip.next_cycle()
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle()
    Crank(chip).turn(6)
    chip.next_cycle()
    assert chip.seen("target") == 6
    assert chip.status() == 0x0300


@spec("PMD-TRJ-13")
def test_into_gear_at_any_time(chip: Bench) -> None:
    chip.load(ratio=1 << 16)
    contour(chip, 4, 1)
    chip.next_cycle(10)
    chip.send("SET_PRFL_GEAR")
    chip.next_cycle()
    at = chip.seen("target")
    Crank(chip).turn(7)
    chip.next_cycle(2)
    assert chip.seen("target") == at + 7
    assert chip.rules() == []


@spec("PMD-TRJ-1")
def test_what_is_told_of_a_velocity_keeps_its_fraction(chip: Bench) -> None:
    chip.send("SET_PRFL_VEL")
    chip.move(vel=0x1_8000, acc=0x1_8000)
    chip.next_cycle(2)
    assert chip.chip.telemetry()["velocity 1"] == 1.5
