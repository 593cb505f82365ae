"""Encoder inputs that are driven as wires: noise filter, 4x decoder and index.

Used where something drives the A, B and index nets (LM-POS-1, MCP-ENC-1, PMD-ENC-1); a plant hands
over counts instead. Time is an integer in any unit the chip likes, as long as it is the same one
everywhere (ps, or periods of the filter clock).

Nothing calls back. The chip tells every edge with :meth:`Quadrature.edge`, and takes what has come
of earlier ones, each with its instant, by calling :meth:`Quadrature.settle` until it returns 0.
"""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import AcLimits
from vbus.core.kernel import NEVER
from vbus.core.state import Names

COUNTED: Final = 1
"""The count went up or down by one; :attr:`Quadrature.direction` says which."""
SKIPPED: Final = 2
"""A and B changed together: a state was lost, nothing was counted."""
INDEX_FELL: Final = 4
INDEX_ROSE: Final = 8
ALL_LOW: Final = 16
"""The state A = B = index = 0 was entered (together with INDEX_FELL: by the index)."""

SHORT_DWELL: Final = 1
"""The state of A and B that ended lasted less than its limit."""
SHORT_PULSE: Final = 2
"""The level of A or B that ended lasted less than its limit."""
INDEX_INSIDE: Final = 4
"""The index moved while A and B stood low: set-up or hold time below 0."""

LONG_AGO: Final = -(1 << 60)

_NEVER: Final[i64] = int(NEVER)

# Place of a state (A in bit 1, B in bit 0) in the order of counting up: 00, 10, 11, 01.
_PLACE: Final = (0, 3, 1, 2)


class InputFilter:
    """An input, or a pair taken together, whose level must last before it is believed.

    Args:
        dwell: how long; a level that lasts exactly this long is believed. 0 believes at once.
        level: level at the start.

    Attributes:
        dwell: how long a level must last.
        level: level believed.
        raw: level at the pin.
        since: instant at which ``raw`` began.
    """

    STATE: ClassVar[Names] = ("dwell", "level", "raw", "since", "_floor")

    def __init__(self, dwell: int, level: int = 1) -> None:
        self.dwell: i64 = dwell
        self.level: int = level
        self.raw: int = level
        self.since: i64 = LONG_AGO
        self._floor: i64 = LONG_AGO

    def edge(self, now: int, level: int) -> None:
        """The pin takes ``level`` at instant ``now``; whatever was due before has been taken."""
        if level != self.raw:
            self.raw = level
            self.since = now

    def due(self) -> i64:
        """Return the instant at which the level at the pin will be believed, if it lasts."""
        if self.raw == self.level:
            return _NEVER
        due = self.since + self.dwell
        # A shorter dwell believes nothing in the past.
        return due if due > self._floor else self._floor

    def take(self) -> None:
        """Believe the level at the pin."""
        self.level = self.raw

    def set_dwell(self, now: int, dwell: int) -> None:
        """Change the dwell from ``now`` on; nothing is believed before ``now`` because of it."""
        self.dwell = dwell
        self._floor = now

    def preset(self, level: int) -> None:
        """Take ``level`` as what has been there for ever."""
        self.level = self.raw = level
        self.since = self._floor = LONG_AGO


class Quadrature:
    """A, B and index inputs with their filters, and the count they make. A before B counts up.

    Args:
        dwell: how long A and B must stand still before they are believed.
        index_dwell: the same for the index.
        together: the dwell is that of the *state* of A and B, so that a state which is too short
            is lost (LM-POS-1); otherwise A and B are filtered each on its own (MCP-ENC-1,
            PMD-ENC-1).
        dwell_limit: shortest legal state; :meth:`edge` returns one that is shorter.
        pulse_limit: shortest legal level of A or B.

    Attributes:
        count: what has been counted; plain, never wraps.
        direction: 1 or -1, the direction of the last count.
        at: instant of what :meth:`settle` returned last.
        dwell: how long the last state of A and B lasted, when :meth:`edge` ended it.
        pulse: how long the last level of A or B lasted, when :meth:`edge` ended it.
    """

    STATE: ClassVar[Names] = (
        "count", "direction", "at", "dwell", "pulse", "_state", "_since", "_a_since", "_b_since",
        "_a: part", "_b: part", "_index: part",
    )  # fmt: skip

    def __init__(
        self,
        dwell: int,
        index_dwell: int,
        *,
        together: bool = False,
        dwell_limit: int = 0,
        pulse_limit: int = 0,
    ) -> None:
        self._together: bool = together
        # Together, the first filter holds the whole state and the second one stays as it is.
        self._a: InputFilter = InputFilter(dwell, 0)
        self._b: InputFilter = InputFilter(dwell, 0)
        self._index: InputFilter = InputFilter(index_dwell)
        self.dwell_limit: int = dwell_limit
        self.pulse_limit: int = pulse_limit
        self.count: int = 0
        self.direction: int = 1
        self.at: int = 0
        self.dwell: int = 0
        self.pulse: int = 0
        # The pins as they are, and since when.
        self._state: int = 0
        self._since: int = LONG_AGO
        self._a_since: int = LONG_AGO
        self._b_since: int = LONG_AGO

    @property
    def state(self) -> int:
        """State of A (bit 1) and B (bit 0) that is believed."""
        if self._together:
            return self._a.level
        return self._a.level << 1 | self._b.level

    @property
    def filter_dwell(self) -> int:
        """For how long a channel must stand for its filter to believe it."""
        return self._a.dwell

    def preset(self, a: int, b: int, index: int) -> None:
        """Take these levels as what has been there for ever; nothing is counted."""
        self._state = a << 1 | b
        self._a.preset(self._state if self._together else a)
        self._b.preset(b)
        self._index.preset(index)
        self._since = self._a_since = self._b_since = LONG_AGO

    def edge(self, now: int, a: int, b: int, index: int) -> int:
        """The pins have these levels from instant ``now`` on.

        Returns:
            0, or :data:`SHORT_DWELL`, :data:`SHORT_PULSE`, :data:`INDEX_INSIDE` added up, with
            the lengths in :attr:`dwell` and :attr:`pulse`.

        Raises:
            ValueError: something was due by ``now`` that :meth:`settle` has not taken.
        """
        if self.due() <= now:
            raise ValueError(f"settle what was due at {self.due()} before telling an edge at {now}")
        found = 0
        state = a << 1 | b
        old = self._state
        if index != self._index.raw:
            # T3 of LM628 and MC1241A: set-up and hold of the index around A and B low.
            if state == 0 and old == 0:
                found = INDEX_INSIDE
            self._index.edge(now, index)
        if state != old:
            self.dwell = now - self._since
            self.pulse = NEVER
            if (state ^ old) & 2:
                self.pulse = now - self._a_since
                self._a_since = now
            if (state ^ old) & 1:
                self.pulse = min(self.pulse, now - self._b_since)
                self._b_since = now
            # T2 and T1 of LM628 and MC1241A.
            if self.dwell < self.dwell_limit:
                found |= SHORT_DWELL
            if self.pulse < self.pulse_limit:
                found |= SHORT_PULSE
            self._state = state
            self._since = now
            self._a.edge(now, state if self._together else a)
            if not self._together:
                self._b.edge(now, b)
        return found

    def due(self) -> i64:
        """Return the instant of the next thing :meth:`settle` will return if no edge comes."""
        due = self._a.due()
        other = self._b.due()
        if other < due:
            due = other
        other = self._index.due()
        return other if other < due else due

    def settle(self, now: i64) -> int:
        """Take the earliest thing due by ``now``.

        Call it until it returns 0, before telling an edge at ``now``: what is due at an instant
        comes before the edges of that instant. At one instant the index comes before A and B, so
        that an index without set-up time is seen.

        Returns:
            0 if nothing is due, else :data:`COUNTED`, :data:`SKIPPED`, :data:`INDEX_FELL`,
            :data:`INDEX_ROSE` and :data:`ALL_LOW` added up; the instant is in :attr:`at`.
        """
        due = self.due()
        if due > now:
            return 0
        self.at = due
        if self._index.due() == due:
            self._index.take()
            if self._index.level:
                return INDEX_ROSE
            return INDEX_FELL | ALL_LOW if self.state == 0 else INDEX_FELL
        old = self.state
        if self._a.due() == due:
            self._a.take()
        if self._b.due() == due:
            self._b.take()
        state = self.state
        turn = (_PLACE[state] - _PLACE[old]) & 3
        if turn == 2:
            # LM-POS-1, MCP-ENC-1, PMD-ENC-1: two states on, by either way: nothing is counted.
            found = SKIPPED
        else:
            # LM-POS-1, MCP-ENC-1, PMD-ENC-1: A before B counts up.
            self.direction = 1 if turn == 1 else -1
            self.count += self.direction
            found = COUNTED
        # LM-POS-3, PMD-CAP-1: the state in which all three are low is entered.
        if state == 0 and self._index.level == 0:
            found |= ALL_LOW
        return found

    def set_dwell(self, now: int, dwell: int, index_dwell: int) -> None:
        """Change the dwells from ``now`` on (the MCP-1200's filter clock divider)."""
        self._a.set_dwell(now, dwell)
        self._b.set_dwell(now, dwell)
        self._index.set_dwell(now, index_dwell)


def judge_inputs(ac: AcLimits, inputs: Quadrature, found: int) -> bool:
    """File what an edge of A, B or index has broken (T1 to T3); tell whether the index is lost.

    Args:
        ac: the limits of the chip whose inputs they are.
        inputs: the decoder that took the edge.
        found: what it found.
    """
    lost = False
    for bit, symbol, measured in (
        (SHORT_DWELL, "T2", inputs.dwell),
        (SHORT_PULSE, "T1", inputs.pulse),
        (INDEX_INSIDE, "T3", -1),
    ):
        if found & bit:
            lost = ac.short(symbol, measured)
    return lost and bool(found & INDEX_INSIDE)
