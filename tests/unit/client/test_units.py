"""From turns and seconds to the numbers motion chips count in."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.client import Units

# The manual's worked example: 500 lines, 341 us.
EXAMPLE = Units(2000, Fraction(341, 1_000_000))


@pytest.mark.spec("LM-T-1")
def test_a_hundred_revolutions() -> None:
    assert EXAMPLE.position(100) == 200_000 == 0x00030D40


@pytest.mark.spec("LM-T-2")
def test_600_rpm() -> None:
    assert EXAMPLE.velocity(10) == 446_956 == 0x0006D1EC


@pytest.mark.spec("LM-T-3")
def test_one_revolution_per_second_per_second() -> None:
    assert EXAMPLE.acceleration(1) == 15 == 0x0000000F


def test_the_sample_follows_from_the_clock_exactly() -> None:
    assert Units.of_clock(2000, 6_000_000).sample * 3 == Fraction(1024, 1_000_000)
    assert Units.of_clock(2000, 25_000_000, 13_568).sample == Fraction(54272, 100_000_000)


def test_conversions_round_to_nearest_and_keep_the_sign() -> None:
    units = Units(10, Fraction(1, 10), fraction=0)
    assert [units.velocity(turns) for turns in (1.4, 1.6, -1.4, -1.6)] == [1, 2, -1, -2]


@given(st.integers(-(2**30), 2**30))
def test_counts_come_back_from_turns(counts: int) -> None:
    units = Units.of_clock(2000, 8_000_000)
    assert units.position(units.turns(counts)) == counts
    assert units.velocity(units.turns_per_s(counts)) == counts
    assert units.acceleration(units.turns_per_s2(counts)) == counts
