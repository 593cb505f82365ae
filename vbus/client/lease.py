"""A lease: how long a byte that was read will be read again, and the polls answered from it."""

from typing import Final

MOST_POLLS: Final = 0xFFFF
"""Polls that one POLLED can tell of."""

MOST_STAMPED: Final = 1 + 255 // 4
"""Polls that one POLLED_AT can tell of."""

LONGEST_STEP: Final = (1 << 32) - 1
"""Longest time between two of them (ps)."""


class Lease:
    """What the host knows of the byte at one address until something touches the chip.

    Args:
        address: where it was read.
        data: the byte.
        now: the host's time when it was read (ps).
        until: instant before which it stays (ps).
        cycle: what a poll costs (ps).

        then: byte from then on, and until when; None if that is not known.

    Attributes:
        polls: polls answered and not yet reported to the board, without time stamps.
        run: time stamps of such polls that have them.
        stamps: whether one message can report several stamped polls to the board.
    """

    __slots__ = (
        "_cycle", "_now", "_stamp", "_then", "_until", "address", "data", "polls", "run", "stamps",
    )  # fmt: skip

    def __init__(
        self, address: int, data: int, now: int, until: int, cycle: int,
        then: tuple[int, int] | None = None,
    ) -> None:  # fmt: skip
        self.address: int = address
        self.data: int = data
        self.polls: int = 0
        self.stamps: bool = False
        self.run: list[int] = []
        self._now: int = now
        self._until: int = until
        self._cycle: int = cycle
        self._stamp: int = -1
        self._then: tuple[int, int] | None = then

    def poll(self, address: int) -> bool:
        """Answer a poll of ``address`` if the byte is known at its instant; it is counted then."""
        when = max(self._stamp, self._now) if self._stamp >= 0 else self._now + self._cycle
        # The second of two leases: the byte from the end of the first on.
        if address == self.address and when >= self._until and self._then is not None:
            (self.data, self._until), self._then = self._then, None
        if address != self.address or when >= self._until:
            return False
        self._now = when
        # Stamped polls are reported by their instants, others by their number.
        if self._stamp >= 0 and self.stamps:
            self.run.append(self._stamp)
            self._stamp = -1
        else:
            self.polls += 1
        return True

    @property
    def telling(self) -> bool:
        """Whether polls must be reported now: a time stamp is for one poll, a count has an end."""
        return self._stamp >= 0 or self.polls == MOST_POLLS or len(self.run) == MOST_STAMPED

    @property
    def stamp(self) -> int:
        """The stamp of what is done next, held back until then; -1: none."""
        return self._stamp if self.stamps else -1

    def takes(self, instant: int) -> bool:
        """Whether a poll at ``instant`` can be reported together with those of the run."""
        if self.polls or self.stamp >= 0:
            return False
        # Steps have 32 bits; and no stamp may lie before the one it follows.
        return not self.run or 0 <= instant - self.run[-1] <= LONGEST_STEP

    def clear(self) -> None:
        """The polls have been reported to the board."""
        self.polls = 0
        self.run = []
        if not self.stamps:
            self._stamp = -1

    def delay(self, duration: int) -> None:
        """The host lets time pass."""
        self._now = max(self._now, self._stamp) + duration
        self._stamp = -1

    def at(self, instant: int) -> None:
        """The host stamps what it does next."""
        self._stamp = instant

    def stamp_sent(self) -> None:
        """The stamp that was held back has been sent to the board."""
        self._now = max(self._now, self._stamp)
        self._stamp = -1
