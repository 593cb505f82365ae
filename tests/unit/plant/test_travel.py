"""What a motor between stops does, decided without following it where that is certain."""

import pytest

from vbus.plant.response import Motor
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
    travel = Travel(RESISTANCE, INDUCTANCE, CONSTANT, CONSTANT, INERTIA, 0.0)
    motor = Motor(RESISTANCE, INDUCTANCE, CONSTANT, CONSTANT, INERTIA, 0.0, 318.0)
    travel.response = motor.response(PERIOD)
    travel.volts = volts
    assert travel.clear(1.0, current, speed, torque, PERIOD)
    assert lowest_speed(volts, current, speed, torque) > 0.0


def test_one_that_swings_through_zero_is_followed() -> None:
    travel = Travel(RESISTANCE, INDUCTANCE, CONSTANT, CONSTANT, INERTIA, 0.0)
    travel.response = Motor(
        RESISTANCE, INDUCTANCE, CONSTANT, CONSTANT, INERTIA, 0.0, 318.0
    ).response(PERIOD)
    travel.volts = 12.0
    assert not travel.clear(1.0, -400.0, 10.0, 0.0, PERIOD)
    assert lowest_speed(12.0, -400.0, 10.0, 0.0) < 0.0
