"""Faults of a chip's oscillator: it stands, or is off its frequency."""

from collections.abc import Callable
from typing import Final

from vbus.chips.base import Chip
from vbus.core.kernel import HELD, NEVER
from vbus.core.kernel.clock import Course
from vbus.core.signals import Plant
from vbus.faults.armed import Armed
from vbus.faults.upsets import ChipFaults, upsets_of

STOPPED: Final = "clock_stopped"
CLOCKS: Final = frozenset({STOPPED, "clock_off"})
"""Faults of this kind, by name."""


class ClockFaults:
    """What is wrong with the clock of one chip.

    Everything is worked out anew from the faults that act: it stands if one says so, and is off by
    the sum of what they say. Cycles are counted on, so a clock that is right again keeps the phase
    it has come to: nothing is caught up, nothing taken back.

    Args:
        chip: the chip.
        plants: what it drives.
    """

    def __init__(self, chip: Chip, plants: list[Plant], acting: Callable[[], list[Armed]]) -> None:
        self.chip: Chip = chip
        self._acting: Callable[[], list[Armed]] = acting
        self._plants: list[Plant] = plants
        self._upsets: ChipFaults = upsets_of(chip)

    def begin(self, armed: Armed) -> str:
        """A fault acts, or acts no more; return how the clock goes on."""
        chip, clock, now = self.chip, self.chip.clock, self.chip.kernel.now
        chip.advance()
        stood = clock.stopped
        off = [one for one in self._acting() if one.name in CLOCKS]
        if any(one.name == STOPPED for one in off):
            clock.stop(now)
            text = f"CLK stands in cycle {clock.cycle_at(now)}"
        else:
            ppm = sum(int(one.values["ppm"]) for one in off)
            clock.run(now, ppm)
            text = f"CLK runs at {clock.frequency:.12g} Hz from cycle {clock.cycle_at(now)} on"
        if clock.frequency:
            self._upsets.set_frequency(clock.frequency, self._plants)
        shift = _held if clock.stopped else _resumed
        chip.clock_changed(shift if clock.stopped != stood else None)
        self._upsets.invalidate()
        chip.kernel.settle()
        return text

    end = begin

    # -- state --------------------------------------------------------------------------------

    def restore(self, courses: list[Course]) -> None:
        """Take back the clock a saved state has; the chip's own state comes after."""
        self.chip.clock.courses = courses
        if not self.chip.clock.stopped:
            self._upsets.restore_frequency(self.chip.clock.frequency)


def _held(when: int, now: int) -> int:
    """The clock stands: what lies ahead keeps its distance, and does not come."""
    return HELD + when - now if now < when < HELD else when


def _resumed(when: int, now: int) -> int:
    """The clock runs again: what was ahead is ahead by as much as it was."""
    return when - HELD + now if HELD <= when < NEVER else when
