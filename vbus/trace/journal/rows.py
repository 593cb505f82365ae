"""What a journal has not written yet: bus cycles as 16-bit words, everything else as it is.

A driver's cycles mostly follow each other: the same session, each from the end of the one before,
each taking as long. Such a cycle is one word, and the same one again is only counted.
"""

from collections.abc import Callable
from struct import pack
from typing import Any, Final

from mypy_extensions import i64

FULL: Final = 4096
"""So many entries are written together, if nothing asks for them earlier."""
AGAIN: Final = 0x8000
"""A word of this and a number below 4000h: the cycle before so many times more."""
OTHER: Final = 0xC000
"""This word: the next entry is one of those beside the words."""


class JournalRows:
    """Takes entries, gives them back as the columns of a block.

    Args:
        full: called when there are so many that they should be taken; it calls :meth:`take`.
    """

    def __init__(self, full: Callable[[], None]) -> None:
        self.full: Callable[[], None] = full
        self.pending: i64 = 0
        """Entries that have not been taken."""
        self._others: list[Any] = []
        self._pairs: list[int] = []
        self._half: i64 = -1
        """A word that waits for another, with which it is a pair; or -1."""
        self._end: i64 = 0
        # -1 until there has been a cycle in this block: no word is written before.
        self._session: i64 = -1
        self._span: i64 = -1
        self._word: i64 = 0
        self._again: i64 = 0

    def cycle(self, session: i64, word: i64, when: i64, after: i64) -> None:
        """Take a bus cycle.

        Args:
            session: number of the session.
            word: 512 times the address, plus 256 for a write, plus the byte.
            when: instant of the call (ps).
            after: instant of its end (ps).
        """
        follows = when == self._end and after - when == self._span and session == self._session
        if follows and word == self._word:
            self._again += 1
        elif follows and word >> 15 == 0:
            if self._again != 0:
                self._put_again()
            self._word = word
            self._put(word)
        else:
            self._put_cycle(session, word, when, after)
        self._end = after
        self.pending += 1
        if self.pending >= FULL:
            self.full()

    def other(self, key: int, value: Any, when: i64, after: i64) -> None:
        """Take any entry: its key and value, and its instants (ps)."""
        self._put_other(key, value, when, after)
        self._end = after
        self.pending += 1
        if self.pending >= FULL:
            self.full()

    def _put_cycle(self, session: i64, word: i64, when: i64, after: i64) -> None:
        value = word >> 9 << 8 | word & 0xFF
        self._put_other(session << 5 | word >> 8 & 1, value, when, after)
        self._session = session
        self._span = after - when
        self._word = word

    def _put_other(self, key: int, value: Any, when: i64, after: i64) -> None:
        if self._again != 0:
            self._put_again()
        self._put(OTHER)
        self._others.extend((key, value, when - self._end, after - when))

    def _put_again(self) -> None:
        self._put(AGAIN | self._again)
        self._again = 0

    def _put(self, word: i64) -> None:
        if self._half < 0:
            self._half = word
        else:
            self._pairs.append(self._half << 16 | word)
            self._half = -1

    def following(self) -> "JournalRows":
        """Return rows for entries that follow what has been taken from these, for another file."""
        made = JournalRows(self.full)
        made._end = self._end
        return made

    def take(self) -> tuple[bytes, list[Any]]:
        """Return the words (most significant byte first), and the entries beside them.

        Of each of those: key, value, start counted from the end of the entry before, and what it
        took (ps).
        """
        if self._again != 0:
            self._put_again()
        words = pack(f">{len(self._pairs)}I", *self._pairs)
        if self._half >= 0:
            words += pack(">H", self._half)
        others = self._others
        self._pairs = []
        self._others = []
        self.pending = 0
        self._half = -1
        # A block stands for itself: its first cycle is written in full.
        self._session = -1
        return words, others
