"""How far another process' clock is ahead, and how sure that is."""

from collections import deque
from typing import Final

KEPT: Final = 64
"""Exchanges looked back at."""
ENOUGH: Final = 6
"""Exchanges after which the estimate is used."""


class ClockEstimate:
    """The offset between two clocks from exchanges of messages, as NTP does it.

    A message and its answer give four instants. The fastest exchange of late is believed: queues
    only make exchanges slower. The true offset differs from the estimate by at most half of that
    exchange's round trip, whatever the two ways share it.
    """

    def __init__(self) -> None:
        self._exchanges: deque[tuple[int, int]] = deque(maxlen=KEPT)
        self.offset: int = 0
        """The other clock minus this one (ns)."""
        self.uncertainty: int = -1
        """At most this far from the truth (ns); -1: nothing is known."""

    def add(self, sent: int, came: int, answered: int, back: int) -> None:
        """Take one exchange: sent and back by this clock, came and answered by the other (ns)."""
        trip = (back - sent) - (answered - came)
        if trip < 0:
            return
        self._exchanges.append((trip, ((came - sent) + (answered - back)) // 2))
        best, self.offset = min(self._exchanges)
        self.uncertainty = (best + 1) // 2

    @property
    def good(self) -> bool:
        """Whether there have been enough exchanges."""
        return len(self._exchanges) >= ENOUGH
