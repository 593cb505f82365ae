"""What sessions ask of time."""

from collections.abc import Callable
from typing import Final

from mypy_extensions import i64, mypyc_attr

from vbus.core.wall_clock import monotonic_ns

_WEEKS_NS: Final = 1 << 51
_USUAL: Final = 1 << 10
"""Chip time that passes in less wall time, at such a rate, is no more than 2^61 ps."""


def chip_time(elapsed: int, ps_per_ns: tuple[int, int]) -> int:
    """Return the chip time (ps) that passes in ``elapsed`` wall time (ns), at a rate as a fraction.

    At the rate 1, and at whole parts of it, in machine words for the first 26 days.
    """
    numerator, denominator = ps_per_ns
    if elapsed >= _WEEKS_NS or numerator >= _USUAL:
        return elapsed * numerator // denominator
    ns: i64 = elapsed
    passed: i64 = ns * numerator // denominator
    return passed


@mypyc_attr(allow_interpreted_subclasses=True)
class TimeSource:
    """Time as a session knows it; by itself that of chips elsewhere, which no pacer here moves.

    Args:
        clock: wall time in ns; for tests.
    """

    def __init__(self, clock: Callable[[], int] = monotonic_ns) -> None:
        self.clock: Callable[[], int] = clock
        """Wall time (ns)."""
        self.real: bool = True
        """Whether time runs on whatever hosts do."""
        self.halted: bool = False
        """Whether time stands still, and what hosts ask for is kept for later."""

    @property
    def now(self) -> int:
        """Chip time (ps); 0 where that is not known."""
        return 0

    def catch_up(self) -> bool:
        """Bring the chips to the present; tell whether they are there."""
        return True

    def touched(self) -> None:
        """A host has been served."""

    def wake_at(self, instant: int, callback: Callable[[], None]) -> None:
        """Call back when chip time may run to ``instant`` (ps)."""

    def forget(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` no more."""
