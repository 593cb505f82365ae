"""From turns and seconds to the numbers motion chips count in, and back."""

from fractions import Fraction
from typing import NamedTuple

Number = int | float | Fraction


class Units(NamedTuple):
    """Counts per turn and seconds per sample of one axis; all conversions round to nearest.

    A chip's velocity is counts per sample, its acceleration counts per sample per sample, both
    as fixed-point numbers with ``fraction`` bits behind the point.

    Attributes:
        counts: encoder counts per turn (four per encoder line), or per whatever unit is wanted.
        sample: length of a sample (PMD: cycle) in seconds, exactly.
        fraction: bits behind the point of velocity and acceleration.
    """

    counts: int
    sample: Fraction
    fraction: int = 16

    @classmethod
    def of_clock(cls, counts: int, hz: int, clocks: int = 2048) -> "Units":
        """Return the units of a chip at ``hz`` whose sample takes ``clocks`` clock periods.

        2048 is the LM628's and LM629's; the MC1241A's cycle takes 13568.
        """
        return cls(counts, Fraction(clocks, hz))

    def position(self, turns: Number) -> int:
        """Return turns as counts."""
        # Fractions: turns as floats are exact numbers, and one rounding comes at the end.
        return round(Fraction(turns) * self.counts)

    def velocity(self, turns_per_s: Number) -> int:
        """Return turns per second in 1/65536 counts per sample."""
        return round(Fraction(turns_per_s) * self._scale(1))

    def acceleration(self, turns_per_s2: Number) -> int:
        """Return turns per second per second in 1/65536 counts per sample per sample."""
        return round(Fraction(turns_per_s2) * self._scale(2))

    def turns(self, counts: int) -> float:
        """Return counts as turns."""
        return float(Fraction(counts, self.counts))

    def turns_per_s(self, velocity: int) -> float:
        """Return a velocity in 1/65536 counts per sample as turns per second."""
        return float(velocity / self._scale(1))

    def turns_per_s2(self, acceleration: int) -> float:
        """Return an acceleration in 1/65536 counts per sample per sample in turns/s/s."""
        return float(acceleration / self._scale(2))

    def _scale(self, order: int) -> Fraction:
        return self.counts * self.sample**order * (1 << self.fraction)
