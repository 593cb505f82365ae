"""One connected host that sends messages: each is carried out, then answered as a whole."""

from collections import deque
from collections.abc import Callable
from typing import Final

from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.serve.session import Serving, Session
from vbus.transports.base import MessageLink

SLICE: Final = 4096
"""Bytes of a message that are carried out before other sessions have their turn."""


class MessageSession(Session):
    """Serves one :class:`~vbus.transports.base.MessageLink`.

    The protocol sees the bytes of the messages one after the other, as if they had come over a
    wire; what a message gave is collected until it has been carried out to its last byte.
    """

    def __init__(
        self, serving: Serving, link: MessageLink, port: HostPort, protocol: Protocol
    ) -> None:
        super().__init__(serving, link, port, protocol)
        self._messages: MessageLink = link
        self._collected: bytearray = bytearray()
        self._rest: deque[bytes] = deque()
        self._answering: bool = False

    def _attend(self, read: bool, watch: bool) -> None:
        """Messages come when the link has them; it says when the host has gone."""

    def tell_pause(self, paused: bool) -> None:
        """The link tells."""

    def _take(self, data: bytes) -> None:
        """Carry out the next message; an empty one is answered at once."""
        self._answering = True
        self.received += len(data)
        if not data:
            self._answer()
        elif len(data) <= SLICE:
            self._serve(data)
        else:
            self._rest.extend(data[start : start + SLICE] for start in range(0, len(data), SLICE))
            self._serve(self._rest.popleft())

    def _serve(self, data: bytes) -> None:
        super()._serve(data)
        if not self.open or self.port.held:
            return
        if self._rest:
            self._loop.call_soon(self._go_on)
        elif self._answering:
            self._answer()

    def _go_on(self) -> None:
        """Carry out the next part of a long message."""
        if self.open and self._rest and not self.port.held:
            self._serve(self._rest.popleft())

    def _answer(self) -> None:
        if not self._settled():
            return
        reply = bytes(self._collected)
        self._collected.clear()
        self._answering = False
        self.sent += len(reply)
        self._messages.answer(reply)

    def _depart(self) -> None:
        """What the host had sent is carried out, to the end of its last message."""
        if not self._detached.closed:
            for data in (*self._rest, *self._messages.left()):
                self.protocol.receive(data)
        super()._depart()

    def _part(self, reason: str, end: Callable[[], None], hang_up: bool = False) -> None:
        """End the session, and let the link say why."""
        self._messages.reason = self._messages.reason or reason
        super()._part(reason, end, hang_up)

    def _send(self) -> None:
        """Keep what the message gave so far."""
        self._collected += self.protocol.out
        self.protocol.out.clear()

    def _push(self) -> None:
        data = self.protocol.take()
        self.sent += len(data)
        self._messages.push(data)
