"""All hosts of one board: listening, serving, telling about itself, stopping."""

import asyncio
import json
import logging
import os
import signal
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from vbus.board import plugins
from vbus.board.board import Board
from vbus.board.cards import Card
from vbus.board.pin_maps import PinMap
from vbus.compiled import core
from vbus.errors import NameInUseError, PluginError
from vbus.kernel import END
from vbus.network.session import Network
from vbus.protocols.base import Protocol
from vbus.server.control import Control, ControlConnection
from vbus.server.fault_orders import FaultOrders
from vbus.server.hang_ups import HangUps
from vbus.server.local_socket import Connection, LocalSocket, OnEnd
from vbus.server.loop import HostLoop
from vbus.server.message_session import MessageSession
from vbus.server.metrics import MetricsPort
from vbus.server.pacer import Pacer
from vbus.server.registry import control_path, status_path, watch_path
from vbus.server.session import Serving, Session
from vbus.server.snapshots import SnapshotOrders
from vbus.server.statistics import ROUND_TRIP_NS, Histogram
from vbus.server.watchdog import Watchdog
from vbus.server.watching import Watcher
from vbus.trace.decode import settings_for_decoders
from vbus.transports.base import Link, MessageLink, Served, Transport, split_url

log = logging.getLogger("vbus")

_Base = TypeVar("_Base")


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

    def __init__(self, spec: LinkSpec, label: str) -> None:
        scheme, path, options = split_url(spec.transport)
        self.spec: LinkSpec = spec
        self.label: str = label
        self.transport: Transport = _plugin(plugins.TRANSPORTS, scheme, Transport)(path, options)
        self.protocol: str = spec.protocol or self.transport.PROTOCOL
        self.wire: type[Protocol] = _plugin(plugins.PROTOCOLS, self.protocol, Protocol)
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


def _plugin(group: str, name: str, base: type[_Base]) -> type[_Base]:
    """Return the class an entry point names.

    Raises:
        PluginError: there is none, or it is no such class.
    """
    found = plugins.load(group, name)
    if not isinstance(found, type) or not issubclass(found, base):
        kind = base.__name__
        raise PluginError(f'{kind.lower()} "{name}" is not a subclass of {kind}')
    return found


class _StatusConnection(Connection):
    """Somebody who asks what ``vbus ls --json`` shows."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, link: Link, on_end: OnEnd, server: "Server"
    ) -> None:
        super().__init__(loop, link, on_end)
        self._server: Server = server

    def begin(self) -> None:
        """Answer at once."""
        self.finish(self._server.status())


class Server:
    """Serves a board to its hosts until told to stop.

    Args:
        board: the board; it is moved by nobody else from here on.
        links: the hosts' entries.
        stall: what happens after a stall of the machine; see :class:`Pacer`.
        report: takes sentences about what happens to links (a device was unplugged).
        metrics: host and port on which Prometheus may ask for numbers, if any.
        pacer: what moves the board's time; else a pacer of its own.
        settle: called before a host gets its answer; see
            :class:`~vbus.server.recording.Recording`.

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
        settle: Callable[[], bool] | None = None,
    ) -> None:
        self._settle: Callable[[], bool] | None = settle
        self.board: Board = board
        self.pacer: Pacer = pacer if pacer is not None else Pacer(board, stall)
        self._report: Callable[[str], None] = report if report is not None else log.warning
        self.pacer.report = self._report
        self._hosts: list[_Host] = [_Host(spec, f"host{n}") for n, spec in enumerate(links)]
        self.faults: FaultOrders = FaultOrders(board.faults, self.sessions_of)
        self.control: Control = Control(self.pacer.catch_up)
        self.control.orders |= SnapshotOrders(board, self.pacer, self.sessions).orders()
        self.control.orders |= self.faults.orders()
        self.round_trips: Histogram = Histogram(ROUND_TRIP_NS)
        self._metrics: MetricsPort | None = None
        if metrics is not None:
            self._metrics = MetricsPort(*metrics, self.statistics)
        self.details: Callable[[], dict[str, Any]] = dict
        """Makes more of what is told of the board."""
        self.local_sockets: tuple[LocalSocket, ...] = ()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._closing: ExitStack = ExitStack()

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
        self.board.faults.links = self.faults
        try:
            self._open_local_sockets(loop)
            hang_ups = HangUps(loop)
            hang_ups.open()
            self._closing.callback(hang_ups.close)
            for host in self._hosts:
                self._open_host(host, loop, hang_ups)
            if self._metrics is not None:
                self._metrics.open(loop)
                self._closing.callback(self._metrics.close)
        except BaseException:
            self.stop()
            raise
        self._closing.callback(self.pacer.stop)
        self.pacer.start(loop)

    def _open_local_sockets(self, loop: asyncio.AbstractEventLoop) -> None:
        name = self.board.name
        self.local_sockets = (
            LocalSocket(status_path(name), partial(_StatusConnection, server=self)),
            LocalSocket(watch_path(name), self._watcher),
            LocalSocket(control_path(name), partial(ControlConnection, control=self.control)),
        )
        for local in self.local_sockets:
            self._closing.callback(local.close)
            try:
                local.open(loop)
            except NameInUseError as error:
                raise NameInUseError(
                    f'a board called "{name}" runs already ({error}); stop it, or give'
                    " this one another name"
                ) from error

    def _watcher(self, loop: asyncio.AbstractEventLoop, link: Link, on_end: OnEnd) -> Watcher:
        return Watcher(loop, link, on_end, self.board, self.status())

    def _open_host(self, host: _Host, loop: asyncio.AbstractEventLoop, hang_ups: HangUps) -> None:
        board, transport = self.board, host.transport
        chips = tuple(host.spec.chips or [chip.name for chip in board.chips])
        transport.report = self._report
        transport.serves(
            Served(board, chips, self.statistics, self.pacer.catch_up, host.spec.network)
        )
        self._closing.callback(self._close_host, host)
        serving = Serving(loop, self.pacer, self.round_trips, hang_ups, host.ended, self._settle)
        transport.open(loop, partial(self._connect, host, serving))

    def _connect(self, host: _Host, serving: Serving, link: Link) -> None:
        """Begin the session of a host that has connected."""
        host.served += 1
        spec = host.spec
        kind: type[Session] = Session
        chips, card, pin_map = spec.chips, spec.card, spec.pin_map
        if isinstance(link, MessageLink):
            kind = MessageSession
            if link.chips:
                # The addresses of a card and the wires of a pin map are those of the whole entry.
                chips, card, pin_map = list(link.chips), None, None
        port = self.board.open_port(host.label, chips or None, spec.cycle_ps, card, pin_map)
        session = kind(serving, link, port, host.wire(port))
        port.on_resume = session.resume_soon
        port.on_events = session.events_soon
        host.sessions.append(session)
        session.begin()
        self.faults.connected(self._hosts.index(host), session)

    def sessions_of(self, place: int) -> list[Session] | None:
        """Return the sessions of the host entry at ``place``; None if there is no such entry."""
        return list(self._hosts[place].sessions) if place < len(self._hosts) else None

    @staticmethod
    def _close_host(host: _Host) -> None:
        host.transport.closing = True
        for session in list(host.sessions):
            session.end("the board stops")
        host.transport.close()

    def stop(self) -> None:
        """End every session and remove every name; may be called again."""
        self._closing.close()

    async def serve(self, stop: asyncio.Event, ready: Callable[[], None] | None = None) -> None:
        """Serve until ``stop`` is set.

        Raises:
            TimeEndedError: chip time has come to its end; every link has been closed.
        """
        self.pacer.on_end = stop.set
        self.start(asyncio.get_running_loop())
        try:
            if ready is not None:
                ready()
            await stop.wait()
        finally:
            self.stop()
        self.pacer.check_over()

    # -- telling about itself -------------------------------------------------------------------

    def status(self) -> bytes:
        """Return the statistics as JSON."""
        return json.dumps(self.statistics()).encode()

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
            "time_left_ps": END - board.now,
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
            "lag": self.pacer.lags.summary("ps"),
            "round_trips": self.round_trips.summary("ns"),
            "metrics": "" if self._metrics is None else self._metrics.url,
            **self.details(),
        }


def run(
    board: Board,
    links: list[LinkSpec],
    stall: str = "catch_up",
    on_ready: Callable[[Server], None] | None = None,
    report: Callable[[str], None] | None = None,
    metrics: tuple[str, int] | None = None,
    settle: Callable[[], bool] | None = None,
) -> None:
    """Serve ``board`` until SIGINT or SIGTERM.

    Raises:
        TransportError: a link cannot be opened.
    """

    async def serve(stop: asyncio.Event) -> None:
        server = Server(board, links, stall, report, metrics, settle=settle)
        await server.serve(stop, None if on_ready is None else partial(on_ready, server))

    run_until_signal(serve)


def run_until_signal(serve: Callable[[asyncio.Event], Coroutine[Any, Any, None]]) -> None:
    """Run a coroutine in a loop of its own; SIGINT and SIGTERM set the event it is given.

    One that is stuck and cannot is killed within a second; see :mod:`vbus.server.watchdog`.
    """

    async def main(watchdog: Watchdog) -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()

        def end(number: int, frame: object) -> None:
            watchdog.heard()
            loop.call_soon_threadsafe(stop.set)

        # Not the loop's own handlers: the one descriptor C's handler writes to is the watchdog's.
        before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            await serve(stop)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    with Watchdog() as watchdog, asyncio.Runner(loop_factory=HostLoop) as runner:
        runner.run(main(watchdog))
