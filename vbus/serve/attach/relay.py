"""A host of this computer and its session with the remote board, byte for byte."""

from collections.abc import Callable
from typing import ClassVar, Final

from vbus.core.state import Names
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.serve.attach.upstream import Upstream
from vbus.serve.session import MOST_PENDING, Services, Session
from vbus.transports.base import Link
from vbus.transports.states import DONE

SOME_TIME: Final = 1
"""An instant: what is held until then is not held for ever."""


class RelayPort(HostPort):
    """A host's hold on a board elsewhere: it is held while the board takes no more bytes.

    Args:
        upstream: the session with the board.
    """

    def __init__(self, upstream: Upstream) -> None:
        self.upstream: Upstream = upstream

    def send(self, data: bytes) -> None:
        """Send bytes to the board."""
        self.upstream.send(data)
        if self.upstream.full:
            self.held = True
            self.hold_until = SOME_TIME

    def go_on(self) -> bool:
        """Lift the hold if the board takes bytes again."""
        self.held = self.upstream.full
        return not self.held

    def finish(self) -> None:
        """The host sends no more, and is there for its answers."""
        self.upstream.finish(True)

    def depart(self, protocol: Protocol) -> None:
        """The host has gone: what it has sent is carried out, then the session ends."""
        protocol.reset()
        self.close()

    def close(self) -> None:
        """End the session: what has been asked for is done first."""
        self.upstream.finish(False)


class Passage(Protocol):
    """The wire format of the board's own link: bytes pass through without being read."""

    WIRING: ClassVar[Names] = ("_relay",)

    def __init__(self, port: RelayPort) -> None:
        super().__init__(port)
        self._relay: RelayPort = port

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        if data:
            self._relay.send(data)

    def reset(self) -> None:
        """Forget what was not sent to the host."""
        self.out.clear()


class RelaySession(Session):
    """Serves one host: what it sends goes to the board, and what the board answers to it."""

    def __init__(self, services: Services, link: Link, port: RelayPort, protocol: Protocol) -> None:
        super().__init__(services, link, port, protocol)
        self._gone_of: Callable[[list[int]], set[int]] = services.disconnects.gone_of
        self._upstream: Upstream = port.upstream
        self._relay: RelayPort = port
        self._over: bool = False
        self._upstream.on_data = self.deliver
        self._upstream.on_room = self.resume

    def deliver(self, data: bytes) -> None:
        """Send the host what has come from the board; the board waits for a host that is slow."""
        if self.open:
            self.protocol.out += data
            self.send()
            if len(self.pending) > MOST_PENDING:
                self._upstream.read_off()

    def stays(self) -> bool:
        """Whether a host that sends no more is there for what it has asked for."""
        if self._gone_of([self.link.fd]):
            return False
        self._relay.finish()
        return True

    def depart(self) -> None:
        """What the host has sent goes to the board; nothing waits here."""
        self._relay.depart(self.protocol)
        self.move(DONE)

    def all_sent(self) -> None:
        """The host has all there is by now; the board may send more while it is there."""
        self._upstream.read_on()
        if self._over:
            self.end("the board has ended the session", True)

    def board_done(self) -> None:
        """The session with the board is over, as it was to be: the host gets what is left."""
        self._over = True
        if not self.pending:
            self.all_sent()
