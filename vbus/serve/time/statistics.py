"""Numbers about a running board: integer histograms with fixed buckets, and how they are shown."""

from typing import Any, Final

_STEPS: Final = (1, 2, 5)

ROUND_TRIP_NS: Final = tuple(step * 10**power for power in range(3, 9) for step in _STEPS)
"""Upper bounds of the buckets for round trips (ns): 1 us to 500 ms."""
LAG_PS: Final = tuple(step * 10**power for power in range(6, 13) for step in _STEPS)
"""Upper bounds of the buckets for lag (ps): 1 us to 5 s."""


class Histogram:
    """Counts integers in fixed buckets; noting one makes no object that stays.

    Args:
        bounds: inclusive upper bounds of the buckets, ascending; one more takes the rest.
    """

    def __init__(self, bounds: tuple[int, ...]) -> None:
        self.bounds: tuple[int, ...] = bounds
        self.buckets: list[int] = [0] * (len(bounds) + 1)
        self.count: int = 0
        self.total: int = 0
        """Sum of everything noted."""
        self.most: int = 0
        """The largest value noted."""

    def note(self, value: int) -> None:
        """Count ``value`` (0 or more)."""
        bounds, buckets = self.bounds, self.buckets
        place = 0  # most are small: looking from below is quicker than halving
        while place < len(bounds) and bounds[place] < value:
            place += 1
        buckets[place] = buckets[place] + 1
        self.count += 1
        self.total += value
        if value > self.most:
            self.most = value

    def percentile(self, percent: int) -> int:
        """Return a value that ``percent`` of those noted do not exceed; 0 if there are none.

        It is the upper bound of a bucket, or the largest value if that is less.
        """
        wanted = -(-self.count * percent // 100)
        seen = 0
        for bound, number in zip(self.bounds, self.buckets, strict=False):
            seen += number
            if seen >= wanted:
                return min(bound, self.most)
        return self.most

    def summary(self, unit: str) -> dict[str, Any]:
        """Return the histogram as ``vbus ls --json`` shows it; keys of values end in ``_unit``."""
        return {
            "count": self.count,
            f"sum_{unit}": self.total,
            f"p50_{unit}": self.percentile(50),
            f"p99_{unit}": self.percentile(99),
            f"max_{unit}": self.most,
            f"bounds_{unit}": list(self.bounds),
            "buckets": list(self.buckets),
        }
