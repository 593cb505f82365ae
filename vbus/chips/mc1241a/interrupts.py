"""The host interrupt: which axis holds ~HostIntrpt low."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a.axis import StepperAxis
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.core.kernel import NEVER
from vbus.core.signals import HIGH, LOW, Pin
from vbus.core.state import Names

NO_AXIS: Final = -1


class Interrupts:
    """~HostIntrpt and the axis it is low for (PMD-INT-1 to PMD-INT-5).

    Args:
        chip: the chip set whose pin it is.
        axes: its axes.
    """

    STATE: ClassVar[Names] = ("axis", "quiet_until")
    WIRING: ClassVar[Names] = ("_axes", "_chip", "_pin")

    def __init__(self, chip: ChipSet, axes: list[StepperAxis]) -> None:
        self._chip: Final[ChipSet] = chip
        self._axes: list[StepperAxis] = axes
        self._pin: Pin = chip.pins["~HostIntrpt"]
        self.axis: int = NO_AXIS
        """Number (0-based) of the interrupting axis, or :data:`NO_AXIS`."""
        self.quiet_until: i64 = NEVER
        """End of the shortest time the line stays high after RST_INTRPT; NEVER outside it."""

    def reset(self) -> None:
        """Release the line."""
        self.axis = NO_AXIS
        self.quiet_until = NEVER
        self._chip.put(self._pin, HIGH)

    def look(self) -> None:
        """Latch the first axis with an event its mask lets through (PMD-INT-1)."""
        if self.axis != NO_AXIS or self.quiet_until != NEVER:
            return
        for axis in self._axes:
            if axis.events & axis.interrupt_mask:
                self.axis = axis.number
                self._chip.put(self._pin, LOW)
                return

    def rested(self) -> None:
        """The line has been high for long enough."""
        self.quiet_until = NEVER
        self.look()

    def release(self) -> None:
        """RST_INTRPT: the line goes high for a clock at least (PMD-INT-3)."""
        self.axis = NO_AXIS
        self.quiet_until = self._chip.instant + self._chip.clock.span_up(1)
        self._chip.put(self._pin, HIGH)
