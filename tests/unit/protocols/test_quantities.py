"""Durations and instants as people type and read them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.core.kernel import END, MS, SECOND, US
from vbus.protocols.quantities import WALL_UNITS, format_instant, parse_duration, picoseconds


@pytest.mark.parametrize(
    ("text", "ps"),
    [
        ("1ps", 1),
        ("2ns", 2000),
        ("100us", 100 * US),
        ("10ms", 10 * MS),
        ("3s", 3 * SECOND),
        ("1.5 ms", 1_500_000_000),
        ("0.000000000001s", 1),
        ("341.333us", 341_333_000),
        ("0s", 0),
    ],
)
def test_a_duration_is_read_exactly(text: str, ps: int) -> None:
    assert parse_duration(text) == ps


@pytest.mark.parametrize(
    ("text", "seconds"), [("5m", 300), ("1.5 min", 90), ("2h", 7200), ("0.001s", 0.001)]
)
def test_a_time_of_the_wall_clock_may_be_in_minutes_and_hours(text: str, seconds: float) -> None:
    assert parse_duration(text, WALL_UNITS) == seconds * SECOND


def test_chip_time_has_no_minutes() -> None:
    with pytest.raises(ValueError, match="'5m' is no duration; write a number with ps, ns, us, ms"):
        parse_duration("5m")


def test_a_time_is_picoseconds_or_says_its_unit() -> None:
    assert (picoseconds(7), picoseconds("7us")) == (7, 7 * US)


@pytest.mark.parametrize("quantity", [0.1, 100.0, True, None])
def test_a_number_that_is_not_whole_says_what_to_give(quantity: object) -> None:
    with pytest.raises(TypeError, match=r'is no time: give picoseconds as an int, .*"0\.1 s"'):
        picoseconds(quantity)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text", ["", "us", "10", "-1us", "1e3us", "1.us", ".5us", "10 minutes", "1us ", "0.5ps",
             f"{END + 1}ps", "9" * 30 + "s"],
)  # fmt: skip
def test_what_is_no_duration_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"no duration|finer|too long"):
        parse_duration(text)


@given(st.integers(0, END))
def test_an_instant_reads_back_exactly(ps: int) -> None:
    assert parse_duration(format_instant(ps)) == ps


def test_instants_are_printed_in_microseconds() -> None:
    assert format_instant(341_333_333) == "341.333333us"
    assert format_instant(15 * US) == "15us"
    assert format_instant(100) == "0.0001us"
