"""How far apart in wall time the nodes reach one instant of chip time."""

from bisect import bisect_left
from collections import deque
from typing import Any, Final

KEPT: Final = 2000
"""Marks whose skew is kept for percentiles."""
OPEN: Final = 50
"""Marks back to which stragglers may still come."""
BOUNDS_NS: Final = tuple(digit * 10**power for power in range(4, 8) for digit in (1, 2, 5))
"""Upper bounds of the classes in which all marks are counted, 10 us to 50 ms."""


class Skew:
    """Collects when each node reached a mark; the spread is the skew of that mark."""

    def __init__(self) -> None:
        self._open: dict[int, dict[int, tuple[int, int]]] = {}
        self._spreads: deque[int] = deque(maxlen=KEPT)
        self._counts: list[int] = [0] * (len(BOUNDS_NS) + 1)
        self.worst: int = 0
        self.latest: int = 0
        """The spread of the latest mark (ns)."""
        self.marks: int = 0
        self.uncertainty: int = 0
        """How far the latest spread may be from the truth (ns): both ends' clocks are estimates."""

    def note(self, number: int, node: int, at: int, uncertainty: int, nodes: int) -> None:
        """Node ``node`` has reached mark ``number`` at ``at`` (ns, agreed clock).

        Args:
            number: of the mark.
            node: its rank.
            at: when.
            uncertainty: how sure that is (ns).
            nodes: how many nodes there are now.
        """
        reached = self._open.setdefault(number, {})
        reached[node] = at, uncertainty
        if len(reached) >= nodes > 1:
            del self._open[number]
            (first, before), (last, after) = min(reached.values()), max(reached.values())
            spread = last - first
            self.uncertainty = before + after
            self.latest = spread
            self._spreads.append(spread)
            self._counts[bisect_left(BOUNDS_NS, spread)] += 1
            self.worst = max(self.worst, spread)
            self.marks += 1
        if len(self._open) > OPEN:
            del self._open[min(self._open)]

    def statistics(self) -> dict[str, Any]:
        """Return percentiles of late, the worst of all, and how sure the latest is (ns).

        ``histogram`` has all marks in classes: their upper bounds (ns; None: there is none) and
        how many marks fell in each, as far as the last that has any.
        """
        ordered = sorted(self._spreads) or [0]
        last = len(ordered) - 1
        classes = [list(pair) for pair in zip((*BOUNDS_NS, None), self._counts, strict=True)]
        while classes and not classes[-1][1]:
            classes.pop()
        return {
            "marks": self.marks,
            "p50_ns": ordered[last // 2],
            "p99_ns": ordered[last * 99 // 100],
            "max_ns": self.worst,
            "uncertainty_ns": self.uncertainty,
            "histogram": classes,
        }
