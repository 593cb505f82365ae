"""What a host asked over one connection, what it was answered, and whether the two fit."""

from collections.abc import Callable
from random import Random
from typing import Any, Final

from vbus.core.kernel import END, MS, NS, US
from vbus.protocols import codes
from vbus.protocols.requests import FORESEEN, LEASED, REPLIES, REQUESTS, UNASKED

Said = tuple[Any, ...]
"""An answer: its tag and its numbers."""

SEEN_BY_THE_SESSION: Final = "EVWX"
"""Answers in which a journal has no part of their own: barriers, HELLO, PASS, and refusals."""


class Wrong(AssertionError):
    """An invariant does not hold."""


class Transcript:
    """The requests of one connection in order, and the replies that have come.

    Args:
        name: of the connection, for people.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.asked: list[tuple[str, int, int]] = []
        """Name of each request, its first argument, and where its bytes end."""
        self.bytes_asked = bytearray()
        self.sent = 0
        """Bytes of requests the system has taken."""
        self.answered = 0
        """Requests that have been answered, or have no answer and stand before one that has."""
        self.said: list[Said] = []
        self.port: int = -1
        """Number of the session that serves it, once it does."""
        self.whole = True
        """Whether what was received can be compared: nobody else's bytes may be among them."""
        self.events = True
        """Whether events come to the host surely."""
        self.polite_end = False
        """Whether everything was answered when the host went."""
        self._arrived = bytearray()
        self.lost = False
        """Whether a request was sent after which nobody knows where the next one starts."""
        self._echoes = 0

    # -- asking ---------------------------------------------------------------------------------

    def ask(self, name: str, *values: int | bytes) -> None:
        data = REQUESTS[name].pack(*values)
        first = values[0] if values and isinstance(values[0], int) else 0
        self.bytes_asked += data
        self.asked.append((name, first, len(self.bytes_asked)))

    def barrier(self) -> None:
        self._echoes += 1
        self.ask("ECHO", self._echoes & 0xFF)

    def garbage(self, data: bytes) -> None:
        self.lost = True
        self.bytes_asked += data

    def unsent(self) -> bytes:
        return bytes(self.bytes_asked[self.sent :])

    @property
    def settled(self) -> bool:
        """Whether everything asked has been answered: the last request was a barrier."""
        return self.answered == len(self.asked) and not self.unsent()

    # -- being answered -------------------------------------------------------------------------

    def take(self, data: bytes) -> None:
        """Take bytes that have come.

        Raises:
            Wrong: they answer nothing that was asked, or not in order.
        """
        self._arrived += data
        if not self.whole:
            return
        arrived = self._arrived
        while arrived:
            reply = REPLIES.get(chr(arrived[0]))
            if reply is None:
                raise Wrong(f"{self.name}: {bytes(arrived[:20]).hex()} begins no reply")
            size = 1 + reply.layout.size
            if len(arrived) < size:
                return
            numbers = reply.layout.unpack_from(arrived, 1)
            run = b""
            if reply.layout.counted:
                if len(arrived) < size + numbers[-1]:
                    return
                run = bytes(arrived[size : size + numbers[-1]])
            del arrived[: size + len(run)]
            self._answer(reply.tag, numbers, run)

    def _answer(self, tag: str, numbers: tuple[int, ...], run: bytes) -> None:
        if tag in UNASKED:
            self.said.append((tag, *numbers))
            return
        if tag == "X":
            self._refused(*numbers)
        else:
            number = self._next(lambda name: bool(REQUESTS[name].reply))
            name, first, end = self.asked[number]
            fitting = (
                REQUESTS[name].reply,
                *(LEASED + FORESEEN if REQUESTS[name].reply == "D" else ""),
            )
            if tag not in fitting or (tag == "E" and numbers[0] != first):
                raise Wrong(
                    f"{self.name}: request {number}, {name} {first}, is answered {tag}{numbers}"
                )
            if end > self.sent:
                raise Wrong(
                    f"{self.name}: request {number}, {name}, is answered before it was sent"
                )
            self.answered = number + 1
        if tag == "B":
            self.said += [("D", value) for value in run]
        elif tag in (LEASED, FORESEEN):
            self.said.append(("D", numbers[0]))
        elif tag != "E":
            self.said.append((tag, *numbers))

    def _next(self, fits: Callable[[str], bool]) -> int:
        for number in range(self.answered, len(self.asked)):
            if fits(self.asked[number][0]):
                return number
        raise Wrong(f"{self.name}: a reply more than was asked for")

    def _refused(self, code: int, low: int) -> None:
        if code == codes.NO_ROOM and not self.said:
            return
        for number in range(self.answered, len(self.asked)):
            if number & 0xFFFF == low:
                self.answered = number + 1
                return
            if REQUESTS[self.asked[number][0]].reply:
                break
        if not self.lost:
            raise Wrong(f"{self.name}: request {low} is refused (X{code}) out of its turn")


def told(entries: list[Any]) -> list[Said]:
    """Return what a session's entries of a journal say its host was answered."""
    said: list[Said] = []
    for entry in entries:
        if entry.error:
            said.append(("X", entry.error))
        elif entry.op in ("read", "getpin"):
            said.append(("D", entry.reply))
        elif entry.op == "claim" and entry.reply:
            said.append(("C", 1))
        elif entry.op == "now":
            said.append(("T", entry.reply))
        elif entry.op == "edges":
            said += [("I", outputs & 0xFFFF_FFFF, when) for outputs, when in entry.reply]
        elif entry.op == "wait" and entry.reply is not None:
            said.append(("R", int(entry.reply[0]), entry.reply[1]))
        elif entry.op == "sample":
            said.append(("P", entry.reply[0], entry.reply[1] & 0xFFFF_FFFF))
        elif entry.op == "sync":
            outputs, edge = entry.reply
            said.append(("S", outputs & 0xFFFF_FFFF, edge))
    return said


def compare(transcript: Transcript, heard: list[Said], entries: list[Any], ended: bool) -> None:
    """Compare what a host heard with what the journal says.

    Args:
        transcript: of the connection.
        heard: what the host has heard of it.
        entries: the journal's, of its session.
        ended: whether that is all.

    Raises:
        Wrong: they differ.
    """
    journal = told(entries)
    left_out = "IH" + ("STW" if any(name == "PASS" for name, *_ in transcript.asked) else "W")
    events = [[one for one in side if one[0] == "I"] for side in (heard, journal)]
    if transcript.events and events[0] != events[1][: len(events[0])]:
        raise Wrong(f"{transcript.name}: events {events[0]}, and in the journal {events[1]}")
    kept = [_up_to_a_refusal([one for one in side if one[0] not in left_out and one[0] != "V"])
            for side in (heard, journal)]  # fmt: skip
    mine, theirs = kept
    for place, one in enumerate(mine):
        other = theirs[place] if place < len(theirs) else None
        if other != one and not (one[0] == "S" and other is not None and _same_edge(one, other)):
            raise Wrong(
                f"{transcript.name}: answer {place} was {one}, and in the journal is {other}"
            )
    if ended and transcript.polite_end and len(mine) < len(theirs) and len(kept[0]) == len(heard):
        raise Wrong(f"{transcript.name}: {len(mine)} answers, and {len(theirs)} in the journal")


def _same_edge(one: Said, other: Said) -> bool:
    """NEVER is told as the largest number there is."""
    return one[:2] == other[:2] and one[2] >= END < other[2]


def _up_to_a_refusal(said: list[Said]) -> list[Said]:
    """READS and PASS that are refused in their midst answer less than they have done."""
    tags = [one[0] for one in said]
    return said[: tags.index("X")] if "X" in tags else said


# -- what hosts ask -------------------------------------------------------------------------------

LENGTHS: Final = (0, 1, 100 * NS, 3 * US, 40 * US, 500 * US, 4 * MS)


def ask_something(random: Random, transcript: Transcript, policy: str, left: int, now: int) -> None:
    """Add one request, of any kind.

    Args:
        random: decides which.
        transcript: takes it.
        policy: who is master of time.
        left: how far it is to the end of time (ps).
        now: what the host takes for the present (ps).
    """
    length = random.choice(LENGTHS)
    if left < 100 * MS and random.random() < 0.2:
        length = max(0, left + random.choice((-1, 0, 1)))
    name = random.choice(
        ("READ4",) * 6 + ("WRITE4",) * 3 + ("ECHO",) * 3 + ("DELAY",) * 2 + ("CLAIM", "UNCLAIM") * 2
        + ("READS", "WRITES", "WAIT", "LINES", "DRIVE", "RELEASE", "SAMPLE", "PIN", "GETPIN", "AT",
           "NOW", "SYNC", "PASS", "EVENTS", "LEASES", "SELECT", "HELLO", "READ", "WRITE")
    )  # fmt: skip
    byte = random.randrange(256)
    values: dict[str, tuple[int | bytes, ...]] = {
        "READ4": (byte & 1,), "WRITE4": (byte & 1, random.randrange(256)), "READ": (byte & 1,),
        "WRITE": (byte & 1, byte), "READS": (byte & 1, 1 + (byte & 15)),
        "WRITES": (byte & 1, random.randbytes(1 + (byte & 7))),
        "WAIT": (length,), "DELAY": (length,), "PASS": (length,),
        "AT": (max(0, now + length - random.choice((0, 0, 0, US))),),
        "LINES": (byte & 15, random.randrange(16)), "DRIVE": (byte,),
        "PIN": (byte & 7, random.randrange(3)), "GETPIN": (byte & 7,),
        "EVENTS": (byte & 3,), "LEASES": (byte % 3,), "SELECT": (byte & 3,), "HELLO": (1,),
    }  # fmt: skip
    if name == "ECHO":
        transcript.barrier()
    else:
        transcript.ask(name, *values.get(name, ()))
