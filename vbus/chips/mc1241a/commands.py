"""Commands: each row of the table sets or gets its parameter, or calls its hook."""

from typing import Any, ClassVar, Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.axis import NO_AXIS, Interrupts, StepperAxis
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.chips.mc1241a.cycle import SampleCycles
from vbus.chips.tables import Command
from vbus.core.bits import sign_extend, wrap
from vbus.core.state import Names

_SLOW: Final = 1 << 16
"""Velocity from which a stop is abrupt: 1 ustep/cycle, 1/64 of a full step in 0.5 ms."""


class Commands:
    """Carries out commands once all their data are there.

    A hook takes the data words as one number, high word first, or what its row says instead, and
    returns the words to be read in the same way. It is a method of this class or of the axis.

    Args:
        chip: the chip set.
        axes: its axes.
        cycles: what they do when, and what they have in common.
        interrupts: which of them interrupts.
    """

    STATE: ClassVar[Names] = ("current", "left_switch: bool")
    WIRING: ClassVar[Names] = ("_axes",)

    def __init__(
        self, chip: ChipSet, axes: list[StepperAxis], cycles: SampleCycles, interrupts: Interrupts
    ) -> None:
        self._chip: ChipSet = chip
        self._axes: list[StepperAxis] = axes
        self._cycles: SampleCycles = cycles
        self._interrupts: Interrupts = interrupts
        # PMD-VER-2, PMD-AMB-4: the word of the part, unless the board file has another.
        self._version: int = int(chip.settings["version_word"]) or ds.VERSIONS[chip.part]
        self.current: int = 0
        """Current axis, 0-based."""
        self.left_switch: bool = False
        """LMTS_OFF was given on a limit switch, no LMTS_ON since."""

    def execute(self, row: Command, value: int) -> int:
        """Carry out ``row`` with the data ``value``; return what the host may read."""
        given = self._fit(row, value) if row.write else row.value
        result: Any = None
        if row.hook:
            method = getattr(self if HOOKS[row.hook] is Commands else self._axis, row.hook)
            result = method() if given is None else method(given)
        else:
            holder: Any = self._cycles.shared if row.scope == "g" else self._axis
            part, _, name = row.parameter.rpartition(".")
            if part:
                holder = getattr(holder, part)
            if given is None:
                result = getattr(holder, name)
            else:
                setattr(holder, name, given)
        # PMD-PKT-7: fixed now, however late its words are read.
        return (result or 0) & ((1 << 16 * row.read) - 1)

    @property
    def _axis(self) -> StepperAxis:
        return self._axes[self.current]

    def _fit(self, row: Command, value: int) -> int:
        """Cut data to what the row keeps of it, and say so if that changes it (PMD-CMD-82)."""
        if not row.bits:
            return value
        if row.signed:
            number = sign_extend(value, 16 * row.write)
            fitted = wrap(value, row.bits)
            # PMD-CMD-82, PMD-AMB-24: -32768 is no motor command.
            if fitted < row.least < 0:
                self._chip.find(ds.RANGE, f"{row.name}: {fitted} is taken as {row.least}")
                return row.least
        else:
            number = value
            fitted = value & (1 << row.bits) - 1
        # A field narrower than 15 bits has unused bits beside it; a wider one is a number's range.
        if row.bits < 15:
            self._check_unused(row, value, row.bits)
        elif fitted != number:
            self._chip.find(ds.RANGE, f"{row.name}: {value:X}H is taken as {fitted}")
        return fitted

    def _check_unused(self, row: Command, value: int, used: int) -> None:
        if value >> used:
            self._chip.find(ds.UNUSED_BITS, f"{row.name} {value:04X}H: bits {used} to 15 must be 0")

    # -- axis control -------------------------------------------------------------------------

    def select(self, number: int) -> int:
        """Choose the current axis, 1 where there is no other; return its status (PMD-CMD-2)."""
        # PMD-CMD-2: a part of one axis has no axis 2.
        if number == len(self._axes):
            self._chip.find(ds.NO_SUCH_AXIS, f"SET_2: the {self._chip.part} has one axis")
            number = 0
        self.current = number
        return self._axis.status

    def select_interrupting(self) -> int:
        """Current axis := the interrupting one, if any; its status (PMD-CMD-3)."""
        # PMD-CMD-3: without an interrupt the current axis stays.
        if self._interrupts.axis != NO_AXIS:
            self.current = self._interrupts.axis
        return self._axis.status

    def update(self) -> None:
        """Update the current axis (PMD-CMD-36)."""
        self._update(self._axis)

    def update_several(self, which: int) -> None:
        """Update several axes in one cycle (PMD-CMD-37)."""
        self._check_unused(ds.COMMANDS["MULTI_UPDATE"], which, len(self._axes))
        # PMD-CMD-37, PMD-BUS-9: all of them act in the same cycle.
        for axis in self._axes:
            if which >> axis.number & 1:
                self._update(axis)

    def set_breakpoint_value(self, value: int) -> None:
        """Set breakpoint comparison value (PMD-CMD-35)."""
        axis = self._axis
        if ds.BRK_OFF < axis.breakpoint_mode < ds.BRK_MTN_CMPLT:
            text = f"axis {self.current + 1}: SET_BRK_PNT while a breakpoint is compared with"
            self._chip.find(ds.LATE_VALUE, f"{text} {axis.breakpoint_value}")
        axis.breakpoint_value = value

    def set_breakpoint(self, mode: int) -> None:
        """Set what the breakpoint compares (PMD-CMD-27 to PMD-CMD-33)."""
        axis = self._axis
        axis.breakpoint_mode = mode
        name = f"axis {self.current + 1}"
        value = axis.breakpoint_value
        if mode == ds.BRK_TIME:
            time = self._cycles.shared.time
            # The nearer half of all times lies ahead.
            if not 0 < value - time & 0xFFFFFFFF < 1 << 31:
                text = f"{name}: SET_TIME_BRK for cycle {value & 0xFFFFFFFF} in cycle {time}"
                self._chip.find(ds.TIME_PASSED, text)
            return
        if mode == ds.BRK_EXT:
            self._cycles.follow_encoders()
        if not axis.breakpoint_met():
            return
        if mode == ds.BRK_MTN_CMPLT:
            text = f"{name}: SET_MTN_CMPLT_BRK while bit 0 of the status word is 1"
            self._chip.find(ds.STALE_COMPLETE, text)
        elif mode == ds.BRK_EXT:
            self._chip.find(ds.MET_AT_ONCE, f"{name}: SET_EXT_BRK while the home input is low")
        else:
            text = f"{name}: the position is beyond {sign_extend(value, 32)} already"
            self._chip.find(ds.MET_AT_ONCE, text)

    def _update(self, axis: StepperAxis) -> None:
        unused = axis.unused()
        if unused:
            mode = ds.PROFILES[axis.profile.mode]
            text = f"axis {axis.number + 1}: the {mode} profile does not use {unused}"
            self._chip.find(ds.OTHER_PROFILE, text)
        elif axis.starts_fast():
            text = f"axis {axis.number + 1}: it begins faster than its profile is to be"
            self._chip.find(ds.START_VELOCITY, text)
        if axis.waits_for_motor():
            text = f"axis {axis.number + 1}: the update of a motion while the motor is off"
            self._chip.find(ds.MOTOR_IS_OFF, text)
        if axis.moves_unwatched():
            limit = f"error limit {axis.position_error_limit} and step ratio 0"
            text = f"axis {axis.number + 1}: a motion begins with {limit}"
            self._chip.find(ds.LIMIT_UNWATCHED, text)
        speed = abs(axis.profile.target_velocity)
        if axis.buffer.stop and speed > max(axis.start_velocity, _SLOW):
            text = f"axis {axis.number + 1}: UPDATE of STOP at {speed / 65536:.6g} ustep/cycle"
            self._chip.find(ds.ABRUPT_STOP, text)
        if axis.up_to_date():
            text = f"axis {axis.number + 1}: nothing was loaded since the last update"
            self._chip.find(ds.IDLE_UPDATE, text)
        axis.request_update()

    # -- interrupts ---------------------------------------------------------------------------

    def shown(self, word: int) -> None:
        """The host reads a status word: it has seen the errors in it."""
        self._axes[word >> ds.AXIS_SHIFT & 1].unread &= ~word

    def interrupting_status(self) -> int:
        """Return the status of the interrupting axis, else of the current one (PMD-CMD-42)."""
        number = self._interrupts.axis
        return (self._axis if number == NO_AXIS else self._axes[number]).status

    def reset_interrupt(self, keep: int) -> None:
        """Clear events of the interrupting axis and release the line (PMD-INT-3)."""
        number = self._interrupts.axis
        # PMD-INT-3: without an interrupt the command clears nothing.
        if number == NO_AXIS:
            meant = self._axis.events & ~keep
            if meant:
                text = f"RST_INTRPT is to clear {meant:04X}H, and ~HostIntrpt is high"
                self._chip.find(ds.NO_INTERRUPT, text)
        else:
            axis = self._axes[number]
            enabled = axis.events & axis.interrupt_mask
            if enabled & keep == enabled != 0:
                text = f"RST_INTRPT {keep:04X}H leaves {enabled:04X}H of axis {number + 1}"
                self._chip.find(ds.KEEPS_INTERRUPT, f"{text}: it interrupts again at once")
            axis.clear_events(keep)
            self._interrupts.release()

    def reset_status(self, keep: int) -> None:
        """Clear events of the current axis (PMD-CMD-46)."""
        events = self._axis.events
        if events and keep & ds.EVENTS == ds.EVENTS:
            text = f"axis {self.current + 1}: RST_STATUS {keep:04X}H leaves {events:04X}H as it is"
            self._chip.find(ds.KEEPS_STATUS, text)
        self.clear_status(keep)

    def clear_status(self, keep: int = 0) -> None:
        """Clear events of the current axis, without an interrupt (PMD-CMD-45)."""
        axis = self._axis
        if axis.events & ~keep & ds.MOTION_COMPLETE and axis.begun():
            text = f"axis {self.current + 1}: motion complete is cleared while a move is under way"
            self._chip.find(ds.CLEARED_LATE, text)
        axis.clear_events(keep)

    # -- the encoder ---------------------------------------------------------------------------

    def set_step_ratio(self, value: int) -> None:
        """Counts per ustep, times 256 (PMD-CMD-53)."""
        if not value:
            text = f"axis {self.current + 1}: with step ratio 0 no stall is found"
            self._chip.find(ds.NO_STEP_RATIO, text)
        self._axis.set_step_ratio(value)

    # -- inputs, at this instant --------------------------------------------------------------

    def set_capture(self, source: int) -> None:
        """Capture by index or home (PMD-CMD-50, PMD-CMD-51)."""
        # Index pulses before this instant were for the source before.
        self._cycles.follow_encoders()
        self._axis.encoder.set_source(source)

    def captured(self) -> int:
        """Return the captured position; a new capture may come (PMD-CMD-52)."""
        self._cycles.follow_encoders()
        return self._axis.encoder.collect()

    def set_actual_position(self, value: int) -> None:
        """Give both positions a number (PMD-CMD-69)."""
        # PMD-CMD-69: the place at this instant gets the number, not that of the last cycle.
        self._cycles.follow_encoders()
        self._axis.renumber(value)

    def limit_switches(self) -> int:
        """Return the levels of the limit switch inputs (PMD-CMD-71)."""
        self._cycles.follow_encoders()
        word = 0
        for axis in self._axes:
            positive, negative = axis.encoder.limit_levels()
            word |= (positive | negative << 1) << 2 * axis.number
        return word

    def set_sensing(self, on: int) -> None:
        """Sense limit switches from now on, or no longer; bits set stay (PMD-CMD-72, -73)."""
        self._cycles.shared.sensing = bool(on)
        self.left_switch = not on and not all(axis.limits.armed for axis in self._axes)
        if on:  # PMD-CMD-72
            for axis in self._axes:
                axis.limits.forget()

    def home_switches(self) -> int:
        """Return the levels of the home inputs (PMD-CMD-74)."""
        self._cycles.follow_encoders()
        return sum(axis.encoder.home_level() << axis.number for axis in self._axes)

    # -- outputs, at the next look-up ---------------------------------------------------------

    def set_motor_command(self, value: int) -> None:
        """Amplitude, at the next look-up (PMD-CMD-64)."""
        # PMD-USTP-2: what the pins show stays up to the next look-up.
        self._cycles.hold_outputs(self.current)
        self._axis.set_motor_command(value)

    def set_phases(self, count: int) -> None:
        """Two phases 90 degrees apart or three 120 degrees apart (PMD-CMD-78, PMD-CMD-79)."""
        self._cycles.hold_outputs(self.current)
        # PMD-AMB-6, PMD-USTP-7: the waveform is the current axis's own.
        self._axis.stepper.two_phase = count == 2

    # -- the chip set -------------------------------------------------------------------------

    def reset(self) -> None:
        """Like ~Reset; ready 2 ms after the command was written (PMD-CMD-75)."""
        self._chip.reset_command()

    def version(self) -> int:
        """Return the version word (PMD-CMD-76)."""
        return self._version


HOOKS: Final = ds.COMMANDS.find_hooks(Commands, StepperAxis)
