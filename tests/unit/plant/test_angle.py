"""Sine and angle by arithmetic alone."""

from math import cos, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.plant.angle import sine, turns_of

TURNS = st.floats(-50, 50)


@given(turns=TURNS)
def test_the_sine_is_good_to_a_millionth_of_a_percent(turns):
    assert sine(turns) == pytest.approx(sin(2 * pi * turns), abs=1e-8)


@pytest.mark.parametrize(
    ("turns", "value"), [(0.0, 0.0), (0.25, 1.0), (0.5, 0.0), (0.75, -1.0), (1.0, 0.0)]
)
def test_the_sine_of_quarter_turns(turns, value):
    assert sine(turns) == pytest.approx(value, abs=1e-9)
    assert sine(-turns) == pytest.approx(-value, abs=1e-9)


@given(turns=st.floats(0, 1, exclude_max=True), length=st.floats(1e-3, 1e3))
def test_the_angle_of_a_vector_is_good_to_a_thousandth_of_a_microstep(turns, length):
    found = turns_of(length * sin(2 * pi * turns), length * cos(2 * pi * turns))
    assert 0.0 <= found <= 1.0
    away = abs(found - turns)
    assert min(away, 1 - away) < 4e-6


def test_no_vector_has_angle_0():
    assert turns_of(0.0, 0.0) == 0.0
