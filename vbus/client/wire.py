"""The host's end of the byte protocol, free of I/O: messages to bytes, bytes to replies."""

from collections import deque
from itertools import pairwise
from struct import pack
from typing import Final

from vbus.client.lease import Lease
from vbus.client.message import Event, Later, Message, Values
from vbus.core.errors import ProtocolError, VbusError
from vbus.protocols.requests import (
    FATAL,
    FORESEEN,
    LEASED,
    REFUSALS,
    REPLIES,
    REQUESTS,
    Reply,
)  # fmt: skip

REMEMBERED: Final = 1024
"""Requests without a reply that are remembered, to name them when they are refused."""

_BY_CODE: Final = {reply.code: reply for reply in REPLIES.values()}
_DATA: Final = ord("D")


class SessionWire:
    """One session as the host sees it: what has been asked, and what has come back.

    Attributes:
        selected: the selection the board has now; None if a SELECT was refused.
        events: edges reported and not yet taken.
        paused: whether the board is paused, by its last report.
    """

    def __init__(self) -> None:
        self.selected: int | None = 1
        self.cycles: list[int] = []
        """What a bus cycle of each chip costs (ps); with it, polls are answered from leases."""
        self.stamped_polls: bool = False
        """Whether the board understands POLLED_AT."""
        self._lease: Lease | None = None
        self._polling: int = -1
        self.events: deque[Event] = deque()
        self.paused: bool = False
        self._bytes: bytearray = bytearray()
        self._number: int = 0
        self._awaited: deque[Later[Values]] = deque()
        self._posted: deque[tuple[int, str]] = deque(maxlen=REMEMBERED)
        self._refused: VbusError | None = None
        self._dead: VbusError | None = None

    def send(self, message: Message, mask: int | None = None) -> bytes:
        """Return the bytes of ``message``, behind a SELECT if it needs another selection.

        Raises:
            ProtocolError: the session has ended; says why.
        """
        # Said again to every call: a session that has ended does not come back.
        if self._dead is not None:
            raise self._dead
        head = self._pass_lease(message, mask)
        # Selected once, and not again before another chip is meant.
        if mask is not None and mask != self.selected:
            head += REQUESTS["SELECT"].pack(mask)
            self._posted.append((self._number, "SELECT"))
            self._number += 1
            self.selected = mask
        for name, later in message.requests:
            if later is None:
                # Remembered by number: a refusal names no request.
                self._posted.append((self._number, name))
            else:
                later.number = self._number
                self._awaited.append(later)
            self._number += 1
        if message.mask is not None:
            self.selected = message.mask
        return head + bytes(message.data)

    def known(self, message: Message, mask: int | None) -> bytes | None:
        """Answer ``message`` if it is a poll whose byte a lease knows.

        Returns:
            The bytes that report it to the board, often none; None if the board must be asked.
        """
        lease = self._lease
        # Another chip, or none: its bytes are not known.
        if lease is None or mask not in (None, self.selected) or self._dead is not None:
            return None
        # The stamp waits for the poll that it belongs to.
        if lease.stamps and message.only_stamp:
            polls = b"" if lease.takes(message.stamp) else self.tell_polls()
            lease.at(message.stamp)
            return polls
        if message.polls < 0 or not lease.poll(message.polls):
            return None
        for _, later in message.requests:
            if later is not None:
                later.settle((lease.data,))
        return self.tell_polls() if lease.telling else b""

    def tell_polls(self) -> bytes:
        """Return the bytes that tell the board of polls it was spared and of a stamp."""
        lease = self._lease
        if lease is None:
            return b""
        data = b""
        # Stamps travel as a first instant and steps: four bytes for a poll instead of nine.
        if lease.run:
            steps = [after - before for before, after in pairwise(lease.run)]
            data += self._tell(
                "POLLED_AT", lease.address, lease.run[0], pack(f">{len(steps)}I", *steps)
            )
        if lease.polls:
            data += self._tell("POLLED", lease.address, lease.polls)
        lease.clear()
        if lease.stamp >= 0:
            data += self._tell("AT", lease.stamp)
            lease.stamp_sent()
        return data

    def _tell(self, name: str, *values: int | bytes) -> bytes:
        self._posted.append((self._number, name))
        self._number += 1
        return REQUESTS[name].pack(*values)

    def _pass_lease(self, message: Message, mask: int | None) -> bytes:
        """``message`` is about to be sent: tell of earlier polls; it may end the lease."""
        data = self.tell_polls()
        self._polling = message.polls
        # Whatever reaches the chip may change the byte.
        if message.touches or mask not in (None, self.selected):
            self._lease = None
        elif self._lease is not None:
            if message.stamp >= 0:
                self._lease.at(message.stamp)
            if message.duration:
                self._lease.delay(message.duration)
        return data

    def _take_lease(self, values: Values) -> None:
        """A read was answered by a lease."""
        data, _, instant, until, *then = (int(value) for value in values)
        mask = self.selected or 0
        chip = mask.bit_length() - 1
        # Of one chip alone: of several a read gives the AND of their bytes.
        if self._polling >= 0 and mask == 1 << chip and chip < len(self.cycles):
            self._lease = Lease(
                self._polling, data, instant, until, self.cycles[chip],
                (then[0], then[1]) if then else None,
            )  # fmt: skip
            self._lease.stamps = self.stamped_polls

    def end(self, error: VbusError) -> None:
        """Give the session up: nothing can be sent, and whatever is awaited fails."""
        if self._dead is None:
            self._dead = error
        while self._awaited:
            self._awaited.popleft().fail(error)

    def raise_refusal(self) -> None:
        """Raise what a request without a reply was refused with, if any was."""
        error, self._refused = self._refused, None
        if error is not None:
            raise error

    def feed(self, data: bytes) -> None:
        """Take bytes from the board; settle the replies they complete."""
        self._bytes += data
        position = 0
        awaited = self._awaited
        while self._dead is None and position < len(self._bytes):
            code = self._bytes[position]
            # Fast way for the reply to a read, the most frequent: no layout is asked.
            if code == _DATA and position + 1 < len(self._bytes) and awaited:
                if awaited[0].reply == "D":
                    awaited.popleft().settle((self._bytes[position + 1],))
                    position += 2
                    continue
            reply = _BY_CODE.get(code)
            # Bytes cannot be skipped: where the next reply begins is not known.
            if reply is None:
                self.end(
                    ProtocolError(
                        f"byte {self._bytes[position]:02x} is no reply of the byte protocol;"
                        " is it the board file's protocol for this link?"
                    )
                )
                break
            used = self._take(reply, position)
            if used == 0:
                break
            position += used
        del self._bytes[:position]

    def _take(self, reply: Reply, position: int) -> int:
        """Take one reply; return its bytes, or 0 if it is not complete."""
        layout = reply.layout
        start = position + 1
        end = layout.end(self._bytes, start)
        if not end:
            return 0
        values: Values = layout.unpack_from(self._bytes, start)
        if layout.counted:
            values = (*values[:-1], bytes(self._bytes[start + layout.size : end]))
        if reply.tag == "I":
            self.events.append(Event(int(values[0]), int(values[1])))
        elif reply.tag == "H":
            self.paused = bool(values[0])
        elif reply.tag == "X":
            self.refuse(int(values[0]), int(values[1]))
        else:
            self._settle(reply, values)
        return end - position

    def _settle(self, reply: Reply, values: Values) -> None:
        expected = self._awaited[0].reply if self._awaited else ""
        # The same byte, and how long it stays.
        if reply.tag in (LEASED, FORESEEN) and expected == "D":
            self._take_lease(values)
            values = values[:1]
        elif expected != reply.tag:
            asked = self._awaited[0].name if self._awaited else "nothing"
            self.end(ProtocolError(f"the board replied {reply.tag!r} to {asked}"))
            return
        self._awaited.popleft().settle(values)

    def refuse(self, code: int, number: int) -> None:
        """Take a refusal: of the request that is awaited, or of one that was posted."""
        _, reason = REFUSALS.get(code, ("", f"reason {code:02x}"))
        later = self._awaited[0] if self._awaited else None
        # A refusal counts requests in 16 bits.
        if later is not None and later.number & 0xFFFF == number:
            error = ProtocolError(f"{later.name} (request {number}) was refused: {reason}")
            self._awaited.popleft()
            later.fail(error)
        else:
            name = next((name for n, name in self._posted if n & 0xFFFF == number), "request")
            # Which chips are selected is not known now: the next message selects anew.
            if name == "SELECT":
                self.selected = None
            error = ProtocolError(f"{name} (request {number}) was refused: {reason}")
            # The first is the cause; those behind it may follow from it.
            if self._refused is None:
                self._refused = error
        if code in FATAL:
            self.end(error)
