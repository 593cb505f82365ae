"""The servo axis: position, flags, and what one sample does (LM-TRJ-17)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.pid import Pid
from vbus.chips.lm628.profile import Trajectory
from vbus.chips.tables import names_of
from vbus.core import state
from vbus.core.bits import clamp, wrap, wrap_word
from vbus.core.options import Settings
from vbus.core.state import Names

START_NONE: Final = 0
START_STOP: Final = 1
START_FULL: Final = 2

_HALF: Final = ds.POSITION_MAX + 1
# LM-CMD-12: RDRV reads C000h to 3FFFh, and no change beyond.
_VELOCITY_MIN: Final = -0x4000
_VELOCITY_MAX: Final = 0x3FFF


class ServoAxis:
    """Registers and sample computation of one chip; knows nothing of time and pins.

    Args:
        settings: the chip's: ``pid_overflow``, ``integral_limit``, and ``reset_status``, where
            ``C4`` is the part whose breakpoint flag cannot be reset until a breakpoint was loaded.

    Attributes:
        profile: the generator.
        pid: the filter.
        count: encoder count at the last sample; the plant's own number.
        real: real position, 31-bit.
        real_change: counts between the last two samples, as RDRV reads it.
        error: position error, saturated to 16 bits.
        following: position error as it is, for plants that follow exactly; 0 with the motor off.
        command: motor command, 16 bits signed.
        flags: status bits 6..1.
        mask: enabled interrupts, bits 6..1.
        motor_off: status bit 7.
        port8: signals bit 8.
        threshold: position error limit.
        stop_on_error: signals bit 9, set by LPES.
        sip: signals bit 0, armed index capture.
        index: index register.
        start: STT waiting for the next sample: START_NONE, START_STOP (its stop bits only), or
            START_FULL.
        udf: UDF waiting for the next sample: signals bit 13.
        breakpoint: position of the breakpoint.
        breakpoint_side: side it lay on when loaded: 1 ahead, -1 behind, 0 here.
        breakpoint_armed: whether it can fire.
        stuck: the breakpoint flag re-asserts itself.
    """

    STATE: ClassVar[Names] = (
        "profile: part", "pid: part", "count", "real", "real_change", "error", "following",
        "command", "flags", "mask", "motor_off: bool", "port8: bool", "threshold",
        "stop_on_error: bool", "sip: bool", "index", "start", "udf: bool", "breakpoint",
        "breakpoint_side", "breakpoint_armed: bool", "stuck: bool", "unseen: bool",
        "interrupts_wanted: bool", "reads", "reads_off", "vain_moves", "off_loaded: bool",
        "passed_over: bool", "port12_wanted: bool",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_settings", "stuck_part")

    def __init__(self, settings: Settings) -> None:
        self._settings: Settings = settings
        self.profile: Trajectory = Trajectory()
        self.pid: Pid = Pid(settings["pid_overflow"] == "wrap", settings["integral_limit"] == "sum")
        self.stuck_part: bool = settings["reset_status"] == "C4"
        """Whether resets end with the breakpoint flag stuck (LM-RST-5)."""
        self.count: i64 = 0
        self.real: i64 = 0
        self.real_change: i64 = 0
        self.error: i64 = 0
        self.following: i64 = 0
        self.command: i64 = 0
        self.flags: i64 = 0
        self.mask: i64 = ds.RESET_MASK
        self.motor_off: bool = True
        self.port8: bool = True
        self.threshold: i64 = ds.THRESHOLD_MAX
        self.stop_on_error: bool = False
        self.sip: bool = False
        self.index: i64 = 0
        self.start: i64 = START_NONE
        self.udf: bool = False
        self.breakpoint: i64 = 0
        self.breakpoint_side: i64 = 0
        self.breakpoint_armed: bool = False
        self.stuck: bool = False
        self.unseen: bool = False
        """HI has risen, and no status byte was read since."""
        self.interrupts_wanted: bool = False
        """MSKI has enabled a flag, and no RSTI has let HI fall since."""
        self.reads: i64 = 0
        """By their codes, which commands the host has read with."""
        self.reads_off: i64 = 0
        """The same since the motor went off."""
        self.vain_moves: i64 = 0
        """Moves with ki above 0 and il 0; -1 once UDF has taken both."""
        self.off_loaded: bool = False
        """The last LTRJ has loaded stop bit 8 at rest."""
        self.passed_over: bool = False
        """A move has begun after LFIL and before UDF."""
        self.port12_wanted: bool = False
        """The last PORT was PORT12, through resets, too."""

    # -- what the host sees -------------------------------------------------------------------

    def interrupt(self) -> bool:
        """Level of HI: any flag that is enabled (LM-STA-7)."""
        # LM-STA-7, LM-AMB-13: a level, no latch: a driver masks around long packets, and the flags
        # raise HI again.
        return self.flags & self.mask != 0

    def may_interrupt(self) -> bool:
        """Whether a sample may move HI: it raises flags, and clears none (LM-STA-7)."""
        return self.mask != 0 and self.flags & self.mask == 0

    def status(self) -> int:
        """Return the status byte without its busy bit (LM-STA-1)."""
        return self.flags | ds.MOTOR_OFF if self.motor_off else self.flags

    @property
    def signals(self) -> int:
        """The signals register (LM-STA-2)."""
        profile = self.profile
        return (
            (0x8000 if self.flags & self.mask else 0)
            | profile.accel_loaded << 14
            | self.udf << 13
            | profile.forward << 12
            | profile.velocity_mode << 11
            | profile.done << 10
            | self.stop_on_error << 9
            | self.port8 << 8
            | self.status()
            | self.sip
        )

    def moving(self) -> bool:
        """Whether the chip is in motion in the sense of LM-TRJ-4."""
        return not self.motor_off and not self.profile.done

    def releases(self, control: int) -> bool:
        """Whether a control word is to turn off the motor of an axis that it holds at rest."""
        at_rest = not (self.motor_off or self.moving() or self.start)
        return at_rest and control & ds.TURN_OFF != 0

    def awaited(self) -> int:
        """Return the flags that a motion is still to raise: its end, an index, a breakpoint."""
        profile = self.profile
        if self.start:
            ends = profile.started & (ds.STOPS | ds.VELOCITY_MODE) != ds.VELOCITY_MODE
        elif self.moving():
            ends = profile.stopping or not profile.velocity_mode
        else:
            return 0
        flags = ds.TRAJECTORY_COMPLETE if ends else 0
        flags |= ds.INDEX if self.sip else 0
        return flags | ds.BREAKPOINT if self.breakpoint_armed else flags

    # -- what commands do ---------------------------------------------------------------------

    def reset(self) -> None:
        """Go to the state in which a reset runs: everything zero, no flag up (LM-RST-2)."""
        fresh = ServoAxis(self._settings)
        fresh.count, fresh.port12_wanted = self.count, self.port12_wanted
        state.load(self, state.save(fresh))

    def finish_reset(self, count: int) -> None:
        """The reset is over, with the encoder at ``count``: that is position 0 (LM-RST-2)."""
        self.count = count
        self.stuck = self.stuck_part
        # LM-RST-5, LM-RST-7, LM-STA-4, LM-AMB-3: motor-off has just risen, which latches bit 2; it
        # is enabled, so HI rises.
        self.flags = ds.TRAJECTORY_COMPLETE | (ds.BREAKPOINT if self.stuck else 0)

    def mask_interrupts(self, enable: int) -> None:
        """MSKI: ones enable (LM-CMD-17)."""
        self.mask = enable & ds.INTERRUPTS
        # LM-STA-7: with a flag enabled, an HI that stands at the end is reported.
        self.interrupts_wanted = self.mask != 0

    def kept_flags(self, keep: int) -> int:
        """Return what RSTI with ``keep`` leaves of the flags (LM-CMD-18, LM-RST-6)."""
        # LM-STA-3, LM-CMD-18: a 0 clears the flag of its number; nothing else but a reset does.
        flags = self.flags & keep
        return flags | ds.BREAKPOINT if self.stuck else flags

    def set_breakpoint(self, position: int) -> None:
        """SBPA: arm the breakpoint and remember from which side it comes (LM-POS-5)."""
        self.breakpoint = wrap(position, ds.POSITION_BITS)
        self._look_at_breakpoint()
        self.breakpoint_armed = True
        # LM-RST-5: the flag asserts itself until a breakpoint has been loaded.
        self.stuck = False

    def _look_at_breakpoint(self) -> None:
        self.breakpoint_side = (self.breakpoint > self.real) - (self.breakpoint < self.real)

    def define_home(self) -> None:
        """DFH: here is 0; desired position and active target move along (LM-POS-4)."""
        # LM-POS-4: all by the same number, so that neither loop nor move notices; the buffered
        # position stays.
        self.profile.shift(self.real)
        self.real = 0
        # The number of the breakpoint stays, so it may lie on the other side now (LM-POS-5).
        self._look_at_breakpoint()

    def capture(self, position: int) -> None:
        """The index pulse has come at ``position`` (LM-POS-3)."""
        # LM-AMB-10: here the register changes, and not when SIP is given.
        self.index = wrap(position, ds.POSITION_BITS)
        # LM-POS-3: further pulses do nothing until SIP is given again.
        self.sip = False
        self.flags |= ds.INDEX

    def request_start(self) -> bool:
        """STT: have the next sample take it; False if it is refused (LM-TRJ-4)."""
        profile = self.profile
        if profile.accel_loaded and self.moving():
            stops = profile.control & ds.STOPS
            # LM-TRJ-4: an acceleration that was changed waits until the motion is over, with bit 14
            # up.
            if not stops:
                # LM-AMB-12: beside the wrong direction of data, this sets the flag.
                self.flags |= ds.COMMAND_ERROR
                return False
            # Stop bits of an STT that still waits for its sample count beside those of this one.
            profile.started = profile.started | stops if self.start else stops
            profile.control &= ~ds.STOPS
            # LM-TRJ-4: a stop is carried out all the same, or the error could never be left.
            self.start = max(self.start, START_STOP)
        else:
            profile.start()
            self.start = START_FULL
        return True

    def request_update(self) -> None:
        """UDF: have the next sample use what is loaded now (LM-CMD-5)."""
        self.pid.send()
        self.udf = True
        self.passed_over = False
        if self.pid.sent[2] and self.pid.sent[4]:
            self.vain_moves = -1

    # -- the sample ---------------------------------------------------------------------------

    def sample(self, count: i64) -> i64:
        """Run one sample with the encoder at ``count`` (LM-TRJ-17); return :attr:`command`."""
        change = count - self.count
        self.count = count
        self.real_change = change
        real = self.real + change
        # LM-POS-2: positions have 31 bits and come round, which bit 4 tells.
        if real < ds.POSITION_MIN or real > ds.POSITION_MAX:
            real = wrap_word(real, _HALF)
            self.flags |= ds.WRAPAROUND
            self._wrap(real, change)
        self.real = real

        # LM-STA-9: bits 12 and 11 of RDSIGS change in this sample, not when STT is written.
        if self.start:
            self._take_start()
        # LM-CMD-5: coefficients change between two filter computations; bit 13 falls.
        if self.udf:
            self.pid.update()
            self.udf = False

        command: i64 = 0
        if self.motor_off:
            self.error = self.following = 0
        else:
            profile = self.profile
            if profile.step():
                self.flags |= ds.TRAJECTORY_COMPLETE  # LM-STA-4, LM-AMB-2: latched
            # LM-PID-2: a difference of 31 bits.
            error = (profile.position >> 16) - real
            if error < ds.POSITION_MIN or error > ds.POSITION_MAX:  # LM-PID-2
                error = wrap_word(error, _HALF)
            self.following = error
            # LM-PID-2: the filter sees 16 bits of the error; a plant that follows exactly sees all
            # of it.
            if error > 32767:
                error = 32767
            elif error < -32768:
                error = -32768
            self.error = error
            size = error if error >= 0 else -error
            # LM-POS-6: judged in every sample, so RSTI alone does not keep the flag down; a motor
            # that is turned off has no output in this very sample.
            if size <= self.threshold or not self._stray():
                command = self.pid.step(error)
        self.command = command

        # LM-POS-5, LM-AMB-6: reached or passed, from either side.
        if self.breakpoint_armed:
            ahead = (self.breakpoint > real) - (self.breakpoint < real)
            if ahead == 0 or ahead != self.breakpoint_side:
                self.flags |= ds.BREAKPOINT
                # LM-POS-5: it fires once.
                self.breakpoint_armed = False
        if self.profile.wrapped:  # LM-POS-2
            self.profile.wrapped = False
            self.flags |= ds.WRAPAROUND
        return command

    def _wrap(self, real: i64, change: i64) -> None:
        """The real position comes round to ``real``: it passes the breakpoint, or changes sides.

        Either counts as LM-POS-5 says.
        """
        place, before = self.breakpoint, self.real
        if change > 0:
            passed = place >= before or place <= real
        else:
            passed = place <= before or place >= real
        # On neither side it fires in this sample.
        self.breakpoint_side = 0 if passed else (place > real) - (place < real)

    def _stray(self) -> bool:
        """The error is beyond its limit: tell whether that turns the motor off."""
        # LM-PID-2: the size of an error is 7FFFh at most here, which the threshold after reset is
        # not below.
        if self.error == -32768 and self.threshold == 32767:
            return False
        self.flags |= ds.POSITION_ERROR
        if not self.stop_on_error:
            return False
        # LM-STA-4: bit 7 rises while bit 10 is 0, so the OR of the two does.
        if not self.profile.done:
            self.flags |= ds.TRAJECTORY_COMPLETE
        self._turn_off()
        self.following = 0
        return True

    def _turn_off(self) -> None:
        """LM-TRJ-10: no drive, no profile, no integral; the position is still tracked."""
        # LM-STA-6: by LPES, and by STT with bit 8; a reset has it set from the beginning.
        self.motor_off = True
        self.profile.velocity = 0
        self.pid.clear()

    def _take_start(self) -> None:
        """Take an accepted STT (LM-TRJ-5 to LM-TRJ-9)."""
        profile = self.profile
        # LM-TRJ-4: of an STT that was refused but for its stop the buffers stay where they are.
        if self.start == START_FULL:
            profile.take_buffers()
        self.start = START_NONE
        stops = profile.started & ds.STOPS
        # LM-TRJ-5: of several stop bits 8 counts before 9, and 9 before 10.
        if stops & ds.TURN_OFF:
            if not self.motor_off and not profile.done:
                self.flags |= ds.TRAJECTORY_COMPLETE
            self._turn_off()
            return
        if self.motor_off:
            # The filter was cleared when the motor went off.
            # LM-STA-6, LM-TRJ-7: any other STT turns the motor on, from where the axis stands.
            self.motor_off = False
            profile.hold(self.real)
        profile.stopping = False
        # LM-STA-5: bit 10 falls with the next STT that is accepted.
        profile.done = False
        if stops & ds.STOP_ABRUPTLY:
            # LM-TRJ-8, LM-AMB-8: the target becomes the real position, not the desired one; the
            # loop stays closed.
            profile.hold(self.real)
            profile.target = self.real
            profile.done = True
            self.flags |= ds.TRAJECTORY_COMPLETE
        elif stops & ds.STOP_SMOOTHLY:
            profile.stopping = True

    @property
    def real_velocity(self) -> int:
        """What RDRV reads: whole counts per sample (LM-CMD-12)."""
        return clamp(self.real_change, _VELOCITY_MIN, _VELOCITY_MAX)

    def signal_names(self) -> str:
        """Return the names of the signals that are set."""
        return names_of(ds.SIGNALS, self.signals, " ")

    # -- rest ---------------------------------------------------------------------------------

    def steady(self) -> bool:
        """Whether the filter's derivative has come to rest, if it runs at all."""
        return self.motor_off or self.pid.steady(self.error)

    def skip(self, samples: int) -> None:
        """Let samples pass that would change nothing."""
        if not self.motor_off:
            self.pid.skip(samples)

    def course(self) -> tuple[int, ...]:
        """Return everything a sample changes, but for the place in the derivative interval.

        Whether il limits follows from it: with the same error it cannot change twice.
        """
        profile, pid = self.profile, self.pid
        return (
            self.count, self.real, self.real_change, self.error, self.following, self.command,
            self.flags, self.motor_off, self.breakpoint_armed, self.start, self.udf,
            profile.position, profile.velocity, profile.target, profile.stopping, profile.done,
            pid.sum, pid.term, pid.derivative, pid.last_error,
        )  # fmt: skip
