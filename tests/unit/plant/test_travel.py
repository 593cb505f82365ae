"""What a motor between stops does, decided without following it where that is certain."""

import pytest

from vbus.plant.dc_motor import DcMotor
from vbus.plant.response import TICKS, Motor
from vbus.plant.travel import Travel

RESISTANCE, INDUCTANCE, CONSTANT, INERTIA = 1.0, 1e-5, 0.05, 1e-5
PERIOD = 256e-6


def lowest_speed(volts: float, current: float, speed: float, torque: float) -> float:
    """Return the lowest speed within a period, by steps so small that they are exact enough."""
    steps = 100_000
    step = PERIOD / steps
    lowest = speed
    for _ in range(steps):
        rise = (volts - RESISTANCE * current - CONSTANT * speed) / INDUCTANCE
        gain = (CONSTANT * current + torque) / INERTIA
        current, speed = current + rise * step, speed + gain * step
        lowest = min(lowest, speed)
    return lowest


@pytest.mark.parametrize(
    ("volts", "current", "speed", "torque"),
    [(12.0, -100.0, 100.0, 0.0), (12.0, -100.0, 100.0, -0.05)],
)
def test_a_speed_that_swings_about_a_higher_one_stays_above_zero(
    volts: float, current: float, speed: float, torque: float
) -> None:
    """It settles at 240 rad/s, or 20 less with the load: the swing about that is smaller."""
    motor = Motor(RESISTANCE, INDUCTANCE, CONSTANT, CONSTANT, INERTIA, 0.0, 318.0)
    travel = Travel(motor)
    travel.response = motor.response(PERIOD)
    travel.volts = volts
    assert travel.clear(1.0, current, speed, torque, PERIOD)
    assert lowest_speed(volts, current, speed, torque) > 0.0


def test_one_that_swings_through_zero_is_followed() -> None:
    motor = Motor(RESISTANCE, INDUCTANCE, CONSTANT, CONSTANT, INERTIA, 0.0, 318.0)
    travel = Travel(motor)
    travel.response = motor.response(PERIOD)
    travel.volts = 12.0
    assert not travel.clear(1.0, -400.0, 10.0, 0.0, PERIOD)
    assert lowest_speed(12.0, -400.0, 10.0, 0.0) < 0.0


def test_a_border_that_a_tick_is_too_short_to_pass_is_passed_when_its_span_says_so() -> None:
    """A tick adds less than the place's last bit, so that no tick by itself gets there."""
    motor = Motor(RESISTANCE, INDUCTANCE, 0.0, 0.0, INERTIA, 0.0, 318.0)
    travel = Travel(motor)
    travel.response = motor.response(PERIOD)
    travel.place, travel.speed = 0.25, 1e-8
    way = 318.0 * 1e-8 * PERIOD
    assert 0.25 + way / TICKS == 0.25 < 0.25 + way / 2
    assert travel.go(TICKS, 0.25 + way / 2, 1.0)
    assert travel.tick == pytest.approx(TICKS / 2, rel=1e-3)


def test_a_shaft_breaks_away_although_rounding_hides_the_tick() -> None:
    """Found by a fit: the last bits of the current did not reach what a longer span had shown."""
    motor = DcMotor({
        "inertia": 0.00032869185589916506, "viscous_friction": 5.4109410839069125e-06,
        "coulomb_friction": 0.002034033347531974, "static_friction": 0.002542541684414967,
        "load_torque": -4.40720834962054e-05,
    })  # fmt: skip
    motor.prepare(PERIOD)
    for _ in range(12):
        motor.drive(-0.008981305516785776, 0)
    assert motor.velocity == pytest.approx(-0.0003960314849486403)
