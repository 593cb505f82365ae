"""The chip's program: when a sample begins, how long its work takes, which exceptions it obeys, and
what it computes in control mode."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.generated.registers import Registers
from vbus.chips.mcp1200.pid import Following, LeadFilter, PidFilter, dac_code, pwm_command
from vbus.chips.mcp1200.profile import (
    CommandedMotion,
    IntegralVelocity,
    PositionInterpolation,
    SCurveMove,
    Trapezoid,
    VelocityInterpolation,
    stop,
)
from vbus.chips.mcp1200.registers import RegisterFile, SampledRegisters
from vbus.chips.mcp1200.stepper import StallCheck
from vbus.core.bits import wrap_word
from vbus.core.state import Names

HELD: Final = 0
"""/RESET is low, or the supply has just come."""
RESETTING: Final = 1
STANDING: Final = 2
"""Idle mode."""
CONTROL: Final = 3

NO_REQUEST: Final = -1
"""The host has written nothing to R05 since the last sample."""


IDLE: Final = -1
"""Answer of :meth:`ControlLoop.begin`: the sample ends in idle mode."""


class SampleTimer:
    """Counts clocks: each ``pre`` of them lower the counter by one, at zero it reloads.

    A sample starts at each reload. The registers R0F, R10 and R11 are looked at only then
    (MCP-SMP-1, MCP-REG-49).

    Args:
        registers: the registers.

    Attributes:
        start: cycle of the last reload.
        pre: clocks per count, in force since then.
        counts: counts per period.
        running: False while reset or /SYNC holds the counter at zero.
    """

    STATE: ClassVar[Names] = ("start", "pre", "counts", "running: bool")

    def __init__(self, registers: RegisterFile) -> None:
        self._registers: Final[RegisterFile] = registers
        self.start: i64 = 0
        self.pre: i64 = 1
        self.counts: i64 = 1
        self.running: bool = False

    @property
    def period(self) -> i64:
        """Clocks from one sample start to the next, as loaded."""
        return self.pre * self.counts

    @property
    def coming(self) -> i64:
        """Clocks of the next period, as the registers stand now."""
        # MCP-SMP-1: one more than either register says.
        return (self._registers.prescaler + 1) * (self._registers.sample_timer + 1)

    def reload(self, cycle: i64) -> i64:
        """Begin a period at ``cycle`` with the values now in the registers; return its end."""
        self.start = cycle
        # MCP-REG-49: R0F, R10 and R11 take effect here and at no other time.
        self.pre = self._registers.prescaler + 1
        self.counts = self._registers.sample_timer + 1
        self.running = True
        return cycle + self.pre * self.counts

    def count(self, cycle: int) -> int:
        """What R0F reads at ``cycle``: the reload value down to 0."""
        # MCP-SMP-2: /SYNC and a reset clear the timer.
        if not self.running:
            return 0
        return max(self.counts - 1 - (cycle - self.start) // self.pre, 0)


def work_clocks(registers: RegisterFile, mode: i64) -> i64:
    """Return how long the core is busy in a sample (MCP-SMP-3).

    Args:
        registers: the registers as they are at the sample's start.
        mode: flag of the control mode that runs, 0 for position control.
    """
    work: i64 = ds.WORK_BASE
    if registers.config & ds.STEP_MODE:
        work += ds.WORK_STEP
    elif registers.feature & ds.PID:
        work += ds.WORK_PID
    else:
        work += ds.WORK_LEAD
    if mode == ds.F0:
        work += ds.WORK_PROFILE
    elif mode == ds.F5:
        work += ds.WORK_VELOCITY
    elif mode == ds.F3 or mode == ds.F4:
        work += ds.WORK_INTERPOLATION
    if registers.backlash:
        work += ds.WORK_BACKLASH
    if registers.deadband:
        work += ds.WORK_DEADBAND
    return work


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
        # MCP-EXC-6: R46 acts without a flag, and 00 is "report", which does nothing.
        wanted = one << (registers.forced_exception & 3)
        # MCP-EXC-5, MCP-REG-5, MCP-AMB-34: bits 1 and 0 of R04, in every sample while the pin is
        # low.
        if self.limit or limit_low:
            wanted |= one << (setting & 3)
        # MCP-EXC-5, MCP-REG-5: bits 3 and 2.
        if self.stop or stop_low:
            wanted |= one << (setting >> 2 & 3)
        # MCP-BRK-1, MCP-REG-5: bits 5 and 4.
        if self.breakpoint:
            wanted |= one << (setting >> 4 & 3)
        # MCP-ERR-2, MCP-REG-5, MCP-AMB-7: bits 7 and 6.
        if self.error:
            wanted |= one << (setting >> 6)
        self.clear()
        # MCP-EXC-1: the strongest action of all sources: idle, abrupt, deceleration.
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
        # MCP-EXC-3: the flag stays at 0 until R07 is written with the pin high.
        if not status & ds.STOP_OK and setting >> 2 & 3 == ds.DECELERATE:
            return True
        return not status & ds.LIMIT_OK and setting & 3 == ds.DECELERATE


class ControlLoop:
    """What the chip computes once per control sample, in the order of MCP-SMP-5.

    A sample has two ends. :meth:`begin` looks at registers and position as they are at its
    start; :meth:`finish` computes from those, and all results appear together when the
    chip ceases to be busy. What the host writes in between is seen by the next sample.

    Args:
        registers: the registers.
        clip: a unipolar DAC port gives zero of a negative motor command, not its magnitude.

    Attributes:
        state: :data:`HELD`, :data:`RESETTING`, :data:`STANDING` or :data:`CONTROL`.
        request: what the host has written to R05 since the last sample, or :data:`NO_REQUEST`.
        mode: flag of the control mode of this sample (F0, F3, F4, F5), 0 for position control.
        mc: motor command before any limit, in 1/16 of an R08 step.
        halted: the host has halted motion; position control holds until R05 = 03.
        abrupt: this sample makes the present place the command position.
        steps: command change of the sample, for step mode.
        goal_step: by how much a velocity command changed too far, else 0.
        last_position: actual position at the sample before.
        point: R2B-R29 as they were when R29 was last written.
        velocity_point: R23-R25 as they were when R25 was last written.
        command_written: the host has written the command position during this sample.
        increment_written: the host has written R0B during this sample.
    """

    STATE: ClassVar[Names] = (
        "mode", "mc", "halted: bool", "abrupt: bool", "steps", "goal_step", "last_position",
        "point", "velocity_point", "command_written: bool", "increment_written: bool",
        "image = registers.sampled.image: bytes[128]", "_position", "_action", "_last_mode",
        "_dropped", "_entering: bool", "_stopping: bool", "_sampled_point", "_sampled_velocity",
        "command: part", "trapezoid: part", "scurve: part", "velocity: part", "interpolation: part",
        "ramps: part", "following: part", "lead: part", "pid: part", "stall: part", "faults: part",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("request", "state")  # saved by the axis

    def __init__(self, registers: RegisterFile, clip: bool) -> None:
        self.registers: Final[RegisterFile] = registers
        self._clip: bool = clip
        self.command: CommandedMotion = CommandedMotion()
        self.trapezoid: Final[Trapezoid] = Trapezoid()
        self.scurve: Final[SCurveMove] = SCurveMove()
        self.velocity: Final[IntegralVelocity] = IntegralVelocity()
        self.interpolation: Final[PositionInterpolation] = PositionInterpolation()
        self.ramps: Final[VelocityInterpolation] = VelocityInterpolation()
        self.following: Final[Following] = Following()
        self.lead: LeadFilter = LeadFilter()
        self.pid: PidFilter = PidFilter()
        self.stall: Final[StallCheck] = StallCheck()
        self.faults: Final[ExceptionSources] = ExceptionSources()
        self.state: i64 = HELD
        self.request: i64 = NO_REQUEST
        self.mode: i64 = 0
        self.abrupt: bool = False
        self.steps: i64 = 0
        self.goal_step: i64 = 0
        self.command_written: bool = False
        self.increment_written: bool = False
        self._position: i64 = 0
        self._action: i64 = 0
        self._entering: bool = False
        self._sampled_point: i64 = 0
        self._sampled_velocity: i64 = 0
        self._last_mode: i64 = 0
        self._dropped: i64 = 0
        self._stopping: bool = False
        self.halted: bool = False
        self.mc: i64 = 0
        self.last_position: i64 = 0
        self.point: i64 = 0
        self.velocity_point: i64 = 0

    # -- modes --------------------------------------------------------------------------------

    def enter_idle(self) -> None:
        """Motor off, old samples forgotten (MCP-MOD-2)."""
        registers = self.registers
        registers.mode = ds.IDLE_CODE
        # MCP-MOD-2, MCP-FLG-4: F1 rises, and no motion is left.
        registers.flag = registers.flag & ~ds.F2 | ds.F1
        registers.status &= ~ds.BUSY
        # MCP-MOD-2: R08 80h, R4C, R09 and R4D 00.
        registers.outputs_off()
        # Old samples are forgotten (MCP-FLT-5).
        self.lead = LeadFilter()
        self.pid = PidFilter()
        self.stall.clear()
        self.faults.clear()
        self.command.rest()
        registers.phase = 0
        registers.interpolator_count = 0
        self.halted = False
        self.mc = 0
        self._last_mode = 0
        self._stopping = False

    def hard_reset(self) -> None:
        """Load what a soft reset loads, too; no flag is up, not even that of idle (MCP-RST-1)."""
        self.soft_reset()
        self.registers.flag = 0
        self.registers.mode = 0
        self.command = CommandedMotion()
        self.point = 0
        self.velocity_point = 0

    def soft_reset(self) -> None:
        """Load what a soft reset loads, then idle (MCP-RST-4)."""
        # MCP-RST-4: these registers alone; all others keep what they have.
        self.registers.reset(*ds.SOFT_RESET)
        self.command.position = 0
        self.following.clear()
        self.last_position = 0
        self._dropped = 0
        self.enter_idle()

    def enter_control(self, position: i64) -> None:
        """The control loop closes at the command position as it is (MCP-MOD-6)."""
        registers = self.registers
        registers.mode = ds.CONTROL_CODE
        # MCP-MOD-6: F1 and the pin IDLE fall.
        registers.flag &= ~ds.F1
        self.halted = False
        self._dropped = 0
        # What happened in idle mode has its flag; only control mode acts on it (MCP-EXC-1).
        self.faults.clear()
        self.following.begin(position if registers.step_mode else registers.command_position)

    def lacking(self) -> str:
        """Return which gains are all 0, so that no error and no motion gives a motor command."""
        registers = self.registers
        if not registers.feature & ds.PID:
            return "" if registers.lead_gain else "R22, the gain of the lead filter, 0"
        gains = registers.kp | registers.kd
        if registers.integral_limit & 0x7FFF:
            gains |= registers.ki
        forward = registers.kv | registers.ka | registers.feed_forward
        return "" if gains or forward else "all gains of the PID filter 0"

    def drop(self, flags: int) -> None:
        """The host has cleared mode flags: a mode set again before a sample begins anew."""
        self._dropped |= flags

    # -- a sample -----------------------------------------------------------------------------

    def begin(self, position: i64, limit_low: bool, stop_low: bool, halt: bool) -> i64:
        """Begin a sample: exceptions and mode (steps 1 and 3 of MCP-SMP-5).

        Args:
            position: actual position.
            limit_low: /LIMIT is low.
            stop_low: /STOP is low.
            halt: the host has asked to halt motion.

        Returns:
            Clocks the core will be busy, or :data:`IDLE`.
        """
        action = self.faults.action(self.registers, limit_low, stop_low)
        # MCP-EXC-2: idle mode, whatever the mode was.
        if action == ds.GO_IDLE:
            return IDLE
        # MCP-REG-48: registers of several bytes are taken now, all bytes in this instant.
        self.registers.sample()
        # MCP-MOD-7, MCP-AMB-14: of "Halt Motion" the manual gives the name alone.
        if halt:
            self.halted = True  # MCP-MOD-7
            action = ds.ABRUPT
        flags = self.registers.flag
        # MCP-EXC-2: position control holds the axis.
        if self.halted or action == ds.ABRUPT:
            flags = 0
        mode: i64
        # MCP-MOD-8, MCP-AMB-27: the order of the manual's tests: F0, F4, F3, F5.
        if flags & ds.F0:
            mode = ds.F0
        elif flags & ds.F4:
            mode = ds.F4
        elif flags & ds.F3:
            mode = ds.F3
        else:
            mode = flags & ds.F5
            if mode and action == ds.REPORT and self.faults.stands(self.registers):
                action = ds.DECELERATE
        self._action = action
        self._position = position
        self._entering = mode != self._last_mode or self._dropped & mode != 0
        # The velocity is carried into another mode, not into one that begins anew (NOTES 7).
        if self._last_mode == 0 or self._dropped & self._last_mode & mode:
            self.command.velocity = 0
            self.command.fraction = 0
        self._dropped = 0
        self._sampled_point = self.point  # MCP-INT-2
        self._sampled_velocity = self.velocity_point
        self.command_written = False
        self.increment_written = False
        self.mode = mode
        stands = mode == 0 or mode == ds.F3
        # MCP-EXC-2, MCP-AMB-33: where there is no velocity of its own to lower, deceleration is an
        # abrupt stop.
        self.abrupt = action == ds.ABRUPT or (action == ds.DECELERATE and stands)
        self.registers.status |= ds.BUSY
        return work_clocks(self.registers, mode)

    def idle_sample(self, position: i64) -> None:
        """A sample of idle mode: of all results only In-position is shown (MCP-STA-4)."""
        # MCP-MOD-5: velocity and error keep what the last control sample left.
        self.last_position = position
        registers = self.registers
        registers.status &= ~ds.IN_POSITION
        # MCP-STA-4, MCP-MOD-5: "always active", says the manual of this bit.
        if self.following.near(registers, position):
            registers.status |= ds.IN_POSITION

    def finish(self) -> None:
        """Compute the sample and show its results."""
        sampled = self.registers.sampled
        position = self._position
        step_mode = sampled.config & ds.STEP_MODE
        command = self.command
        cleared = self._profile(command, sampled)
        self.registers.flag &= ~cleared
        self._last_mode = self.mode & ~cleared

        # MCP-SMP-6: at the starts of two samples, 16 bits.
        self.registers.actual_velocity = wrap_word(position - self.last_position, 0x8000)
        self.last_position = position

        if self.abrupt and step_mode:
            self.following.begin(command.position)
        self.steps = self.following.step(sampled, command.position, position)
        if step_mode:
            # MCP-STP-4: steps are compared with counts, not a command with a position.
            too_large = self.stall.stalled(sampled)
        else:
            too_large = self.following.too_large
        if too_large:
            # MCP-ERR-2, MCP-AMB-6: status bit 4, of a stall too.
            self.registers.fault(ds.ERROR_OK)
            self.faults.error = True

        # MCP-STP-1: the filters are not used.
        if not step_mode:
            self._drive(command, sampled, self.following.error)
        self._show(command)

    def _profile(self, command: CommandedMotion, sampled: SampledRegisters) -> i64:
        """Move the command position; return the flags to clear."""
        mode = self.mode
        # MCP-TRP-1, MCP-REG-13: a move starts from the command position as the host has left it.
        if (mode == 0 or self._entering) and command.position != sampled.command_position:
            # The host has put it there: a whole count.
            command.position = sampled.command_position
            command.fraction = 0
        self.goal_step = 0
        cleared: i64 = 0
        if self.abrupt:
            command.rest()
            command.position = self._position
            self._stopping = False
            if self._action == ds.ABRUPT:
                # MCP-EXC-2: an abrupt stop clears the mode flags.
                cleared = ds.MODE_FLAGS
            # MCP-AMB-33: F3 stays set; the next point that is loaded goes on.
            elif mode == ds.F3:
                self.interpolation.hold(sampled.final_position)
        elif mode == ds.F0:
            cleared = self._point_to_point(command, sampled)
        elif mode == ds.F4:
            self._interpolate_velocity(command, sampled)
        elif mode == ds.F3:
            self._interpolate_position(command, sampled)
        elif mode == ds.F5:
            self._run_at_velocity(command, sampled)
        else:
            # MCP-VEL-3, MCP-INT-6: without a flag the axis is held where the command is.
            self._hold_position(command, sampled)
            return 0
        self.registers.command_position = command.position
        return cleared

    def _hold_position(self, command: CommandedMotion, sampled: SampledRegisters) -> None:
        command.rest()
        increment = sampled.command_increment
        # MCP-POS-1: used once, then cleared, in position control alone.
        if increment == 0:
            return
        command.position = wrap_word(command.position + increment, 0x800000)
        # A command position that the host has written during the sample is the newer one.
        if not self.command_written:
            self.registers.command_position = command.position
        if not self.increment_written:
            self.registers.command_increment = 0

    def _point_to_point(self, command: CommandedMotion, sampled: SampledRegisters) -> i64:
        command.left = 0
        if self._entering:
            self._stopping = False
            command.phase = 0
            self.trapezoid.begun = False
            self.scurve.begun = False
        if self._action == ds.DECELERATE and not self._stopping:
            self._begin_stop(command, sampled)
        over: i64 = 0
        if not self._stopping:
            # R01 bit 4 may change under way: the other generator begins anew (NOTES 38).
            if sampled.feature & ds.S_CURVE:
                self.trapezoid.begun = False
                over = self.scurve.step(command, sampled)
            else:
                self.scurve.begun = False
                over = self.trapezoid.step(command, sampled)
            if over < 0:
                self._begin_stop(command, sampled)
        if self._stopping:
            # MCP-EXC-2, MCP-TRP-6: by A in every sample, whatever the profile was.
            over = int(stop(command, sampled.accel))
        command.moving = over <= 0
        if over > 0:
            self._stopping = False
            command.phase = 0
            command.fraction = 0
            # MCP-TRP-3: F0, F2 and R06 become 0; position control goes on.
            return ds.F0
        return 0

    def _begin_stop(self, command: CommandedMotion, sampled: SampledRegisters) -> None:
        self._stopping = True
        command.decel_position = command.position
        if sampled.feature & ds.S_CURVE:
            command.fraction = 0

    def _interpolate_position(self, command: CommandedMotion, sampled: SampledRegisters) -> None:
        if self._entering:
            self.interpolation.hold(sampled.final_position)
        busy = sampled.capture_control & ds.INTERPOLATOR_BUSY != 0
        # MCP-INT-2, MCP-INT-3: captured bytes while the latch is set; else, and at the beginning,
        # the registers.
        point = self._sampled_point if busy and not self._entering else sampled.final_position
        if self.interpolation.step(command, sampled, busy or self._entering, point):
            self.registers.capture_control &= ~ds.INTERPOLATOR_BUSY

    def _interpolate_velocity(self, command: CommandedMotion, sampled: SampledRegisters) -> None:
        ramps = self.ramps
        # MCP-INT-5, MCP-MOD-8: the first segment begins at the velocity there is.
        if self._entering:
            ramps.hold(command.velocity)
        busy = sampled.capture_control & ds.INTERPOLATOR_BUSY != 0
        goal = self._sampled_velocity if busy and not self._entering else sampled.velocity
        fresh = busy or self._entering
        # MCP-EXC-2: the command in use becomes 0.
        if self._action == ds.DECELERATE:
            self.registers.velocity = 0
            self.velocity_point = 0
            ramps.slow_down(command, sampled)
            fresh = False
            goal = 0
        if ramps.step(command, sampled, fresh, goal):
            self.registers.capture_control &= ~ds.INTERPOLATOR_BUSY

    def _run_at_velocity(self, command: CommandedMotion, sampled: SampledRegisters) -> None:
        command.left = 0
        command.phase = 0
        if self._entering:
            self.velocity.begun = False
        goal = sampled.velocity_goal
        # MCP-EXC-3: the velocity command is forgotten: clearing the flag does not start the motion
        # again.
        if self._action == ds.DECELERATE:
            goal = 0
            self.velocity.begun = False  # a goal of the chip's own, not the host's
            if sampled.accel == 0:
                command.velocity = 0
            if sampled.feature & ds.HIGH_RESOLUTION:
                self.registers.velocity = 0
            else:
                self.registers.velocity_command = 0
        self.goal_step = self.velocity.step(command, sampled, goal)

    def _drive(self, command: CommandedMotion, sampled: SampledRegisters, error: i64) -> None:
        """Steps 8 and 9: filter and outputs."""
        # MCP-FLT-6: either filter keeps what it remembers while the other runs.
        if sampled.feature & ds.PID:
            velocity = command.velocity
            # MCP-FLT-4: in position control R57:R56 is the velocity for feed-forward.
            if self.mode == 0:
                velocity = sampled.feed_forward
            self.mc = self.pid.step(sampled, error, velocity)
        else:
            self.mc = self.lead.step(sampled, error)
        code = dac_code(sampled, self.mc, error, self._clip)
        pwm = pwm_command(sampled, self.mc, error)
        self.registers.drive(code, pwm)

    def _show(self, command: CommandedMotion) -> None:
        self.registers.mode = ds.HALT_CODE if self.halted else ds.CONTROL_CODE  # MCP-MOD-7
        self.registers.phase = command.phase
        self.registers.interpolator_count = command.left & 0xFF
        self.registers.accel_delta = command.accel_delta & 0xFFFFFF
        self.registers.decel_position = command.decel_position
        # MCP-ERR-4: after the deadband, as the filter sees it.
        self.registers.position_error = self.following.error
        flags = self.registers.flag & ~ds.F2
        # A profile flag set during this sample is in motion from then on (NOTES 3).
        if command.moving or (flags & ds.F0 and not self.halted):
            flags |= ds.F2
        self.registers.flag = flags
        status = self.registers.status & ~(ds.BUSY | ds.IN_POSITION)
        # MCP-STA-4: before the deadband.
        if self.following.in_position:
            status |= ds.IN_POSITION
        self.registers.status = status
