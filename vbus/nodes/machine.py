"""All nodes of a board in one process: the same nodes, the same rounds, no network."""

from collections.abc import Callable, Iterable, Sequence

from vbus.board.board import Board
from vbus.board.build import assemble, build
from vbus.board.config import read_board_file, read_board_text
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.core.errors import ConfigError, VbusError
from vbus.nodes.conductor import RUNS, Conductor
from vbus.nodes.machine_snapshot import MachineSnapshot, restore
from vbus.nodes.messages import NodeReport
from vbus.nodes.node import Line, Node, hash_of, merged
from vbus.nodes.plan import Plan, part_of, plan_of
from vbus.nodes.scenario import Scenario
from vbus.record.format import Header


def node_of(
    file: BoardFile,
    source: Source,
    name: str,
    scenario: Scenario | None = None,
    trace: bool = False,
    built: Callable[[Node], None] | None = None,
) -> Node:
    """Return one node of a board, powered on, at instant 0, with what its hosts do.

    Args:
        file: the board file.
        source: takes its mistakes.
        name: of the node.
        scenario: what hosts do; the node takes what concerns its own chips.
        trace: whether it notes what happens; with a scenario it always does.
        built: is given the node before anything happens to it: who records it begins here.

    Raises:
        ConfigError: a part refuses its settings, or there is no such node.
    """
    plan = plan_of(file)
    made = Node(plan, plan.rank(name))
    board = assemble(part_of(file, name), source, made.solder)
    board.text, board.file = source.text, file.path
    board.granted = file.board.time != "realtime"
    made.begin(board)
    if built is not None:
        built(made)
    if trace or scenario is not None:
        made.start_trace()
    if scenario is not None:
        made.orders_of("scenario")
        for order in scenario.of({chip.name for chip in made.board.chips}):
            made.order("scenario", order)
    return made


def conductor_of(
    file: BoardFile,
    source: Source,
    node: str,
    scenario: Scenario | None = None,
    trace: bool = False,
    built: Callable[[Node], None] | None = None,
) -> Conductor:
    """Return one node of a board, ready to keep one virtual time; see :func:`node_of`."""
    made = node_of(file, source, node, scenario, trace, built)
    return Conductor(made, scenario.until if scenario is not None else -1)


def build_nodes(file: BoardFile, source: Source) -> list[Node]:
    """Return every node of a board, in the order of the file."""
    return [node_of(file, source, node.name) for node in file.nodes]


def board_of(header: Header, name: str, board_file: str = "") -> Board:
    """Return what a journal was recorded on, made again, at instant 0: a board, or that of a node.

    Args:
        header: of the journal.
        name: of the journal, for messages.
        board_file: a board file in place of the journal's own.

    Raises:
        VbusError: the board was made in Python, or its file has mistakes or no such node.
    """
    if board_file:
        file, source = read_board_file(board_file)
    elif header.text:
        file, source = read_board_text(header.text, header.file)
    else:
        raise VbusError(f"{name}: it was recorded on a board made in Python")
    if not file.nodes:
        return build(file, source)
    node = header.board.removeprefix(f"{file.board.name}.")
    if node not in plan_of(file).nodes:
        raise ConfigError(f'{name}: it is of "{header.board}", which is no node of {file.path}')
    return node_of(file, source, node).board


class Machine:
    """Every node of a board, in this process.

    Args:
        file: the board file, with nodes.
        source: takes its mistakes.
        scenario: what hosts do.
        built: is given each node before anything happens to it.
    """

    def __init__(
        self,
        file: BoardFile,
        source: Source,
        scenario: Scenario | None = None,
        built: Callable[[Node], None] | None = None,
    ) -> None:
        self.plan: Plan = plan_of(file)
        self.conductors: list[Conductor] = [
            conductor_of(file, source, node, scenario, built=built) for node in self.plan.nodes
        ]

    @property
    def nodes(self) -> list[Node]:
        """The nodes, by rank."""
        return [conductor.node for conductor in self.conductors]

    def run(self) -> None:
        """Run until nothing more can happen without a host."""
        moved = True
        while moved:
            moved = False
            for conductor in self.conductors:
                moved = self.poll(conductor) or moved

    def poll(self, conductor: Conductor) -> bool:
        """Let one node do what it can, and tell the others; return whether it did anything."""
        report = conductor.poll()
        if report is None:
            return conductor.state == RUNS
        self._share(conductor, report)
        conductor.ended()
        return True

    def load(self, snapshot: MachineSnapshot) -> None:
        """Go on from a snapshot of the machine.

        Raises:
            SnapshotError: see :func:`~vbus.nodes.machine_snapshot.restore`.
        """
        restore(self.conductors, snapshot.nodes)
        for conductor in self.conductors:
            participant = conductor.participant
            self._share(conductor, participant.log[participant.round])

    def _share(self, conductor: Conductor, report: NodeReport) -> None:
        for other in self.conductors:
            if other is not conductor:
                other.participant.receive(report)

    def trace_hash(self) -> str:
        """Return the SHA-256 (hex) over what happened on all nodes."""
        return trace_hash(self.nodes)


def trace_lines(nodes: Iterable[Node]) -> list[list[Line]]:
    """Return what was noted on nodes, in order of rank; nothing of nodes that are not given."""
    lines: list[list[Line]] = []
    for node in nodes:
        node.board.catch_up()
        lines += [[] for _ in range(node.rank - len(lines))]
        lines.append(node.trace.lines() if node.trace is not None else [])
    return lines


def trace_hash(nodes: Sequence[Node]) -> str:
    """Return the SHA-256 (hex) over the traces of all nodes, given by rank."""
    if any(node.trace is None for node in nodes):
        raise ValueError("no trace is running: call start_trace() before time starts")
    return hash_of(merged(trace_lines(nodes)))
