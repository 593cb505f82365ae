"""The exception handler: what happened since the last sample, and what R04 says to do about it."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.generated.registers import Registers
from vbus.core.state import Names


class ExceptionSources:
    """Exception sources noted since the last look; one action for all of them (MCP-EXC-1).

    The flags in the status register are set by the block that sees the cause, at once; this is only
    what the next control sample does about it.

    Attributes:
        limit: /LIMIT has gone low.
        stop: /STOP has gone low.
        breakpoint: the breakpoint has been reached.
        error: the position error was too large, or the motor stalled.
    """

    STATE: ClassVar[Names] = ("limit: bool", "stop: bool", "breakpoint: bool", "error: bool")

    def __init__(self) -> None:
        self.limit: bool = False
        self.stop: bool = False
        self.breakpoint: bool = False
        self.error: bool = False

    def clear(self) -> None:
        """Nothing has happened."""
        self.limit = False
        self.stop = False
        self.breakpoint = False
        self.error = False

    def action(self, registers: Registers, limit_low: bool, stop_low: bool) -> i64:
        """Return what to do in this sample and forget what was noted.

        A pin that is still low, and R46, cause the action anew in every sample (MCP-EXC-5).
        """
        setting = registers.exception
        one: i64 = 1
        wanted = one << (registers.forced_exception & 3)
        if self.limit or limit_low:
            wanted |= one << (setting & 3)
        if self.stop or stop_low:
            wanted |= one << (setting >> 2 & 3)
        if self.breakpoint:
            wanted |= one << (setting >> 4 & 3)
        if self.error:
            wanted |= one << (setting >> 6)
        self.clear()
        if wanted >> ds.GO_IDLE & 1:
            return ds.GO_IDLE
        if wanted >> ds.ABRUPT & 1:
            return ds.ABRUPT
        if wanted >> ds.DECELERATE & 1:
            return ds.DECELERATE
        return ds.REPORT

    def stands(self, registers: Registers) -> bool:
        """Tell whether a pin's flag that asks for a deceleration has not been cleared yet.

        Integral velocity mode stays at rest until then, though the pin is high (NOTES 27).
        """
        setting = registers.exception
        status = registers.status
        if not status & ds.STOP_OK and setting >> 2 & 3 == ds.DECELERATE:
            return True
        return not status & ds.LIMIT_OK and setting & 3 == ds.DECELERATE
