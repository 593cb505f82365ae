"""Status and mode words, and the host interrupt."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a.axis import Axis
from vbus.chips.mc1241a.datasheet import (
    AUTO_STOP,
    AUTO_UPDATE_OFF,
    AXIS_ON,
    AXIS_SHIFT,
    IN_MOTION,
    MOTOR_ON,
    PHASE_SHIFT,
    PROFILE_SHIFT,
    S_CURVE,
)
from vbus.kernel import NEVER
from vbus.state import Names

NOBODY: Final = -1


def status_word(axis: Axis) -> int:
    """Return the status word of an axis (PMD-STA-1)."""
    word = axis.events | AXIS_ON | axis.number << AXIS_SHIFT
    if axis.motor_on:
        word |= MOTOR_ON
    if axis.profile.in_motion():
        word |= IN_MOTION
    return word


def mode_word(axis: Axis) -> int:
    """Return the mode word of an axis (PMD-STA-5)."""
    mode = axis.profile.mode
    word = mode << PROFILE_SHIFT
    if axis.auto_stop:
        word |= AUTO_STOP
    if not axis.auto_update:
        word |= AUTO_UPDATE_OFF
    if mode == S_CURVE:
        word |= axis.profile.phase() << PHASE_SHIFT
    return word


class Interrupts:
    """Which axis holds ~HostIntrpt low (PMD-INT-1 to PMD-INT-5)."""

    STATE: ClassVar[Names] = ("axis", "quiet_until")

    def __init__(self) -> None:
        self.axis: int = NOBODY
        """Number (0-based) of the interrupting axis, or :data:`NOBODY`."""
        self.quiet_until: i64 = NEVER
        """End of the shortest time the line stays high after RST_INTRPT; NEVER outside it."""

    def reset(self) -> None:
        """Release the line."""
        self.axis = NOBODY
        self.quiet_until = NEVER

    def look(self, axes: "list[Axis]") -> bool:
        """Latch the first axis with an event its mask lets through; tell whether one was."""
        if self.axis != NOBODY or self.quiet_until != NEVER:
            return False
        for axis in axes:
            if axis.events & axis.interrupt_mask:
                self.axis = axis.number
                return True
        return False

    def release(self, quiet_until: int) -> None:
        """Let the line go high, at least until ``quiet_until`` (PMD-INT-3)."""
        self.axis = NOBODY
        self.quiet_until = quiet_until
