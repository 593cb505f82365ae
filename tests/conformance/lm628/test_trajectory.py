"""The trajectory generator: LTRJ, STT, stops, and the steps of position and velocity mode."""

from itertools import pairwise

import pytest

from tests.conformance.lm628.bench import Bench, Course, Follower
from vbus.chips.lm628.profile import approach

ONE = 1 << 16
"""One count per sample, or per sample squared."""
LARGEST = 0x3FFFFFFF


def desired(bench: Bench, samples: int) -> list[float]:
    """Desired position (counts) in each of the next samples."""
    result = []
    for _ in range(samples):
        bench.next_sample()
        result.append(bench.probe.desired_position / 65536)
    return result


def velocities(bench: Bench, samples: int) -> list[float]:
    result = []
    for _ in range(samples):
        bench.next_sample()
        result.append(bench.probe.desired_velocity / 65536)
    return result


def cruise(bench: Bench, velocity: int = 4, control: int = 0x1800) -> None:
    """Have the axis run in velocity mode, at its velocity."""
    bench.move(control, accel=velocity * ONE, velocity=velocity * ONE)
    bench.next_sample()
    bench.next_sample()
    bench.command("RSTI", 0)


@pytest.mark.spec("LM-TRJ-1", "LM-CMD-20", "LM-BUS-6")
def test_the_data_follow_in_the_order_acceleration_velocity_position(bench):
    bench.command("LTRJ", 0xE0EA, 0x0001, 0x0002, 0x0003, 0x0004, 0xFFFF, 0x0006)

    profile = bench.probe
    assert profile.trajectory_loaded == [0x00010002, 0x00030004, 0xFFFF0006]
    assert profile.trajectory_control_word == 0, "bits 15-13, 7 and 6 are ignored"
    assert bench.probe.words_due == 0


@pytest.mark.spec("LM-TRJ-1")
@pytest.mark.parametrize("bits", range(8))
def test_only_the_parameters_whose_load_bits_are_set_are_sent(bench, bits):
    bench.command("LTRJ", 0x2A, 0, 1, 0, 2, 0, 3)
    control = sum(load for n, load in enumerate((0x20, 0x08, 0x02)) if bits >> n & 1)
    bench.command("LTRJ", control)
    words = 2 * bits.bit_count()
    assert bench.probe.words_due == words
    for word in range(words):
        bench.word(0x100 * (word % 2))

    assert bench.probe.trajectory_loaded == [0x100 if bits >> n & 1 else n + 1 for n in range(3)]
    assert bench.rules() == []


@pytest.mark.spec("LM-TRJ-1", "LM-TRJ-3")
def test_a_relative_bit_without_its_load_bit_is_ignored(bench):
    bench.move(0x0000, accel=ONE, velocity=ONE, position=100)
    bench.next_sample()
    bench.move(0x0015)
    bench.next_sample()

    profile = bench.probe
    assert (profile.acceleration, profile.velocity, profile.target_position) == (ONE, ONE, 100)


@pytest.mark.spec("LM-TRJ-2", "LM-AMB-14")
def test_velocity_and_acceleration_take_all_30_bits(bench):
    bench.move(0x1800, accel=LARGEST, velocity=LARGEST)
    bench.next_sample()

    assert bench.probe.desired_velocity == LARGEST
    assert bench.report("RDDV") == LARGEST
    assert bench.rules() == ["too-fast"]


@pytest.mark.spec("LM-TRJ-2")
def test_what_is_out_of_range_is_cut_and_reported(bench):
    bench.move(0, accel=0xC0000005, velocity=0x40000007, position=0x40000001)
    bench.next_sample()

    profile = bench.probe
    assert (profile.acceleration, profile.velocity, profile.target_position) == (
        5,
        7,
        -(1 << 30) + 1,
    )
    assert bench.rules() == ["range", "range", "range"]
    assert bench.violations[0].detail == "acceleration C0000005H: it is cut to the range"


@pytest.mark.spec("LM-TRJ-2")
@pytest.mark.parametrize("position", [-(1 << 30), (1 << 30) - 1, -1])
def test_positions_of_31_bits_are_in_range(bench, position):
    bench.move(0, accel=ONE, position=position)
    bench.next_sample()
    assert bench.probe.target_position == position
    assert bench.rules() == ["no-velocity"]


@pytest.mark.spec("LM-TRJ-3", "LM-AMB-15")
def test_relative_rates_are_signed_changes_of_the_active_values(bench):
    bench.move(0, accel=5 * ONE, velocity=6 * ONE, position=1)
    bench.next_sample()
    profile = bench.probe
    bench.move(0x0014, accel=-ONE, velocity=2 * ONE)
    bench.next_sample()
    assert (profile.acceleration, profile.velocity) == (4 * ONE, 8 * ONE)
    bench.move(0x0014, accel=-5 * ONE, velocity=-9 * ONE)
    bench.next_sample()
    assert (profile.acceleration, profile.velocity) == (0, 0), "clamped"
    bench.move(0x0004, velocity=LARGEST)
    bench.next_sample()
    bench.move(0x0004, velocity=1)
    bench.next_sample()
    assert profile.velocity == LARGEST, "clamped"
    assert bench.rules() == []


@pytest.mark.spec("LM-TRJ-3")
def test_a_relative_position_adds_to_the_active_target_and_a_bare_stt_does_not_repeat_it(bench):
    bench.move(0, accel=0, velocity=0, position=100)
    bench.next_sample()
    bench.move(0x0001, position=-30)
    bench.next_sample()
    assert bench.probe.target_position == 70
    bench.command("STT")
    bench.next_sample()
    assert bench.probe.target_position == 70


@pytest.mark.spec("LM-TRJ-3")
def test_loading_twice_before_stt_replaces_and_never_accumulates(bench):
    bench.move(0, accel=0, velocity=0, position=100)
    bench.next_sample()
    bench.load(0x0001, position=20)
    bench.load(0x0001, position=30)
    bench.command("STT")
    bench.next_sample()
    assert bench.probe.target_position == 130

    bench.load(0x0001, position=20)
    bench.load(0x0000, position=5)
    bench.command("STT")
    bench.next_sample()
    assert bench.probe.target_position == 5


@pytest.mark.spec("LM-TRJ-3", "LM-POS-2")
def test_a_relative_position_beyond_the_range_wraps(bench):
    bench.move(0, position=(1 << 30) - 1)
    bench.next_sample()
    bench.move(0x0001, position=1)
    bench.next_sample()
    assert bench.probe.target_position == -(1 << 30)


@pytest.mark.spec("LM-TRJ-4", "LM-T-14", "LM-AMB-12")
def test_stt_in_motion_after_a_new_acceleration_is_refused(bench):
    cruise(bench)
    bench.load(0x1800, accel=ONE, velocity=9 * ONE)
    bench.write(0, 0x01)
    end = bench.chip.ready_at()
    bench.at(end - 1)
    assert bench.probe.status_without_busy() == 0x00
    bench.at(end)
    assert bench.probe.status_without_busy() == 0x02, "command error when busy falls"
    assert bench.rules() == ["stt-refused"]

    assert velocities(bench, 3) == [4, 4, 4]
    assert bench.report("RDSIGS") & 0x4000, "acceleration is still loaded"
    assert bench.probe.trajectory_loaded[:2] == [ONE, 9 * ONE], "buffers are kept"

    bench.move(0x0100)
    bench.next_sample()
    assert bench.status() & 0x80, "but the motor can be turned off"
    assert bench.report("RDSIGS") & 0x4000
    bench.move(0x1800, accel=2 * ONE, velocity=5 * ONE)
    assert bench.rules() == ["stt-refused", "off-at-speed"]
    assert velocities(bench, 3) == [2, 4, 5]
    assert not bench.report("RDSIGS") & 0x4000


@pytest.mark.spec("LM-TRJ-4")
def test_a_refused_stt_may_still_stop_smoothly_with_the_active_acceleration(bench):
    bench.move(0x1800, accel=2 * ONE, velocity=6 * ONE)
    velocities(bench, 4)
    bench.move(0x1C00, accel=ONE, velocity=9 * ONE)

    assert velocities(bench, 4) == [4, 2, 0, 0]
    profile = bench.probe
    assert profile.acceleration_waiting
    assert (profile.acceleration, profile.velocity) == (2 * ONE, 6 * ONE), "nothing was copied"
    assert bench.rules() == []

    bench.command("STT")
    assert velocities(bench, 3) == [1, 2, 3], "the motion is over: accepted"


@pytest.mark.spec("LM-TRJ-4", "LM-TRJ-6")
def test_a_stop_of_a_refused_stt_does_not_add_relative_data_once_more(bench):
    bench.move(0x1830, accel=2 * ONE, velocity=6 * ONE)
    velocities(bench, 4)
    bench.move(0x1C00, accel=ONE, velocity=9 * ONE)
    assert velocities(bench, 4) == [4, 2, 0, 0]


@pytest.mark.spec("LM-TRJ-4")
def test_acceleration_may_be_changed_when_the_axis_is_on_target_or_off(bench):
    bench.move(0, accel=ONE, velocity=ONE, position=2)
    desired(bench, 4)
    bench.move(0, accel=2 * ONE, velocity=2 * ONE, position=20)
    bench.next_sample()
    assert bench.probe.acceleration == 2 * ONE
    assert bench.rules() == []


@pytest.mark.spec("LM-TRJ-4")
def test_velocity_and_position_may_be_changed_in_motion(bench):
    bench.move(0, accel=ONE, velocity=4 * ONE, position=1000)
    assert velocities(bench, 5) == [1, 2, 3, 4, 4]
    bench.move(0, velocity=6 * ONE, position=2000)
    assert velocities(bench, 3) == [5, 6, 6]
    assert bench.probe.target_position == 2000


@pytest.mark.spec("LM-TRJ-5", "LM-CMD-2")
@pytest.mark.parametrize(
    ("control", "off", "velocity"),
    [(0x0F00, True, 0), (0x0E00, False, 0), (0x0B00, True, 0), (0x0D00, True, 0)],
)
def test_of_several_stop_bits_the_strongest_counts_and_it_is_reported(
    bench, control, off, velocity
):
    bench.move(0x1800, accel=ONE, velocity=8 * ONE)
    velocities(bench, 8)
    bench.move(control | 0x1000)
    bench.next_sample()

    assert bench.probe.motor_off == off
    assert bench.probe.desired_velocity == velocity
    assert bench.rules() == ["stop-bits", *["off-at-speed"] * off]


@pytest.mark.spec("LM-CMD-2", "LM-TRJ-5")
@pytest.mark.parametrize(("stop", "found"), [(0x100, ["off-at-speed"]), (0x200, []), (0x400, [])])
def test_of_a_single_stop_bit_only_the_motor_off_at_speed_is_noted(bench, stop, found):
    bench.move(0x1800, accel=ONE, velocity=8 * ONE)
    velocities(bench, 8)
    bench.move(stop | 0x1000)
    assert bench.rules() == found


@pytest.mark.spec("LM-TRJ-5", "LM-AMB-18")
@pytest.mark.parametrize("stop", [0x0400, 0x0200])
def test_a_stop_is_used_up_and_the_next_stt_resumes_the_move(bench, stop):
    bench.move(0, accel=ONE, velocity=4 * ONE, position=40)
    desired(bench, 5)
    bench.load(stop)
    bench.command("STT")
    desired(bench, 6)
    assert bench.probe.on_target
    assert bench.probe.trajectory_control_word == 0
    assert bench.probe.desired_position != 40 * ONE

    bench.command("STT")
    desired(bench, 30)
    assert bench.probe.desired_position == 40 * ONE


@pytest.mark.spec("LM-TRJ-5", "LM-AMB-18")
def test_after_a_stop_in_velocity_mode_stt_runs_up_again(bench):
    cruise(bench)
    bench.move(0x1C00)
    assert velocities(bench, 2) == [0, 0]
    bench.command("STT")
    assert velocities(bench, 2) == [4, 4]


@pytest.mark.spec("LM-TRJ-6")
def test_stt_copies_the_buffers_and_clears_on_target_motor_off_and_acceleration_loaded(bench):
    bench.load(0x1800, accel=3, velocity=4, position=5)
    assert bench.report("RDSIGS") & 0x4480 == 0x4080
    bench.command("STT")
    bench.next_sample()

    profile = bench.probe
    assert (profile.acceleration, profile.velocity) == (3, 4)
    assert (profile.velocity_mode, profile.forward) == (True, True)
    assert bench.report("RDSIGS") & 0x4480 == 0
    bench.move(0x0000)
    bench.next_sample()
    assert profile.target_position == 5
    assert not profile.velocity_mode


@pytest.mark.spec("LM-TRJ-7")
def test_turning_the_motor_on_starts_from_where_it_is_without_any_history(make):
    plant = Course()
    bench = make(plant=plant)
    bench.filter(kp=1, ki=256, kd=10, il=0x7FFF)
    bench.move(0x1800, accel=ONE, velocity=ONE)
    desired(bench, 9)
    axis = bench.probe
    assert axis.error_sum > 0
    assert axis.desired_velocity == ONE
    bench.move(0x0100)
    plant.counts = [9000]
    desired(bench, 2)
    assert axis.desired_position == 8 * ONE or axis.desired_position == 9 * ONE

    bench.move(0, position=8000)
    bench.next_sample()
    assert axis.desired_position == 9000 * ONE - ONE, "real position, and one sample toward 8000"
    assert (axis.position_error, axis.error_sum, axis.last_error) == (-1, -1, -1)
    assert axis.motor_command == -1 - 256 - 10, "P, I and D of this one sample"


@pytest.mark.spec("LM-TRJ-8", "LM-AMB-8")
def test_stop_abruptly_holds_the_real_position_at_once(make):
    plant = Course()
    bench = make(plant=plant)
    bench.filter(kp=10)
    cruise(bench)
    plant.counts = [3]
    bench.next_sample()
    bench.next_sample()
    assert bench.probe.real_position == 3 < bench.probe.desired_position >> 16
    bench.move(0x1A00)
    bench.next_sample()

    axis = bench.probe
    assert (axis.desired_position, axis.desired_velocity) == (3 * ONE, 0)
    assert axis.target_position == 3
    assert axis.on_target
    assert axis.status_without_busy() == 0x04
    plant.counts += [1]
    bench.next_sample()
    bench.next_sample()
    assert axis.motor_command == 20, "the loop stays closed"


@pytest.mark.spec("LM-TRJ-9")
def test_stop_smoothly_slows_down_by_the_acceleration_to_a_whole_count(bench):
    bench.move(0x1800, accel=0x18000, velocity=0x50001)
    velocities(bench, 7)
    bench.move(0x1C00)

    assert velocities(bench, 3) == [v / ONE for v in (0x38001, 0x20001, 0x08001)]
    assert not bench.probe.on_target
    position = bench.probe.desired_position
    assert position % ONE
    assert velocities(bench, 2) == [0, 0]
    profile = bench.probe
    assert profile.desired_position == position & ~0xFFFF, "the fraction is dropped"
    assert profile.target_position == position >> 16
    assert profile.on_target
    assert bench.status() == 0x04


@pytest.mark.spec("LM-TRJ-9")
def test_stop_smoothly_of_a_backward_motion_rounds_down_too(bench):
    bench.move(0x0800, accel=0x18000, velocity=0x50000)
    velocities(bench, 6)
    before = bench.probe.desired_position
    bench.move(0x0C00)

    assert velocities(bench, 4) == [-3.5, -2, -0.5, 0]
    assert bench.probe.desired_position == (before - 0x60000) // ONE * ONE


@pytest.mark.spec("LM-TRJ-9")
def test_stop_smoothly_without_acceleration_stops_at_once(bench):
    cruise(bench)
    bench.move(0x0100)
    bench.next_sample()
    bench.move(0x1800, accel=4 * ONE, velocity=4 * ONE)
    velocities(bench, 2)
    bench.probe.acceleration = 0
    bench.load(0x1C00)
    bench.probe.acceleration_loaded = 0
    bench.command("STT")
    assert velocities(bench, 1) == [0]
    assert bench.probe.on_target


@pytest.mark.spec("LM-TRJ-5", "LM-TRJ-9")
def test_stt_during_a_smooth_stop_goes_on_with_the_motion(bench):
    bench.move(0x1800, accel=ONE, velocity=9 * ONE)
    velocities(bench, 9)
    bench.move(0x1C00)
    assert velocities(bench, 2) == [8, 7]
    bench.move(0x1800)
    assert velocities(bench, 3) == [8, 9, 9]


@pytest.mark.spec("LM-TRJ-10")
def test_mechanics_that_follow_exactly_stand_still_while_the_motor_is_off(make):
    bench = make(plant=Follower())
    cruise(bench)
    assert bench.probe.full_position_error == 4
    bench.move(0x0100)
    bench.next_sample()
    bench.next_sample()
    real = bench.probe.real_position
    desired(bench, 5)
    assert bench.probe.real_position == real
    assert bench.chip.telemetry()["error"] == 0


@pytest.mark.spec("LM-TRJ-10", "LM-STA-6")
def test_motor_off_gives_no_drive_freezes_the_profile_and_still_tracks_the_position(make):
    plant = Course()
    bench = make(plant=plant)
    bench.filter(kp=100, ki=100, kd=100, il=1000)
    cruise(bench)
    plant.counts = [0, -5, -9]
    for _ in range(3):
        bench.next_sample()
    assert bench.probe.motor_command != 0
    bench.load(0x0100)
    before = bench.probe.on_target
    bench.command("STT")
    bench.next_sample()

    axis = bench.probe
    position = axis.desired_position
    assert (axis.motor_command, bench.probe.output_code()) == (0, 0x80)
    assert axis.desired_velocity == 0
    assert (axis.error_sum, axis.integration_sum) == (0, 0)
    assert axis.on_target == before
    plant.counts += [70, 80]
    desired(bench, 3)
    assert axis.desired_position == position, "frozen"
    assert axis.real_position == 80
    assert (axis.motor_command, axis.error_sum, axis.derivative) == (0, 0, 0)
    assert bench.report("RDDV") == 0


@pytest.mark.spec("LM-TRJ-11", "LM-TRJ-13")
def test_velocity_mode_ramps_by_the_acceleration_and_keeps_the_fraction(bench):
    bench.move(0x1800, accel=0x4000, velocity=0xC001)

    assert velocities(bench, 5) == [0x4000 / ONE, 0x8000 / ONE, 0xC000 / ONE, *[0xC001 / ONE] * 2]
    assert bench.probe.desired_position == 0x4000 + 0x8000 + 0xC000 + 2 * 0xC001
    assert bench.report("RDDP") == bench.probe.desired_position >> 16


@pytest.mark.spec("LM-TRJ-13")
def test_velocity_mode_changes_direction_through_zero_by_the_acceleration(bench):
    cruise(bench, 4)
    bench.move(0x0800)
    assert velocities(bench, 3) == [0, -4, -4]
    bench.move(0x1800, velocity=2 * ONE)
    assert velocities(bench, 3) == [0, 2, 2]


@pytest.mark.spec("LM-TRJ-13", "LM-AMB-5")
def test_in_velocity_mode_the_active_target_follows_the_desired_position(bench):
    bench.move(0x1800, accel=0x18000, velocity=0x18000)
    for _ in range(5):
        bench.next_sample()
        profile = bench.probe
        assert profile.target_position == profile.desired_position >> 16
    bench.move(0x0001, position=10)
    target = bench.probe.target_position
    bench.next_sample()
    assert bench.probe.target_position == target + 10


@pytest.mark.spec("LM-TRJ-14")
def test_the_desired_position_does_not_wait_for_the_motor(bench):
    cruise(bench, 4)
    start = bench.probe.desired_position
    bench.sample(4000)
    samples = (bench.probe.desired_position - start) // (4 * ONE)
    assert samples > 3900
    assert bench.probe.position_error == bench.probe.desired_position >> 16, "the motor never moved"


@pytest.mark.spec("LM-TRJ-15")
def test_an_acceleration_above_the_velocity_is_not_refused(bench):
    bench.move(0, accel=100 * ONE, velocity=3 * ONE, position=10)
    assert desired(bench, 5) == [3, 6, 9, 10, 10]
    assert bench.rules() == ["hasty"]
    assert bench.probe.on_target


@pytest.mark.spec("LM-TRJ-12")
@pytest.mark.parametrize("slower", [0, 1, 2])
def test_what_is_one_acceleration_too_fast_to_stop_is_slowed_by_one_acceleration(
    slower: int,
) -> None:
    """From the smallest velocity on: what is left after it is the coming sample's, and no stop."""
    assert approach(5, 10 + slower, ONE, 10) == (slower if slower else 5)


@pytest.mark.spec("LM-TRJ-12", "LM-T-5")
def test_the_printed_move_of_20_counts(bench):
    bench.move(0, accel=ONE, velocity=4 * ONE, position=20)
    assert desired(bench, 7) == [1, 3, 6, 10, 14, 17, 19]
    assert not bench.report("RDSIGS") & 0x0400
    assert desired(bench, 1) == [20]
    assert bench.report("RDSIGS") & 0x0400
    assert bench.status() == 0x04
    assert bench.report("RDDV") == 0


@pytest.mark.spec("LM-TRJ-12", "LM-T-6")
def test_the_printed_move_that_does_not_divide_evenly(bench):
    bench.move(0, accel=0x8000, velocity=0x28000, position=11)
    course = []
    for _ in range(9):
        bench.next_sample()
        profile = bench.probe
        course.append((profile.desired_velocity, bench.report("RDDP")))
    assert [velocity for velocity, _ in course[:8]] == [
        0x8000, 0x10000, 0x18000, 0x20000, 0x20000, 0x18000, 0x10000, 0x10000,
    ]  # fmt: skip
    assert [position for _, position in course] == [0, 1, 3, 5, 7, 8, 9, 10, 11]
    assert bench.probe.on_target
    assert bench.probe.desired_velocity == 0, "8000h was the way; it is still at the end"


@pytest.mark.spec("LM-TRJ-12")
@pytest.mark.parametrize("sign", [1, -1])
def test_a_target_moved_behind_the_axis_is_reached_by_turning_round(bench, sign):
    bench.move(0, accel=ONE, velocity=5 * ONE, position=sign * 100)
    assert velocities(bench, 5) == [sign * v for v in (1, 2, 3, 4, 5)]
    bench.move(0, position=0)
    course = desired(bench, 25)
    assert course[-1] == 0
    assert bench.probe.on_target
    rates = [b - a for a, b in pairwise(course)]
    assert max(abs(b - a) for a, b in pairwise(rates)) == 1
    assert min(sign * rate for rate in rates) < 0 < max(sign * rate for rate in rates)
    assert min(sign * position for position in course) == 0, "no overshoot"


@pytest.mark.spec("LM-TRJ-12")
def test_without_acceleration_position_mode_does_not_move(bench):
    bench.move(0, accel=0, velocity=5 * ONE, position=100)
    assert velocities(bench, 3) == [0, 0, 0]
    assert not bench.probe.on_target


@pytest.mark.spec("LM-TRJ-16", "LM-STA-4")
def test_a_move_of_no_length_is_complete_in_its_first_sample(bench):
    bench.move(0, accel=ONE, velocity=ONE, position=0)
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.probe.on_target
    assert bench.status() == 0x04
    bench.command("RSTI", 0)
    bench.command("STT")
    bench.next_sample()
    assert bench.status() == 0x04, "and again, though it was on target before"


@pytest.mark.spec("LM-TRJ-17")
@pytest.mark.parametrize(
    ("hz", "period"),
    [(8_000_000, 256_000_000), (6_000_000, 341_333_333), (1_000_000, 2_048_000_000)],
)
def test_a_sample_is_2048_clocks_exactly_and_does_not_drift(make, hz, period):
    bench = make(hz=hz)
    bench.move(0x1800, accel=ONE, velocity=ONE)
    bench.next_sample()
    position = bench.probe.desired_position >> 16
    for number in (300, 3000, 30_000):
        instant = 2048 * number * 10**12 // hz
        assert abs(instant - number * period) <= number
        bench.at(instant - 1)
        before = bench.probe.desired_position >> 16
        bench.at(instant)
        assert bench.probe.desired_position >> 16 == before + 1
    assert before > position


@pytest.mark.spec("LM-TRJ-17")
def test_the_position_that_turns_the_motor_on_is_that_of_the_same_sample(make):
    plant = Course()
    bench = make(plant=plant)
    bench.filter(kp=10)
    bench.next_sample()
    plant.counts = [7]
    bench.next_sample()
    bench.load(0, accel=2 * ONE, velocity=2 * ONE, position=100)
    bench.command("LFIL", 0x0008, 50)
    while bench.now % (256 * 10**6) > 50 * 10**6:
        bench.run(10**6)
    bench.next_sample()
    bench.command("STT")
    bench.command("UDF")
    bench.next_sample()

    axis = bench.probe
    assert axis.desired_position == (7 + 2) * ONE, "read, taken and stepped in one sample"
    assert axis.motor_command == 2 * 50, "with the filter that UDF brought in it"


@pytest.mark.spec("LM-T-1", "LM-T-2", "LM-T-3")
def test_the_manuals_worked_example_in_its_codes():
    counts = 500 * 4 * 100
    assert (counts, f"{counts:08X}") == (200_000, "00030D40")
    velocity = round(500 * 4 * 341e-6 / 60 * 600 * 65536)
    assert (velocity, f"{velocity:08X}") == (446_956, "0006D1EC")
    acceleration = round(2.33e-4 * 65536)
    assert (acceleration, f"{acceleration:08X}") == (15, "0000000F")


@pytest.mark.spec("LM-T-1", "LM-T-2", "LM-T-3", "LM-T-4")
def test_the_manuals_worked_example_as_a_move(make):
    bench = make(part="LM629N-6", hz=6_000_000, plant=Follower())
    bench.filter(kp=1)
    bench.move(0, accel=0x0000000F, velocity=0x0006D1EC, position=0x00030D40)
    bench.next_sample()
    first = bench.chip.clock.cycle_at(bench.now) // 2048

    bench.sample(first + 29_560 - 1)
    assert bench.probe.desired_velocity == 443_400 == 0x6C408
    assert bench.probe.desired_position >> 16 == 100_001
    bench.sample(first + 29_560)
    assert bench.probe.desired_velocity < 443_400, "the velocity that was asked for is not reached"
    bench.sample(first + 59_121 - 2)
    assert not bench.probe.on_target
    assert (200_000 << 16) - bench.probe.desired_position == 5
    assert bench.probe.desired_velocity == 15
    bench.sample(first + 59_121 - 1)
    assert bench.probe.on_target
    assert bench.report("RDDP") == 200_000
    assert round(59_121 * 341e-6, 2) == 20.16


# -- data loaded ahead --------------------------------------------------------------------------


@pytest.mark.spec("LM-TRJ-6", "LM-CMD-2", "LM-CMD-20")
def test_what_is_loaded_after_stt_waits_for_the_next_one(bench):
    bench.load(0, accel=ONE, velocity=4 * ONE, position=20)
    bench.next_sample()
    bench.command("STT")
    bench.load(0, accel=2 * ONE, velocity=9 * ONE, position=500)
    profile = bench.probe
    assert bench.probe.start_waiting, "all of this within one sample"
    bench.next_sample()
    assert (profile.acceleration, profile.velocity, profile.target_position) == (ONE, 4 * ONE, 20)
    assert profile.trajectory_loaded == [2 * ONE, 9 * ONE, 500]
    assert profile.acceleration_waiting
    for _ in range(10):
        bench.next_sample()
    bench.command("STT")
    bench.next_sample()
    assert (profile.acceleration, profile.velocity, profile.target_position) == (
        2 * ONE,
        9 * ONE,
        500,
    )
    assert not profile.acceleration_waiting


@pytest.mark.spec("LM-TRJ-5", "LM-TRJ-10", "LM-CMD-2")
@pytest.mark.parametrize("stop", [0x0100, 0x0200, 0x0400])
def test_a_stop_is_not_lost_to_data_loaded_after_it(bench, stop):
    bench.move(0x1800, accel=ONE, velocity=4 * ONE)
    for _ in range(6):
        bench.next_sample()
    bench.command("LTRJ", stop)
    bench.command("STT")
    bench.load(0x1800, velocity=2 * ONE)
    assert bench.probe.start_waiting, "all of this within one sample"
    for _ in range(6):
        bench.next_sample()
    assert bench.probe.motor_off == (stop == 0x0100)
    assert bench.probe.desired_velocity == 0
    bench.command("STT")
    for _ in range(6):
        bench.next_sample()
    assert (bench.probe.motor_off, bench.probe.desired_velocity) == (False, 2 * ONE)


@pytest.mark.spec("LM-TRJ-3", "LM-TRJ-6")
def test_relative_data_loaded_after_stt_counts_from_the_target_of_the_one_before(bench):
    bench.load(0, accel=ONE, velocity=4 * ONE, position=20)
    bench.next_sample()
    bench.command("STT")
    bench.load(0x0001, position=5)
    assert bench.probe.start_waiting, "all of this within one sample"
    bench.next_sample()
    assert bench.probe.target_position == 20
    bench.command("STT")
    bench.next_sample()
    assert bench.probe.target_position == 25
    bench.command("STT")
    bench.next_sample()
    assert bench.probe.target_position == 25, "used up"


@pytest.mark.spec("LM-TRJ-5", "LM-TRJ-4", "LM-CMD-2")
@pytest.mark.parametrize(
    ("first", "second", "velocity"), [(0x1A00, 0x1C00, 0), (0x1C00, 0x1A00, 0), (0x1800, 0x1C00, 7)]
)
def test_of_two_stts_in_one_sample_both_count_if_the_second_may_only_stop(
    bench, first, second, velocity
):
    bench.move(0x1800, accel=ONE, velocity=8 * ONE)
    velocities(bench, 8)
    bench.move(first, velocity=9 * ONE)
    bench.load(second, accel=3 * ONE)
    bench.command("STT")
    assert bench.probe.start_waiting, "all of this within one sample"
    bench.next_sample()

    profile = bench.probe
    assert profile.desired_velocity == velocity * ONE, (
        "the stronger stop wins, whichever came first"
    )
    assert (profile.acceleration, profile.velocity) == (ONE, 9 * ONE), (
        "what the first has taken, but no more"
    )
    assert profile.acceleration_waiting


@pytest.mark.spec("LM-TRJ-5", "LM-CMD-2")
def test_of_two_stts_in_one_sample_that_may_both_start_the_last_counts(bench):
    bench.move(0x1800, accel=ONE, velocity=8 * ONE)
    velocities(bench, 4)
    bench.move(0x1A00)
    bench.command("STT")
    assert bench.probe.start_waiting, "both within one sample"
    assert velocities(bench, 3) == [5, 6, 7], "not stopped"


# -- the active target ----------------------------------------------------------------------------


def run_and_stop(bench: Bench, position: int = 0, samples: int = 2) -> None:
    """60 samples in velocity mode, and the first ones of a smooth stop."""
    bench.command("LTRJ", 0x182A, 0x0000, 0x4000, 0x000A, 0x0000, *words(position))
    bench.command("STT")
    assert desired(bench, 60)[-1] == 405
    bench.command("LTRJ", 0x1C00)
    bench.command("STT")
    assert desired(bench, samples)[-1] == (424.25 if samples == 2 else 600)


def words(value: int) -> tuple[int, int]:
    return value >> 16 & 0xFFFF, value & 0xFFFF


@pytest.mark.spec("LM-TRJ-13", "LM-TRJ-3")
@pytest.mark.parametrize("buffered", [0, 7000])
def test_in_a_smooth_stop_a_relative_position_counts_from_the_desired_position(bench, buffered):
    run_and_stop(bench, buffered)
    bench.command("LTRJ", 0x0003, *words(100))
    bench.command("STT")
    bench.next_sample()
    assert bench.probe.target_position == 524
    assert desired(bench, 200)[-1] == 524
    assert bench.probe.on_target


@pytest.mark.spec("LM-AMB-5", "LM-CMD-22", "LM-TRJ-13")
def test_in_a_smooth_stop_sbpr_counts_from_the_desired_position(make):
    bench = make(plant=Follower())
    bench.command("RSTI", 0)
    run_and_stop(bench, 7000)
    bench.command("SBPR", 0, 40)
    assert (bench.probe.breakpoint, bench.probe.real_position) == (464, 414)
    seen = []
    for _ in range(6):
        bench.next_sample()
        seen.append((bench.report("RDRP"), bench.status()))
    assert seen == [(424, 0), (433, 0), (442, 0), (451, 0), (459, 0), (468, 0x40)]


@pytest.mark.spec("LM-TRJ-9", "LM-TRJ-3", "LM-AMB-5")
@pytest.mark.parametrize("buffered", [0, 7000])
def test_after_a_smooth_stop_relative_values_count_from_where_it_ended(bench, buffered):
    run_and_stop(bench, buffered, 40)
    assert bench.probe.on_target
    bench.command("SBPR", *words(-30))
    assert bench.probe.breakpoint == 570
    bench.move(0x0001, position=-100)
    bench.next_sample()
    assert bench.probe.target_position == 500


@pytest.mark.spec("LM-TRJ-9", "LM-TRJ-4")
@pytest.mark.parametrize("mode", [0x1800, 0x0000])
def test_a_smooth_stop_with_an_acceleration_loaded_takes_the_target_along(bench, mode):
    bench.move(mode, accel=ONE, velocity=6 * ONE, position=1000)
    velocities(bench, 8)
    bench.load(0x1C00, accel=2 * ONE)
    bench.command("STT")

    profile = bench.probe
    for velocity in (5, 4, 3, 2, 1, 0):
        bench.next_sample()
        assert profile.desired_velocity == velocity * ONE
        assert profile.target_position == profile.desired_position >> 16
    assert profile.on_target
    assert profile.position_loaded == 1000


@pytest.mark.spec("LM-TRJ-5", "LM-TRJ-6", "LM-AMB-18")
@pytest.mark.parametrize(
    ("stop", "place"), [(0x0400, 30), (0x0200, 0), (0x0100, 1000)],
    ids=["smoothly", "abruptly", "motor off"],
)  # fmt: skip
@pytest.mark.parametrize("relative", [0, 1])
def test_a_position_loaded_with_a_stop_stays_buffered_until_the_next_stt(
    bench, stop, place, relative
):
    bench.move(0, accel=ONE, velocity=5 * ONE, position=1000)
    assert desired(bench, 6)[-1] == 20
    bench.load(stop | relative, position=7000)
    bench.command("STT")
    profile = bench.probe
    bench.next_sample()
    assert profile.target_position == {30: 24, 0: 0, 1000: 1000}[place]
    assert (profile.position_loaded, profile.relative[2]) == (7000, bool(relative))
    desired(bench, 6)
    assert profile.target_position == place, (
        "where it stopped; with the motor off where the move went"
    )
    bench.command("SBPR", 0, 5)
    assert bench.probe.breakpoint == place + 5

    bench.command("STT")
    bench.next_sample()
    assert profile.target_position == (place + 7000 if relative else 7000)
    bench.command("STT")
    bench.next_sample()
    assert profile.target_position == (place + 7000 if relative else 7000), "used up"


@pytest.mark.spec("LM-TRJ-6", "LM-TRJ-5", "LM-AMB-18")
def test_a_position_that_velocity_mode_never_started_is_reached_after_the_stop(bench):
    run_and_stop(bench, 7000)
    bench.command("LTRJ", 0)
    bench.command("STT")
    assert desired(bench, 1000)[-1] == 7000


@pytest.mark.spec("LM-TRJ-6", "LM-TRJ-3", "LM-TRJ-1")
def test_a_stop_takes_relative_rates_and_its_direction_but_no_position(bench):
    bench.move(0x1800, accel=ONE, velocity=6 * ONE, position=1000)
    velocities(bench, 8)
    bench.load(0x0C05, velocity=2 * ONE, position=9)
    bench.command("STT")
    bench.next_sample()

    profile = bench.probe
    assert (profile.velocity, profile.forward, profile.velocity_mode) == (8 * ONE, False, True)
    assert profile.trajectory_loaded == [ONE, 8 * ONE, 9]
    assert profile.relative == [False, False, True]


@pytest.mark.spec("LM-TRJ-13", "LM-TRJ-10", "LM-AMB-5")
@pytest.mark.parametrize("control", [0x0100, 0x0900])
def test_motor_off_in_velocity_mode_leaves_the_desired_position_as_the_target(make, control):
    plant = Course()
    bench = make(plant=plant)
    cruise(bench)
    bench.move(control, position=7000)
    plant.counts = [-9, -9]
    desired(bench, 4)
    profile = bench.probe
    assert (profile.desired_position, profile.target_position) == (8 * ONE, 8)
    bench.command("SBPR", 0, 5)
    assert bench.probe.breakpoint == 13


@pytest.mark.spec("LM-TRJ-13", "LM-TRJ-10")
def test_velocity_mode_chosen_while_the_motor_goes_off_makes_the_desired_position_the_target(bench):
    bench.move(0, accel=ONE, velocity=5 * ONE, position=1000)
    assert desired(bench, 6)[-1] == 20
    bench.move(0x0900)
    bench.next_sample()
    assert bench.report("RDSIGS") & 0x0880 == 0x0880
    assert bench.probe.target_position == 20


@pytest.mark.spec("LM-TRJ-9", "LM-POS-6")
def test_an_error_that_ends_a_smooth_stop_leaves_the_desired_position_as_the_target(make):
    bench = make(plant=Course())
    bench.move(0x1800, accel=ONE, velocity=9 * ONE, position=7000)
    assert desired(bench, 12)[-1] == 72
    bench.command("LPES", 85)
    bench.move(0x1C00)
    desired(bench, 3)
    assert bench.probe.motor_off
    profile = bench.probe
    assert (profile.desired_position, profile.target_position) == (87 * ONE, 87)


@pytest.mark.spec("LM-POS-4", "LM-TRJ-9")
def test_home_in_a_smooth_stop_moves_the_target_along(make):
    bench = make(plant=Follower())
    run_and_stop(bench, 7000)
    assert bench.probe.real_position == 414
    bench.command("DFH")
    profile = bench.probe
    assert (profile.desired_position, profile.target_position) == (0xA4000, 10)
    bench.next_sample()
    assert profile.target_position == profile.desired_position >> 16 == 19
    assert desired(bench, 60)[-1] == 600 - 414
    bench.command("DFH")
    bench.move(0x0001, position=25)
    bench.next_sample()
    assert profile.target_position == 25


@pytest.mark.spec("LM-TRJ-5", "LM-TRJ-4", "LM-TRJ-6")
@pytest.mark.parametrize("relative", [0, 1])
def test_a_move_that_is_stopped_in_the_sample_that_would_begin_it_was_not_started(bench, relative):
    bench.move(0, accel=ONE, velocity=5 * ONE, position=1000)
    assert desired(bench, 6)[-1] == 20
    bench.move(relative, position=7000)
    bench.load(0x0100, accel=3 * ONE)
    bench.command("STT")
    assert bench.probe.start_waiting, "all of this within one sample"
    bench.next_sample()
    assert bench.probe.motor_off
    assert bench.probe.target_position == 1000

    bench.move(0)
    bench.next_sample()
    assert bench.probe.target_position == 7000 + 1000 * relative
