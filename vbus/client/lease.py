"""A lease: how long a byte that was read will be read again, and the polls answered from it."""

from typing import Final

MOST_POLLS: Final = 0xFFFF
"""Polls that one POLLED can tell of."""


class Lease:
    """What the host knows of the byte at one address until something touches the chip.

    Args:
        address: where it was read.
        data: the byte.
        now: the host's time when it was read (ps).
        until: instant before which it stays (ps).
        cycle: what a poll costs (ps).

    Attributes:
        polls: polls answered that the board has not been told of.
    """

    __slots__ = ("_cycle", "_now", "_stamp", "_until", "address", "data", "polls")

    def __init__(self, address: int, data: int, now: int, until: int, cycle: int) -> None:
        self.address: int = address
        self.data: int = data
        self.polls: int = 0
        self._now: int = now
        self._until: int = until
        self._cycle: int = cycle
        self._stamp: int = -1

    def poll(self, address: int) -> bool:
        """Answer a poll of ``address`` if the byte is known at its instant; it is counted then."""
        when = max(self._stamp, self._now) if self._stamp >= 0 else self._now + self._cycle
        if address != self.address or when >= self._until:
            return False
        self._now = when
        self.polls += 1
        return True

    @property
    def telling(self) -> bool:
        """Whether the board must be told now: a time stamp is for one poll, a count has an end."""
        return self._stamp >= 0 or self.polls == MOST_POLLS

    def told(self) -> None:
        """The board has been told of the polls."""
        self.polls = 0
        self._stamp = -1

    def delay(self, duration: int) -> None:
        """The host lets time pass."""
        self._now = max(self._now, self._stamp) + duration
        self._stamp = -1

    def at(self, instant: int) -> None:
        """The host stamps what it does next."""
        self._stamp = instant
