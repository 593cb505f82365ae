"""Faults of a chip's oscillator: it stands, or is off its frequency."""

from collections.abc import Callable
from typing import Any, Final

from vbus.chips.base import Chip
from vbus.faults import fitting
from vbus.kernel import HELD, NEVER
from vbus.options import Value
from vbus.signals import Plant
from vbus.state.first import load_tuple

STOPPED: Final = "clock_stopped"
CLOCKS: Final = frozenset({STOPPED, "clock_off"})
"""Faults of this kind, by name."""
PERIODS_CLK: Final = {"lm628": 2048, "mc1241a": 1696}
"""For how many cycles of CLK a chip drives its mechanics, where that is always the same."""

Shift = Callable[[int, int], int]


class ClockFaults:
    """What is wrong with the clock of one chip.

    Everything is worked out anew from the faults that act: it stands if one says so, and is off by
    the sum of what they say. Cycles are counted on, so a clock that is right again keeps the phase
    it has come to: nothing is caught up, nothing taken back.

    Args:
        chip: the chip.
        plants: what it drives.
    """

    def __init__(self, chip: Chip, plants: list[Plant]) -> None:
        self.chip: Chip = chip
        self.acting: dict[int, tuple[str, dict[str, Value]]] = {}
        self._plants: list[Plant] = plants

    def begin(self, number: int, name: str, values: dict[str, Value]) -> str:
        """Let a fault act; return what it changes."""
        self.acting[number] = (name, values)
        return self._apply()

    def end(self, number: int) -> str:
        """Let it act no more; return how the clock goes on."""
        if self.acting.pop(number, None) is None:
            return ""
        return self._apply()

    def _apply(self) -> str:
        chip, clock, now = self.chip, self.chip.clock, self.chip.kernel.now
        chip.advance()
        stood = clock.stopped
        if any(name == STOPPED for name, _ in self.acting.values()):
            clock.stop(now)
            text = f"CLK stands in cycle {clock.cycle_at(now)}"
        else:
            ppm = sum(int(values["ppm"]) for _, values in self.acting.values())
            clock.run(now, ppm)
            text = f"CLK runs at {clock.frequency:.12g} Hz from cycle {clock.cycle_at(now)} on"
        self._tell_period()
        if clock.stopped != stood:
            _move(chip, _held if clock.stopped else _resumed)
        _follow(chip)
        return text

    def _tell_period(self) -> None:
        """Mechanics live in seconds: how long a period is has changed."""
        inside: Any = self.chip
        now = self.chip.clock.frequency
        if not now:
            return
        if self.chip.FAMILY == "mcp1200":
            inside.works.encoder.clk_hz = now
            inside.works.encoder._prepared = 0  # from the next period on
        elif self.chip.FAMILY in PERIODS_CLK:
            for plant in self._plants:
                plant.prepare(PERIODS_CLK[self.chip.FAMILY] / now)

    # -- state --------------------------------------------------------------------------------

    def restore(self, acting: dict[int, tuple[str, dict[str, Value]]], courses: Any) -> None:
        """Take back the clock a saved state has; the chip's own state comes after."""
        self.acting = acting
        load_tuple(self.chip.clock, courses)
        if self.chip.FAMILY == "mcp1200" and not self.chip.clock.stopped:
            inside: Any = self.chip
            inside.works.encoder.clk_hz = self.chip.clock.frequency


def _held(when: int, now: int) -> int:
    """The clock stands: what lies ahead keeps its distance, and does not come."""
    return HELD + when - now if now < when < HELD else when


def _resumed(when: int, now: int) -> int:
    """The clock runs again: what was ahead is ahead by as much as it was."""
    return when - HELD + now if HELD <= when < NEVER else when


def _move(chip: Chip, shift: Shift) -> None:
    """Hold the instants that a chip waits for, or give them back."""
    inside: Any = chip
    now: int = chip.kernel.now
    if chip.FAMILY == "lm628":
        inside.host.busy_end = shift(inside.host.busy_end, now)
        inside._reset_end = shift(inside._reset_end, now)
        inside.encoder.index_at = shift(inside.encoder.index_at, now)
    elif chip.FAMILY == "mc1241a":
        inside.port.busy_until = shift(inside.port.busy_until, now)
        inside.interrupts.quiet_until = shift(inside.interrupts.quiet_until, now)
        inside.output._queue = [(shift(one[0], now), *one[1:]) for one in inside.output._queue]
        inside.cycles.pause(chip.clock.stopped)


def _follow(chip: Chip) -> None:
    """The course of the clock is another: so is when the next things come."""
    inside: Any = chip
    if chip.FAMILY == "lm628":
        inside._outputs.due = 0
        if inside.powered:
            inside._place_sample()
        if not chip.clock.stopped:
            inside.encoder.index_at = (
                NEVER if inside.encoder.index_at == NEVER
                else min(inside.encoder.index_at, inside._sample_at)
            )  # fmt: skip
            inside._encoder_pins.look()
    elif chip.FAMILY == "mc1241a" and not inside.stopped():
        inside.cycles.replan(inside.port.busy_until)
    fitting.disturb(chip)
    chip.kernel.settle()
