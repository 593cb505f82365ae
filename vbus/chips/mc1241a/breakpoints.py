"""Breakpoints: on what condition an update happens by itself."""

from vbus.bits import sign_extend
from vbus.chips.mc1241a.datasheet import (
    BRK_ACTL_NEG,
    BRK_ACTL_POS,
    BRK_EXT,
    BRK_MTN_CMPLT,
    BRK_NEG,
    BRK_OFF,
    BRK_POS,
    BRK_TIME,
    MOTION_COMPLETE,
)
from vbus.kernel import NEVER


def is_met(
    mode: int, value: int, time: int, target: int, actual: int, events: int, home: int
) -> bool:
    """Tell whether a breakpoint's condition holds (PMD-CMD-27 to PMD-CMD-33).

    Args:
        mode: one of the ``BRK_`` numbers.
        value: the compare register, 32 bits.
        time: cycles since reset.
        target: target position at the end of the last cycle (usteps).
        actual: actual position at that instant (counts).
        events: status events at that instant.
        home: level of the home input.
    """
    if mode == BRK_OFF:
        return False
    if mode == BRK_TIME:
        return time == value & 0xFFFFFFFF
    if mode == BRK_MTN_CMPLT:
        return events & MOTION_COMPLETE != 0
    if mode == BRK_EXT:
        return home == 0
    limit = sign_extend(value, 32)
    if mode == BRK_POS:
        return target >= limit
    if mode == BRK_NEG:
        return target <= limit
    if mode == BRK_ACTL_POS:
        return actual >= limit
    return mode == BRK_ACTL_NEG and actual <= limit


def cycles_to_go(mode: int, value: int, time: int) -> int:
    """Return in how many cycles a breakpoint of a resting axis fires, NEVER if it will not.

    Everything but time stands still while an axis rests.
    """
    if mode != BRK_TIME:
        return NEVER
    return (value - time - 1 & 0xFFFFFFFF) + 1
