"""Host entries of a board while it runs: where hosts come from, and which are there."""

import asyncio
from collections.abc import Callable
from typing import Any

from msgspec import Struct, field

from vbus import plugins
from vbus.board.card.cards import Card
from vbus.boardfile.sections import NO_HOST, HostSection, PinMapSection
from vbus.network.session import Network
from vbus.protocols.base import Protocol
from vbus.serve.session import Session
from vbus.transports.base import Link, Transport, split_url


class LinkSpec(Struct):
    """One host entry of a board file.

    Attributes:
        transport: address, e.g. ``"pty:$VBUS_RUNTIME/x"``.
        protocol: name of the wire format; empty for the transport's usual one.
        chips: names of the chips its sessions may select; empty for all.
        cycle_ps: cost of a whole bus cycle; 0 for the default.
        card: address decoding of a card, if any.
        pin_map: wiring of a microcontroller's port bits, if any.
        network: the board's place on the network, for transports that use it.
        remote: other computers may be let in.
        line: the entry itself, whose serial line it may be.
    """

    transport: str
    protocol: str = ""
    chips: list[str] = field(default_factory=list)
    cycle_ps: int = 0
    card: Card | None = None
    pin_map: PinMapSection | None = None
    network: Network | None = None
    remote: bool = False
    line: HostSection = NO_HOST


class HostEntry:
    """A host entry while the board runs: its transport and its sessions."""

    def __init__(self, spec: LinkSpec, label: str) -> None:
        scheme, path, options = split_url(spec.transport)
        self.spec: LinkSpec = spec
        self.label: str = label
        self.transport: Transport = plugins.class_of(plugins.TRANSPORTS, scheme, Transport)(
            path, options
        )
        self.transport.remote = spec.remote
        self.transport.line = spec.line
        self.protocol: str = spec.protocol or self.transport.PROTOCOL
        self.wire: type[Protocol] = plugins.class_of(plugins.PROTOCOLS, self.protocol, Protocol)
        self.transport.no_room = self.wire.NO_ROOM
        self.sessions: list[Session] = []
        self.served: int = 0
        self._received: int = 0
        self._sent: int = 0

    @property
    def received(self) -> int:
        """Bytes of all its sessions, those that have ended included."""
        return self._received + sum(session.received for session in self.sessions)

    @property
    def sent(self) -> int:
        """Bytes sent to all its sessions."""
        return self._sent + sum(session.sent for session in self.sessions)

    def open(
        self, loop: asyncio.AbstractEventLoop, board: str, report: Callable[[str], None],
        connect: Callable[[Link], None],
    ) -> None:  # fmt: skip
        """Let hosts in from now on.

        Args:
            loop: the event loop.
            board: name of the board.
            report: takes sentences about what happens to the link.
            connect: takes each host that comes.

        Raises:
            TransportError: the address cannot be used.
        """
        transport = self.transport
        transport.closing = False
        transport.report, transport.board = report, board
        transport.open(loop, connect)

    def close(self, why: str) -> None:
        """End every session, and let no host in any more; may be called again."""
        self.transport.closing = True
        for session in list(self.sessions):
            session.end(why)
        self.transport.close()

    def ended(self, session: Session) -> None:
        """A session is over; what it carried stays counted."""
        self.sessions.remove(session)
        self._received += session.received
        self._sent += session.sent

    def status(self, chips: list[str]) -> dict[str, Any]:
        """Return what ``vbus ls --json`` shows of it; ``chips`` are those of the board."""
        return {
            "url": self.transport.url,
            "protocol": self.protocol,
            "chips": self.spec.chips or chips,
            "state": "connected" if self.sessions else self.transport.state,
            "sessions": len(self.sessions),
            "served": self.served,
            "received": self.received,
            "sent": self.sent,
        }
