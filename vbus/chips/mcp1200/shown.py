"""What the core's samples leave in the registers, as numbers until somebody looks."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.picture import long_word, word
from vbus.state import Names


class Shown:
    """The registers a sample writes. Loading and storing them loses nothing.

    Attributes:
        flag: R00.
        capture: R03.
        mode: R05.
        phase: R06.
        status: R07.
        dac: 12-bit code of the DAC port: R08, R4C.
        pwm: motor command of the PWM, its low 12 bits: R09, R4D.
        command: R0C-R0E, its low 24 bits.
        left: R19.
        error: R2C-R2D, its low 16 bits.
        accel_delta: R31-R33, its low 24 bits.
        velocity: R34-R35, its low 16 bits.
        decel: R39-R3B, its low 24 bits.
    """

    __slots__ = (
        "accel_delta", "capture", "command", "dac", "decel", "error", "flag", "left", "mode",
        "phase", "pwm", "status", "velocity",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self) -> None:
        self.flag: i64 = 0
        self.capture: i64 = 0
        self.mode: i64 = 0
        self.phase: i64 = 0
        self.status: i64 = 0
        self.dac: i64 = 0
        self.pwm: i64 = 0
        self.command: i64 = 0
        self.left: i64 = 0
        self.error: i64 = 0
        self.accel_delta: i64 = 0
        self.velocity: i64 = 0
        self.decel: i64 = 0

    def load(self, image: bytes) -> None:
        """Take what the register bytes ``image`` say."""
        self.flag = image[ds.FLAG]
        self.capture = image[ds.CAPTURE_CONTROL]
        self.mode = image[ds.MODE]
        self.phase = image[ds.PHASE]
        self.status = image[ds.STATUS]
        self.dac = word(image, ds.MOTOR_COMMAND, ds.MOTOR_COMMAND_LOW) >> 4
        self.pwm = word(image, ds.PWM_COMMAND, ds.PWM_FRACTION) >> 4
        self.command = long_word(image, ds.COMMAND_MSB, ds.COMMAND_CSB, ds.COMMAND_LSB)
        self.left = image[ds.INTERPOLATOR_COUNT]
        self.error = word(image, ds.ERROR_MSB, ds.ERROR_LSB)
        lsb = ds.ACCEL_DELTA_LSB
        self.accel_delta = long_word(image, lsb + 2, lsb + 1, lsb)
        self.velocity = word(image, ds.ACTUAL_VELOCITY_MSB, ds.ACTUAL_VELOCITY_LSB)
        self.decel = long_word(image, ds.DECEL_LSB + 2, ds.DECEL_LSB + 1, ds.DECEL_LSB)

    def copy(self, other: "Shown") -> None:
        """Become equal to ``other``."""
        self.flag = other.flag
        self.capture = other.capture
        self.mode = other.mode
        self.phase = other.phase
        self.status = other.status
        self.dac = other.dac
        self.pwm = other.pwm
        self.command = other.command
        self.left = other.left
        self.error = other.error
        self.accel_delta = other.accel_delta
        self.velocity = other.velocity
        self.decel = other.decel

    def fault(self, flag: i64) -> None:
        """An active-low error flag becomes 0; the direction of motion is noted (MCP-STA-3)."""
        if self.status & flag:
            self.status &= ~(flag | ds.DIRECTION)
            if self.velocity & 0x8000:
                self.status |= ds.DIRECTION

    def store(self, registers: bytearray) -> None:
        """Put everything where the bus finds it."""
        registers[ds.FLAG] = self.flag
        registers[ds.CAPTURE_CONTROL] = self.capture
        registers[ds.MODE] = self.mode
        registers[ds.PHASE] = self.phase
        registers[ds.STATUS] = self.status
        registers[ds.MOTOR_COMMAND] = self.dac >> 4
        registers[ds.MOTOR_COMMAND_LOW] = self.dac << 4 & 0xF0
        registers[ds.PWM_COMMAND] = self.pwm >> 4 & 0xFF
        registers[ds.PWM_FRACTION] = self.pwm << 4 & 0xF0
        registers[ds.INTERPOLATOR_COUNT] = self.left
        _put(registers, ds.COMMAND_LSB, -1, self.command)
        registers[ds.ERROR_LSB] = self.error & 0xFF
        registers[ds.ERROR_MSB] = self.error >> 8 & 0xFF
        _put(registers, ds.ACCEL_DELTA_LSB, 1, self.accel_delta)
        registers[ds.ACTUAL_VELOCITY_LSB] = self.velocity & 0xFF
        registers[ds.ACTUAL_VELOCITY_MSB] = self.velocity >> 8 & 0xFF
        _put(registers, ds.DECEL_LSB, 1, self.decel)


def _put(registers: bytearray, lsb: i64, up: i64, value: i64) -> None:
    """Store three bytes, the least significant first, from ``lsb`` up or down."""
    registers[lsb] = value & 0xFF
    registers[lsb + up] = value >> 8 & 0xFF
    registers[lsb + up + up] = value >> 16 & 0xFF
