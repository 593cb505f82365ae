"""Pause and steps: time that stands still, and goes on step by step.

While time stands still, every request of a host is held before it acts, and carried out when time
goes on. A step lets the board run, hosts included, to an instant, a bus cycle or a condition. Where
hosts are masters of time it is they who move it, as ever, so a run in steps is the run it would
have been without. Where no host is attached, or if asked to, the session that steps lets time pass.
"""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.chips.base import SAMPLE
from vbus.core.kernel import NEVER
from vbus.core.signals import Observer
from vbus.protocols.quantities import format_instant, parse_duration
from vbus.serve.local_socket import Order
from vbus.serve.session import Session
from vbus.serve.time.pacer import LEASE, WallClockPacer
from vbus.serve.time.time_slicer import SLICE_NS

if TYPE_CHECKING:
    from vbus.events.watch import Watch

RUNNING: Final = "running"
PAUSED: Final = "paused"
STEPPING: Final = "stepping"
STEPS: Final = ("cycle", "time", "sample", "edge", "condition")


@dataclass(slots=True)
class _Goal:
    """What a step goes to.

    Attributes:
        board: the board.
        text: what is said once it is there.
        at: the instant, if it is one (ps).
        cycles: bus cycles that are still to be made, if it is those; else -1.
        watch: looks for the condition, if it is one.
    """

    board: Board
    text: str
    at: int = NEVER
    cycles: int = -1
    watch: "Watch | None" = None

    def met(self) -> bool:
        """Whether it is there."""
        if self.watch is not None:
            return self.watch.look()
        return self.cycles == 0 or self.board.now >= self.at

    def next_look(self) -> int:
        """Return the next instant at which it may be, though nothing is asked of the board."""
        return self.at if self.watch is None else self.watch.next_look()


class Steps(Observer):
    """Pause, go, step, rate, for one served board.

    Args:
        board: the board.
        pacer: what moves its time.
        sessions: gives those that are open.

    Attributes:
        state: :data:`RUNNING`, :data:`PAUSED` or :data:`STEPPING`.
        text: the same as a sentence.
        changed: called whenever they change.
        own: the session that steps, if there is one.
    """

    def __init__(
        self, board: Board, pacer: WallClockPacer, sessions: Callable[[], Iterator[Session]]
    ) -> None:
        self.state: str = RUNNING
        self.text: str = "time runs"
        self.changed: list[Callable[[], None]] = []
        self.own: HostBus | None = None
        self._board: Board = board
        self._pacer: WallClockPacer = pacer
        self._sessions: Callable[[], Iterator[Session]] = sessions
        self._goal: _Goal | None = None
        self._alone: bool = False
        pacer.on_bound = self._look

    def orders(self) -> dict[str, Order]:
        """Return the orders by name."""
        return {"pause": self._pause, "go": self._go, "step": self._step, "rate": self._rate}

    # -- orders -------------------------------------------------------------------------------

    def _pause(self, request: dict[str, Any]) -> dict[str, Any]:
        self.pause("paused")
        return self.status()

    def _go(self, request: dict[str, Any]) -> dict[str, Any]:
        self.go()
        return self.status()

    def _rate(self, request: dict[str, Any]) -> dict[str, Any]:
        rate = float("inf") if request["rate"] == "max" else float(request["rate"])
        if not rate >= 0.001:
            raise ValueError(
                f'{request["rate"]} is no rate; write a number from 0.001 up, or "max"'
            )
        if self._board.policy != "realtime":
            raise ValueError(f"a rate makes sense in real time; this board is {self._board.policy}")
        self._pacer.set_rate(rate)
        self._tell()
        return self.status()

    def _step(self, request: dict[str, Any]) -> dict[str, Any]:
        goal = self._goal_of(request)
        realtime = self._board.policy == "realtime"
        alone = not realtime and (bool(request.get("alone")) or not any(self._sessions()))
        if goal.cycles > 0 and (alone or not any(self._sessions())):
            raise ValueError("no host is attached that could make a bus cycle; make one yourself")
        if alone and self.own is None:
            raise ValueError(
                f"the hosts of a board in {self._board.policy} move its time, and none is attached"
            )
        self._leave()
        self._goal, self._alone = goal, alone
        if goal.watch is not None:
            goal.watch.begin()
        if goal.met():
            self.pause(f"{goal.text}: holds already")
            return self.status()
        self._board.observe(self)
        self._tell(STEPPING, f"goes on until {goal.text}")
        if alone:
            self._hold_all()
            self._pass_time()
        else:
            self._pacer.confine(goal.next_look())
        return self.status()

    def _goal_of(self, request: dict[str, Any]) -> _Goal:
        board, by = self._board, request["by"]
        if by == "cycle":
            count = int(request.get("count", 1))
            if count < 1:
                raise ValueError(f"{count} bus cycles: allowed are 1 and more")
            return _Goal(board, "the next bus cycle" if count == 1 else f"{count} bus cycles",
                         cycles=count)  # fmt: skip
        if by == "time":
            span = parse_duration(str(request["for"]))
            return _Goal(board, format_instant(board.now + span), board.now + span)
        if by == "sample":
            chip = board.chip(str(request["chip"]).partition(".")[0])
            chip.advance()
            due = chip.due(SAMPLE)
            if due == NEVER:
                raise ValueError(f"{chip.name} rests: it makes no samples now")
            return _Goal(board, f"a sample of {chip.name}", due)
        if by not in STEPS:
            raise ValueError(f'there is no step by "{by}"; there are {", ".join(STEPS)}')
        from vbus.events.watch import Watch

        text = str(request["until"]) if by == "condition" else f"changed({request['pin']})"
        return _Goal(board, text, watch=Watch(text, board))

    # -- doing it -----------------------------------------------------------------------------

    def pause(self, text: str) -> None:
        """Let time stand still, and keep what hosts ask for."""
        self._leave()
        self._hold_all()
        self._tell(PAUSED, text)

    def go(self) -> None:
        """Let time run as ever; what was held is carried out."""
        self._leave()
        if self.state != RUNNING:
            self._tell(RUNNING, "time runs")
            self._pacer.confine(NEVER)

    def still(self) -> None:
        """Something has let a little time pass while it stands still: that is its instant now."""
        if self._pacer.halted:
            self._pacer.halt()

    def _hold_all(self) -> None:
        self._pacer.halt()
        for port in self._board.ports:  # those of hosts that have gone meanwhile among them
            if port is not self.own and not port.held:
                port.held, port.hold_until = True, max(self._board.now, 1)
        for session in list(self._sessions()):
            session.hold()

    def _leave(self) -> None:
        """Go to nothing any more."""
        goal, self._goal = self._goal, None
        if goal is not None:
            if self in self._board.observers:
                self._board.unobserve(self)
            if goal.watch is not None:
                goal.watch.end()

    def _look(self) -> None:
        """Time is where the step must be looked at."""
        goal = self._goal
        if goal is None or goal.met():
            self.pause(goal.text if goal is not None else self.text)
        else:
            self._pacer.bound = goal.next_look()

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Count a cycle, and look whether the condition holds after it."""
        goal = self._goal
        if goal is not None:
            goal.cycles -= 1
            poll = goal.watch is not None and self._is_poll(goal.watch, chip, write, address)
            if not poll and goal.met():
                self.pause(goal.text)

    def _is_poll(self, watch: "Watch", chip: str, write: bool, address: int) -> bool:
        """Whether a condition is after a cycle what it was before: drivers poll a lot."""
        if write or watch.condition.events or "+" in chip or chip == "-":
            return False
        return address in self._board.chip(chip).FREE_READS

    def _pass_time(self) -> None:
        """Let time pass by the session's own DELAY, as any host would; hosts wait meanwhile."""
        goal, board, own, pacer = self._goal, self._board, self.own, self._pacer
        if goal is None or not self._alone or own is None:
            return
        from vbus.events.watch import passing

        def delay(due: int) -> None:
            until = min(due, board.now + LEASE)
            board.limit = until
            while not own.delay(until - board.now):
                board.catch_up()
                board.limit = until

        began = pacer.clock()
        for _ in passing(goal.met, goal.next_look, delay):
            if pacer.clock() - began > SLICE_NS:
                pacer.halt()
                asyncio.get_running_loop().call_soon(self._pass_time)
                return
        self.pause(goal.text)

    # -- telling ------------------------------------------------------------------------------

    def status(self) -> dict[str, Any]:
        """Return its state, for the page and for ``vbus ls``."""
        rate = "max" if self._pacer.free else self._board.rate
        return {
            "state": self.state, "text": self.text, "now_ps": str(self._board.now),
            "rate": rate if self._board.policy == "realtime" else None,
        }  # fmt: skip

    def _tell(self, state: str = "", text: str = "") -> None:
        if state:
            self.state, self.text = state, text
        for changed in tuple(self.changed):
            changed()
