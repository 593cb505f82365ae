"""Nodes that keep one virtual time: what is granted is run, what was lost is asked for."""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from vbus.board.snapshot import write
from vbus.boardfile.sections import BoardFile
from vbus.core.errors import NodeError, NodeMismatchError, VbusError
from vbus.nodes.conductor import HOST, RUNS, Conductor
from vbus.nodes.machine_snapshot import saved
from vbus.nodes.messages import Message, Need, NodeReport, Reports
from vbus.nodes.node import Node
from vbus.serve.nodes.ordering import Answer, NodeRequest
from vbus.serve.nodes.peers import LET_IN, Group, Peers
from vbus.serve.output_file import OutputFile
from vbus.serve.time.pacer import WallClockPacer

LACKING: Final = 0.25
"""Seconds after which a report that does not come is asked for; not measured."""
BUDGET: Final = 0.01
"""Seconds of computing after which the loop serves others; not measured."""
SNAPSHOT_EVERY: Final = 0.25
"""Seconds between two snapshots; not measured."""
WAITS_FOR_OTHERS: Final = "waits for the others"

log = logging.getLogger("vbus")


class Timebase(Peers):
    """Runs the nodes of this process in one virtual time with those of other processes.

    Args:
        group: the board, and how its nodes are reached.
        conductors: the nodes of this process.
        snapshot: file that takes a snapshot now and then, if this process has one node.
        clock: wall time in seconds; for tests.

    Attributes:
        rounds: rounds of all nodes of this process.
    """

    def __init__(
        self,
        group: Group,
        conductors: Sequence[Conductor],
        snapshot: OutputFile | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(group, [conductor.node.rank for conductor in conductors], clock)
        self.conductors: list[Conductor] = list(conductors)
        self._seconds: Callable[[], float] = clock
        self._pacers: list[WallClockPacer] = []
        self.rounds: int = 0
        self._began: float = -1.0
        self._ended: float = 0.0
        self._computed: float = 0.0
        self._sent: float = 0.0
        self._snapshot: OutputFile | None = snapshot
        self._last_snapshot: float = 0.0
        self._scheduled: bool = False
        self._mine: dict[int, Conductor] = dict(zip(self.ranks, conductors, strict=True))
        self._to_send: list[NodeReport] = []
        """Reports of this turn; they travel as one message."""

    # -- life -----------------------------------------------------------------------------------

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin; the link is open."""
        super().start(loop)
        self.agreed.set()
        for rank, conductor in self._mine.items():
            # After a snapshot: these messages were made before the link was open.
            for number in sorted(conductor.participant.log):
                self._share(rank, conductor.participant.log[number])
            for other in self.others:
                self._ask(rank, other)
        self._send_reports()
        self.proceed()

    def proceed(self) -> None:
        """Something has happened: see soon what can be done."""
        if not self._scheduled and self.loop is not None:
            self._scheduled = True
            self.loop.call_soon(self._run)

    def _run(self) -> None:
        self._scheduled = False
        if self.loop is None or self.failure is not None:
            return
        started = self._seconds()
        try:
            while self._round():
                if self._seconds() - started > BUDGET:
                    self.proceed()
                    return
        except NodeError as error:
            self.fail(error)
        if all(conductor.finished for conductor in self.conductors):
            self.done()

    def _round(self) -> bool:
        """Let every node do what it can; return whether there may be more to do."""
        moved = False
        for conductor in self.conductors:
            before = conductor.participant.round
            started = self._seconds()
            report = conductor.poll()
            self._computed += self._seconds() - started
            if conductor.participant.round != before:
                self.rounds += 1
                self._ended = self._seconds()
                if self._began < 0:
                    self._began = self._ended
                for pacer in self._pacers:
                    pacer.grant_came()
            if report is not None:
                self._share(conductor.node.rank, report)
                self._keep_snapshot(conductor)
                conductor.ended()
            moved = moved or report is not None or conductor.state == RUNS
        self._send_reports()
        return moved

    # -- messages -------------------------------------------------------------------------------

    def _share(self, rank: int, report: NodeReport) -> None:
        for other, conductor in self._mine.items():
            if other != rank:
                conductor.participant.receive(report)
        self._to_send.append(report)

    def _send_reports(self) -> None:
        if not self._to_send:
            return
        started = self._seconds()
        first, *others = self._to_send
        message: Message = first
        # One message for all nodes of this process: a message costs more than its bytes.
        if others:
            message = Reports(first.digest, first.node, first.round, (first, *others))
        self.send(first.node, message)
        self._to_send.clear()
        self._sent += self._seconds() - started

    def _ask(self, rank: int, other: int) -> None:
        participant = self._mine[rank].participant
        self.send(rank, Need(self.plan.digest, rank, participant.round, other))

    def joined(self, rank: int) -> None:
        """Ask a node that has come for what was missed."""
        for mine in self._mine:
            self._ask(mine, rank)

    def deliver(self, rank: int, message: Message) -> None:
        """Take reports, or that reports are lacking."""
        if isinstance(message, NodeReport):
            self._take(message)
        elif isinstance(message, Reports):
            for report in message.reports:
                self.heard_of(report.node)
                self._take(report)
        elif isinstance(message, Need) and message.other in self._mine:
            self._resend(message.other, self.others[rank].name, message.round)

    def _take(self, report: NodeReport) -> None:
        other = self.others[report.node]
        for conductor in self.conductors:
            conductor.participant.receive(report)
        other.round = max(other.round, report.round)

    def _resend(self, mine: int, name: str, first: int) -> None:
        """Node ``name`` lacks reports from round ``first`` on."""
        log = self._mine[mine].participant.log
        latest = max(log, default=-1)
        if log and first < min(log):
            raise NodeMismatchError(
                name,
                f"node {name} rejoins at round {first}, and reports are held from round {min(log)}"
                " on: its snapshot is too old, or from another run",
            )
        for number in range(first, latest + 1):
            self.send(mine, log[number])

    def check(self, now: float) -> None:
        """Ask for reports that do not come."""
        for rank, other in self.others.items():
            for mine, conductor in self._mine.items():
                if (
                    rank in conductor.participant.missing()
                    and other.round >= conductor.participant.round
                    and now - other.asked > LACKING
                ):
                    other.asked = now
                    self._ask(mine, rank)

    # -- telling --------------------------------------------------------------------------------

    def _keep_snapshot(self, conductor: Conductor) -> None:
        now = self._seconds()
        if self._snapshot is not None and now - self._last_snapshot >= SNAPSHOT_EVERY:
            self._last_snapshot = now
            self.write_snapshot(conductor)

    def write_snapshot(self, conductor: Conductor) -> None:
        """Write a snapshot of a node that has just reported; the file is replaced in one step."""
        assert self._snapshot is not None
        try:
            self._snapshot.write(write(conductor.save()), sync=False)
        except VbusError as error:
            self.lost.append(str(error))
            self.group.report(f"{error}; no more snapshots are written")
            self._snapshot = None

    def state_of(self, rank: int) -> tuple[int, str]:
        """Return the latest round a node has reported, and what it does."""
        conductor = self._mine[rank]
        return max(conductor.participant.log, default=-1), conductor.state

    def standing_at(self) -> str:
        """Return where time stands."""
        now = max(c.participant.granted for c in self.conductors) - 1
        return (
            f"time stands still at {max(now, 0) / 1e9:.6f} ms, round"
            f" {self.conductors[0].participant.round}"
        )

    def pacer(self, node: Node, part: BoardFile) -> WallClockPacer:
        """Return what wakes the sessions of a node when time is granted."""
        awaited = {f"host{n}" for n, host in enumerate(part.hosts) if host.awaited}
        self._mine[node.rank].awaited = awaited
        pacer = WallClockPacer(node.board)
        pacer.on_moved = self.proceed
        self._pacers.append(pacer)
        return pacer

    def let_in(self, rank: int, do: Callable[[str], None]) -> None:
        """Let something happen as soon as no other node relies on that it does not."""
        self._ask_for(rank, self._mine[rank].outside, 0, "nothing was changed", do)

    def _ask_for(
        self,
        rank: int,
        asked: list[tuple[int, Callable[[], None]]],
        number: int,
        what: str,
        do: Callable[[str], None],
    ) -> None:
        """Have something done by a node's conductor, or refused when it does not come to that.

        Args:
            rank: of the node.
            asked: what the conductor has been asked for.
            number: of the first round that will do.
            what: has not come about if it is refused.
            do: see :meth:`let_in`.
        """

        def now() -> None:
            timer.cancel()
            do("")

        def give_up() -> None:
            asked.remove(entry)
            why = HOST if self._mine[rank].state == HOST else WAITS_FOR_OTHERS
            do(
                f"node {self.plan.nodes[rank]} {why}, so {what}; say it again when time runs or all"
                " are here (vbus ls tells for whom it waits)"
            )

        entry = (number, now)
        timer = asyncio.get_running_loop().call_later(LET_IN, give_up)
        asked.append(entry)
        self.proceed()

    def carry_out(self, rank: int, request: NodeRequest, answer: Callable[[Answer], None]) -> None:
        """Tell the instant of a node, or its part of a snapshot when a round has ended."""
        conductor = self._mine[rank]
        node = conductor.node

        def save(refusal: str) -> None:
            answer(Answer(node.name, error=refusal) if refusal else _answer_of(conductor))

        if request.at >= 0 or request.lines:
            answer(
                Answer(
                    node.name,
                    error="orders are for boards in real time; in virtual time a scenario says what"
                    " happens when: vbus run --scenario",
                )
            )
        elif request.save >= 0:
            what = f"round {request.save} has not ended"
            self._ask_for(rank, conductor.at_round, request.save, what, save)
        else:
            answer(Answer(node.name, node.board.now))

    def figures(self) -> dict[str, Any]:
        """Return the rounds of this process, and how long one took (us of wall time).

        Of that, how long its nodes and motors took, and how long reports took to be sent; the rest
        is what comes from others, and waiting for it.
        """
        rounds = self.rounds // max(len(self.conductors), 1)
        spent = (self._ended - self._began) * 1e6
        us_per_round = spent / (rounds - 1) if rounds > 1 else 0.0
        each = 1e6 / max(rounds, 1)
        timing = {
            "rounds": rounds, "us_per_round": us_per_round,
            "us_computing": self._computed * each, "us_sending": self._sent * each,
        }  # fmt: skip
        return {"timing": timing}

    def details(self, rank: int) -> dict[str, Any]:
        """Return how far a node is, and whom it waits for."""
        participant = self._mine[rank].participant
        missing = participant.missing() if participant.reported else []
        return {
            "round": participant.round,
            "granted_ps": participant.granted,
            "waits_for": [self.plan.nodes[n] for n in missing],
        }


def _answer_of(conductor: Conductor) -> Answer:
    """Return the answer with a node's part of a snapshot, or why it has none."""
    name, now = conductor.node.name, conductor.node.board.now
    try:
        part = saved(conductor)
    except VbusError as error:
        return Answer(name, error=f"node {name} cannot be saved: {error}")
    except Exception:
        log.exception("internal error while saving node %s, which goes on", name)
        why = f"node {name} cannot be saved: internal error; its own messages say more"
        return Answer(name, error=why)
    return Answer(name, now, part=part)
