"""Nodes that keep one virtual time: what is granted is run, who is silent is named."""

import asyncio
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from vbus.errors import NodeError, NodeLostError, NodeMismatchError, VbusError
from vbus.kernel import MS
from vbus.nodes.conductor import RUNS, Conductor
from vbus.nodes.messages import Alive, Need, Report, decode, encode
from vbus.nodes.plan import Plan
from vbus.server.node_link import NodeLink

TICK: Final = 0.1
"""Seconds between signs of life."""
LACKING: Final = 0.25
"""Seconds after which a report that does not come is asked for."""
BUDGET: Final = 0.01
"""Seconds of computing after which the loop serves others."""
SNAPSHOT_EVERY: Final = 0.25
"""Seconds between two snapshots."""
FAREWELL: Final = 5.0
"""Seconds that a node which is done waits for the others at most."""
GRACE: Final = 0.3
"""Seconds between a loss and the error: long enough to hear which node was the first to be lost."""
DONE: Final = "done"
GAVE_UP: Final = "has given up "
"""State of a node that ends because of another, whose name follows."""


class _Other:
    """What is known of a node in another process."""

    def __init__(self, name: str, deadline: float) -> None:
        self.name: str = name
        self.deadline: float = deadline
        self.joined: bool = False
        self.strange: bool = False
        self.cause: bool = False
        """Another node says that it ends because of this one."""
        self.present: bool = False
        self.heard: float = 0.0
        self.asked: float = 0.0
        self.state: str = "not here yet"
        self.round: int = -1


class Timebase:
    """Runs the nodes of this process in one time with those of other processes.

    A node that dies, or is silent beyond its deadline, is a :class:`NodeLostError` for all others:
    never a wait without end. Nodes that have not come yet are waited for.

    Args:
        plan: the board.
        conductors: the nodes of this process.
        link: to the other processes; None if all nodes are here.
        say: takes sentences about nodes that come and go.
        patience: seconds to wait for a lost node to rejoin; then, or at once if 0, it is an error.
        snapshot: file that takes a snapshot now and then, if this process has one node.
        clock: wall time in seconds; for tests.
    """

    def __init__(
        self,
        plan: Plan,
        conductors: Sequence[Conductor],
        link: NodeLink | None = None,
        say: Callable[[str], None] = print,
        patience: float = 0.0,
        snapshot: str = "",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.plan: Plan = plan
        self.conductors: list[Conductor] = list(conductors)
        self.on_grant: list[Callable[[], None]] = []
        """Called after each grant of a node of this process."""
        self.failure: VbusError | None = None
        self.finished: asyncio.Event = asyncio.Event()
        """Set when the run is over, for better or worse."""
        self.rounds: int = 0
        self.waited: float = 0.0
        """Seconds spent waiting for other processes."""
        self._link: NodeLink | None = link
        self._say: Callable[[str], None] = say
        self._patience: float = patience
        self._snapshot: str = snapshot
        self._clock: Callable[[], float] = clock
        self._loop: asyncio.AbstractEventLoop | None = None
        self._kicked: bool = False
        self._mine: dict[int, Conductor] = {c.node.rank: c for c in conductors}
        self._others: dict[int, _Other] = {
            rank: _Other(name, plan.deadlines[rank] / (1000 * MS))
            for rank, name in enumerate(plan.nodes)
            if rank not in self._mine
        }
        self._lost: dict[int, tuple[float, NodeLostError]] = {}
        self._last_tick: float = 0.0
        self._last_snapshot: float = 0.0
        self._idle_since: float = 0.0
        self._done_at: float = -1.0
        self._timer: asyncio.TimerHandle | None = None

    # -- life -----------------------------------------------------------------------------------

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin; the link is open."""
        self._loop = loop
        self._last_tick = self._last_snapshot = self._idle_since = self._clock()
        if self._link is not None:
            self._link.on_message = self._received
            self._link.on_presence = self._presence
        for rank, conductor in self._mine.items():
            # After a snapshot these were made before anybody was there to take them.
            for number in sorted(conductor.participant.log):
                self._send(rank, conductor.participant.log[number])
            for other in self._others:
                self._ask(rank, other)
        self._tick()
        self.kick()

    def stop(self) -> None:
        """Let time stand still."""
        if self._timer is not None:
            self._timer.cancel()
        self._loop = None

    def kick(self) -> None:
        """Something has happened: see soon what can be done."""
        if not self._kicked and self._loop is not None:
            self._kicked = True
            self._loop.call_soon(self._run)

    def _run(self) -> None:
        self._kicked = False
        if self._loop is None or self.failure is not None:
            return
        started = self._clock()
        if not any(c.participant.reported and not c.participant.ready() for c in self.conductors):
            self._idle_since = started
        try:
            while self._round():
                if self._clock() - started > BUDGET:
                    self.kick()
                    return
        except NodeError as error:
            self._fail(error)
        if self._done_at < 0 and all(c.finished for c in self.conductors):
            self._done_at = self._clock()
            self._tell_state()
        self._see_whether_all_are_done()

    def _round(self) -> bool:
        """Let every node do what it can; return whether there may be more to do."""
        moved = False
        for conductor in self.conductors:
            before = conductor.participant.round
            report = conductor.poll()
            if conductor.participant.round != before:
                self.rounds += 1
                for granted in self.on_grant:
                    granted()
            if report is not None:
                self._send(conductor.node.rank, report)
                self._keep_snapshot(conductor)
            moved = moved or report is not None or conductor.state == RUNS
        return moved

    # -- messages -------------------------------------------------------------------------------

    def _send(self, rank: int, message: Report | Alive | Need) -> None:
        if isinstance(message, Report):
            for other, conductor in self._mine.items():
                if other != rank:
                    conductor.receive(message)
        if self._link is not None:
            self._link.send(rank, encode(message))

    def _ask(self, rank: int, other: int) -> None:
        participant = self._mine[rank].participant
        self._send(rank, Need(self.plan.digest, rank, other, participant.round))

    def _received(self, rank: int, data: bytes) -> None:
        if self.failure is not None or self._loop is None:
            return
        other = self._others[rank]
        try:
            message = decode(data, other.name, len(self.plan.nodes), len(self.plan.wires))
            if message.node != rank:
                raise NodeMismatchError(
                    other.name, f"node {other.name} has sent a message in the name of another"
                )
        except NodeMismatchError as error:
            # What cannot be understood is no sign of life either.
            self._say(str(error))
            return
        try:
            if message.digest != self.plan.digest:
                self._strange(other)
                return
            self._heard(rank)
            if isinstance(message, Report):
                for conductor in self.conductors:
                    conductor.receive(message)
                other.round = max(other.round, message.round)
            elif isinstance(message, Alive):
                other.state = message.state
                other.round = message.round
                if other.state.startswith(GAVE_UP):
                    self._follow(rank, other.state.removeprefix(GAVE_UP))
            elif message.other in self._mine:
                self._resend(message.other, other.name, message.round)
        except NodeError as error:
            self._fail(error)
        self.kick()

    def _strange(self, other: _Other) -> None:
        """A node runs another board: it goes, unless nobody agrees with this one either."""
        error = NodeMismatchError(
            other.name,
            f"node {other.name} runs another board file or version of vbus: give every node the"
            " same",
        )
        if len(self._mine) == 1 and not any(known.joined for known in self._others.values()):
            raise error
        if not other.strange:
            self._say(f"{error}; waits for it")
        other.strange = True

    def _resend(self, mine: int, name: str, first: int) -> None:
        """Node ``name`` lacks reports from round ``first`` on."""
        log = self._mine[mine].participant.log
        latest = max(log, default=-1)
        if log and first < min(log):
            raise NodeMismatchError(
                name,
                f"node {name} rejoins at round {first}, and reports are kept from round {min(log)}"
                " on: its snapshot is too old, or from another run",
            )
        for number in range(first, latest + 1):
            self._send(mine, log[number])

    def _heard(self, rank: int) -> None:
        other = self._others[rank]
        other.heard = self._clock()
        if not other.joined:
            other.joined = other.present = True
            other.state = "here"
            for mine in self._mine:
                self._ask(mine, rank)
        if rank in self._lost and other.present:
            del self._lost[rank]
            self._say(f"node {other.name} is back")
            for mine in self._mine:
                self._ask(mine, rank)

    # -- who is there ---------------------------------------------------------------------------

    def _presence(self, rank: int, there: bool) -> None:
        other = self._others[rank]
        if there:
            other.present = True
            if other.joined:
                self._heard(rank)
            for mine in self._mine:
                self._tell_state_of(mine)
                self._ask(mine, rank)
            self.kick()
        elif other.present:
            other.present = False
            if other.joined and other.state != DONE and self._done_at < 0:
                self._lose(rank, "has died or was cut off: its process or its link is gone")
            self._see_whether_all_are_done()

    def _lose(self, rank: int, why: str) -> None:
        if rank in self._lost or self.failure is not None:
            return
        other = self._others[rank]
        now = max(c.participant.granted for c in self.conductors) - 1
        error = NodeLostError(
            other.name,
            f"node {other.name} {why}; time stands still at {max(now, 0) / 1e9:.6f} ms, round"
            f" {self.conductors[0].participant.round}",
        )
        if not other.state.startswith(GAVE_UP):
            other.state = "lost"
        self._lost[rank] = (self._clock(), error)
        if self._patience > 0:
            self._say(f"{error}; waits {self._patience:g} s for it to rejoin")
        else:
            assert self._loop is not None
            self._loop.call_later(GRACE, self._give_up)

    def _follow(self, rank: int, name: str) -> None:
        """Node ``rank`` ends because of node ``name``: that is the one to be named."""
        other = self._others[rank]
        lost = self.plan.nodes.index(name) if name in self.plan.nodes else -1
        if lost in self._mine and self._done_at < 0:
            self._fail(
                NodeLostError(
                    other.name,
                    f"node {other.name} has given up node {name}, which runs here: it was silent"
                    " too long, or cut off",
                )
            )
        elif lost in self._others and self._done_at < 0:
            self._lost.pop(lost, None)
            self._others[lost].cause = True
            self._lose(lost, f"does not answer node {other.name}, which has given it up")

    def _give_up(self) -> None:
        expired = [
            (
                not self._others[rank].cause,
                self._others[rank].state.startswith(GAVE_UP),  # the consequence of another
                self.plan.hub != rank,  # all links end there: with it all are lost
                rank,
                error,
            )
            for rank, (since, error) in self._lost.items()
            if self._clock() - since >= self._patience
        ]
        if expired and self.failure is None:
            self._fail(min(expired, key=lambda item: item[:4])[4])

    def _fail(self, error: VbusError) -> None:
        if self.failure is None:
            if isinstance(error, NodeLostError):
                for rank in self._mine:
                    state = GAVE_UP + error.node
                    self._send(rank, Alive(self.plan.digest, rank, -1, state))
            self.failure = error
            self.finished.set()

    def _tick(self) -> None:
        if self._loop is None:
            return
        self._timer = self._loop.call_later(TICK, self._tick)
        now = self._clock()
        if now - self._last_tick > 5 * TICK:
            # This process itself stood still: what others sent meanwhile is still to be read.
            for other in self._others.values():
                other.heard = max(other.heard, now - TICK)
        self._last_tick = now
        self._tell_state()
        if self._done_at < 0 and self.failure is None:
            self._look_for_silence(now)
        if self._lost and self._patience > 0:
            self._give_up()
        self._see_whether_all_are_done()
        self.kick()

    def _look_for_silence(self, now: float) -> None:
        for rank, other in self._others.items():
            if not other.joined or rank in self._lost or other.state == DONE:
                continue
            if now - other.heard > other.deadline:
                self._lose(rank, f"has been silent for {other.deadline:g} s: it stalls")
            for mine, conductor in self._mine.items():
                if (
                    rank in conductor.participant.missing()
                    and other.round >= conductor.participant.round
                    and now - other.asked > LACKING
                ):
                    other.asked = now
                    self._ask(mine, rank)

    def _tell_state(self) -> None:
        for rank in self._mine:
            self._tell_state_of(rank)

    def _tell_state_of(self, rank: int) -> None:
        conductor = self._mine[rank]
        latest = max(conductor.participant.log, default=-1)
        state = DONE if self._done_at >= 0 else conductor.state
        self._send(rank, Alive(self.plan.digest, rank, latest, state))

    def _see_whether_all_are_done(self) -> None:
        if self._done_at < 0:
            return
        late = self._clock() - self._done_at > FAREWELL
        if late or all(o.state == DONE or not o.present for o in self._others.values()):
            self.finished.set()

    # -- telling --------------------------------------------------------------------------------

    def _keep_snapshot(self, conductor: Conductor) -> None:
        now = self._clock()
        if self._snapshot and now - self._last_snapshot >= SNAPSHOT_EVERY:
            self._last_snapshot = now
            self.write_snapshot(conductor)

    def write_snapshot(self, conductor: Conductor) -> None:
        """Write a snapshot of a node that has just reported; the file is replaced in one step."""
        path = Path(self._snapshot)
        partial = path.with_name(path.name + ".part")
        try:
            partial.write_bytes(conductor.save())
            partial.replace(path)
        except OSError as error:
            self._say(f"{path}: the snapshot is not written: {error.strerror}")
            self._snapshot = ""

    def status(self, rank: int) -> dict[str, Any]:
        """Return what ``vbus ls`` shows of one node of this process; instants in ps."""
        conductor = self._mine[rank]
        return {
            "board": self.plan.board,
            "node": self.plan.nodes[rank],
            "state": conductor.state,
            "round": conductor.participant.round,
            "granted_ps": conductor.participant.granted,
            "waits_for": [self.plan.nodes[n] for n in conductor.participant.missing()]
            if conductor.participant.reported
            else [],
            "others": {
                self.plan.nodes[n]: (
                    self._others[n].state if n in self._others else self._mine[n].state
                )
                for n in range(len(self.plan.nodes))
                if n != rank
            },
        }
