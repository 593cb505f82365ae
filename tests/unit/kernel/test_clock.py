"""Clock: cycles to picoseconds without drift."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.kernel import NEVER, Clock

FREQUENCIES = st.integers(1, 200_000_000)


def test_a_second_of_six_megahertz_is_exactly_six_million_cycles() -> None:
    clock = Clock(6_000_000)

    assert clock.ps(6_000_000 * 3600) == 3600 * 10**12


def test_a_sample_at_six_megahertz_never_drifts() -> None:
    clock = Clock(6_000_000)

    for sample in (1, 3, 1_000, 10**9):
        assert abs(clock.ps(2048 * sample) * 6 - 2048 * sample * 10**6) < 6


@given(FREQUENCIES, st.integers(0, NEVER - 1))
def test_a_cycle_begins_at_its_instant_and_not_one_picosecond_earlier(hz: int, when: int) -> None:
    clock = Clock(hz)
    cycle = when * hz // 10**12
    start = clock.ps(cycle)
    assert start == cycle * 10**12 // hz

    assert clock.cycle_at(start) == cycle
    if start:
        assert clock.cycle_at(start - 1) == cycle - 1


@given(FREQUENCIES)
def test_no_cycle_begins_after_the_end_of_time(hz: int) -> None:
    clock = Clock(hz)
    last = NEVER * hz // 10**12

    assert clock.ps(last) == last * 10**12 // hz <= NEVER
    assert clock.ps(last + 1) == clock.ps((1 << 62) - 1) == NEVER
    assert clock.cycle_at(NEVER) == ((NEVER + 1) * hz - 1) // 10**12


@given(FREQUENCIES, st.integers(0, 10**6))
def test_a_span_rounded_up_is_never_shorter_than_the_periods(hz: int, cycles: int) -> None:
    clock = Clock(hz)

    assert clock.span_up(cycles) * hz >= cycles * 10**12
    assert clock.span_up(cycles) - clock.span(cycles) in (0, 1)


def test_a_clock_needs_a_frequency() -> None:
    with pytest.raises(ValueError, match=r"^a clock needs a frequency above 0 Hz, not 0$"):
        Clock(0)
    with pytest.raises(ValueError, match=r"^a clock needs a frequency below 1 THz, not 10+ Hz$"):
        Clock(10**12)
