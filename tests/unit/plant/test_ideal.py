"""The ideal plant: a follower in whole counts."""

from math import cos, pi, sin

import pytest

from vbus.plant.ideal import IdealPlant


def test_it_moves_by_the_error_in_each_period():
    plant = IdealPlant()
    assert [plant.drive(0.0, error) for error in (3, 0, -5, 32767)] == [3, 3, -2, 32765]


def test_its_course_is_a_straight_line():
    plant = IdealPlant()
    plant.drive(0.0, 10)
    assert [plant.count_at(tenth / 10) for tenth in range(11)] == list(range(11))
    assert plant.fraction_at(1) == pytest.approx(0.05)
    assert plant.fraction_at(10) == pytest.approx(0.95)


@pytest.mark.parametrize(
    ("settings", "steps", "counts"),
    [
        ({}, [1, 1, -3, 200], [10, 20, -10, 1990]),
        ({"steps_per_rev": 2000}, [7, -9], [7, -2]),
        ({"encoder_lines": 25, "steps_per_rev": 200}, [1, 1, 1, -4], [0, 1, 1, -1]),
    ],
)
def test_it_makes_every_step_pulse(settings, steps, counts):
    plant = IdealPlant(settings)
    assert [plant.pulses(step) for step in steps] == counts


def currents(microstep: int, amplitude: float, three: bool) -> tuple[float, float, float]:
    """Phase currents of a microstepping driver, cut to 15 bits as the MC1241A gives them."""
    turn = 2 * pi * microstep / 256
    a = round(32767 * amplitude * sin(turn))
    if not three:
        return a / 32767, round(32767 * amplitude * cos(turn)) / 32767, 0.0
    b = round(32767 * amplitude * sin(turn + 2 * pi / 3))
    return a / 32767, b / 32767, -(a + b) / 32767


@pytest.mark.parametrize("three", [False, True])
@pytest.mark.parametrize("amplitude", [1.0, -1.0, 0.05])
@pytest.mark.parametrize("direction", [1, -1])
def test_it_follows_the_microsteps_of_two_and_three_phases(three, amplitude, direction):
    # With 3200 lines a microstep is a count.
    plant = IdealPlant({"encoder_lines": 3200})
    half_a_cycle = plant.phases(*currents(0, amplitude, three))
    assert half_a_cycle == (-128 if amplitude < 0 else 0)
    for microstep in range(1, 700):
        count = plant.phases(*currents(direction * microstep, amplitude, three))
        assert count == half_a_cycle + direction * microstep


def test_without_currents_it_stays():
    plant = IdealPlant({"encoder_lines": 3200})
    plant.phases(*currents(40, 1.0, False))
    assert plant.phases(0.0, 0.0, 0.0) == 40


def test_it_rests_in_a_period_that_asks_for_nothing():
    plant = IdealPlant({"encoder_lines": 1})
    plant.drive(0.0, 1)
    assert not plant.resting()
    plant.drive(0.0, 0)
    assert plant.resting()
    # A step too small for the encoder is a step all the same.
    plant.pulses(1)
    assert not plant.resting()
    plant.pulses(0)
    assert plant.resting()
    plant.phases(*currents(3, 1.0, False))
    assert not plant.resting()
    plant.phases(*currents(3, 1.0, False))
    assert plant.resting()
