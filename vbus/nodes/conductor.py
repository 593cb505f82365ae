"""A node that keeps one virtual time with the others: runs what is granted, reports what it did."""

from collections.abc import Callable
from typing import Final

from vbus.board.snapshot import Snapshot, restore, take
from vbus.core.kernel import MS, NEVER
from vbus.nodes.messages import NodeReport
from vbus.nodes.node import Node
from vbus.nodes.sync import Participant

SLICE: Final = 20 * MS
"""Chip time that is computed in one go; not measured."""

RUNS: Final = "runs"
WAITS: Final = "waits"
RESTS: Final = "rests"
HOST: Final = "waits for its host"


class Conductor:
    """Moves one node's time as far as all nodes agree on.

    The carrier of the messages calls :meth:`poll` after everything that happens, and sends the
    reports it returns to all other nodes.

    Args:
        node: the node, at instant 0.
        until: how far time is to run whatever hosts want (ps); -1: as far as hosts want.

    Attributes:
        participant: this node's part in the agreement.
        until: see above.
        state: what the node does.
        at_round: what is done at the end of a round, once the node has reported it: the first
            round that will do, and the deed.
    """

    def __init__(self, node: Node, until: int) -> None:
        self.node: Node = node
        self.participant: Participant = Participant(
            node.names, node.rank, node.plan.lookahead, node.plan.digest
        )
        node.agreed = self.participant
        self.until: int = until
        self.state: str = RUNS
        self.awaited: set[str] = set()
        """Labels of hosts that have not used time yet, and without which it does not begin."""
        self.outside: list[tuple[int, Callable[[], None]]] = []
        """What comes from outside and is no call of a host, such as a fault: done, in whatever
        round, as soon as no other node has been promised that nothing happens yet."""
        self.at_round: list[tuple[int, Callable[[], None]]] = []
        self._wanted: int = -2
        node.board.limit = -1  # until time is granted

    # -- what its hosts want ------------------------------------------------------------------

    def wants(self) -> int:
        """Return how far this node wants time to run (ps); -1 if its hosts want nothing.

        For a host it is a quantum more, so that what it does next is within the same grant.
        """
        beyond = self.participant.lookahead - 1
        return max([self.until, *(min(until + beyond, NEVER) for until in self._awaited())])

    def _awaited(self) -> list[int]:
        """Return the instants that held hosts wait for (ps)."""
        ports = self.node.board.ports
        return [port.hold_until for port in ports if port.held and port.hold_until < NEVER]

    def busy(self) -> bool:
        """Tell whether a host that has begun to use time may still act within the grant."""
        limit = self.participant.granted - 1
        acting = [port for port in self.node.board.ports if port.clock.used]
        self.awaited -= {port.label for port in acting}
        return bool(self.awaited) or any(
            not (port.held and port.hold_until > limit) for port in acting
        )

    @property
    def finished(self) -> bool:
        """Whether time has come to where it was to run, and no node wants more."""
        participant = self.participant
        return 0 <= self.until < participant.granted and participant.rested

    # -- running ------------------------------------------------------------------------------

    def poll(self) -> NodeReport | None:
        """Do what can be done now: at most one slice of time, or the end of a round.

        Returns:
            The report that ends this node's round, if it has come to that; then there may be more
            to do at once. None: nothing, until a message comes or a host does something; unless
            :attr:`state` is ``"runs"``.
        """
        participant = self.participant
        if participant.reported:
            if not participant.ready():
                self.state = WAITS
                return None
            self.node.accept(participant.grant())
            self.node.board.limit = participant.granted - 1
            self.state = RUNS
            return None
        self._let_in()
        if self.busy():
            self.state = HOST
            return None
        if participant.rested and self._wanted == self.wants():
            if not participant.heard_of_round() and not self.at_round:
                self.state = RESTS
                return None
        self.state = RUNS
        now = self.node.board.kernel.now
        if participant.granted > now + SLICE:
            self.node.run_before(now + SLICE)
            return None
        self.node.run_before(participant.granted)
        self._let_in()
        return self._report()

    def _let_in(self) -> None:
        """Do what comes from outside, unless an edge of it could come too late elsewhere."""
        participant = self.participant
        now = int(self.node.board.kernel.now)
        if now + participant.lookahead >= participant.granted:
            while self.outside:
                self.outside.pop(0)[1]()

    def _report(self) -> NodeReport:
        # Before that instant the node sends no edge of its own.
        following = min([self.node.board.kernel.next_due, *self._awaited()])
        self._wanted = self.wants()
        return self.participant.report(following, self._wanted, self.node.take_edges())

    def ended(self) -> None:
        """The report of this round has been shared: do what was asked for its end."""
        for asked in [one for one in self.at_round if one[0] <= self.participant.round]:
            self.at_round.remove(asked)
            asked[1]()

    # -- state --------------------------------------------------------------------------------

    def save(self) -> Snapshot:
        """Return a snapshot, to be taken after a report: what this node needs to rejoin."""
        return take(self.node.board)

    def load(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot.

        Raises:
            SnapshotError: it was made by another node or board.
        """
        restore(self.node.board, snapshot)
        self.node.board.limit = self.participant.granted - 1
        self._wanted = self.wants()
