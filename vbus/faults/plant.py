"""A plant with something broken: between a chip and the plant it really drives."""

from typing import ClassVar, Final

from vbus.core.signals import Plant
from vbus.core.state import Names

SHARE: Final = 0
"""The encoder shows a part of the motion: all of it, none, or backwards."""
STUCK_A: Final = 1
STUCK_B: Final = 2
PLAY: Final = 3

WHOLE: Final = 1 << 20
"""A share of 1."""

_A: Final = (0, 1, 1, 0)
_B: Final = (0, 0, 1, 1)
_HALVINGS: Final = 60
"""An instant is found to 2^-60 of a period: finer than a float tells instants apart."""


class FaultyPlant(Plant):
    """Stands in for ``inner`` on one axis while a fault needs it.

    The encoder's count is a function of the shaft's: ``shown`` when the shaft was at ``anchor``,
    and from there on as :attr:`mode` says. Changes take effect between two periods.
    """

    STATE: ClassVar[Names] = (
        "count", "anchor", "shown", "_pulses", "_low", "_before", "_stood: bool", "_touched: bool",
        "inner: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "frozen", "drive_sign", "powered", "lose_every", "mode", "share", "level", "gap", "index",
        "second_index", "pulsed",
    )  # fmt: skip

    def __init__(self, inner: Plant) -> None:
        super().__init__()
        self.inner: Plant = inner
        self.switches = inner.switches
        self.count = inner.count
        self.frozen: bool = False
        """The shaft stands."""
        self.drive_sign: int = 1
        self.powered: bool = True
        self.lose_every: int = 0
        self.mode: int = SHARE
        self.share: int = WHOLE
        self.level: int = 1
        self.gap: int = 0
        self.index: bool = True
        self.second_index: int = 0
        self.anchor: int = inner.count
        self.shown: int = inner.count
        self.pulsed: int = 0
        """Counts that pulses on a channel hold it off by."""
        self._pulses: int = 0
        self._low: int = 0
        self._before: int = inner.count
        self._stood: bool = False
        self._touched: bool = True

    @property
    def plain(self) -> bool:
        """Whether the inner plant alone would now do the same."""
        return (
            not self.frozen and self.drive_sign == 1 and self.powered and not self.lose_every
            and self.mode == SHARE and self.share == WHOLE and self.index
            and not self.second_index and self.shown == self.anchor
        )  # fmt: skip

    # -- changes ------------------------------------------------------------------------------

    def take_hold(self) -> None:
        """A change comes: count on from where shaft and encoder stand."""
        shown = self._show(self.inner.count)
        self.anchor, self.shown = self.inner.count, shown
        self._low = 0
        self._touched = True

    def jump(self, counts: int) -> None:
        """Move the encoder against the shaft."""
        self.take_hold()
        self.shown += counts
        self.count += counts

    # -- what the encoder shows -----------------------------------------------------------------

    def _show(self, count: int) -> int:
        """Return what the encoder shows with the shaft at ``count``."""
        moved = count - self.anchor
        if self.mode == SHARE:
            return self.shown + moved * self.share // WHOLE
        if self.mode == PLAY:
            return self.shown + self._play(moved)
        return self.shown + self._decoder_offset(count) - self._decoder_offset(self.anchor)

    def _play(self, moved: int) -> int:
        if moved < self._low:
            return moved
        return max(self._low, moved - self.gap)

    def _decoder_offset(self, count: int) -> int:
        """Place of the decoder, 0 or 1 from a corner, while a channel does not move."""
        if self.mode == STUCK_A:
            return _B[count & 3] if self.level else -_B[count & 3]
        return _A[count & 3] if self.level == 0 else -_A[count & 3]

    # -- periods ------------------------------------------------------------------------------

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        self.inner.prepare(period)

    def _begin(self) -> bool:
        """A period begins; tell whether the shaft may move."""
        self._before = self.count
        self._stood = self.frozen
        return not self.frozen

    def _end(self) -> int:
        if self.mode == PLAY:
            self._low = self._play(self.inner.count - self.anchor)
        count = self._show(self.inner.count)
        self._touched = False
        self.count = count
        return count

    def drive(self, command: float, error: int) -> int:
        """Run one period with a servo command."""
        if self._begin():
            if self.powered:
                self.inner.drive(command * self.drive_sign, error * self.drive_sign)
            else:
                self.inner.drive(0.0, 0)
        return self._end()

    def pulses(self, steps: int) -> int:
        """Run one period with step pulses."""
        if self._begin():
            steps = steps * self.drive_sign if self.powered else 0
            if self.lose_every:
                total = self._pulses + abs(steps)
                lost = total // self.lose_every
                self._pulses = total % self.lose_every
                steps -= lost if steps > 0 else -lost
            self.inner.pulses(steps)
        return self._end()

    def phases(self, a: float, b: float, c: float) -> int:
        """Run one period with phase currents; a reversed motor has two of them exchanged."""
        if self._begin():
            if not self.powered:
                self.inner.phases(0.0, 0.0, 0.0)
            elif self.drive_sign < 0:
                self.inner.phases(a, *((c, b) if c != 0.0 else (-b, 0.0)))
            else:
                self.inner.phases(a, b, c)
        return self._end()

    # -- the course of a period -----------------------------------------------------------------

    def count_at(self, fraction: float) -> int:
        """Return the count at ``fraction`` of the last period."""
        if self._stood:
            return self.count
        if self.mode == PLAY:
            ahead: int = self.count - self._before
            return self._before + int(ahead * fraction)
        return self._show(int(self.inner.count_at(fraction)))

    def fraction_at(self, count: int) -> float:
        """Return when in the last period the encoder first reached ``count``."""
        if self.mode == SHARE and self.share == WHOLE and not self._stood:
            return float(self.inner.fraction_at(count - self.shown + self.anchor))
        start = self.count_at(0.0)
        if count == start:
            return 0.0
        rising = count > start
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            here = self.count_at(middle)
            if (here >= count) if rising else (here <= count):
                high = middle
            else:
                low = middle
        return high

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        """Tell whether moving from ``start`` to ``end`` enters an index, and which."""
        if not self.index or self.mode in (STUCK_A, STUCK_B):
            return False, 0
        found, count = self._index(start, end)
        if self.second_index:
            again, other = self._index(start - self.second_index, end - self.second_index)
            other += self.second_index
            if again and (not found or abs(other - start) < abs(count - start)):
                return True, other
        return found, count

    def _index(self, start: int, end: int) -> tuple[bool, int]:
        # The disc turns with what the encoder shows, but for jumps of the count and swapped wires.
        sign = -1 if self.share < 0 else 1
        found, count = self.inner.index_between(
            self.anchor + (start - self.shown) * sign, self.anchor + (end - self.shown) * sign
        )
        return (True, self.shown + (int(count) - self.anchor) * sign) if found else (False, 0)

    def resting(self) -> bool:
        """Whether another period with the same drive would leave everything as it is."""
        return not self._touched and (self._stood or self.inner.resting())
