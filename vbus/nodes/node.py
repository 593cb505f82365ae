"""A node: a part of a board with a kernel of its own, and the trace of what happened on it."""

import hashlib
from collections.abc import Iterable, Iterator
from functools import partial
from heapq import heappop, heappush, merge
from operator import itemgetter
from typing import Any, ClassVar

from vbus.board.board import Beyond, Board
from vbus.circuit.orders import Order, Orders
from vbus.core.errors import SnapshotError
from vbus.core.kernel import Timer
from vbus.core.signals import TraceHash
from vbus.core.signals.wire import Drive, WireEnd
from vbus.core.state import Names, Saved, save, validate
from vbus.core.state.kinds import Load
from vbus.nodes.messages import Edge
from vbus.nodes.plan import Plan, Wire
from vbus.nodes.sync import Participant

Line = tuple[int, str]
"""Instant (ps), and what happened at it."""


class NodeTrace(TraceHash):
    """Keeps what a :class:`TraceHash` would hash: bus cycles, edges and violations of one node."""

    STATE: ClassVar[Names] = (
        "_lines: list[(i64, str), ...]", "_pending: list[(i64, i64, str), ...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_hash", "_order")

    def __init__(self, order: list[str]) -> None:
        super().__init__(order)
        self._lines: list[Line] = []

    def record(self, when: int, text: str) -> None:
        """Keep it."""
        self._lines.append((when, text))

    def lines(self) -> list[Line]:
        """Return everything so far, in order."""
        return [*self._lines, *self.waiting()]


def merged(traces: Iterable[Iterable[Line]]) -> Iterator[str]:
    """Merge the traces of nodes, given by rank, in order of (instant, node, sequence)."""
    ranked = ([(when, rank, text) for when, text in lines] for rank, lines in enumerate(traces))
    # Of equal instants, merge() takes the one of the earlier list.
    for when, rank, text in merge(*ranked, key=itemgetter(0)):
        yield f"{when} {rank} {text}\n"


def hash_of(lines: Iterable[str]) -> str:
    """Return the SHA-256 (hex) over the lines of a merged trace."""
    total = hashlib.sha256()
    for line in lines:
        total.update(line.encode())
    return total.hexdigest()


class Node(Beyond):
    """One node: chips, plants and nets under a kernel of their own, and ends of wires.

    An edge that a node sends at t arrives at t plus the wire's delay, after what the chips there do
    of themselves at that instant and before what their hosts do. Edges that arrive at one instant
    are taken in order of (node, number), and move together.

    Args:
        plan: the machine.
        rank: which of its nodes this is.
    """

    STATE: ClassVar[Names] = (
        "number", "_arrivals: heap[(i64, i64, i64, i64, i64, bool)]",
        "drives: list[(i64, i64, i64, bool), ...]", "wire_ends: parts", "orders: parts",
        "trace: part | None", "agreed: part | None",
        "_held: heap[(i64, i64, i64, i64, i64, bool)]", "_holds",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_timer", "board", "ends", "name", "names", "plan", "rank", "wires")
    DERIVED: ClassVar[Names] = ("_drives", "late", "worst_late")

    def __init__(self, plan: Plan, rank: int) -> None:
        self.plan: Plan = plan
        self.names: tuple[str, ...] = plan.nodes
        self.rank: int = rank
        self.name: str = plan.nodes[rank]
        self.wires: tuple[Wire, ...] = plan.wires
        self.ends: dict[int, WireEnd] = {}
        self.number: int = 0
        """Edges sent since the start."""
        self.late: int = 0
        """Edges that came after their instant had passed (real time only)."""
        self.worst_late: int = 0
        self.orders: list[Orders] = []
        """Cycles to be run at given instants, after what arrives at those instants."""
        self.trace: NodeTrace | None = None
        self.agreed: Participant | None = None
        """The node's part in keeping one virtual time with the others."""
        self._drives: list[Drive] = []
        self._arrivals: list[tuple[int, int, int, int, int, bool]] = []
        self._held: list[tuple[int, int, int, int, int, bool]] = []
        """What faults let come later: instant, running number, wire, node, level, weak."""
        self._holds: int = 0

    # -- building -----------------------------------------------------------------------------

    def solder(self, board: Board) -> None:
        """Solder this node's pins to the ends of their wires, before power comes up."""
        for rank, wire in enumerate(self.wires):
            if self.rank not in wire.ends:
                continue
            end = WireEnd(
                board.kernel, wire.name, rank, self._drives, rest=wire.rest, width=wire.width
            )
            for node in wire.ends:
                if node != self.rank:
                    end.add_far(node, f"{self.names[node]}:{wire.name}")
            board.adopt(end)
            self.ends[rank] = end
            for pin in wire.ends[self.rank]:
                board.find_pin(pin).move(end)

    def begin(self, board: Board) -> None:
        """Take the node's board, powered on."""
        self.board: Board = board
        for chip in board.chips:
            chip.on_node = True
            chip.rearm()
        board.beyond = self
        # Made after the timers of all chips: what arrives comes after what they do of themselves.
        self._timer: Timer = board.kernel.timer(self._arrived)

    def start_trace(self) -> None:
        """Begin to note what happens: before time starts."""
        if self.trace is None:
            self.trace = NodeTrace([chip.name for chip in self.board.chips])
            self.board.observe(self.trace)
            for net in self.board.nets.values():
                net.observe(self.trace)

    # -- edges --------------------------------------------------------------------------------

    def accept(self, edges: Iterable[Edge]) -> None:
        """Take edges of other nodes; they arrive after the delay, or now if that is past."""
        now = self.board.kernel.now
        mine = [
            edge for edge in edges if edge[3] in self.ends and edge[1] in self.ends[edge[3]].far
        ]
        if mine:
            self._note("arrive", [[list(edge) for edge in mine]])
        for sent, node, number, wire, level, weak in mine:
            when = sent + self.wires[wire].delay
            if when < now:
                self.late += 1
                self.worst_late = max(self.worst_late, now - when)
                when = now
            heappush(self._arrivals, (when, node, number, wire, level, weak))
        self._wait()

    # -- orders -------------------------------------------------------------------------------

    def orders_of(self, label: str, saved: bool = True) -> Orders:
        """Return the orders of one source for given instants.

        Args:
            label: name of the source, in traces.
            saved: whether it is part of the state.
        """
        known = next((orders for orders in self.orders if orders.label == label), None)
        if known is None:
            self._note("orders", [label, saved])
            known = Orders(self.board, label, saved)
            known.made = partial(self._note, "made")
            self.orders.append(known)
        return known

    def order(self, label: str, order: Order) -> None:
        """Add an order to those of a source (:meth:`orders_of`), for its instant."""
        o = order
        self._note("order", [label, o.when, [*o.chips], o.kind, o.address, o.data, o.pin])
        self.orders_of(label).give(order)

    def _note(self, what: str, values: list[object]) -> None:
        for observer in self.board.listeners:
            observer.outside(what, values)

    def replay(self, what: str, values: tuple[Any, ...]) -> None:
        """Take from a journal what came from beyond the node.

        Raises:
            ValueError: it names what is not here.
        """
        if what == "arrive":
            self.accept(values[0])
        elif what == "orders":
            self.orders_of(*values)
        else:
            label, when, chips, kind, address, data, pin = values
            for name in chips:
                self.board.chip(name)
            self.order(label, Order(when, tuple(chips), kind, address, data, pin))

    def _arrived(self) -> None:
        now = self.board.kernel.now
        arrivals = self._arrivals
        while arrivals and arrivals[0][0] <= now:
            _, node, _, wire, level, weak = heappop(arrivals)
            end = self.ends[wire]
            for later, shown, pulls in end.come(node, level, weak):
                if later:
                    heappush(self._held, (now + later, self._holds, wire, node, shown, pulls))
                    self._holds += 1
                else:
                    end.arrive(node, shown, pulls)
        while self._held and self._held[0][0] <= now:
            _, _, wire, node, level, weak = heappop(self._held)
            self.ends[wire].arrive(node, level, weak)
        self._wait()

    def _wait(self) -> None:
        due = [queue[0][0] for queue in (self._arrivals, self._held) if queue]
        if due:
            self._timer.at(min(due))

    def take_edges(self) -> list[Edge]:
        """Return and forget the edges sent since the last call."""
        edges = []
        for when, wire, level, weak in self._drives:
            edges.append((when, self.rank, self.number, wire, level, weak))
            self.number += 1
        self._drives.clear()
        return edges

    # -- time and state -----------------------------------------------------------------------

    def run_before(self, when: int) -> None:
        """Let happen everything at instants before ``when`` (ps)."""
        if when - 1 > self.board.kernel.now:
            self.board.pass_until(when - 1)

    @property
    def drives(self) -> list[Drive]:
        """What the ends of this node have sent since the last report."""
        return self._drives

    @drives.setter
    def drives(self, drives: list[Drive]) -> None:
        self._drives[:] = drives

    @property
    def wire_ends(self) -> list[WireEnd]:
        """The ends of the wires that lead to others."""
        return list(self.ends.values())

    def save(self) -> Saved:
        """Return the state of what leads beyond the board, with the trace so far."""
        saved: Saved = save(self)
        return saved

    def prepare(self, saved: Any) -> Load:
        """Check what :meth:`save` gave, on a node built from the same file; return what loads it.

        Raises:
            SnapshotError: another node made it, or a node with another scenario.
        """
        if self.agreed is not None and not self.agreed.log:
            self._check_scenario(saved)
        loading = validate(self, saved, f"node {self.name}")
        if self.agreed is not None:
            self.agreed.check(saved["agreed"])
        return loading

    def _check_scenario(self, saved: Any) -> None:
        """Check that a node which has done nothing yet was given what :meth:`save` has.

        Raises:
            SnapshotError: it has another scenario, or only one of the two has one, or a trace.
        """
        fields = saved if isinstance(saved, dict) else {}
        was = "the snapshot is of a run"
        orders = fields.get("orders")
        if isinstance(orders, tuple) and len(orders) != len(self.orders):
            one = "out a scenario: leave --scenario out" if self.orders else " a scenario: give it"
            raise SnapshotError(f"{was} with{one}")
        if isinstance(orders, tuple) and not all(map(_goes_on, self.orders, orders)):
            raise SnapshotError(
                f"{was} with another scenario: what was still to come is not what this one has"
            )
        if (fields.get("trace") is None) != (self.trace is None):
            one = "out a trace: leave --trace out" if self.trace else " a trace: give --trace FILE"
            raise SnapshotError(f"{was} with{one}")


def _goes_on(given: Orders, saved: Any) -> bool:
    """Tell whether what has been given goes on as saved orders do."""
    waiting = given.waiting
    try:
        return saved["_given"] == len(waiting) and {*waiting}.issuperset(saved["waiting"])
    except (TypeError, LookupError):
        return False
