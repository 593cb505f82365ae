"""The output pins: status lines, motor command port, Pulse and Sign."""

from typing import ClassVar

from vbus.chips.base import Chip
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.clockwork import Clockwork
from vbus.chips.mcp1200.states import CONTROL, HELD, STANDING
from vbus.chips.mcp1200.timer import FAR
from vbus.signals import HIGH, LOW, Pin
from vbus.state import Names


class OutputPins:
    """Puts the pins to the levels that registers and clockwork give.

    PWM and step edges are only worked out for the instants somebody looks at, or while Pulse or
    Sign are listened to.

    Args:
        chip: whose pins.
        works: what they show.
    """

    __slots__ = (
        "_busy", "_dac", "_idle", "_prof", "_pulse", "_shown", "_sign", "_trig", "_works",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, works: Clockwork) -> None:
        self._works: Clockwork = works
        self._shown: int = -1
        self._prof: Pin = chip.pins["PROF"]
        self._idle: Pin = chip.pins["IDLE"]
        self._busy: Pin = chip.pins["BUSY"]
        self._trig: Pin = chip.pins["TRIG"]
        self._dac: Pin = chip.pins[ds.DAC]
        self._pulse: Pin = chip.pins["PULSE"]
        self._sign: Pin = chip.pins["SIGN"]

    def show(self, cycle: int) -> None:
        """Put every output to its level at ``cycle``."""
        works = self._works
        data = works.file.bytes
        shown = (
            data[ds.FLAG] | data[ds.STATUS] << 8 | data[ds.CAPTURE_CONTROL] << 16
            | data[ds.CONFIG] << 24 | data[ds.MOTOR_COMMAND] << 32
            | data[ds.MOTOR_COMMAND_LOW] << 40 | works.state << 48 | works.core.mode << 56
        )  # fmt: skip
        if shown != self._shown:
            self._shown = shown
            self._prof.drive(self._prof_level())
            self._idle.drive(int(data[ds.FLAG] & ds.F1 != 0))
            self._busy.drive(data[ds.STATUS] & ds.BUSY)
            self._dac.drive(data[ds.MOTOR_COMMAND] << 4 | data[ds.MOTOR_COMMAND_LOW] >> 4)
            self._trig.drive(self._trig_level())
        self.show_pulse(cycle)

    def forget(self) -> None:
        """The pins may stand at other levels than before: a state was loaded."""
        self._shown = -1

    def _prof_level(self) -> int:
        """F2, or the interpolator's busy latch (MCP-FLG-5)."""
        works = self._works
        capture = works.file.bytes[ds.CAPTURE_CONTROL]
        interpolating = works.state == CONTROL and works.core.mode in (ds.F3, ds.F4)
        if capture & ds.BUSY_ON_PROF and interpolating:
            return int(capture & ds.INTERPOLATOR_BUSY != 0)
        return int(works.file.bytes[ds.FLAG] & ds.F2 != 0)

    def _trig_level(self) -> int:
        """Low while the breakpoint flag stands and the pin is an output (MCP-BRK-1, 5)."""
        works = self._works
        data = works.file.bytes
        low = (
            works.state >= STANDING
            and data[ds.CONFIG] & ds.BREAK_ENABLE
            and not data[ds.CAPTURE_CONTROL] & ds.TRIG_INPUT
            and not data[ds.STATUS] & ds.BREAKPOINT_OK
        )
        return LOW if low else HIGH

    def show_pulse(self, cycle: int) -> None:
        """Put Pulse and Sign to their levels at ``cycle``."""
        works = self._works
        works.live.look()
        if works.state == HELD:
            self._pulse.drive(LOW)
            self._sign.drive(HIGH)
        elif works.file.bytes[ds.CONFIG] & ds.STEP_MODE:
            self._pulse.drive(works.stepper.level(cycle))
            self._sign.drive(works.stepper.sign)
        else:
            works.pwm.roll(cycle)
            released = cycle == works.released
            if cycle > works.released:
                works.released = -1
            self._pulse.drive(HIGH if released else works.pwm.level(cycle))
            self._sign.drive(works.pwm.sign)

    def pulse_edge(self, cycle: int) -> int:
        """Return a cycle after ``cycle``, not later than the next edge of Pulse or Sign."""
        works = self._works
        works.live.look()
        if works.state == HELD:
            return FAR
        if works.file.bytes[ds.CONFIG] & ds.STEP_MODE:
            return works.stepper.next_edge(cycle)
        works.pwm.roll(cycle)
        edge = works.pwm.next_edge(cycle)
        if cycle == works.released:
            return cycle + 1
        if cycle < works.released:
            return min(edge, works.released)
        return edge
