"""All hosts of one board: listening, serving, telling about itself, stopping."""

import asyncio
import json
import logging
import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from vbus.board import plugins
from vbus.board.board import Board
from vbus.board.cards import Card
from vbus.board.pin_maps import PinMap
from vbus.compiled import core
from vbus.errors import NameInUseError, PluginError, TransportError
from vbus.network.session import Network
from vbus.protocols.base import Protocol
from vbus.server.control import Control
from vbus.server.fault_orders import FaultOrders
from vbus.server.loop import HostLoop
from vbus.server.message_session import MessageSession
from vbus.server.metrics import MetricsPort
from vbus.server.pacer import Pacer
from vbus.server.registry import status_path
from vbus.server.session import Session
from vbus.server.snapshots import SnapshotOrders
from vbus.server.statistics import ROUND_TRIP_NS, Histogram
from vbus.server.watching import Watching
from vbus.trace.decode import settings_for_decoders
from vbus.transports.base import Link, MessageLink, Served, Transport, split_url
from vbus.transports.sockets import UnixTransport

log = logging.getLogger("vbus")


@dataclass(slots=True)
class LinkSpec:
    """One host entry of a board file.

    Attributes:
        transport: address, e.g. ``"pty:$VBUS_RUNTIME/x"``.
        protocol: name of the wire format; empty for the transport's usual one.
        chips: names of the chips its sessions may select; empty for all.
        cycle_ps: cost of a whole bus cycle; 0 for the default.
        card: address decoding of a card, if any.
        pin_map: wiring of a microcontroller's port bits, if any.
        network: the board's place on the network, for transports that use it.
    """

    transport: str
    protocol: str = ""
    chips: list[str] = field(default_factory=list)
    cycle_ps: int = 0
    card: Card | None = None
    pin_map: PinMap | None = None
    network: Network | None = None


class _Host:
    """A host entry while the board runs: its transport and its sessions."""

    def __init__(
        self, spec: LinkSpec, transport: Transport, protocol: str, wire: type[Protocol]
    ) -> None:
        self.spec: LinkSpec = spec
        self.transport: Transport = transport
        self.protocol: str = protocol
        self.wire: type[Protocol] = wire
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

    def ended(self, session: Session) -> None:
        """A session is over; what it carried stays counted."""
        self.sessions.remove(session)
        self._received += session.received
        self._sent += session.sent


class Server:
    """Serves a board to its hosts until told to stop.

    Args:
        board: the board; it is moved by nobody else from here on.
        links: the hosts' entries.
        stall: what happens after a stall of the machine; see :class:`Pacer`.
        report: takes sentences about what happens to links (a device was unplugged).
        metrics: host and port on which Prometheus may ask for numbers, if any.
        pacer: what moves the board's time; else a pacer of its own.

    Raises:
        PluginError: a transport or protocol is missing, or prometheus-client for ``metrics``.
    """

    def __init__(
        self,
        board: Board,
        links: list[LinkSpec],
        stall: str = "catch_up",
        report: Callable[[str], None] | None = None,
        metrics: tuple[str, int] | None = None,
        pacer: Pacer | None = None,
    ) -> None:
        self.board: Board = board
        self.pacer: Pacer = pacer if pacer is not None else Pacer(board, stall)
        self._report: Callable[[str], None] = report if report is not None else log.warning
        self._hosts: list[_Host] = [self._host(spec) for spec in links]
        self._status: UnixTransport | None = None
        self._watching: Watching = Watching(board, self.statistics)
        self.control: Control = Control(board.name, self.pacer.catch_up)
        SnapshotOrders(board, self.pacer, self.control, self.sessions)
        self.faults: FaultOrders = FaultOrders(
            board.faults, self.control, self.sessions_of, self.soon
        )
        self._loop: asyncio.AbstractEventLoop | None = None
        self.round_trips: Histogram = Histogram(ROUND_TRIP_NS)
        self._metrics: MetricsPort | None = None
        if metrics is not None:
            self._metrics = MetricsPort(*metrics, self.statistics)

    @staticmethod
    def _host(spec: LinkSpec) -> _Host:
        scheme, path, options = split_url(spec.transport)
        made = plugins.load(plugins.TRANSPORTS, scheme)
        if not isinstance(made, type) or not issubclass(made, Transport):
            raise PluginError(f'transport "{scheme}" is not a subclass of Transport')
        transport = made(path, options)
        name = spec.protocol or transport.PROTOCOL
        wire = plugins.load(plugins.PROTOCOLS, name)
        if not isinstance(wire, type) or not issubclass(wire, Protocol):
            raise PluginError(f'protocol "{name}" is not a subclass of Protocol')
        return _Host(spec, transport, name, wire)

    def sessions(self) -> Iterator[Session]:
        """Give every session that is open, host by host."""
        for host in self._hosts:
            yield from host.sessions

    @property
    def urls(self) -> list[str]:
        """Addresses of all hosts' links, in the order of the board file."""
        return [host.transport.url for host in self._hosts]

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open every link and let time run.

        Raises:
            TransportError: a link cannot be opened, or a board of this name runs already;
                nothing is left open.
        """
        self._loop = loop
        try:
            self._open_status(loop)
            for host in self._hosts:
                host.transport.report = self._report
                host.transport.serves(self._served(host.spec))
                host.transport.open(loop, self._linker(host, loop))
            if self._metrics is not None:
                self._metrics.open(loop)
        except TransportError:
            self.stop()
            raise
        self.pacer.start(loop)

    def _served(self, spec: LinkSpec) -> Served:
        """Return what a transport may know of the board."""
        chips = spec.chips or [chip.name for chip in self.board.chips]
        return Served(self.board, tuple(chips), self.statistics, self.pacer.catch_up, spec.network)

    def _linker(self, host: _Host, loop: asyncio.AbstractEventLoop) -> Callable[[Link], None]:
        def linked(link: Link) -> None:
            host.served += 1
            label = f"host{self._hosts.index(host)}"
            spec = host.spec
            session: Session
            if isinstance(link, MessageLink):
                # The addresses of a card and the wires of a pin map are those of the whole entry.
                whole = not link.chips
                port = self.board.open_port(
                    label,
                    link.chips or spec.chips or None,
                    spec.cycle_ps,
                    spec.card if whole else None,
                    spec.pin_map if whole else None,
                )
                session = MessageSession(
                    loop, link, port, host.wire(port), self.pacer, host.ended, self.round_trips
                )
            else:
                port = self.board.open_port(
                    label, spec.chips or None, spec.cycle_ps, spec.card, spec.pin_map
                )
                session = Session(
                    loop, link, port, host.wire(port), self.pacer, host.ended, self.round_trips
                )
            port.on_resume = session.resume_soon
            port.on_events = session.events_soon
            host.sessions.append(session)
            if self.faults.acting:
                self.faults.joined(self._hosts.index(host), session)

        return linked

    def sessions_of(self, place: int) -> list[Session] | None:
        """Return the sessions of the host entry at ``place``; None if there is no such entry."""
        return list(self._hosts[place].sessions) if place < len(self._hosts) else None

    def soon(self, session: Session, reason: str) -> None:
        """End a session when what it does now is done."""
        if self._loop is not None:
            self._loop.call_soon(session.end, reason)

    def stop(self) -> None:
        """End every session and remove every name; may be called again."""
        self.pacer.stop()
        for host in self._hosts:
            host.transport.closing = True
            for session in list(host.sessions):
                session.end("the board stops")
            host.transport.close()
        if self._status is not None:
            self._status.close()
            self._status = None
        self._watching.close()
        self.control.close()
        if self._metrics is not None:
            self._metrics.close()

    async def serve(self, stop: asyncio.Event, ready: Callable[[], None] | None = None) -> None:
        """Serve until ``stop`` is set."""
        self.start(asyncio.get_running_loop())
        try:
            if ready is not None:
                ready()
            await stop.wait()
        finally:
            self.stop()

    # -- telling about itself -------------------------------------------------------------------

    def _open_status(self, loop: asyncio.AbstractEventLoop) -> None:
        path = status_path(self.board.name)
        status = UnixTransport(str(path), {})
        try:
            status.open(loop, self._tell)
        except NameInUseError as error:
            raise NameInUseError(
                f'a board called "{self.board.name}" runs already ({error}); stop it, or give'
                " this one another name"
            ) from error
        self._status = status
        self._watching.open(loop)
        self.control.open(loop)

    def _tell(self, link: Link) -> None:
        try:
            os.set_blocking(link.fd, True)
            os.write(link.fd, json.dumps(self.statistics()).encode())
        except OSError:  # who asked did not wait for the answer
            pass
        link.close()

    def statistics(self) -> dict[str, Any]:
        """Return what ``vbus ls --json`` shows of this board; times in ps."""
        board = self.board
        self.pacer.catch_up()
        settings = settings_for_decoders(board.chips)
        return {
            "board": board.name,
            "pid": os.getpid(),
            "core": core(),
            "policy": board.policy,
            "rate": "max" if self.pacer.free else board.rate,
            "time_ps": board.now,
            "lag_ps": self.pacer.lag,
            "worst_lag_ps": self.pacer.worst_lag,
            "slipped_ps": self.pacer.slipped,
            "chips": [
                {
                    "name": chip.name,
                    "part": chip.part,
                    "family": chip.FAMILY,
                    "bus_settings": settings.get(chip.name, {}),
                    "clock_hz": chip.clock.hz,
                    "reads": chip.reads,
                    "writes": chip.writes,
                }
                for chip in board.chips
            ],
            "links": [
                {
                    "url": host.transport.url,
                    "protocol": host.protocol,
                    "chips": host.spec.chips or [chip.name for chip in board.chips],
                    "state": host.transport.state,
                    "sessions": len(host.sessions),
                    "served": host.served,
                    "received": host.received,
                    "sent": host.sent,
                }
                for host in self._hosts
            ],
            "counters": dict(board.counters),
            "violations": {rule: n for rule, n in board.counters.items() if "." in rule},
            "sessions": sum(len(host.sessions) for host in self._hosts),
            "lag": self.pacer.lags.told("ps"),
            "round_trips": self.round_trips.told("ns"),
            "metrics": "" if self._metrics is None else self._metrics.url,
        }


def run(
    board: Board,
    links: list[LinkSpec],
    stall: str = "catch_up",
    on_ready: Callable[[Server], None] | None = None,
    report: Callable[[str], None] | None = None,
    metrics: tuple[str, int] | None = None,
) -> None:
    """Serve ``board`` until SIGINT or SIGTERM.

    Raises:
        TransportError: a link cannot be opened.
    """

    async def main() -> None:
        server = Server(board, links, stall, report, metrics)
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        await server.serve(stop, None if on_ready is None else lambda: on_ready(server))

    with asyncio.Runner(loop_factory=HostLoop) as runner:
        runner.run(main())
