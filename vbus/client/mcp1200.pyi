# Made from vbus/chips/mcp1200 (calls, host) by contrib.generate; change that.
"""The client of the MCP-1200."""

from typing import Final

from vbus.client.access import RegisterCycles
from vbus.client.bus import Bus, Chip, ChipCycles

class Mcp1200Calls(Mcp1200Access):
    """A call for each row of the chip's tables, under the manual's name in lower case.

    Values are plain integers in the chip's own units. Of several words or bytes, the most
    significant one is written first.
    """

    def read_flag(self) -> int:
        """Read Flag Register (R00H, MCP-REG-1).

        Returns 8 bits, unsigned.
        """

    def write_flag(self, value: int) -> None:
        """Write Flag Register (R00H, MCP-REG-1).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_feature(self) -> int:
        """Read Feature Control Register (R01H, MCP-REG-2).

        Returns 8 bits, unsigned.
        """

    def write_feature(self, value: int) -> None:
        """Write Feature Control Register (R01H, MCP-REG-2).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_config(self) -> int:
        """Read Advanced Configuration Register (R02H, MCP-REG-3).

        Returns 8 bits, unsigned.
        """

    def write_config(self, value: int) -> None:
        """Write Advanced Configuration Register (R02H, MCP-REG-3).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_capture_control(self) -> int:
        """Read Capture Control Register (R03H, MCP-REG-4).

        Returns 8 bits, unsigned.
        """

    def write_capture_control(self, value: int) -> None:
        """Write Capture Control Register (R03H, MCP-REG-4).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_exception(self) -> int:
        """Read Exception Handling Register (R04H, MCP-REG-5).

        Returns 8 bits, unsigned.
        """

    def write_exception(self, value: int) -> None:
        """Write Exception Handling Register (R04H, MCP-REG-5).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_mode(self) -> int:
        """Read Mode Brancher (R05H, MCP-REG-6).

        Returns 8 bits, unsigned.
        """

    def write_mode(self, value: int) -> None:
        """Write Mode Brancher (R05H, MCP-REG-6).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_phase(self) -> int:
        """Read Profile Phase Status (R06H, MCP-REG-7).

        Returns 8 bits, unsigned.
        """

    def read_status(self) -> int:
        """Read Status Register (R07H, MCP-REG-8).

        Returns 8 bits, unsigned.
        """

    def write_status(self, value: int) -> None:
        """Write Status Register (R07H, MCP-REG-8).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_motor_command(self) -> int:
        """Read Motor Command Port (MSB) (R08H, MCP-REG-9).

        Returns 8 bits, unsigned, in 1/256 of full scale.
        """

    def write_motor_command(self, value: int) -> None:
        """Write Motor Command Port (MSB) (R08H, MCP-REG-9).

        Args:
            value: 8 bits, unsigned, in 1/256 of full scale, 0 to 255.
        """

    def read_pwm_command(self) -> int:
        """Read PWM Command Port (R09H, MCP-REG-10).

        Returns 8 bits, two's complement, in % of full scale.
        """

    def write_pwm_command(self, value: int) -> None:
        """Write PWM Command Port (R09H, MCP-REG-10).

        Args:
            value: 8 bits, two's complement, in % of full scale, -128 to 127.
        """

    def read_dac_offset(self) -> int:
        """Read Motor Command DAC Offset (R0AH, MCP-REG-11).

        Returns 8 bits, two's complement, in 1/4096 of full scale.
        """

    def write_dac_offset(self, value: int) -> None:
        """Write Motor Command DAC Offset (R0AH, MCP-REG-11).

        Args:
            value: 8 bits, two's complement, in 1/4096 of full scale, -128 to 127.
        """

    def read_command_increment(self) -> int:
        """Read Command Position Increment (R0BH, MCP-REG-12).

        Returns 8 bits, two's complement, in count.
        """

    def write_command_increment(self, value: int) -> None:
        """Write Command Position Increment (R0BH, MCP-REG-12).

        Args:
            value: 8 bits, two's complement, in count, -128 to 127.
        """

    def read_command_position(self) -> int:
        """Read Command Position (R0CH, R0DH, R0EH, MCP-REG-13).

        Returns 24 bits, two's complement, in count.
        """

    def write_command_position(self, value: int) -> None:
        """Write Command Position (R0CH, R0DH, R0EH, MCP-REG-13).

        Args:
            value: 24 bits, two's complement, in count, -8388608 to 8388607.
        """

    def read_sample_timer(self) -> int:
        """Read Sample Timer (R0FH, MCP-REG-14).

        Returns 8 bits, unsigned, in pre-scalar period.
        """

    def write_sample_timer(self, value: int) -> None:
        """Write Sample Timer (R0FH, MCP-REG-14).

        Args:
            value: 8 bits, unsigned, in pre-scalar period, 0 to 255.
        """

    def read_prescaler(self) -> int:
        """Read Sample Timer Pre-scalar (R10H, R11H, MCP-REG-15).

        Returns 16 bits, unsigned, in clk.
        """

    def write_prescaler(self, value: int) -> None:
        """Write Sample Timer Pre-scalar (R10H, R11H, MCP-REG-15).

        Args:
            value: 16 bits, unsigned, in clk, 0 to 65535.
        """

    def read_actual_position(self) -> int:
        """Read Read Actual Position (R12H, R13H, R14H, MCP-REG-16).

        Returns 24 bits, two's complement, in count.
        """

    def read_preset_position(self) -> int:
        """Read Preset Actual Position (R15H, R16H, R17H, MCP-REG-17).

        Returns 24 bits, two's complement, in count.
        """

    def write_preset_position(self, value: int) -> None:
        """Write Preset Actual Position (R15H, R16H, R17H, MCP-REG-17).

        Args:
            value: 24 bits, two's complement, in count, -8388608 to 8388607.
        """

    def read_interpolator_preset(self) -> int:
        """Read Interpolator Counter Preset (R18H, MCP-REG-18).

        Returns 8 bits, unsigned.
        """

    def write_interpolator_preset(self, value: int) -> None:
        """Write Interpolator Counter Preset (R18H, MCP-REG-18).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_interpolator_count(self) -> int:
        """Read Interpolator Counter Value (R19H, MCP-REG-19).

        Returns 8 bits, unsigned, in sample.
        """

    def read_encoder_pwm(self) -> int:
        """Read Encoder Filter Clock / PWM Resolution (R1AH, MCP-REG-20).

        Returns 8 bits, unsigned.
        """

    def write_encoder_pwm(self, value: int) -> None:
        """Write Encoder Filter Clock / PWM Resolution (R1AH, MCP-REG-20).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_step_width(self) -> int:
        """Read Stepper Pulse Width (R1BH, MCP-REG-21).

        Returns 8 bits, unsigned, in clk.
        """

    def write_step_width(self, value: int) -> None:
        """Write Stepper Pulse Width (R1BH, MCP-REG-21).

        Args:
            value: 8 bits, unsigned, in clk, 0 to 255.
        """

    def read_encoder_ratio(self) -> int:
        """Read Encoder / Stepper Ratio (R1CH, R1DH, MCP-REG-22).

        Returns 16 bits, unsigned, in 1/256 count/step.
        """

    def write_encoder_ratio(self, value: int) -> None:
        """Write Encoder / Stepper Ratio (R1CH, R1DH, MCP-REG-22).

        Args:
            value: 16 bits, unsigned, in 1/256 count/step, 0 to 65535.
        """

    def read_lead_zero(self) -> int:
        """Read Lead Filter Zero (R20H, MCP-REG-23).

        Returns 8 bits, unsigned.
        """

    def write_lead_zero(self, value: int) -> None:
        """Write Lead Filter Zero (R20H, MCP-REG-23).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_lead_pole(self) -> int:
        """Read Lead Filter Pole (R21H, MCP-REG-23).

        Returns 8 bits, unsigned.
        """

    def write_lead_pole(self, value: int) -> None:
        """Write Lead Filter Pole (R21H, MCP-REG-23).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_lead_gain(self) -> int:
        """Read Lead Filter Gain (R22H, MCP-REG-23).

        Returns 8 bits, unsigned.
        """

    def write_lead_gain(self, value: int) -> None:
        """Write Lead Filter Gain (R22H, MCP-REG-23).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_velocity(self) -> int:
        """Read High Resolution Velocity (R23H, R24H, R25H, MCP-REG-24).

        Returns 24 bits, two's complement, in 1/256 count/sample.
        """

    def write_velocity(self, value: int) -> None:
        """Write High Resolution Velocity (R23H, R24H, R25H, MCP-REG-24).

        Args:
            value: 24 bits, two's complement, in 1/256 count/sample, -8388608 to 8388607.
        """

    def read_acceleration(self) -> int:
        """Read Acceleration (R27H, R26H, MCP-REG-25).

        Returns 16 bits, unsigned, in 1/256 count/sample².
        """

    def write_acceleration(self, value: int) -> None:
        """Write Acceleration (R27H, R26H, MCP-REG-25).

        Args:
            value: 16 bits, unsigned, in 1/256 count/sample², 0 to 65535.
        """

    def read_profile_velocity(self) -> int:
        """Read Profile Velocity (Low Res) (R28H, MCP-REG-26).

        Returns 8 bits, unsigned, in count/sample.
        """

    def write_profile_velocity(self, value: int) -> None:
        """Write Profile Velocity (Low Res) (R28H, MCP-REG-26).

        Args:
            value: 8 bits, unsigned, in count/sample, 0 to 255.
        """

    def read_final_position(self) -> int:
        """Read Final Position (R2BH, R2AH, R29H, MCP-REG-27).

        Returns 24 bits, two's complement, in count.
        """

    def write_final_position(self, value: int) -> None:
        """Write Final Position (R2BH, R2AH, R29H, MCP-REG-27).

        Args:
            value: 24 bits, two's complement, in count, -8388608 to 8388607.
        """

    def read_position_error(self) -> int:
        """Read Position Error (R2DH, R2CH, MCP-REG-28).

        Returns 16 bits, two's complement, in count.
        """

    def read_capture(self) -> int:
        """Read Capture Count (R30H, R2FH, R2EH, MCP-REG-29).

        Returns 24 bits, two's complement, in count.
        """

    def read_accel_delta(self) -> int:
        """Read Accel. Delta Position (R33H, R32H, R31H, MCP-REG-30).

        Returns 24 bits, unsigned, in count.
        """

    def read_actual_velocity(self) -> int:
        """Read Actual Velocity (R35H, R34H, MCP-REG-31).

        Returns 16 bits, two's complement, in count/sample.
        """

    def read_decel_position(self) -> int:
        """Read Deceleration Position (R3BH, R3AH, R39H, MCP-REG-32).

        Returns 24 bits, two's complement, in count.
        """

    def read_velocity_command(self) -> int:
        """Read Velocity Command (R3CH, MCP-REG-33).

        Returns 8 bits, two's complement, in count/sample.
        """

    def write_velocity_command(self, value: int) -> None:
        """Write Velocity Command (R3CH, MCP-REG-33).

        Args:
            value: 8 bits, two's complement, in count/sample, -128 to 127.
        """

    def read_breakpoint(self) -> int:
        """Read Break-point Position (R3FH, R3EH, R3DH, MCP-REG-34).

        Returns 24 bits, two's complement, in count.
        """

    def write_breakpoint(self, value: int) -> None:
        """Write Break-point Position (R3FH, R3EH, R3DH, MCP-REG-34).

        Args:
            value: 24 bits, two's complement, in count, -8388608 to 8388607.
        """

    def read_backlash(self) -> int:
        """Read Backlash (R44H, MCP-REG-35).

        Returns 8 bits, unsigned, in count.
        """

    def write_backlash(self, value: int) -> None:
        """Write Backlash (R44H, MCP-REG-35).

        Args:
            value: 8 bits, unsigned, in count, 0 to 255.
        """

    def read_deadband(self) -> int:
        """Read Deadband (R45H, MCP-REG-36).

        Returns 8 bits, unsigned, in count.
        """

    def write_deadband(self, value: int) -> None:
        """Write Deadband (R45H, MCP-REG-36).

        Args:
            value: 8 bits, unsigned, in count, 0 to 255.
        """

    def read_forced_exception(self) -> int:
        """Read Forced Exception Register (R46H, MCP-REG-37).

        Returns 8 bits, unsigned.
        """

    def write_forced_exception(self, value: int) -> None:
        """Write Forced Exception Register (R46H, MCP-REG-37).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_max_error(self) -> int:
        """Read Maximum Error (R4AH, R49H, MCP-REG-38).

        Returns 16 bits, unsigned, in count.
        """

    def write_max_error(self, value: int) -> None:
        """Write Maximum Error (R4AH, R49H, MCP-REG-38).

        Args:
            value: 16 bits, unsigned, in count, 0 to 65535.
        """

    def read_saturation(self) -> int:
        """Read Saturation Foldback Setting (R4BH, MCP-REG-39).

        Returns 8 bits, unsigned, in 1/256 of full scale.
        """

    def write_saturation(self, value: int) -> None:
        """Write Saturation Foldback Setting (R4BH, MCP-REG-39).

        Args:
            value: 8 bits, unsigned, in 1/256 of full scale, 0 to 255.
        """

    def read_motor_command_low(self) -> int:
        """Read Motor Command Port (extended) (R4CH, MCP-REG-40).

        Returns 8 bits, unsigned.
        """

    def write_motor_command_low(self, value: int) -> None:
        """Write Motor Command Port (extended) (R4CH, MCP-REG-40).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_pwm_fraction(self) -> int:
        """Read PWM Command Port (extended) (R4DH, MCP-REG-41).

        Returns 8 bits, unsigned.
        """

    def write_pwm_fraction(self, value: int) -> None:
        """Write PWM Command Port (extended) (R4DH, MCP-REG-41).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_jerk(self) -> int:
        """Read Jerk (R55H, R54H, MCP-REG-42).

        Returns 16 bits, unsigned, in 1/65536 count/sample³.
        """

    def write_jerk(self, value: int) -> None:
        """Write Jerk (R55H, R54H, MCP-REG-42).

        Args:
            value: 16 bits, unsigned, in 1/65536 count/sample³, 0 to 65535.
        """

    def read_feed_forward(self) -> int:
        """Read Command Feed-forward (R57H, R56H, MCP-REG-43).

        Returns 16 bits, two's complement, in 1/256 count/sample.
        """

    def write_feed_forward(self, value: int) -> None:
        """Write Command Feed-forward (R57H, R56H, MCP-REG-43).

        Args:
            value: 16 bits, two's complement, in 1/256 count/sample, -32768 to 32767.
        """

    def read_kp(self) -> int:
        """Read Proportional Gain, Kp (R61H, MCP-REG-44).

        Returns 8 bits, unsigned.
        """

    def write_kp(self, value: int) -> None:
        """Write Proportional Gain, Kp (R61H, MCP-REG-44).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_ki(self) -> int:
        """Read Integral Gain, Ki (R62H, MCP-REG-44).

        Returns 8 bits, unsigned.
        """

    def write_ki(self, value: int) -> None:
        """Write Integral Gain, Ki (R62H, MCP-REG-44).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_kd(self) -> int:
        """Read Derivative Gain, Kd (R63H, MCP-REG-44).

        Returns 8 bits, unsigned.
        """

    def write_kd(self, value: int) -> None:
        """Write Derivative Gain, Kd (R63H, MCP-REG-44).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_derivative_span(self) -> int:
        """Read Derivative Span (R64H, MCP-REG-45).

        Returns 8 bits, unsigned, in sample.
        """

    def write_derivative_span(self, value: int) -> None:
        """Write Derivative Span (R64H, MCP-REG-45).

        Args:
            value: 8 bits, unsigned, in sample, 0 to 255.
        """

    def read_integral_limit(self) -> int:
        """Read Integral Limit (R66H, R65H, MCP-REG-46).

        Returns 16 bits, unsigned.
        """

    def write_integral_limit(self, value: int) -> None:
        """Write Integral Limit (R66H, R65H, MCP-REG-46).

        Args:
            value: 16 bits, unsigned, 0 to 65535.
        """

    def read_ka(self) -> int:
        """Read Accel Feed-forward, Kaff (R69H, MCP-REG-47).

        Returns 8 bits, unsigned.
        """

    def write_ka(self, value: int) -> None:
        """Write Accel Feed-forward, Kaff (R69H, MCP-REG-47).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

    def read_kv(self) -> int:
        """Read Velocity Feed-forward, Kvff (R6AH, MCP-REG-47).

        Returns 8 bits, unsigned.
        """

    def write_kv(self, value: int) -> None:
        """Write Velocity Feed-forward, Kvff (R6AH, MCP-REG-47).

        Args:
            value: 8 bits, unsigned, 0 to 255.
        """

PROFILE: Final = 0
POSITION_INTERPOLATION: Final = 3
VELOCITY_INTERPOLATION: Final = 4
VELOCITY: Final = 5
FIRST_EXTENDED: Final = 64

class Mcp1200Access(RegisterCycles):
    """One MCP-1200: values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.bus.Bus.chip`; or a bus
            with one chip.
        checked: read back every register that reads as it was written.
    """

    checked: bool

    def __init__(self, cycles: ChipCycles, *, checked: bool = False) -> None: ...
    def extend(self) -> None:
        """Switch extended addressing on (R02 bit 0), whatever else R02 holds."""

    def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` as a number, by extended addressing if need be."""

    def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write the register at ``addresses``, by extended addressing if need be.

        Raises:
            ReadBackError: the register reads otherwise (``checked``).
            ValueError: the value does not fit.
        """

class Mcp1200(Mcp1200Calls):
    """One axis on an MCP-1200.

    Positions are counts, velocities and accelerations 1/256 count per sample (per sample).

    Args:
        bus: the session.
        chip: the chip's name on the board; None if there is only one.
        checked: read back every register that reads as it was written, and flags after they are
            set or cleared.
    """

    bus: Bus
    chip: Chip

    def __init__(self, bus: Bus, chip: str | None = None, *, checked: bool = False) -> None: ...
    def wait_flags(self, bits: int, level: int, longest: str = "10s") -> int:
        """Read the flag register until ``bits`` of it are ``level``; return it.

        Raises:
            NotReadyError: they are not, after ``longest`` of chip time.
        """

    def reset(self) -> None:
        """Reset by software and wait for idle mode (MCP-RST-4, MCP-RST-5)."""

    def control(self) -> None:
        """Close the loop and wait until it is closed (MCP-MOD-6)."""

    def idle(self) -> None:
        """Turn the motor off and wait until it is off (MCP-MOD-2)."""

    def halt(self) -> None:
        """Stop where the axis is, and hold it there until :meth:`control` (MCP-MOD-7)."""

    def set_flag(self, number: int) -> None:
        """Set a mode flag by number: :data:`PROFILE`, :data:`VELOCITY` and so on."""

    def clear_flag(self, number: int) -> None:
        """Clear a mode flag by number."""

    def feature(self, **switches: bool) -> None:
        """Switch features on or off, others stay: ``pid``, ``s_curve``, ``unipolar`` …

        Raises:
            ValueError: no such feature; says which there are.
        """

    def move(
        self,
        final: int,
        *,
        velocity: int,
        acceleration: int,
        jerk: int | None = None,
        longest: str = "60s",
    ) -> int:
        """Move to ``final`` and wait for the end of the profile; return the actual position.

        Args:
            final: final position, counts.
            velocity: top velocity, 1/256 count per sample.
            acceleration: 1/256 count per sample per sample.
            jerk: 1/65536 count per sample cubed for an S-curve; None makes a trapezoid.
            longest: chip time after which the move is given up.

        Raises:
            NotReadyError: the profile has not ended after ``longest`` of chip time.
            ReadBackError: the command position has ended elsewhere (``checked``).
        """

    def home(
        self, *, velocity: int, acceleration: int, rising: bool = False, longest: str = "60s"
    ) -> int:
        """Run at ``velocity`` until the index is captured, stop, and return its position.

        Args:
            velocity: 1/256 count per sample; its sign is the direction.
            acceleration: 1/256 count per sample per sample.
            rising: the edge of INDEX that is wanted.
            longest: chip time after which the search is given up.

        Raises:
            NotReadyError: no index has come after ``longest`` of chip time.
        """
