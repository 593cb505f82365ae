"""What the MC1241A/MC1141A manual says, as data: commands, parameters, bits, pins, timings."""

from typing import Final

from vbus.chips.ac_table import AcLimit, AcTable, rules_in
from vbus.chips.bus_watch import ADDRESS, BYTE, EITHER, BusTable, Strobe
from vbus.chips.mc1241a.generated.bits import *  # noqa: F403
from vbus.chips.tables import Bit, CardRow, Command, CommandTable, PinRow
from vbus.core.options import Option
from vbus.core.signals import HIGH, LOW, Rule, Value, ValueTable, Z

FAMILY: Final = "mc1241a"

# -- addresses of a whole bus cycle (PMD-BUS-12) ------------------------------------------------

DATA_PORT: Final = 0
"""HostCmd low: data words."""
COMMAND_PORT: Final = 1
"""HostCmd high: command bytes. Reading it gives the *adapter's* status byte."""
RESET_PORT: Final = 2
"""Written: the adapter pulses ~Reset. Reading it gives the adapter's status byte too."""

STATUS_READY: Final = 0x80
"""Adapter status D7: level of HostRdy."""
STATUS_NO_INTERRUPT: Final = 0x40
"""Adapter status D6: level of ~HostIntrpt."""


CARD_DECODES: Final[dict[str, tuple[CardRow, ...]]] = {
    # "Interfacing MC1241A to ISA bus": 340H, 342H, 344H, 348H.
    "isa": (
        CardRow(0, read=DATA_PORT, write=DATA_PORT),
        CardRow(2, write=COMMAND_PORT),
        CardRow(4, read=COMMAND_PORT, bits=STATUS_READY),
        CardRow(8, write=RESET_PORT),
    ),
    # Cards with neighbouring byte ports and both lines in the status byte.
    "byte": (
        CardRow(0, read=DATA_PORT, write=DATA_PORT),
        CardRow(1, read=COMMAND_PORT, write=COMMAND_PORT,
                bits=STATUS_READY | STATUS_NO_INTERRUPT),
    ),
}  # fmt: skip
"""Address decodes of known cards (PMD-BUS-12)."""

# -- timing, in clock periods --------------------------------------------------------------------

CYCLE_CLK: Final = 13_568
"""One cycle, 542.72 us at 25 MHz: the unit of time of every profile."""
SLOTS: Final = 8
"""Microstep look-ups in a cycle (PMD-USTP-2)."""
SLOT_CLK: Final = CYCLE_CLK // SLOTS
BUSY_HALF_CLK: Final = 3_375
"""Busy to ready, typically: 67.5 us at 25 MHz, in half clock periods (PMD-BUS-7)."""
RESET_CLK: Final = 50_000
"""2 ms from reset to ready (PMD-RST-1)."""
FRAME_CLK: Final = 256
"""One PWM frame: 97.66 kHz (PMD-USTP-6)."""
FILTER_CLK: Final = 12
"""Inputs must be stable for three clocks of 160 ns (PMD-ENC-1)."""

# -- status word (PMD-STA-1) ---------------------------------------------------------------------

STATUS_BITS: Final = (
    Bit(0, "motion complete", "the trajectory has ended"),
    Bit(1, "wrap", "a position has passed one end of its range and goes on from the other"),
    Bit(2, "breakpoint", "a breakpoint's condition was met"),
    Bit(3, "capture", "index or home has captured the actual position"),
    Bit(4, "motion error", "the position error has exceeded its limit"),
    Bit(5, "positive limit", "the positive limit switch has stopped the axis"),
    Bit(6, "negative limit", "the negative limit switch has stopped the axis"),
    Bit(7, "command error", "a command was refused for the state the axis was in"),
    Bit(8, "motor on", "the profile generator is enabled"),
    Bit(9, "axis on", "always 1"),
    Bit(10, "in motion", "the trajectory is in motion"),
    Bit(12, "axis 2", "number of the axis, less one"),
)
EVENTS: Final = 0x00FF
AXIS_SHIFT: Final = 12

# -- mode word (PMD-STA-5) -----------------------------------------------------------------------

MODE_BITS: Final = (
    Bit(7, "auto stop", "a motion error turns the motor off"),
    Bit(10, "auto update off", "a breakpoint does not update"),
    Bit(11, "profile, low bit", "00 trapezoidal, 01 velocity, 10 S-curve, 11 gear"),
    Bit(12, "profile, high bit"),
    Bit(13, "S-curve phase, low bit", "0 at rest, 1 to 7"),
    Bit(14, "S-curve phase, middle bit"),
    Bit(15, "S-curve phase, high bit"),
)
PROFILE_SHIFT: Final = 11
PHASE_SHIFT: Final = 13

TRAPEZOIDAL: Final = 0
VELOCITY: Final = 1
S_CURVE: Final = 2
GEAR: Final = 3
PROFILES: Final = ("trapezoidal", "velocity", "S-curve", "gear")
"""The four as people call them."""

BRK_OFF: Final = 0
BRK_TIME: Final = 1
BRK_POS: Final = 2
BRK_NEG: Final = 3
BRK_ACTL_POS: Final = 4
BRK_ACTL_NEG: Final = 5
BRK_MTN_CMPLT: Final = 6
BRK_EXT: Final = 7

OUTPUT_PWM: Final = 0
OUTPUT_DAC16: Final = 2

TWO_PHASE: Final = 0x0008
"""GET_PHASE_INFO bit 3."""

CAPTURE_INDEX: Final = 0
CAPTURE_HOME: Final = 1

# -- parameters ----------------------------------------------------------------------------------

POSITION_BITS: Final = 31
"""Positions run from -2^30 to 2^30-1 and wrap (PMD-TRJ-1)."""
MAGNITUDE_BITS: Final = 30
"""Velocities and trapezoidal accelerations: 0 to 2^30-1."""
ACCELERATION_BITS: Final = 31
"""Velocity-contouring accelerations: -2^30 to 2^30-1."""
FULL_SCALE: Final = 32_767
"""Largest phase output and motor command."""

# -- commands ------------------------------------------------------------------------------------

COMMANDS: Final = CommandTable(
    # Axis control
    Command("SET_1", 0x01, read=1, clause="PMD-CMD-1", hook="select", value=0,
            title="Set current axis # to 1"),
    Command("SET_2", 0x02, read=1, clause="PMD-CMD-2", hook="select", value=1,
            title="Set current axis # to 2"),
    Command("SET_I", 0x08, read=1, scope="i", clause="PMD-CMD-3", hook="select_interrupting",
            title="Set current axis # to the interrupting axis"),
    # Profile generation
    Command("SET_PRFL_S_CRV", 0x0B, scope="c", clause="PMD-CMD-4", hook="set_profile",
            value=S_CURVE, title="Set profile mode to S-curve"),
    Command("SET_PRFL_TRAP", 0x09, scope="c", clause="PMD-CMD-5", hook="set_profile",
            value=TRAPEZOIDAL, title="Set profile mode to trapezoidal point to point"),
    Command("SET_PRFL_VEL", 0x0A, scope="c", clause="PMD-CMD-6", hook="set_profile", value=VELOCITY,
            title="Set profile mode to velocity-contouring"),
    Command("SET_PRFL_GEAR", 0x0C, scope="c", clause="PMD-CMD-7", hook="set_profile", value=GEAR,
            title="Set profile mode to electronic gear"),
    Command("SET_POS", 0x10, write=2, scope="c", clause="PMD-CMD-8", hook="set_position",
            bits=POSITION_BITS, buffered=True, signed=True, unit="ustep",
            title="Set command position"),
    Command("SET_VEL", 0x11, write=2, scope="c", clause="PMD-CMD-9", parameter="buffer.velocity",
            bits=MAGNITUDE_BITS, buffered=True, fraction=16, unit="ustep/cycle",
            title="Set command velocity"),
    Command("SET_ACC", 0x12, write=2, scope="c", clause="PMD-CMD-10",
            parameter="buffer.acceleration", bits=32, buffered=True, signed=True, fraction=16,
            unit="ustep/cycle/cycle", title="Set command acceleration"),
    Command("SET_MAX_ACC", 0x15, write=1, scope="c", clause="PMD-CMD-11",
            parameter="buffer.max_acceleration", bits=15, buffered=True, fraction=16,
            unit="ustep/cycle/cycle", title="Set max acceleration (S-curve profile only)"),
    Command("SET_JERK", 0x13, write=2, scope="c", clause="PMD-CMD-12", parameter="buffer.jerk",
            bits=31, buffered=True, fraction=32, unit="ustep/cycle/cycle/cycle",
            title="Set command jerk"),
    Command("SET_RATIO", 0x14, write=2, scope="c", clause="PMD-CMD-13", parameter="buffer.ratio",
            bits=32, buffered=True, signed=True, fraction=16, unit="ustep/cnt",
            title="Set command electronic gear ratio"),
    Command("SET_START_VEL", 0x6A, write=2, scope="c", clause="PMD-CMD-14",
            hook="set_start_velocity", bits=MAGNITUDE_BITS, fraction=16, unit="ustep/cycle",
            title="Set starting velocity"),
    Command("STOP", 0x46, scope="c", clause="PMD-CMD-15", parameter="buffer.stop", value=1,
            buffered=True, title="Abruptly stop current axis motion"),
    Command("SMOOTH_STOP", 0x4E, scope="c", clause="PMD-CMD-16", parameter="buffer.smooth_stop",
            value=1, buffered=True, title="Smoothly stop current axis motion"),
    Command("SYNCH_PRFL", 0x47, scope="c", clause="PMD-CMD-17", parameter="buffer.synch", value=1,
            buffered=True, title="Set target position to actual position"),
    Command("GET_POS", 0x4A, read=2, scope="c", clause="PMD-CMD-18", parameter="buffer.position",
            buffered=True, signed=True, unit="ustep", title="Get command position"),
    Command("GET_VEL", 0x4B, read=2, scope="c", clause="PMD-CMD-19", parameter="buffer.velocity",
            buffered=True, fraction=16, unit="ustep/cycle", title="Get command velocity"),
    Command("GET_ACC", 0x4C, read=2, scope="c", clause="PMD-CMD-20",
            parameter="buffer.acceleration", buffered=True, signed=True, fraction=16,
            unit="ustep/cycle/cycle", title="Get command acceleration"),
    Command("GET_MAX_ACC", 0x4F, read=1, scope="c", clause="PMD-CMD-21",
            parameter="buffer.max_acceleration", buffered=True, fraction=16,
            unit="ustep/cycle/cycle", title="Get max acceleration (S-curve profile only)"),
    Command("GET_JERK", 0x58, read=2, scope="c", clause="PMD-CMD-22", parameter="buffer.jerk",
            buffered=True, fraction=32, unit="ustep/cycle/cycle/cycle", title="Get command jerk"),
    Command("GET_RATIO", 0x59, read=2, scope="c", clause="PMD-CMD-23", parameter="buffer.ratio",
            buffered=True, signed=True, fraction=16, unit="ustep/cnt",
            title="Get command electronic gear ratio"),
    Command("GET_START_VEL", 0x6B, read=2, scope="c", clause="PMD-CMD-24",
            parameter="start_velocity", fraction=16, unit="ustep/cycle",
            title="Get starting velocity"),
    Command("GET_TRGT_POS", 0x1D, read=2, scope="c", clause="PMD-CMD-25",
            parameter="profile.target_position", signed=True, unit="ustep",
            title="Get current target position"),
    Command("GET_TRGT_VEL", 0x1E, read=2, scope="c", clause="PMD-CMD-26",
            parameter="profile.target_velocity", signed=True, fraction=16, unit="ustep/cycle",
            title="Get current target velocity"),
    # Parameter update
    Command("SET_TIME_BRK", 0x17, scope="c", clause="PMD-CMD-27", hook="set_breakpoint",
            value=BRK_TIME, title="Set breakpoint mode to time"),
    Command("SET_POS_BRK", 0x18, scope="c", clause="PMD-CMD-28", hook="set_breakpoint",
            value=BRK_POS, title="Set breakpoint mode to positive target position"),
    Command("SET_NEG_BRK", 0x19, scope="c", clause="PMD-CMD-29", hook="set_breakpoint",
            value=BRK_NEG, title="Set breakpoint mode to negative target position"),
    Command("SET_ACTL_POS_BRK", 0x1B, scope="c", clause="PMD-CMD-30", hook="set_breakpoint",
            value=BRK_ACTL_POS, title="Set breakpoint mode to positive actual position"),
    Command("SET_ACTL_NEG_BRK", 0x1C, scope="c", clause="PMD-CMD-31", hook="set_breakpoint",
            value=BRK_ACTL_NEG, title="Set breakpoint mode to negative actual position"),
    Command("SET_MTN_CMPLT_BRK", 0x35, scope="c", clause="PMD-CMD-32", hook="set_breakpoint",
            value=BRK_MTN_CMPLT, title="Set breakpoint mode to motion complete"),
    Command("SET_EXT_BRK", 0x5E, scope="c", clause="PMD-CMD-33", hook="set_breakpoint",
            value=BRK_EXT, title="Set breakpoint mode to external"),
    Command("SET_BRK_OFF", 0x6D, scope="c", clause="PMD-CMD-34", parameter="breakpoint_mode",
            value=BRK_OFF, title="Set breakpoint mode off"),
    Command("SET_BRK_PNT", 0x16, write=2, scope="c", clause="PMD-CMD-35",
            hook="set_breakpoint_value", signed=True, title="Set breakpoint comparison value"),
    Command("UPDATE", 0x1A, scope="c", clause="PMD-CMD-36", hook="update",
            title="Immediate parameter update"),
    Command("MULTI_UPDATE", 0x5B, write=1, scope="g", clause="PMD-CMD-37", hook="update_several",
            title="Multiple axis immediate parameter update"),
    Command("SET_AUTO_UPDATE_ON", 0x5C, scope="c", clause="PMD-CMD-38", parameter="auto_update",
            value=1, title="Set automatic profile update on"),
    Command("SET_AUTO_UPDATE_OFF", 0x5D, scope="c", clause="PMD-CMD-39", parameter="auto_update",
            value=0, title="Set automatic profile update off"),
    Command("GET_BRK_PNT", 0x57, read=2, scope="c", clause="PMD-CMD-40",
            parameter="breakpoint_value", signed=True, title="Get breakpoint comparison value"),
    # Interrupt processing
    Command("SET_INTRPT_MASK", 0x2F, write=1, scope="c", clause="PMD-CMD-41",
            parameter="interrupt_mask", bits=8, title="Set interrupt mask"),
    Command("GET_INTRPT", 0x30, read=1, scope="i", clause="PMD-CMD-42", hook="interrupting_status",
            title="Get status of interrupting axis"),
    Command("RST_INTRPT", 0x32, write=1, scope="i", clause="PMD-CMD-43", hook="reset_interrupt",
            title="Reset interrupting events"),
    Command("GET_INTRPT_MASK", 0x56, read=1, scope="c", clause="PMD-CMD-44",
            parameter="interrupt_mask", title="Get interrupt mask"),
    # Status/mode
    Command("CLR_STATUS", 0x33, scope="c", clause="PMD-CMD-45", hook="clear_status", value=0,
            title="Reset status of current axis"),
    Command("RST_STATUS", 0x34, write=1, scope="c", clause="PMD-CMD-46", hook="reset_status",
            title="Reset events for current axis"),
    Command("GET_STATUS", 0x31, read=1, scope="c", clause="PMD-CMD-47", parameter="status",
            title="Get axis status word"),
    Command("GET_MODE", 0x48, read=1, scope="c", clause="PMD-CMD-48", parameter="mode",
            title="Get axis mode word"),
    # Encoder
    Command("GET_ACTL_POS", 0x37, read=2, scope="c", clause="PMD-CMD-49",
            parameter="encoder.actual", signed=True, unit="cnt",
            title="Get current actual axis location"),
    Command("SET_CAPT_INDEX", 0x64, scope="c", clause="PMD-CMD-50", hook="set_capture",
            value=CAPTURE_INDEX, title="Set index signal as position capture trigger"),
    Command("SET_CAPT_HOME", 0x65, scope="c", clause="PMD-CMD-51", hook="set_capture",
            value=CAPTURE_HOME, title="Set home signal as position capture trigger"),
    Command("GET_CAPT", 0x36, read=2, scope="c", clause="PMD-CMD-52", hook="captured", signed=True,
            unit="cnt", title="Get current axis position capture location"),
    Command("SET_STEP_RATIO", 0x68, write=1, scope="c", clause="PMD-CMD-53", hook="set_step_ratio",
            bits=15, fraction=8, unit="cnt/ustep", title="Set number of encoder counts per step"),
    Command("GET_STEP_RATIO", 0x6F, read=1, scope="c", clause="PMD-CMD-54", parameter="step_ratio",
            fraction=8, unit="cnt/ustep", title="Get number of encoder counts per step"),
    Command("SET_AUTO_STOP_ON", 0x45, scope="c", clause="PMD-CMD-55", parameter="auto_stop",
            value=1, title="Set auto stop on motion error mode on"),
    Command("SET_AUTO_STOP_OFF", 0x44, scope="c", clause="PMD-CMD-56", parameter="auto_stop",
            value=0, title="Set auto stop on motion error mode off"),
    Command("SET_POS_ERR", 0x29, write=1, scope="c", clause="PMD-CMD-57",
            parameter="position_error_limit", bits=15, unit="cnt",
            title="Set maximum position error limit"),
    Command("GET_POS_ERR", 0x55, read=1, scope="c", clause="PMD-CMD-58",
            parameter="position_error_limit", unit="cnt", title="Get maximum position error limit"),
    Command("GET_ACTL_POS_ERR", 0x60, read=1, scope="c", clause="PMD-CMD-59",
            parameter="position_error", signed=True, unit="cnt", title="Get actual position error"),
    # Motor control
    Command("SET_OUTPUT_PWM", 0x3C, scope="g", clause="PMD-CMD-60", parameter="output_mode",
            value=OUTPUT_PWM, title="Set motor output mode to PWM"),
    Command("SET_OUTPUT_DAC16", 0x3B, scope="g", clause="PMD-CMD-61", parameter="output_mode",
            value=OUTPUT_DAC16, title="Set motor output mode to 16-bit DAC"),
    Command("MTR_ON", 0x43, scope="c", clause="PMD-CMD-62", hook="enable",
            title="Enable profile generator"),
    Command("MTR_OFF", 0x42, scope="c", clause="PMD-CMD-63", hook="disable",
            title="Disable profile generator"),
    Command("SET_MTR_CMD", 0x62, write=1, scope="c", clause="PMD-CMD-64", hook="set_motor_command",
            bits=16, least=-FULL_SCALE, signed=True, title="Write direct value to motor output"),
    Command("GET_MTR_CMD", 0x3A, read=1, scope="c", clause="PMD-CMD-65",
            parameter="active.motor_command", signed=True, title="Read motor output command"),
    Command("SET_BUF_MTR_CMD", 0x77, write=1, scope="c", clause="PMD-CMD-66",
            hook="set_buffered_motor_command", bits=16, least=-FULL_SCALE, buffered=True,
            signed=True, title="Write double buffered motor command output"),
    Command("GET_BUF_MTR_CMD", 0x69, read=1, scope="c", clause="PMD-CMD-67",
            parameter="buffer.motor_command", buffered=True, signed=True,
            title="Get double buffered motor command value"),
    Command("GET_OUTPUT_MODE", 0x6E, read=1, scope="g", clause="PMD-CMD-68",
            parameter="output_mode", title="Get current output mode"),
    # Miscellaneous
    Command("SET_ACTL_POS", 0x4D, write=2, scope="c", clause="PMD-CMD-69",
            hook="set_actual_position", bits=POSITION_BITS, signed=True, title="Set axis position"),
    Command("SET_LMT_SENSE", 0x66, write=1, scope="g", clause="PMD-CMD-70", parameter="limit_sense",
            bits=4, title="Set limit switch bit sense"),
    Command("GET_LMT_SWTCH", 0x67, read=1, scope="g", clause="PMD-CMD-71", hook="limit_switches",
            title="Get state of limit switches"),
    Command("LMTS_ON", 0x70, scope="g", clause="PMD-CMD-72", hook="set_sensing", value=1,
            title="Set limit switch sensing on"),
    Command("LMTS_OFF", 0x71, scope="g", clause="PMD-CMD-73", hook="set_sensing", value=0,
            title="Set limit switch sensing off"),
    Command("GET_HOME", 0x05, read=1, scope="g", clause="PMD-CMD-74", hook="home_switches",
            title="Get state of home switches"),
    Command("RESET", 0x39, scope="g", clause="PMD-CMD-75", hook="reset", title="Reset chipset"),
    Command("GET_VRSN", 0x6C, read=1, scope="g", clause="PMD-CMD-76", hook="version",
            title="Get chipset software version information"),
    Command("GET_TIME", 0x3E, read=2, scope="g", clause="PMD-CMD-77", parameter="time",
            unit="cycles", title="Get current chip set time (# cycles)"),
    # Microstepping
    Command("SET_PHASE_2", 0x74, scope="c", clause="PMD-CMD-78", hook="set_phases", value=2,
            title="Set waveform to 2-phase"),
    Command("SET_PHASE_3", 0x73, scope="c", clause="PMD-CMD-79", hook="set_phases", value=3,
            title="Set waveform to 3-phase"),
    Command("GET_PHASE_INFO", 0x7F, read=1, scope="c", clause="PMD-CMD-80",
            parameter="stepper.phase_info", title="Get commutation flags set by host"),
)  # fmt: skip
"""The command summary: 80 rows (PMD-CMD-81).

A breakpoint's value has no unit, because it is of either position or in cycles; nor has that of
SET_ACTL_POS, which gives both positions a number.
"""

ILLEGAL_CODES: Final = frozenset({0x00, 0x03, 0x04, 0x22, *range(0x80, 0x100)})
"""Answered with checksum 0 (PMD-PKT-4)."""
RESERVED_CODE: Final = 0x49
"""Does nothing and has a valid checksum (PMD-PKT-5)."""

UPDATES: Final = (COMMANDS["UPDATE"].code, COMMANDS["MULTI_UPDATE"].code)
STATUS_READERS: Final = frozenset(
    COMMANDS[name].code for name in ("GET_STATUS", "GET_INTRPT", "SET_1", "SET_2", "SET_I")
)
"""Codes of commands that give the host a status word."""
FAMILY_CODES: Final[dict[int, tuple[str, int, int]]] = {
    0x06: ("SET_MTR_LMT", 1, 0),
    0x07: ("GET_MTR_LMT", 0, 1),
    0x0F: ("SET_MTR_BIAS", 1, 0),
    0x25: ("SET_KP", 1, 0),
    0x26: ("SET_KI", 1, 0),
    0x27: ("SET_KD", 1, 0),
    0x28: ("SET_I_LM", 1, 0),
    0x2B: ("SET_KVFF", 1, 0),
    0x2D: ("GET_MTR_BIAS", 0, 1),
    0x2E: ("GET_INTGR", 0, 2),
    0x38: ("SET_SMPL_TIME", 1, 0),
    0x40: ("AXIS_OFF", 0, 0),
    0x41: ("AXIS_ON", 0, 0),
    0x50: ("GET_KP", 0, 1),
    0x51: ("GET_KI", 0, 1),
    0x52: ("GET_KD", 0, 1),
    0x53: ("GET_I_LM", 0, 1),
    0x54: ("GET_KVFF", 0, 1),
    0x61: ("GET_SMPL_TIME", 0, 1),
}
"""Codes of the servo chips of the family: name, words written, words read (PMD-PKT-6)."""

# -- version word (PMD-VER-1) --------------------------------------------------------------------

VERSIONS: Final = {"MC1241A": 0x4A10, "MC1141A": 0x4210}
"""The manual's worked word with the first version of "A" parts, 2.0 (PMD-VER-2, NOTES 22)."""

# -- pins ----------------------------------------------------------------------------------------

BUS: Final = BusTable(
    ("~HostSlct", "HostCmd", "~HostRead", "~HostWrite"),
    strobes=(
        Strobe(("~HostSlct", "~HostWrite"), HIGH, "write"),
        Strobe(("~HostSlct", "~HostRead"), HIGH, "take", (("HostCmd", LOW),)),
        Strobe(("~HostSlct", "~HostRead"), HIGH, "empty", (("HostCmd", HIGH),)),
        Strobe(("HostCmd",), EITHER, "place"),
        Strobe(("~HostSlct",), HIGH, "release"),
        Strobe(("~HostSlct", "~HostRead", "~HostWrite"), LOW, "clash"),
        Strobe(("~HostSlct", "~HostRead", "HostCmd"), LOW, "begin", (("~HostWrite", HIGH),)),
    ),
    read=(
        (-110_000, "HostCmd", LOW), (-110_000, "~HostSlct", LOW), (-100_000, "~HostRead", LOW),
        (0, "~HostRead", HIGH), (25_000, "~HostSlct", HIGH), (25_000, "HostCmd", Z),
    ),
    write=(
        (-110_000, "HostCmd", ADDRESS), (-110_000, "~HostSlct", LOW),
        (-100_000, "~HostWrite", LOW), (-100_000, "D0-D7", BYTE), (0, "~HostWrite", HIGH),
        (30_000, "~HostSlct", HIGH), (30_000, "HostCmd", Z), (30_000, "D0-D7", Z),
    ),
    address="HostCmd",
    # The adapter answers by itself: it has a status byte, and a write that pulses ~Reset.
    special={
        **dict.fromkeys(((COMMAND_PORT, False), (RESET_PORT, False)), ()),
        (RESET_PORT, True): ((-1_000_000, "~Reset", LOW), (0, "~Reset", Z)),
    },
    cycle_ps=200_000,
)  # fmt: skip
"""The host bus (PMD-BUS-2 to PMD-BUS-4)."""

PINS: Final = (
    PinRow("~HostSlct", "in", strobe=True, select=True, title="Host Port Select"),
    PinRow("~HostWrite", "in", strobe=True, title="Host Port Write data"),
    PinRow("~HostRead", "in", strobe=True, title="Host Port Read data"),
    PinRow("HostCmd", "in", rest=LOW, strobe=True, title="Host Port Command"),
    PinRow("D0-D7", "io", rest=Z, width=8, title="HostData0-7"),
    PinRow("HostRdy", "out", rest=LOW, title="Host Port Ready/Busy"),
    PinRow("~HostIntrpt", "out", title="Host Interrupt"),
    PinRow("~Reset", "in", title="Master chip set reset"),
    PinRow("QuadA1", "in", rest=LOW, title="Quadrature channel A, axis 1"),
    PinRow("QuadB1", "in", rest=LOW, title="Quadrature channel B, axis 1"),
    PinRow("~Index1", "in", title="Index encoder signal, axis 1"),
    PinRow("~Home1", "in", title="Home signal, axis 1"),
    PinRow("PosLimit1", "in", rest=LOW, title="Positive limit switch, axis 1"),
    PinRow("NegLimit1", "in", rest=LOW, title="Negative limit switch, axis 1"),
    PinRow("QuadA2", "in", rest=LOW, title="Quadrature channel A, axis 2"),
    PinRow("QuadB2", "in", rest=LOW, title="Quadrature channel B, axis 2"),
    PinRow("~Index2", "in", title="Index encoder signal, axis 2"),
    PinRow("~Home2", "in", title="Home signal, axis 2"),
    PinRow("PosLimit2", "in", rest=LOW, title="Positive limit switch, axis 2"),
    PinRow("NegLimit2", "in", rest=LOW, title="Negative limit switch, axis 2"),
    PinRow("PWMMag1A", "out", rest=LOW, wave=True, title="PWM magnitude, axis 1 phase A"),
    PinRow("PWMSign1A", "out", rest=LOW, wave=True, title="PWM direction, axis 1 phase A"),
    PinRow("PWMMag1B", "out", rest=LOW, wave=True, title="PWM magnitude, axis 1 phase B"),
    PinRow("PWMSign1B", "out", rest=LOW, wave=True, title="PWM direction, axis 1 phase B"),
    PinRow("PWMMag2A", "out", rest=LOW, wave=True, title="PWM magnitude, axis 2 phase A"),
    PinRow("PWMSign2A", "out", rest=LOW, wave=True, title="PWM direction, axis 2 phase A"),
    PinRow("PWMMag2B", "out", rest=LOW, wave=True, title="PWM magnitude, axis 2 phase B"),
    PinRow("PWMSign2B", "out", rest=LOW, wave=True, title="PWM direction, axis 2 phase B"),
    PinRow("DAC16Addr0-1", "out", rest=LOW, width=2, title="Axis and phase of the DAC word"),
    PinRow("Data0-11", "out", rest=LOW, width=12, title="DAC word, high 12 bits"),
    PinRow("DACLow0-3", "out", rest=LOW, width=4, title="DAC word, low 4 bits"),
    PinRow("I/OAddr0-3", "out", rest=LOW, width=4, title="Multi-purpose address; FH for a DAC"),
    PinRow("~I/OWrite", "out", wave=True, title="Multi-purpose write"),
    PinRow("DACSlct", "out", rest=LOW, wave=True, title="DAC Select"),
)
"""The pins a board can use; links between the two ICs of the set, supplies and clocks are not."""

# -- AC characteristics --------------------------------------------------------------------------

AC: Final = AcTable(
    FAMILY,
    AcLimit("T1", "PMD-TIM-1", "quadrature phase pulse width", min_ps=1_600_000),
    AcLimit("T2", "PMD-TIM-2", "dwell time per quadrature state", min_ps=800_000),
    AcLimit("T3", "PMD-TIM-3", "index set-up and hold to A and B low"),
    AcLimit("power", "PMD-TIM-4", "stable power to reset", min_ps=250_000_000_000),
    AcLimit("reset", "PMD-TIM-5", "~Reset low", min_ps=1_000_000),
    AcLimit("T4", "PMD-TIM-6", "clock high or low", min_ps=19_500, max_ps=75_000),
    AcLimit("T5", "PMD-TIM-7", "clock period", min_ps=39_000, max_ps=149_000),
    AcLimit("T6", "PMD-TIM-8", "~HostSlct hold after the strobe", min_ps=15_000, max_ps=2_000_000),
    AcLimit("T7w", "PMD-TIM-9", "~HostSlct set-up before ~HostWrite", min_ps=10_000),
    AcLimit("T7r", "PMD-TIM-9", "~HostSlct set-up before ~HostRead", min_ps=-20_000),
    AcLimit("T8w", "PMD-TIM-10", "HostCmd set-up before ~HostWrite", min_ps=10_000),
    AcLimit("T8r", "PMD-TIM-10", "HostCmd set-up before ~HostRead", min_ps=-20_000),
    AcLimit("T9", "PMD-TIM-11", "HostCmd hold after the strobe", min_ps=25_000),
    AcLimit("T10", "PMD-TIM-12", "read data access time", min_ps=50_000, output=True),
    AcLimit("T11", "PMD-TIM-13", "read data hold", min_ps=10_000, output=True),
    AcLimit("T12", "PMD-TIM-14", "~HostRead rise to high impedance", min_ps=50_000, output=True),
    AcLimit("T13", "PMD-TIM-15", "HostRdy delay", min_ps=70_000, output=True),
    AcLimit("T14", "PMD-TIM-16", "~HostWrite low", min_ps=50_000),
    AcLimit("T15", "PMD-TIM-17", "write data set-up", min_ps=35_000),
    AcLimit("T16", "PMD-TIM-18", "write data hold", min_ps=30_000),
    AcLimit("T17", "PMD-TIM-19", "read recovery", min_ps=60_000),
    AcLimit("T18", "PMD-TIM-20", "write recovery", min_ps=60_000),
    # The chip's own DAC port (PMD-TIM-21); the waveform of output.py keeps them.
    AcLimit("T19", "PMD-TIM-21", "I/OAddr stable to ~I/OWrite", min_ps=35_000, output=True),
    AcLimit("T20", "PMD-TIM-21", "~I/OWrite low", min_ps=56_000, max_ps=95_000, output=True),
    AcLimit("T21", "PMD-TIM-21", "data hold after ~I/OWrite", min_ps=17_000, output=True),
    AcLimit("T22", "PMD-TIM-21", "ClkOut low to I/OAddr stable", min_ps=10_000, max_ps=40_000,
            output=True),
    AcLimit("T23", "PMD-TIM-21", "ClkOut low to ~I/OWrite low", min_ps=75_000, max_ps=92_000,
            output=True),
    AcLimit("T24", "PMD-TIM-21", "ClkOut low to data valid", max_ps=92_000, output=True),
    AcLimit("T25", "PMD-TIM-21", "ClkOut cycle", min_clk=4, output=True),
    AcLimit("T26", "PMD-TIM-21", "I/OAddr stable to DACSlct high", max_ps=66_000, output=True),
    AcLimit("T27", "PMD-TIM-21", "~I/OWrite low to DACSlct high", max_ps=44_500, output=True),
)  # fmt: skip

# -- rules beside the AC limits ------------------------------------------------------------------

NOT_READY: Final = Rule(
    "mc1241a.not-ready", "PMD-BUS-8", "The host port may be used only while HostRdy is high."
)
READ_COMMAND: Final = Rule(
    "mc1241a.read-command", "PMD-BUS-4", "~HostRead must not be low while HostCmd is high."
)
FLOATING_WRITE: Final = Rule(
    "mc1241a.floating-write", "PMD-BUS-13",
    "D0-D7 are driven until the byte that is written is latched.", "warning",
)  # fmt: skip
BOTH_STROBES: Final = Rule(
    "mc1241a.both-strobes", "PMD-BUS-2", "~HostRead and ~HostWrite must not be low together."
)
ABORTED: Final = Rule(
    "mc1241a.aborted", "PMD-BUS-10", "A command must not cut a packet short.", "warning"
)
UNEXPECTED_WRITE: Final = Rule(
    "mc1241a.unexpected-write", "PMD-BUS-11", "No data word was to be written now.", "warning"
)
UNEXPECTED_READ: Final = Rule(
    "mc1241a.unexpected-read", "PMD-BUS-11", "A data word was to be written, not read.", "warning"
)
ILLEGAL: Final = Rule(
    "mc1241a.illegal-command", "PMD-PKT-4", "The command code must be a legal one.", "warning"
)
RESERVED: Final = Rule(
    "mc1241a.reserved-command", "PMD-PKT-5", "Reserved codes should not be used.", "warning"
)
RANGE: Final = Rule(
    "mc1241a.range", "PMD-CMD-82", "Data must lie in the parameter's range.", "warning"
)
UNUSED_BITS: Final = Rule(
    "mc1241a.unused-bits", "PMD-CMD-82", "Unused bits of a data word must be 0.", "warning"
)
NO_SUCH_AXIS: Final = Rule(
    "mc1241a.no-such-axis", "PMD-CMD-2", "The part has only one axis.", "warning"
)
MOVING: Final = Rule(
    "mc1241a.mode-in-motion", "PMD-TRJ-13",
    "The axis should be at rest when point-to-point profiles are selected.", "warning",
)  # fmt: skip
STOP_TWICE: Final = Rule(
    "mc1241a.two-stops", "PMD-TRJ-11", "STOP and SMOOTH_STOP in one update: STOP wins.", "note"
)
COMMAND_REFUSED: Final = Rule(
    "mc1241a.command-error", "PMD-ERR-1", "The axis must be in a state that allows the command.",
    "warning",
)  # fmt: skip
MOTOR_COMMAND_LOST: Final = Rule(
    "mc1241a.motor-command-lost", "PMD-UPD-1",
    "An update should find the motor command set by SET_MTR_CMD equal to the buffered one.",
    "note",
)  # fmt: skip
WITHOUT_CURRENT: Final = Rule(
    "mc1241a.without-current", "PMD-CMD-64",
    "A motor command above 0 should be set before a profile runs: with 0 no phase has a current.",
    "note",
)  # fmt: skip
TWO_CHANNELS: Final = Rule(
    "mc1241a.quadrature", "PMD-ENC-1", "Only one of A and B may change at a time."
)

KEEPS_INTERRUPT: Final = Rule(
    "mc1241a.keeps-interrupt", "PMD-INT-3",
    "RST_INTRPT clears an event that interrupts: of its word a 0 clears, and a 1 leaves.",
    "warning",
)  # fmt: skip
KEEPS_STATUS: Final = Rule(
    "mc1241a.keeps-status", "PMD-CMD-46",
    "RST_STATUS clears an event: of its word a 0 clears, and FFH in its low byte leaves all.",
    "warning",
)  # fmt: skip
LIMIT_UNWATCHED: Final = Rule(
    "mc1241a.limit-unwatched", "PMD-STL-1",
    "A limit set by SET_POS_ERR has a step ratio above 0: without one it is never compared.",
    "warning",
)  # fmt: skip
NO_STEP_RATIO: Final = Rule(
    "mc1241a.no-step-ratio", "PMD-STL-1",
    "With a step ratio above 0 the axis is compared with its encoder; with 0 no stall is found.",
    "note",
)  # fmt: skip
IDLE_UPDATE: Final = Rule(
    "mc1241a.idle-update", "PMD-UPD-1", "UPDATE follows what has been loaded for it.", "note"
)
CHECKSUM_UNREAD: Final = Rule(
    "mc1241a.checksum-unread", "PMD-PKT-2",
    "A host reads checksums, by which it finds a byte that went wrong.", "note",
)  # fmt: skip
INTERRUPT_STANDS: Final = Rule(
    "mc1241a.interrupt-stands", "PMD-INT-1",
    "When a run ends, ~HostIntrpt has been answered by RST_INTRPT, if it is wired.", "note",
)  # fmt: skip
ERRORS_STAND: Final = Rule(
    "mc1241a.errors-stand", "PMD-STA-1",
    "When a run ends, errors in the status words have been cleared.", "note",
)  # fmt: skip
ERROR_UNREAD: Final = Rule(
    "mc1241a.error-unread", "PMD-STA-2",
    "A command error and a motion error are read in a status word before they are cleared.", "note",
)  # fmt: skip
NO_RATE: Final = Rule(
    "mc1241a.no-rate", "PMD-TRJ-12",
    "A move has its velocity and acceleration when an update starts it, or it does not begin.",
    "note",
)  # fmt: skip
LATE_VALUE: Final = Rule(
    "mc1241a.late-value", "PMD-CMD-35",
    "SET_BRK_PNT comes before the breakpoint that compares with it: it may be met by the old one.",
    "warning",
)  # fmt: skip
START_VELOCITY: Final = Rule(
    "mc1241a.start-velocity", "PMD-CMD-14",
    "The starting velocity is smaller than the velocity of the profile.", "warning",
)  # fmt: skip
ABRUPT_STOP: Final = Rule(
    "mc1241a.abrupt-stop", "PMD-TRJ-9",
    "SMOOTH_STOP ends a motion: STOP at speed is for emergencies, and a stepper loses steps.",
    "note",
)  # fmt: skip
OTHER_PROFILE: Final = Rule(
    "mc1241a.other-profile", "PMD-CMD-10",
    "SET_ACC is for trapezoids and velocities, SET_MAX_ACC and SET_JERK are for S-curves.", "note",
)  # fmt: skip
STALE_COMPLETE: Final = Rule(
    "mc1241a.stale-complete", "PMD-CMD-32",
    "SET_MTN_CMPLT_BRK comes with motion complete cleared: else the breakpoint is met at once.",
    "warning",
)  # fmt: skip
MET_AT_ONCE: Final = Rule(
    "mc1241a.met-at-once", "PMD-UPD-2",
    "The condition of a breakpoint does not hold yet when it is set, or the update comes at once.",
    "note",
)  # fmt: skip
TIME_PASSED: Final = Rule(
    "mc1241a.time-passed", "PMD-CMD-27",
    "A time breakpoint lies ahead: its value is a number of cycles since reset, not from now on.",
    "warning",
)  # fmt: skip
MOTOR_IS_OFF: Final = Rule(
    "mc1241a.motor-off", "PMD-MTR-2",
    "MTR_ON comes before the update that is to start a motion: with the motor off none begins.",
    "warning",
)  # fmt: skip
RUNS_ON: Final = Rule(
    "mc1241a.runs-on", "PMD-STL-1",
    "A motion error ends its motion: by auto stop, or the host stops the axis.", "note",
)  # fmt: skip
CLEARED_LATE: Final = Rule(
    "mc1241a.cleared-late", "PMD-STA-2",
    "Motion complete is cleared before a move begins: later, that of a short move goes with it.",
    "note",
)  # fmt: skip
NO_INTERRUPT: Final = Rule(
    "mc1241a.no-interrupt", "PMD-INT-3",
    "RST_INTRPT answers an interrupt: where none stands it clears nothing, and RST_STATUS does.",
    "note",
)  # fmt: skip
LIMITS_OFF: Final = Rule(
    "mc1241a.limits-off", "PMD-CMD-73",
    "When a run ends, LMTS_ON has followed an LMTS_OFF that was given on a limit switch.", "note",
)  # fmt: skip
CURRENT_LEFT: Final = Rule(
    "mc1241a.current-left", "PMD-CMD-66",
    "When a run ends, an update has taken a motor command that was loaded alone, at rest.",
    "warning",
)  # fmt: skip
LEFT_LOADED: Final = Rule(
    "mc1241a.left-loaded", "PMD-UPD-1", "When a run ends, an update has taken what was loaded.",
    "note",
)  # fmt: skip

RULES: Final = (*AC.rules.values(), *rules_in(globals()))
"""What a host can break: each AC limit, and each rule above."""

# -- settings ------------------------------------------------------------------------------------

OPTIONS: Final = (
    Option("host_busy", "choice", "fixed",
           "when HostRdy rises: after 67.5 us, or at the next microstep slot",
           choices=("fixed", "slot"), clause="PMD-BUS-7", extremes=("slot",)),
    Option("family_codes", "choice", "illegal",
           "what codes of the family's servo chips do: nothing legal, or nothing at all",
           choices=("illegal", "noop"), clause="PMD-PKT-6"),
    Option("version_word", "count", 0, "what GET_VRSN returns; 0 is the part's own word",
           low=0, high=0xFFFF, clause="PMD-VER-2"),
    Option("pwm_sign", "choice", "low", "level of the PWMSign pins for positive outputs",
           choices=("low", "high"), clause="PMD-AMB-23"),
    Option("phase_b", "choice", "leads", "phase B leads or lags phase A",
           choices=("leads", "lags"), clause="PMD-AMB-23"),
    Option("encoder_1", "choice", "axis 1", "axis whose mechanics turn encoder 1",
           choices=("axis 1", "axis 2"), clause="PMD-TRJ-7"),
    Option("encoder_2", "choice", "axis 2", "axis whose mechanics turn encoder 2",
           choices=("axis 1", "axis 2"), clause="PMD-TRJ-7"),
    Option("cold_start", "flag", False,
           "power comes up at the start of time, and ~Reset before 250 ms is a violation",
           clause="PMD-TIM-4"),
)  # fmt: skip
"""Keys a board file may give to the chip set."""

# -- Values: registers that commands load and read, and telemetry -------------------------------

_STATUS: Final = "status"
_POSITION: Final = "position"
_PROFILE: Final = "profile"
_MOTOR: Final = "motor"
_VELOCITY: Final = "ustep/cycle"
_ACCELERATION: Final = "ustep/cycle/cycle"
_EVENTS: Final = tuple(bit for bit in STATUS_BITS if bit.mask & EVENTS)
_BREAKPOINTS: Final = (
    "off", "time", "positive target position", "negative target position",
    "positive actual position", "negative actual position", "motion complete", "external",
)  # fmt: skip


def _double(
    name: str, attribute: str, clause: str, unit: str, fraction: int = 0
) -> tuple[Value, ...]:
    """Return a double-buffered register: the buffer, and the active one (PMD-UPD-1)."""
    return (
        Value(f"{name} buffered", f"axes[{{}}].buffer.{attribute}", _PROFILE, clause,
              "as the host loaded it", unit, fraction),
        Value(name, f"axes[{{}}].active.{attribute}", _PROFILE, "PMD-UPD-1",
              "in use since the last update", unit, fraction),
    )  # fmt: skip


VALUES: Final = ValueTable(
    Value("status word", group=_STATUS, clause="PMD-STA-1", command="GET_STATUS",
          digits=4, fields=STATUS_BITS, key="status {}"),
    Value("mode word", group=_STATUS, clause="PMD-STA-5", command="GET_MODE",
          digits=4, fields=MODE_BITS, key="mode {}"),
    Value("interrupt mask", "axes[{}].interrupt_mask", _STATUS, "PMD-CMD-41",
          "events that pull ~HostIntrpt", digits=2, fields=_EVENTS),
    Value("breakpoint mode", "axes[{}].breakpoint_mode", _STATUS, "PMD-CMD-27",
          "what is compared", words=_BREAKPOINTS),
    Value("breakpoint value", "axes[{}].breakpoint_value", _STATUS, "PMD-CMD-35",
          "what it is compared with"),
    Value("target position", group=_POSITION, command="GET_TRGT_POS",
          key="target {}", lane="desired"),
    Value("target velocity", group=_POSITION, command="GET_TRGT_VEL"),
    Value("actual position", group=_POSITION, command="GET_ACTL_POS", key="actual {}", lane="real"),
    Value("position error", group=_POSITION, command="GET_ACTL_POS_ERR",
          key="error {}", lane="error"),
    Value("position error limit", group=_POSITION, command="SET_POS_ERR"),
    Value("step ratio", "axes[{}].step_ratio", _POSITION, "PMD-CMD-53",
          "encoder counts for each microstep", "cnt/ustep", 8),
    Value("profile mode", "axes[{}].profile.mode", _PROFILE, "PMD-CMD-4",
          "which profile is generated", words=PROFILES),
    *_double("position", "position", "PMD-CMD-8", "ustep"),
    *_double("velocity", "velocity", "PMD-CMD-9", _VELOCITY, 16),
    *_double("acceleration", "acceleration", "PMD-CMD-10", _ACCELERATION, 16),
    *_double("max acceleration", "max_acceleration", "PMD-CMD-11", _ACCELERATION, 16),
    *_double("jerk", "jerk", "PMD-CMD-12", "ustep/cycle/cycle/cycle", 32),
    *_double("gear ratio", "ratio", "PMD-CMD-13", "ustep/cnt", 16),
    Value("start velocity", "axes[{}].start_velocity", _PROFILE, "PMD-CMD-14",
          "as SET_START_VEL set it", _VELOCITY, 16),
    *_double("motor command", "motor_command", "PMD-CMD-64", ""),
    Value("phase information", group=_MOTOR, command="GET_PHASE_INFO", digits=4),
    Value("current axis", "commands.current", "chip set", "PMD-CMD-1",
          "which axis commands are for", words=("1", "2")),
    Value("output mode", "shared.output_mode", "chip set", "PMD-CMD-68",
          "how the motors are driven", words=("PWM", "", "DAC16")),
    Value("limit sense", "shared.limit_sense", "chip set", "PMD-CMD-70",
          "as SET_LMT_SENSE set it", digits=4),
    Value("limit sensing", "shared.sensing", "chip set", "PMD-CMD-72",
          "whether limit switches are looked at", words=("off", "on")),
    Value("time", "shared.time", "chip set", unit="cycles", command="GET_TIME",
          moves=True, key="time"),
    Value("target velocity", "axes[{}].profile.velocity", unit=_VELOCITY, fraction=32,
          key="velocity {}", lane="velocity"),
    Value("phase A", "cycles.phase_outputs({})[0]", key="phase A {}"),
    Value("phase B", "cycles.phase_outputs({})[1]", key="phase B {}"),
    Value("HostRdy", "ready()", key="ready"),
    Value("interrupting axis", "interrupts.axis + 1", key="interrupt"),
    commands=COMMANDS, home="axes[{}].",
    order=("time", "ready", "interrupt", "target {}", "velocity {}", "actual {}", "error {}",
           "status {}", "mode {}", "phase A {}", "phase B {}"),
)  # fmt: skip
