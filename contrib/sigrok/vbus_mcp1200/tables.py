# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/chips/tables.py and vbus/chips/mcp1200/datasheet.py; change that, or the generator.
"""Rows of a datasheet: pins, commands, registers, bits, limits. Data, and checks on it."""

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

HIGH = 1


class PinRow(NamedTuple):
    """A pin of the package.

    Attributes:
        name: as the manual prints it, with slash or tilde.
        direction: ``"in"``, ``"out"``, ``"io"`` or ``"od"`` (open drain, can only pull low).
        rest: level read while nobody drives the net.
        width: wires in the bundle (8 for D0-D7).
        strobe: a control line of the host bus, numbered for the LINES request.
        select: the chip's own select line, which a shared bus does not join.
        wave: an output that carries a waveform (PWM), too fast to be one of a session's lines.
        title: what it is for.
    """

    name: str
    direction: str
    rest: int = HIGH
    width: int = 1
    strobe: bool = False
    title: str = ""
    select: bool = False
    wave: bool = False

    @property
    def shared(self) -> bool:
        """Whether chips on one bus have this pin in common: D0-D7 and strobes, not selects."""
        return (self.strobe or (self.direction == "io" and self.width == 8)) and not self.select


class CardRow(NamedTuple):
    """One port of a plug-in card: what a read and a write at ``offset`` do at the chip.

    Attributes:
        offset: from the card's base address.
        read: chip address a read goes to, or None if nobody answers.
        write: chip address a write goes to, or None if nobody answers.
        bits: data bits the card drives in a read; the others float high.
    """

    offset: int
    read: int | None = None
    write: int | None = None
    bits: int = 0xFF


class Bit(NamedTuple):
    """A named bit of a status byte, register or control word."""

    number: int
    name: str
    title: str = ""

    @property
    def mask(self) -> int:
        """The bit as a number."""
        return 1 << self.number


class Command(NamedTuple):
    """One row of a command set.

    Attributes:
        name: mnemonic, verbatim.
        code: command byte.
        write: 16-bit words the host writes after it.
        read: 16-bit words the host reads after it.
        up_to: most words the host may write, where a control word decides.
        clause: clause id of the specification.
        title: the manual's description.
        note: when it may be used.
        scope: ``"c"`` current axis, ``"g"`` global, ``"i"`` interrupting axis, ``""`` single axis.
        hook: name of the method that carries it out, if it does not just set or get a parameter.
        parameter: the parameter it sets or gets: an attribute of the chip's parts, by its path.
        value: what a command without data gives to its parameter or hook.
        bits: how many bits of the data are kept; 0 for all.
        least: smallest value kept, where it is not that of its bits.
        buffered: the value takes effect at an update.
        signed: the (single) value is two's complement.
        fraction: fraction bits of the value.
        unit: what the value counts.
    """

    name: str
    code: int
    write: int = 0
    read: int = 0
    up_to: int = 0
    clause: str = ""
    title: str = ""
    note: str = ""
    scope: str = ""
    hook: str = ""
    parameter: str = ""
    value: int | None = None
    bits: int = 0
    least: int = 0
    buffered: bool = False
    signed: bool = False
    fraction: int = 0
    unit: str = ""


class CommandTable:
    """Commands of one chip, by code and by mnemonic; refuses a code or mnemonic given twice."""

    __slots__ = ("_by_code", "_by_name", "rows")

    def __init__(self, *rows: Command) -> None:
        self.rows: tuple[Command, ...] = rows
        self._by_code: dict[int, Command] = {}
        self._by_name: dict[str, Command] = {}
        for row in rows:
            if row.code in self._by_code:
                raise ValueError(
                    f"code {row.code:02X}H stands for {row.name} and {self._by_code[row.code].name}"
                )
            if row.name in self._by_name:
                raise ValueError(f"{row.name} stands in the table twice")
            self._by_code[row.code] = row
            self._by_name[row.name] = row

    def __iter__(self) -> Iterator[Command]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> Command:
        return self._by_name[name]

    def by_code(self, code: int) -> Command | None:
        """Return the row with this command byte, or None if the code is undefined."""
        return self._by_code.get(code)

    def find_hooks(self, *owners: type) -> dict[str, type]:
        """Return which of ``owners`` has each hook, the first one that does.

        Raises:
            ValueError: a row names a hook that none has.
        """
        found: dict[str, type] = {}
        for row in self.rows:
            if row.hook:
                having = [owner for owner in owners if hasattr(owner, row.hook)]
                if not having:
                    raise ValueError(f"{row.name}: there is no method {row.hook!r}")
                found[row.hook] = having[0]
        return found


class AcLimit(NamedTuple):
    """One row of an AC characteristics table.

    A limit is ``clocks`` clock periods plus ``ps`` picoseconds.

    Attributes:
        symbol: the manual's number, e.g. ``"T14"``.
        clause: clause id of the specification.
        title: the interval in the manual's words.
        min_ps: constant part of the minimum.
        min_clk: clock periods in the minimum.
        max_ps: maximum, or 0 for none.
        output: the chip's own promise; broken by a host that looks too early.
    """

    symbol: str
    clause: str
    title: str
    min_ps: int = 0
    min_clk: float = 0
    max_ps: int = 0
    output: bool = False


LIVE: Final = "at once"
SAMPLED: Final = "with the next sample"
REPORTED: Final = "as the last sample left it"


class Register(NamedTuple):
    """One register, of one or more bytes.

    Attributes:
        name: short name in capitals.
        addresses: byte addresses, most significant byte first.
        reset: value after a hardware reset.
        access: ``"rw"``, ``"r"`` or ``"w"`` as the manual says.
        signed: the whole value is two's complement.
        fraction: fraction bits.
        clause: clause id.
        title: the manual's name.
        unit: what its value counts.
        counts: when its value means something: :data:`LIVE`, :data:`SAMPLED`, :data:`REPORTED`.
        fields: its bits by name.
        on_read: method of the chip that gives its bytes; "": they are read as they stand.
        on_write: method of the chip that takes its bytes; "": they are stored.
        on_loaded: method of the chip that is told when its least significant byte has been stored.
    """

    name: str
    addresses: tuple[int, ...]
    reset: int = 0
    access: str = "rw"
    signed: bool = False
    fraction: int = 0
    clause: str = ""
    title: str = ""
    unit: str = ""
    counts: str = ""
    fields: tuple[Bit, ...] = ()
    on_read: str = ""
    on_write: str = ""
    on_loaded: str = ""

    @property
    def bits(self) -> int:
        """Width of the whole value."""
        return 8 * len(self.addresses)

    @property
    def moves(self) -> bool:
        """Whether samples change its number, not only its host."""
        told = self.counts == REPORTED and (self.unit != "" or self.access == "r")
        return not self.fields and (told or self.on_read != "")

    @property
    def low(self) -> int:
        """Address of the least significant byte."""
        return self.addresses[-1]


class RegisterMap:
    """Registers of one chip by name and by address; refuses an address given twice."""

    __slots__ = ("_by_address", "_by_name", "rows", "size")

    def __init__(self, size: int, *rows: Register) -> None:
        self.size: int = size
        self.rows: tuple[Register, ...] = rows
        self._by_address: dict[int, Register] = {}
        self._by_name: dict[str, Register] = {}
        for row in rows:
            if row.name in self._by_name:
                raise ValueError(f"register {row.name} stands in the map twice")
            self._by_name[row.name] = row
            for address in row.addresses:
                if not 0 <= address < size:
                    raise ValueError(f"{row.name}: address {address:02X}H is outside the map")
                if address in self._by_address:
                    other = self._by_address[address].name
                    raise ValueError(f"address {address:02X}H is in {row.name} and in {other}")
                self._by_address[address] = row

    def __iter__(self) -> Iterator[Register]:
        return iter(self.rows)

    def __getitem__(self, name: str) -> Register:
        return self._by_name[name]

    def at(self, address: int) -> Register | None:
        """Return the register that holds the byte at ``address``, or None."""
        return self._by_address.get(address)

    def find_hooks(
        self, role: str, owner: type, plain: str = "", read_only: str = ""
    ) -> dict[int, Callable[..., Any]]:
        """Return the methods of ``owner`` that rows name, by address of the bytes they are for.

        Args:
            role: which name of a row: ``"on_read"``, ``"on_write"`` or ``"on_loaded"``.
            owner: class of the methods.
            plain: method of rows that name none; "": none.
            read_only: the same for rows that cannot be written.

        Raises:
            ValueError: a row names what is no method of ``owner``.
        """
        found: dict[int, Callable[..., Any]] = {}
        for row in self.rows:
            name = getattr(row, role) or (plain if row.access != "r" else read_only)
            if name:
                method = getattr(owner, name, None)
                if not callable(method):
                    raise ValueError(f"{row.name}: there is no method {name!r}")
                addresses = row.addresses[-1:] if role == "on_loaded" else row.addresses
                found.update(dict.fromkeys(addresses, method))
        return found


ACTIONS = ('report', 'idle', 'decelerate', 'abrupt')
CONFIG = 2
EXCEPTIONS = (('error', 6), ('breakpoint', 4), ('stop', 2), ('limit', 0))
EXTENDED = 1
FAMILY = 'mcp1200'
MODES = ('soft reset', 'idle', 'halt motion', 'control')
REGISTERS = RegisterMap(
    128,
    Register(name='FLAG', addresses=(0,), reset=2, access='rw', signed=False, fraction=0, clause='MCP-REG-1', title='Flag Register', unit='', counts='as the last sample left it', fields=(Bit(number=0, name='F0', title='Trapezoid/S-curve Profile'), Bit(number=1, name='F1', title='IDLE Flag'), Bit(number=2, name='F2', title='IN-MOTION Flag'), Bit(number=3, name='F3', title='Position Interpolation Control'), Bit(number=4, name='F4', title='Velocity Interpolation Control'), Bit(number=5, name='F5', title='Integral Velocity Profile')), on_read='', on_write='write_flag', on_loaded=''),
    Register(name='FEATURE', addresses=(1,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-2', title='Feature Control Register', unit='', counts='with the next sample', fields=(Bit(number=2, name='UNIPOLAR', title='Unipolar Select'), Bit(number=3, name='PID', title='Filter Select (0 = Lead, 1 = PID)'), Bit(number=4, name='S_CURVE', title='Profile Mode Select (0 = Trapezoid, 1 = S-Curve)'), Bit(number=5, name='HIGH_RESOLUTION', title='High-Resolution Velocity'), Bit(number=6, name='DIAGNOSTIC_PWM', title='Position Error sent to PWM'), Bit(number=7, name='DIAGNOSTIC_DAC', title='Position Error sent to DAC')), on_read='', on_write='', on_loaded=''),
    Register(name='CONFIG', addresses=(2,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-3', title='Advanced Configuration Register', unit='', counts='at once', fields=(Bit(number=0, name='EXTENDED', title='Extended Addressing'), Bit(number=1, name='STEP_MODE', title='Step Mode Enable'), Bit(number=2, name='STEP_LOW', title='Step Output Polarity (1 = low pulse)'), Bit(number=4, name='BREAK_ENABLE', title='Breakpoint Feature Enable'), Bit(number=5, name='BREAK_REPEAT', title='Breakpoint Mode (1 = Repeat)'), Bit(number=6, name='SIGN_INHIBIT', title='PWM Sign Reversal Inhibit'), Bit(number=7, name='PWM_BIAS', title='PWM Bias (1 = 50% Duty Cycle)')), on_read='', on_write='write_config', on_loaded=''),
    Register(name='CAPTURE_CONTROL', addresses=(3,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-4', title='Capture Control Register', unit='', counts='at once', fields=(Bit(number=0, name='TRIG_LATCH', title='TRIG Latch Output / Clear'), Bit(number=1, name='TRIG_CAPTURE', title='TRIG Input Capture Enable'), Bit(number=2, name='TRIG_INPUT', title='TRIG_IO Pin Direction (1 = Input)'), Bit(number=3, name='INDEX_LATCH', title='INDEX Latch Output / Clear'), Bit(number=4, name='INDEX_CAPTURE', title='INDEX Input Capture Enable'), Bit(number=5, name='INDEX_RISING', title='INDEX Pin Polarity (1 = Rising Edge)'), Bit(number=6, name='BUSY_ON_PROF', title='Interp. Busy Status on PROF pin'), Bit(number=7, name='INTERPOLATOR_BUSY', title='Interp. Busy Status')), on_read='', on_write='write_capture_control', on_loaded=''),
    Register(name='EXCEPTION', addresses=(4,), reset=9, access='rw', signed=False, fraction=0, clause='MCP-REG-5', title='Exception Handling Register', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='MODE', addresses=(5,), reset=1, access='rw', signed=False, fraction=0, clause='MCP-REG-6', title='Mode Brancher', unit='', counts='as the last sample left it', fields=(), on_read='', on_write='write_mode', on_loaded=''),
    Register(name='PHASE', addresses=(6,), reset=0, access='r', signed=False, fraction=0, clause='MCP-REG-7', title='Profile Phase Status', unit='', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='STATUS', addresses=(7,), reset=248, access='rw', signed=False, fraction=0, clause='MCP-REG-8', title='Status Register', unit='', counts='as the last sample left it', fields=(Bit(number=0, name='BUSY', title='BUSY pin state'), Bit(number=1, name='DIRECTION', title='Motor Direction at Last Fault (1 = Reverse)'), Bit(number=2, name='IN_POSITION', title='In-Position Flag'), Bit(number=3, name='TIMER_OK', title='Sample Timer Error (active low)'), Bit(number=4, name='ERROR_OK', title='Maximum Error Fault (active low)'), Bit(number=5, name='BREAKPOINT_OK', title='Breakpoint Flag (active low)'), Bit(number=6, name='STOP_OK', title='Stop Error (active low)'), Bit(number=7, name='LIMIT_OK', title='Limit Error (active low)')), on_read='', on_write='write_status', on_loaded=''),
    Register(name='MOTOR_COMMAND', addresses=(8,), reset=128, access='rw', signed=False, fraction=0, clause='MCP-REG-9', title='Motor Command Port (MSB)', unit='1/256 of full scale', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded='guard_outputs'),
    Register(name='PWM_COMMAND', addresses=(9,), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-10', title='PWM Command Port', unit='% of full scale', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded='guard_outputs'),
    Register(name='DAC_OFFSET', addresses=(10,), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-11', title='Motor Command DAC Offset', unit='1/4096 of full scale', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='COMMAND_INCREMENT', addresses=(11,), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-12', title='Command Position Increment', unit='count', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded='load_command_increment'),
    Register(name='COMMAND_POSITION', addresses=(12, 13, 14), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-13', title='Command Position', unit='count', counts='as the last sample left it', fields=(), on_read='', on_write='write_command_position', on_loaded=''),
    Register(name='SAMPLE_TIMER', addresses=(15,), reset=64, access='rw', signed=False, fraction=0, clause='MCP-REG-14', title='Sample Timer', unit='pre-scalar period', counts='with the next sample', fields=(), on_read='read_sample_timer', on_write='', on_loaded=''),
    Register(name='PRESCALER', addresses=(16, 17), reset=63, access='rw', signed=False, fraction=0, clause='MCP-REG-15', title='Sample Timer Pre-scalar', unit='clk', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='ACTUAL_POSITION', addresses=(18, 19, 20), reset=0, access='r', signed=True, fraction=0, clause='MCP-REG-16', title='Read Actual Position', unit='count', counts='at once', fields=(), on_read='read_actual_position', on_write='write_actual_position', on_loaded=''),
    Register(name='PRESET_POSITION', addresses=(21, 22, 23), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-17', title='Preset Actual Position', unit='count', counts='at once', fields=(), on_read='', on_write='', on_loaded='preset_position'),
    Register(name='INTERPOLATOR_PRESET', addresses=(24,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-18', title='Interpolator Counter Preset', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='INTERPOLATOR_COUNT', addresses=(25,), reset=0, access='r', signed=False, fraction=0, clause='MCP-REG-19', title='Interpolator Counter Value', unit='sample', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='ENCODER_PWM', addresses=(26,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-20', title='Encoder Filter Clock / PWM Resolution', unit='', counts='at once', fields=(), on_read='', on_write='write_encoder_pwm', on_loaded=''),
    Register(name='STEP_WIDTH', addresses=(27,), reset=15, access='rw', signed=False, fraction=0, clause='MCP-REG-21', title='Stepper Pulse Width', unit='clk', counts='at once', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='ENCODER_RATIO', addresses=(28, 29), reset=0, access='rw', signed=False, fraction=8, clause='MCP-REG-22', title='Encoder / Stepper Ratio', unit='count/step', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='LEAD_ZERO', addresses=(32,), reset=229, access='rw', signed=False, fraction=0, clause='MCP-REG-23', title='Lead Filter Zero', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='LEAD_POLE', addresses=(33,), reset=64, access='rw', signed=False, fraction=0, clause='MCP-REG-23', title='Lead Filter Pole', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='LEAD_GAIN', addresses=(34,), reset=64, access='rw', signed=False, fraction=0, clause='MCP-REG-23', title='Lead Filter Gain', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='VELOCITY', addresses=(35, 36, 37), reset=0, access='rw', signed=True, fraction=8, clause='MCP-REG-24', title='High Resolution Velocity', unit='count/sample', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded='load_velocity'),
    Register(name='ACCELERATION', addresses=(39, 38), reset=0, access='rw', signed=False, fraction=8, clause='MCP-REG-25', title='Acceleration', unit='count/sample²', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='PROFILE_VELOCITY', addresses=(40,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-26', title='Profile Velocity (Low Res)', unit='count/sample', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='FINAL_POSITION', addresses=(43, 42, 41), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-27', title='Final Position', unit='count', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded='load_final_position'),
    Register(name='POSITION_ERROR', addresses=(45, 44), reset=0, access='r', signed=True, fraction=0, clause='MCP-REG-28', title='Position Error', unit='count', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='CAPTURE', addresses=(48, 47, 46), reset=0, access='r', signed=True, fraction=0, clause='MCP-REG-29', title='Capture Count', unit='count', counts='at once', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='ACCEL_DELTA', addresses=(51, 50, 49), reset=0, access='r', signed=False, fraction=0, clause='MCP-REG-30', title='Accel. Delta Position', unit='count', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='ACTUAL_VELOCITY', addresses=(53, 52), reset=0, access='r', signed=True, fraction=0, clause='MCP-REG-31', title='Actual Velocity', unit='count/sample', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='DECEL_POSITION', addresses=(59, 58, 57), reset=0, access='r', signed=True, fraction=0, clause='MCP-REG-32', title='Deceleration Position', unit='count', counts='as the last sample left it', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='VELOCITY_COMMAND', addresses=(60,), reset=0, access='rw', signed=True, fraction=0, clause='MCP-REG-33', title='Velocity Command', unit='count/sample', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='BREAKPOINT', addresses=(63, 62, 61), reset=8388608, access='rw', signed=True, fraction=0, clause='MCP-REG-34', title='Break-point Position', unit='count', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='BACKLASH', addresses=(68,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-35', title='Backlash', unit='count', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='DEADBAND', addresses=(69,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-36', title='Deadband', unit='count', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='FORCED_EXCEPTION', addresses=(70,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-37', title='Forced Exception Register', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='MAX_ERROR', addresses=(74, 73), reset=65535, access='rw', signed=False, fraction=0, clause='MCP-REG-38', title='Maximum Error', unit='count', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='SATURATION', addresses=(75,), reset=240, access='rw', signed=False, fraction=0, clause='MCP-REG-39', title='Saturation Foldback Setting', unit='1/256 of full scale', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='MOTOR_COMMAND_LOW', addresses=(76,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-40', title='Motor Command Port (extended)', unit='', counts='as the last sample left it', fields=(), on_read='', on_write='write_output_low', on_loaded=''),
    Register(name='PWM_FRACTION', addresses=(77,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-41', title='PWM Command Port (extended)', unit='', counts='as the last sample left it', fields=(), on_read='', on_write='write_output_low', on_loaded=''),
    Register(name='JERK', addresses=(85, 84), reset=0, access='rw', signed=False, fraction=16, clause='MCP-REG-42', title='Jerk', unit='count/sample³', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='FEED_FORWARD', addresses=(87, 86), reset=0, access='rw', signed=True, fraction=8, clause='MCP-REG-43', title='Command Feed-forward', unit='count/sample', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='KP', addresses=(97,), reset=64, access='rw', signed=False, fraction=0, clause='MCP-REG-44', title='Proportional Gain, Kp', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='KI', addresses=(98,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-44', title='Integral Gain, Ki', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='KD', addresses=(99,), reset=64, access='rw', signed=False, fraction=0, clause='MCP-REG-44', title='Derivative Gain, Kd', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='DERIVATIVE_SPAN', addresses=(100,), reset=1, access='rw', signed=False, fraction=0, clause='MCP-REG-45', title='Derivative Span', unit='sample', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='INTEGRAL_LIMIT', addresses=(102, 101), reset=32767, access='rw', signed=False, fraction=0, clause='MCP-REG-46', title='Integral Limit', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='KA', addresses=(105,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-47', title='Accel Feed-forward, Kaff', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
    Register(name='KV', addresses=(106,), reset=0, access='rw', signed=False, fraction=0, clause='MCP-REG-47', title='Velocity Feed-forward, Kvff', unit='', counts='with the next sample', fields=(), on_read='', on_write='', on_loaded=''),
)
