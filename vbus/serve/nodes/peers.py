"""The other nodes of a board: who is there, who is silent, who was lost and must be named."""

import asyncio
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import msgspec

from vbus.boardfile.sections import BoardFile
from vbus.core.errors import ConfigError, NodeLostError, NodeMismatchError, VbusError
from vbus.core.kernel import MS, NEVER
from vbus.nodes.messages import Alive, Message, Reports, decode, encode
from vbus.nodes.node import Node
from vbus.nodes.plan import Plan
from vbus.serve.nodes.node_link import LARGEST_ANSWER, NodeLink, Receiver
from vbus.serve.nodes.ordering import (
    NO_ORDER,
    Answer,
    NodeRequest,
    is_of_another,
    read_answer,
    read_request,
)
from vbus.serve.time.pacer import WallClockPacer

TICK: Final = 0.1
"""Seconds between signs of life; the margin of a lease (MARGIN_MS) is two and a half of them."""
FAREWELL: Final = 5.0
"""Seconds that a node which is done waits for the others at most; not measured."""
GRACE: Final = 0.3
"""Seconds between a loss and the error: long enough to hear which node was the first to be lost."""
LET_IN: Final = 10.0
"""Seconds that an order from outside waits for other nodes; not measured."""
ASK_SECONDS: Final = LET_IN + 30.0
"""How long an answer of another process may take: a node says itself why it waits, and what it
sends may be long."""
DONE: Final = "done"
LEFT: Final = "has been stopped"
GAVE_UP: Final = "has given up "
"""State of a node that ends because of another, whose name follows."""


@dataclass(slots=True)
class Peer:
    """What is known of a node in another process.

    Attributes:
        name: its name.
        deadline: how long it may be silent (s).
        joined: whether it has been heard of.
        refused: whether it runs another board.
        cause: whether another node says that it ends because of this one.
        present: whether its process is on the network.
        heard: when it was heard of last (s).
        asked: when it was asked for a report last (s).
        state: what it says it does.
        round: the latest it has reported.
    """

    name: str
    deadline: float
    joined: bool = False
    refused: bool = False
    cause: bool = False
    present: bool = False
    heard: float = 0.0
    asked: float = 0.0
    state: str = "not here yet"
    round: int = -1


@dataclass(frozen=True, slots=True)
class Group:
    """What the nodes of one process share.

    Attributes:
        plan: the board.
        link: to the other processes; None if all nodes are here.
        report: takes sentences about nodes that come and go.
        patience: seconds to wait for a lost node to rejoin; then, or at once if 0, it is an error.
    """

    plan: Plan
    link: NodeLink | None = None
    report: Callable[[str], None] = print
    patience: float = 0.0


class Peers(Receiver):
    """The nodes of this process among those of the whole board.

    A node that dies, or is silent beyond its deadline, is a :class:`NodeLostError` for all others:
    never a wait without end. Nodes that have not come yet are waited for.

    Args:
        group: the board, and how its nodes are reached.
        mine: ranks of the nodes in this process.
        clock: wall time in seconds; for tests.

    Attributes:
        plan: the board.
        group: that, and how its nodes are reached.
        ranks: of the nodes in this process.
        others: the nodes of other processes, by rank.
        loop: the event loop, while time moves.
        failure: why the run ended, if it did so in error.
        finished: set when the run is over, for better or worse.
        agreed: set when this process knows when chip time begins.
        lost: why files have not all they should have.
    """

    def __init__(
        self, group: Group, mine: Sequence[int], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.plan: Plan = group.plan
        self.failure: VbusError | None = None
        self.finished: asyncio.Event = asyncio.Event()
        self.agreed: asyncio.Event = asyncio.Event()
        self.group: Group = group
        self.ranks: tuple[int, ...] = tuple(mine)
        self.lost: list[str] = []
        self._clock: Callable[[], float] = clock
        self.loop: asyncio.AbstractEventLoop | None = None
        self.others: dict[int, Peer] = {
            rank: Peer(name, self.plan.deadlines[rank] / (1000 * MS))
            for rank, name in enumerate(self.plan.nodes)
            if rank not in self.ranks
        }
        self._lost: dict[int, tuple[float, NodeLostError]] = {}
        self._last_tick: float = 0.0
        self._done_at: float = -1.0
        self._timer: asyncio.TimerHandle | None = None

    # -- what kinds of time differ in -----------------------------------------------------------

    def deliver(self, rank: int, message: Message) -> None:
        """Take a message of node ``rank``: all but signs of life."""
        raise NotImplementedError

    def joined(self, rank: int) -> None:
        """Node ``rank`` has come, or come back."""

    def check(self, now: float) -> None:
        """See to what is due now and then."""

    def proceed(self) -> None:
        """Something has happened: see soon what can be done."""

    def state_of(self, rank: int) -> tuple[int, str]:
        """Return the latest round, and what a node of this process does."""
        raise NotImplementedError

    def standing_at(self) -> str:
        """Return where time stands, for an error message."""
        raise NotImplementedError

    def pacer(self, node: Node, part: BoardFile) -> WallClockPacer:
        """Return what moves the board of a node of this process, once it is :attr:`agreed`.

        Args:
            node: the node.
            part: its part of the board file.
        """
        raise NotImplementedError

    def details(self, rank: int) -> dict[str, Any]:
        """Return what ``vbus ls`` shows of one node of this process besides its state."""
        raise NotImplementedError

    def let_in(self, rank: int, do: Callable[[str], None]) -> None:
        """Let what comes from outside happen at a node of this process; by default, at once.

        Args:
            rank: of the node.
            do: is called once: with "", or with the reason why it must not happen.
        """
        do("")

    def latest_skew(self) -> int | None:
        """Return how far apart in wall time nodes were last (ns); None if they wait for others."""
        return None

    def figures(self) -> dict[str, Any]:
        """Return what was measured: keys of :class:`~vbus.serve.nodes.nodes.NodesOutcome`."""
        raise NotImplementedError

    # -- life ----------------------------------------------------------------------------------

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin; the link is open."""
        self.loop = loop
        self._last_tick = self._clock()
        self._tick()

    def stop(self) -> None:
        """Let time stand still."""
        if self.loop is not None and self.failure is None and self._done_at < 0:
            for rank in self.ranks:
                self.send(rank, Alive(self.plan.digest, rank, -1, LEFT))
        if self._timer is not None:
            self._timer.cancel()
        self.loop = None

    def done(self) -> None:
        """The run is over for the nodes of this process; it ends when it is so for all."""
        if self._done_at < 0:
            self._done_at = self._clock()
            self._tell_state()
        self._see_whether_all_are_done()

    # -- messages ------------------------------------------------------------------------------

    def send(self, rank: int, message: Message) -> None:
        """Send what node ``rank`` of this process has to say to other processes."""
        if self.group.link is not None:
            self.group.link.send(rank, encode(message))

    def received(self, rank: int, data: bytes) -> None:
        """Take what a node of another process has sent."""
        if self.failure is not None or self.loop is None:
            return
        other = self.others[rank]
        try:
            message = decode(data, other.name, len(self.plan.nodes), len(self.plan.wires))
            reports = message.reports if isinstance(message, Reports) else ()
            if message.node != rank or any(one.node in self.ranks for one in reports):
                raise NodeMismatchError(
                    other.name, f"node {other.name} has sent a message in the name of another"
                )
        except NodeMismatchError as error:
            # What cannot be understood is no sign of life either.
            self.group.report(str(error))
            return
        try:
            if message.digest != self.plan.digest:
                self._refuse(other)
                return
            self.heard_of(rank)
            if isinstance(message, Alive):
                # What a lost node said before may come late.
                if rank not in self._lost or message.state.startswith(GAVE_UP):
                    other.state = message.state
                    other.round = message.round
                if other.state.startswith(GAVE_UP):
                    self._follow(rank, other.state.removeprefix(GAVE_UP))
            else:
                self.deliver(rank, message)
        except VbusError as error:
            self.fail(error)
        self.proceed()

    def _refuse(self, other: Peer) -> None:
        """A node runs another board: refuse it, unless this node agrees with no other either."""
        error = NodeMismatchError(
            other.name,
            f"node {other.name} runs another board file or version of vbus: give every node the"
            " same",
        )
        if len(self.ranks) == 1 and not any(known.joined for known in self.others.values()):
            raise error
        if not other.refused:
            self.group.report(f"{error}; waits for it")
        other.refused = True

    def heard_of(self, rank: int) -> None:
        """Node ``rank`` has shown that it is there."""
        other = self.others[rank]
        other.heard = self._clock()
        if not other.joined:
            other.joined = other.present = True
            other.state = "here"
            self.joined(rank)
        if rank in self._lost and other.present:
            del self._lost[rank]
            self.group.report(f"node {other.name} is back")
            self.joined(rank)

    # -- orders -----------------------------------------------------------------------------

    def order(self, rank: int, data: bytes, answer: Callable[[bytes], None]) -> None:
        """Take an order for a node of this process.

        Args:
            rank: of the node.
            data: a :class:`~vbus.serve.nodes.ordering.NodeRequest`.
            answer: takes an :class:`~vbus.serve.nodes.ordering.Answer`, once, soon or late.
        """

        def give(reply: Answer) -> None:
            data = msgspec.json.encode(reply)
            if len(data) > LARGEST_ANSWER:
                why = f"its answer has {len(data)} bytes, and at most {LARGEST_ANSWER} are sent"
                data = msgspec.json.encode(Answer(name, error=f"node {name}: {why}"))
            answer(data)

        name = self.plan.nodes[rank]
        try:
            request = read_request(data)
        except ConfigError as error:
            give(Answer(name, error=f"{NO_ORDER}: {error}"))
            return
        if request.digest != self.plan.digest:
            give(Answer(name, error=is_of_another(name)))
        else:
            self.carry_out(rank, request, give)

    def carry_out(self, rank: int, request: NodeRequest, answer: Callable[[Answer], None]) -> None:
        """Carry out an order for a node of this process; ``answer`` is called once."""
        raise NotImplementedError

    # -- snapshots ------------------------------------------------------------------------------

    def save_node(self, request: dict[str, Any], reply: Callable[[dict[str, Any]], None]) -> None:
        """Get a node's part of a snapshot at the end of a round, or see whether the node is there.

        Args:
            request: ``node``, and ``round``, if a part is wanted.
            reply: takes once, soon or late, what an order's reply has.
        """
        name, number, plan = request.get("node"), request.get("round", -1), self.plan
        if name not in plan.nodes or not (isinstance(number, int) and -1 <= number <= NEVER):
            reply({"error": f"{name} is no node of {plan.board}, or {number} no round of it"})
            return

        def take(data: bytes) -> None:
            try:
                reply({"done": self._part(str(name), number, data)})
            except VbusError as error:
                reply({"error": str(error)})

        rank, asked = plan.rank(name), msgspec.json.encode(NodeRequest(plan.digest, save=number))
        if self.group.link is None or rank in self.ranks:
            self.order(rank, asked, take)
        else:
            self.group.link.ask(rank, asked, ASK_SECONDS, take)

    def _part(self, name: str, number: int, data: bytes) -> Any:
        """Return what a node has answered, for JSON.

        Raises:
            VbusError: the node has not answered, refuses, or the answer makes no sense.
        """
        state = self.state_seen(name)
        if not data and number < 0:
            return {"answers": False, "state": state}
        if not data:
            raise VbusError(f"node {name} does not answer ({state}); is it running (vbus ls)?")
        answer = read_answer(name, data)
        if answer.error:
            raise VbusError(answer.error)
        if number < 0:
            return {"answers": True, "state": state}
        if answer.part is None:
            raise VbusError(f"node {name} gives an answer without its part of the snapshot")
        return msgspec.to_builtins(answer.part)

    # -- who is there ---------------------------------------------------------------------------

    def present(self, rank: int, there: bool) -> None:
        """A node of another process has come or gone."""
        if self.loop is None:
            return
        other = self.others[rank]
        if there:
            other.present = True
            if other.joined:
                self.heard_of(rank)
            self._tell_state()
            self.joined(rank)
            self.proceed()
        elif other.present:
            other.present = False
            if other.joined and other.state != DONE and self._done_at < 0:
                died = "has died or was cut off: its process or its link is gone"
                self._lose(rank, LEFT if other.state == LEFT else died)
            self._see_whether_all_are_done()

    def _lose(self, rank: int, why: str) -> None:
        if rank in self._lost or self.failure is not None:
            return
        other = self.others[rank]
        error = NodeLostError(other.name, f"node {other.name} {why}; {self.standing_at()}")
        if not other.state.startswith((GAVE_UP, LEFT)):
            other.state = "lost"
        self._lost[rank] = (self._clock(), error)
        if self.group.patience > 0:
            self.group.report(f"{error}; waits {self.group.patience:g} s for it to rejoin")
        else:
            assert self.loop is not None
            self.loop.call_later(GRACE, self._give_up)

    def _follow(self, rank: int, name: str) -> None:
        """Node ``rank`` ends because of node ``name``: that is the one to be named."""
        other = self.others[rank]
        lost = self.plan.nodes.index(name) if name in self.plan.nodes else -1
        if lost in self.ranks and self._done_at < 0:
            self.fail(
                NodeLostError(
                    other.name,
                    f"node {other.name} has given up node {name}, which runs here: it was silent"
                    " too long, or cut off",
                )
            )
        elif lost in self.others and self._done_at < 0:
            self.others[lost].cause = True
            self._lose(lost, f"does not answer node {other.name}, which has given it up")

    def _give_up(self) -> None:
        expired = [
            (
                not self.others[rank].cause,
                self.others[rank].state.startswith(GAVE_UP),  # the consequence of another
                self.plan.hub != rank,  # all links end there: with it all are lost
                rank,
                error,
            )
            for rank, (since, error) in self._lost.items()
            if self._clock() - since >= self.group.patience
        ]
        if expired and self.failure is None:
            self.fail(min(expired, key=lambda item: item[:4])[4])

    def fail(self, error: VbusError) -> None:
        """End the run in error, and let the other nodes know because of which node."""
        if self.failure is None:
            if isinstance(error, NodeLostError):
                for rank in self.ranks:
                    state = GAVE_UP + error.node
                    self.send(rank, Alive(self.plan.digest, rank, -1, state))
            self.failure = error
            self.finished.set()

    def _tick(self) -> None:
        if self.loop is None:
            return
        self._timer = self.loop.call_later(TICK, self._tick)
        now = self._clock()
        if now - self._last_tick > 5 * TICK:
            # This process itself stood still: what others sent meanwhile is still to be read.
            for other in self.others.values():
                other.heard = max(other.heard, now - TICK)
        self._last_tick = now
        self._tell_state()
        if self._done_at < 0 and self.failure is None:
            self._look_for_silence(now)
        if self._lost and self.group.patience > 0:
            self._give_up()
        self._see_whether_all_are_done()
        self.proceed()

    def _look_for_silence(self, now: float) -> None:
        for rank, other in self.others.items():
            if not other.joined or rank in self._lost or other.state == DONE:
                continue
            if now - other.heard > other.deadline:
                said = f"has been silent for {other.deadline:g} s: it stalls or is cut off"
                self._lose(rank, said)
        self.check(now)

    def _tell_state(self) -> None:
        if self.failure is not None:
            return
        for rank in self.ranks:
            latest, state = self.state_of(rank)
            if self._done_at >= 0:
                state = DONE
            self.send(rank, Alive(self.plan.digest, rank, latest, state))

    def _see_whether_all_are_done(self) -> None:
        if self._done_at < 0:
            return
        late = self._clock() - self._done_at > FAREWELL
        if late or all(o.state == DONE or not o.present for o in self.others.values()):
            self.finished.set()

    # -- telling --------------------------------------------------------------------------------

    def state_seen(self, name: str) -> str:
        """Return what a node of this machine does, or has said last that it does."""
        rank = self.plan.rank(name)
        return self.others[rank].state if rank in self.others else self.state_of(rank)[1]

    def status(self, rank: int) -> dict[str, Any]:
        """Return what ``vbus ls`` shows of one node of this process; instants in ps."""
        return {
            "board": self.plan.board,
            "node": self.plan.nodes[rank],
            "state": self.state_of(rank)[1],
            "others": {
                name: self.state_seen(name) for n, name in enumerate(self.plan.nodes) if n != rank
            },
            **self.details(rank),
        }
