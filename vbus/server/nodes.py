"""Running nodes of a board in this process: their hosts' links, their time, what they leave."""

import asyncio
import contextlib
import hashlib
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vbus.board.sections import BoardFile
from vbus.board.source import Source
from vbus.errors import ConfigError, TransportError, VbusError
from vbus.network.security import Security
from vbus.nodes.conductor import Conductor
from vbus.nodes.machine import conductor_of
from vbus.nodes.plan import Plan, part_of, pins_of, plan_of
from vbus.nodes.scenario import Scenario, read_scenario
from vbus.nodes.trace import merged
from vbus.server.granted import GrantedPacer
from vbus.server.loop import HostLoop
from vbus.server.node_link import NodeLink
from vbus.server.server import LinkSpec, Server
from vbus.server.serving import links_of
from vbus.server.timebase import Timebase


@dataclass(slots=True)
class NodeWishes:
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
        security: certificates of the network, if any.
    """

    nodes: tuple[str, ...] = ()
    scenario: str = ""
    trace: str = ""
    snapshot: str = ""
    rejoin: str = ""
    patience: float = 0.0
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    security: Security | None = field(default=None, repr=False)


class NodeServer(Server):
    """Serves the hosts of one node.

    Args:
        conductor: the node.
        links: the hosts' entries.
        timebase: what moves its time.
        report: takes sentences about what happens to links.
    """

    def __init__(
        self,
        conductor: Conductor,
        links: list[LinkSpec],
        timebase: Timebase,
        report: Callable[[str], None],
    ) -> None:
        limit = conductor.node.board.limit
        super().__init__(conductor.node.board, links, report=report)
        conductor.node.board.limit = limit
        self._rank: int = conductor.node.rank
        self._timebase: Timebase = timebase
        pacer = GrantedPacer(conductor.node.board, timebase.kick)
        timebase.on_grant.append(pacer.granted)
        self.pacer = pacer

    def statistics(self) -> dict[str, Any]:
        """Return what ``vbus ls --json`` shows of this node."""
        return {**super().statistics(), "node": self._timebase.status(self._rank)}


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


def names_of(plan: Plan, wishes: NodeWishes) -> tuple[str, ...]:
    """Return the nodes to be run here, in the order of the board file.

    Raises:
        ConfigError: there is no such node.
    """
    for name in wishes.nodes:
        try:
            plan.rank(name)
        except ValueError as error:
            raise ConfigError(str(error)) from None
    return tuple(name for name in plan.nodes if not wishes.nodes or name in wishes.nodes)


def endpoints_of(
    file: BoardFile, names: Sequence[str], wishes: NodeWishes
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return where this process listens and where it connects.

    Raises:
        ConfigError: nobody has said where the nodes meet.
    """
    if wishes.listen or wishes.connect:
        return wishes.listen, wishes.connect
    for node in file.nodes:
        if node.listen:
            return ((node.listen,), ()) if node.name in names else ((), (node.listen,))
    raise ConfigError(
        f'{file.path}: where do the nodes meet? write listen = "tcp/127.0.0.1:7447" at one of them,'
        " or start one with --listen and the others with --connect"
    )


def conductors_of(
    file: BoardFile, source: Source, names: Sequence[str], wishes: NodeWishes
) -> list[Conductor]:
    """Return the nodes of this process, each where it is to begin.

    Raises:
        ConfigError: the board or the scenario has mistakes.
        VbusError: the snapshot cannot be read, or is another node's.
    """
    scenario = scenario_of(file, wishes.scenario) if wishes.scenario else None
    if (wishes.snapshot or wishes.rejoin) and len(names) != 1:
        raise ConfigError(
            "a snapshot holds one node; start each with its own --node and --snapshot"
        )
    made = [conductor_of(file, source, name, scenario, bool(wishes.trace)) for name in names]
    if wishes.rejoin:
        try:
            data = Path(wishes.rejoin).read_bytes()
        except OSError as error:
            raise VbusError(f"{wishes.rejoin}: cannot be read: {error.strerror}") from error
        made[0].load(data)
    return made


def write_trace(conductors: Sequence[Conductor], path: str) -> None:
    """Write the traces of some nodes, merged: instant, rank of the node, what happened.

    Raises:
        VbusError: the file cannot be written.
    """
    try:
        with Path(path).open("w", encoding="ascii", newline="\n") as file:
            for when, rank, text in merged(_lines(conductors)):
                file.write(f"{when} {rank} {text}\n")
    except OSError as error:
        raise VbusError(f"{path}: cannot be written: {error.strerror}") from error


def _lines(conductors: Sequence[Conductor]) -> list[list[tuple[int, str]]]:
    lines: list[list[tuple[int, str]]] = []
    for conductor in conductors:
        node = conductor.node
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
    wishes: NodeWishes,
    on_ready: Callable[[list[Server]], None] | None = None,
    report: Callable[[str], None] = print,
) -> list[Conductor]:
    """Run nodes until their scenario is over, or until SIGINT or SIGTERM.

    Returns:
        The nodes, as they are at the end.

    Raises:
        ConfigError: the board or the scenario has mistakes.
        TransportError: a link cannot be opened.
        NodeError: another node has died, stalls, or runs another board; names it.
    """
    plan = plan_of(file)
    names = names_of(plan, wishes)
    conductors = conductors_of(file, source, names, wishes)

    async def main() -> None:
        loop = asyncio.get_running_loop()
        stop = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        await _serve(file, plan, conductors, wishes, stop, on_ready, report)

    with asyncio.Runner(loop_factory=HostLoop) as runner:
        runner.run(main())
    return conductors


async def _serve(
    file: BoardFile,
    plan: Plan,
    conductors: list[Conductor],
    wishes: NodeWishes,
    stop: asyncio.Event,
    on_ready: Callable[[list[Server]], None] | None,
    report: Callable[[str], None],
) -> None:
    loop = asyncio.get_running_loop()
    names = [conductor.node.name for conductor in conductors]
    link = None
    if len(names) < len(plan.nodes):
        link = NodeLink(plan.board, plan.nodes, [conductor.node.rank for conductor in conductors])
    timebase = Timebase(plan, conductors, link, report, wishes.patience, wishes.snapshot)
    servers: list[Server] = []
    for conductor in conductors:
        part = part_of(file, conductor.node.name)
        conductor.awaited = {f"host{n}" for n, host in enumerate(part.hosts) if host.awaited}
        servers.append(NodeServer(conductor, links_of(part), timebase, report))
    stopped = asyncio.ensure_future(stop.wait())
    try:
        for server in servers:
            server.start(loop)
        if link is not None:
            listen, connect = endpoints_of(file, names, wishes)
            opening = asyncio.ensure_future(link.open(listen, connect, wishes.security, report))
            await asyncio.wait((opening, stopped), return_when=asyncio.FIRST_COMPLETED)
            if not opening.done():
                opening.cancel()
                return
            opening.result()
        timebase.start(loop)
        if on_ready is not None:
            on_ready(servers)
        over = asyncio.ensure_future(timebase.finished.wait())
        await asyncio.wait((over, stopped), return_when=asyncio.FIRST_COMPLETED)
        over.cancel()
        if timebase.failure is not None:
            raise timebase.failure
    finally:
        stopped.cancel()
        timebase.stop()
        for server in servers:
            server.stop()
        if link is not None:
            with contextlib.suppress(TransportError):
                link.close()
        if wishes.trace:
            write_trace(conductors, wishes.trace)
