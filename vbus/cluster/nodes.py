"""Running nodes of a board in this process: their hosts' links, their time, what they leave."""

import asyncio
import hashlib
import signal
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from vbus.board.sections import BoardFile
from vbus.board.source import Source
from vbus.cluster.granted import GrantedPacer
from vbus.cluster.node_link import NodeLink
from vbus.cluster.peers import Peers
from vbus.cluster.realtime_nodes import RealTime
from vbus.cluster.timebase import Timebase
from vbus.errors import ConfigError, VbusError
from vbus.nodes.conductor import Conductor
from vbus.nodes.machine import conductor_of, node_of
from vbus.nodes.node import Node
from vbus.nodes.plan import Plan, part_of, pins_of, plan_of
from vbus.nodes.scenario import Scenario, read_scenario
from vbus.nodes.trace import merged
from vbus.server.loop import HostLoop
from vbus.server.pacer import Pacer
from vbus.server.readiness import tell_ready
from vbus.server.server import LinkSpec, Server
from vbus.server.serving import links_of, network_of

LAST_WORDS: Final = 0.1
"""Seconds that a message to the other nodes may take before the link is closed."""


@dataclass(slots=True)
class NodeOptions:
    """How nodes are to be run.

    Attributes:
        nodes: names of those in this process; none named: all.
        scenario: file of what hosts do at given instants.
        trace: file that takes what has happened on these nodes.
        snapshot: file that takes a snapshot of the node four times a second.
        rejoin: snapshot to go on from.
        patience: seconds to wait for a lost node to rejoin.
        listen: endpoint to listen on, in place of the board file's.
        connect: endpoints to connect to, in place of the board file's.
    """

    nodes: tuple[str, ...] = ()
    scenario: str = ""
    trace: str = ""
    snapshot: str = ""
    rejoin: str = ""
    patience: float = 0.0
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()


class NodeServer(Server):
    """Serves the hosts of one node.

    Args:
        node: the node.
        links: the hosts' entries.
        pacer: what moves its time.
        status: returns what is told of it as a node.
        report: takes sentences about what happens to links.
    """

    def __init__(
        self,
        node: Node,
        links: list[LinkSpec],
        pacer: Pacer,
        status: Callable[[int], dict[str, Any]],
        report: Callable[[str], None],
    ) -> None:
        super().__init__(node.board, links, report=report, pacer=pacer)
        self._rank: int = node.rank
        self._status_of: Callable[[int], dict[str, Any]] = status
        # What is ordered from outside, such as another state, would leave the other nodes behind.
        self.control.orders.clear()

    def statistics(self) -> dict[str, Any]:
        """Return what ``vbus ls --json`` shows of this node."""
        return {**super().statistics(), "node": self._status_of(self._rank)}


@dataclass(slots=True)
class Outcome:
    """What has come of a run.

    Attributes:
        nodes: the nodes of this process, as they are at the end.
        over: whether a scenario was played to its end.
        skew: in real time: how far apart nodes were, by :meth:`~vbus.cluster.skew.Skew.statistics`.
        timing: in virtual time: rounds, and wall time of one (us).
    """

    nodes: list[Node]
    over: bool = False
    skew: dict[str, Any] = field(default_factory=dict)
    timing: dict[str, float] = field(default_factory=dict)


def scenario_of(file: BoardFile, path: str) -> Scenario:
    """Return the scenario of a file.

    Raises:
        ConfigError: it cannot be read, or makes no sense.
    """
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "this is no UTF-8 text"
        raise ConfigError(f"{path}: cannot be read: {reason}") from None
    return read_scenario(text, path, pins_of(file), 1_000_000)


def names_of(plan: Plan, options: NodeOptions) -> tuple[str, ...]:
    """Return the nodes to be run here, in the order of the board file.

    Raises:
        ConfigError: there is no such node.
    """
    for name in options.nodes:
        try:
            plan.rank(name)
        except ValueError as error:
            raise ConfigError(str(error)) from None
    return tuple(name for name in plan.nodes if not options.nodes or name in options.nodes)


def endpoints_of(
    file: BoardFile, names: Sequence[str], options: NodeOptions
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return where this process listens and where it connects.

    Raises:
        ConfigError: nobody has said where the nodes meet.
    """
    if options.listen or options.connect:
        return options.listen, options.connect
    for node in file.nodes:
        if node.listen:
            return ((node.listen,), ()) if node.name in names else ((), (node.listen,))
    if file.zenoh.connect:
        return (), file.zenoh.connect
    raise ConfigError(
        f'{file.path}: where do the nodes meet? write listen = "tcp/127.0.0.1:7447" at one of them,'
        " or start one with --listen and the others with --connect"
    )


def _conductors(
    file: BoardFile,
    source: Source,
    names: Sequence[str],
    scenario: Scenario | None,
    options: NodeOptions,
) -> list[Conductor]:
    """Return the nodes of this process, each where it is to begin in virtual time."""
    if (options.snapshot or options.rejoin) and len(names) != 1:
        raise ConfigError(
            "a snapshot holds one node; start each with its own --node and --snapshot"
        )
    made = [conductor_of(file, source, name, scenario, bool(options.trace)) for name in names]
    if options.rejoin:
        try:
            data = Path(options.rejoin).read_bytes()
        except OSError as error:
            raise VbusError(f"{options.rejoin}: cannot be read: {error.strerror}") from error
        made[0].load(data)
    return made


def write_trace(nodes: Sequence[Node], path: str) -> None:
    """Write the traces of some nodes, merged: instant, rank of the node, what happened.

    Raises:
        VbusError: the file cannot be written.
    """
    try:
        with Path(path).open("w", encoding="ascii", newline="\n") as file:
            for when, rank, text in merged(_lines(nodes)):
                file.write(f"{when} {rank} {text}\n")
    except OSError as error:
        raise VbusError(f"{path}: cannot be written: {error.strerror}") from error


def _lines(nodes: Sequence[Node]) -> list[list[tuple[int, str]]]:
    lines: list[list[tuple[int, str]]] = []
    for node in nodes:
        node.board.catch_up()
        lines += [[] for _ in range(node.rank - len(lines))]
        lines.append(node.trace.lines() if node.trace is not None else [])
    return lines


def read_traces(paths: Sequence[str]) -> tuple[str, int]:
    """Merge trace files of all nodes of a run; return the SHA-256 (hex) and the number of lines.

    Raises:
        VbusError: a file cannot be read, or is no trace.
    """
    lines: list[tuple[int, int, int, str]] = []
    for path in paths:
        try:
            with Path(path).open(encoding="ascii") as file:
                for number, line in enumerate(file):
                    when, rank, _ = line.split(" ", 2)
                    lines.append((int(when), int(rank), number, line))
        except OSError as error:
            raise VbusError(f"{path}: cannot be read: {error.strerror}") from error
        except ValueError:
            raise VbusError(f"{path}: this is no trace of nodes") from None
    lines.sort()
    total = hashlib.sha256()
    for *_, line in lines:
        total.update(line.encode())
    return total.hexdigest(), len(lines)


def serve_nodes(
    file: BoardFile,
    source: Source,
    options: NodeOptions,
    on_ready: Callable[[list[Server]], None] | None = None,
    report: Callable[[str], None] = print,
) -> Outcome:
    """Run nodes until their scenario is over, or until SIGINT or SIGTERM.

    Raises:
        ConfigError: the board or the scenario has mistakes.
        TransportError: a link cannot be opened.
        NodeError: another node has died, stalls, or runs another board; names it.
    """
    run = _Run(file, source, options, report)

    async def main() -> None:
        loop = asyncio.get_running_loop()
        stop = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        await run.serve(stop, on_ready)

    with asyncio.Runner(loop_factory=HostLoop) as runner:
        runner.run(main())
    return run.outcome()


class _Run:
    """Nodes of this process from their start to their end."""

    def __init__(
        self,
        file: BoardFile,
        source: Source,
        options: NodeOptions,
        report: Callable[[str], None],
    ) -> None:
        self._file: BoardFile = file
        self._options: NodeOptions = options
        self._report: Callable[[str], None] = report
        self._plan: Plan = plan_of(file)
        names = names_of(self._plan, options)
        scenario = scenario_of(file, options.scenario) if options.scenario else None
        self._link: NodeLink | None = None
        # In real time whoever orders a start comes over the network, also if all nodes are here.
        places = options.listen or options.connect or file.zenoh.connect
        meets = bool(places) or self._plan.hub >= 0
        if len(names) < len(self._plan.nodes) or (file.board.time == "realtime" and meets):
            ranks = [self._plan.rank(name) for name in names]
            self._link = NodeLink(self._plan.board, self._plan.nodes, ranks)
        self._servers: list[Server] = []
        self._virtual: Timebase | None = None
        self._real: RealTime | None = None
        link, patience = self._link, options.patience
        if file.board.time == "realtime":
            if options.snapshot or options.rejoin:
                raise ConfigError("a snapshot is for virtual time; this board is realtime")
            self._nodes = [
                node_of(file, source, name, scenario, bool(options.trace)) for name in names
            ]
            until = scenario.until if scenario is not None else -1
            rate = file.board.rate
            self._real = RealTime(self._plan, self._nodes, link, report, patience, until, rate)
            self._peers: Peers = self._real
        else:
            conductors = _conductors(file, source, names, scenario, options)
            self._nodes = [conductor.node for conductor in conductors]
            self._virtual = Timebase(
                self._plan, conductors, link, report, patience, options.snapshot
            )
            self._peers = self._virtual

    async def serve(
        self, stop: asyncio.Event, on_ready: Callable[[list[Server]], None] | None
    ) -> None:
        """Run until the scenario is over, a node is lost, or ``stop`` is set."""
        loop = asyncio.get_running_loop()
        stopped = asyncio.ensure_future(stop.wait())
        failed = asyncio.ensure_future(self._peers.finished.wait())
        ends = (stopped, failed)
        try:
            if self._virtual is not None:
                self._serve_virtual(self._virtual, loop)
            if self._link is not None:
                names = [node.name for node in self._nodes]
                listen, connect = endpoints_of(self._file, names, self._options)
                security = network_of(self._file.zenoh).security
                if not await _first(self._link.open(listen, connect, security, self._report), ends):
                    return
            self._peers.start(loop)
            if self._real is not None:
                if not await _first(self._real.epoch_known.wait(), ends):
                    return
                self._serve_real(self._real, loop)
            if on_ready is not None:
                on_ready(self._servers)
            tell_ready()
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for end in ends:
                end.cancel()
            if self._link is not None and self._peers.failure is not None:
                await asyncio.sleep(LAST_WORDS)
            self._peers.stop()
            for server in self._servers:
                server.stop()
            if self._link is not None:
                self._link.close()
            if self._options.trace:
                write_trace(self._nodes, self._options.trace)
            if self._peers.failure is not None:
                raise self._peers.failure

    def _serve_virtual(self, timebase: Timebase, loop: asyncio.AbstractEventLoop) -> None:
        for conductor in timebase.conductors:
            part = part_of(self._file, conductor.node.name)
            conductor.awaited = {f"host{n}" for n, host in enumerate(part.hosts) if host.awaited}
            pacer = GrantedPacer(conductor.node.board, timebase.kick)
            timebase.on_grant.append(pacer.granted)
            self._start(conductor.node, pacer, timebase.status, loop)

    def _serve_real(self, real: RealTime, loop: asyncio.AbstractEventLoop) -> None:
        for node in self._nodes:
            pacer = real.pace(node, self._file.board.stall)
            self._start(node, pacer, real.status, loop)

    def _start(
        self,
        node: Node,
        pacer: Pacer,
        status: Callable[[int], dict[str, Any]],
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        links = links_of(part_of(self._file, node.name))
        server = NodeServer(node, links, pacer, status, self._report)
        self._servers.append(server)
        server.start(loop)

    def outcome(self) -> Outcome:
        """Return what has come of it."""
        skew = self._real.skew.statistics() if self._real is not None else {}
        over = self._peers.finished.is_set() and bool(self._options.scenario)
        timing = self._virtual.timing() if self._virtual is not None else {}
        return Outcome(self._nodes, over, skew, timing)


async def _first(work: Coroutine[Any, Any, Any], ends: tuple[asyncio.Future[Any], ...]) -> bool:
    """Do some work; return whether it was done before one of ``ends`` came."""
    task = asyncio.ensure_future(work)
    await asyncio.wait((task, *ends), return_when=asyncio.FIRST_COMPLETED)
    if not task.done():
        task.cancel()
        return False
    task.result()
    return True
