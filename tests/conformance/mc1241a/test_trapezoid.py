"""Trapezoidal point to point, position range, motion complete (PMD-TRJ-1 to -3, -8, -12)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mc1241a.conftest import Bench
from vbus.chips.mc1241a.chipset import ProfileRegisters
from vbus.chips.mc1241a.profile import Profile

spec = pytest.mark.spec


@spec("PMD-TRJ-2", "PMD-T-9", "PMD-TRJ-12")
def test_the_move_of_20(bench: Bench) -> None:
    bench.move(pos=20, vel=4 << 16, acc=1 << 16)
    assert bench.trace("target", 7) == [1, 3, 6, 10, 14, 17, 19]
    assert bench.status() == 0x0700
    bench.next_cycle()
    assert bench.seen("target") == 20
    assert bench.status() == 0x0301


@spec("PMD-TRJ-2", "PMD-T-9", "PMD-CMD-14")
def test_the_move_of_30_with_a_start_velocity(bench: Bench) -> None:
    bench.send("SET_START_VEL", 2 << 16)
    bench.move(pos=30, vel=5 << 16, acc=1 << 16)
    assert bench.trace("target", 8) == [2, 5, 9, 14, 19, 23, 27, 30]
    assert bench.status() == 0x0301


@spec("PMD-TRJ-2", "PMD-T-9")
def test_backwards_is_the_mirror_image(chip: Bench) -> None:
    chip.move(pos=-20, vel=4 << 16, acc=1 << 16)
    assert chip.trace("target", 8) == [-1, -3, -6, -10, -14, -17, -19, -20]


@spec("PMD-TRJ-3")
def test_position_and_velocity_may_change_in_motion(chip: Bench) -> None:
    chip.move(pos=10_000, vel=4 << 16, acc=1 << 15)
    chip.next_cycle(20)
    chip.move(vel=2 << 16)
    assert [v / 2**16 for v in _speeds(chip, 5)] == [3.5, 3.0, 2.5, 2.0, 2.0]
    chip.move(pos=-50)
    chip.next_cycle(200)
    assert chip.seen("target") == -50
    assert chip.status() == 0x0301


def _speeds(bench: Bench, cycles: int) -> list[int]:
    speeds = []
    for _ in range(cycles):
        bench.next_cycle()
        speeds.append(bench.probe.profile_velocity >> 16)
    return speeds


@spec("PMD-TRJ-1", "PMD-STA-1", "PMD-T-17")
@pytest.mark.parametrize("up", [True, False])
def test_the_target_wraps_between_the_ends_of_its_range(chip: Bench, up: bool) -> None:
    top, bottom = 1_073_741_823, -1_073_741_824
    end, other, sign = (top, bottom, 1) if up else (bottom, top, -1)
    chip.send("SET_ACTL_POS", end - sign)
    chip.send("SET_PRFL_VEL")
    chip.move(vel=1 << 16, acc=sign << 16)
    chip.next_cycle()
    assert chip.send("GET_TRGT_POS") == end
    assert chip.status() & 0x0002 == 0
    chip.next_cycle()
    assert chip.seen("target") == other
    assert chip.status() & 0x0002


@spec("PMD-TRJ-1")
def test_the_encoder_position_wraps_and_sets_bit_1_too(chip: Bench) -> None:
    chip.send("SET_ACTL_POS", 1_073_741_823)
    chip.next_cycle()
    assert chip.status() == 0x0300
    chip.drive("QuadA1", 1)
    chip.next_cycle()
    assert chip.send("GET_ACTL_POS") == -1_073_741_824
    assert chip.status() == 0x0302


@spec("PMD-TRJ-1")
def test_fractions_of_a_ustep_are_kept(chip: Bench) -> None:
    chip.send("SET_PRFL_VEL")
    chip.move(vel=0x4001, acc=0x4001)  # a quarter ustep and 2^-16 each cycle
    chip.next_cycle(65536)
    assert chip.seen("target") == 65536 // 4 + 1


@spec("PMD-TRJ-8")
def test_in_motion_from_the_update_s_cycle_to_the_last(chip: Bench) -> None:
    chip.move(pos=3, vel=1 << 16, acc=1 << 16)
    assert chip.status() & 0x0400 == 0
    chip.next_cycle()
    for _ in range(2):
        assert chip.seen("status") & 0x0400
        chip.next_cycle()
    assert chip.seen("status") == 0x0301


@spec("PMD-TRJ-8", "PMD-TRJ-12", "PMD-ERR-1")
@pytest.mark.parametrize(("vel", "acc"), [(0, 1 << 16), (4 << 16, 0), (0, 0), (4 << 16, 1 << 30)])
def test_a_move_that_cannot_begin_is_not_in_motion(bench: Bench, vel: int, acc: int) -> None:
    bench.send("SET_START_VEL", 1 << 16)
    bench.move(pos=20, vel=vel, acc=acc)  # an acceleration has 30 bits
    bench.next_cycle(5)
    assert bench.status() == 0x0300
    assert bench.seen("target") == 0
    bench.send("SET_START_VEL", 0)
    bench.move(vel=4 << 16, acc=1 << 16)
    bench.next_cycle()
    assert bench.seen("target") == 1
    assert bench.status() == 0x0700
    bench.next_cycle(7)
    assert bench.seen("target") == 20
    assert bench.status() == 0x0301
    assert bench.rules() == ["no-rate", "without-current"]


@spec("PMD-CMD-64")
def test_a_profile_that_ends_without_a_motor_command_is_noted(bench: Bench) -> None:
    bench.move(pos=20, vel=4 << 16, acc=1 << 16)
    bench.next_cycle(6)
    assert bench.rules() == [], "it has not ended yet"
    bench.next_cycle(10)
    assert bench.rules() == ["without-current"]
    assert bench.violations[0].detail == (
        "axis 1: the profile has run to its end while the motor command was 0: set it by"
        " SET_MTR_CMD, or by SET_BUF_MTR_CMD and UPDATE"
    )
    assert bench.violations[0].severity == "note"
    bench.send("SET_MTR_CMD", 1)
    bench.move(pos=0)
    bench.next_cycle(20)
    assert bench.seen("target") == 0
    assert bench.rules().count("without-current") == 1, "a motor command carries a current"


@spec("PMD-TRJ-8", "PMD-TRJ-12")
def test_a_move_whose_top_velocity_becomes_0_ends_in_motion_complete(bench: Bench) -> None:
    bench.move(pos=1000, vel=4 << 16, acc=2 << 16)
    bench.next_cycle(5)
    at = bench.seen("target")
    bench.move(vel=0)
    bench.next_cycle()
    assert (bench.seen("target"), bench.seen("status")) == (at + 2, 0x0700)
    bench.next_cycle()
    assert (bench.seen("target"), bench.seen("status")) == (at + 2, 0x0301)
    bench.send("CLR_STATUS")
    bench.next_cycle(5)
    assert bench.status() == 0x0300
    bench.move(vel=4 << 16, acc=1 << 16)  # any parameter may change now
    bench.next_cycle(400)
    assert bench.seen("target") == 1000
    assert bench.status() == 0x0301


@spec("PMD-TRJ-12")
def test_a_top_velocity_of_0_that_comes_while_the_move_turns_round_completes_it(
    chip: Bench,
) -> None:
    chip.send("SET_START_VEL", 3 << 16)
    chip.move(pos=1000, vel=4 << 16, acc=2 << 16)
    chip.next_cycle(5)
    chip.move(pos=-1000)
    chip.next_cycle()
    assert chip.seen("velocity") == 0
    assert chip.seen("status") == 0x0700
    at = chip.seen("target")
    chip.move(vel=0)
    chip.next_cycle()
    assert (chip.seen("target"), chip.seen("status")) == (at, 0x0301)
    chip.next_cycle(5)
    assert (chip.seen("target"), chip.seen("status")) == (at, 0x0301)


@spec("PMD-TRJ-12")
def test_a_move_that_turns_round_and_is_put_on_its_destination_is_complete(chip: Bench) -> None:
    chip.send("SET_START_VEL", 3 << 16)
    chip.send("SET_ACTL_POS", -1000)
    chip.move(pos=0, vel=4 << 16, acc=2 << 16)
    chip.next_cycle(5)
    chip.move(pos=-1000)
    chip.next_cycle()
    assert chip.seen("velocity") == 0
    chip.send("SYNCH_PRFL")  # the encoder has stayed at -1000
    chip.move()
    chip.next_cycle()
    assert (chip.seen("target"), chip.seen("status")) == (-1000, 0x0301)


@spec("PMD-TRJ-8", "PMD-TRJ-2")
def test_a_fraction_of_velocity_left_by_an_s_curve_is_no_motion_without_acceleration(
    chip: Bench,
) -> None:
    chip.send("SET_PRFL_S_CRV")
    chip.move(pos=2000, vel=10 << 16, max_acc=1, jerk=1)
    chip.next_cycle(3)
    assert 0 < chip.probe.profile_velocity < 1 << 16
    chip.send("SET_PRFL_TRAP")
    chip.next_cycle()
    assert chip.status() == 0x0301


@spec("PMD-TRJ-12", "PMD-CMD-8")
def test_an_update_to_the_present_position_completes_in_the_next_cycle(chip: Bench) -> None:
    chip.send("SET_ACTL_POS", 77)
    chip.move(pos=77, vel=1 << 16, acc=1 << 16)
    assert chip.seen("status") == 0x0300
    chip.next_cycle()
    assert chip.seen("status") == 0x0301


@spec("PMD-TRJ-12", "PMD-CMD-36")
def test_an_update_that_moves_nothing_does_not(chip: Bench) -> None:
    chip.move(vel=1 << 16, acc=1 << 16)
    chip.next_cycle(3)
    assert chip.status() == 0x0300
    chip.move(pos=5)
    chip.next_cycle(20)
    chip.send("CLR_STATUS")
    chip.send("UPDATE")
    chip.next_cycle(3)
    assert chip.status() == 0x0300


@spec("PMD-ERR-4")
def test_a_start_velocity_above_the_top_velocity_starts_at_the_top(chip: Bench) -> None:
    chip.send("SET_START_VEL", 9 << 16)
    chip.move(pos=10, vel=4 << 16, acc=1 << 16)
    assert chip.trace("target", 3) == [4, 8, 10]
    assert chip.status() == 0x0301


# -- properties -------------------------------------------------------------------------------


@spec("PMD-TRJ-2")
@settings(deadline=None, max_examples=300)
@given(
    goal=st.integers(-1000, 1000),
    top=st.integers(1 << 15, 50 << 16),
    accel=st.integers(2000, 20 << 16),
    start=st.integers(0, 8 << 16),
    turns=st.lists(st.tuples(st.integers(1, 40), st.integers(-1000, 1000)), max_size=3),
)
def test_every_move_lands_exactly_within_its_limits(
    goal: int, top: int, accel: int, start: int, turns: list[tuple[int, int]]
) -> None:
    """Also after changes of the destination on the way: |dv| <= A above the start velocity."""
    profile, active = Profile(), ProfileRegisters()
    active.position, active.velocity, active.acceleration = goal, top, accel
    done = profile.start(active, True)
    cycle, slow = 0, 0
    pending = list(turns)
    while True:
        before = profile.velocity >> 16
        done = profile.step(active, start, 0) != 0 or done
        speed = profile.moved >> 16
        assert abs(speed) <= top
        if abs(before) > start and abs(speed) > start and (speed > 0) == (before > 0):
            assert abs(speed - before) <= accel
        slow = slow + 1 if 0 < abs(speed) < start else 0
        assert slow <= 2 or start > top
        cycle += 1
        if pending and cycle == pending[0][0]:
            active.position = pending.pop(0)[1]
            done = profile.start(active, True)
        elif done:
            if not pending:
                break
            active.position = pending.pop(0)[1]
            done = profile.start(active, True)
        assert cycle < 30_000
    assert profile.position == active.position << 32
    assert profile.velocity == 0
