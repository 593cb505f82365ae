"""One axis: registers, update, limit switches, and the order of work in a cycle; and which axis
interrupts."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chipset import ChipSet, ProfileRegisters, SharedParameters
from vbus.chips.mc1241a.encoder import AxisInputs
from vbus.chips.mc1241a.microstep import Microstepper
from vbus.chips.mc1241a.profile import Profile
from vbus.chips.tables import names_of
from vbus.core.bits import sign_extend
from vbus.core.kernel import NEVER
from vbus.core.signals import HIGH, LOW, Pin, Rule
from vbus.core.state import Names

ERROR_LIMIT: Final = 32_767
"""Largest position error the axis tolerates after reset."""

UPDATED: Final = 0
"""The active motor command has come from the buffer."""
DIRECT: Final = 1
"""SET_MTR_CMD has set it."""
DIRECT_REPORTED: Final = 2
"""The same, and an update that left it as it was has been reported."""
FOR_EVER: Final = (1 << 62) - 1
"""More cycles than there will be."""

_UNUSED: Final = {
    ds.TRAPEZOIDAL: ("max_acceleration", "jerk"),
    ds.VELOCITY: ("max_acceleration", "jerk"),
    ds.S_CURVE: ("acceleration",),
    ds.GEAR: (),
}
"""Rates that a profile mode does not use, beside those it does (PMD-CMD-10 to PMD-CMD-12)."""

Report = Callable[[Rule, str], None]
"""Takes a rule the host has broken on an axis, and what happened."""


class LimitDetector:
    """The over-travel detector of one axis (PMD-LIM-1, PMD-LIM-2)."""

    STATE: ClassVar[Names] = ("armed: bool", "_hit", "_positive: bool", "_negative: bool")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Arm the detector with both switches taken as open."""
        self.armed: bool = True
        self._hit: int = 0
        self.forget()

    def forget(self) -> None:
        """Take a switch that is active already as one that becomes active (PMD-LIM-4)."""
        self._positive: bool = False
        self._negative: bool = False

    def look(self, positive: bool, negative: bool, events: int, sensing: bool) -> int:
        """Look at the switches once a cycle; return the status bit of a hit, or 0.

        Args:
            positive: whether the positive switch is active, by its sense.
            negative: whether the negative switch is.
            events: status events, of which the host may have cleared the last hit.
            sensing: LMTS_ON rules.
        """
        # PMD-LIM-2: armed again when the switch that was hit is open and its status bit is cleared.
        if not self.armed:
            active = positive if self._hit == ds.POSITIVE_LIMIT else negative
            if not active and not events & self._hit:
                self.armed = True
                self._hit = 0
                # The other switch may have become active unseen (NOTES 9).
                self.forget()
        bit = 0
        # PMD-LIM-1, PMD-LIM-4: a switch counts as it becomes active, the positive one first.
        if self.armed and sensing:
            if positive and not self._positive:
                bit = ds.POSITIVE_LIMIT
            elif negative and not self._negative:
                bit = ds.NEGATIVE_LIMIT
            if bit:
                self.armed = False
                self._hit = bit
        self._positive = positive
        self._negative = negative
        return bit

    def steady(self, positive: bool, negative: bool, events: int, sensing: bool) -> bool:
        """Whether :meth:`look` with the same arguments would change nothing."""
        if self._positive != positive or self._negative != negative:
            return False
        if self.armed:
            return True
        active = positive if self._hit == ds.POSITIVE_LIMIT else negative
        return active or events & self._hit != 0


class StepperAxis:
    """Everything the chip set keeps for one axis.

    Args:
        number: 0-based.
        shared: what the axes have in common.
        encoder: its counts, index and home.
        stepper: its microstep look-ups.
        report: takes findings about the host.
    """

    STATE: ClassVar[Names] = (
        "events", "motor_on: bool", "auto_stop", "auto_update", "_update_pending: bool",
        "position_given: bool", "_position_taken: bool", "_motor_command_from",
        "motor_command_given: bool", "_motor_command_taken: bool", "interrupt_mask",
        "breakpoint_mode", "breakpoint_value", "start_velocity", "step_ratio",
        "position_error_limit", "position_error", "_error_offset", "buffer: part", "_taken: part",
        "active: part", "profile: part", "limits: part", "encoder: part", "stepper: part",
        "unread", "watched: bool",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("number",)

    def __init__(
        self,
        number: int,
        shared: SharedParameters,
        encoder: AxisInputs,
        stepper: Microstepper,
        report: Report,
    ) -> None:
        self.number: int = number
        self._shared: Final[SharedParameters] = shared
        self.encoder: Final[AxisInputs] = encoder
        self.stepper: Final[Microstepper] = stepper
        self.profile: Final[Profile] = Profile()
        self.limits: Final[LimitDetector] = LimitDetector()
        self.buffer: Final[ProfileRegisters] = ProfileRegisters()
        self.active: Final[ProfileRegisters] = ProfileRegisters()
        self._taken: Final[ProfileRegisters] = ProfileRegisters()
        self._report: Report = report
        self.reset()

    def reset(self) -> None:
        """Take the values of the manual's reset table (PMD-RST-2)."""
        self.events: int = 0
        self.motor_on: bool = True
        self.auto_stop: int = 1
        self.auto_update: int = 1
        self.position_given: bool = False
        """SET_POS was given since the last update (PMD-TRJ-12)."""
        self._update_pending: bool = False
        self._position_taken: bool = False
        self.motor_command_given: bool = False
        """SET_BUF_MTR_CMD was given since the last update (NOTES 6)."""
        self._motor_command_taken: bool = False
        self._motor_command_from: int = UPDATED
        self.unread: int = 0
        """Errors that no status word has shown the host."""
        self.interrupt_mask: int = 0
        self.breakpoint_mode: int = ds.BRK_OFF
        self.breakpoint_value: int = 0
        self.start_velocity: int = 0
        self.step_ratio: int = 0
        self.watched: bool = False
        """A step ratio above 0 has been set since a reset."""
        self.position_error_limit: int = ERROR_LIMIT
        self.position_error: int = 0
        """Target minus actual position (counts), clamped to 16 bits."""
        self._error_offset: int = 0
        self.buffer.copy(ProfileRegisters())
        self.active.copy(ProfileRegisters())
        self._taken.copy(ProfileRegisters())
        self.profile.reset()
        self.limits.reset()
        self.encoder.reset()
        self.stepper.reset()

    # -- status and mode words ----------------------------------------------------------------

    @property
    def status(self) -> int:
        """The status word (PMD-STA-1)."""
        # PMD-STA-1, PMD-AMB-20: bit 9 is always 1: this part has no command that turns an axis off.
        word = self.events | ds.AXIS_ON | self.number << ds.AXIS_SHIFT
        if self.motor_on:
            word |= ds.MOTOR_ON
        if self.profile.in_motion():
            word |= ds.IN_MOTION
        return word

    @property
    def mode(self) -> int:
        """The mode word (PMD-STA-5)."""
        mode = self.profile.mode
        word = mode << ds.PROFILE_SHIFT
        if self.auto_stop:
            word |= ds.AUTO_STOP
        if not self.auto_update:
            word |= ds.AUTO_UPDATE_OFF
        # PMD-STA-5: a phase is shown of an S-curve alone.
        if mode == ds.S_CURVE:
            word |= self.profile.phase() << ds.PHASE_SHIFT
        return word

    # -- one cycle ----------------------------------------------------------------------------

    def cycle(self) -> None:
        """Do the work of one cycle, in the order of PMD-CYC-1."""
        profile = self.profile
        # PMD-CYC-1: the encoder is read first: all that follows in the cycle sees these counts.
        counts = self.encoder.read()
        # PMD-CYC-1, PMD-CAP-1: a capture shows in the status word from the next cycle on.
        if self.encoder.take_capture():
            self.events |= ds.CAPTURE
        # PMD-TRJ-1: the actual position coming round sets the bit, too.
        if self.encoder.wrapped:
            self.events |= ds.WRAP
        # A breakpoint looks at how the last cycle ended (PMD-UPD-3).
        met = self.breakpoint_met()
        # PMD-BUS-9: what UPDATE copies it copies at the beginning of a cycle.
        if self._update_pending:
            self._update()
        # PMD-UPD-2: met once, it is set no more; without auto update that is all.
        if met:
            self.breakpoint_mode = ds.BRK_OFF
            self.events |= ds.BREAKPOINT
            if self.auto_update:
                self.request_update()
                self._update()
        positive, negative = self._limits()
        hit = self.limits.look(positive, negative, self.events, self._shared.sensing)
        # PMD-LIM-1: whichever way the axis moves, it stops and waits for the next update.
        if hit:
            profile.halt()
            self.events |= hit | ds.MOTION_COMPLETE  # PMD-LIM-1
        # The look-ups of the cycle spread its way from here on (PMD-USTP-2).
        start = profile.position
        ended = profile.step(self.active, self.start_velocity, counts)
        if ended & ds.MOTION_COMPLETE:
            self._judge_end()
        self.events |= ended
        self.stepper.begin_cycle(start, profile.moved)
        self._check_error()

    def _judge_end(self) -> None:
        """Say so if a profile has run to its end in vain."""
        text = f"axis {self.number + 1}: the profile has run to its end"
        if self.active.motor_command == 0:
            how = "set it by SET_MTR_CMD, or by SET_BUF_MTR_CMD and UPDATE"
            self._report(ds.WITHOUT_CURRENT, f"{text} while the motor command was 0: {how}")
        if self.events & ds.MOTION_ERROR:
            self._report(ds.RUNS_ON, f"{text} after a motion error: auto stop is off")

    def _limits(self) -> tuple[bool, bool]:
        """Return whether the limit switches are active, by their sense (PMD-LIM-1)."""
        positive, negative = self.encoder.limit_levels()
        sense = self._shared.limit_sense >> 2 * self.number
        # PMD-LIM-1: each bit of SET_LMT_SENSE says at which level its switch is active.
        return positive != sense & 1, negative != sense >> 1 & 1

    def breakpoint_met(self) -> bool:
        """Tell whether the breakpoint's condition holds."""
        mode, value = self.breakpoint_mode, self.breakpoint_value
        if mode == ds.BRK_OFF:
            return False
        if mode == ds.BRK_TIME:
            return self._shared.time == value & 0xFFFFFFFF  # PMD-CMD-27
        if mode == ds.BRK_MTN_CMPLT:
            return self.events & ds.MOTION_COMPLETE != 0  # PMD-CMD-32
        if mode == ds.BRK_EXT:
            return self.encoder.home_level() == 0  # PMD-CMD-33
        limit = sign_extend(value, 32)
        if mode == ds.BRK_POS:
            return self.profile.target_position >= limit  # PMD-CMD-28
        if mode == ds.BRK_NEG:
            return self.profile.target_position <= limit  # PMD-CMD-29
        if mode == ds.BRK_ACTL_POS:
            return self.encoder.actual >= limit  # PMD-CMD-30
        return mode == ds.BRK_ACTL_NEG and self.encoder.actual <= limit  # PMD-CMD-31

    def _check_error(self) -> None:
        """Compare target and actual position (PMD-STL-1)."""
        # PMD-STL-1: with ratio 0 nothing is compared, and nothing is found.
        if not self.step_ratio:
            self.position_error = 0
            return
        # PMD-STL-1, PMD-AMB-26: target minus actual, the order in which the section names them.
        error = self._expected() - self.encoder.counted - self._error_offset
        self.position_error = max(-32_768, min(32_767, error))
        if self._has_motion_error():
            self.unread |= ds.MOTION_ERROR & ~self.events
            self.events |= ds.MOTION_ERROR
            # PMD-STL-1: with auto stop the motor goes off as by MTR_OFF.
            if self.auto_stop and self.motor_on:
                self.disable()

    def _expected(self) -> int:
        """Where the encoder should be for the target position (counts)."""
        # PMD-STL-1: rounded down, by the ratio's 8 fraction bits; without the wraps, which the
        # encoder has at other places.
        return self.profile.travelled() * self.step_ratio >> 8

    def _has_motion_error(self) -> bool:
        # PMD-STL-1: larger than the limit, not equal to it.
        return self.step_ratio != 0 and abs(self.position_error) > self.position_error_limit

    def zero_error(self) -> None:
        """Make the present position error the new zero (PMD-STL-2)."""
        self.position_error = 0
        # PMD-STL-2: or a new ratio, or number, would be an error at once.
        self._error_offset = self._expected() - self.encoder.counted

    # -- update -------------------------------------------------------------------------------

    def loaded(self) -> Rule | None:
        """Return what to say of the buffer if it has what no update has taken."""
        buffer, active = self.buffer, self._taken if self._update_pending else self.active
        if buffer.differs(active) or buffer.stop + buffer.smooth_stop + buffer.synch > 0:
            return ds.LEFT_LOADED
        if not self.motor_command_given or buffer.motor_command == active.motor_command:
            return None
        # A breakpoint that is set is to bring it, or the host at the end of the motion.
        waits = self.breakpoint_mode != ds.BRK_OFF or self.profile.in_motion()
        return ds.LEFT_LOADED if waits else ds.CURRENT_LEFT

    def up_to_date(self) -> bool:
        """Whether an update now would change nothing: of a move that goes on, or has ended."""
        if self._update_pending or self.position_given or self.motor_command_given:
            return False
        return self.motor_on and self.profile.settled(self.active) and not self.loaded()

    def unused(self) -> str:
        """Return rates that are loaded and new, and do nothing in the profile mode in force."""
        buffer, active = self.buffer, self._taken if self._update_pending else self.active
        names = [
            name
            for name in _UNUSED[self.profile.mode]
            if getattr(buffer, name) != getattr(active, name)
        ]
        return ", ".join(names).replace("_", " ")

    def starts_fast(self) -> bool:
        """Whether an update now gives a velocity below the starting velocity (PMD-CMD-14)."""
        ramps = self.profile.mode in (ds.TRAPEZOIDAL, ds.VELOCITY)
        return ramps and 0 < self.buffer.velocity < self.start_velocity

    def waits_for_motor(self) -> bool:
        """Whether an update now would begin a motion, were the motor on (PMD-MTR-2)."""
        return not self.motor_on and self._begins()

    def moves_unwatched(self) -> bool:
        """Whether a motion begins with an error limit that no step ratio has ever served."""
        limited = self.position_error_limit != ERROR_LIMIT
        return limited and not self.step_ratio and not self.watched and self._begins()

    def begun(self) -> bool:
        """Whether a move is under way, or about to be, that no breakpoint has begun."""
        coming = self._update_pending and self._position_taken
        return (coming or self.profile.in_motion()) and not self.events & ds.BREAKPOINT

    def _begins(self) -> bool:
        buffer, mode = self.buffer, self.profile.mode
        if buffer.stop or buffer.smooth_stop or buffer.velocity == 0:
            return False
        if mode == ds.VELOCITY:
            return buffer.acceleration != 0
        elsewhere = buffer.position != self.profile.target_position
        return mode != ds.GEAR and self.position_given and elsewhere

    def request_update(self) -> None:
        """UPDATE acts: what is in the buffer now is copied at the next cycle (NOTES 5)."""
        buffer, taken = self.buffer, self._taken
        stop = buffer.stop | taken.stop
        smooth_stop = buffer.smooth_stop | taken.smooth_stop
        synch = buffer.synch | taken.synch
        # PMD-UPD-1: the three actions are used up by one update; numbers stay in the buffer.
        buffer.stop = buffer.smooth_stop = buffer.synch = 0
        taken.copy(buffer)
        taken.stop, taken.smooth_stop, taken.synch = stop, smooth_stop, synch
        # PMD-TRJ-12: that SET_POS was given counts, whatever its number.
        self._position_taken |= self.position_given
        self.position_given = False
        self._motor_command_taken |= self.motor_command_given
        self.motor_command_given = False
        self._update_pending = True

    def _update(self) -> None:
        """Copy the registers taken and carry out the actions taken (PMD-UPD-1)."""
        taken, profile = self._taken, self.profile
        stop, smooth, synch = taken.stop, taken.smooth_stop, taken.synch
        taken.stop = taken.smooth_stop = taken.synch = 0
        given, self._position_taken = self._position_taken, False
        self._update_pending = False
        before = self.active.position
        refused = self._copy(taken)
        if stop and smooth:
            # PMD-TRJ-11: STOP counts, and both are used up.
            self._report(ds.STOP_TWICE, f"axis {self.number + 1}: STOP wins over SMOOTH_STOP")
        # PMD-AMB-5: the target becomes the actual position, as the reference says; two other places
        # say the reverse.
        if synch:
            self._renumber(self.encoder.actual)
        # PMD-ERR-1, PMD-ERR-2: status bit 7; all that is not refused has been copied.
        if refused:
            self._refuse(refused)
        # PMD-TRJ-9: at once, in any mode; motion is complete at rest too.
        if stop:
            profile.halt()
            self.events |= ds.MOTION_COMPLETE  # PMD-TRJ-9
            return
        # PMD-TRJ-10: a gear takes no notice of it.
        if smooth and profile.mode != ds.GEAR:
            # With the motor off it rests, and goes on waiting.
            if not self.motor_on or profile.smooth_stop():
                self.events |= ds.MOTION_COMPLETE  # PMD-TRJ-10, at rest
            return
        if not self.motor_on:
            return  # PMD-MTR-2
        # PMD-ERR-3, PMD-LIM-3: away from the switch a move begins as ever.
        if self._shared.sensing and profile.mode in (ds.TRAPEZOIDAL, ds.S_CURVE):
            positive, negative = self._limits()
            way = (taken.position << 32) - profile.position
            if (way > 0 and positive) or (way < 0 and negative):
                self._refuse("the move leads toward an active limit switch")  # PMD-ERR-3
                self.active.position = before
                return
        if profile.start(self.active, given):
            self.events |= ds.MOTION_COMPLETE  # PMD-TRJ-12
        elif given and profile.stuck(self.active):
            self._report(
                ds.NO_RATE,
                f"axis {self.number + 1}: the update of a move with velocity {self.active.velocity}"
                f" and acceleration {self.active.acceleration}: it does not begin",
            )

    def _copy(self, buffer: ProfileRegisters) -> str:
        """Copy buffer to active, but for what must not change in motion; say what was refused."""
        active, profile = self.active, self.profile
        refused = ""
        kept: tuple[str, ...] = ()
        if profile.in_motion():
            # PMD-TRJ-3, PMD-AMB-13: in motion a trapezoid takes a position and a velocity; beside
            # another acceleration it takes the position alone.
            if profile.mode == ds.TRAPEZOIDAL and buffer.acceleration != active.acceleration:
                refused = "acceleration changed in a trapezoidal move"  # PMD-ERR-1
                kept = ("velocity", "acceleration")
            elif profile.mode == ds.S_CURVE and (
                buffer.velocity != active.velocity
                or buffer.max_acceleration != active.max_acceleration
                or buffer.jerk != active.jerk
            ):
                refused = "velocity, acceleration or jerk changed in an S-curve move"  # PMD-ERR-2
                kept = ("velocity", "max_acceleration", "jerk")
        active.copy(buffer, ("motor_command", *kept))
        self._copy_motor_command(buffer.motor_command)
        return refused

    def _copy_motor_command(self, buffered: int) -> None:
        """Copy the buffered motor command if SET_BUF_MTR_CMD has given one (NOTES 6)."""
        active = self.active
        # PMD-UPD-1: only what SET_BUF_MTR_CMD has given since, or a driver that uses SET_MTR_CMD
        # alone lost its motor with its first update.
        if self._motor_command_taken:
            active.motor_command = buffered
            self._motor_command_from = UPDATED
            self._motor_command_taken = False
        elif self._motor_command_from == DIRECT and active.motor_command != buffered:
            self._motor_command_from = DIRECT_REPORTED
            self._report(
                ds.MOTOR_COMMAND_LOST,
                f"axis {self.number + 1}: motor command {active.motor_command} set by SET_MTR_CMD"
                f" stays; an update of every register would bring the buffered {buffered}",
            )

    def _refuse(self, why: str) -> None:
        self.unread |= ds.COMMAND_ERROR & ~self.events
        self.events |= ds.COMMAND_ERROR
        self._report(ds.COMMAND_REFUSED, f"axis {self.number + 1}: {why}")

    # -- commands of this axis ----------------------------------------------------------------

    def set_profile(self, mode: int) -> None:
        """SET_PRFL_S_CRV, _TRAP, _VEL and _GEAR: at once (PMD-CMD-4 to PMD-CMD-7)."""
        # PMD-TRJ-13: into a point-to-point mode the axis should be at rest.
        if self.profile.set_mode(mode, self.active.position):
            self._report(ds.MOVING, f"axis {self.number + 1} is in motion")

    def set_position(self, value: int) -> None:
        """SET_POS: that it was given at all counts too (PMD-CMD-8, PMD-TRJ-12)."""
        self.buffer.position = value
        self.position_given = True

    def set_buffered_motor_command(self, value: int) -> None:
        """SET_BUF_MTR_CMD: the amplitude from the next update on (PMD-CMD-66)."""
        self.buffer.motor_command = value
        self.motor_command_given = True

    def set_motor_command(self, value: int) -> None:
        """SET_MTR_CMD: past the buffer (PMD-CMD-64)."""
        if self._update_pending and self._motor_command_taken:
            self._report(
                ds.MOTOR_COMMAND_LOST,
                f"axis {self.number + 1}: the update that came before SET_MTR_CMD {value} acts"
                f" after it, and brings the buffered {self._taken.motor_command}",
            )
        self.active.motor_command = value
        self._motor_command_from = DIRECT

    def set_start_velocity(self, value: int) -> None:
        """SET_START_VEL: at once, but not in motion (PMD-CMD-14)."""
        if self.profile.in_motion():
            # PMD-CMD-14: the manual forbids it in motion.
            self._refuse("start velocity changed in motion")
        else:
            self.start_velocity = value

    def set_step_ratio(self, value: int) -> None:
        """SET_STEP_RATIO: counts per ustep times 256; the error starts from 0."""
        self.step_ratio = value
        self.watched |= value != 0
        self.zero_error()

    def renumber(self, value: int) -> None:
        """SET_ACTL_POS: both positions take a number, and nothing moves (PMD-CMD-69)."""
        self.encoder.renumber(value)
        self._renumber(value)

    def _renumber(self, target: int) -> None:
        before = self.profile.position
        self.profile.set_target(target)
        self.stepper.renumber(before, self.profile.position)
        self.zero_error()

    def disable(self) -> None:
        """MTR_OFF: freeze the microstep angle; the windings keep their currents (PMD-MTR-2)."""
        # PMD-MTR-2: an axis that moved has come to its end.
        if self.profile.in_motion():
            self.events |= ds.MOTION_COMPLETE
        self.motor_on = False
        self.profile.halt()

    def enable(self) -> None:
        """MTR_ON: enable the generator; nothing moves until the next update (PMD-MTR-1)."""
        # PMD-MTR-1: given in motion, it stops the axis: that ends a motion.
        if self.profile.in_motion():
            self.events |= ds.MOTION_COMPLETE
        self.motor_on = True
        self.profile.halt()
        self.zero_error()

    def clear_events(self, keep: int) -> None:
        """Clear the events whose bits in ``keep`` are 0, but no lasting error (PMD-STA-4)."""
        # PMD-STA-4: as long as the error is beyond its limit the bit stays.
        if self._has_motion_error():
            keep |= ds.MOTION_ERROR
        if self.unread & ~keep:
            text = f"{self.unread_errors()} is cleared, and no status word has shown it to the host"
            self._report(ds.ERROR_UNREAD, text)
            self.unread &= keep
        # PMD-STA-2: nothing but a command or a reset clears an event.
        self.events &= keep & ds.EVENTS

    def unread_errors(self) -> str:
        """Return the axis and what of :attr:`unread` is set, in words."""
        return f"axis {self.number + 1}: {names_of(ds.STATUS_BITS, self.unread)}"

    # -- rest ---------------------------------------------------------------------------------

    def idle_cycles(self) -> int:
        """Return how many coming cycles would change nothing; 0 if the next may do something."""
        if (
            self._update_pending
            or not self.profile.resting(self.active)
            or not self.stepper.still()
            or not self.encoder.resting()
        ):
            return 0
        positive, negative = self._limits()
        # What the next cycle may do is asked here once: every answer of 0 runs that cycle.
        if not self.limits.steady(positive, negative, self.events, self._shared.sensing):
            return 0
        if self.breakpoint_met() or (
            self._has_motion_error() and not self.events & ds.MOTION_ERROR
        ):
            return 0
        # Everything but time stands still while an axis rests.
        if self.breakpoint_mode != ds.BRK_TIME:
            return FOR_EVER
        # The cycle in which the time is equal is run.
        return self.breakpoint_value - self._shared.time - 1 & 0xFFFFFFFF


NO_AXIS: Final = -1


class Interrupts:
    """~HostIntrpt and the axis it is low for (PMD-INT-1 to PMD-INT-5).

    Args:
        chip: the chip set whose pin it is.
        axes: its axes.
    """

    STATE: ClassVar[Names] = ("axis", "quiet_until")
    WIRING: ClassVar[Names] = ("_axes",)

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
        # PMD-INT-1, PMD-INT-4: an interrupt that stands is the only one until RST_INTRPT.
        if self.axis != NO_AXIS or self.quiet_until != NEVER:
            return
        for axis in self._axes:
            # PMD-INT-2, PMD-AMB-12: a level of bits 7 to 0; of two axes the lower number.
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
        # PMD-INT-3: RST_INTRPT alone ends the interrupt; the current axis stays (PMD-INT-5).
        self.axis = NO_AXIS
        # PMD-INT-3: a host that waits for an edge must see the line high.
        self.quiet_until = self._chip.instant + self._chip.clock.span_up(1)
        self._chip.put(self._pin, HIGH)
