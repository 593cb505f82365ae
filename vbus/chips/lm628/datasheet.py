"""What the LM628/LM629 manual says, as data: commands, bits, pins, AC limits, timings, rules.

Clause ids (``LM-BUS-7``) are those of the project's list for this chip; where the manual is silent
or contradicts itself, NOTES.md says what was chosen.
"""

from typing import Final

from vbus.chips.ac_table import AcLimit, AcTable, rules_in
from vbus.chips.bus_watch import strobed_bus
from vbus.chips.lm628.generated.bits import *  # noqa: F403
from vbus.chips.tables import Bit, Command, CommandTable, PinRow
from vbus.core.kernel import MS, NS, US
from vbus.core.options import Option
from vbus.core.signals import HIGH, LOW, Rule, Value, ValueTable, Z

FAMILY: Final = "lm628"
PARTS: Final = ("LM628N-6", "LM628N-8", "LM629N-6", "LM629N-8", "LM629M-6", "LM629M-8")
ADDRESS_BITS: Final = 1

COMMAND_PORT: Final = 0
"""Address with /PS low: commands are written, the status byte is read."""
DATA_PORT: Final = 1
"""Address with /PS high."""

# -- Table 2. User command set ------------------------------------------------------------------

COMMANDS: Final = CommandTable(
    Command("RESET", 0x00, clause="LM-CMD-1", hook="reset", title="Reset LM628", note="1"),
    Command("PORT8", 0x05, clause="LM-CMD-6", hook="select_port", value=8,
            title="Select 8-Bit Output", note="2"),
    Command("PORT12", 0x06, clause="LM-CMD-7", hook="select_port", value=12,
            title="Select 12-Bit Output", note="2"),
    Command("DFH", 0x02, clause="LM-CMD-3", hook="set_home", title="Define Home", note="1"),
    Command("SIP", 0x03, clause="LM-CMD-4", parameter="sip", value=True, title="Set Index Position",
            note="1"),
    Command("LPEI", 0x1B, write=1, clause="LM-CMD-16", hook="load_threshold", value=0,
            unit="cnt", title="Interrupt on Error", note="1"),
    Command("LPES", 0x1A, write=1, clause="LM-CMD-15", hook="load_threshold", value=1,
            unit="cnt", title="Stop on Error", note="1"),
    Command("SBPA", 0x20, write=2, clause="LM-CMD-21", hook="set_absolute_breakpoint", unit="cnt",
            title="Set Breakpoint, Absolute", note="1", signed=True),
    Command("SBPR", 0x21, write=2, clause="LM-CMD-22", hook="set_relative_breakpoint", unit="cnt",
            title="Set Breakpoint, Relative", note="1", signed=True),
    Command("MSKI", 0x1C, write=1, clause="LM-CMD-17", hook="enable_interrupts",
            title="Mask Interrupts", note="1"),
    Command("RSTI", 0x1D, write=1, clause="LM-CMD-18", hook="reset_interrupts",
            title="Reset Interrupts", note="1"),
    Command("LFIL", 0x1E, write=1, up_to=5, clause="LM-CMD-19", hook="load_filter",
            title="Load Filter Parameters", note="1"),
    Command("UDF", 0x04, clause="LM-CMD-5", hook="request_update", title="Update Filter", note="1"),
    Command("LTRJ", 0x1F, write=1, up_to=7, clause="LM-CMD-20", hook="load_trajectory",
            title="Load Trajectory", note="1"),
    Command("STT", 0x01, clause="LM-CMD-2", hook="start", title="Start Motion", note="3"),
    Command("RDSIGS", 0x0C, read=1, clause="LM-CMD-13", parameter="signals",
            title="Read Signals Register", note="1"),
    Command("RDIP", 0x09, read=2, clause="LM-CMD-10", parameter="index", unit="cnt",
            title="Read Index Position", note="1", signed=True),
    Command("RDDP", 0x08, read=2, clause="LM-CMD-9", parameter="profile.desired_position",
            unit="cnt", title="Read Desired Position", note="1", signed=True),
    Command("RDRP", 0x0A, read=2, clause="LM-CMD-11", parameter="real", unit="cnt",
            title="Read Real Position", note="1", signed=True),
    Command("RDDV", 0x07, read=2, clause="LM-CMD-8", parameter="profile.velocity",
            unit="cnt/sample", title="Read Desired Velocity", note="1", signed=True, fraction=16),
    Command("RDRV", 0x0B, read=1, clause="LM-CMD-12", parameter="real_velocity", unit="cnt/sample",
            title="Read Real Velocity", note="1", signed=True),
    Command("RDSUM", 0x0D, read=1, clause="LM-CMD-14", parameter="pid.term",
            title="Read Integration Sum", note="1", signed=True),
)  # fmt: skip

RESET: Final = COMMANDS["RESET"].code
"""The one command that is carried out at its strobe, not when busy falls (LM-RST-4)."""

MSKI: Final = COMMANDS["MSKI"].code
RSTI: Final = COMMANDS["RSTI"].code
LFIL: Final = COMMANDS["LFIL"].code
UDF: Final = COMMANDS["UDF"].code
LTRJ: Final = COMMANDS["LTRJ"].code
STT: Final = COMMANDS["STT"].code
RDDP: Final = COMMANDS["RDDP"].code
RDIP: Final = COMMANDS["RDIP"].code
RDRP: Final = COMMANDS["RDRP"].code

NOTES: Final = {
    "1": "Commands may be executed on the fly during motion.",
    "2": "Commands not applicable to execution during motion.",
    "3": "Command may be executed during motion if acceleration parameter was not changed.",
}

# -- Tables 3 and 7. Status byte (RDSTAT, LM-CMD-23), interrupt mask and reset ------------------

STATUS: Final = (
    Bit(7, "MOTOR_OFF", "Motor Off"),
    Bit(6, "BREAKPOINT", "Breakpoint Reached [Interrupt]"),
    Bit(5, "POSITION_ERROR", "Excessive Position Error [Interrupt]"),
    Bit(4, "WRAPAROUND", "Wraparound Occurred [Interrupt]"),
    Bit(3, "INDEX", "Index Pulse Observed [Interrupt]"),
    Bit(2, "TRAJECTORY_COMPLETE", "Trajectory Complete [Interrupt]"),
    Bit(1, "COMMAND_ERROR", "Command Error [Interrupt]"),
    Bit(0, "BUSY", "Busy Bit"),
)

INTERRUPTS: Final = 0x7E
"""The six flags that MSKI enables and RSTI resets."""
RESET_MASK: Final = 0x3E
"""After reset all but the breakpoint interrupt are enabled."""

# -- Table 8. Signals register (RDSIGS) ---------------------------------------------------------

SIGNALS: Final = (
    Bit(15, "HOST_INTERRUPT", "Host Interrupt"),
    Bit(14, "ACCELERATION_LOADED", "Acceleration Loaded (But Not Updated)"),
    Bit(13, "UDF_EXECUTED", "UDF Executed (But Filter Not yet Updated)"),
    Bit(12, "FORWARD", "Forward Direction"),
    Bit(11, "VELOCITY_MODE", "Velocity Mode"),
    Bit(10, "ON_TARGET", "On Target"),
    Bit(9, "STOP_ON_ERROR", "Turn Off upon Excessive Position Error"),
    Bit(8, "PORT8", "Eight-Bit Output Mode"),
    *STATUS[:7],
    Bit(0, "SIP", "Acquire Next Index (SIP Executed)"),
)

# -- Table 6. Trajectory control word (LTRJ) ----------------------------------------------------

TRAJECTORY: Final = (
    Bit(12, "FORWARD", "Forward Direction (Velocity Mode Only)"),
    Bit(11, "VELOCITY_MODE", "Velocity Mode"),
    Bit(10, "STOP_SMOOTHLY", "Stop Smoothly (Decelerate as Programmed)"),
    Bit(9, "STOP_ABRUPTLY", "Stop Abruptly (Maximum Deceleration)"),
    Bit(8, "TURN_OFF", "Turn Off Motor (Output Zero Drive)"),
    Bit(5, "LOAD_ACCELERATION", "Acceleration Will Be Loaded"),
    Bit(4, "RELATIVE_ACCELERATION", "Acceleration Data Is Relative"),
    Bit(3, "LOAD_VELOCITY", "Velocity Will Be Loaded"),
    Bit(2, "RELATIVE_VELOCITY", "Velocity Data Is Relative"),
    Bit(1, "LOAD_POSITION", "Position Will Be Loaded"),
    Bit(0, "RELATIVE_POSITION", "Position Data Is Relative"),
)

STOPS: Final = 0x0700
LOADS: Final = (0x20, 0x08, 0x02)
"""Load bits of acceleration, velocity, position; the bit below each makes the data relative."""

RATE_MAX: Final = 0x3FFFFFFF
"""Largest acceleration and velocity, 1/65536 counts per sample (per sample)."""
FOLLOWED_MAX: Final = 256 << 16
"""Largest velocity at which an encoder is followed: a state lasts 8 clock periods (LM-TIM-2)."""
POSITION_BITS: Final = 31
POSITION_MAX: Final = (1 << 30) - 1
POSITION_MIN: Final = -(1 << 30)

# -- Table 4. Filter control word (LFIL); bits 15-8 are the derivative interval, Table 5 --------

FILTER: Final = (
    Bit(3, "LOAD_KP", "Loading kp Data"),
    Bit(2, "LOAD_KI", "Loading ki Data"),
    Bit(1, "LOAD_KD", "Loading kd Data"),
    Bit(0, "LOAD_IL", "Loading il Data"),
)

COEFFICIENT_MAX: Final = 0x7FFF
THRESHOLD_MAX: Final = 0x7FFF

# -- Pinout -------------------------------------------------------------------------------------

_HOST: Final = (
    PinRow("/CS", "in", HIGH, strobe=True, select=True, title="Pin 12 (5): chip select"),
    PinRow("/PS", "in", HIGH, strobe=True, title="Pin 16 (9): low = command port, high = data"),
    PinRow("/RD", "in", HIGH, strobe=True, title="Pin 13 (6): read"),
    PinRow("/WR", "in", HIGH, strobe=True, title="Pin 15 (8): write"),
    PinRow("D0-D7", "io", Z, width=8, title="Pins 4 to 11 (20 to 24, 2 to 4): host port"),
    PinRow("/RST", "in", HIGH, title="Pin 27 (15): reset, acts when it rises"),
    PinRow("HI", "out", LOW, title="Pin 17 (10): host interrupt, active high"),
    PinRow("A", "in", LOW, title="Pin 2 (18): encoder, leads B while going forward"),
    PinRow("B", "in", LOW, title="Pin 3 (19): encoder"),
    PinRow("/IN", "in", HIGH, title="Pin 1 (17): index"),
)
_DAC: Final = tuple(
    PinRow(f"DAC{7 - n}", "out", LOW, title=f"Pin {18 + n}: converter, bit {7 - n}")
    for n in range(8)
)
_PWM: Final = (
    PinRow("SIGN", "out", LOW, title="Pin 18 (11): PWM sign, high = reverse torque"),
    PinRow("MAG", "out", LOW, title="Pin 19 (13): PWM magnitude"),
)

PINS_LM628: Final[tuple[PinRow, ...]] = _HOST + _DAC
PINS_LM629: Final[tuple[PinRow, ...]] = _HOST + _PWM
PINS_OF: Final = {part: PINS_LM629 if part.startswith("LM629") else PINS_LM628 for part in PARTS}
"""An LM629 has a PWM instead of the converter's lines."""
PINS: Final[tuple[PinRow, ...]] = _HOST + _DAC + _PWM
"""Pins of either part."""

# -- AC electrical characteristics --------------------------------------------------------------

AC: Final = AcTable(
    FAMILY,
    AcLimit("T1", "LM-TIM-1", "Motor-phase pulse width at least 16/f", min_clk=16),
    AcLimit("T2", "LM-TIM-2", "Dwell time per encoder state at least 8/f", min_clk=8),
    AcLimit("T3", "LM-TIM-3", "Index pulse set-up and hold relative to A and B low, at least 0"),
    AcLimit("T4", "LM-TIM-4", "Clock pulse width at least 57 ns (-8) or 78 ns (-6)",
            min_ps=57 * NS),
    AcLimit("T5", "LM-TIM-5", "Clock period at least 125 ns (-8) or 166 ns (-6), at most 1 us",
            min_ps=125 * NS, max_ps=US),
    AcLimit("T6", "LM-TIM-6", "Reset pulse width at least 8/f", min_clk=8),
    AcLimit("T7", "LM-TIM-7", "Chip-select set-up and hold around the strobe, at least 0"),
    AcLimit("T8", "LM-TIM-8", "Port-select set-up at least 30 ns", min_ps=30 * NS),
    AcLimit("T9", "LM-TIM-9", "Port-select hold at least 30 ns", min_ps=30 * NS),
    AcLimit("T10", "LM-TIM-10", "Read data access time: valid 180 ns after /RD falls",
            max_ps=180 * NS, output=True),
    AcLimit("T11", "LM-TIM-11", "Read data hold: nothing else drives D0-D7 until /RD rises",
            output=True),
    AcLimit("T12", "LM-TIM-12", "/RD high to hi-Z: nothing else drives D0-D7 for 180 ns",
            max_ps=180 * NS, output=True),
    AcLimit("T14", "LM-TIM-14", "/WR pulse width at least 100 ns", min_ps=100 * NS),
    AcLimit("T15", "LM-TIM-15", "Write data set-up at least 50 ns", min_ps=50 * NS),
    AcLimit("T16", "LM-TIM-16", "Write data hold at least 120 ns", min_ps=120 * NS),
    AcLimit("T17", "LM-TIM-17", "Read recovery at least 120 ns (data port)", min_ps=120 * NS),
    AcLimit("T18", "LM-TIM-18", "Write recovery at least 120 ns (data port)", min_ps=120 * NS),
)  # fmt: skip

CLOCK_LIMITS: Final = {"6": (78 * NS, 166 * NS), "8": (AC["T4"].min_ps, AC["T5"].min_ps)}
"""T4 and T5 minima (ps) by speed grade, the last character of the part number."""
CLOCK_ABSURD: Final = (10_000, 80_000_000)
"""Clocks (Hz) below and above which no such part can be meant at all."""

# -- Timings ------------------------------------------------------------------------------------

# LM-AMB-7: the 2048 periods that the text on reset names are the sample; a derivative interval is
# one or more of them.
SAMPLE_CLK: Final = 2048
"""Servo sample (LM-TRJ-17)."""
BUSY_CLK: Final = 120
"""Busy after an accepted byte (LM-BUS-8): 15 us at 8 MHz, 20 us at 6 MHz."""
BUSY_CAP: Final = 100 * US
"""Busy is never longer (ps)."""
RESET_TIME: Final = MS
"""Default duration of a reset (ps); the manual says less than 1.5 ms."""
BUS: Final = strobed_bus(
    ("/CS", "/PS", "/RD", "/WR"), setup=AC["T8"].min_ps, read_low=AC["T10"].max_ps,
    write_low=AC["T14"].min_ps, hold=AC["T9"].min_ps, data_setup=AC["T14"].min_ps,
    data_hold=AC["T16"].min_ps, cycle_ps=AC["T10"].max_ps + AC["T12"].max_ps,
)  # fmt: skip
"""The host bus (LM-BUS-1 to LM-BUS-3), in whole cycles at the shortest times the manual allows."""

# -- Motor output -------------------------------------------------------------------------------

ZERO_8: Final = 0x80
ZERO_12: Final = 0x800
MUX_CLK: Final = 8
"""Step of the 12-bit port's sequence: word, strobe up, strobe down, next word (NOTES 27)."""
PWM_FRAMES: Final = (128, 256, 512, 1024, 2048)
"""Frame lengths (clk) that fit the sample a whole number of times."""

# -- Rules --------------------------------------------------------------------------------------

CONTENTION: Final = Rule(
    "lm628.contention", "LM-BUS-4", "/RD and /WR must not be low together."
)  # fmt: skip
BUSY_WRITE: Final = Rule(
    "lm628.busy-write", "LM-BUS-10", "Nothing is written while busy: the byte is ignored."
)
BUSY_READ: Final = Rule(
    "lm628.busy-read", "LM-BUS-10", "No data is read while busy: the last byte is returned."
)
FLOATING_WRITE: Final = Rule(
    "lm628.floating-write", "LM-BUS-15",
    "D0-D7 are driven until the byte that is written is latched.", "warning",
)  # fmt: skip
CUT_PACKET: Final = Rule(
    "lm628.cut-packet", "LM-BUS-11",
    "A command is written only after the data of the one before it is complete.", "warning",
)  # fmt: skip
WRONG_WAY: Final = Rule(
    "lm628.wrong-way", "LM-BUS-12",
    "Data goes the way the command says, and no further than it says.", "warning",
)  # fmt: skip
UNDEFINED_COMMAND: Final = Rule(
    "lm628.undefined-command", "LM-BUS-13", "Only command codes of Table 2 are written.", "warning"
)
RESET_WRITE: Final = Rule(
    "lm628.reset-write", "LM-RST-4", "Nothing is written during reset: the byte is ignored."
)
PORT_IN_MOTION: Final = Rule(
    "lm628.port-in-motion", "LM-AMB-11", "PORT8 and PORT12 are not for use in motion.", "warning"
)
PORT12_ON_LM629: Final = Rule(
    "lm628.port12-on-lm629", "LM-CMD-7", "PORT12 is not for the LM629.", "warning"
)
PORT_LOST: Final = Rule(
    "lm628.port-lost", "LM-CMD-7",
    "A host that has chosen 12 bits chooses them again after a reset, which chooses 8.", "warning",
)  # fmt: skip
STT_REFUSED: Final = Rule(
    "lm628.stt-refused", "LM-TRJ-4",
    "After a change of acceleration, STT waits until the motion is over.", "warning",
)  # fmt: skip
STOP_BITS: Final = Rule(
    "lm628.stop-bits", "LM-TRJ-5", "Only one of the stop bits 8 to 10 is set at a time.", "warning"
)
RANGE: Final = Rule(
    "lm628.range", "LM-TRJ-2", "Values stay within the range the manual gives.", "warning"
)
DOUBLE_EDGE: Final = Rule(
    "lm628.double-edge", "LM-POS-1", "A and B must not change together: nothing is counted."
)
INDEX_GROUNDED: Final = Rule(
    "lm628.index-grounded", "LM-POS-3", "The index input is not held low for more than a turn."
)

FILTER_WAITS: Final = Rule(
    "lm628.filter-waits", "LM-CMD-5",
    "What LFIL has loaded is taken by UDF before STT turns the motor on.", "warning",
)  # fmt: skip
NO_ACCELERATION: Final = Rule(
    "lm628.no-acceleration", "LM-TRJ-12",
    "A move from rest has an acceleration above 0: with 0 it never begins.", "warning",
)  # fmt: skip
NO_VELOCITY: Final = Rule(
    "lm628.no-velocity", "LM-TRJ-12",
    "A move has a velocity above 0 when it starts, or it waits for one.", "note",
)  # fmt: skip
VELOCITY_WRAPS: Final = Rule(
    "lm628.velocity-wraps", "LM-TRJ-2",
    "A velocity has 32 bits: cut to 16, it wraps at 1 count per sample.", "warning",
)  # fmt: skip
HASTY: Final = Rule(
    "lm628.hasty", "LM-TRJ-15",
    "The acceleration that a move loads is not above its velocity.", "warning",
)  # fmt: skip
TOO_FAST: Final = Rule(
    "lm628.too-fast", "LM-TIM-2",
    "A velocity is not above 256 counts per sample: the encoder inputs follow no faster axis.",
    "note",
)  # fmt: skip
NO_INTEGRAL: Final = Rule(
    "lm628.no-integral", "LM-PID-5",
    "An integral coefficient and its limit il are both above 0: with one of them 0 the integral"
    " term is 0.", "note",
)  # fmt: skip
VAIN_INTEGRAL: Final = Rule(
    "lm628.vain-integral", "LM-PID-5",
    "When a run of several moves ends, a ki above 0 has once had an il above 0 beside it.",
    "warning",
)  # fmt: skip
NO_TRAJECTORY: Final = Rule(
    "lm628.no-trajectory", "LM-CMD-2", "STT starts what LTRJ has loaded before.", "note"
)
OFF_AT_SPEED: Final = Rule(
    "lm628.off-at-speed", "LM-TRJ-10",
    "A stop bit 9 or 10 ends a motion; with bit 8, or RESET, the axis runs on without drive.",
    "note",
)  # fmt: skip
OFF_WAITS: Final = Rule(
    "lm628.off-waits", "LM-TRJ-10",
    "When a run ends, STT has taken a stop bit 8 that was loaded at rest: until then the motor"
    " stays on.", "warning",
)  # fmt: skip
RESETS_NOTHING: Final = Rule(
    "lm628.resets-nothing", "LM-CMD-18",
    "Of the word of RSTI a 0 clears a flag: with a 1 in each of bits 6 to 1 it clears none.",
    "warning",
)  # fmt: skip
LEAVES_FLAGS: Final = Rule(
    "lm628.leaves-flags", "LM-CMD-18", "RSTI clears a flag that is set.", "note"
)
CLEARS_AWAITED: Final = Rule(
    "lm628.clears-awaited", "LM-CMD-18",
    "RSTI leaves alone the flag of what is still to come: it may have come just before.", "note",
)  # fmt: skip
RESET_FORGETS: Final = Rule(
    "lm628.reset-forgets", "LM-RST-2",
    "RESET comes before what it sets back is loaded: filter, limits, mask, port.", "note",
)  # fmt: skip
STOP_LOST: Final = Rule(
    "lm628.stop-lost", "LM-CMD-16",
    "LPEI ends what LPES has asked for: a position error does not stop the motor any more.", "note",
)  # fmt: skip
HI_STANDS: Final = Rule(
    "lm628.hi-stands", "LM-STA-7",
    "When a run ends, HI has been answered by RSTI, if it is wired.", "note",
)  # fmt: skip
ERRORS_STAND: Final = Rule(
    "lm628.errors-stand", "LM-STA-1",
    "When a run ends, a command error and a position error have been cleared.", "note",
)  # fmt: skip
LEFT_LOADED: Final = Rule(
    "lm628.left-loaded", "LM-CMD-20",
    "When a run ends, UDF or STT has taken what LFIL or LTRJ has loaded.", "note",
)  # fmt: skip
LOAD_LOST: Final = Rule(
    "lm628.load-lost", "LM-CMD-20",
    "STT takes a velocity or a position that LTRJ has loaded before LTRJ loads another one.",
    "note",
)  # fmt: skip
IDLE_BITS: Final = Rule(
    "lm628.idle-bits", "LM-TRJ-1",
    "A control word has no bit that does nothing: one not used, a relative one without its load,"
    " a position or direction that the mode has not.", "note",
)  # fmt: skip
MISPLACED: Final = Rule(
    "lm628.misplaced", "LM-TRJ-1",
    "Flags stand in bits 6 to 1 of MSKI's and RSTI's word, the load bits of LFIL's control word in"
    " bits 3 to 0, its interval in bits 15 to 8: none in bits that do nothing.", "warning",
)  # fmt: skip
UPDATE_WAITS: Final = Rule(
    "lm628.update-waits", "LM-CMD-5",
    "When a run ends, UDF has taken what LFIL had loaded before a move that is over.", "warning",
)  # fmt: skip
MODE_LOST: Final = Rule(
    "lm628.mode-lost", "LM-TRJ-13",
    "LTRJ of an axis that runs in velocity mode has bit 11, a stop bit or a position: else the axis"
    " goes to an old target.", "note",
)  # fmt: skip
TARGET_LOST: Final = Rule(
    "lm628.target-lost", "LM-TRJ-13",
    "A move ends before velocity mode begins: it never comes to its target otherwise.", "note",
)  # fmt: skip
DESIRED_OFF: Final = Rule(
    "lm628.desired-off", "LM-TRJ-10",
    "Where an axis stands whose motor went off on its way, RDRP reads: RDDP stays where the profile"
    " was.", "note",
)  # fmt: skip
INTERVAL_LOST: Final = Rule(
    "lm628.interval-lost", "LM-PID-1",
    "Each LFIL loads the derivative interval: a host saves it, and writes it again.", "note",
)  # fmt: skip
EARLY_BREAKPOINT: Final = Rule(
    "lm628.early-breakpoint", "LM-CMD-22",
    "SBPR counts from the target in force: that of an STT is so from the next sample on.",
    "warning",
)  # fmt: skip
LEFT_ARMED: Final = Rule(
    "lm628.left-armed", "LM-POS-3",
    "When a run ends, the index that SIP waits for has come, and so has a breakpoint.", "note",
)  # fmt: skip
LEFT_RUNNING: Final = Rule(
    "lm628.left-running", "LM-TRJ-13",
    "When a run ends, velocity mode has been stopped: it has no end of its own.", "note",
)  # fmt: skip
EARLY_INDEX: Final = Rule(
    "lm628.early-index", "LM-CMD-10",
    "RDIP is read when the index has come that SIP waits for.", "note",
)  # fmt: skip
HOME_IN_MOTION: Final = Rule(
    "lm628.home-in-motion", "LM-POS-4",
    "DFH is given at rest: in motion home is where the axis happens to be.", "note",
)  # fmt: skip
DESIRED_ALONE: Final = Rule(
    "lm628.desired-alone", "LM-CMD-9",
    "A host that reads where an axis should be (RDDP) reads where it is (RDRP), too.", "note",
)  # fmt: skip

RULES: Final = (*AC.rules.values(), *rules_in(globals()))
"""What a host can break: each AC limit, and each rule above."""

# -- Settings (LM-CFG-1) ------------------------------------------------------------------------

_OVERFLOW: Final = (
    'The manual says: "All filter multiplications are 16-bit operations; only the bottom 16 bits of'
    ' the product are used." `"wrap"` is this text, read literally. `"saturate"`, the default, is a'
    " departure from it: the sentence is taken to say that products are not scaled down. For that"
    " speaks the console log of two real LM629s: where kp * e is -39700, the lower 16 bits of which"
    " drive away from the target, the motor moves toward it."
)
_LIMIT: Final = (
    '`"sum"`, the default, is what the console log of two real LM629s fits: il limits the scaled'
    " summation, sum / 256 rounded down; RDSUM reads it, and the contribution is ki times it. With"
    ' that go RDSUM\'s name in the manual, "read integration-term summation value", and its range,'
    ' up to the integration limit. `"term"` is the manual\'s text: il "constrains the contribution'
    ' of the integration term", and "when the magnitude of integration term value exceeds il, the'
    ' il value (with appropriate sign) is substituted". That the sum stops growing at the limit is'
    " a ruling, in either."
)

OPTIONS: Final = (
    Option("busy_clk", "count", BUSY_CLK, "busy after an accepted byte, in clock periods",
           low=1, high=800, clause="LM-BUS-8", extremes=(1,)),
    Option("busy_jitter_clk", "count", 0, "busy varies by up to this many clock periods",
           low=0, high=800, clause="LM-BUS-8", extremes=(80, 680)),
    Option("seed", "count", 0, "start of the stream that busy_jitter_clk draws from",
           low=0, high=0xFFFFFFFF, clause="LM-BUS-8"),
    Option("busy", "choice", "typical", "worst: always busy for 100 us",
           choices=("typical", "worst"), clause="LM-BUS-8", extremes=("worst",)),
    Option("reset_time", "s", RESET_TIME, "how long a reset takes",
           low=1, high=1_499_999_999, clause="LM-RST-4", extremes=("1499 us", "1 us")),
    Option("reset_status", "choice", "84", "status after reset (hexadecimal)",
           choices=("84", "C4"), clause="LM-RST-5", extremes=("C4",)),
    Option("reset_fail", "count", 0, "this many resets never come to an end",
           low=0, clause="LM-RST-9"),
    Option("pid_overflow", "choice", "saturate", "what becomes of filter products over 16 bits",
           choices=("saturate", "wrap"), clause="LM-PID-6", evidence=_OVERFLOW),
    Option("integral_limit", "choice", "sum",
           "what il limits and RDSUM reads: the summation, or its product with ki",
           choices=("sum", "term"), clause="LM-PID-5", evidence=_LIMIT),
    Option("pwm_frame_clk", "count", 512, "length of a PWM frame, in clock periods",
           low=PWM_FRAMES[0], high=PWM_FRAMES[-1], clause="LM-PID-10"),
    Option("counts_per_turn", "count", 2000,
           "encoder counts of one turn, to tell a grounded index input from a pulse",
           low=1, clause="LM-POS-3"),
    Option("clk_duty", "ratio", 0.5, "part of the clock period during which CLK is high",
           low=0.01, high=0.99, clause="LM-TIM-4"),
)  # fmt: skip

# -- Values: registers that commands load and read, and telemetry --------------------------------

_STATUS: Final = "status"
_POSITION: Final = "position"
_TRAJECTORY: Final = "trajectory"
_FILTER: Final = "filter"
_MASK: Final = tuple(bit for bit in STATUS if bit.mask & INTERRUPTS)
_CONTROL: Final = tuple(bit for bit in TRAJECTORY if bit.number >= 8)
_ACCELERATION: Final = "cnt/sample/sample"
_VELOCITY: Final = "cnt/sample"


def _filter(name: str, number: int, title: str) -> tuple[Value, ...]:
    """Return a filter parameter as it is loaded, and as it is used since the last UDF."""
    return (
        Value(f"{name} loaded", f"axis.pid.loaded[{number}]", _FILTER, "LM-CMD-19",
              f"{title}, as LFIL loaded it"),
        Value(name, f"axis.pid.{name}", _FILTER, "LM-CMD-5", f"{title}, in use"),
    )  # fmt: skip


VALUES: Final = ValueTable(
    Value("status byte", "status()", _STATUS, "LM-STA-1", "what RDSTAT reads",
          digits=2, fields=STATUS, key="status"),
    Value("signals register", group=_STATUS, clause="LM-STA-2", command="RDSIGS",
          digits=4, fields=SIGNALS, key="signals"),
    Value("interrupt mask", "axis.mask", _STATUS, "LM-CMD-17",
          "flags that raise HI, as MSKI enables them", digits=2, fields=_MASK),
    Value("real position", group=_POSITION, command="RDRP", key="real", lane="real"),
    Value("desired position", "axis.profile.position", _POSITION, "LM-CMD-9",
          "what RDDP reads, with its fraction", "cnt", 16, key="desired", lane="desired"),
    Value("position error", "axis.error", _POSITION, "LM-TRJ-17",
          "desired less real position, of the last sample", "cnt", key="error", lane="error"),
    Value("real velocity", group=_POSITION, command="RDRV", key="real_velocity", lane="velocity"),
    Value("desired velocity", group=_POSITION, command="RDDV", key="velocity", lane="profile"),
    Value("index position", group=_POSITION, command="RDIP"),
    Value("breakpoint", "axis.breakpoint", _POSITION, "LM-CMD-21", "as SBPA or SBPR set it", "cnt"),
    Value("breakpoint armed", "axis.breakpoint_armed", _POSITION, "LM-POS-5",
          "whether it can be reached", words=("no", "yes")),
    Value("error threshold", "axis.threshold", _POSITION, "LM-CMD-15",
          "as LPEI or LPES loaded it", "cnt"),
    Value("trajectory control word", "axis.profile.control", _TRAJECTORY, "LM-TRJ-1",
          "bits 12 to 8 of the last LTRJ", digits=4, fields=_CONTROL),
    Value("acceleration loaded", "axis.profile.raw[0]", _TRAJECTORY, "LM-TRJ-1",
          "as LTRJ loaded it", _ACCELERATION, 16),
    Value("acceleration", "axis.profile.accel", _TRAJECTORY, "LM-TRJ-3",
          "in use since STT", _ACCELERATION, 16),
    Value("velocity loaded", "axis.profile.raw[1]", _TRAJECTORY, "LM-TRJ-1",
          "as LTRJ loaded it", _VELOCITY, 16),
    Value("velocity", "axis.profile.top", _TRAJECTORY, "LM-TRJ-3",
          "the limit in use since STT", _VELOCITY, 16),
    Value("position loaded", "axis.profile.raw[2]", _TRAJECTORY, "LM-TRJ-1",
          "as LTRJ loaded it", "cnt", digits=8),
    Value("target position", "axis.profile.target", _TRAJECTORY, "LM-AMB-5",
          "where the motion under way goes", "cnt", key="target"),
    *_filter("kp", 1, "proportional coefficient"),
    *_filter("ki", 2, "integral coefficient"),
    *_filter("kd", 3, "derivative coefficient"),
    *_filter("il", 4, "integration limit"),
    *_filter("ds", 0, "derivative interval less one sample"),
    Value("integration sum", group=_FILTER, command="RDSUM", moves=True, key="integral"),
    Value("motor command", "axis.command", _FILTER, "LM-PID-7", "what the filter gives",
          moves=True, key="command"),
    Value("names of the signals", "axis.signal_names()", key="signal_names", text=True),
    Value("motor output", "output.command", key="output", lane="output", step=2.0**-11),
    Value("code of the output", "output.code()", moves=True, key="code"),
    Value("host interrupt", "pins['HI'].level", key="interrupt"),
    commands=COMMANDS, home="axis.",
    order=("desired", "target", "velocity", "real", "real_velocity", "error", "integral", "command",
           "signals", "signal_names", "output", "code", "status", "interrupt"),
)  # fmt: skip
