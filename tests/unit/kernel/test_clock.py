"""Clock: cycles to picoseconds without drift."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.kernel import Clock

FREQUENCIES = st.integers(1, 200_000_000)


def test_a_second_of_six_megahertz_is_exactly_six_million_cycles() -> None:
    clock = Clock(6_000_000)

    assert clock.ps(6_000_000 * 3600) == 3600 * 10**12


def test_a_sample_at_six_megahertz_never_drifts() -> None:
    clock = Clock(6_000_000)

    for sample in (1, 3, 1_000, 10**9):
        assert abs(clock.ps(2048 * sample) * 6 - 2048 * sample * 10**6) < 6


@given(FREQUENCIES, st.integers(0, 10**15))
def test_a_cycle_begins_at_its_instant_and_not_one_picosecond_earlier(hz: int, cycle: int) -> None:
    clock = Clock(hz)
    start = clock.ps(cycle)

    assert clock.cycle_at(start) == cycle
    if start:
        assert clock.cycle_at(start - 1) == cycle - 1


@given(FREQUENCIES, st.integers(0, 10**9))
def test_a_span_rounded_up_is_never_shorter_than_the_periods(hz: int, cycles: int) -> None:
    clock = Clock(hz)

    assert clock.span_up(cycles) * hz >= cycles * 10**12
    assert clock.span_up(cycles) - clock.span(cycles) in (0, 1)


def test_a_clock_needs_a_frequency() -> None:
    with pytest.raises(ValueError, match=r"^a clock needs a frequency above 0 Hz, not 0$"):
        Clock(0)
