"""Watching a board for a condition: what is looked at, and when; and the loop that waits for it."""

from collections.abc import Callable, Iterator
from typing import Final

from vbus.chips.base import CHANGE
from vbus.chips.packets import Packet
from vbus.circuit.circuit import Circuit
from vbus.circuit.stream import PacketReader
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, NEVER, Timer
from vbus.core.signals import Violation
from vbus.events.condition import COMMAND, VIOLATION, Condition, Course
from vbus.protocols.quantities import format_instant

LOOK: Final = MS
"""Longest time between two looks at a chip that an input may wake at any time (ps)."""


class Watch(PacketReader):
    """Looks at a board for a condition.

    Edges, violations and bus cycles are taken down as they happen; values are looked at by
    :meth:`look`, which the caller that moves time calls. With ``met`` the board's own time calls
    it: at each edge and bus cycle and at each sample of the chips concerned.

    Args:
        text: the condition.
        board: the board.
        what: what the condition is called in messages.
        met: is called at the instant at which it holds.
        anew: what holds from the beginning must cease to first, and again after each time.

    Raises:
        ConditionError: the condition is none, or names what the board does not have.
    """

    def __init__(
        self,
        text: str,
        board: Circuit,
        what: str = "condition",
        met: Callable[[], None] | None = None,
        anew: bool = False,
    ) -> None:
        self.condition: Condition = Condition(text, board, what)
        self.board: Circuit = board
        self._met: Callable[[], None] | None = met
        self._timer = self.timer(self._look) if met is not None else None
        self._watching = False
        self._anew = anew
        self._held = False
        """Whether it has held at the last look, if that counts."""
        self._course = Course(broken=dict(board.counters))
        self._chips = [board.chip(name) for name in self.condition.chips()]
        self._nets = [one.net for one in self.condition.levels.values() if one.net is not None]

    def timer(self, look: Callable[[], None]) -> Timer:
        """Return the timer by which the board's time looks: what hosts are promised is the same."""
        return self.board.kernel.onlooker(look)

    def begin(self) -> None:
        """Watch from now on."""
        self._watching = True
        for net in self._nets:
            net.observe(self)
        if self._chips or self.condition.events:
            self.board.observe(self)
        self._held = self._anew and self.look()
        if self._timer is not None:
            self._timer.at(self.board.now)

    def end(self) -> None:
        """Watch no more; again is harmless."""
        if not self._watching:
            return
        self._watching = False
        for net in self._nets:
            net.unobserve(self)
        if self._chips or self.condition.events:
            self.board.unobserve(self)
        if self._timer is not None:
            self._timer.cancel()

    # -- what happens -------------------------------------------------------------------------

    def reads(self) -> bool:
        """Tell whether the condition is about commands."""
        return bool(self.condition.commands)

    def packet(self, chip: str, packet: Packet) -> None:
        """Take down a command: it has come at the end of its packet."""
        self.happen(COMMAND, chip, packet.text)

    def edge(self, when: int, net: str, level: int) -> None:
        """Take down an edge."""
        self._course.change(net, level)
        self._wake()

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """A cycle may have changed what its chips tell."""
        self._wake()

    def violation(self, violation: Violation) -> None:
        """Take down a violation."""
        self.happen(VIOLATION, violation.chip, violation.rule)

    def happen(self, kind: str, chip: str, text: str) -> None:
        """Take down an event."""
        self._course.happen(kind, chip, text)
        self._wake()

    def _wake(self) -> None:
        if self._timer is not None:
            self._timer.at(self.board.now)

    # -- looking --------------------------------------------------------------------------------

    def look(self) -> bool:
        """Tell whether the condition holds now."""
        for chip in self._chips:
            chip.advance()
        self.condition.look(self._course)
        return self.condition.holds(self._course, self.board.now)

    def next_look(self) -> int:
        """Return the next instant at which it may hold though no host does anything (ps)."""
        return max(min(self._next_change(), self.board.next_due()), self.board.now + 1)

    def _next_change(self) -> int:
        """Return the same for a watch that observes edges (ps)."""
        changes = [chip.due(CHANGE) for chip in self._chips]
        return max(min([self._course.due, *changes]), self.board.now + 1)

    def _look(self) -> None:
        held, before = self.look(), self._held
        self._held = self._anew and held
        if held and not before and self._met is not None:
            self._met()
            return
        due = self._next_change()
        if self._chips:
            due = min(due, self.board.now + LOOK)
        if self._timer is not None and due < NEVER:
            self._timer.at(due)

    def flush(self) -> None:
        """Look now, if that is due, and not when time goes on."""
        if self._timer is not None and self._timer.due == self.board.now:
            self._timer.cancel()
            self._look()

    def found(self) -> str:
        """Return what the levels are, for people."""
        values = self._course.values
        return ", ".join(f"{key} is {values[key]}" for key in self.condition.levels)


class ConditionTracker:
    """Tells, look by look, whether a condition holds; a board not looked at before begins anew.

    Args:
        text: the condition.
        board: a board for its names, or one like it.

    Raises:
        ConditionError: it is none, or names what the board does not have.
    """

    def __init__(self, text: str, board: Circuit) -> None:
        self._text = text
        self._watch: Watch | None = None
        Watch(text, board)  # what makes no sense is refused now

    def __call__(self, board: Circuit) -> bool:
        """Tell whether it holds on a board that is up to date."""
        if self._watch is None or self._watch.board is not board:
            self._watch = Watch(self._text, board)
            self._watch.begin()
        return self._watch.look()


def passing(
    met: Callable[[], bool], next_look: Callable[[], int], pass_until: Callable[[int], None]
) -> Iterator[None]:
    """Let time pass until something holds; yield after each stretch, for others to have a turn.

    Args:
        met: whether it holds.
        next_look: the next instant at which to look again (ps).
        pass_until: lets time pass to an instant (ps).
    """
    while not met():
        pass_until(next_look())
        yield


def wait_until(board: Circuit, condition: str, within: int) -> int:
    """Let time pass until a condition holds, or not at all if it does; return that instant (ps).

    Args:
        board: a board whose time only the caller moves.
        condition: the condition.
        within: chip time in which it must come to hold (ps).

    Raises:
        VbusError: it makes no sense on this board, or has not come to hold in time.
    """
    watch = Watch(condition, board)
    watch.begin()
    begun = board.now
    end = begun + within

    def holds() -> bool:
        found = watch.look()
        if not found and board.now >= end:
            raise VbusError(not_met(watch, begun, within))
        return found

    try:
        for _ in passing(holds, lambda: min(watch.next_look(), end), board.pass_until):
            pass
    finally:
        watch.end()
        board.catch_up()
    return board.now


def not_met(watch: Watch, begun: int, within: int) -> str:
    """Return a sentence about a condition that has not come to hold."""
    found = watch.found()
    return (
        f'"{watch.condition.text}" has not come to hold within {format_instant(within)} of chip'
        f" time, since {format_instant(begun)}{'; ' if found else ''}{found}"
    )
