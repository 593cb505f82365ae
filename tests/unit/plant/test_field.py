"""Phase currents to a field, with two phases and with three."""

import pytest

from vbus.core.state import load, save
from vbus.plant.stepper import StepperMotor, field


def test_two_phases_are_sine_and_cosine():
    assert field(0.6, 0.8, 0.0, False) == (0.6, 0.8, False)
    assert field(0.6, 0.8, 0.0, True) == (0.6, 0.8, False)


@pytest.mark.parametrize("three", [False, True])
def test_three_phases_are_taken_together(three):
    # At a third of a turn A is sin 120, B sin 240 and C sin 0.
    across, along, found = field(0.5, 0.5, -1.0, three)
    assert found
    assert (across, along) == pytest.approx((0.5, 0.8660254))


def test_where_the_third_current_is_0_the_last_answer_holds():
    across, along, three = field(0.8660254, -0.8660254, 0.0, True)
    assert three
    assert (across, along) == pytest.approx((0.8660254, -0.5))
    assert field(0.7, -0.7, 0.0, False) == (0.7, -0.7, False)


def test_a_motor_remembers_how_many_phases_it_has_when_it_is_saved():
    plant = StepperMotor()
    plant.phases(0.5, 0.5, -1.0)
    copy = StepperMotor()
    load(copy, save(plant))
    for _ in range(100):
        assert copy.phases(0.8, -0.8, 0.0) == plant.phases(0.8, -0.8, 0.0)
    assert save(copy) == save(plant)
    other = StepperMotor()
    for _ in range(100):
        other.phases(0.8, -0.8, 0.0)
    assert other.count != plant.count
