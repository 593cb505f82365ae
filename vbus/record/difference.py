"""The first difference between a journal and a run: what it is, and the two sides of it."""

import copy
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from vbus.chips.packets import Cycle, Decoder, Packet
from vbus.core.signals import Observer, Violation
from vbus.record.again import StretchReplayer
from vbus.record.format import Entry
from vbus.record.view import violation_of


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first place where a run differs from its journal.

    Attributes:
        entry: number of the entry.
        when: instant (ps).
        what: what differs: ``"reply"``, ``"instant"``, ``"violation"``, ``"missing"`` (happened
            now, not in the journal), ``"unconsumed"`` (in the journal, did not happen) or
            ``"state"``.
        where: host, chip and call.
        recorded: the journal's side, decoded.
        now: the present side, decoded.
        clause: clause of the specification it falls under, or "".
    """

    entry: int
    when: int
    what: str
    where: str
    recorded: str
    now: str
    clause: str = ""


class Findings(Observer):
    """Violations by chip, and cycles that were ordered: what the journal has and what the run has.

    Each is kept until it is matched.

    Args:
        making: knows which entry is played.
    """

    def __init__(self, making: StretchReplayer) -> None:
        self.recorded: dict[str, deque[tuple[int, Violation]]] = {}
        self.found: dict[str, deque[tuple[int, Violation]]] = {}
        self._making: StretchReplayer = making
        self.expecting: int = 0
        """How much the journal has that the run has not found yet."""
        self.ordered: deque[tuple[int, tuple[Any, ...]]] = deque()
        """Bus cycles that came of orders, in the journal."""
        self.made: deque[tuple[int, tuple[Any, ...]]] = deque()
        """Those of the run."""

    def outside(self, order: str, values: list[object]) -> None:
        """Note a bus cycle of the run that came of an order."""
        if order == "made":
            self.made.append((self._making.entry, tuple(values)))

    def violation(self, violation: Violation) -> None:
        """Note one of the run."""
        self.found.setdefault(violation.chip, deque()).append((self._making.entry, violation))

    def expect(self, entry: Entry) -> None:
        """Note a violation, or a cycle that was ordered, of the journal."""
        self.expecting += 1
        if entry.op == "made":
            self.ordered.append((entry.number, entry.args))
            return
        violation = violation_of(entry)
        self.recorded.setdefault(violation.chip, deque()).append((entry.number, violation))

    def compare(self) -> Divergence | None:
        """Match pairs; return the first that differ. A chip finds its own in their order."""
        for chip, recorded in self.recorded.items():
            found = self.found.get(chip)
            while found and recorded:
                number, was = recorded.popleft()
                self.expecting -= 1
                _, now = found.popleft()
                if was != now:
                    lines = line_of(was), line_of(now)
                    return Divergence(number, was.when, "violation", chip, *lines, was.clause)
        while self.ordered and self.made:
            number, cycle = self.ordered.popleft()
            self.expecting -= 1
            _, again = self.made.popleft()
            if cycle != again:
                lines = cycle_line(cycle), cycle_line(again)
                return Divergence(number, cycle[0], "reply", _orderer(cycle), *lines)
        return None

    def rest(self) -> Divergence | None:
        """Return the earliest violation that stands on one side only."""
        left = [
            Divergence(number, v.when, "unconsumed", v.chip, line_of(v), "nothing", v.clause)
            for queue in self.recorded.values()
            for number, v in queue
        ] + [
            Divergence(number, v.when, "missing", v.chip, "nothing", line_of(v), v.clause)
            for queue in self.found.values()
            for number, v in queue
        ]
        for queue, what in ((self.ordered, "unconsumed"), (self.made, "missing")):
            for number, cycle in queue:
                sides = (cycle_line(cycle), "nothing")
                was, now = sides if what == "unconsumed" else sides[::-1]
                left.append(Divergence(number, cycle[0], what, _orderer(cycle), was, now))
        return min(left, key=attrgetter("entry"), default=None)


def cycle_line(cycle: tuple[Any, ...]) -> str:
    """Return a bus cycle that came of an order in one line."""
    when, _, _, write, address, data = cycle
    return f"{'w' if write else 'r'} {address:X} {data:02X} at {when} ps"


def _orderer(cycle: tuple[Any, ...]) -> str:
    return f"{cycle[1]}, {cycle[2]}: ordered cycle"


def line_of(violation: Violation) -> str:
    """Return a violation in one line."""
    v = violation
    return f"{v.rule} at {v.when} ps, measured {v.measured}, limit {v.limit}: {v.detail}"


class Side:
    """One side of a difference: a bus cycle, and the packet it turns out to be in.

    Args:
        decoder: of the chip, as it stood before the cycle; None if there is none.
        cycle: the cycle; None if this side has none.
        shown: its text in messages.
    """

    def __init__(self, decoder: Decoder | None, cycle: Cycle | None, shown: str) -> None:
        self._decoder: Decoder | None = copy.deepcopy(decoder)
        self._cycle: Cycle | None = cycle
        self._shown: str = shown
        self.packet: Packet | None = None
        if cycle is not None:
            self.feed(cycle)

    def known(self) -> bool:
        """Tell whether nothing that follows can tell more of the packet."""
        return self.packet is not None or self._decoder is None

    def feed(self, cycle: Cycle) -> None:
        """Take the cycle itself, or one that follows."""
        self._take(self._decoder.feed(cycle) if self._decoder is not None else ())

    def finish(self) -> None:
        """Nothing follows: a packet that is still open is cut short."""
        self._take(self._decoder.finish() if self._decoder is not None else ())

    def _take(self, packets: Iterable[Packet]) -> None:
        mine = (packet for packet in packets if self._cycle in packet.cycles)
        self.packet = self.packet or next(mine, None)

    def __str__(self) -> str:
        return f"{self._shown} in {self.packet.text}" if self.packet is not None else self._shown


def difference_of(number: int, when: int, what: str, where: str, sides: list[Side]) -> Divergence:
    """Return the difference between two sides that nothing follows; see :class:`Divergence`."""
    for side in sides:
        side.finish()
    clause = next((side.packet.clause for side in sides if side.packet is not None), "")
    recorded, now = map(str, sides)
    return Divergence(number, when, what, where, recorded, now, clause)
