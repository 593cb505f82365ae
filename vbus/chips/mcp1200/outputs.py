"""The output pins: status lines, motor command port, Pulse and Sign."""

from typing import ClassVar, Final

from vbus.chips.base import Chip
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.axis import ClockedAxis
from vbus.chips.mcp1200.blocks import CONTROL, HELD, NOT_RELEASED, STANDING
from vbus.chips.mcp1200.timer import FAR
from vbus.core.signals import HIGH, LOW, Pin
from vbus.core.state import Names

NOTHING: Final = -1
"""In place of the registers that the pins show: other than any."""


class OutputPins:
    """Puts the pins to the levels that registers and clocks give.

    PWM and step edges are only computed for instants that are observed, or while Pulse or
    Sign are listened to.

    Args:
        chip: whose pins.
        axis: what they show.
    """

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, axis: ClockedAxis) -> None:
        self._axis: ClockedAxis = axis
        self._shown: int = NOTHING
        self._prof: Pin = chip.pins["PROF"]
        self._idle: Pin = chip.pins["IDLE"]
        self._busy: Pin = chip.pins["BUSY"]
        self._trig: Pin = chip.pins["TRIG"]
        self._dac: Pin = chip.pins[ds.DAC]
        self._pulse: Pin = chip.pins["PULSE"]
        self._sign: Pin = chip.pins["SIGN"]

    def show(self, cycle: int) -> None:
        """Put every output to its level at ``cycle``."""
        axis = self._axis
        registers = axis.registers
        shown = (
            registers.flag | registers.status << 8 | registers.capture_control << 16
            | registers.config << 24 | registers.dac << 32 | axis.state << 48 | axis.loop.mode << 56
        )  # fmt: skip
        if shown != self._shown:
            self._shown = shown
            self._prof.drive(self._prof_level())
            self._idle.drive(int(registers.flag & ds.F1 != 0))
            self._busy.drive(registers.status & ds.BUSY)
            self._dac.drive(registers.dac)
            self._trig.drive(self._trig_level())
        self.show_pulse(cycle)

    def forget(self) -> None:
        """The pins may stand at other levels than before: a state was loaded."""
        self._shown = NOTHING

    def _prof_level(self) -> int:
        """F2, or the interpolator's busy latch (MCP-FLG-5)."""
        axis = self._axis
        capture = axis.registers.capture_control
        interpolating = axis.state == CONTROL and axis.loop.mode in (ds.F3, ds.F4)
        if capture & ds.BUSY_ON_PROF and interpolating:
            return int(capture & ds.INTERPOLATOR_BUSY != 0)
        return int(axis.registers.flag & ds.F2 != 0)

    def _trig_level(self) -> int:
        """Low while the breakpoint flag stands and the pin is an output (MCP-BRK-1, 5)."""
        axis = self._axis
        registers = axis.registers
        low = (
            axis.state >= STANDING
            and registers.config & ds.BREAK_ENABLE
            and not registers.capture_control & ds.TRIG_INPUT
            and not registers.status & ds.BREAKPOINT_OK
        )
        return LOW if low else HIGH

    def may_move(self) -> bool:
        """Whether samples, and what comes of them, can move an output that has a listener."""
        axis = self._axis
        if axis.asked():
            return True
        registers = axis.registers
        # A sample under way may be one of a profile whose flag the host has cleared since.
        if self._prof.net.heard and (registers.flag & (ds.MODE_FLAGS | ds.F2) or axis.loop.mode):
            return True
        if self._trig.net.heard and (
            registers.config & ds.BREAK_ENABLE and not registers.capture_control & ds.TRIG_INPUT
        ):
            return True
        # A sample that finds the one before unfinished ends in idle mode (MCP-SMP-4).
        if self._idle.net.heard and axis.state == CONTROL:
            return True
        always = (self._busy, self._dac, self._pulse, self._sign)
        return any(pin.net.heard for pin in always)

    def show_pulse(self, cycle: int) -> None:
        """Put Pulse and Sign to their levels at ``cycle``."""
        axis = self._axis
        if axis.state == HELD:
            self._pulse.drive(LOW)
            self._sign.drive(HIGH)  # MCP-RST-2
        elif axis.registers.step_mode:
            self._pulse.drive(axis.stepper.level(cycle))
            self._sign.drive(axis.stepper.sign)
        else:
            axis.pwm.roll(cycle)
            released = cycle == axis.released
            if cycle > axis.released:
                axis.released = NOT_RELEASED
            self._pulse.drive(HIGH if released else axis.pwm.level(cycle))
            self._sign.drive(axis.pwm.sign)

    def pulse_edge(self, cycle: int) -> int:
        """Return a cycle after ``cycle``, not later than the next edge of Pulse or Sign."""
        axis = self._axis
        if axis.state == HELD:
            return FAR
        if axis.registers.step_mode:
            return axis.stepper.next_edge(cycle)
        axis.pwm.roll(cycle)
        edge = axis.pwm.next_edge(cycle)
        if cycle == axis.released:
            return cycle + 1
        if cycle < axis.released:
            return min(edge, axis.released)
        return edge
