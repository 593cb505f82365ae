"""Nodes in real time: one epoch by agreed clocks, edges that travel, orders for coming instants."""

from __future__ import annotations

import asyncio
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from vbus.boardfile.sections import BoardFile
from vbus.core.errors import NodeMismatchError
from vbus.core.kernel import MS, Timer
from vbus.nodes.messages import Edge, Mark, Message, Ping, Pong, WireEdges
from vbus.nodes.node import Node
from vbus.serve.nodes.ordering import Answer, NodeRequest, take_order
from vbus.serve.nodes.peers import TICK, Group, Peers
from vbus.serve.time.pacer import WallClockPacer
from vbus.serve.time.statistics import Histogram

LAST_EXCHANGES: Final = 64
"""Exchanges looked back at: some seconds of them. Not measured."""
ENOUGH: Final = 6
"""Exchanges after which the estimate is used; not measured."""


def monotonic_clock() -> str:
    """Return what names the clock that counts here: processes with one name read one clock.

    It counts from the start of this computer, and from elsewhere in a time namespace of its own.
    Empty if the system does not tell.
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot} {os.readlink('/proc/self/ns/time')}"
    except OSError:
        return ""


class ClockEstimate:
    """The offset between two clocks from exchanges of messages, as NTP does it.

    A message and its answer give four instants. The fastest exchange of late is believed: queues
    only make exchanges slower. The true offset differs from the estimate by at most half of that
    exchange's round trip, whatever the two ways share it.
    """

    def __init__(self) -> None:
        self._exchanges: deque[tuple[int, int]] = deque(maxlen=LAST_EXCHANGES)
        self.offset: int = 0
        """The other clock minus this one (ns)."""
        self.uncertainty: int = -1
        """At most this far from the truth (ns); -1: nothing is known."""
        self.shared: bool = False
        """Whether both go by one clock."""

    def share(self) -> None:
        """Both go by one clock: there is nothing to estimate."""
        self.shared = True
        self.offset = self.uncertainty = 0

    def add(self, sent: int, came: int, answered: int, back: int) -> None:
        """Take one exchange: sent and back by this clock, came and answered by the other (ns)."""
        trip = (back - sent) - (answered - came)
        if trip < 0:
            return
        self._exchanges.append((trip, ((came - sent) + (answered - back)) // 2))
        best, self.offset = min(self._exchanges)
        self.uncertainty = (best + 1) // 2

    @property
    def good(self) -> bool:
        """Whether there have been enough exchanges."""
        return self.shared or len(self._exchanges) >= ENOUGH


MARKS_KEPT: Final = 2000
"""Marks whose skew is recorded for percentiles."""
MARKS_OPEN: Final = 50
"""Marks back to which stragglers may still come: five seconds."""
BOUNDS_NS: Final = tuple(digit * 10**power for power in range(4, 8) for digit in (1, 2, 5))
"""Upper bounds of the classes in which all marks are counted, 10 us to 50 ms."""


class Skew:
    """Collects when each node reached a mark; the spread is the skew of that mark."""

    def __init__(self) -> None:
        self._open: dict[int, dict[int, tuple[int, int]]] = {}
        self._spreads: deque[int] = deque(maxlen=MARKS_KEPT)
        self._all: Histogram = Histogram(BOUNDS_NS)
        self.latest: int = 0
        """The spread of the latest mark (ns)."""
        self.uncertainty: int = 0
        """How far the latest spread may be from the truth (ns): both ends' clocks are estimates."""

    def note(self, number: int, node: int, at: int, uncertainty: int, nodes: int) -> None:
        """Node ``node`` has reached mark ``number`` at ``at`` (ns, agreed clock).

        Args:
            number: of the mark.
            node: its rank.
            at: when.
            uncertainty: how sure that is (ns).
            nodes: how many nodes there are now.
        """
        reached = self._open.setdefault(number, {})
        reached[node] = at, uncertainty
        if len(reached) >= nodes > 1:
            del self._open[number]
            (first, before), (last, after) = min(reached.values()), max(reached.values())
            spread = last - first
            self.uncertainty = before + after
            self.latest = spread
            self._spreads.append(spread)
            self._all.note(spread)
        if len(self._open) > MARKS_OPEN:
            del self._open[min(self._open)]

    def statistics(self) -> dict[str, Any]:
        """Return percentiles of late, the worst of all, and how sure the latest is (ns).

        ``histogram`` has all marks in classes: their upper bounds (ns; None: there is none) and
        how many marks fell in each, as far as the last that has any.
        """
        ordered = sorted(self._spreads) or [0]
        last = len(ordered) - 1
        classes = [list(pair) for pair in zip((*BOUNDS_NS, None), self._all.buckets, strict=True)]
        while classes and not classes[-1][1]:
            classes.pop()
        return {
            "marks": self._all.count,
            "p50_ns": ordered[last // 2],
            "p99_ns": ordered[last * 99 // 100],
            "max_ns": self._all.most,
            "uncertainty_ns": self.uncertainty,
            "histogram": classes,
        }


HEAD_START_NS: Final = 300_000_000
"""Wall time between agreeing on the epoch and the epoch itself: each node has
to hear of it before. Not measured."""
PING_SECONDS: Final = 0.02
"""Between exchanges, until the clocks are known; not measured."""
MARK: Final = 100 * MS
"""Chip time between two marks at which skew is measured, at rate 1."""
SLEW: Final = 500
"""A clock that drifts is followed by at most this much (ns in a million): the
kernel, too, slews a clock by 500 ppm at most."""


class RealTime(Peers):
    """Nodes of this process in real time with those of other processes.

    The node that listens, else the first of the board, keeps the epoch. The others measure by how
    much its clock differs from theirs, and go by it.

    Args:
        group: the board, and how its nodes are reached.
        nodes: the nodes of this process.
        until: chip time at which the run is over (ps); -1: never.
        rate: chip seconds per second.
        clock: wall time in ns; for tests.

    Attributes:
        skew: measured between nodes.
        clock: estimate of the epoch keeper's clock.
    """

    def __init__(
        self,
        group: Group,
        nodes: Sequence[Node],
        until: int = -1,
        rate: float = 1.0,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        super().__init__(group, [node.rank for node in nodes])
        self.nodes: dict[int, Node] = {node.rank: node for node in nodes}
        self.pacers: dict[int, WallClockPacer] = {}
        self.keeper: int = max(self.plan.hub, 0)
        self.epoch: int = -1
        """When chip time was 0, by this process' clock (ns)."""
        self.skew: Skew = Skew()
        self.clock: ClockEstimate = ClockEstimate()
        self._until: int = until
        self._ns: Callable[[], int] = clock
        self._clock_name: str = monotonic_clock() if clock is time.monotonic_ns else ""
        self._pings: int = 0
        self._sent: dict[int, int] = {node.rank: 0 for node in nodes}
        self._next: dict[int, int] = {}
        """Number of the message with edges that comes next from a node in another process."""
        self._keepers_epoch: int = -1
        self._pinging: asyncio.TimerHandle | None = None
        self._period: int = max(MARK, int(MARK * min(rate, 1000)))
        self._marks: dict[int, Timer] = {}

    @property
    def keeps(self) -> bool:
        """Whether the epoch is held in this process."""
        return self.keeper in self.nodes

    # -- agreeing on the epoch ------------------------------------------------------------------

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin to agree; the link is open."""
        super().start(loop)
        self.proceed()
        if not self.keeps:
            self._ping()

    def stop(self) -> None:
        """Let time stand still."""
        if self._pinging is not None:
            self._pinging.cancel()
        super().stop()

    def proceed(self) -> None:
        """The keeper begins when all it has to wait for are there."""
        if self.keeps and self.epoch < 0:
            here = all(other.joined for other in self.others.values())
            # With a scenario everybody is to be there when it begins.
            if here or self._until < 0:
                self._begin(self._ns() + HEAD_START_NS)

    def _ping(self) -> None:
        if self.loop is None:
            return
        mine = self.ranks[0]
        self.send(mine, Ping(self.plan.digest, mine, self._pings, self._ns(), self._clock_name))
        self._pings += 1
        pause = TICK if self.agreed.is_set() else PING_SECONDS
        self._pinging = self.loop.call_later(pause, self._ping)

    def _answered(self, pong: Pong) -> None:
        if pong.node != self.keeper or pong.other != self.ranks[0]:
            return
        if pong.shared:
            self.clock.share()
        else:
            self.clock.add(pong.sent, pong.came, pong.answered, self._ns())
        if pong.epoch < 0 or not self.clock.good:
            return
        name = self.plan.nodes[self.keeper]
        if 0 <= self._keepers_epoch != pong.epoch:
            raise NodeMismatchError(
                name,
                f"node {name}, which keeps the epoch, has begun a new run: start every node anew",
            )
        self._keepers_epoch = pong.epoch
        epoch = pong.epoch - self.clock.offset
        if self.epoch < 0:
            self._begin(epoch)
        elif abs(epoch - self.epoch) > self.clock.uncertainty:
            most = int(TICK * 1000) * SLEW
            step = max(-most, min(most, epoch - self.epoch))
            self.epoch += step
            for pacer in self.pacers.values():
                pacer.shift(step)

    def _begin(self, epoch: int) -> None:
        self.epoch = epoch
        self.agreed.set()

    # -- moving ---------------------------------------------------------------------------------

    def pacer(self, node: Node, part: BoardFile) -> WallClockPacer:
        """Return what moves a node's board, once the epoch is known."""
        pacer = WallClockPacer(node.board, part.board.stall, self._ns, epoch=self.epoch)
        pacer.on_moved = lambda: self.flush(node)
        self.pacers[node.rank] = pacer
        timer = node.board.kernel.timer(lambda: self._mark(node), saved=False)
        self._marks[node.rank] = timer
        now = max(self._ns() - self.epoch, 0) * 1000
        timer.at((now // self._period + 1) * self._period)
        return pacer

    def flush(self, node: Node) -> None:
        """Send the edges that are on their way; see whether the run is over."""
        edges = node.take_edges()
        if edges:
            for other in self.nodes.values():
                if other is not node:
                    self._accept(other, edges)
            number = self._sent[node.rank]
            self.send(node.rank, WireEdges(self.plan.digest, node.rank, number, tuple(edges)))
            self._sent[node.rank] = number + 1
        if self._until >= 0 and all(mine.board.now > self._until for mine in self.nodes.values()):
            self.done()

    def _accept(self, node: Node, edges: Sequence[Edge]) -> None:
        pacer = self.pacers.get(node.rank)
        if pacer is not None:
            # The board may stand where it was before a stall: there the edges are not late yet.
            node.accept(edges)
            pacer.catch_up()
            pacer.served()

    def _mark(self, node: Node) -> None:
        number = node.board.now // self._period
        at, sure = self._ns() + self.clock.offset, self._uncertainty()
        self.skew.note(number, node.rank, at, sure, self._here())
        self.send(node.rank, Mark(self.plan.digest, node.rank, number, at, sure))
        self._marks[node.rank].at(node.board.now + self._period)

    def _uncertainty(self) -> int:
        """How far the agreed clock may be from what this process believes (ns)."""
        return 0 if self.keeps else max(self.clock.uncertainty, 0)

    def _here(self) -> int:
        return len(self.nodes) + sum(other.joined for other in self.others.values())

    # -- orders ---------------------------------------------------------------------------------

    def carry_out(self, rank: int, request: NodeRequest, answer: Callable[[Answer], None]) -> None:
        """Take an order for a node, or tell chip time (``ordering.py``)."""
        node, pacer = self.nodes[rank], self.pacers.get(rank)
        if pacer is None:
            answer(Answer(node.name, error="chip time has not begun yet"))
            return
        pacer.catch_up()
        taken = take_order(node, request, self._uncertainty())
        pacer.served()
        answer(taken)

    def let_in(self, rank: int, do: Callable[[str], None]) -> None:
        """Let something happen at a node now, and send the edges it has caused."""
        super().let_in(rank, do)
        if rank in self.pacers:
            self.pacers[rank].served()

    # -- messages -------------------------------------------------------------------------------

    def deliver(self, rank: int, message: Message) -> None:
        """Take what another node has to say."""
        if isinstance(message, Ping):
            if self.keeps:
                came = self._ns()
                shared = message.clock == self._clock_name != ""
                self.send(
                    self.keeper,
                    Pong(
                        self.plan.digest, self.keeper, message.round, rank, message.sent, came,
                        self._ns(), self.epoch, shared,
                    ),
                )  # fmt: skip
        elif isinstance(message, Pong):
            self._answered(message)
        elif isinstance(message, WireEdges):
            self._look_for_gap(rank, message.round)
            for node in self.nodes.values():
                self._accept(node, message.edges)
        elif isinstance(message, Mark):
            self.skew.note(message.round, rank, message.at, message.uncertainty, self._here())

    def _look_for_gap(self, rank: int, number: int) -> None:
        """Time does not wait here: what was sent while a cable was out is lost, and reported."""
        lost = number - self._next.get(rank, number)
        self._next[rank] = number + 1
        if lost > 0:
            self.group.report(
                f"{lost} messages with edges of node {self.plan.nodes[rank]} were lost while it was"
                " cut off; a wire it drives may stand wrong until its next edge"
            )

    # -- telling --------------------------------------------------------------------------------

    def state_of(self, rank: int) -> tuple[int, str]:
        """Return what a node of this process does."""
        return -1, "runs" if self.agreed.is_set() else "agrees on the epoch"

    def standing_at(self) -> str:
        """Return where this process is, for an error message."""
        now = max(node.board.now for node in self.nodes.values())
        return f"chip time here is {now / 1e9:.3f} ms"

    def latest_skew(self) -> int | None:
        """Return how far apart the nodes were at the latest mark (ns)."""
        return self.skew.latest

    def figures(self) -> dict[str, Any]:
        """Return how far apart the nodes were."""
        return {"skew": self.skew.statistics()}

    def details(self, rank: int) -> dict[str, Any]:
        """Return how well a node keeps to the time of all."""
        node = self.nodes[rank]
        return {
            "keeps_epoch": rank == self.keeper,
            "clock_shared": self.clock.shared,
            "clock_offset_ns": 0 if self.keeps else self.clock.offset,
            "clock_uncertainty_ns": self._uncertainty(),
            "skew": self.skew.statistics(),
            "late_edges": node.late,
            "worst_late_ps": node.worst_late,
            "late_orders": sum(orders.late for orders in node.orders),
        }
