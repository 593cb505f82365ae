"""The registers: as they stand, and as they were when the last control sample began."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.generated.registers import Registers
from vbus.core.state import Names

FAR: Final = (1 << 62) - 1
"""A clock cycle that does not come."""


class SampledRegisters(Registers):
    """What a control sample computes from."""

    DERIVED: ClassVar[Names] = ()

    @property
    def accel(self) -> i64:
        """Acceleration, 1/256 count per sample squared (MCP-REG-25)."""
        return self.acceleration & 0x7FFF

    @property
    def velocity_goal(self) -> i64:
        """Velocity command of integral velocity mode, 1/256 count per sample (MCP-VEL-1)."""
        if self.feature & ds.HIGH_RESOLUTION:
            return self.velocity
        return self.velocity_command << 8

    @property
    def top_velocity(self) -> i64:
        """Top velocity of a profile, 1/256 count per sample (MCP-TRP-1)."""
        # MCP-AMB-1: by bit 5 of R01, as the register's table has it.
        if not self.feature & ds.HIGH_RESOLUTION:
            # MCP-REG-26, MCP-AMB-2: R28, not R40; its bit 7 is not used.
            return (self.profile_velocity & 0x7F) << 8
        velocity = self.velocity
        # MCP-TRP-1: of a negative R23 to R25 the size counts.
        if velocity < 0:
            velocity = -velocity
        return velocity


class RegisterFile(Registers):
    """The registers as they stand; the only owner of their numbers and of their bytes.

    Attributes:
        sampled: the same when the last control sample began.
    """

    STATE: ClassVar[Names] = ("image: bytes[128]",)

    def __init__(self) -> None:
        super().__init__()
        self.sampled: Final[SampledRegisters] = SampledRegisters()

    def sample(self) -> None:
        """A control sample begins: it computes from the registers as they are now."""
        self.sampled.copy(self)

    def reset(self, *names: str) -> None:
        """Load the reset values of the registers named, or of all."""
        for name in names or tuple(row.name for row in ds.REGISTERS):
            row = ds.REGISTERS[name]
            for address, byte in zip(row.addresses, row.reset.to_bytes(row.bits // 8), strict=True):
                self.put(address, byte)

    def fault(self, flag: i64) -> None:
        """An active-low error flag becomes 0; the direction of motion is noted (MCP-STA-3)."""
        # MCP-STA-3: the direction is that of the moment in which the flag falls.
        if self.status & flag:
            self.status &= ~(flag | ds.DIRECTION)
            if self.actual_velocity < 0:
                self.status |= ds.DIRECTION

    # -- what some of them mean ---------------------------------------------------------------

    @property
    def step_mode(self) -> bool:
        """Whether Pulse and Sign carry steps; they are counted, not the encoder (MCP-STP-1)."""
        return self.config & ds.STEP_MODE != 0

    @property
    def dac(self) -> i64:
        """12-bit code of the DAC port."""
        return self.motor_command << 4 | self.motor_command_low >> 4

    @property
    def pwm(self) -> i64:
        """Motor command of the PWM, in 1/16 of an R09 step."""
        return self.pwm_command << 4 | self.pwm_fraction >> 4

    def drive(self, dac: i64, pwm: i64) -> None:
        """Put the DAC port's code and the PWM's motor command where they are read and go out."""
        self.motor_command = dac >> 4
        self.motor_command_low = (dac & 0x0F) << 4
        self.pwm_command = pwm >> 4
        self.pwm_fraction = (pwm & 0x0F) << 4

    def outputs_off(self) -> None:
        """Both motor command outputs to zero."""
        self.drive(ds.DAC_ZERO, 0)
