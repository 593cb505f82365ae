"""All hosts of one board: listening, services, telling about itself, stopping."""

import asyncio
import logging
import os
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.boardfile.sections import HostSection
from vbus.circuit.stream import settings_for_decoders
from vbus.compiled import core
from vbus.core.errors import NameInUseError, TransportError
from vbus.core.kernel import END
from vbus.protocols.base import Protocol
from vbus.protocols.serial_line import BREAK, DTR, RTS, ModemPins, SerialLine, frame_ps
from vbus.serve.detached_waits import DetachedWaits, DisconnectPoller
from vbus.serve.fast_path import SpinTurn
from vbus.serve.host_entry import HostEntry
from vbus.serve.host_entry import LinkSpec as LinkSpec
from vbus.serve.local_socket import Connection, Control, LocalSocket
from vbus.serve.loop import done_before, first_of, run_until_signal
from vbus.serve.message_session import MessageSession
from vbus.serve.metrics import MetricsPort
from vbus.serve.orders.fault_orders import FaultOrders
from vbus.serve.orders.snapshots import snapshot_orders
from vbus.serve.recording import Recording, no_journal
from vbus.serve.registry import own_board, runs_already, socket_path
from vbus.serve.session import Services, Session
from vbus.serve.time.pacer import WallClockPacer
from vbus.serve.time.statistics import ROUND_TRIP_NS, Histogram
from vbus.serve.time.steps import RUNNING, Steps
from vbus.transports.base import Link, MessageLink, Served

if TYPE_CHECKING:
    from vbus.serve.orders.watching import BoardView, Watched
    from vbus.views.scope.lanes import Lateness

log = logging.getLogger("vbus")


def on_line(host: HostSection, board: Board, port: HostBus, wire: Protocol) -> SerialLine | None:
    """Return a wire format at the end of the line a host entry describes; None without a line.

    Args:
        host: the entry.
        board: the board.
        port: the session's port.
        wire: the wire format, on that port.
    """
    modem = None
    if any(host.driven.values()):
        lines = ((DTR, host.dtr), (RTS, host.rts), (BREAK, host.breaks))
        modem = ModemPins(
            tuple((bit, number) for bit, pins in lines for number in _numbers(board, port, pins)),
            tuple(_numbers(board, port, host.reset)),
            host.change_time,
        )
    elif not host.baud:
        return None
    port.promises = not host.baud
    return SerialLine(port, wire, frame_ps(host.baud, host.frame) if host.baud else 0, modem)


def _numbers(board: Board, port: HostBus, pins: Iterable[str]) -> Iterable[int]:
    """Return the numbers of the session's side pins that are on the nets of these, each once."""
    nets = [board.find_pin(name).net for name in pins]
    return [number for number, side in enumerate(port.pins.sides) if side.net in nets]


PATIENCE_SECONDS: Final = 5.0
"""How long a board that is to stop carries out what hosts that have gone had sent (wall time);
not measured."""
REAL_SECONDS: Final = 0.001
"""How often it looks whether that is done, in real time; not measured."""


class Server:
    """Serves a board to its hosts until :meth:`stop`.

    Args:
        board: the board; from here on only the server moves its time.
        links: the hosts' entries.
        stall: what happens after a stall of the machine; see :class:`WallClockPacer`.
        report: takes sentences about what happens to links (a device was unplugged).
        metrics: host and port on which Prometheus may ask for numbers, if any; or where another
            board of this process tells its own.
        pacer: what moves the board's time; else a pacer of its own.
        settle: called before a host gets its answer; see
            :class:`~vbus.serve.recording.Recording`.

    Raises:
        PluginError: a transport or protocol is broken, or prometheus-client is missing.
    """

    def __init__(
        self,
        board: Board,
        links: list[LinkSpec],
        stall: str = "catch_up",
        report: Callable[[str], None] | None = None,
        metrics: tuple[str, int] | MetricsPort | None = None,
        pacer: WallClockPacer | None = None,
        settle: Callable[[], bool] | None = None,
    ) -> None:
        self._settle: Callable[[], bool] | None = settle
        self.board: Board = board
        self.pacer: WallClockPacer = pacer if pacer is not None else WallClockPacer(board, stall)
        self._report: Callable[[str], None] = report if report is not None else log.warning
        self.pacer.report = self._report
        self.hosts: list[HostEntry] = [HostEntry(spec, f"host{n}") for n, spec in enumerate(links)]
        self.faults: FaultOrders = FaultOrders(board, self.hosts)
        self.control: Control = Control(self.pacer.catch_up)
        self.control.orders |= snapshot_orders(board, self.pacer, self.sessions)
        self.control.orders |= self.faults.orders()
        self.steps: Steps = Steps(board, self.pacer, self.sessions)
        self.control.orders |= self.steps.orders()
        self._watched: Watched | None = None
        self._recording: Recording | None = None
        self.control.orders["journal.save"] = no_journal
        self.control.orders["status"] = lambda request: self.statistics()
        self.round_trips: Histogram = Histogram(ROUND_TRIP_NS)
        self._turns: SpinTurn = SpinTurn()
        self.detached: DetachedWaits = DetachedWaits(self.pacer)
        self.metrics: MetricsPort | None = None
        self._shares_metrics: bool = isinstance(metrics, MetricsPort)
        if isinstance(metrics, MetricsPort):
            self.metrics = metrics
            metrics.add(self.statistics)
        elif metrics is not None:
            self.metrics = MetricsPort(*metrics, self.statistics)
        self.details: Callable[[], dict[str, Any]] = dict
        """Gives the parts of the detailed status report that others add."""
        self.skew: Callable[[], int | None] = lambda: None
        """Gives the clock skew between nodes; None on a board without nodes."""
        self.local_socket: LocalSocket = LocalSocket(self.control, self._view)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._closing: ExitStack = ExitStack()

    def keep(self, recording: Recording) -> None:
        """Tell of what is recorded of the board, save its journal, and go back in it, if asked."""
        if recording.about:
            self.details = partial(dict, journal=recording.about)
            self.control.orders["journal.save"] = recording.save
            self._recording = recording

    def sessions(self) -> Iterator[Session]:
        """Give every session that is open, host by host."""
        for host in self.hosts:
            yield from host.sessions

    @property
    def urls(self) -> list[str]:
        """Addresses of all hosts' links, in the order of the board file."""
        return [host.transport.url for host in self.hosts]

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open every link and let time run.

        Raises:
            TransportError: a link cannot be opened, or a board of this name runs already;
                nothing is left open.
        """
        self._loop = loop
        self.board.serve_links(self.faults)
        try:
            self._closing.enter_context(own_board(self.board.name))
            self._closing.callback(self.local_socket.close)
            try:
                self.local_socket.open(loop, socket_path(self.board.name))
            except NameInUseError as error:
                raise runs_already(self.board.name, error) from error
            disconnects = DisconnectPoller(loop)
            disconnects.open()
            self._closing.callback(disconnects.close)
            self.pacer.look_for_hosts = disconnects.look
            self.detached.look_for_hosts = partial(self._look_for_hosts, disconnects)
            for host in self.hosts:
                self._open_host(host, loop, disconnects)
            if self.metrics is not None and not self._shares_metrics:
                self.metrics.open(loop)
                self._closing.callback(self.metrics.close)
            self._closing.callback(self._mark_pause, False)
            self._mark_pause(False)
            self.steps.changed.append(lambda: self._mark_pause(self.steps.state != RUNNING))
            # Closed in the reverse order: time stands before the last waits are given up, and those
            # before the links close.
            self._closing.callback(self.detached.close)
            self._closing.callback(self.pacer.stop)
            self.pacer.start(loop)
        except BaseException as error:
            self.stop()
            if isinstance(error, OSError) and not isinstance(error, TransportError):
                raise TransportError(f"board {self.board.name}: {error.strerror}") from error
            raise

    def _mark_pause(self, paused: bool) -> None:
        """Leave word with each link that it answers later, or that it answers again."""
        for host in self.hosts:
            host.transport.tell_pause(paused)
        for session in self.sessions():
            session.tell_pause(paused)

    def _view(self, connection: Connection, given: dict[str, Any]) -> "BoardView":
        """Return what a connection asks to watch."""
        # Whatever records is imported by the first who watches: a board starts without.
        from vbus.serve.orders.jump import JumpBack
        from vbus.serve.orders.watching import Watched, view_of

        if self._watched is None:
            jump = JumpBack(self.board, self.pacer, self.steps, self._onlookers)
            jump.recording = self._recording
            self._watched = Watched(self.board, self._late, self.control, self.steps, jump)
        return view_of(self._watched, connection, given)

    def _onlookers(self) -> list[Any]:
        return [one.view for one in self.local_socket.connections if one.view is not None]

    def _look_for_hosts(self, disconnects: DisconnectPoller) -> None:
        sessions = [session for session in self.sessions() if session.link.fd >= 0]
        gone = disconnects.gone_of(session.link.fd for session in sessions)
        for session in sessions:
            if session.link.fd in gone:
                session.hung_up()

    def _open_host(
        self, host: HostEntry, loop: asyncio.AbstractEventLoop, disconnects: DisconnectPoller
    ) -> None:
        board = self.board
        chips = tuple(host.spec.chips or [chip.name for chip in board.chips])
        host.transport.serves(
            Served(board, chips, self.statistics, self.pacer.catch_up, host.spec.network)
        )
        self._closing.callback(host.close, "the board stops")
        services = Services(
            loop, self.pacer, self._turns, self.round_trips, disconnects, self.detached,
            host.ended, self._settle,
        )  # fmt: skip
        connect = partial(self._connect, host, services)
        admit = partial(self.detached.admit, begin=connect)
        host.open(loop, board.name, self._report, admit)

    def _connect(self, host: HostEntry, services: Services, link: Link) -> None:
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
        wire = host.wire(port)
        line = on_line(spec.line, self.board, port, wire)
        session = kind(services, link, port, line or wire)
        # What is said unasked takes its time on a line, too.
        port.on_events = session.resume_soon if line else session.events_soon
        host.sessions.append(session)
        session.begin()
        if self.pacer.halted:
            session.hold()
        self.faults.connected(host, session)

    def stop(self) -> None:
        """End every session and remove every name; may be called again."""
        try:
            self._closing.close()
        except OSError as error:  # everything else has been closed
            self._report(f"board {self.board.name}, while it stopped: {error}")

    async def finish(self, over: Callable[[], bool], passing: bool = True) -> None:
        """Carry out what hosts that have gone had sent: before the board stops, and is judged.

        Returns when there is no more of it, or none that can go on: a CLAIM of a host that has
        gone may wait for one that stays, and time may have been paused.

        Args:
            over: asked now and then; no more is carried out once it says so.
            passing: whether that takes time, if hosts had asked for some.
        """
        pause = REAL_SECONDS if self.pacer.real else 0.0
        while self._leaving(passing) and not over():
            await asyncio.sleep(pause)

    def _leaving(self, passing: bool) -> bool:
        """Whether there is something to carry out of a host that has gone."""
        if self.pacer.halted or self.pacer.over:
            return False
        return (
            any(host.transport.waiting() for host in self.hosts)
            or any(
                session.leaves() and (passing or not session.port.held)
                for session in self.sessions()
            )
            or (passing and self.detached.passing)
        )

    # -- telling about itself -------------------------------------------------------------------

    def _late(self) -> "Lateness":
        from vbus.views.scope.lanes import Lateness

        return Lateness(self.pacer.lag, self.pacer.overload.times, self.skew())

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
            "state": self.steps.state,
            "rate": "max" if self.pacer.free else board.rate,
            "time_ps": board.now,
            "time_left_ps": END - board.now,
            "lag_ps": self.pacer.lag,
            "worst_lag_ps": self.pacer.worst_lag,
            "slipped_ps": self.pacer.slipped,
            "overload": self.pacer.overload.times,
            "worst_overload": self.pacer.overload.worst,
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
            "links": [host.status([chip.name for chip in board.chips]) for host in self.hosts],
            "counters": dict(board.counters),
            "violations": {rule: n for rule, n in board.counters.items() if "." in rule},
            "sessions": sum(len(host.sessions) for host in self.hosts),
            "lag": self.pacer.lags.summary("ps"),
            "round_trips": self.round_trips.summary("ns"),
            "metrics": "" if self.metrics is None else self.metrics.url,
            **self.details(),
        }


class ServedRun:
    """Boards that are served in this process, from their start to their end.

    What hosts that have gone had sent is carried out at the end; in real time, as far as it needs
    no time.

    Args:
        servers: a board's, or one for each node.
        before: what is waited for before the run is ready; cancelled by its end.
        patience: how long hosts that have gone keep a board (s of wall time), where hosts are
            masters of time.

    Attributes:
        over: set when the run ends by itself.
    """

    def __init__(
        self,
        servers: Iterable[Server] = (),
        before: Callable[[], Awaitable[None]] | None = None,
        patience: float = PATIENCE_SECONDS,
    ) -> None:
        self.servers: list[Server] = list(servers)
        self.over: asyncio.Event = asyncio.Event()
        self._before: Callable[[], Awaitable[None]] | None = before
        self._patience: float = patience

    async def serve(self, stop: asyncio.Event, ready: Callable[[], object] | None = None) -> None:
        """Run until ``stop`` is set, or the run is over.

        Args:
            stop: ends the run.
            ready: called once all is open and ``before`` has returned.

        Raises:
            TimeEndedError: chip time has come to its end; every link has been closed.
        """
        self.stop: asyncio.Event = stop
        ends = (stop, self.over)
        try:
            if await done_before(ends, self.begin(asyncio.get_running_loop())):
                if ready is not None and not stop.is_set():
                    ready()
                await first_of(ends)
            await self.finish()
        finally:
            self.end()
        for server in self.servers:
            server.pacer.check_over()

    async def begin(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open every link, and wait for what is to come before the run is ready."""
        for server in self.servers:
            self.open(server, loop)
        if self._before is not None:
            await self._before()

    def open(self, server: Server, loop: asyncio.AbstractEventLoop) -> None:
        """Open the links of a board; the run stops when its time has ended."""
        server.pacer.on_end = self.stop.set
        server.start(loop)

    async def finish(self) -> None:
        """Carry out what hosts that have gone had sent."""
        loop = asyncio.get_running_loop()
        last = loop.time() + self._patience
        for server in self.servers:
            await server.finish(lambda: loop.time() > last, not server.pacer.real)

    def end(self) -> None:
        """Close every link; may be called again."""
        with ExitStack() as stopping:  # each, whatever the others raise
            for server in self.servers:
                stopping.callback(server.stop)


def run(
    board: Board,
    links: list[LinkSpec],
    stall: str = "catch_up",
    on_ready: Callable[[Server], None] | None = None,
    report: Callable[[str], None] | None = None,
    metrics: tuple[str, int] | None = None,
    settle: Callable[[], bool] | None = None,
    before: "Callable[[Server], Awaitable[None]] | None" = None,
) -> None:
    """Serve ``board`` until SIGINT or SIGTERM.

    Raises:
        TransportError: a link cannot be opened.
    """

    async def serve(stop: asyncio.Event) -> None:
        server = Server(board, links, stall, report, metrics, settle=settle)
        ready = None if on_ready is None else partial(on_ready, server)
        first = None if before is None else partial(before, server)
        await ServedRun([server], first).serve(stop, ready)

    run_until_signal(serve)
