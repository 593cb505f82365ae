"""How far apart in wall time the nodes reach one instant of chip time."""

from collections import deque
from typing import Any, Final

KEPT: Final = 2000
"""Marks whose skew is kept for percentiles."""
OPEN: Final = 50
"""Marks back to which stragglers may still come."""


class Skew:
    """Collects when each node reached a mark; the spread is the skew of that mark."""

    def __init__(self) -> None:
        self._open: dict[int, dict[int, tuple[int, int]]] = {}
        self._spreads: deque[int] = deque(maxlen=KEPT)
        self.worst: int = 0
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
            self._spreads.append(spread)
            self.worst = max(self.worst, spread)
            self.marks += 1
        if len(self._open) > OPEN:
            del self._open[min(self._open)]

    def statistics(self) -> dict[str, Any]:
        """Return percentiles of late, the worst of all, and how sure the latest is (ns)."""
        ordered = sorted(self._spreads)
        if not ordered:
            return {"marks": 0, "p50_ns": 0, "p99_ns": 0, "max_ns": 0, "uncertainty_ns": 0}
        last = len(ordered) - 1
        return {
            "marks": self.marks,
            "p50_ns": ordered[last // 2],
            "p99_ns": ordered[last * 99 // 100],
            "max_ns": self.worst,
            "uncertainty_ns": self.uncertainty,
        }
