"""Whether a session looks for its host's next message before it sleeps."""

from typing import Final

PATIENCE: Final = 8
"""Lone messages in a row after which a session sleeps at once. It trades the wake-ups of a host
that polls for 30 us of looks, as often, for one that does not."""
RETRY: Final = 64
"""Lone messages after which looking is tried again: 30 us spread over 64 trips."""
LATE_NS: Final = 1_000_000
"""A session that gave way for so long between two messages gave the processor to others: far
above a sched_yield on an idle processor, about 1 us."""
CROWDED: Final = 1024
"""Messages after which looking is tried again then; ``benchmarks/fair_links.py`` measures what hosts
beside each other have of it."""


class SpinPolicy:
    """The patience of one session.

    It is lost for a while when nothing came, and for longer where others want the processor:
    whoever sleeps is let in sooner than who gives way.

    Attributes:
        left: how many more lone messages it takes to lose it; 0: it is lost.
    """

    def __init__(self) -> None:
        self.left: int = PATIENCE
        self._skipped: int = 0

    def served(self, messages: int) -> None:
        """So many messages came one after the other."""
        if messages > 1:
            self.left = PATIENCE
        elif self.left:
            self.left -= 1
        else:
            self._skipped += 1
            if self._skipped == RETRY:
                self._skipped = 0
                self.left = 1

    def lose(self) -> None:
        """Others want the processor."""
        self.left, self._skipped = 0, RETRY - CROWDED
