"""What a journal has not written yet: bus cycles as 16-bit words, everything else as it is.

A driver's cycles mostly follow each other: the same session, each from the end of the one before,
each taking as long. Such a cycle is one word, and the same one again is only counted.

A driver that moves lines makes the same calls for each cycle, in the same order. A call like one
before is one word, too, and after the same one mostly the same follows: that is tried first.
"""

from collections.abc import Callable, Iterator
from struct import iter_unpack, pack
from typing import Any, Final

from mypy_extensions import i64

PORTS: Final = 32
"""Keys per port: a key is this times the session's number, plus the operation."""
READ: Final = 0
WRITE: Final = 1
"""Operations that are bus cycles."""
# Blocks of some 10 KB: zlib finds repeats in 32 KB, and a crash loses little.
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
LARGEST: Final = (1 << 62) - 1
"""Numbers in a call are not above this."""


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
        self._fours: list[int] = []
        """Groups of four words of 16 bits, each group as one signed number of 64 bits."""
        self._words: i64 = 0
        """The words of the group that is not full yet."""
        self._waiting: i64 = 0
        """How many words that group has."""
        self._end: i64 = 0
        # -1 until there has been a cycle in this block: no word is written before.
        self._session: i64 = -1
        self._span: i64 = -1
        self._word: i64 = 0
        self._again: i64 = 0
        self._calls: dict[tuple[int, ...], Call] = {}
        self._latest: Call | None = None
        self._names: dict[str, int] = {}
        """Numbers of chips that strobes have reached, by their names."""
        self._chips: str = ""
        self._name: i64 = -1
        """Names of the chips of the strobed cycle before, and the number of these names."""

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
        if chips != self._chips:
            self._chips = chips
            self._name = self._names.setdefault(chips, len(self._names))
        first = self._name << 1 | write
        self.call(key, STROBED, first, address << 8 | data, 0, 0, when, after)

    def cycle(self, session: i64, word: i64, when: i64, after: i64) -> None:
        """Take a bus cycle.

        Args:
            session: number of the session.
            word: 512 times the address, plus 256 for a write, plus the byte.
            when: instant of the call (ps).
            after: instant of its end (ps).
        """
        follows = when == self._end and after - when == self._span and session == self._session
        # The commonest case first: a driver that polls.
        if follows and word == self._word:
            self._again += 1
        # Addresses from 64 on do not fit into 15 bits, and take the long form.
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
        if known is not None and known.like(key, form, first, second, reply, more, start, span):
            self._put_call(known)
        else:
            known = latest.earlier if latest is not None else None
            if known is None or not known.like(key, form, first, second, reply, more, start, span):
                names = (key, form, first, second, reply, more, start, span)
                known = self._calls.get(names)
            if known is not None:
                self._put_call(known)
            else:
                known = self._new(key, form, first, second, reply, more, start, span)
            if latest is not None:
                latest.earlier = latest.following
                latest.following = known
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

    def _put_call(self, call: Call) -> None:
        if self._again != 0:
            self._put_again()
        self._put(call.place)

    def _put_other(self, key: int, value: Any, when: i64, after: i64) -> None:
        if self._again != 0:
            self._put_again()
        self._put(OTHER)
        self._others.extend((key, value, when - self._end, after - when))

    def _put_again(self) -> None:
        self._put(AGAIN | self._again)
        self._again = 0

    def _put(self, word: i64) -> None:
        if self._waiting == 0:
            self._words = word - ((word & AGAIN) << 1)
        else:
            self._words = self._words << 16 | word
        self._waiting += 1
        if self._waiting == 4:
            self._fours.append(self._words)
            self._waiting = 0

    def following(self) -> "JournalRows":
        """Return rows for entries that follow what has been taken from these, for another file."""
        made = JournalRows(self.full)
        made._end = self._end
        return made

    def take(self) -> tuple[bytes, list[Any]]:
        """Return the words (most significant byte first) and the entries beside the words.

        An entry is four items of the list: key, value, start counted from the end of the entry
        before (ps), and duration (ps).
        """
        if self._again != 0:
            self._put_again()
        words = pack(f">{len(self._fours)}q", *self._fours)
        if self._waiting != 0:
            words += pack(">q", self._words)[8 - 2 * self._waiting :]
        others = self._others
        self._fours = []
        self._others = []
        self.pending = 0
        self._waiting = 0
        # Numbers of calls count from the beginning of their block.
        self._calls = {}
        self._latest = None
        # A block stands for itself: its first cycle is written in full.
        self._session = -1
        return words, others


Row = tuple[Any, Any, Any, Any, int]
"""Key, value, start counted from the end of the entry before, what the entry took (ps), and how
often it comes in a row."""


def rows_of(words: Any, others: Any) -> Iterator[Row]:
    """Give the entries of a block, of which :meth:`JournalRows.take` gave words and others.

    Raises:
        ValueError: the words make no sense.
    """
    rest = iter(zip(others[0::4], others[1::4], others[2::4], others[3::4], strict=True))
    had: list[Any] = []
    cycle: Row | None = None
    keys: tuple[Any, Any] = (READ, WRITE)
    for (number,) in iter_unpack(">H", words):
        word: i64 = number
        if word == OTHER:
            row = next(rest, None)
            if row is None:
                raise ValueError("an entry is missing")
            key, value, _, span = row
            if key % PORTS in (READ, WRITE) and isinstance(value, int):
                cycle = (key, value, 0, span, 1)
                keys = (key // PORTS * PORTS + READ, key // PORTS * PORTS + WRITE)
            had.append(row)
            yield (*row, 1)
        elif word > OTHER:
            if word - OTHER > len(had):
                raise ValueError("an entry comes once more that has not been")
            yield (*had[word - OTHER - 1], 1)
        elif cycle is None:
            raise ValueError("the first cycle is missing")
        elif word < AGAIN:
            value = int(word >> 9 << 8 | word & 0xFF)
            cycle = (keys[1] if word & 0x100 else keys[0], value, 0, cycle[3], 1)
            yield cycle
        else:
            yield (cycle[0], cycle[1], 0, cycle[3], int(word - AGAIN))
    if next(rest, None) is not None:
        raise ValueError("an entry is left over")
