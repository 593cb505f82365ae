"""The registers as numbers: those whose new value counts at once, and a sample's picture of all."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.state import Names


class Live:
    """Registers that count from the moment they are written, decoded once for all who use them.

    The register bytes stay the truth for the bus. Whoever may have changed them from outside
    calls :meth:`look`; the core keeps :attr:`dac` and :attr:`pwm` up to date by itself.

    Args:
        registers: the register bytes.

    Attributes:
        config: R02.
        feature: R01.
        frame: clocks of a PWM frame.
        dac: 12-bit code of the DAC port.
        pwm: motor command of the PWM, signed, in 1/16 of an R09 step.
        pre: clocks per count of the sample timer.
        counts: counts per sample.
        break_at: R3F-R3D, signed.
    """

    __slots__ = ("_bytes", "break_at", "config", "counts", "dac", "feature", "frame", "pre", "pwm")
    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, registers: bytearray) -> None:
        self._bytes: bytearray = registers
        self.config: i64 = 0
        self.feature: i64 = 0
        self.frame: i64 = 1
        self.dac: i64 = 0
        self.pwm: i64 = 0
        self.pre: i64 = 1
        self.counts: i64 = 1
        self.break_at: i64 = 0
        self.look()

    def look(self) -> None:
        """Take the register bytes as they are."""
        image = bytes(self._bytes)
        self.config = image[ds.CONFIG]
        self.feature = image[ds.FEATURE]
        self.frame = ds.PWM_RESOLUTION[image[ds.ENCODER_PWM] & 0x0F]
        self.dac = word(image, ds.MOTOR_COMMAND, ds.MOTOR_COMMAND_LOW) >> 4
        pwm = word(image, ds.PWM_COMMAND, ds.PWM_FRACTION) >> 4
        self.pwm = pwm - 0x1000 if pwm >= 0x800 else pwm
        self.pre = word(image, ds.PRESCALER_MSB, ds.PRESCALER_LSB) + 1
        timer: i64 = image[ds.SAMPLE_TIMER]
        self.counts = timer + 1
        self.break_at = long_word(image, ds.BREAK_MSB, ds.BREAK_CSB, ds.BREAK_LSB)


class Picture:
    """What a control sample computes from: the registers as they were at its start.

    Attributes:
        flag: R00.
        feature: R01.
        config: R02.
        capture: R03.
        exception: R04.
        forced: R46.
        command: R0C-R0E, signed.
        increment: R0B, signed.
        final: R2B-R29, signed.
        high_velocity: R23-R25, signed, 1/256 count per sample (MCP-REG-24).
        goal: velocity command of the integral velocity mode, 1/256 count per sample (MCP-VEL-1).
        top: top velocity of a profile, 1/256 count per sample (MCP-TRP-1).
        accel: R27, R26: 1/256 count per sample squared (MCP-REG-25).
        jerk: R55, R54: 1/65536 count per sample cubed.
        segment: binary logarithm of the samples of an interpolation segment (R18).
        ratio: R1C, R1D.
        lead_zero: R20.
        lead_pole: R21.
        lead_gain: R22.
        backlash: R44.
        deadband: R45.
        max_error: R4A, R49.
        limit: R4B.
        dac_offset: R0A, signed.
        feed_forward: R57, R56, signed.
        kp: R61.
        ki: R62.
        kd: R63.
        span: R64.
        integral_limit: R66, R65.
        ka: R69.
        kv: R6A.
    """

    __slots__ = (
        "accel", "backlash", "capture", "command", "config", "dac_offset", "deadband",
        "exception", "feature", "feed_forward", "final", "flag", "forced", "goal",
        "high_velocity", "increment", "integral_limit", "jerk", "ka", "kd", "ki", "kp", "kv",
        "lead_gain", "lead_pole", "lead_zero", "limit", "max_error", "ratio", "segment", "span",
        "top",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self) -> None:
        self.flag: i64 = 0
        self.feature: i64 = 0
        self.config: i64 = 0
        self.capture: i64 = 0
        self.exception: i64 = 0
        self.forced: i64 = 0
        self.command: i64 = 0
        self.increment: i64 = 0
        self.final: i64 = 0
        self.high_velocity: i64 = 0
        self.goal: i64 = 0
        self.top: i64 = 0
        self.accel: i64 = 0
        self.jerk: i64 = 0
        self.segment: i64 = 1
        self.ratio: i64 = 0
        self.lead_zero: i64 = 0
        self.lead_pole: i64 = 0
        self.lead_gain: i64 = 0
        self.backlash: i64 = 0
        self.deadband: i64 = 0
        self.max_error: i64 = 0
        self.limit: i64 = 0
        self.dac_offset: i64 = 0
        self.feed_forward: i64 = 0
        self.kp: i64 = 0
        self.ki: i64 = 0
        self.kd: i64 = 0
        self.span: i64 = 0
        self.integral_limit: i64 = 0
        self.ka: i64 = 0
        self.kv: i64 = 0

    def take(self, image: bytes) -> None:
        """Decode ``image``, the register bytes."""
        self.flag = image[ds.FLAG]
        self.feature = image[ds.FEATURE]
        self.config = image[ds.CONFIG]
        self.capture = image[ds.CAPTURE_CONTROL]
        self.exception = image[ds.EXCEPTION]
        self.forced = image[ds.FORCED_EXCEPTION]
        self.command = long_word(image, ds.COMMAND_MSB, ds.COMMAND_CSB, ds.COMMAND_LSB)
        self.increment = byte(image, ds.COMMAND_INCREMENT)
        self.final = long_word(image, ds.FINAL_MSB, ds.FINAL_CSB, ds.FINAL_LSB)
        self.high_velocity = long_word(image, ds.VELOCITY_MSB, ds.VELOCITY_CSB, ds.VELOCITY_LSB)
        if self.feature & ds.HIGH_RESOLUTION:
            self.goal = self.high_velocity
            self.top = self.goal if self.goal >= 0 else -self.goal
        else:
            self.goal = byte(image, ds.VELOCITY_COMMAND) * 256
            top: i64 = image[ds.PROFILE_VELOCITY]
            self.top = (top & 0x7F) << 8
        self.accel = word(image, ds.ACCEL_MSB, ds.ACCEL_LSB) & 0x7FFF
        self.jerk = word(image, ds.JERK_MSB, ds.JERK_LSB)
        segment: i64 = image[ds.INTERPOLATOR_PRESET]
        self.segment = (segment & 7) + 1
        self.ratio = word(image, ds.RATIO_MSB, ds.RATIO_FRACTION)
        self.lead_zero = image[ds.LEAD_ZERO]
        self.lead_pole = image[ds.LEAD_POLE]
        self.lead_gain = image[ds.LEAD_GAIN]
        self.backlash = image[ds.BACKLASH]
        self.deadband = image[ds.DEADBAND]
        self.max_error = word(image, ds.MAX_ERROR_MSB, ds.MAX_ERROR_LSB)
        self.limit = image[ds.SATURATION]
        self.dac_offset = byte(image, ds.DAC_OFFSET)
        forward = word(image, ds.FEED_FORWARD_MSB, ds.FEED_FORWARD_LSB)
        self.feed_forward = forward - 0x10000 if forward >= 0x8000 else forward
        self.kp = image[ds.KP]
        self.ki = image[ds.KI]
        self.kd = image[ds.KD]
        self.span = image[ds.DERIVATIVE_SPAN]
        self.integral_limit = word(image, ds.INTEGRAL_LIMIT_MSB, ds.INTEGRAL_LIMIT_LSB) & 0x7FFF
        self.ka = image[ds.KA]
        self.kv = image[ds.KV]


def byte(image: bytes, place: i64) -> i64:
    """Return a byte as a signed number."""
    value: i64 = image[place]
    return value - 0x100 if value >= 0x80 else value


def word(image: bytes, msb: i64, lsb: i64) -> i64:
    """Return two bytes as an unsigned number."""
    high: i64 = image[msb]
    low: i64 = image[lsb]
    return high << 8 | low


def long_word(image: bytes, msb: i64, csb: i64, lsb: i64) -> i64:
    """Return three bytes as a signed number."""
    high: i64 = image[msb]
    value = high << 16 | word(image, csb, lsb)
    return value - 0x1000000 if value >= 0x800000 else value
