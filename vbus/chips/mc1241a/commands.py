"""Commands: plain parameters straight from the table, and one method for each other row."""

from collections.abc import Callable
from typing import ClassVar

from vbus.bits import clamp
from vbus.chips.mc1241a.axis import Axis
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.chips.mc1241a.cycle import Cycles
from vbus.chips.mc1241a.datasheet import (
    BUFFERED,
    CAPTURE_HOME,
    CAPTURE_INDEX,
    COMMANDS,
    EVENTS,
    GEAR,
    MOVING,
    NO_SUCH_AXIS,
    PARAMETERS,
    RANGE,
    S_CURVE,
    SELECTS,
    TRAPEZOIDAL,
    TWO_PHASE,
    UNUSED_BITS,
    VELOCITY,
    VERSIONS,
)
from vbus.chips.mc1241a.events import NOBODY, Interrupts, mode_word, status_word
from vbus.chips.mc1241a.microstep import FULL_SCALE
from vbus.chips.mc1241a.parameters import fit, in_range
from vbus.chips.tables import Command
from vbus.state import Names


class Commands:
    """Carries out commands once all their data are there.

    A method takes the data words as one number, high word first, and returns the words to be
    read in the same way.

    Args:
        chip: the chip set.
        axes: its axes.
        cycles: what they do when, and what they have in common.
        interrupts: which of them interrupts.
    """

    STATE: ClassVar[Names] = ("current",)
    WIRING: ClassVar[Names] = (
        "_axes", "_chip", "_cycles", "_interrupts", "_methods", "_version",
    )  # fmt: skip

    def __init__(
        self, chip: ChipSet, axes: list[Axis], cycles: Cycles, interrupts: Interrupts
    ) -> None:
        self._chip: ChipSet = chip
        self._axes: list[Axis] = axes
        self._cycles: Cycles = cycles
        self._interrupts: Interrupts = interrupts
        self._version: int = int(chip.settings["version_word"]) or VERSIONS[chip.part]
        self.current: int = 0
        """Current axis, 0-based."""
        self._methods: dict[int, Callable[[int], int]] = {
            row.code: getattr(self, row.handler) for row in COMMANDS if not row.parameter
        }

    def execute(self, row: Command, value: int) -> int:
        """Carry out ``row`` with the data ``value``; return what the host may read."""
        method = self._methods.get(row.code)
        result = self._serve(row, value) if method is None else method(value)
        return result & ((1 << 16 * row.read) - 1)

    @property
    def _axis(self) -> Axis:
        return self._axes[self.current]

    def _fit(self, row: Command, name: str, value: int) -> int:
        """Cut data to a parameter's width, and say so if that changed it (PMD-CMD-82)."""
        fitted = fit(name, value)
        if not in_range(row, fitted, value):
            self._chip.find(RANGE, f"{row.name}: {value:X}H is taken as {fitted}")
        return fitted

    def _serve(self, row: Command, value: int) -> int:
        """Set or get a parameter: the buffer, the active register, or a plain one."""
        name = row.parameter
        holder: object
        if row.scope == "g":
            holder = self._cycles.shared
        elif row.buffered:
            holder = self._axis.buffer
        elif name in BUFFERED:
            holder = self._axis.active
        else:
            holder = self._axis
        if row.read:
            return int(getattr(holder, name))
        if row.write:
            if not PARAMETERS[name].signed and PARAMETERS[name].bits < 15:
                self._check_unused(row, value, PARAMETERS[name].bits)
                setattr(holder, name, fit(name, value))
            else:
                setattr(holder, name, self._fit(row, name, value))
        else:
            setattr(holder, name, SELECTS[row.name])
        return 0

    def _check_unused(self, row: Command, value: int, used: int) -> None:
        if value >> used:
            self._chip.find(UNUSED_BITS, f"{row.name} {value:04X}H: bits {used} to 15 must be 0")

    # -- axis control -------------------------------------------------------------------------

    def _select(self, number: int) -> int:
        self.current = number
        return status_word(self._axis)

    def cmd_set_1(self, _: int) -> int:
        """Current axis 1; its status (PMD-CMD-1)."""
        return self._select(0)

    def cmd_set_2(self, _: int) -> int:
        """Current axis 2, or still 1 where there is no other; its status (PMD-CMD-2)."""
        if len(self._axes) == 1:
            self._chip.find(NO_SUCH_AXIS, f"SET_2: the {self._chip.part} has one axis")
            return self._select(0)
        return self._select(1)

    def cmd_set_i(self, _: int) -> int:
        """Current axis := the interrupting one, if any; its status (PMD-CMD-3)."""
        number = self._interrupts.axis
        return self._select(self.current if number == NOBODY else number)

    # -- profile generation -------------------------------------------------------------------

    def _set_profile(self, mode: int) -> int:
        axis = self._axis
        if axis.profile.set_mode(mode, axis.active.position):
            self._chip.find(MOVING, f"axis {self.current + 1} is in motion")
        return 0

    def cmd_set_prfl_s_crv(self, _: int) -> int:
        """S-curve (PMD-CMD-4)."""
        return self._set_profile(S_CURVE)

    def cmd_set_prfl_trap(self, _: int) -> int:
        """Trapezoidal (PMD-CMD-5)."""
        return self._set_profile(TRAPEZOIDAL)

    def cmd_set_prfl_vel(self, _: int) -> int:
        """Velocity contouring (PMD-CMD-6)."""
        return self._set_profile(VELOCITY)

    def cmd_set_prfl_gear(self, _: int) -> int:
        """Electronic gear (PMD-CMD-7)."""
        return self._set_profile(GEAR)

    def cmd_set_pos(self, value: int) -> int:
        """Destination; that it was given at all counts too (PMD-CMD-8, PMD-TRJ-12)."""
        axis = self._axis
        axis.buffer.position = self._fit(COMMANDS["SET_POS"], "position", value)
        axis.position_given = True
        return 0

    def cmd_set_start_vel(self, value: int) -> int:
        """Start velocity (PMD-CMD-14)."""
        row = COMMANDS["SET_START_VEL"]
        self._axis.set_start_velocity(self._fit(row, "start_velocity", value))
        return 0

    def cmd_get_trgt_pos(self, _: int) -> int:
        """Target position, whole usteps (PMD-CMD-25)."""
        return self._axis.profile.target()

    def cmd_get_trgt_vel(self, _: int) -> int:
        """Target velocity, 16.16 (PMD-CMD-26)."""
        return self._axis.profile.velocity >> 16

    def cmd_update(self, _: int) -> int:
        """Update the current axis at the next cycle (PMD-CMD-36)."""
        self._axis.request_update()
        return 0

    def cmd_multi_update(self, value: int) -> int:
        """Update several axes in one cycle (PMD-CMD-37)."""
        self._check_unused(COMMANDS["MULTI_UPDATE"], value, len(self._axes))
        for axis in self._axes:
            if value >> axis.number & 1:
                axis.request_update()
        return 0

    # -- interrupts, status -------------------------------------------------------------------

    def cmd_get_intrpt(self, _: int) -> int:
        """Status of the interrupting axis, else of the current one (PMD-CMD-42)."""
        number = self._interrupts.axis
        return status_word(self._axes[self.current if number == NOBODY else number])

    def cmd_rst_intrpt(self, value: int) -> int:
        """Clear events of the interrupting axis and release the line (PMD-INT-3)."""
        number = self._interrupts.axis
        if number != NOBODY:
            self._axes[number].clear_events(value)
            self._chip.release_interrupt()
        return 0

    def cmd_clr_status(self, _: int) -> int:
        """Clear all events (PMD-CMD-45)."""
        self._axis.clear_events(0)
        return 0

    def cmd_rst_status(self, value: int) -> int:
        """Clear the events whose bits are 0 (PMD-CMD-46)."""
        self._axis.clear_events(value & EVENTS)
        return 0

    def cmd_get_status(self, _: int) -> int:
        """Status word (PMD-CMD-47)."""
        return status_word(self._axis)

    def cmd_get_mode(self, _: int) -> int:
        """Mode word (PMD-CMD-48)."""
        return mode_word(self._axis)

    # -- encoder ------------------------------------------------------------------------------

    def cmd_get_actl_pos(self, _: int) -> int:
        """Actual position as read in the last cycle (PMD-CMD-49)."""
        return self._axis.encoder.actual

    def _set_capture(self, source: int) -> int:
        self._cycles.follow_encoders()
        self._axis.encoder.set_source(source)
        return 0

    def cmd_set_capt_index(self, _: int) -> int:
        """Capture by index (PMD-CMD-50)."""
        return self._set_capture(CAPTURE_INDEX)

    def cmd_set_capt_home(self, _: int) -> int:
        """Capture by home (PMD-CMD-51)."""
        return self._set_capture(CAPTURE_HOME)

    def cmd_get_capt(self, _: int) -> int:
        """Captured position; a new capture may come (PMD-CMD-52)."""
        self._cycles.follow_encoders()
        return self._axis.encoder.collect()

    def cmd_set_step_ratio(self, value: int) -> int:
        """Encoder counts per ustep times 256 (PMD-CMD-53)."""
        row = COMMANDS["SET_STEP_RATIO"]
        self._axis.set_step_ratio(self._fit(row, "step_ratio", value))
        return 0

    # -- motor --------------------------------------------------------------------------------

    def cmd_mtr_on(self, _: int) -> int:
        """Enable the generator (PMD-CMD-62)."""
        self._axis.motor_turn_on()
        return 0

    def cmd_mtr_off(self, _: int) -> int:
        """Disable the generator (PMD-CMD-63)."""
        self._axis.motor_off()
        return 0

    def _motor_command(self, row: Command, value: int) -> int:
        fitted = clamp(fit("motor_command", value), -FULL_SCALE, FULL_SCALE)
        if not in_range(row, fitted, value):
            self._chip.find(RANGE, f"{row.name}: -32768 is taken as -32767")
        return fitted

    def cmd_set_mtr_cmd(self, value: int) -> int:
        """Amplitude, at the next look-up (PMD-CMD-64)."""
        self._cycles.hold_outputs(self.current)
        self._axis.set_motor_command(self._motor_command(COMMANDS["SET_MTR_CMD"], value))
        return 0

    def cmd_set_buf_mtr_cmd(self, value: int) -> int:
        """Amplitude from the next update on (PMD-CMD-66)."""
        row = COMMANDS["SET_BUF_MTR_CMD"]
        axis = self._axis
        axis.buffer.motor_command = self._motor_command(row, value)
        axis.motor_command_given = True
        return 0

    # -- miscellaneous ------------------------------------------------------------------------

    def cmd_set_actl_pos(self, value: int) -> int:
        """Give both positions a number (PMD-CMD-69)."""
        self._cycles.follow_encoders()
        row = COMMANDS["SET_ACTL_POS"]
        self._axis.set_actual_position(self._fit(row, "position", value))
        return 0

    def cmd_get_lmt_swtch(self, _: int) -> int:
        """Levels of the limit switch inputs (PMD-CMD-71)."""
        self._cycles.follow_encoders()
        word = 0
        for axis in self._axes:
            positive, negative = axis.encoder.limit_levels()
            word |= (positive | negative << 1) << 2 * axis.number
        return word

    def cmd_lmts_on(self, _: int) -> int:
        """Sense limit switches; one that is active already is a hit (PMD-LIM-4)."""
        self._cycles.shared.sensing = True
        for axis in self._axes:
            axis.limits.forget()
        return 0

    def cmd_lmts_off(self, _: int) -> int:
        """Stop sensing; bits already set stay (PMD-CMD-73)."""
        self._cycles.shared.sensing = False
        return 0

    def cmd_get_home(self, _: int) -> int:
        """Levels of the home inputs (PMD-CMD-74)."""
        self._cycles.follow_encoders()
        word = 0
        for axis in self._axes:
            word |= axis.encoder.home_level() << axis.number
        return word

    def cmd_reset(self, _: int) -> int:
        """Like ~Reset; ready 2 ms after the command was written (PMD-CMD-75)."""
        self._chip.reset_command()
        return 0

    def cmd_get_vrsn(self, _: int) -> int:
        """Version word (PMD-CMD-76)."""
        return self._version

    # -- microstepping ------------------------------------------------------------------------

    def _set_phases(self, two: bool) -> int:
        self._cycles.hold_outputs(self.current)
        self._axis.stepper.two_phase = two
        return 0

    def cmd_set_phase_2(self, _: int) -> int:
        """Two phases 90 degrees apart, at the next look-up (PMD-CMD-78)."""
        return self._set_phases(True)

    def cmd_set_phase_3(self, _: int) -> int:
        """Three phases 120 degrees apart (PMD-CMD-79)."""
        return self._set_phases(False)

    def cmd_get_phase_info(self, _: int) -> int:
        """Bit 3: two phases (PMD-CMD-80)."""
        return TWO_PHASE if self._axis.stepper.two_phase else 0
