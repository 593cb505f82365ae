"""What a journal has not written yet: bus cycles as 16-bit words, everything else as it is.

A driver's cycles mostly follow each other: the same session, each from the end of the one before,
each taking as long. Such a cycle is one word, and the same one again is only counted.

A driver that moves lines makes the same calls for each cycle, in the same order. A call like one
before is one word, too, and after the same one mostly the same follows: that is tried first.
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
"""This word: the next entry is one of those beside the words. More than this by 1, 2 and so on: the
first, the second and so on of those beside the words, once more."""

FLAG: Final = 1
"""A kind of replies: true or false. A call without one has 0 in its place."""
NUMBER: Final = 2
PAIR: Final = 3
"""The reply is two numbers."""
STROBED: Final = 3
"""In place of a number of arguments: a bus cycle that strobes have made. The first number is twice
that of the chips' names, plus 1 for a write; the second 256 times the address, plus the byte."""
LARGEST: Final = 1 << 62
"""Numbers in a call are below this."""


class Call:
    """A call that is among the entries beside the words of this block.

    Args:
        place: the word that stands for it once more.
        key: 32 times the session's number, plus the operation.
        form: how many arguments it has (or :data:`STROBED`), plus 4 times the kind of its reply.
        first: argument.
        second: argument.
        reply: or the first number of one that has two.
        more: the second.
        start: counted from the end of the entry before (ps).
        span: what it took (ps).

    Attributes:
        following: the call that came after it the last time.
        earlier: another one that came after it before that.
    """

    def __init__(
        self, place: i64, key: i64, form: i64, first: i64, second: i64, reply: i64, more: i64,
        start: i64, span: i64,
    ) -> None:  # fmt: skip
        self.place: i64 = place
        self.key: i64 = key
        self.form: i64 = form
        self.first: i64 = first
        self.second: i64 = second
        self.reply: i64 = reply
        self.more: i64 = more
        self.start: i64 = start
        self.span: i64 = span
        self.following: Call | None = None
        self.earlier: Call | None = None

    def like(
        self, key: i64, form: i64, first: i64, second: i64, reply: i64, more: i64, start: i64,
        span: i64,
    ) -> bool:  # fmt: skip
        """Whether another call is the same."""
        return (
            self.key == key and self.form == form and self.first == first
            and self.second == second and self.reply == reply and self.more == more
            and self.start == start and self.span == span
        )  # fmt: skip

    def follow(self, call: "Call") -> None:
        """Note what has come after it."""
        if self.following is not call:
            self.earlier = self.following
            self.following = call


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
        self._calls: dict[tuple[int, ...], Call] = {}
        self._latest: Call | None = None
        self._names: dict[str, int] = {}

    def strobed(
        self, key: i64, chips: str, write: bool, address: i64, data: i64, when: i64, after: i64
    ) -> None:
        """Take a bus cycle that strobes have made.

        Args:
            key: 32 times the session's number, plus the operation.
            chips: their names.
            write: whether the host wrote.
            address: 0 up.
            data: the byte.
            when: instant (ps).
            after: instant that it is now (ps).
        """
        name = self._names.setdefault(chips, len(self._names))
        self.call(key, STROBED, name << 1 | write, address << 8 | data, 0, 0, when, after)

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

    def call(
        self, key: i64, form: i64, first: i64, second: i64, reply: i64, more: i64, when: i64,
        after: i64,
    ) -> None:  # fmt: skip
        """Take a call that was answered; see :class:`Call`.

        Args:
            key: 32 times the session's number, plus the operation.
            form: how many arguments it has, plus 4 times the kind of its reply.
            first: argument.
            second: argument.
            reply: or the first number of one that has two.
            more: the second.
            when: instant of the call (ps).
            after: instant of its end (ps).
        """
        start, span = when - self._end, after - when
        latest = self._latest
        known = latest.following if latest is not None else None
        if known is None or not known.like(key, form, first, second, reply, more, start, span):
            known = latest.earlier if latest is not None else None
            if known is None or not known.like(key, form, first, second, reply, more, start, span):
                names = (key, form, first, second, reply, more, start, span)
                known = self._calls.get(names)
        if known is None:
            known = self._new(key, form, first, second, reply, more, start, span)
        else:
            if self._again != 0:
                self._put_again()
            self._put(known.place)
        if latest is not None:
            latest.follow(known)
        self._latest = known
        self._end = after
        self.pending += 1
        if self.pending >= FULL:
            self.full()

    def _new(
        self, key: i64, form: i64, first: i64, second: i64, reply: i64, more: i64, start: i64,
        span: i64,
    ) -> Call:  # fmt: skip
        """Write a call down in full; return it."""
        place: i64 = OTHER + 1 + len(self._others) // 4
        arguments: list[Any] = [first, second][: form & 3]
        if form & 3 == STROBED:
            chips = [*self._names][first >> 1]
            arguments = [chips, first & 1 != 0, second >> 8, second & 0xFF]
        kind = form >> 2
        answer: Any = None
        if kind == FLAG:
            answer = reply != 0
        elif kind == NUMBER:
            answer = reply
        elif kind == PAIR:
            answer = (reply, more)
        self._put_other(
            key, [arguments, answer, 0, -1], self._end + start, self._end + start + span
        )
        known = Call(place, key, form, first, second, reply, more, start, span)
        self._calls[key, form, first, second, reply, more, start, span] = known
        return known

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
        self._calls = {}
        self._latest = None
        # A block stands for itself: its first cycle is written in full.
        self._session = -1
        return words, others
