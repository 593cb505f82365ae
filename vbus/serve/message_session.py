"""One connected host that sends messages: each is carried out, then answered as a whole."""

from collections import deque
from typing import Final

from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.serve.session import Services, Session
from vbus.transports import states
from vbus.transports.base import MessageLink

SLICE: Final = 4096
"""Bytes of a message that are carried out before other sessions have their turn: some 4 ms of
requests of a byte, which take 1 us each in the interpreted core."""


class MessageSession(Session):
    """Serves one :class:`~vbus.transports.base.MessageLink`.

    The protocol sees the bytes of the messages one after the other, as if they had come over a
    wire; what a message gave is collected until it has been carried out to its last byte.
    """

    def __init__(
        self, services: Services, link: MessageLink, port: HostPort, protocol: Protocol
    ) -> None:
        super().__init__(services, link, port, protocol)
        self._services: Services = services
        self._messages: MessageLink = link
        self._collected: bytearray = bytearray()
        self._rest: deque[bytes] = deque()
        self._answering: bool = False

    def tell_pause(self, paused: bool) -> None:
        """The link tells."""

    def take(self, data: bytes) -> None:
        """Carry out the next message; an empty one is answered at once."""
        self._answering = True
        self.received += len(data)
        if not data:
            self._answer()
        else:
            self._cut(data)
            self.serve(self._rest.popleft())

    def _cut(self, data: bytes) -> None:
        self._rest = deque(data[start : start + SLICE] for start in range(0, len(data), SLICE))

    def serve(self, data: bytes) -> None:
        """Carry out a slice, or go on after a wait; then the rest, or the answer."""
        super().serve(data)
        if not self.open or self.port.held:
            return
        if self._rest:
            self._services.loop.call_soon(self._go_on)
        elif self._answering:
            self._answer()

    def _go_on(self) -> None:
        """Carry out the next slice."""
        if self.state == states.CLOSED:
            return
        if self._services.pacer.halted or self.port.held:
            self.hold()  # for its own wait, or a pause that has come between slices
        elif self._rest:
            self.serve(self._rest.popleft())
            if self.state == states.DEPARTED and not self.port.held:
                self.carried_out()

    def _answer(self) -> None:
        if not self.settled():  # a durable journal is full; the session has ended
            return
        reply = bytes(self._collected)
        self._collected.clear()
        self._answering = False
        self.sent += len(reply)
        self._messages.answer(reply)

    def host_left(self) -> None:
        """Carry out one slice of what the host had sent at once; a longer rest takes its turns.

        256 messages of 64 KiB are a minute of bus cycles, in which all other hosts would wait.
        """
        if self.open and not self._services.detached.closed:
            self._answering = False
            self._cut(b"".join((*self._rest, *self._messages.left())))
            if self._rest and not self.port.held:
                super().serve(self._rest.popleft())
        super().host_left()

    def more(self) -> bool:
        """Whether the protocol has not been given all that the host had sent."""
        return bool(self._rest)

    def carried_out(self) -> None:
        """Go on with the rest of what the host had sent; the session ends behind it."""
        if self._rest:
            self._services.loop.call_soon(self._go_on)
        else:
            super().carried_out()

    def send(self) -> None:
        """Keep what the message gave so far, for a host that is there."""
        if not self.deaf:
            self._collected += self.protocol.out
        self.protocol.out.clear()

    def push(self) -> None:
        """Send bytes that answer no message."""
        data = self.protocol.take()
        self.sent += len(data)
        self._messages.push(data)
