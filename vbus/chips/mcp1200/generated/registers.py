# Made from the register table by vbus.cli.generate; change the table or the generator.
"""The registers of the MCP-1200 as numbers."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.state import Names

NAMES: Final = (
    "accel_delta",
    "acceleration",
    "actual_position",
    "actual_velocity",
    "backlash",
    "breakpoint",
    "capture",
    "capture_control",
    "command_increment",
    "command_position",
    "config",
    "dac_offset",
    "deadband",
    "decel_position",
    "derivative_span",
    "encoder_pwm",
    "encoder_ratio",
    "exception",
    "feature",
    "feed_forward",
    "final_position",
    "flag",
    "forced_exception",
    "integral_limit",
    "interpolator_count",
    "interpolator_preset",
    "jerk",
    "ka",
    "kd",
    "ki",
    "kp",
    "kv",
    "lead_gain",
    "lead_pole",
    "lead_zero",
    "max_error",
    "mode",
    "motor_command",
    "motor_command_low",
    "phase",
    "position_error",
    "prescaler",
    "preset_position",
    "profile_velocity",
    "pwm_command",
    "pwm_fraction",
    "sample_timer",
    "saturation",
    "status",
    "step_width",
    "velocity",
    "velocity_command",
)


class Registers:
    """A number for each row of the register table; the bytes on the bus are made of them.

    Attributes:
        flag: 00H; as the last sample left it.
        feature: 01H; with the next sample.
        config: 02H; at once.
        capture_control: 03H; at once.
        exception: 04H; with the next sample.
        mode: 05H; as the last sample left it.
        phase: 06H; as the last sample left it.
        status: 07H; as the last sample left it.
        motor_command: 08H; 1/256 of full scale; as the last sample left it.
        pwm_command: 09H; signed; % of full scale; as the last sample left it.
        dac_offset: 0AH; signed; 1/4096 of full scale; with the next sample.
        command_increment: 0BH; signed; count; with the next sample.
        command_position: 0CH, 0DH, 0EH; signed; count; as the last sample left it.
        sample_timer: 0FH; pre-scalar period; with the next sample.
        prescaler: 10H, 11H; clk; with the next sample.
        actual_position: 12H, 13H, 14H; signed; count; at once.
        preset_position: 15H, 16H, 17H; signed; count; at once.
        interpolator_preset: 18H; with the next sample.
        interpolator_count: 19H; sample; as the last sample left it.
        encoder_pwm: 1AH; at once.
        step_width: 1BH; clk; at once.
        encoder_ratio: 1CH, 1DH; 1/256 count/step; with the next sample.
        lead_zero: 20H; with the next sample.
        lead_pole: 21H; with the next sample.
        lead_gain: 22H; with the next sample.
        velocity: 23H, 24H, 25H; signed; 1/256 count/sample; with the next sample.
        acceleration: 27H, 26H; 1/256 count/sample²; with the next sample.
        profile_velocity: 28H; count/sample; with the next sample.
        final_position: 2BH, 2AH, 29H; signed; count; with the next sample.
        position_error: 2DH, 2CH; signed; count; as the last sample left it.
        capture: 30H, 2FH, 2EH; signed; count; at once.
        accel_delta: 33H, 32H, 31H; count; as the last sample left it.
        actual_velocity: 35H, 34H; signed; count/sample; as the last sample left it.
        decel_position: 3BH, 3AH, 39H; signed; count; as the last sample left it.
        velocity_command: 3CH; signed; count/sample; with the next sample.
        breakpoint: 3FH, 3EH, 3DH; signed; count; with the next sample.
        backlash: 44H; count; with the next sample.
        deadband: 45H; count; with the next sample.
        forced_exception: 46H; with the next sample.
        max_error: 4AH, 49H; count; with the next sample.
        saturation: 4BH; 1/256 of full scale; with the next sample.
        motor_command_low: 4CH; as the last sample left it.
        pwm_fraction: 4DH; as the last sample left it.
        jerk: 55H, 54H; 1/65536 count/sample³; with the next sample.
        feed_forward: 57H, 56H; signed; 1/256 count/sample; with the next sample.
        kp: 61H; with the next sample.
        ki: 62H; with the next sample.
        kd: 63H; with the next sample.
        derivative_span: 64H; sample; with the next sample.
        integral_limit: 66H, 65H; with the next sample.
        ka: 69H; with the next sample.
        kv: 6AH; with the next sample.
    """

    __slots__ = NAMES
    DERIVED: ClassVar[Names] = NAMES

    def __init__(self) -> None:
        self.flag: i64 = 0
        self.feature: i64 = 0
        self.config: i64 = 0
        self.capture_control: i64 = 0
        self.exception: i64 = 0
        self.mode: i64 = 0
        self.phase: i64 = 0
        self.status: i64 = 0
        self.motor_command: i64 = 0
        self.pwm_command: i64 = 0
        self.dac_offset: i64 = 0
        self.command_increment: i64 = 0
        self.command_position: i64 = 0
        self.sample_timer: i64 = 0
        self.prescaler: i64 = 0
        self.actual_position: i64 = 0
        self.preset_position: i64 = 0
        self.interpolator_preset: i64 = 0
        self.interpolator_count: i64 = 0
        self.encoder_pwm: i64 = 0
        self.step_width: i64 = 0
        self.encoder_ratio: i64 = 0
        self.lead_zero: i64 = 0
        self.lead_pole: i64 = 0
        self.lead_gain: i64 = 0
        self.velocity: i64 = 0
        self.acceleration: i64 = 0
        self.profile_velocity: i64 = 0
        self.final_position: i64 = 0
        self.position_error: i64 = 0
        self.capture: i64 = 0
        self.accel_delta: i64 = 0
        self.actual_velocity: i64 = 0
        self.decel_position: i64 = 0
        self.velocity_command: i64 = 0
        self.breakpoint: i64 = 0
        self.backlash: i64 = 0
        self.deadband: i64 = 0
        self.forced_exception: i64 = 0
        self.max_error: i64 = 0
        self.saturation: i64 = 0
        self.motor_command_low: i64 = 0
        self.pwm_fraction: i64 = 0
        self.jerk: i64 = 0
        self.feed_forward: i64 = 0
        self.kp: i64 = 0
        self.ki: i64 = 0
        self.kd: i64 = 0
        self.derivative_span: i64 = 0
        self.integral_limit: i64 = 0
        self.ka: i64 = 0
        self.kv: i64 = 0

    def copy(self, other: "Registers") -> None:
        """Become equal to ``other``."""
        self.flag = other.flag
        self.feature = other.feature
        self.config = other.config
        self.capture_control = other.capture_control
        self.exception = other.exception
        self.mode = other.mode
        self.phase = other.phase
        self.status = other.status
        self.motor_command = other.motor_command
        self.pwm_command = other.pwm_command
        self.dac_offset = other.dac_offset
        self.command_increment = other.command_increment
        self.command_position = other.command_position
        self.sample_timer = other.sample_timer
        self.prescaler = other.prescaler
        self.actual_position = other.actual_position
        self.preset_position = other.preset_position
        self.interpolator_preset = other.interpolator_preset
        self.interpolator_count = other.interpolator_count
        self.encoder_pwm = other.encoder_pwm
        self.step_width = other.step_width
        self.encoder_ratio = other.encoder_ratio
        self.lead_zero = other.lead_zero
        self.lead_pole = other.lead_pole
        self.lead_gain = other.lead_gain
        self.velocity = other.velocity
        self.acceleration = other.acceleration
        self.profile_velocity = other.profile_velocity
        self.final_position = other.final_position
        self.position_error = other.position_error
        self.capture = other.capture
        self.accel_delta = other.accel_delta
        self.actual_velocity = other.actual_velocity
        self.decel_position = other.decel_position
        self.velocity_command = other.velocity_command
        self.breakpoint = other.breakpoint
        self.backlash = other.backlash
        self.deadband = other.deadband
        self.forced_exception = other.forced_exception
        self.max_error = other.max_error
        self.saturation = other.saturation
        self.motor_command_low = other.motor_command_low
        self.pwm_fraction = other.pwm_fraction
        self.jerk = other.jerk
        self.feed_forward = other.feed_forward
        self.kp = other.kp
        self.ki = other.ki
        self.kd = other.kd
        self.derivative_span = other.derivative_span
        self.integral_limit = other.integral_limit
        self.ka = other.ka
        self.kv = other.kv

    def byte(self, address: i64) -> i64:
        """Return the byte at ``address``; 0 where there is no register."""
        if address < 0x29:
            if address < 0x13:
                if address < 0x09:
                    if address < 0x04:
                        if address < 0x02:
                            if address < 0x01:
                                if address == 0x00:
                                    return self.flag & 0xFF
                            else:
                                if address == 0x01:
                                    return self.feature & 0xFF
                        else:
                            if address < 0x03:
                                if address == 0x02:
                                    return self.config & 0xFF
                            else:
                                if address == 0x03:
                                    return self.capture_control & 0xFF
                    else:
                        if address < 0x06:
                            if address < 0x05:
                                if address == 0x04:
                                    return self.exception & 0xFF
                            else:
                                if address == 0x05:
                                    return self.mode & 0xFF
                        else:
                            if address < 0x07:
                                if address == 0x06:
                                    return self.phase & 0xFF
                            else:
                                if address < 0x08:
                                    if address == 0x07:
                                        return self.status & 0xFF
                                else:
                                    if address == 0x08:
                                        return self.motor_command & 0xFF
                else:
                    if address < 0x0E:
                        if address < 0x0B:
                            if address < 0x0A:
                                if address == 0x09:
                                    return self.pwm_command & 0xFF
                            else:
                                if address == 0x0A:
                                    return self.dac_offset & 0xFF
                        else:
                            if address < 0x0C:
                                if address == 0x0B:
                                    return self.command_increment & 0xFF
                            else:
                                if address < 0x0D:
                                    if address == 0x0C:
                                        return self.command_position >> 16 & 0xFF
                                else:
                                    if address == 0x0D:
                                        return self.command_position >> 8 & 0xFF
                    else:
                        if address < 0x10:
                            if address < 0x0F:
                                if address == 0x0E:
                                    return self.command_position & 0xFF
                            else:
                                if address == 0x0F:
                                    return self.sample_timer & 0xFF
                        else:
                            if address < 0x11:
                                if address == 0x10:
                                    return self.prescaler >> 8 & 0xFF
                            else:
                                if address < 0x12:
                                    if address == 0x11:
                                        return self.prescaler & 0xFF
                                else:
                                    if address == 0x12:
                                        return self.actual_position >> 16 & 0xFF
            else:
                if address < 0x1D:
                    if address < 0x18:
                        if address < 0x15:
                            if address < 0x14:
                                if address == 0x13:
                                    return self.actual_position >> 8 & 0xFF
                            else:
                                if address == 0x14:
                                    return self.actual_position & 0xFF
                        else:
                            if address < 0x16:
                                if address == 0x15:
                                    return self.preset_position >> 16 & 0xFF
                            else:
                                if address < 0x17:
                                    if address == 0x16:
                                        return self.preset_position >> 8 & 0xFF
                                else:
                                    if address == 0x17:
                                        return self.preset_position & 0xFF
                    else:
                        if address < 0x1A:
                            if address < 0x19:
                                if address == 0x18:
                                    return self.interpolator_preset & 0xFF
                            else:
                                if address == 0x19:
                                    return self.interpolator_count & 0xFF
                        else:
                            if address < 0x1B:
                                if address == 0x1A:
                                    return self.encoder_pwm & 0xFF
                            else:
                                if address < 0x1C:
                                    if address == 0x1B:
                                        return self.step_width & 0xFF
                                else:
                                    if address == 0x1C:
                                        return self.encoder_ratio >> 8 & 0xFF
                else:
                    if address < 0x24:
                        if address < 0x21:
                            if address < 0x20:
                                if address == 0x1D:
                                    return self.encoder_ratio & 0xFF
                            else:
                                if address == 0x20:
                                    return self.lead_zero & 0xFF
                        else:
                            if address < 0x22:
                                if address == 0x21:
                                    return self.lead_pole & 0xFF
                            else:
                                if address < 0x23:
                                    if address == 0x22:
                                        return self.lead_gain & 0xFF
                                else:
                                    if address == 0x23:
                                        return self.velocity >> 16 & 0xFF
                    else:
                        if address < 0x26:
                            if address < 0x25:
                                if address == 0x24:
                                    return self.velocity >> 8 & 0xFF
                            else:
                                if address == 0x25:
                                    return self.velocity & 0xFF
                        else:
                            if address < 0x27:
                                if address == 0x26:
                                    return self.acceleration & 0xFF
                            else:
                                if address < 0x28:
                                    if address == 0x27:
                                        return self.acceleration >> 8 & 0xFF
                                else:
                                    if address == 0x28:
                                        return self.profile_velocity & 0xFF
        else:
            if address < 0x44:
                if address < 0x33:
                    if address < 0x2E:
                        if address < 0x2B:
                            if address < 0x2A:
                                if address == 0x29:
                                    return self.final_position & 0xFF
                            else:
                                if address == 0x2A:
                                    return self.final_position >> 8 & 0xFF
                        else:
                            if address < 0x2C:
                                if address == 0x2B:
                                    return self.final_position >> 16 & 0xFF
                            else:
                                if address < 0x2D:
                                    if address == 0x2C:
                                        return self.position_error & 0xFF
                                else:
                                    if address == 0x2D:
                                        return self.position_error >> 8 & 0xFF
                    else:
                        if address < 0x30:
                            if address < 0x2F:
                                if address == 0x2E:
                                    return self.capture & 0xFF
                            else:
                                if address == 0x2F:
                                    return self.capture >> 8 & 0xFF
                        else:
                            if address < 0x31:
                                if address == 0x30:
                                    return self.capture >> 16 & 0xFF
                            else:
                                if address < 0x32:
                                    if address == 0x31:
                                        return self.accel_delta & 0xFF
                                else:
                                    if address == 0x32:
                                        return self.accel_delta >> 8 & 0xFF
                else:
                    if address < 0x3B:
                        if address < 0x35:
                            if address < 0x34:
                                if address == 0x33:
                                    return self.accel_delta >> 16 & 0xFF
                            else:
                                if address == 0x34:
                                    return self.actual_velocity & 0xFF
                        else:
                            if address < 0x39:
                                if address == 0x35:
                                    return self.actual_velocity >> 8 & 0xFF
                            else:
                                if address < 0x3A:
                                    if address == 0x39:
                                        return self.decel_position & 0xFF
                                else:
                                    if address == 0x3A:
                                        return self.decel_position >> 8 & 0xFF
                    else:
                        if address < 0x3D:
                            if address < 0x3C:
                                if address == 0x3B:
                                    return self.decel_position >> 16 & 0xFF
                            else:
                                if address == 0x3C:
                                    return self.velocity_command & 0xFF
                        else:
                            if address < 0x3E:
                                if address == 0x3D:
                                    return self.breakpoint & 0xFF
                            else:
                                if address < 0x3F:
                                    if address == 0x3E:
                                        return self.breakpoint >> 8 & 0xFF
                                else:
                                    if address == 0x3F:
                                        return self.breakpoint >> 16 & 0xFF
            else:
                if address < 0x56:
                    if address < 0x4B:
                        if address < 0x46:
                            if address < 0x45:
                                if address == 0x44:
                                    return self.backlash & 0xFF
                            else:
                                if address == 0x45:
                                    return self.deadband & 0xFF
                        else:
                            if address < 0x49:
                                if address == 0x46:
                                    return self.forced_exception & 0xFF
                            else:
                                if address < 0x4A:
                                    if address == 0x49:
                                        return self.max_error & 0xFF
                                else:
                                    if address == 0x4A:
                                        return self.max_error >> 8 & 0xFF
                    else:
                        if address < 0x4D:
                            if address < 0x4C:
                                if address == 0x4B:
                                    return self.saturation & 0xFF
                            else:
                                if address == 0x4C:
                                    return self.motor_command_low & 0xFF
                        else:
                            if address < 0x54:
                                if address == 0x4D:
                                    return self.pwm_fraction & 0xFF
                            else:
                                if address < 0x55:
                                    if address == 0x54:
                                        return self.jerk & 0xFF
                                else:
                                    if address == 0x55:
                                        return self.jerk >> 8 & 0xFF
                else:
                    if address < 0x64:
                        if address < 0x61:
                            if address < 0x57:
                                if address == 0x56:
                                    return self.feed_forward & 0xFF
                            else:
                                if address == 0x57:
                                    return self.feed_forward >> 8 & 0xFF
                        else:
                            if address < 0x62:
                                if address == 0x61:
                                    return self.kp & 0xFF
                            else:
                                if address < 0x63:
                                    if address == 0x62:
                                        return self.ki & 0xFF
                                else:
                                    if address == 0x63:
                                        return self.kd & 0xFF
                    else:
                        if address < 0x66:
                            if address < 0x65:
                                if address == 0x64:
                                    return self.derivative_span & 0xFF
                            else:
                                if address == 0x65:
                                    return self.integral_limit & 0xFF
                        else:
                            if address < 0x69:
                                if address == 0x66:
                                    return self.integral_limit >> 8 & 0xFF
                            else:
                                if address < 0x6A:
                                    if address == 0x69:
                                        return self.ka & 0xFF
                                else:
                                    if address == 0x6A:
                                        return self.kv & 0xFF
        return 0

    def put(self, address: i64, data: i64) -> None:
        """Store the byte ``data`` at ``address``, if there is a register."""
        if address < 0x29:
            if address < 0x13:
                if address < 0x09:
                    if address < 0x04:
                        if address < 0x02:
                            if address < 0x01:
                                if address == 0x00:
                                    self.flag = data
                            else:
                                if address == 0x01:
                                    self.feature = data
                        else:
                            if address < 0x03:
                                if address == 0x02:
                                    self.config = data
                            else:
                                if address == 0x03:
                                    self.capture_control = data
                    else:
                        if address < 0x06:
                            if address < 0x05:
                                if address == 0x04:
                                    self.exception = data
                            else:
                                if address == 0x05:
                                    self.mode = data
                        else:
                            if address < 0x07:
                                if address == 0x06:
                                    self.phase = data
                            else:
                                if address < 0x08:
                                    if address == 0x07:
                                        self.status = data
                                else:
                                    if address == 0x08:
                                        self.motor_command = data
                else:
                    if address < 0x0E:
                        if address < 0x0B:
                            if address < 0x0A:
                                if address == 0x09:
                                    self.pwm_command = (data ^ 0x80) - 0x80
                            else:
                                if address == 0x0A:
                                    self.dac_offset = (data ^ 0x80) - 0x80
                        else:
                            if address < 0x0C:
                                if address == 0x0B:
                                    self.command_increment = (data ^ 0x80) - 0x80
                            else:
                                if address < 0x0D:
                                    if address == 0x0C:
                                        self.command_position = (
                                            data ^ 0x80
                                        ) - 0x80 << 16 | self.command_position & 0xFFFF
                                else:
                                    if address == 0x0D:
                                        self.command_position = (
                                            self.command_position & -0xFF01 | data << 8
                                        )
                    else:
                        if address < 0x10:
                            if address < 0x0F:
                                if address == 0x0E:
                                    self.command_position = (
                                        self.command_position & -0x100 | data << 0
                                    )
                            else:
                                if address == 0x0F:
                                    self.sample_timer = data
                        else:
                            if address < 0x11:
                                if address == 0x10:
                                    self.prescaler = data << 8 | self.prescaler & 0xFF
                            else:
                                if address < 0x12:
                                    if address == 0x11:
                                        self.prescaler = self.prescaler & -0x100 | data << 0
                                else:
                                    if address == 0x12:
                                        self.actual_position = (
                                            data ^ 0x80
                                        ) - 0x80 << 16 | self.actual_position & 0xFFFF
            else:
                if address < 0x1D:
                    if address < 0x18:
                        if address < 0x15:
                            if address < 0x14:
                                if address == 0x13:
                                    self.actual_position = (
                                        self.actual_position & -0xFF01 | data << 8
                                    )
                            else:
                                if address == 0x14:
                                    self.actual_position = self.actual_position & -0x100 | data << 0
                        else:
                            if address < 0x16:
                                if address == 0x15:
                                    self.preset_position = (
                                        data ^ 0x80
                                    ) - 0x80 << 16 | self.preset_position & 0xFFFF
                            else:
                                if address < 0x17:
                                    if address == 0x16:
                                        self.preset_position = (
                                            self.preset_position & -0xFF01 | data << 8
                                        )
                                else:
                                    if address == 0x17:
                                        self.preset_position = (
                                            self.preset_position & -0x100 | data << 0
                                        )
                    else:
                        if address < 0x1A:
                            if address < 0x19:
                                if address == 0x18:
                                    self.interpolator_preset = data
                            else:
                                if address == 0x19:
                                    self.interpolator_count = data
                        else:
                            if address < 0x1B:
                                if address == 0x1A:
                                    self.encoder_pwm = data
                            else:
                                if address < 0x1C:
                                    if address == 0x1B:
                                        self.step_width = data
                                else:
                                    if address == 0x1C:
                                        self.encoder_ratio = data << 8 | self.encoder_ratio & 0xFF
                else:
                    if address < 0x24:
                        if address < 0x21:
                            if address < 0x20:
                                if address == 0x1D:
                                    self.encoder_ratio = self.encoder_ratio & -0x100 | data << 0
                            else:
                                if address == 0x20:
                                    self.lead_zero = data
                        else:
                            if address < 0x22:
                                if address == 0x21:
                                    self.lead_pole = data
                            else:
                                if address < 0x23:
                                    if address == 0x22:
                                        self.lead_gain = data
                                else:
                                    if address == 0x23:
                                        self.velocity = (
                                            data ^ 0x80
                                        ) - 0x80 << 16 | self.velocity & 0xFFFF
                    else:
                        if address < 0x26:
                            if address < 0x25:
                                if address == 0x24:
                                    self.velocity = self.velocity & -0xFF01 | data << 8
                            else:
                                if address == 0x25:
                                    self.velocity = self.velocity & -0x100 | data << 0
                        else:
                            if address < 0x27:
                                if address == 0x26:
                                    self.acceleration = self.acceleration & -0x100 | data << 0
                            else:
                                if address < 0x28:
                                    if address == 0x27:
                                        self.acceleration = data << 8 | self.acceleration & 0xFF
                                else:
                                    if address == 0x28:
                                        self.profile_velocity = data
        else:
            if address < 0x44:
                if address < 0x33:
                    if address < 0x2E:
                        if address < 0x2B:
                            if address < 0x2A:
                                if address == 0x29:
                                    self.final_position = self.final_position & -0x100 | data << 0
                            else:
                                if address == 0x2A:
                                    self.final_position = self.final_position & -0xFF01 | data << 8
                        else:
                            if address < 0x2C:
                                if address == 0x2B:
                                    self.final_position = (
                                        data ^ 0x80
                                    ) - 0x80 << 16 | self.final_position & 0xFFFF
                            else:
                                if address < 0x2D:
                                    if address == 0x2C:
                                        self.position_error = (
                                            self.position_error & -0x100 | data << 0
                                        )
                                else:
                                    if address == 0x2D:
                                        self.position_error = (
                                            data ^ 0x80
                                        ) - 0x80 << 8 | self.position_error & 0xFF
                    else:
                        if address < 0x30:
                            if address < 0x2F:
                                if address == 0x2E:
                                    self.capture = self.capture & -0x100 | data << 0
                            else:
                                if address == 0x2F:
                                    self.capture = self.capture & -0xFF01 | data << 8
                        else:
                            if address < 0x31:
                                if address == 0x30:
                                    self.capture = (
                                        data ^ 0x80
                                    ) - 0x80 << 16 | self.capture & 0xFFFF
                            else:
                                if address < 0x32:
                                    if address == 0x31:
                                        self.accel_delta = self.accel_delta & -0x100 | data << 0
                                else:
                                    if address == 0x32:
                                        self.accel_delta = self.accel_delta & -0xFF01 | data << 8
                else:
                    if address < 0x3B:
                        if address < 0x35:
                            if address < 0x34:
                                if address == 0x33:
                                    self.accel_delta = data << 16 | self.accel_delta & 0xFFFF
                            else:
                                if address == 0x34:
                                    self.actual_velocity = self.actual_velocity & -0x100 | data << 0
                        else:
                            if address < 0x39:
                                if address == 0x35:
                                    self.actual_velocity = (
                                        data ^ 0x80
                                    ) - 0x80 << 8 | self.actual_velocity & 0xFF
                            else:
                                if address < 0x3A:
                                    if address == 0x39:
                                        self.decel_position = (
                                            self.decel_position & -0x100 | data << 0
                                        )
                                else:
                                    if address == 0x3A:
                                        self.decel_position = (
                                            self.decel_position & -0xFF01 | data << 8
                                        )
                    else:
                        if address < 0x3D:
                            if address < 0x3C:
                                if address == 0x3B:
                                    self.decel_position = (
                                        data ^ 0x80
                                    ) - 0x80 << 16 | self.decel_position & 0xFFFF
                            else:
                                if address == 0x3C:
                                    self.velocity_command = (data ^ 0x80) - 0x80
                        else:
                            if address < 0x3E:
                                if address == 0x3D:
                                    self.breakpoint = self.breakpoint & -0x100 | data << 0
                            else:
                                if address < 0x3F:
                                    if address == 0x3E:
                                        self.breakpoint = self.breakpoint & -0xFF01 | data << 8
                                else:
                                    if address == 0x3F:
                                        self.breakpoint = (
                                            data ^ 0x80
                                        ) - 0x80 << 16 | self.breakpoint & 0xFFFF
            else:
                if address < 0x56:
                    if address < 0x4B:
                        if address < 0x46:
                            if address < 0x45:
                                if address == 0x44:
                                    self.backlash = data
                            else:
                                if address == 0x45:
                                    self.deadband = data
                        else:
                            if address < 0x49:
                                if address == 0x46:
                                    self.forced_exception = data
                            else:
                                if address < 0x4A:
                                    if address == 0x49:
                                        self.max_error = self.max_error & -0x100 | data << 0
                                else:
                                    if address == 0x4A:
                                        self.max_error = data << 8 | self.max_error & 0xFF
                    else:
                        if address < 0x4D:
                            if address < 0x4C:
                                if address == 0x4B:
                                    self.saturation = data
                            else:
                                if address == 0x4C:
                                    self.motor_command_low = data
                        else:
                            if address < 0x54:
                                if address == 0x4D:
                                    self.pwm_fraction = data
                            else:
                                if address < 0x55:
                                    if address == 0x54:
                                        self.jerk = self.jerk & -0x100 | data << 0
                                else:
                                    if address == 0x55:
                                        self.jerk = data << 8 | self.jerk & 0xFF
                else:
                    if address < 0x64:
                        if address < 0x61:
                            if address < 0x57:
                                if address == 0x56:
                                    self.feed_forward = self.feed_forward & -0x100 | data << 0
                            else:
                                if address == 0x57:
                                    self.feed_forward = (
                                        data ^ 0x80
                                    ) - 0x80 << 8 | self.feed_forward & 0xFF
                        else:
                            if address < 0x62:
                                if address == 0x61:
                                    self.kp = data
                            else:
                                if address < 0x63:
                                    if address == 0x62:
                                        self.ki = data
                                else:
                                    if address == 0x63:
                                        self.kd = data
                    else:
                        if address < 0x66:
                            if address < 0x65:
                                if address == 0x64:
                                    self.derivative_span = data
                            else:
                                if address == 0x65:
                                    self.integral_limit = self.integral_limit & -0x100 | data << 0
                        else:
                            if address < 0x69:
                                if address == 0x66:
                                    self.integral_limit = data << 8 | self.integral_limit & 0xFF
                            else:
                                if address < 0x6A:
                                    if address == 0x69:
                                        self.ka = data
                                else:
                                    if address == 0x6A:
                                        self.kv = data

    @property
    def image(self) -> bytes:
        """The bytes of all addresses."""
        return bytes(
            (
                self.flag & 0xFF,
                self.feature & 0xFF,
                self.config & 0xFF,
                self.capture_control & 0xFF,
                self.exception & 0xFF,
                self.mode & 0xFF,
                self.phase & 0xFF,
                self.status & 0xFF,
                self.motor_command & 0xFF,
                self.pwm_command & 0xFF,
                self.dac_offset & 0xFF,
                self.command_increment & 0xFF,
                self.command_position >> 16 & 0xFF,
                self.command_position >> 8 & 0xFF,
                self.command_position & 0xFF,
                self.sample_timer & 0xFF,
                self.prescaler >> 8 & 0xFF,
                self.prescaler & 0xFF,
                self.actual_position >> 16 & 0xFF,
                self.actual_position >> 8 & 0xFF,
                self.actual_position & 0xFF,
                self.preset_position >> 16 & 0xFF,
                self.preset_position >> 8 & 0xFF,
                self.preset_position & 0xFF,
                self.interpolator_preset & 0xFF,
                self.interpolator_count & 0xFF,
                self.encoder_pwm & 0xFF,
                self.step_width & 0xFF,
                self.encoder_ratio >> 8 & 0xFF,
                self.encoder_ratio & 0xFF,
                0,
                0,
                self.lead_zero & 0xFF,
                self.lead_pole & 0xFF,
                self.lead_gain & 0xFF,
                self.velocity >> 16 & 0xFF,
                self.velocity >> 8 & 0xFF,
                self.velocity & 0xFF,
                self.acceleration & 0xFF,
                self.acceleration >> 8 & 0xFF,
                self.profile_velocity & 0xFF,
                self.final_position & 0xFF,
                self.final_position >> 8 & 0xFF,
                self.final_position >> 16 & 0xFF,
                self.position_error & 0xFF,
                self.position_error >> 8 & 0xFF,
                self.capture & 0xFF,
                self.capture >> 8 & 0xFF,
                self.capture >> 16 & 0xFF,
                self.accel_delta & 0xFF,
                self.accel_delta >> 8 & 0xFF,
                self.accel_delta >> 16 & 0xFF,
                self.actual_velocity & 0xFF,
                self.actual_velocity >> 8 & 0xFF,
                0,
                0,
                0,
                self.decel_position & 0xFF,
                self.decel_position >> 8 & 0xFF,
                self.decel_position >> 16 & 0xFF,
                self.velocity_command & 0xFF,
                self.breakpoint & 0xFF,
                self.breakpoint >> 8 & 0xFF,
                self.breakpoint >> 16 & 0xFF,
                0,
                0,
                0,
                0,
                self.backlash & 0xFF,
                self.deadband & 0xFF,
                self.forced_exception & 0xFF,
                0,
                0,
                self.max_error & 0xFF,
                self.max_error >> 8 & 0xFF,
                self.saturation & 0xFF,
                self.motor_command_low & 0xFF,
                self.pwm_fraction & 0xFF,
                0,
                0,
                0,
                0,
                0,
                0,
                self.jerk & 0xFF,
                self.jerk >> 8 & 0xFF,
                self.feed_forward & 0xFF,
                self.feed_forward >> 8 & 0xFF,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                self.kp & 0xFF,
                self.ki & 0xFF,
                self.kd & 0xFF,
                self.derivative_span & 0xFF,
                self.integral_limit & 0xFF,
                self.integral_limit >> 8 & 0xFF,
                0,
                0,
                self.ka & 0xFF,
                self.kv & 0xFF,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
            )
        )

    @image.setter
    def image(self, image: bytes) -> None:
        self.flag = image[0x00]
        self.feature = image[0x01]
        self.config = image[0x02]
        self.capture_control = image[0x03]
        self.exception = image[0x04]
        self.mode = image[0x05]
        self.phase = image[0x06]
        self.status = image[0x07]
        self.motor_command = image[0x08]
        self.pwm_command = (image[0x09] ^ 0x80) - 0x80
        self.dac_offset = (image[0x0A] ^ 0x80) - 0x80
        self.command_increment = (image[0x0B] ^ 0x80) - 0x80
        self.command_position = ((image[0x0C] ^ 0x80) - 0x80) << 16 | image[0x0D] << 8 | image[0x0E]
        self.sample_timer = image[0x0F]
        self.prescaler = image[0x10] << 8 | image[0x11]
        self.actual_position = ((image[0x12] ^ 0x80) - 0x80) << 16 | image[0x13] << 8 | image[0x14]
        self.preset_position = ((image[0x15] ^ 0x80) - 0x80) << 16 | image[0x16] << 8 | image[0x17]
        self.interpolator_preset = image[0x18]
        self.interpolator_count = image[0x19]
        self.encoder_pwm = image[0x1A]
        self.step_width = image[0x1B]
        self.encoder_ratio = image[0x1C] << 8 | image[0x1D]
        self.lead_zero = image[0x20]
        self.lead_pole = image[0x21]
        self.lead_gain = image[0x22]
        self.velocity = ((image[0x23] ^ 0x80) - 0x80) << 16 | image[0x24] << 8 | image[0x25]
        self.acceleration = image[0x27] << 8 | image[0x26]
        self.profile_velocity = image[0x28]
        self.final_position = ((image[0x2B] ^ 0x80) - 0x80) << 16 | image[0x2A] << 8 | image[0x29]
        self.position_error = ((image[0x2D] ^ 0x80) - 0x80) << 8 | image[0x2C]
        self.capture = ((image[0x30] ^ 0x80) - 0x80) << 16 | image[0x2F] << 8 | image[0x2E]
        self.accel_delta = image[0x33] << 16 | image[0x32] << 8 | image[0x31]
        self.actual_velocity = ((image[0x35] ^ 0x80) - 0x80) << 8 | image[0x34]
        self.decel_position = ((image[0x3B] ^ 0x80) - 0x80) << 16 | image[0x3A] << 8 | image[0x39]
        self.velocity_command = (image[0x3C] ^ 0x80) - 0x80
        self.breakpoint = ((image[0x3F] ^ 0x80) - 0x80) << 16 | image[0x3E] << 8 | image[0x3D]
        self.backlash = image[0x44]
        self.deadband = image[0x45]
        self.forced_exception = image[0x46]
        self.max_error = image[0x4A] << 8 | image[0x49]
        self.saturation = image[0x4B]
        self.motor_command_low = image[0x4C]
        self.pwm_fraction = image[0x4D]
        self.jerk = image[0x55] << 8 | image[0x54]
        self.feed_forward = ((image[0x57] ^ 0x80) - 0x80) << 8 | image[0x56]
        self.kp = image[0x61]
        self.ki = image[0x62]
        self.kd = image[0x63]
        self.derivative_span = image[0x64]
        self.integral_limit = image[0x66] << 8 | image[0x65]
        self.ka = image[0x69]
        self.kv = image[0x6A]
