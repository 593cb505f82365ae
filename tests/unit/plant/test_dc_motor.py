"""The DC motor: what a physicist would expect of it, and that it really comes to rest."""

import pytest

from vbus.core.bits import clamp
from vbus.core.state import save
from vbus.plant.dc_motor import DcMotor

PERIOD = 256e-6
"""Sample period of an LM629 at 8 MHz."""

V, R, K, J = 24.0, 2.5, 0.03, 5e-6
"""Supply, resistance, motor constant and inertia of the default motor."""
VISCOUS, COULOMB, STATIC = 1e-6, 0.002, 0.0025
FREE: dict[str, float] = {
    "viscous_friction": 0.0, "coulomb_friction": 0.0, "static_friction": 0.0,
}  # fmt: skip


def motor(**settings: float) -> DcMotor:
    plant = DcMotor(settings)
    plant.prepare(PERIOD)
    return plant


def run(plant: DcMotor, command: float, seconds: float) -> DcMotor:
    for _ in range(round(seconds / PERIOD)):
        plant.drive(command, 0)
    return plant


@pytest.mark.parametrize("command", [1.0, 0.5, -0.25])
def test_the_no_load_speed_is_what_is_left_of_the_voltage_after_friction(command):
    plant = run(motor(), command, 0.3)
    torque = K * V * abs(command) / R - COULOMB
    speed = torque / (K * K / R + VISCOUS)
    assert abs(plant.velocity) == pytest.approx(speed, rel=1e-6)
    assert plant.velocity * command > 0
    assert abs(plant.current) * K == pytest.approx(COULOMB + VISCOUS * speed, rel=1e-6)


def test_the_encoder_counts_four_times_its_lines_a_revolution():
    plant = run(motor(**FREE, encoder_lines=500), 1.0, 0.3)
    start = plant.count
    run(plant, 1.0, 1.0)
    assert plant.velocity == pytest.approx(800.0)
    # 800 rad/s for 3906 periods of 256 us, 2000 counts to 2 pi.
    assert plant.count - start == pytest.approx(800 * 3906 * PERIOD * 2000 / 6.2831853, abs=2)


def test_the_speed_rises_with_the_mechanical_time_constant():
    constant = J * R / (K * K)
    plant = run(motor(**FREE, inductance=0.0), 1.0, constant)
    assert plant.velocity == pytest.approx(800 * (1 - 1 / 2.718281828), rel=0.01)


def test_the_current_of_a_blocked_motor_rises_with_the_electrical_time_constant():
    constant = 5e-3 / R
    plant = run(motor(inductance=5e-3, static_friction=1.0), 1.0, constant)
    assert plant.velocity == 0.0
    assert plant.current == pytest.approx(9.6 * (1 - 1 / 2.718281828), rel=0.03)


def test_without_inductance_the_current_follows_at_once():
    plant = motor(inductance=0.0, static_friction=1.0)
    plant.drive(1.0, 0)
    assert plant.current == pytest.approx(9.6)


def test_the_amplifier_saturates_at_its_supply():
    courses = [[motor(gain=48.0).drive(c, 0) for _ in range(50)] for c in (0.5, 0.7, 1.0)]
    assert courses[0] == courses[1] == courses[2]
    backward = run(motor(gain=48.0), -1.0, 0.3)
    assert backward.velocity == -run(motor(gain=24.0), 1.0, 0.3).velocity


@pytest.mark.parametrize(("load", "direction"), [(0.28, 1), (0.2875, 0), (0.289, 0), (0.3, -1)])
def test_at_stall_torque_the_motor_neither_lifts_its_load_nor_drops_it(load, direction):
    # Stall torque is 0.03 * 24 / 2.5 = 0.288 N*m; friction holds 0.0025 N*m either way.
    plant = motor(load_torque=load, inductance=0.0)
    run(plant, 1.0, 0.5)
    assert (plant.velocity > 0) - (plant.velocity < 0) == direction
    assert (plant.count > 0) - (plant.count < 0) == direction


@pytest.mark.parametrize(("load", "moves"), [(0.0024, False), (0.0026, True)])
def test_static_friction_holds_a_load_below_it_and_not_above(load, moves):
    for sign in (1, -1):
        plant = run(motor(load_torque=sign * load), 0.0, 0.5)
        assert (plant.count != 0) is moves
        assert plant.resting() is not moves
        if moves:
            assert plant.count * sign < 0


def test_the_motor_breaks_away_at_static_friction_and_keeps_going_at_coulomb_friction():
    # 0.0025 N*m need 0.2083 V, 0.002 N*m need 0.1667 V.
    plant = run(motor(), 0.2075 / V, 0.2)
    assert (plant.count, plant.velocity, plant.resting()) == (0, 0.0, True)
    run(plant, 0.2090 / V, 0.2)
    assert plant.velocity > 0
    run(plant, 0.1800 / V, 0.5)
    assert plant.velocity > 0
    run(plant, 0.1600 / V, 0.5)
    assert plant.velocity == 0.0


def test_a_motor_that_coasts_loses_energy_all_the_time_and_comes_to_rest_exactly():
    plant = run(motor(), 1.0, 0.2)
    energy = None
    for _ in range(2000):
        plant.drive(0.0, 0)
        now = 0.5 * J * plant.velocity**2 + 0.5 * 0.0005 * plant.current**2
        assert energy is None or now < energy or (now == energy and plant.velocity == 0.0)
        energy = now
    assert plant.velocity == 0.0
    assert plant.current == 0.0
    count = plant.count
    run(plant, 0.0, 1.0)
    assert (plant.count, plant.velocity) == (count, 0.0)


@pytest.mark.parametrize("command", [0.0, 0.004, -0.004])
def test_at_rest_another_period_changes_no_bit(command):
    plant = run(run(motor(), 0.7, 0.1), command, 0.3)
    assert plant.resting()
    before = save(plant)
    plant.drive(command, 0)
    assert save(plant) == before


def test_a_motor_that_turns_is_not_at_rest():
    plant = motor()
    for _ in range(2000):
        plant.drive(1.0, 0)
        assert not plant.resting()


@pytest.mark.parametrize(("command", "stop"), [(1.0, 700), (-1.0, -300)])
def test_an_end_stop_takes_the_impact_and_holds(command, stop):
    plant = motor(stop_low=-300, stop_high=700)
    counts = [plant.drive(command, 0) for _ in range(1000)]
    assert counts[-1] == stop
    assert min(counts) >= -300
    assert max(counts) <= 700
    assert plant.velocity == 0.0
    assert plant.resting()
    assert abs(plant.current) == pytest.approx(9.6)
    assert plant.course()[-1] + plant.base == stop + 0.5, "in the middle of its count"
    # It lets go in the other direction.
    assert abs(run(plant, -command, 0.005).count - stop) > 20


@pytest.mark.parametrize("period", [64e-6, 256e-6, 2e-3])
def test_the_course_hardly_depends_on_the_period(period):
    plant = motor()
    plant.prepare(period)
    for _ in range(round(0.064 / period)):
        plant.drive(0.5, 0)
    assert plant.count == pytest.approx(6310, rel=0.015)


def test_a_new_length_of_the_period_forgets_the_course_of_the_last_one_and_its_rest():
    plant = run(motor(), 1.0, 0.3)
    rested = motor()
    for period in (64e-6, PERIOD, 64e-6):
        plant.drive(1.0, 0)
        rested.drive(0.0, 0)
        assert plant.count_at(0.5) < plant.count
        assert plant.fraction_at(plant.count) > 0.5
        assert rested.resting()
        plant.prepare(period)
        rested.prepare(period)
        assert plant.count_at(0.5) == plant.count_at(0.001) == plant.count
        assert plant.fraction_at(plant.count) == 0.0
        assert not rested.resting()


@pytest.mark.parametrize(
    "settings", [{"inertia": 1e-12}, {"resistance": 1e-6}, {"back_emf": 100.0}]
)
def test_no_choice_of_parameters_makes_it_unstable(settings):
    plant = run(motor(**settings), 1.0, 0.2)
    assert 0.0 < plant.velocity <= 801.0


def test_a_million_revolutions_away_it_moves_just_the_same():
    here, there = motor(), motor()
    there.count += 2 * 10**9
    there.base += 2 * 10**9
    there._next += 2 * 10**9
    for number in range(1000):
        command = (number % 7 - 3) / 3
        assert there.drive(command, 0) - here.drive(command, 0) == 2 * 10**9
        assert there.velocity == here.velocity


def test_a_stop_may_stand_where_the_shaft_starts():
    plant = motor(stop_low=0, stop_high=700)
    assert [plant.drive(-1.0, 0) for _ in range(20)] == [0] * 20


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"static_friction": 0.001}, "never easier to start"),
        ({"stop_low": 10, "stop_high": 20}, "starts at count 0"),
        ({"stop_low": 10, "stop_high": -10}, "starts at count 0"),
        ({"stop_low": 1, "stop_high": 20}, "starts at count 0"),
        ({"inertia": 0.0}, "inertia"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        DcMotor(settings)


@pytest.mark.parametrize(
    ("kp", "kd"), [(100, 0), (100, 500), (100, 1000), (300, 3000), (1000, 10000), (1000, 20000)]
)
def test_in_a_loop_with_the_gains_of_an_lm629_it_settles_on_its_target(kp, kd):
    def word(value: int) -> int:
        return clamp(value, -0x8000, 0x7FFF)

    plant = motor()
    before = 0
    for _ in range(4000):
        error = 400 - plant.count
        command = word(kp * error + word(kd * (error - before)))
        before = error
        plant.drive(command / 32768, error)
    assert plant.resting()
    assert abs(400 - plant.count) <= 4
