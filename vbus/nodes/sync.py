"""One virtual time for all nodes: rounds of reports, and how far each lets time run."""

from collections.abc import Sequence
from typing import ClassVar, Final

from vbus.core.errors import NodeMismatchError, SnapshotError
from vbus.core.kernel import END, NEVER
from vbus.core.state import Names, Saved
from vbus.nodes.messages import MOST_WIRES, Edge, NodeReport, decode, encode

LONGEST_LOG: Final = 1 << 16
"""Reports of its own that a node stores for nodes that rejoin: a bound of memory."""


class Participant:
    """One node's part in keeping one time; every node computes the same.

    Time runs in rounds. At the end of a round each node reports what it has sent on wires, and
    before which instant it will send nothing more of its own. Once a node has every report of a
    round it knows all that can reach it before the earliest such instant plus the shortest delay:
    that is the *grant*, up to which it may run without hearing from anybody. The order in which
    reports come, and how late they are, does not matter.

    Nothing here reads a clock, waits, or sends: bytes are carried by others.

    Args:
        names: all nodes.
        me: rank of this one.
        lookahead: the shortest delay of a wire between nodes (ps).
        digest: of the board file.

    Attributes:
        round: the round under way: its reports are awaited.
        granted: everything before this instant may happen (ps).
        rested: whether the last grant gave no time: no node wanted any.
        reported: whether this node has ended the round.
    """

    STATE: ClassVar[Names] = ("round", "granted", "rested: bool", "latest: list[bytes[...], ...]")
    WIRING: ClassVar[Names] = ("digest", "lookahead", "me", "names")
    DERIVED: ClassVar[Names] = ("_heard", "log", "reported")

    def __init__(self, names: Sequence[str], me: int, lookahead: int, digest: str) -> None:
        self.names: tuple[str, ...] = tuple(names)
        self.me: int = me
        self.lookahead: int = lookahead
        self.digest: str = digest
        self.round: int = 0
        self.granted: int = 0
        self.rested: bool = False
        self.log: dict[int, NodeReport] = {}
        """This node's own reports, for those who lack them."""
        self._heard: dict[int, dict[int, NodeReport]] = {}
        """Reports of this round and later ones, by round and node."""
        self.reported: bool = False

    # -- reports ------------------------------------------------------------------------------

    def report(self, following: int, until: int, edges: list[Edge]) -> NodeReport:
        """End this node's round: everything before the grant is done.

        Args:
            following: before this instant the node sends no edge of its own (ps).
            until: how far its hosts want time to run (ps); -1: nothing.
            edges: sent in this round.
        """
        if self.reported:
            raise ValueError(f"round {self.round} is reported already")
        report = NodeReport(
            self.digest,
            self.me,
            self.round,
            self.granted,
            max(following, self.granted),
            until,
            tuple(edges),
        )
        self.reported = True
        self.log[self.round] = report
        self.log.pop(self.round - LONGEST_LOG, None)
        self._heard.setdefault(self.round, {})[self.me] = report
        return report

    def receive(self, report: NodeReport) -> None:
        """Take another node's report; one that is known already changes nothing.

        Raises:
            NodeMismatchError: it runs another board, or has sent another report of that round.
        """
        name = self.names[report.node]
        if report.digest != self.digest:
            raise NodeMismatchError(
                name,
                f"node {name} runs another board file or version of vbus ({report.digest}; here"
                f" {self.digest}): give every node the same file",
            )
        if report.round < self.round:
            return
        known = self._heard.setdefault(report.round, {}).setdefault(report.node, report)
        if known != report:
            raise NodeMismatchError(
                name,
                f"node {name} has sent two different reports of round {report.round}: two"
                " processes run it, or it was started anew without its hosts doing the same",
            )

    def heard_of_round(self) -> bool:
        """Tell whether another node has ended the present round."""
        return any(node != self.me for node in self._heard.get(self.round, ()))

    def missing(self) -> list[int]:
        """Return the ranks of the other nodes whose reports of this round have not come."""
        heard = self._heard.get(self.round, {})
        return [node for node in range(len(self.names)) if node != self.me and node not in heard]

    # -- grants -------------------------------------------------------------------------------

    def ready(self) -> bool:
        """Tell whether every report of the round is here."""
        return self.reported and not self.missing()

    def grant(self) -> list[Edge]:
        """Begin the next round: move :attr:`granted`; return what the others have sent.

        Raises:
            NodeMismatchError: a report does not fit the round.
        """
        reports = self._heard.pop(self.round)
        first = NEVER
        until = -1
        edges: list[Edge] = []
        for node in range(len(self.names)):
            report = reports[node]
            if report.horizon != self.granted:
                name = self.names[node]
                raise NodeMismatchError(
                    name,
                    f"node {name} reports {report.horizon} ps at the end of round {self.round}, and"
                    f" {self.granted} ps were granted",
                )
            first = min(first, report.following)
            until = max(until, report.until)
            if node != self.me:
                edges += report.edges
        # An edge under way may make its receiver send one in turn, not before it has arrived.
        for own in reports.values():
            for edge in own.edges:
                first = min(first, max(edge[0] + self.lookahead, self.granted))
        following = min(first + self.lookahead, until + 1, END + 1)
        self.rested = following <= self.granted
        self.granted = max(following, self.granted)
        self.round += 1
        self.reported = False
        return edges

    # -- state --------------------------------------------------------------------------------

    def before_save(self) -> None:
        """Refuse to be saved but at the end of a round, after :meth:`report`."""
        if not self.reported:
            raise ValueError("a snapshot is taken when the round has been reported")

    @property
    def latest(self) -> list[bytes]:
        """The latest two reports, which others may not have got yet."""
        return [encode(self.log[n]) for n in (self.round - 1, self.round) if n in self.log]

    @latest.setter
    def latest(self, latest: list[bytes]) -> None:
        self.log = {report.round: report for report in map(self._own, latest)}
        self._heard = {self.round: {self.me: self.log[self.round]}}
        self.reported = True

    def _own(self, data: bytes) -> NodeReport:
        """Return a saved report.

        Raises:
            SnapshotError: another node made it, or it was made on another board.
        """
        report = decode(data, self.names[self.me], len(self.names), MOST_WIRES)
        if not isinstance(report, NodeReport) or report.node != self.me:
            raise SnapshotError("the state was made by another node")
        if report.digest != self.digest:
            raise SnapshotError("the state was made with another board file or version")
        return report

    def check(self, saved: Saved) -> None:
        """Check the reports of a saved state.

        Raises:
            SnapshotError: another node made them, or they were made on another board.
        """
        reports = [self._own(data) for data in saved["latest"]]
        if saved["round"] not in [report.round for report in reports]:
            raise SnapshotError(f"the state has no report of its round {saved['round']}")
