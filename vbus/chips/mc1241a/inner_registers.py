"""The registers behind the commands, where the chip set keeps them."""

from typing import Final

from vbus.chips.family import InnerRegister
from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.tables import REPORTED

_AXIS: Final = "axes.{}."
_STATUS: Final = "status"
_POSITION: Final = "position"
_PROFILE: Final = "profile"
_MOTOR: Final = "motor"
_VELOCITY: Final = "ustep/cycle"
_ACCELERATION: Final = "ustep/cycle/cycle"
_EVENTS: Final = tuple(bit for bit in ds.STATUS_BITS if bit.mask & ds.EVENTS)
_BREAKPOINTS: Final = (
    "off", "time", "positive target position", "negative target position",
    "positive actual position", "negative actual position", "motion complete", "external",
)  # fmt: skip


def _double(
    name: str, attribute: str, clause: str, unit: str, fraction: int = 0
) -> tuple[InnerRegister, ...]:
    """Return a double-buffered register: the buffer, and the active one (PMD-UPD-1)."""
    return (
        InnerRegister(f"{name} buffered", f"{_AXIS}buffer.{attribute}", _PROFILE, clause,
                      "as the host loaded it", unit, fraction),
        InnerRegister(name, f"{_AXIS}active.{attribute}", _PROFILE, "PMD-UPD-1",
                      "in use since the last update", unit, fraction),
    )  # fmt: skip


REGISTERS: Final = (
    InnerRegister("status word", f"{_AXIS}status", _STATUS, "PMD-STA-1", "what GET_STATUS reads",
                  digits=4, fields=ds.STATUS_BITS),
    InnerRegister("mode word", f"{_AXIS}mode", _STATUS, "PMD-STA-5", "what GET_MODE reads",
                  digits=4, fields=ds.MODE_BITS),
    InnerRegister("interrupt mask", f"{_AXIS}interrupt_mask", _STATUS, "PMD-CMD-41",
                  "events that pull ~HostIntrpt", digits=2, fields=_EVENTS),
    InnerRegister("breakpoint mode", f"{_AXIS}breakpoint_mode", _STATUS, "PMD-CMD-27",
                  "what is compared", words=_BREAKPOINTS),
    InnerRegister("breakpoint value", f"{_AXIS}breakpoint_value", _STATUS, "PMD-CMD-35",
                  "what it is compared with"),
    InnerRegister("target position", f"{_AXIS}profile.target_position", _POSITION, "PMD-CMD-25",
                  "what GET_TRGT_POS reads", "ustep"),
    InnerRegister("target velocity", f"{_AXIS}profile.target_velocity", _POSITION, "PMD-CMD-26",
                  "what GET_TRGT_VEL reads", _VELOCITY, 16),
    InnerRegister("actual position", f"{_AXIS}encoder.actual", _POSITION, "PMD-CMD-49",
                  "what GET_ACTL_POS reads", "cnt"),
    InnerRegister("position error", f"{_AXIS}position_error", _POSITION, "PMD-CMD-59",
                  "what GET_ACTL_POS_ERR reads", "cnt"),
    InnerRegister("position error limit", f"{_AXIS}position_error_limit", _POSITION, "PMD-CMD-57",
                  "as SET_POS_ERR set it", "cnt"),
    InnerRegister("step ratio", f"{_AXIS}step_ratio", _POSITION, "PMD-CMD-53",
                  "encoder counts for each microstep", "cnt/ustep", 8),
    InnerRegister("profile mode", f"{_AXIS}profile.mode", _PROFILE, "PMD-CMD-4",
                  "which profile is generated", words=ds.PROFILES),
    *_double("position", "position", "PMD-CMD-8", "ustep"),
    *_double("velocity", "velocity", "PMD-CMD-9", _VELOCITY, 16),
    *_double("acceleration", "acceleration", "PMD-CMD-10", _ACCELERATION, 16),
    *_double("max acceleration", "max_acceleration", "PMD-CMD-11", _ACCELERATION, 16),
    *_double("jerk", "jerk", "PMD-CMD-12", "ustep/cycle/cycle/cycle", 32),
    *_double("gear ratio", "ratio", "PMD-CMD-13", "ustep/cnt", 16),
    InnerRegister("start velocity", f"{_AXIS}start_velocity", _PROFILE, "PMD-CMD-14",
                  "as SET_START_VEL set it", _VELOCITY, 16),
    *_double("motor command", "motor_command", "PMD-CMD-64", ""),
    InnerRegister("phase information", f"{_AXIS}stepper.phase_info", _MOTOR, "PMD-CMD-80",
                  "what GET_PHASE_INFO reads", digits=4),
    InnerRegister("current axis", "commands.current", "chip set", "PMD-CMD-1",
                  "which axis commands are for", words=("1", "2")),
    InnerRegister("output mode", "shared.output_mode", "chip set", "PMD-CMD-68",
                  "how the motors are driven", words=("PWM", "", "DAC16")),
    InnerRegister("limit sense", "shared.limit_sense", "chip set", "PMD-CMD-70",
                  "as SET_LMT_SENSE set it", digits=4),
    InnerRegister("limit sensing", "shared.sensing", "chip set", "PMD-CMD-72",
                  "whether limit switches are looked at", words=("off", "on")),
    InnerRegister("time", "shared.time", "chip set", "PMD-CMD-77", "what GET_TIME reads", "cycles",
                  counts=REPORTED),
)  # fmt: skip
