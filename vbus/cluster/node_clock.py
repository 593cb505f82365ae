"""How far another process' clock is ahead, and how sure that is."""

import os
from collections import deque
from pathlib import Path
from typing import Final

KEPT: Final = 64
"""Exchanges looked back at."""
ENOUGH: Final = 6
"""Exchanges after which the estimate is used."""


def monotonic_clock() -> str:
    """Return what names the clock that counts here: processes with one name read one clock.

    It counts from the start of this computer, and from elsewhere in a time namespace of its own.
    Empty if the system does not tell.
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot} {os.readlink('/proc/self/ns/time')}"
    except OSError:
        return ""


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
        self.shared: bool = False
        """Whether both go by one clock."""

    def share(self) -> None:
        """Both go by one clock: there is nothing to estimate."""
        self.shared = True
        self.offset = self.uncertainty = 0

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
        return self.shared or len(self._exchanges) >= ENOUGH
