"""All nodes of a board in one process: the same nodes, the same rounds, no network."""

from collections.abc import Callable, Sequence

from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.nodes.conductor import RUNS, Conductor
from vbus.nodes.machine_snapshot import MachineSnapshot, restore
from vbus.nodes.messages import NodeReport
from vbus.nodes.node import Node
from vbus.nodes.plan import Plan, build_node, plan_of
from vbus.nodes.scenario import Scenario
from vbus.nodes.trace import merged_hash


def node_of(
    file: BoardFile,
    source: Source,
    name: str,
    scenario: Scenario | None = None,
    trace: bool = False,
    built: Callable[[Node], None] | None = None,
) -> Node:
    """Return one node of a board, with what its hosts do.

    Args:
        file: the board file.
        source: takes its mistakes.
        name: of the node.
        scenario: what hosts do; the node takes what concerns its own chips.
        trace: whether it notes what happens; with a scenario it always does.
        built: is given the node before anything happens to it: who records it begins here.
    """
    made = build_node(file, source, name)
    if file.board.time != "realtime":
        made.board.granted = True
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
    plan = plan_of(file)
    made = node_of(file, source, node, scenario, trace, built)
    until = scenario.until if scenario is not None else -1
    return Conductor(made, plan.lookahead, plan.digest, until).begin()


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
        restore(self.conductors, snapshot)
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


def trace_hash(nodes: Sequence[Node]) -> str:
    """Return the SHA-256 (hex) over the traces of all nodes, given by rank."""
    lines = []
    for node in nodes:
        if node.trace is None:
            raise ValueError("no trace is running: call start_trace() before time starts")
        node.board.catch_up()
        lines.append(node.trace.lines())
    return merged_hash(lines)
