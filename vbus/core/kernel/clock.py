"""A chip's CLK: clock cycles to picoseconds and back, without drift."""

from itertools import pairwise
from math import gcd
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.instants import END, NEVER
from vbus.core.state import Names

PS_PER_SECOND: Final = 10**12
MILLION: Final = 10**6
HELD: Final = END
"""While a clock stands, what would be due so many ps later is due at this instant plus that: time
does not come there."""
_NEVER: Final[i64] = int(NEVER)
MOST_FAST: Final = 2
"""Largest speed of a saved clock, as a multiple of its frequency."""
_STANDING: Final = 1 << 62
"""Period of a clock that stands (ps)."""

Course = tuple[int, int, int, int]
"""A clock from one cycle on: that cycle, its instant (ps), and the period as a fraction (ps)."""


class Clock:
    """A clock input of ``hz`` hertz whose cycle 0 starts at instant 0.

    Instants are always converted from the absolute cycle number, so no rounding adds up: the
    error of any edge is below one picosecond, for ever. Instants and cycle numbers fit a machine
    word up to the end of time, at any frequency below 1 THz.

    An oscillator that is off, or fails, has another course from some cycle on; see :meth:`run` and
    :meth:`stop`. Cycles are counted on, and what was before stays as it was.
    """

    STATE: ClassVar[Names] = ("courses: list[(i64, i64, int, int), ...]",)
    DERIVED: ClassVar[Names] = ("_courses", "_den", "_last", "_num", "_plain", "stopped")

    def __init__(self, hz: int) -> None:
        if hz <= 0:
            raise ValueError(f"a clock needs a frequency above 0 Hz, not {hz}")
        if hz >= PS_PER_SECOND:
            raise ValueError(f"a clock needs a frequency below 1 THz, not {hz} Hz")
        self.hz: int = hz
        """What the board file says, whatever the oscillator does (Hz)."""
        self.stopped: bool = False
        """Whether it stands now."""
        self._courses: list[Course] = []
        self._num: i64 = 1
        self._den: i64 = 1
        self._plain: bool = True
        self._last: i64 = 0
        self._take([(0, 0, PS_PER_SECOND, hz)])

    def _take(self, courses: list[Course]) -> None:
        """Go on as the last of these says. A period is _num / _den ps in lowest terms."""
        start, since, num, den = courses[-1]
        self._courses = courses
        shared = gcd(num, den)
        self._num, self._den = num // shared, den // shared
        # Where their product fits 62 bits, so does every number on the way from a cycle to its
        # instant and back.
        self._plain = len(courses) == 1 and (num // shared) * (den // shared) < 1 << 62
        self.stopped = num == _STANDING
        # The last cycle whose instant is a number of 63 bits: what lies beyond never comes.
        last = start if self.stopped else start + (NEVER - since) * den // num
        self._last = min(last, NEVER)

    def ps(self, cycle: i64) -> i64:
        """Return the instant (ps) at which ``cycle`` starts; NEVER beyond the end of time."""
        if cycle > self._last:
            return _NEVER
        if self._plain:
            # 1 MHz, 8 MHz and most clocks of boards have a period of whole picoseconds.
            if self._den == 1:
                return cycle * self._num
            # In two parts, so that the product of a late cycle fits a machine word.
            whole = cycle // self._den
            return whole * self._num + (cycle - whole * self._den) * self._num // self._den
        exact: int = cycle
        return self._exact_ps(exact)

    def cycle_at(self, ps: i64) -> i64:
        """Return the number of the cycle that is under way at instant ``ps``."""
        if self._plain:
            whole = ps // self._num
            into = ps - whole * self._num
            # The inverse of ps(), which rounds down: the last cycle that starts at this instant or
            # before.
            return whole * self._den + ((into + 1) * self._den - 1) // self._num
        exact: int = ps
        return self._exact_cycle(exact)

    def _exact_ps(self, cycle: int) -> int:
        start, since, num, den = self._courses[0]
        for course in reversed(self._courses):
            # From the last course back: nearly every question is about now.
            if cycle >= course[0]:
                start, since, num, den = course
                break
        return since + (cycle - start) * num // den

    def _exact_cycle(self, ps: int) -> int:
        start, since, num, den = self._courses[0]
        for course in reversed(self._courses):
            if ps >= course[1]:
                start, since, num, den = course
                break
        return start + ((ps - since + 1) * den - 1) // num

    def span(self, cycles: i64) -> i64:
        """Return how long ``cycles`` periods take (ps, rounded down), wherever they start.

        Of a clock that stands, as long as they would if it ran as the board file says.
        """
        if self._plain:
            return self.ps(cycles)
        # Beyond machine words: a clock that has failed may have any period.
        exact: int = cycles
        num, den = self._courses[-1][2:] if not self.stopped else (PS_PER_SECOND, self.hz)
        return min(exact * num // den, NEVER)

    def span_up(self, cycles: i64) -> i64:
        """Return the duration of ``cycles`` periods rounded up: what a minimum limit means."""
        return -self.span(-cycles)

    # -- oscillators that fail -----------------------------------------------------------------

    @property
    def frequency(self) -> float:
        """What it does now (Hz): :attr:`hz` if nothing is wrong, 0.0 if it stands."""
        _, _, num, den = self._courses[-1]
        return 0.0 if self.stopped else float(PS_PER_SECOND * den) / float(num)

    def run(self, now: int, ppm: int) -> None:
        """Run on ``ppm`` millionths above the nominal frequency, below if negative.

        The period under way at ``now`` keeps its length, the next ones have the new one. A clock
        that stood begins a period at ``now``.
        """
        under_way: int = self.cycle_at(now)
        start = under_way + 1
        # A running oscillator ends its period; one that stood begins anew.
        since = now if self.stopped else self.ps(start)
        self._change((start, since, PS_PER_SECOND * MILLION, self.hz * (MILLION + ppm)))

    def stop(self, now: int) -> None:
        """Stand: the period under way at ``now`` does not end."""
        # A clock that stands has no period that could be under way again.
        if not self.stopped:
            under_way: int = self.cycle_at(now)
            self._change((under_way, self.ps(under_way), _STANDING, 1))

    def _change(self, course: Course) -> None:
        """Take another course, in the place of any that has not begun by then."""
        courses = self._courses[:]
        while len(courses) > 1 and courses[-1][0] >= course[0]:
            courses.pop()
        # No caller converts instants that long past.
        self._take([*courses[-15:], course])

    @property
    def courses(self) -> list[Course]:
        """The courses it has taken, none if it is as it was made."""
        return self._courses if len(self._courses) > 1 else []

    @courses.setter
    def courses(self, courses: list[Course]) -> None:
        """Set the courses of a saved clock.

        Raises:
            ValueError: one runs too fast, or does not begin where the one before has led.
        """
        for _, _, num, den in courses:
            # A snapshot may come from anywhere: a clock of any speed would make samples without
            # end.
            if min(num, den) <= 0 or den * PS_PER_SECOND > MOST_FAST * self.hz * num:
                raise ValueError(f"a clock of {self.hz} Hz with a period of {num}/{den} ps")
        for (start, since, num, den), (then, when, _, _) in pairwise(courses):
            there = start + ((when - since + 1) * den - 1) // num
            # A course begins with the cycle under way, or the next one.
            if not there <= then <= there + 1:
                raise ValueError(f"a clock that jumps from cycle {there} to {then}")
        self._take(courses or [(0, 0, PS_PER_SECOND, self.hz)])
