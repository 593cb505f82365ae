"""Histograms of integers in fixed buckets."""

from typing import Any

from vbus.serve.metrics import _families
from vbus.serve.nodes.realtime_nodes import BOUNDS_NS
from vbus.serve.time.statistics import LAG_PS, ROUND_TRIP_NS, Histogram


def test_a_value_at_a_bound_belongs_to_that_bucket_and_one_more_to_the_next() -> None:
    histogram = Histogram((10, 20))
    for value in (0, 10, 11, 20, 21):
        histogram.note(value)

    told = histogram.summary("ns")

    assert told["buckets"] == [2, 2, 1]
    assert told["bounds_ns"] == [10, 20]
    assert (told["count"], told["sum_ns"], told["max_ns"]) == (5, 62, 21)


def test_percentiles_are_bounds_that_as_many_values_do_not_exceed() -> None:
    histogram = Histogram((10, 20, 50))
    for value in [5] * 50 + [15] * 49 + [40]:
        histogram.note(value)

    assert histogram.percentile(50) == 10
    assert histogram.percentile(51) == 20
    assert histogram.percentile(99) == 20
    assert histogram.percentile(100) == 40


def test_an_empty_histogram_has_percentiles_of_zero() -> None:
    assert Histogram((10,)).percentile(99) == 0


def test_values_beyond_the_last_bound_show_as_the_largest_of_them() -> None:
    histogram = Histogram((10,))
    histogram.note(700)

    assert histogram.percentile(50) == 700


def test_the_bounds_ascend() -> None:
    for bounds in (LAG_PS, ROUND_TRIP_NS):
        assert list(bounds) == sorted(set(bounds))


def test_the_buckets_reach_from_a_microsecond_to_half_a_second_and_to_five() -> None:
    for bounds, first, last in (
        (ROUND_TRIP_NS, 1_000, 500_000_000),
        (LAG_PS, 1_000_000, 5_000_000_000_000),
        (BOUNDS_NS, 10_000, 50_000_000),
    ):
        assert (bounds[0], bounds[-1]) == (first, last)
        assert list(bounds) == sorted({*bounds})


def test_picoseconds_are_shown_as_seconds() -> None:
    times = ("time_ps", "time_left_ps", "slipped_ps", "worst_lag_ps")
    statistics: dict[str, Any] = {"links": [], "chips": [], "violations": {}, "overload": 2}
    statistics |= dict.fromkeys(times, 3 * 10**12)
    shown = {one.name: one.samples[0].value for one in _families("b", statistics) if one.samples}
    assert shown == {
        "vbus_chip_time_seconds": 3.0, "vbus_chip_time_left_seconds": 3.0,
        "vbus_slipped_seconds": 3.0, "vbus_overload_ratio": 2.0, "vbus_worst_lag_seconds": 3.0,
    }  # fmt: skip
