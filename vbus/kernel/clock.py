"""A chip's CLK: clock cycles to picoseconds and back, without drift."""

from typing import Final

PS_PER_SECOND: Final = 10**12


class Clock:
    """A clock input of ``hz`` hertz whose cycle 0 starts at instant 0.

    Instants are always converted from the absolute cycle number, so no rounding adds up: the
    error of any edge is below one picosecond, for ever.
    """

    __slots__ = ("hz",)

    def __init__(self, hz: int) -> None:
        if hz <= 0:
            raise ValueError(f"a clock needs a frequency above 0 Hz, not {hz}")
        self.hz: int = hz

    def ps(self, cycle: int) -> int:
        """Return the instant (ps) at which ``cycle`` starts."""
        return cycle * PS_PER_SECOND // self.hz

    def cycle_at(self, ps: int) -> int:
        """Return the number of the cycle that is under way at instant ``ps``."""
        return ((ps + 1) * self.hz - 1) // PS_PER_SECOND

    def span(self, cycles: int) -> int:
        """Return how long ``cycles`` periods take (ps, rounded down), wherever they start."""
        return cycles * PS_PER_SECOND // self.hz

    def span_up(self, cycles: int) -> int:
        """Return the duration of ``cycles`` periods rounded up: what a minimum limit means."""
        return -(-cycles * PS_PER_SECOND // self.hz)
