"""A chip's CLK: clock cycles to picoseconds and back, without drift."""

from math import gcd
from typing import Final

from mypy_extensions import i64

from vbus.kernel.kernel import NEVER

PS_PER_SECOND: Final = 10**12
_NEVER: Final[i64] = int(NEVER)


class Clock:
    """A clock input of ``hz`` hertz whose cycle 0 starts at instant 0.

    Instants are always converted from the absolute cycle number, so no rounding adds up: the
    error of any edge is below one picosecond, for ever. Instants and cycle numbers fit a machine
    word up to the end of time, at any frequency below 1 THz.
    """

    __slots__ = ("_den", "_last", "_num", "_short", "hz")

    def __init__(self, hz: int) -> None:
        if hz <= 0:
            raise ValueError(f"a clock needs a frequency above 0 Hz, not {hz}")
        if hz >= PS_PER_SECOND:
            raise ValueError(f"a clock needs a frequency below 1 THz, not {hz} Hz")
        self.hz: int = hz
        # A period is _num / _den ps in lowest terms. Where their product fits 62 bits, so does
        # every number on the way from a cycle to its instant and back.
        shared = gcd(PS_PER_SECOND, hz)
        self._short: bool = (PS_PER_SECOND // shared) * (hz // shared) < 1 << 62
        self._num: i64 = PS_PER_SECOND // shared
        self._den: i64 = hz // shared if self._short else 1
        self._last: i64 = NEVER * hz // PS_PER_SECOND

    def ps(self, cycle: i64) -> i64:
        """Return the instant (ps) at which ``cycle`` starts; NEVER beyond the end of time."""
        if cycle > self._last:
            return _NEVER
        if self._short:
            whole = cycle // self._den
            return whole * self._num + (cycle - whole * self._den) * self._num // self._den
        exact: int = cycle
        return exact * PS_PER_SECOND // self.hz

    def cycle_at(self, ps: i64) -> i64:
        """Return the number of the cycle that is under way at instant ``ps``."""
        if self._short:
            whole = ps // self._num
            into = ps - whole * self._num
            return whole * self._den + ((into + 1) * self._den - 1) // self._num
        exact: int = ps
        return ((exact + 1) * self.hz - 1) // PS_PER_SECOND

    def span(self, cycles: i64) -> i64:
        """Return how long ``cycles`` periods take (ps, rounded down), wherever they start."""
        return self.ps(cycles)

    def span_up(self, cycles: i64) -> i64:
        """Return the duration of ``cycles`` periods rounded up: what a minimum limit means."""
        return -self.ps(-cycles)
