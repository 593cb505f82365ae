"""Running nodes of a board in this process: their hosts' links, their time, what they leave."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, NoReturn

import msgspec

from vbus.board.snapshot import MAGIC
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.core.errors import ConfigError, OptionError, VbusError, read_errors, write_errors
from vbus.core.file_kinds import HEAD, is_none
from vbus.core.interpreter import keep_what_is_made
from vbus.nodes.conductor import Conductor
from vbus.nodes.machine import conductor_of, node_of, trace_lines
from vbus.nodes.machine_snapshot import NO_ROUNDS, read_nodes, restore
from vbus.nodes.node import Node, hash_of, merged
from vbus.nodes.plan import Plan, part_of, pins_of, plan_of
from vbus.nodes.scenario import Scenario, read_scenario
from vbus.serve.local_socket import Control
from vbus.serve.loop import run_until_signal, tell_ready
from vbus.serve.metrics import MetricsPort
from vbus.serve.nodes.node_link import NodeLink
from vbus.serve.nodes.node_records import join_waves, recording_of
from vbus.serve.nodes.peers import Group, Peers
from vbus.serve.nodes.realtime_nodes import RealTime
from vbus.serve.nodes.timebase import Timebase
from vbus.serve.output_file import OutputFile
from vbus.serve.recording import Recording
from vbus.serve.registry import own_board
from vbus.serve.server import ServedRun, Server
from vbus.serve.serving import links_of, metrics_of, network_of

LAST_WORDS: Final = 0.1
"""Seconds that a message to the other nodes may take before the link is closed; not measured."""


@dataclass(slots=True)
class NodeOptions:
    """How nodes are to be run.

    Attributes:
        nodes: names of those in this process; none named: all.
        scenario: file of what hosts do at given instants.
        trace: file that takes what has happened on these nodes.
        snapshot: file that takes a snapshot of the node four times a second.
        start: snapshot of the machine, or of this node, to go on from.
        patience: seconds to wait for a lost node to rejoin.
        listen: endpoint to listen on, in place of the board file's.
        connect: endpoints to connect to, in place of the board file's.
    """

    nodes: tuple[str, ...] = ()
    scenario: str = ""
    trace: str = ""
    snapshot: str = ""
    start: str = ""
    patience: float = 0.0
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()


@dataclass(slots=True)
class NodesOutcome:
    """What has come of a run.

    Attributes:
        nodes: the nodes of this process, as they are at the end.
        over: whether a scenario was played to its end.
        lost: why files have not all they should have; it has been said.
        skew: in real time: how far apart nodes were, by
            :meth:`~vbus.serve.nodes.realtime_nodes.Skew.statistics`.
        timing: in virtual time: rounds, and wall time of one (us).
    """

    nodes: list[Node]
    over: bool = False
    lost: list[str] = field(default_factory=list)
    skew: dict[str, Any] = field(default_factory=dict)
    timing: dict[str, float] = field(default_factory=dict)


def scenario_of(file: BoardFile, path: str) -> Scenario:
    """Return the scenario of a file.

    Raises:
        ConfigError: it cannot be read, or makes no sense.
    """
    with read_errors(path, ConfigError):
        text = Path(path).read_text()
    return read_scenario(text, path, pins_of(file), 1_000_000)


def names_of(plan: Plan, options: NodeOptions) -> tuple[str, ...]:
    """Return the nodes to be run here, in the order of the board file.

    Raises:
        ConfigError: there is no such node.
    """
    for name in options.nodes:
        plan.rank(name)
    return tuple(name for name in plan.nodes if not options.nodes or name in options.nodes)


def endpoints_of(
    file: BoardFile, names: Sequence[str], options: NodeOptions
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return where this process listens and where it connects.

    Raises:
        ConfigError: neither the file nor an option says where the nodes meet.
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
    built: Callable[[Node], None],
) -> list[Conductor]:
    """Return the nodes of this process, each where it is to begin in virtual time."""
    if options.snapshot and len(names) != 1:
        raise OptionError(
            "a snapshot holds one node; start each with its own --node and --snapshot"
        )
    made = [
        conductor_of(file, source, name, scenario, bool(options.trace), built) for name in names
    ]
    if options.start:
        with read_errors(options.start):
            data = Path(options.start).read_bytes()
        restore(made, read_nodes(data, options.start))
    return made


_TRACED: Final = '"vbus run BOARD --trace FILE" writes one, of a board with nodes'


def read_traces(paths: Sequence[str | Path]) -> tuple[list[str], str]:
    """Merge trace files of all nodes of a run; return the lines and their SHA-256 (hex).

    Raises:
        VbusError: a file cannot be read, or is no trace.
    """
    lines: list[tuple[int, int, int, str]] = []
    for path in paths:
        with read_errors(path), Path(path).open(encoding="ascii") as file:
            try:
                for number, line in enumerate(file):
                    when, rank, _ = line.split(" ", 2)
                    lines.append((int(when), int(rank), number, line))
            except ValueError:
                head = Path(path).read_bytes()[:HEAD]
                raise VbusError(is_none(path, head, "trace of nodes", _TRACED)) from None
    if not lines:
        raise VbusError(is_none(" and ".join(map(str, paths)), b"", "trace of nodes", _TRACED))
    merged_lines = [line for *_, line in sorted(lines)]
    return merged_lines, hash_of(merged_lines)


def serve_nodes(
    file: BoardFile,
    source: Source,
    options: NodeOptions,
    on_ready: Callable[[list[Server]], None] | None = None,
    report: Callable[[str], None] = print,
    before: Callable[[], Awaitable[None]] | None = None,
) -> NodesOutcome:
    """Run nodes until their scenario is over, or until SIGINT or SIGTERM.

    Args:
        file: the board.
        source: its text.
        options: which nodes, and how.
        on_ready: gets their servers once all nodes have met.
        report: takes sentences about what went wrong.
        before: awaited when the nodes of this process can be watched, in virtual time before it
            begins.

    Raises:
        ConfigError: the board or the scenario has mistakes.
        OptionError: an option makes no sense, or not for this board.
        TransportError: a link cannot be opened.
        NodeError: another node has died, stalls, or runs another board; names it.
        VbusError: a file to write is another writer's.
    """
    with ExitStack() as owned:
        run = _NodesRun(file, source, options, report, before, owned)

        def ready() -> None:
            keep_what_is_made()
            if on_ready is not None:
                on_ready(run.servers)
            tell_ready()

        run_until_signal(partial(run.serve, ready=ready))
    return run.outcome()


class _NodesRun(ServedRun):
    """Nodes of this process from their start to their end."""

    def __init__(
        self,
        file: BoardFile,
        source: Source,
        options: NodeOptions,
        report: Callable[[str], None],
        before: Callable[[], Awaitable[None]] | None,
        owned: ExitStack,
    ) -> None:
        super().__init__(before=before)
        if options.connect and file.zenoh.connect:  # hosts come by the same routers
            zenoh = msgspec.structs.replace(file.zenoh, connect=options.connect)
            file = msgspec.structs.replace(file, zenoh=zenoh)
        self._file: BoardFile = file
        self._options: NodeOptions = options
        self._report: Callable[[str], None] = report
        plan = plan_of(file)
        names = names_of(plan, options)
        scenario = scenario_of(file, options.scenario) if options.scenario else None
        for name in names:
            owned.enter_context(own_board(f"{file.board.name}.{name}"))
        self._trace, recorded = (
            owned.enter_context(closing(OutputFile(path, begins=begins))) if path else None
            for path, begins in ((options.trace, b""), (options.snapshot, MAGIC))
        )
        self._link: NodeLink | None = None
        # In real time orders to start come over the network, also if all nodes are here.
        self._real: bool = file.board.time == "realtime"
        places = options.listen or options.connect or file.zenoh.connect
        meets = bool(places) or plan.hub >= 0
        if len(names) < len(plan.nodes) or (self._real and meets):
            self._link = NodeLink(plan.board, plan.nodes, [plan.rank(name) for name in names])
        group = Group(plan, self._link, report, options.patience)
        self._recordings: dict[int, Recording] = {}
        self._lost: list[str] = []
        record = file.record
        wanted = record.journal or record.report or record.coverage or file.waves
        if options.start and wanted:
            raise OptionError(
                f"{file.path}: what is recorded begins at power-on, so nothing can be recorded of a"
                " node that goes on from a snapshot; leave it out with"
                " --from"
            )

        def built(node: Node) -> None:
            self._recordings[node.rank] = recording_of(file, node, report, owned)

        self._peers: Peers
        if self._real:
            if options.snapshot or options.start:
                raise OptionError(NO_ROUNDS)
            trace = bool(options.trace)
            self._nodes = [node_of(file, source, name, scenario, trace, built) for name in names]
            until = scenario.until if scenario is not None else -1
            self._peers = RealTime(group, self._nodes, until, file.board.rate)
        else:
            conductors = _conductors(file, source, names, scenario, options, built)
            self._nodes = [conductor.node for conductor in conductors]
            self._peers = Timebase(group, conductors, recorded)
        self.over = self._peers.finished

    async def finish(self) -> None:
        """Say why the nodes of this process give up, if they do.

        Raises:
            NodeError: another node was lost, or runs another board.
        """
        if self._peers.failure is not None:
            if self._link is not None:
                await asyncio.sleep(LAST_WORDS)
            raise self._peers.failure

    def end(self) -> None:
        """Leave the other nodes, close every link, and what is recorded."""
        with ExitStack() as closing:
            closing.callback(self._leave_trace)
            closing.callback(self._end_records)
            if self._link is not None:
                closing.callback(self._link.close)
            closing.callback(super().end)
            closing.callback(self._peers.stop)

    async def begin(self, loop: asyncio.AbstractEventLoop) -> None:
        """Meet the other nodes, and serve hosts: in virtual time before it begins."""
        if not self._real:
            await self._serve_hosts(loop)
        if self._link is not None:
            await self._open(self._link)
        for recording in self._recordings.values():
            recording.start(loop)
        self._peers.start(loop)
        await self._peers.agreed.wait()
        if self._real:
            await self._serve_hosts(loop)

    async def _open(self, link: NodeLink) -> None:
        names = [node.name for node in self._nodes]
        listen, connect = endpoints_of(self._file, names, self._options)
        network = network_of(self._file.zenoh)
        deadline = max(node.deadline for node in self._file.nodes if node.name in names) * 1e-12
        await link.open(
            self._peers, listen, connect, network.security, network.remote, deadline, self._report
        )

    async def _serve_hosts(self, loop: asyncio.AbstractEventLoop) -> None:
        metrics: tuple[str, int] | MetricsPort | None = metrics_of(self._file)
        for node in self._nodes:
            part = part_of(self._file, node.name)
            pacer = self._peers.pacer(node, part)
            recording = self._recordings[node.rank]
            server = Server(
                node.board, links_of(part), report=self._report, metrics=metrics, pacer=pacer,
                settle=recording.settle,
            )  # fmt: skip
            server.keep(recording)
            metrics = server.metrics
            server.details = partial(self._details, node)
            server.skew = self._peers.latest_skew
            self._use_orders(node, server.control)
            self.servers.append(server)
        await super().begin(loop)

    def _use_orders(self, node: Node, control: Control) -> None:
        """Leave of a board's orders those that a node can follow: faults happen in its own time."""
        for name in control.orders:
            if not name.startswith(("fault.", "journal.", "status")):
                control.orders[name] = partial(_refuse, node.board.name)
        peers, rank = self._peers, node.rank

        def by_grant(request: dict[str, Any], reply: Callable[[dict[str, Any]], None]) -> None:
            def do(refusal: str) -> None:
                reply({"error": refusal} if refusal else control.carry_out(request))

            peers.let_in(rank, do)

        control.answered = {
            "fault.arm": by_grant, "fault.clear": by_grant, "snap.node": peers.save_node,
        }  # fmt: skip

    def _details(self, node: Node) -> dict[str, Any]:
        journal = self._recordings[node.rank].about
        return {"node": self._peers.status(node.rank)} | ({"journal": journal} if journal else {})

    def _end_records(self) -> None:
        """The nodes have stopped: end every recording; of all nodes, join their waveforms."""
        for recording in self._recordings.values():
            recording.close()
        if len(self._recordings) == len(self._file.nodes):
            self._lost += join_waves(self._file, self._report)
        self._lost += [line for one in self._recordings.values() for line in one.failures]

    def _leave_trace(self) -> None:
        if self._trace is None:
            return
        try:
            with write_errors(self._trace.path):
                self._trace.begin_text().writelines(merged(trace_lines(self._nodes)))
            self._trace.keep()
        except VbusError as error:
            self._lost.append(str(error))
            self._report(str(error))

    def outcome(self) -> NodesOutcome:
        """Return what has come of it."""
        over = self.over.is_set() and bool(self._options.scenario)
        lost = [*self._lost, *self._peers.lost]
        return NodesOutcome(self._nodes, over, lost, **self._peers.figures())


def _refuse(name: str, request: dict[str, Any]) -> NoReturn:
    """Refuse an order that would leave the other nodes behind.

    Raises:
        ValueError: always.
    """
    raise ValueError(
        f"{name} is a node: its time and state are those of all nodes, so it cannot be halted,"
        " moved or saved alone; in virtual time vbus snap save with the name of the machine keeps"
        " that of all nodes, and vbus run --snapshot FILE that of one, to rejoin"
    )
