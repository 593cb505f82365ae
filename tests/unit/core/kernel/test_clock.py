"""Clock: cycles to picoseconds without drift."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.core.kernel import NEVER, US, Clock
from vbus.core.state import load, save

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


def test_a_span_is_of_the_clock_as_it_runs_now() -> None:
    clock = Clock(1_000_000)
    clock.run(5 * US, 1_000_000)
    assert clock.span(10) == 5 * US
    clock.run(50 * US, -500_000)
    assert (clock.span(10), clock.span_up(10)) == (20 * US, 20 * US)


CHANGES = st.lists(
    st.tuples(
        st.integers(0, 10**7), st.sampled_from(["run", "stop"]), st.integers(-(10**5), 10**5)
    ),
    min_size=1,
    max_size=8,
)


@given(FREQUENCIES.filter(lambda hz: hz < 10**9), CHANGES)
def test_a_clock_that_fails_again_and_again_counts_on_and_leaves_the_past_as_it_was(
    hz: int, changes: list[tuple[int, str, int]]
) -> None:
    clock = Clock(hz)
    now = 0
    seen: list[tuple[int, int]] = []
    for gap, what, ppm in changes:
        now += gap
        under_way = clock.cycle_at(now)
        clock.run(now, ppm) if what == "run" else clock.stop(now)
        # What has begun has begun, and is counted on from there.
        assert clock.cycle_at(now) in (under_way, under_way + 1)
        assert clock.cycle_at(now) >= under_way
        for when, cycle in seen:
            assert clock.cycle_at(when) == cycle
        if now not in dict(seen):
            seen.append((now - 1, clock.cycle_at(now - 1))) if now else None
        cycle = clock.cycle_at(now)
        assert clock.ps(cycle) <= now < clock.ps(cycle + 1)
        if clock.stopped:
            assert clock.ps(cycle + 1) == NEVER
            assert clock.cycle_at(now + 10**12) == cycle
            assert clock.span(hz) == 10**12
        else:
            # The period under way is finished as it was; the next ones are new.
            first, later = clock.ps(cycle + 2), clock.ps(cycle + 2 + 10**6)
            assert abs((later - first) - 10**24 // (hz * (10**6 + ppm))) <= 1
            assert clock.cycle_at(later) == cycle + 2 + 10**6
            assert clock.cycle_at(later - 1) == cycle + 1 + 10**6
    twin = Clock(hz)
    load(twin, save(clock))
    for ahead in (0, 1, 1000, 10**6):
        assert twin.ps(clock.cycle_at(now) + ahead) == clock.ps(clock.cycle_at(now) + ahead)
    assert twin.stopped == clock.stopped
    assert twin.frequency == clock.frequency


@pytest.mark.parametrize("cycle", range(4, 12))
@pytest.mark.parametrize(("when", "there"), [(8 * US - 1, 7), (8 * US, 8), (9 * US - 1, 8)])
def test_courses_that_do_not_follow_each_other_are_refused(
    when: int, there: int, cycle: int
) -> None:
    """A clock that changes does so in the cycle under way, or from the next one on."""
    clock = Clock(1_000_000)
    courses = [(0, 0, 1_000_000_000_000, 1_000_000), (cycle, when, 1_000_000_000_000, 500_000)]
    if cycle in (there, there + 1):
        clock.courses = courses
        assert clock.cycle_at(when) == cycle
    else:
        with pytest.raises(ValueError, match=f"jumps from cycle {there} to {cycle}"):
            clock.courses = courses


def test_a_clock_that_nothing_happened_to_keeps_no_state() -> None:
    clock = Clock(8_000_000)
    assert save(clock)["courses"] == ()
    clock.run(0, 50)
    load(clock, {"courses": ()})
    assert clock.ps(8_000_000) == 10**12
    assert clock.frequency == 8e6
