"""How long a remote board takes to answer, and what it never answered.

A meter sees the bytes that go to the board and those that come from it, and changes none.
"""

from collections import deque
from typing import Any, Final

from vbus.protocols.byte import COUNTED, SIZES
from vbus.protocols.requests import FATAL, REPLIES, REQUESTS, UNASKED
from vbus.serve.time.statistics import ROUND_TRIP_NS, Histogram

_WAITING: Final = frozenset({"CLAIM", "DELAY", "PASS", "WAIT"})
"""Requests the board may take its time over: that is not the way's."""
_REFUSED: Final = "X"

_ANSWERED: Final = bytes(
    (row := REQUESTS.at(code)) is None or bool(row.reply) for code in range(256)
)
"""Whether a request has a reply, by its first byte; an unknown one is refused."""
_WAITS: Final = bytes(
    (row := REQUESTS.at(code)) is not None and row.name in _WAITING for code in range(256)
)


class Trips:
    """The answers of all sessions of an attachment.

    Attributes:
        all: every round trip (ns): of a request that was sent while no other was under way.
        answers: how many answers have come.
        lost: how many never came, because the board or the way to it had gone.
    """

    def __init__(self) -> None:
        self.all: Histogram = Histogram(ROUND_TRIP_NS)
        self.answers: int = 0
        self.lost: int = 0
        self._recent: Histogram = Histogram(ROUND_TRIP_NS)

    def note(self, taken: int) -> None:
        """Count one that took so long (ns)."""
        self.all.note(taken)
        self._recent.note(taken)

    def take_recent(self) -> Histogram:
        """Return those since the last call."""
        recent, self._recent = self._recent, Histogram(ROUND_TRIP_NS)
        return recent

    def summary(self) -> dict[str, Any]:
        """Return what ``vbus ls --json`` shows."""
        return {
            "round_trips": self.all.summary("ns"),
            "answers": self.answers,
            "answers_lost": self.lost,
        }


class Meter:
    """Measures one session with a board in turns: from the first bytes sent to what comes next.

    Args:
        trips: takes what was measured.
    """

    def __init__(self, trips: Trips) -> None:
        self.trips: Trips = trips
        self._asked: int = -1

    def sent(self, data: bytes, now: int) -> None:
        """See bytes that go to the board at the wall time ``now`` (ns)."""
        if self._asked < 0:
            self._asked = now

    def came(self, data: bytes, now: int) -> None:
        """See bytes that have come from it."""
        if self._asked >= 0:
            self.trips.note(now - self._asked)
            self.trips.answers += 1
            self._asked = -1

    @property
    def open(self) -> int:
        """How many answers are still to come."""
        return int(self._asked >= 0)

    def lose(self) -> int:
        """Nothing comes any more: count what is missing, and return how many that are."""
        missing = self.open
        self.trips.lost += missing
        self._asked = -1
        return missing


class ByteMeter(Meter):
    """Counts the replies of the byte protocol, and measures those that tell of the way.

    Of requests sent together the first is measured. A reply that may be late because the host let
    time pass is not.
    """

    def __init__(self, trips: Trips) -> None:
        super().__init__(trips)
        self._requests: bytes = b""
        self._replies: bytes = b""
        self._number: int = 0
        self._open: deque[tuple[int, int, bool]] = deque()
        """Number, instant, and whether it is a measure, of each request not yet answered."""
        self._waited: int = -1
        """Number of the last request that let time pass, while it may still do so."""
        self._blind: bool = False
        """Where the next request begins is not known: the board refuses everything."""

    def sent(self, data: bytes, now: int) -> None:
        """See bytes that go to the board."""
        if self._blind:
            return
        data = self._requests + data
        position, end = 0, len(data)
        while position < end:
            code = data[position]
            following = position + SIZES[code]
            if following > end:
                break
            if COUNTED[code]:
                following += data[following - 1]
                if following > end:
                    break
            if _WAITS[code]:
                self._waited = self._number
            if _ANSWERED[code]:
                self._open.append((self._number, now, self._waited < 0 and not self._open))
            self._number += 1
            position = following
        self._requests = data[position:]

    def came(self, data: bytes, now: int) -> None:
        """See bytes that have come from it."""
        if self._blind:
            return
        data = self._replies + data
        position, end = 0, len(data)
        while position < end:
            reply = REPLIES.get(chr(data[position]))
            following = reply.layout.end(data, position + 1) if reply is not None else end
            if not following:
                break
            if reply is None or (reply.tag == _REFUSED and data[position + 1] in FATAL):
                self._blind = True
                self._open.clear()
                return
            if reply.tag == _REFUSED:
                _, number = reply.layout.unpack_from(data, position + 1)
                if self._open and self._open[0][0] & 0xFFFF == number:
                    self._settle(now)
            elif reply.tag not in UNASKED and self._open:
                self._settle(now)
            position = following
        self._replies = data[position:]

    def _settle(self, now: int) -> None:
        number, asked, measures = self._open.popleft()
        self.trips.answers += 1
        if measures:
            self.trips.note(now - asked)
        if number >= self._waited:
            self._waited = -1

    @property
    def open(self) -> int:
        """How many answers are still to come."""
        return len(self._open)

    def lose(self) -> int:
        """Nothing comes any more."""
        missing = len(self._open)
        self.trips.lost += missing
        self._open.clear()
        return missing
