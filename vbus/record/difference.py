"""The first difference between a journal and a run: what it is, and the two sides of it."""

import copy
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

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


Found = tuple[int, Any]
"""Number of the entry; a violation, or a bus cycle as entries have it."""
ORDERED: Final = ""
"""In place of a chip's name: cycles that came of orders."""


class Findings(Observer):
    """Violations, and cycles that came of orders: what the journal has and what the run has.

    Each waits until it is matched; a chip finds its own in their order.

    Args:
        making: knows which entry is played.
    """

    def __init__(self, making: StretchReplayer) -> None:
        self.expecting: int = 0
        """How much the journal has that the run has not found yet."""
        self._making: StretchReplayer = making
        self._recorded: dict[str, deque[Found]] = {}
        """By name of the chip; those that were ordered by :data:`ORDERED`, and last."""
        self._found: dict[str, deque[Found]] = {}

    def outside(self, order: str, values: list[object]) -> None:
        """Note a bus cycle of the run that came of an order."""
        if order == "made":
            self._note(self._found, self._making.entry, tuple(values))

    def violation(self, violation: Violation) -> None:
        """Note one of the run."""
        self._note(self._found, self._making.entry, violation)

    def expect(self, entry: Entry) -> None:
        """Note a violation, or a cycle that was ordered, of the journal."""
        self.expecting += 1
        found = entry.args if entry.op == "made" else violation_of(entry)
        self._note(self._recorded, entry.number, found)

    @staticmethod
    def _note(queues: dict[str, deque[Found]], number: int, found: Any) -> None:
        chip = found.chip if isinstance(found, Violation) else ORDERED
        queues.setdefault(chip, deque()).append((number, found))

    def compare(self) -> Divergence | None:
        """Match pairs; return the first that differ."""
        # Chips come before ordered cycles: a violation is the cause, a cycle that differs its
        # effect.
        for chip in sorted(self._recorded, key=ORDERED.__eq__):
            recorded, found = self._recorded[chip], self._found.get(chip)
            while found and recorded:
                number, was = recorded.popleft()
                self.expecting -= 1
                _, now = found.popleft()
                if was != now:
                    what = "reply" if chip == ORDERED else "violation"
                    return _differs(number, what, was, line_of(was), line_of(now))
        return None

    def rest(self) -> Divergence | None:
        """Return the earliest violation, or ordered cycle, that stands on one side only."""
        left = [
            _differs(number, what, found, *(line_of(found), "nothing")[::way])
            for queues, what, way in (
                (self._recorded, "unconsumed", 1), (self._found, "missing", -1),
            )
            for chip in sorted(queues, key=ORDERED.__eq__)
            for number, found in queues[chip]
        ]  # fmt: skip
        # The first cause is what helps; all that follows from it is noise.
        return min(left, key=attrgetter("entry"), default=None)


def line_of(found: Any) -> str:
    """Return a violation, or a bus cycle that came of an order, in one line."""
    if isinstance(found, Violation):
        v = found
        return f"{v.rule} at {v.when} ps, measured {v.measured}, limit {v.limit}: {v.detail}"
    when, _, _, *cycle = found
    return f"{Cycle(when, *cycle)} at {when} ps"


def _differs(number: int, what: str, found: Any, recorded: str, now: str) -> Divergence:
    if isinstance(found, Violation):
        return Divergence(number, found.when, what, found.chip, recorded, now, found.clause)
    where = f"{found[1]}, {found[2]}: ordered cycle"
    return Divergence(number, found[0], what, where, recorded, now)


class Side:
    """One side of a difference: a bus cycle, and the packet it turns out to be in.

    Args:
        decoder: of the chip, as it stood before the cycle; None if there is none.
        cycle: the cycle; None if this side has none.
        shown: its text in messages.
    """

    def __init__(self, decoder: Decoder | None, cycle: Cycle | None, shown: str) -> None:
        # A copy: both sides go on from the same state of the decoder, each with bytes of its own.
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
