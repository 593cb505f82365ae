"""Where encoder counts come from: a plant's course through the sample, or the A, B, /IN nets."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.motion.quadrature import Quadrature
from vbus.core.kernel import NEVER, Clock
from vbus.core.signals import Plant
from vbus.core.state import Names

_NEVER: Final[i64] = int(NEVER)
"""As a machine word: a compiled core keeps a literal this large as an object."""


class EncoderCounts:
    """Counts and index of one axis.

    With a plant the whole course of a sample is known at its start, so the index has its exact
    instant inside it. Without one, whatever drives the nets is decoded (LM-POS-1, LM-POS-3).

    Args:
        clock: the chip's clock.

    Attributes:
        plant: the mechanics, if any.
        inputs: filter and decoder of the nets; in ps.
        index_at: instant of the plant's next index in this sample that :meth:`seek` found.
        index_count: count at that index.
    """

    STATE: ClassVar[Names] = (
        "plant: part | None", "inputs: part", "index_at", "index_count", "_start", "_end", "_from",
        "_to",
    )  # fmt: skip

    def __init__(self, clock: Clock) -> None:
        # LM-POS-1, LM-TIM-2: a state that lasts less than 8 clock periods is not recognised.
        dwell = ds.AC.minimum("T2", clock)
        self.plant: Plant | None = None
        self.inputs: Quadrature = Quadrature(
            dwell, 0, together=True, dwell_limit=dwell, pulse_limit=ds.AC.minimum("T1", clock)
        )
        self.index_at: i64 = _NEVER
        self.index_count: i64 = 0
        self._start: i64 = 0
        self._end: i64 = 1
        self._from: i64 = 0
        self._to: i64 = 0

    def connect(self, plant: Plant, period: float) -> None:
        """Attach the mechanics; ``period`` is the sample in seconds."""
        plant.prepare(period)
        self.plant = plant
        self._from = self._to = plant.count

    def run(self, command: float, following: i64) -> i64:
        """Let the plant run through one sample with the drive that holds; return the count."""
        self.index_at = _NEVER
        if self.plant is None:
            return self.inputs.count
        self._from = self._to
        count = self.plant.drive(command, following)
        self._to = count
        return count

    def lasts(self, start: i64, end: i64) -> None:
        """The last sample lasts from ``start`` to ``end``: say so before asking for instants."""
        # A clock that stands gives both the same instant, and a length of 0 would divide.
        self._start = start if start < end else end - 1
        self._end = end

    def due(self) -> i64:
        """Return the instant of the next index to capture, or of the nets' next settled state."""
        if self.plant is None:
            return self.inputs.due()
        return self.index_at

    def count(self) -> i64:
        """Return the count at the end of the sample; from the nets, the count now."""
        if self.plant is None:
            return self.inputs.count
        return self._to

    def count_at(self, when: i64) -> i64:
        """Return the count at instant ``when`` of the present sample."""
        if self.plant is None:
            return self.inputs.count
        fraction = float(when - self._start) / float(self._end - self._start)
        return self.plant.count_at(min(max(fraction, 0.0), 1.0))

    def seek(self, after: i64) -> None:
        """Look for the plant's first index later than ``after`` in the present sample."""
        self.index_at = _NEVER
        if self.plant is None:
            return
        found, count = self.plant.index_between(self._from, self._to)
        while found:
            # One product, rounded down: the same bits on every machine.
            into: i64 = int(self.plant.fraction_at(count) * float(self._end - self._start))
            at = self._start + into
            if at > after:
                self.index_at = at if at < self._end else self._end
                self.index_count = count
                return
            before, end = count, self._to
            found, count = self.plant.index_between(before, end)
            # Each lies further on, or a wrong plant's would be looked for for ever.
            found = found and (before < count <= end or end <= count < before)

    def resting(self) -> bool:
        """Whether another sample with the same drive would leave everything as it is."""
        return self._from == self._to and (self.plant is None or self.plant.resting())
