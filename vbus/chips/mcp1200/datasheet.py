"""What the MCP-1200 manual says, as data: registers, bits, pins, AC limits, timings, rules.

Clause ids (``MCP-BUS-5``) are those of the project's list for this chip; where the manual is
silent or contradicts itself, NOTES.md says what was chosen.
"""

from typing import Final

from vbus.chips.ac_table import AcLimit, AcTable, rules_in
from vbus.chips.bus_watch import ADDRESS, BYTE, EITHER, BusTable, Strobe
from vbus.chips.mcp1200.generated.bits import *  # noqa: F403
from vbus.chips.tables import LIVE, REPORTED, SAMPLED, Bit, PinRow, Register, RegisterMap
from vbus.core.options import Option
from vbus.core.signals import HIGH, LOW, Rule, Value, ValueTable, Z

FAMILY: Final = "mcp1200"
PARTS: Final = ("MCP-1200", "MCP1200")
ADDRESS_BITS: Final = 7

# -- Control Register Bit Values ----------------------------------------------------------------

FLAG_BITS: Final = (
    Bit(0, "F0", "Trapezoid/S-curve Profile"),
    Bit(1, "F1", "IDLE Flag"),
    Bit(2, "F2", "IN-MOTION Flag"),
    Bit(3, "F3", "Position Interpolation Control"),
    Bit(4, "F4", "Velocity Interpolation Control"),
    Bit(5, "F5", "Integral Velocity Profile"),
)
FEATURE_BITS: Final = (
    Bit(2, "UNIPOLAR", "Unipolar Select"),
    Bit(3, "PID", "Filter Select (0 = Lead, 1 = PID)"),
    Bit(4, "S_CURVE", "Profile Mode Select (0 = Trapezoid, 1 = S-Curve)"),
    Bit(5, "HIGH_RESOLUTION", "High-Resolution Velocity"),
    Bit(6, "DIAGNOSTIC_PWM", "Position Error sent to PWM"),
    Bit(7, "DIAGNOSTIC_DAC", "Position Error sent to DAC"),
)
CONFIG_BITS: Final = (
    Bit(0, "EXTENDED", "Extended Addressing"),
    Bit(1, "STEP_MODE", "Step Mode Enable"),
    Bit(2, "STEP_LOW", "Step Output Polarity (1 = low pulse)"),
    Bit(4, "BREAK_ENABLE", "Breakpoint Feature Enable"),
    Bit(5, "BREAK_REPEAT", "Breakpoint Mode (1 = Repeat)"),
    Bit(6, "SIGN_INHIBIT", "PWM Sign Reversal Inhibit"),
    Bit(7, "PWM_BIAS", "PWM Bias (1 = 50% Duty Cycle)"),
)
CAPTURE_BITS: Final = (
    Bit(0, "TRIG_LATCH", "TRIG Latch Output / Clear"),
    Bit(1, "TRIG_CAPTURE", "TRIG Input Capture Enable"),
    Bit(2, "TRIG_INPUT", "TRIG_IO Pin Direction (1 = Input)"),
    Bit(3, "INDEX_LATCH", "INDEX Latch Output / Clear"),
    Bit(4, "INDEX_CAPTURE", "INDEX Input Capture Enable"),
    Bit(5, "INDEX_RISING", "INDEX Pin Polarity (1 = Rising Edge)"),
    Bit(6, "BUSY_ON_PROF", "Interp. Busy Status on PROF pin"),
    Bit(7, "INTERPOLATOR_BUSY", "Interp. Busy Status"),
)
STATUS_BITS: Final = (
    Bit(0, "BUSY", "BUSY pin state"),
    Bit(1, "DIRECTION", "Motor Direction at Last Fault (1 = Reverse)"),
    Bit(2, "IN_POSITION", "In-Position Flag"),
    Bit(3, "TIMER_OK", "Sample Timer Error (active low)"),
    Bit(4, "ERROR_OK", "Maximum Error Fault (active low)"),
    Bit(5, "BREAKPOINT_OK", "Breakpoint Flag (active low)"),
    Bit(6, "STOP_OK", "Stop Error (active low)"),
    Bit(7, "LIMIT_OK", "Limit Error (active low)"),
)

# -- Register Reference Table -------------------------------------------------------------------
# Multi-byte registers are listed most significant byte first, whatever their order in the map.

REGISTERS: Final = RegisterMap(
    128,
    Register("FLAG", (0x00,), 0x02, clause="MCP-REG-1", title="Flag Register",
             counts=REPORTED, fields=FLAG_BITS, on_write="write_flag"),
    Register("FEATURE", (0x01,), 0x00, clause="MCP-REG-2", title="Feature Control Register",
             counts=SAMPLED, fields=FEATURE_BITS),
    Register("CONFIG", (0x02,), 0x00, clause="MCP-REG-3", title="Advanced Configuration Register",
             counts=LIVE, fields=CONFIG_BITS, on_write="write_config"),
    Register("CAPTURE_CONTROL", (0x03,), 0x00, clause="MCP-REG-4", title="Capture Control Register",
             counts=LIVE, fields=CAPTURE_BITS, on_write="write_capture_control"),
    Register("EXCEPTION", (0x04,), 0x09, clause="MCP-REG-5", title="Exception Handling Register",
             counts=SAMPLED, on_write="write_exception"),
    Register("MODE", (0x05,), 0x01, clause="MCP-REG-6", title="Mode Brancher",
             counts=REPORTED, on_write="write_mode"),
    Register("PHASE", (0x06,), 0x00, "r", clause="MCP-REG-7", title="Profile Phase Status",
             counts=REPORTED),
    Register("STATUS", (0x07,), 0xF8, clause="MCP-REG-8", title="Status Register",
             counts=REPORTED, fields=STATUS_BITS, on_write="write_status"),
    Register("MOTOR_COMMAND", (0x08,), 0x80, clause="MCP-REG-9", title="Motor Command Port (MSB)",
             counts=REPORTED, unit="1/256 of full scale", on_loaded="guard_outputs"),
    Register("PWM_COMMAND", (0x09,), 0x00, signed=True, clause="MCP-REG-10",
             title="PWM Command Port",
             counts=REPORTED, unit="% of full scale", on_loaded="guard_outputs"),
    Register("DAC_OFFSET", (0x0A,), 0x00, signed=True, clause="MCP-REG-11",
             title="Motor Command DAC Offset", counts=SAMPLED, unit="1/4096 of full scale"),
    Register("COMMAND_INCREMENT", (0x0B,), 0x00, signed=True, clause="MCP-REG-12",
             title="Command Position Increment",
             counts=SAMPLED, unit="count", on_loaded="load_command_increment"),
    Register("COMMAND_POSITION", (0x0C, 0x0D, 0x0E), 0, signed=True, clause="MCP-REG-13",
             title="Command Position",
             counts=REPORTED, unit="count", on_write="write_command_position"),
    Register("SAMPLE_TIMER", (0x0F,), 0x40, clause="MCP-REG-14", title="Sample Timer",
             counts=SAMPLED, unit="pre-scalar period", on_read="read_sample_timer"),
    Register("PRESCALER", (0x10, 0x11), 0x003F, clause="MCP-REG-15",
             title="Sample Timer Pre-scalar", counts=SAMPLED, unit="clk"),
    Register("ACTUAL_POSITION", (0x12, 0x13, 0x14), 0, "r", signed=True, clause="MCP-REG-16",
             title="Read Actual Position", counts=LIVE, unit="count",
             on_read="read_actual_position", on_write="write_actual_position"),
    Register("PRESET_POSITION", (0x15, 0x16, 0x17), 0, signed=True, clause="MCP-REG-17",
             title="Preset Actual Position",
             counts=LIVE, unit="count", on_loaded="preset_position"),
    Register("INTERPOLATOR_PRESET", (0x18,), 0, clause="MCP-REG-18",
             title="Interpolator Counter Preset", counts=SAMPLED),
    Register("INTERPOLATOR_COUNT", (0x19,), 0, "r", clause="MCP-REG-19",
             title="Interpolator Counter Value", counts=REPORTED, unit="sample"),
    Register("ENCODER_PWM", (0x1A,), 0, clause="MCP-REG-20",
             title="Encoder Filter Clock / PWM Resolution",
             counts=LIVE, on_write="write_encoder_pwm"),
    Register("STEP_WIDTH", (0x1B,), 0x0F, clause="MCP-REG-21", title="Stepper Pulse Width",
             counts=LIVE, unit="clk"),
    Register("ENCODER_RATIO", (0x1C, 0x1D), 0, fraction=8, clause="MCP-REG-22",
             title="Encoder / Stepper Ratio", counts=SAMPLED, unit="count/step"),
    Register("LEAD_ZERO", (0x20,), 0xE5, clause="MCP-REG-23", title="Lead Filter Zero",
             counts=SAMPLED),
    Register("LEAD_POLE", (0x21,), 0x40, clause="MCP-REG-23", title="Lead Filter Pole",
             counts=SAMPLED),
    Register("LEAD_GAIN", (0x22,), 0x40, clause="MCP-REG-23", title="Lead Filter Gain",
             counts=SAMPLED),
    Register("VELOCITY", (0x23, 0x24, 0x25), 0, signed=True, fraction=8, clause="MCP-REG-24",
             title="High Resolution Velocity",
             counts=SAMPLED, unit="count/sample", on_loaded="load_velocity"),
    Register("ACCELERATION", (0x27, 0x26), 0, fraction=8, clause="MCP-REG-25", title="Acceleration",
             counts=SAMPLED, unit="count/sample²"),
    Register("PROFILE_VELOCITY", (0x28,), 0, clause="MCP-REG-26",
             title="Profile Velocity (Low Res)", counts=SAMPLED, unit="count/sample"),
    Register("FINAL_POSITION", (0x2B, 0x2A, 0x29), 0, signed=True, clause="MCP-REG-27",
             title="Final Position", counts=SAMPLED, unit="count", on_loaded="load_final_position"),
    Register("POSITION_ERROR", (0x2D, 0x2C), 0, "r", signed=True, clause="MCP-REG-28",
             title="Position Error", counts=REPORTED, unit="count"),
    Register("CAPTURE", (0x30, 0x2F, 0x2E), 0, "r", signed=True, clause="MCP-REG-29",
             title="Capture Count", counts=LIVE, unit="count"),
    Register("ACCEL_DELTA", (0x33, 0x32, 0x31), 0, "r", clause="MCP-REG-30",
             title="Accel. Delta Position", counts=REPORTED, unit="count"),
    Register("ACTUAL_VELOCITY", (0x35, 0x34), 0, "r", signed=True, clause="MCP-REG-31",
             title="Actual Velocity", counts=REPORTED, unit="count/sample"),
    Register("DECEL_POSITION", (0x3B, 0x3A, 0x39), 0, "r", signed=True, clause="MCP-REG-32",
             title="Deceleration Position", counts=REPORTED, unit="count"),
    Register("VELOCITY_COMMAND", (0x3C,), 0, signed=True, clause="MCP-REG-33",
             title="Velocity Command", counts=SAMPLED, unit="count/sample"),
    Register("BREAKPOINT", (0x3F, 0x3E, 0x3D), 0x800000, signed=True, clause="MCP-REG-34",
             title="Break-point Position", counts=SAMPLED, unit="count"),
    Register("BACKLASH", (0x44,), 0, clause="MCP-REG-35", title="Backlash",
             counts=SAMPLED, unit="count"),
    Register("DEADBAND", (0x45,), 0, clause="MCP-REG-36", title="Deadband",
             counts=SAMPLED, unit="count"),
    Register("FORCED_EXCEPTION", (0x46,), 0, clause="MCP-REG-37", title="Forced Exception Register",
             counts=SAMPLED),
    Register("MAX_ERROR", (0x4A, 0x49), 0xFFFF, clause="MCP-REG-38", title="Maximum Error",
             counts=SAMPLED, unit="count"),
    Register("SATURATION", (0x4B,), 0xF0, clause="MCP-REG-39", title="Saturation Foldback Setting",
             counts=SAMPLED, unit="1/256 of full scale"),
    Register("MOTOR_COMMAND_LOW", (0x4C,), 0, clause="MCP-REG-40",
             title="Motor Command Port (extended)", counts=REPORTED, on_write="write_output_low"),
    Register("PWM_FRACTION", (0x4D,), 0, clause="MCP-REG-41", title="PWM Command Port (extended)",
             counts=REPORTED, on_write="write_output_low"),
    Register("JERK", (0x55, 0x54), 0, fraction=16, clause="MCP-REG-42", title="Jerk",
             counts=SAMPLED, unit="count/sample³"),
    Register("FEED_FORWARD", (0x57, 0x56), 0, signed=True, fraction=8, clause="MCP-REG-43",
             title="Command Feed-forward", counts=SAMPLED, unit="count/sample"),
    Register("KP", (0x61,), 0x40, clause="MCP-REG-44", title="Proportional Gain, Kp",
             counts=SAMPLED),
    Register("KI", (0x62,), 0x00, clause="MCP-REG-44", title="Integral Gain, Ki", counts=SAMPLED),
    Register("KD", (0x63,), 0x40, clause="MCP-REG-44", title="Derivative Gain, Kd", counts=SAMPLED),
    Register("DERIVATIVE_SPAN", (0x64,), 0x01, clause="MCP-REG-45", title="Derivative Span",
             counts=SAMPLED, unit="sample"),
    Register("INTEGRAL_LIMIT", (0x66, 0x65), 0x7FFF, clause="MCP-REG-46", title="Integral Limit",
             counts=SAMPLED),
    Register("KA", (0x69,), 0x00, clause="MCP-REG-47", title="Accel Feed-forward, Kaff",
             counts=SAMPLED),
    Register("KV", (0x6A,), 0x00, clause="MCP-REG-47", title="Velocity Feed-forward, Kvff",
             counts=SAMPLED),
)  # fmt: skip

SOFT_RESET: Final = (
    "FLAG", "EXCEPTION", "MODE", "PHASE", "STATUS", "MOTOR_COMMAND", "PWM_COMMAND",
    "MOTOR_COMMAND_LOW", "PWM_FRACTION", "DAC_OFFSET", "COMMAND_INCREMENT", "COMMAND_POSITION",
    "SAMPLE_TIMER", "LEAD_ZERO", "LEAD_POLE", "LEAD_GAIN", "SATURATION", "MAX_ERROR",
    "ACTUAL_POSITION",
)  # fmt: skip
"""What a soft reset reloads; every other register keeps its value (MCP-RST-4)."""

# Addresses that host programs use as numbers: these registers have one byte.

FLAG: Final = REGISTERS["FLAG"].low
CONFIG: Final = REGISTERS["CONFIG"].low
CAPTURE_CONTROL: Final = REGISTERS["CAPTURE_CONTROL"].low
RESET_GAINS: Final = tuple(REGISTERS[name].reset for name in ("KP", "KI", "KD"))
STATUS: Final = REGISTERS["STATUS"].low

MODE_FLAGS: Final = 0x39
"""F0, F3, F4, F5."""
ERROR_FLAGS: Final = 0xF8
"""Bits of the Status Register that are active low."""
SWAP_AB: Final = 0x80
"""In R1A, beside two numbers."""

REPORT: Final = 0
GO_IDLE: Final = 1
DECELERATE: Final = 2
ABRUPT: Final = 3
ACTIONS: Final = ("report", "idle", "decelerate", "abrupt")
"""Exception actions, by their two bits in R04."""
EXCEPTIONS: Final = (("error", 6), ("breakpoint", 4), ("stop", 2), ("limit", 0))
"""Events, and the lower bit of each in R04."""

SOFT_RESET_CODE: Final = 0
IDLE_CODE: Final = 1
HALT_CODE: Final = 2
CONTROL_CODE: Final = 3
MODES: Final = ("soft reset", "idle", "halt motion", "control")
"""Codes of the Mode Brancher R05; all larger ones are control (MCP-MOD-1)."""

# -- timings, in clock periods ------------------------------------------------------------------

SAMPLE_PERIOD: Final = (0x0F, 0x10, 0x11)
"""Registers that make the sample period (MCP-REG-14, -15)."""
WRITE_CLK: Final = 4
"""From /CS rise until a written byte is visible inside (MCP-BUS-5)."""
RECOVERY_WRITE_CLK: Final = 4
RECOVERY_READ_CLK: Final = 2
"""From one /CS rise to the next (MCP-BUS-12)."""
RESET_CLK: Final = 320
"""Duration of a reset (MCP-RST-5)."""
SAMPLE_CLK: Final = (0x3F + 1) * (0x40 + 1)
"""A sample after reset, until a host programs another (MCP-REG-14, MCP-REG-15)."""
BREAK_ROUTINE_CLK: Final = 67
"""From sample start to the breakpoint routine (MCP-BRK-3)."""
DIRECTION_SETUP_CLK: Final = 1080
"""From a change of the direction output to the next step (MCP-STP-2)."""

WORK_BASE: Final = 500
WORK_LEAD: Final = 500
WORK_PID: Final = 800
WORK_STEP: Final = 700
WORK_PROFILE: Final = 900
WORK_VELOCITY: Final = 400
WORK_INTERPOLATION: Final = 300
WORK_BACKLASH: Final = 100
WORK_DEADBAND: Final = 100
"""What the core has to do in a sample (MCP-SMP-3)."""

DAC_ZERO: Final = 0x800
"""Code of the DAC port for no motor command."""
PWM_FULL: Final = 1600
"""Motor command, in 1/16, from which the duty is 100 %."""
FILTER_DIVIDER: Final = (1, 2, 4, 8, 16, 32, 32, 32)
"""Clocks of an encoder filter clock by R1A bits 6-4 (MCP-ENC-1)."""
FILTER_STAGES: Final = 3

# -- pins ---------------------------------------------------------------------------------------

DATA: Final = "DB0-DB7"
DAC: Final = "MC0-MC11"

_ADDRESSED: Final = (
    (-70_000, DATA, ADDRESS), (-70_000, "/ALE", LOW), (-60_000, "/ALE", HIGH),
)  # fmt: skip
BUS: Final = BusTable(
    ("/ALE", "/CS", "/OE", "R/W"),
    strobes=(
        Strobe(("R/W",), EITHER, "place"),
        Strobe(("/ALE",), LOW, "open"),
        Strobe(("/ALE",), HIGH, "latch"),
        Strobe(("/CS",), LOW, "enter"),
        Strobe(("/CS",), HIGH, "access", (("R/W", HIGH),)),
        Strobe(("/CS",), HIGH, "write", (("R/W", LOW),)),
        Strobe(("/OE",), HIGH, "take"),
        Strobe(("/OE",), LOW, "begin", (("R/W", HIGH),)),
        Strobe(("/OE",), LOW, "begin", (("/CS", HIGH),)),
    ),
    read=(
        (-70_000, "R/W", HIGH), *_ADDRESSED, (-50_000, DATA, Z), (-50_000, "/CS", LOW),
        (-45_000, "/OE", LOW), (0, "/CS", HIGH), (10_000, "/OE", HIGH),
    ),
    write=(
        (-70_000, "R/W", LOW), *_ADDRESSED, (-50_000, DATA, BYTE), (-50_000, "/CS", LOW),
        (0, "/CS", HIGH), (10_000, DATA, Z), (10_000, "R/W", HIGH),
    ),
    data=DATA,
    cycle_ps=80_000,
)  # fmt: skip
"""The host bus (MCP-BUS-2 to MCP-BUS-7); whole cycles have the non-overlapped order, well above the
minima."""

PINS: Final = (
    PinRow("/ALE", "in", strobe=True, title="Address Latch Enable"),
    PinRow("/CS", "in", strobe=True, select=True, title="Chip Select"),
    PinRow("/OE", "in", strobe=True, title="Output Enable"),
    PinRow("R/W", "in", strobe=True, title="Read/Write"),
    PinRow(DATA, "io", rest=Z, width=8, title="Address/Data Bus AD0/DB0-AD6/DB6, DB7"),
    PinRow("CHA", "in", title="Encoder channel A"),
    PinRow("CHB", "in", title="Encoder channel B"),
    PinRow("INDEX", "in", title="Index pulse"),
    PinRow("/LIMIT", "in", title="Limit input"),
    PinRow("/STOP", "in", title="Stop input"),
    PinRow("/RESET", "in", title="Hard reset"),
    PinRow("/SYNC", "in", title="Synchronises the sample timers of several chips"),
    PinRow("TRIG", "od", title="Trigger I/O"),
    PinRow("PROF", "out", rest=LOW, title="Profile Flag"),
    PinRow("IDLE", "out", rest=LOW, title="Idle Flag"),
    PinRow("BUSY", "out", rest=LOW, title="High during internal calculations"),
    PinRow("PULSE", "out", rest=LOW, title="PWM Pulse, or step"),
    PinRow("SIGN", "out", rest=LOW, title="PWM Sign, or direction"),
    PinRow(DAC, "out", rest=Z, width=12, title="Motor Command Port, MC11 first"),
)

# -- AC Electrical Characteristics --------------------------------------------------------------

SUPPLIES: Final = ("5 V", "3.3 V")
SLOWEST_PS: Final = 500_000
"""Longest clock period: 2 MHz."""


def _ac(period: int, k: int, low: int, latch: int, valid: int, oe: int, high: int) -> AcTable:
    """One of the manual's two tables; ``k`` is the constant in its formulae (all in ps)."""
    return AcTable(
        FAMILY,
        AcLimit("tCPER", "MCP-TIM-1", "Clock Period (clk)", min_ps=period, max_ps=SLOWEST_PS),
        AcLimit("tCPWH", "MCP-TIM-2", "Pulse Width, Clock High", min_clk=0.3),
        AcLimit("tCPWL", "MCP-TIM-2", "Pulse Width, Clock Low", min_clk=0.3),
        AcLimit("tCR", "MCP-TIM-3", "Clock Rise and Fall Time", max_ps=5_000),
        AcLimit("tIRST", "MCP-TIM-4", "Input Pulse Width Reset, Sync", k, 1),
        AcLimit("tIP", "MCP-TIM-5", "Input Pulse Width Stop, Limit", k, 1),
        # The next three count filter clocks (R1A bits 6-4), not clocks.
        AcLimit("tIX", "MCP-TIM-6", "Input Pulse Width Index", k, 3),
        AcLimit("tIAB", "MCP-TIM-7", "Input Pulse Width CHA, CHB", k, 3),
        AcLimit("tAB", "MCP-TIM-8", "Delay CHA to CHB Transition", k, 1),
        AcLimit("tIABR", "MCP-TIM-9", "Input Rise/Fall Time CHA, CHB", max_ps=40_000),
        AcLimit("tIR", "MCP-TIM-9", "Input Rise/Fall Time of the other inputs", max_ps=40_000),
        AcLimit("tIPW", "MCP-TIM-10", "Input Pulse Width ALE, CS", low),
        AcLimit("tAC", "MCP-TIM-11", "Delay Time, ALE Fall to CS Fall", k),
        AcLimit("tACH", "MCP-TIM-12", "Delay Time, ALE Rise to CS Rise", k),
        AcLimit("tASR1", "MCP-TIM-13", "Address Setup Time Before ALE Rise"),
        AcLimit("tASR", "MCP-TIM-14", "Address Setup Time Before CS Fall"),
        AcLimit("tSDR", "MCP-TIM-15", "Write Data Setup Time Before CS Rise", k),
        AcLimit("tH", "MCP-TIM-16", "Address/Data Hold Time", k),
        AcLimit("tWCS", "MCP-TIM-17", "Setup Time, R/W Before CS Rise", k),
        AcLimit("tWH", "MCP-TIM-18", "Hold Time, R/W After CS Rise", k),
        AcLimit("tCSAL", "MCP-TIM-19", "Delay Time, Write Cycle, CS Rise to ALE Fall", k, 4),
        AcLimit("tCSCS", "MCP-TIM-20", "Delay Time, CS Rise to Next Address Latch", latch),
        AcLimit("tWC", "MCP-TIM-21", "Write Cycle, ALE Fall to ALE Fall for Next Write", k, 4),
        AcLimit("tOEDB", "MCP-TIM-22", "Delay Time, OE Fall to Data Bus Valid",
                max_ps=valid, output=True),
        AcLimit("tALDB", "MCP-TIM-23", "Delay Time, Address Latch to Data Bus Valid",
                max_ps=valid, output=True),
        AcLimit("tIPWOE", "MCP-TIM-24", "Input Pulse Width OE", oe),
        AcLimit("tDOEH", "MCP-TIM-25", "Data Held After OE Rise", k, output=True),
        AcLimit("tALAL", "MCP-TIM-26", "Read Cycle, Address Latch to Address Latch", k, 2),
        AcLimit("tOF", "MCP-TIM-27", "Output Pulse Width", 0, 1, output=True),
        AcLimit("tOR", "MCP-TIM-28", "Output Rise/Fall Time", max_ps=valid, output=True),
        AcLimit("tEP", "MCP-TIM-28", "Delay Time, Clock Rise to Output", max_ps=valid, output=True),
        AcLimit("tALH", "MCP-TIM-29", "Hold Time, ALE High After CS Rise", k),
        AcLimit("tALPWH", "MCP-TIM-30", "Pulse Width, ALE High", high),
        AcLimit("tCA", "MCP-TIM-31", "Delay Time, CS Fall to ALE Fall", k),
        AcLimit("tACL", "MCP-TIM-32", "Delay Time, ALE Rise to CS Fall", k),
    )  # fmt: skip


AC: Final = {
    "5 V": _ac(50_000, 2_100, 2_500, 3_500, 25_000, 14_200, 3_100),
    "3.3 V": _ac(70_000, 3_100, 3_800, 5_300, 36_000, 17_200, 5_300),
}

# -- rules a host can break ---------------------------------------------------------------------

CONTENTION: Final = Rule(
    "mcp1200.contention", "MCP-BUS-8", "/OE must be high while /CS is low in a write cycle."
)
FLOATING_WRITE: Final = Rule(
    "mcp1200.floating-write", "MCP-BUS-13",
    "DB0-DB7 are driven until the byte that is written is latched.", "warning",
)  # fmt: skip
RECOVERY: Final = Rule(
    "mcp1200.recovery",
    "MCP-BUS-12",
    "From one /CS rise to the next at least 4 clk must pass for a write, 2 clk for a read.",
)
RESERVED: Final = Rule(
    "mcp1200.reserved", "MCP-BUS-10", "This address is not in the register table.", "warning"
)
GOAL_STEP: Final = Rule(
    "mcp1200.goal-step",
    "MCP-VEL-2",
    "Two successive velocity commands must differ by at most 127 (high resolution: 32767).",
    "warning",
)
STEP_OVERRUN: Final = Rule(
    "mcp1200.step-overrun",
    "MCP-STP-3",
    "The step pulses of a sample must fit into it.",
    "warning",
)
DOUBLE_EDGE: Final = Rule(
    "mcp1200.double-edge", "MCP-ENC-1", "CHA and CHB must not change together.", "warning"
)
EXTENDED_OFF: Final = Rule(
    "mcp1200.extended-off", "MCP-BUS-9",
    "Registers from R40 on are written with bit 0 of R02 set: without it the byte goes to another.",
    "warning",
)  # fmt: skip
LISTED_RANGE: Final = Rule(
    "mcp1200.range", "MCP-REG-26", "A register is written with what the manual lists for it.",
    "warning",
)  # fmt: skip
LISTED_MOST: Final = {0x05: 0x03, 0x18: 0x07, 0x1A: 0x08, 0x27: 0x7F, 0x28: 0x7F}
"""Largest numbers that the manual lists for some registers (MCP-REG-6, -18, -20, -25, -26)."""
LISTED_BITS: Final = {0x1A: 0x0F}
"""Which bits of a register hold its number, if not all do."""
READ_ONLY: Final = Rule(
    "mcp1200.read-only", "MCP-REG-16",
    "A register that can only be read is not written: R15 to R17 preset the position.", "warning",
)  # fmt: skip
RESET_WRITE: Final = Rule(
    "mcp1200.reset-write", "MCP-RST-5",
    "Nothing but R05 = 00 is written in a reset, until F1 rises: it may overwrite what is.",
    "warning",
)  # fmt: skip
NO_FORCE: Final = Rule(
    "mcp1200.no-force", "MCP-OUT-1",
    "The saturation limit R4B differs from 80H and 7FH, with which a saturated DAC gives no force.",
    "warning",
)  # fmt: skip
FORCELESS: Final = (0x7F, 0x80)
SPLIT_POSITION: Final = Rule(
    "mcp1200.split-position", "MCP-TRP-1",
    "All bytes of a final position are written before F0 is set, or it is the old one's in part.",
    "warning",
)  # fmt: skip
PART_POSITION: Final = Rule(
    "mcp1200.part-position", "MCP-REG-27",
    "Of a final position all three bytes are written, or the others stay as they were.", "note",
)  # fmt: skip
NO_WAY: Final = Rule(
    "mcp1200.no-way", "MCP-TRP-5",
    "A final position is written before F0 is set: a profile without a way to go is over.", "note",
)  # fmt: skip
PID_UNUSED: Final = Rule(
    "mcp1200.pid-unused", "MCP-REG-2",
    "Gains of the PID filter count with bit 3 of R01 set: without it the lead filter runs.", "note",
)  # fmt: skip
OTHER_FILTER: Final = Rule(
    "mcp1200.other-filter", "MCP-REG-2",
    "A mode begins with the filter whose values are written: bit 3 of R01 chooses the PID filter.",
    "warning",
)  # fmt: skip
NO_INTEGRAL: Final = Rule(
    "mcp1200.no-integral", "MCP-FLT-3",
    "An integral gain has a limit above 0, at some time: with R66:R65 at 0 it does nothing.",
    "warning",
)  # fmt: skip
FILTER_CHANGED: Final = Rule(
    "mcp1200.filter-changed", "MCP-REG-2",
    "R01 is written in control mode with bit 3 as it was: else a filter with gains of the reset"
    " takes over.", "warning",
)  # fmt: skip
JUMP: Final = Rule(
    "mcp1200.jump", "MCP-MOD-6",
    "The command position is written before control begins, or the axis jumps to the old one.",
    "warning",
)  # fmt: skip
JUMP_COUNTS: Final = 127
"""So far an axis may have drifted since its host has looked where it is."""
NO_GAIN: Final = Rule(
    "mcp1200.no-gain", "MCP-FLT-3", "Control begins with a gain above 0.", "warning"
)
PRESET_IN_CONTROL: Final = Rule(
    "mcp1200.preset-in-control", "MCP-REG-17",
    "The position counter is preset in idle mode: a closed loop drives the difference away.",
    "note",
)  # fmt: skip
MODE_LOST: Final = Rule(
    "mcp1200.mode-lost", "MCP-MOD-1",
    "R05 is written again once the sample has come that obeys it.", "warning",
)  # fmt: skip
TOO_EARLY: Final = Rule(
    "mcp1200.flag-before-control", "MCP-FLG-4",
    "A mode flag is set once R05 reads 03: before, F2 does not rise with it.", "note",
)  # fmt: skip
OTHER_VELOCITY: Final = Rule(
    "mcp1200.other-velocity", "MCP-TRP-1",
    "The velocity of a profile is in the register that bit 5 of R01 chooses.", "warning",
)  # fmt: skip
NO_RATE: Final = Rule(
    "mcp1200.no-rate", "MCP-TRP-5",
    "A profile has an acceleration and a velocity when it starts, or it waits for them.", "note",
)  # fmt: skip
PART_VALUE: Final = Rule(
    "mcp1200.part-value", "MCP-REG-25",
    "A value of several bytes is written as a whole, or the others stay as after a reset.", "note",
)  # fmt: skip
STALE_READ: Final = Rule(
    "mcp1200.stale-read", "MCP-REG-16",
    "R14 is read before R13 and R12, which read what was latched then.", "note",
)  # fmt: skip
STALE_POSITION: Final = Rule(
    "mcp1200.stale-position", "MCP-REG-16",
    "A position is read from R14 on: R12 and R13 read just before it are of another instant.",
    "warning",
)  # fmt: skip
HELD_AT_CONTROL: Final = Rule(
    "mcp1200.held-at-control", "MCP-REG-13",
    "R0E or R17 is written last: control begins with nothing held that it has not loaded.",
    "warning",
)  # fmt: skip
LEFT_HELD: Final = Rule(
    "mcp1200.left-held", "MCP-REG-13",
    "When a run ends, R0E or R17 has loaded the bytes that are held for it.", "note",
)  # fmt: skip
CLEARED_AT_SPEED: Final = Rule(
    "mcp1200.cleared-at-speed", "MCP-VEL-3",
    "F5 is cleared once F2 reads 0: at speed the profile stops in one sample.", "note",
)  # fmt: skip
RAMP_CUT: Final = Rule(
    "mcp1200.ramp-cut", "MCP-VEL-3",
    "After a velocity of 0 F5 is cleared once F2 reads 0: before, the ramp down is cut short.",
    "warning",
)  # fmt: skip
OUTPUT_LEFT: Final = Rule(
    "mcp1200.output-left", "MCP-REG-9",
    "A motor command of idle mode is taken back before control begins, and when a run ends.",
    "note",
)  # fmt: skip
OUTPUT_IN_CONTROL: Final = Rule(
    "mcp1200.output-in-control", "MCP-REG-9",
    "R08, R09 and their fractions are written in idle mode: a closed loop writes them itself.",
    "warning",
)  # fmt: skip
TWO_MODES: Final = Rule(
    "mcp1200.two-modes", "MCP-MOD-8",
    "Of F0, F3, F4 and F5 one is set at a time: the one before is cleared first.", "warning",
)  # fmt: skip
FLAG_LEFT: Final = Rule(
    "mcp1200.flag-left", "MCP-MOD-9",
    "When a run ends, F3 and F4 are cleared, and F0 and F5 in idle mode, where they wait for"
    " control.", "note",
)  # fmt: skip
JERK_UNUSED: Final = Rule(
    "mcp1200.jerk-unused", "MCP-REG-2",
    "A jerk counts with bit 4 of R01 set: without it the profile is a trapezoid.", "note",
)  # fmt: skip
POINT_LOST: Final = Rule(
    "mcp1200.point-lost", "MCP-INT-2",
    "A point of an interpolation is written once bit 7 of R03 is 0, or it takes another's place.",
    "warning",
)  # fmt: skip
EARLY_POINT: Final = Rule(
    "mcp1200.early-point", "MCP-INT-2",
    "Of a point of an interpolation R29 is written last: it takes the other bytes as they are.",
    "warning",
)  # fmt: skip
OTHER_POINT: Final = Rule(
    "mcp1200.other-point", "MCP-INT-2",
    "F3 interpolates positions of R2B to R29, F4 velocities of R23 to R25.", "warning",
)  # fmt: skip
LATE_POSITION: Final = Rule(
    "mcp1200.late-position", "MCP-TRP-6",
    "A final position is changed in phases 1 to 4: from 5 on it is for the next move.", "note",
)  # fmt: skip
BREAKPOINT_LOST: Final = Rule(
    "mcp1200.breakpoint-lost", "MCP-BRK-2",
    "The first breakpoint has been loaded by a sample before repeat mode is chosen.", "warning",
)  # fmt: skip
INCREMENT_LOST: Final = Rule(
    "mcp1200.increment-lost", "MCP-POS-1",
    "R0B is written once in a sample, or the increment before is lost.", "warning",
)  # fmt: skip
INCREMENT_WAITS: Final = Rule(
    "mcp1200.increment-waits", "MCP-POS-1",
    "R0B is written in position control: in another mode it waits, and moves the axis later.",
    "note",
)  # fmt: skip
TRIG_OUTPUT: Final = Rule(
    "mcp1200.trig-output", "MCP-CAP-2",
    "TRIG captures as an input: bit 2 of R03 is set beside bit 1.", "warning",
)  # fmt: skip
NO_CAPTURE: Final = Rule(
    "mcp1200.no-capture", "MCP-CAP-2",
    "R30 to R2E have a position once bit 4 or 1 of R03 lets a latch capture: it is set without.",
    "warning",
)  # fmt: skip
NO_MAX_ERROR: Final = Rule(
    "mcp1200.no-max-error", "MCP-ERR-2",
    "An action for a position error has a limit: with R4A:R49 at FFFFH it is never taken.", "note",
)  # fmt: skip
LOST_IN_RESET: Final = Rule(
    "mcp1200.lost-in-reset", "MCP-RST-4",
    "What a soft reset loads is written after it: before, it has served nothing.", "warning",
)  # fmt: skip
LOST: Final = {
    address: REGISTERS[name].reset & 0xFF
    for name in (
        "EXCEPTION", "DAC_OFFSET", "SAMPLE_TIMER", "LEAD_ZERO", "LEAD_POLE", "LEAD_GAIN",
        "SATURATION", "MAX_ERROR",
    )
    for address in REGISTERS[name].addresses
}  # fmt: skip
"""Addresses of settings that a soft reset loads, and what with: each byte of one the same."""
LIMIT_UNGUARDED: Final = Rule(
    "mcp1200.limit-unguarded", "MCP-EXC-8",
    "An action for /LIMIT that was taken back to leave the switch has been put back in the end.",
    "warning",
)  # fmt: skip
STOP_UNGUARDED: Final = Rule(
    "mcp1200.stop-unguarded", "MCP-EXC-8",
    "An action for /STOP that was taken back while the pin was low has been put back in the end.",
    "note",
)  # fmt: skip
ERRORS_STAND: Final = Rule(
    "mcp1200.errors-stand", "MCP-STA-2", "When a run ends, errors in R07 have been cleared.", "note"
)

RULES: Final = (*AC["5 V"].rules.values(), *rules_in(globals()))
"""What a host can break: each AC limit, and each rule above."""

# -- board file keys ----------------------------------------------------------------------------

OPTIONS: Final = (
    Option("supply", "choice", "5 V", "supply voltage; decides the AC limits",
           choices=SUPPLIES, clause="MCP-CFG-1"),
    Option("drive", "choice", "pwm", "which motor command output the amplifier takes",
           choices=("pwm", "dac")),
    Option("unipolar", "choice", "magnitude",
           "what a unipolar DAC port gives of a negative motor command: its magnitude, while"
           " Sign shows the direction, or zero",
           choices=("magnitude", "clip"), clause="MCP-OUT-2"),
    Option("io_stall_clk", "count", 0, "clocks the core loses per bus cycle",
           low=0, high=16, clause="MCP-BUS-11", extremes=(1,)),
    Option("index", "choice", "low", "level of the encoder's index pulse", choices=("low", "high")),
    Option("limit_switches", "flag", True,
           "the axis' limit+ and limit- switches are wired to /LIMIT"),
    Option("home_switch", "choice", "none", "input the axis' home switch is wired to",
           choices=("none", "/STOP", "INDEX", "TRIG")),
    Option("clock_high", "ratio", 0.5, "part of the clock period the clock is high",
           low=0.0, high=1.0, clause="MCP-TIM-2"),
    Option("clock_edge", "s", 0, "rise and fall time of the clock", low=0, clause="MCP-TIM-3"),
    Option("input_edge", "s", 0, "rise and fall time of the other inputs", low=0,
           clause="MCP-TIM-9"),
)  # fmt: skip

# -- Values: telemetry; the other registers are found as the map names them ------

VALUES: Final = ValueTable(
    Value("mode", "mode()", key="mode", text=True),
    Value("command position", key="command", lane="desired", register="COMMAND_POSITION"),
    Value("actual position", "axis.counter.position(chip.cycle_now())", key="actual", lane="real",
          register="ACTUAL_POSITION"),
    Value("position error", key="error", lane="error", register="POSITION_ERROR"),
    Value("actual velocity", key="velocity", lane="velocity", register="ACTUAL_VELOCITY"),
    Value("motor output", "drive()", key="drive", lane="output", step=1e-4),
    Value("flags", key="flags", register="FLAG"),
    Value("status", key="status", register="STATUS"),
    Value("profile phase", key="phase", register="PHASE"),
    Value("sample timer", "axis.timer.count(chip.cycle_now())", register="SAMPLE_TIMER"),
    registers=REGISTERS, home="axis.registers.",
)  # fmt: skip
