"""The outputs: PWM frames, what the plant is driven with, and all of it on the pins."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.control_loop import CONTROL, HELD, NO_REQUEST, STANDING, ControlLoop
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.chips.mcp1200.pid import Following
from vbus.chips.mcp1200.registers import FAR, RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.core.options import Value
from vbus.core.signals import HIGH, LOW, Pin
from vbus.core.state import Names

NOT_RELEASED: Final = -1
"""/RESET has not risen just now."""
FULL: Final = 1600.0
""":data:`~vbus.chips.mcp1200.datasheet.PWM_FULL` as a float."""
ZERO: Final = 2048.0


def frame_clocks(setting: i64) -> i64:
    """Return the clocks of a PWM frame by R1A bits 3-0: 100, 150, 200, 300 to 1600 (MCP-OUT-5)."""
    # MCP-OUT-5: 9 to 15 are as 8.
    if setting > 8:
        setting = 8
    # MCP-AMB-18: by R1A; the division by 100 that is printed elsewhere is its setting 0.
    clocks: i64 = 100
    if setting & 1:
        clocks = 150
    return clocks << (setting >> 1)


def within(command: i64) -> i64:
    """A motor command, cut to what is 100 % of a PWM: 1600 of 2048 (MCP-OUT-4, MCP-OUT-5)."""
    if command > ds.PWM_FULL:
        return ds.PWM_FULL
    if command < -ds.PWM_FULL:
        return -ds.PWM_FULL
    return command


def sign_of(command: i64) -> i64:
    """Level of Sign for a motor command: 1 = negative."""
    if command < 0:
        return 1
    return 0


class Pwm:
    """The Pulse and Sign pins while they carry sign/magnitude PWM, frame by frame.

    A frame's duty and sign are those of the command at its start (MCP-OUT-7). Nothing runs
    between two looks at it: :meth:`roll` computes which frame is under way, and must be called
    before the command or one of its settings changes.

    Args:
        registers: the registers.

    Attributes:
        start: cycle at which the frame under way began.
        length: its clocks.
        high: how many of them Pulse is high.
        sign: level of Sign (1 = negative).
        released: cycle in which Pulse is high after a hard reset (MCP-RST-1), else
            :data:`NOT_RELEASED`.
    """

    STATE: ClassVar[Names] = ("start", "length", "high", "sign")
    DERIVED: ClassVar[Names] = ("released",)  # saved by the axis

    def __init__(self, registers: RegisterFile) -> None:
        self._registers: Final[RegisterFile] = registers
        self.released: i64 = NOT_RELEASED
        self.start: i64 = 0
        self.length: i64 = frame_clocks(0)
        self.high: i64 = 0
        self.sign: i64 = 0

    def restart(self, cycle: i64) -> None:
        """Begin a frame at ``cycle`` with nothing before it."""
        self.start = cycle
        command = self._registers.pwm
        self.sign = sign_of(command)
        self.length = self._clocks()
        self.high = self._duty(command, self.length)

    def _clocks(self) -> i64:
        """Clocks of a frame that begins now."""
        return frame_clocks(self._registers.encoder_pwm & 0x0F)

    def _duty(self, command: i64, length: i64) -> i64:
        """Clocks for which Pulse is high in a frame of ``length`` clocks that begins now."""
        command = within(command)
        # MCP-OUT-6, MCP-AMB-3: by bit 7 of R02; 0 is half a frame.
        if self._registers.config & ds.PWM_BIAS:
            return (ds.PWM_FULL + command) * length // (2 * ds.PWM_FULL)
        if command < 0:
            command = -command
        return command * length // ds.PWM_FULL

    def roll(self, cycle: i64) -> None:
        """Come to the frame that is under way at ``cycle``."""
        start = self.start + self.length
        if cycle < start:
            return
        # MCP-OUT-7: duty and sign are those of the frame's beginning.
        command = self._registers.pwm
        sign = sign_of(command)
        changed = sign != self.sign
        self.sign = sign
        length = self._clocks()
        self.length = length
        past = cycle - start
        # Only the first whole frame after a change of sign is held low (MCP-OUT-8).
        if past < length and changed and self._registers.config & ds.SIGN_INHIBIT:
            self.high = 0
        else:
            self.high = self._duty(command, length)
        # Frames in which nothing changed are passed over by one division.
        self.start = cycle - past % length

    def level(self, cycle: int) -> int:
        """Level of Pulse in a cycle of the frame under way."""
        return int(cycle - self.start < self.high)

    def next_edge(self, cycle: int) -> int:
        """Return a cycle after ``cycle`` not later than the next edge of Pulse or Sign."""
        fall = self.start + self.high
        if cycle < fall < self.start + self.length:
            return fall
        if self.steady():
            return FAR
        return self.start + self.length

    def steady(self) -> bool:
        """Whether every further frame is the same level throughout, as long as no host writes."""
        command = self._registers.pwm
        if 0 < self.high < self.length or self.sign != sign_of(command):
            return False
        length = self._clocks()
        high = self._duty(command, length)
        return (high == 0) == (self.high == 0) and (high == length) == (self.high == self.length)


class PlantDrive:
    """Gives the plant, period by period, the motor command or the steps that are on the pins.

    Args:
        registers: the registers.
        encoder: runs the plant.
        stepper: source of steps.
        following: where plants go that follow exactly.
        settings: the chip's board file keys: which output the amplifier takes, and what a
            unipolar one means.
    """

    STATE: ClassVar[Names] = ("_given: float", "_steps")

    def __init__(
        self,
        registers: RegisterFile,
        encoder: EncoderCourse,
        stepper: Stepper,
        following: Following,
        settings: dict[str, Value],
    ) -> None:
        self._registers: Final[RegisterFile] = registers
        self._encoder: Final[EncoderCourse] = encoder
        self._stepper: Final[Stepper] = stepper
        self._following: Final[Following] = following
        self._dac: bool = settings["drive"] == "dac"
        self._clip: bool = settings["unipolar"] == "clip"
        self._given: float = 0.0
        self._steps: i64 = 0

    def level(self) -> float:
        """The motor command as a fraction of full scale."""
        # MCP-STP-1: Pulse and Sign carry steps.
        if self._registers.step_mode:
            return 0.0
        if not self._dac:
            return float(within(self._registers.pwm)) / FULL
        code = self._registers.dac - ds.DAC_ZERO
        unipolar = self._registers.feature & ds.UNIPOLAR
        if unipolar and self._registers.pwm < 0 and not self._clip:
            # An amplifier that gets a magnitude takes its direction from Sign.
            code = -code
        return float(code) / ZERO

    def at_rest(self) -> bool:
        """Whether another period would change nothing."""
        return self._encoder.resting() and self._given == self.level()

    def period(self, end: i64, aiming: bool) -> None:
        """Run the plant from where its last period ended to ``end``.

        Args:
            end: next instant at which its drive may change.
            aiming: the loop is closed; it pulls the axis to where it aims.
        """
        self._given = self.level()
        if self._registers.step_mode:
            sent = self._stepper.sent(end)
            self._encoder.run(end, self._given, 0, True, sent - self._steps)
            self._steps = sent
            return
        error: i64 = 0
        # A plant that follows exactly goes where the loop aims, once it has closed.
        if aiming:
            error = self._encoder.error(self._following.aim())
        self._encoder.run(end, self._given, error, False, 0)


class OutputPins:
    """Puts the pins to the levels that registers and clocks give.

    PWM and step edges are only computed for instants that are observed, or while Pulse or
    Sign are listened to.

    Args:
        chip: whose pins.
        registers: what they show.
        loop: the mode of operation.
        stepper: gives Pulse and Sign in step mode.
        pwm: gives them otherwise.
    """

    def __init__(
        self, chip: Chip, registers: RegisterFile, loop: ControlLoop, stepper: Stepper, pwm: Pwm
    ) -> None:
        self._registers: Final[RegisterFile] = registers
        self._loop: Final[ControlLoop] = loop
        self._stepper: Final[Stepper] = stepper
        self._pwm: Final[Pwm] = pwm
        self._prof: Pin = chip.pins["PROF"]
        self._idle: Pin = chip.pins["IDLE"]
        self._busy: Pin = chip.pins["BUSY"]
        self._trig: Pin = chip.pins["TRIG"]
        self._dac: Pin = chip.pins[ds.DAC]
        self._pulse: Pin = chip.pins["PULSE"]
        self._sign: Pin = chip.pins["SIGN"]

    def show(self, cycle: int) -> None:
        """Put every output to its level at ``cycle``."""
        registers = self._registers
        self._prof.drive(self._prof_level())
        self._idle.drive(int(registers.flag & ds.F1 != 0))
        self._busy.drive(registers.status & ds.BUSY)
        # MCP-MOD-3: in idle mode as the host wrote it: without offset, unipolar mode or saturation.
        self._dac.drive(registers.dac)
        self._trig.drive(self._trig_level())
        self.show_pulse(cycle)

    def _prof_level(self) -> int:
        """F2, or the interpolator's busy latch (MCP-FLG-5)."""
        loop, capture = self._loop, self._registers.capture_control
        interpolating = loop.state == CONTROL and loop.mode in (ds.F3, ds.F4)
        if capture & ds.BUSY_ON_PROF and interpolating:
            return int(capture & ds.INTERPOLATOR_BUSY != 0)
        return int(self._registers.flag & ds.F2 != 0)

    def _trig_level(self) -> int:
        """Low while the breakpoint flag stands and the pin is an output (MCP-BRK-1, 5)."""
        registers = self._registers
        low = (
            self._loop.state >= STANDING
            and registers.config & ds.BREAK_ENABLE
            and not registers.capture_control & ds.TRIG_INPUT
            and not registers.status & ds.BREAKPOINT_OK
        )
        return LOW if low else HIGH

    def may_move(self) -> bool:
        """Whether samples, and what comes of them, can move an output that has a listener."""
        registers, loop = self._registers, self._loop
        # The next sample obeys a command for another mode of operation.
        if loop.request != NO_REQUEST:
            return True
        # A sample under way may be one of a profile whose flag the host has cleared since.
        if self._prof.net.heard and (registers.flag & (ds.MODE_FLAGS | ds.F2) or loop.mode):
            return True
        if self._trig.net.heard and (
            registers.config & ds.BREAK_ENABLE and not registers.capture_control & ds.TRIG_INPUT
        ):
            return True
        # A sample that finds the one before unfinished ends in idle mode (MCP-SMP-4).
        if self._idle.net.heard and loop.state == CONTROL:
            return True
        always = (self._busy, self._dac, self._pulse, self._sign)
        return any(pin.net.heard for pin in always)

    def show_pulse(self, cycle: int) -> None:
        """Put Pulse and Sign to their levels at ``cycle``."""
        pwm = self._pwm
        if self._loop.state == HELD:
            self._pulse.drive(LOW)
            self._sign.drive(HIGH)  # MCP-RST-2
        elif self._registers.step_mode:
            self._pulse.drive(self._stepper.level(cycle))
            self._sign.drive(self._stepper.sign)
        else:
            pwm.roll(cycle)
            released = cycle == pwm.released
            if cycle > pwm.released:
                pwm.released = NOT_RELEASED
            self._pulse.drive(HIGH if released else pwm.level(cycle))
            self._sign.drive(pwm.sign)

    def pulse_edge(self, cycle: int) -> int:
        """Return a cycle after ``cycle``, not later than the next edge of Pulse or Sign."""
        pwm = self._pwm
        if self._loop.state == HELD:
            return FAR
        if self._registers.step_mode:
            return self._stepper.next_edge(cycle)
        pwm.roll(cycle)
        edge = pwm.next_edge(cycle)
        if cycle == pwm.released:
            return cycle + 1
        if cycle < pwm.released:
            return min(edge, pwm.released)
        return edge
