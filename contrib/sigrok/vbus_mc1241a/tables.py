# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/chips/tables.py and vbus/chips/mc1241a/datasheet.py; change that, or the generator.
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


AXIS_SHIFT = 12
COMMANDS = CommandTable(
    Command(name='SET_1', code=1, write=0, read=1, up_to=0, clause='PMD-CMD-1', title='Set current axis # to 1', note='', scope='', hook='select', parameter='', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_2', code=2, write=0, read=1, up_to=0, clause='PMD-CMD-2', title='Set current axis # to 2', note='', scope='', hook='select', parameter='', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_I', code=8, write=0, read=1, up_to=0, clause='PMD-CMD-3', title='Set current axis # to the interrupting axis', note='', scope='i', hook='select_interrupting', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_PRFL_S_CRV', code=11, write=0, read=0, up_to=0, clause='PMD-CMD-4', title='Set profile mode to S-curve', note='', scope='c', hook='set_profile', parameter='', value=2, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_PRFL_TRAP', code=9, write=0, read=0, up_to=0, clause='PMD-CMD-5', title='Set profile mode to trapezoidal point to point', note='', scope='c', hook='set_profile', parameter='', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_PRFL_VEL', code=10, write=0, read=0, up_to=0, clause='PMD-CMD-6', title='Set profile mode to velocity-contouring', note='', scope='c', hook='set_profile', parameter='', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_PRFL_GEAR', code=12, write=0, read=0, up_to=0, clause='PMD-CMD-7', title='Set profile mode to electronic gear', note='', scope='c', hook='set_profile', parameter='', value=3, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_POS', code=16, write=2, read=0, up_to=0, clause='PMD-CMD-8', title='Set command position', note='', scope='c', hook='set_position', parameter='', value=None, bits=31, least=0, buffered=True, signed=True, fraction=0, unit='ustep'),
    Command(name='SET_VEL', code=17, write=2, read=0, up_to=0, clause='PMD-CMD-9', title='Set command velocity', note='', scope='c', hook='', parameter='buffer.velocity', value=None, bits=30, least=0, buffered=True, signed=False, fraction=16, unit='ustep/cycle'),
    Command(name='SET_ACC', code=18, write=2, read=0, up_to=0, clause='PMD-CMD-10', title='Set command acceleration', note='', scope='c', hook='', parameter='buffer.acceleration', value=None, bits=32, least=0, buffered=True, signed=True, fraction=16, unit='ustep/cycle/cycle'),
    Command(name='SET_MAX_ACC', code=21, write=1, read=0, up_to=0, clause='PMD-CMD-11', title='Set max acceleration (S-curve profile only)', note='', scope='c', hook='', parameter='buffer.max_acceleration', value=None, bits=15, least=0, buffered=True, signed=False, fraction=16, unit='ustep/cycle/cycle'),
    Command(name='SET_JERK', code=19, write=2, read=0, up_to=0, clause='PMD-CMD-12', title='Set command jerk', note='', scope='c', hook='', parameter='buffer.jerk', value=None, bits=31, least=0, buffered=True, signed=False, fraction=32, unit='ustep/cycle/cycle/cycle'),
    Command(name='SET_RATIO', code=20, write=2, read=0, up_to=0, clause='PMD-CMD-13', title='Set command electronic gear ratio', note='', scope='c', hook='', parameter='buffer.ratio', value=None, bits=32, least=0, buffered=True, signed=True, fraction=16, unit='ustep/cnt'),
    Command(name='SET_START_VEL', code=106, write=2, read=0, up_to=0, clause='PMD-CMD-14', title='Set starting velocity', note='', scope='c', hook='set_start_velocity', parameter='', value=None, bits=30, least=0, buffered=False, signed=False, fraction=16, unit='ustep/cycle'),
    Command(name='STOP', code=70, write=0, read=0, up_to=0, clause='PMD-CMD-15', title='Abruptly stop current axis motion', note='', scope='c', hook='', parameter='buffer.stop', value=1, bits=0, least=0, buffered=True, signed=False, fraction=0, unit=''),
    Command(name='SMOOTH_STOP', code=78, write=0, read=0, up_to=0, clause='PMD-CMD-16', title='Smoothly stop current axis motion', note='', scope='c', hook='', parameter='buffer.smooth_stop', value=1, bits=0, least=0, buffered=True, signed=False, fraction=0, unit=''),
    Command(name='SYNCH_PRFL', code=71, write=0, read=0, up_to=0, clause='PMD-CMD-17', title='Set target position to actual position', note='', scope='c', hook='', parameter='buffer.synch', value=1, bits=0, least=0, buffered=True, signed=False, fraction=0, unit=''),
    Command(name='GET_POS', code=74, write=0, read=2, up_to=0, clause='PMD-CMD-18', title='Get command position', note='', scope='c', hook='', parameter='buffer.position', value=None, bits=0, least=0, buffered=True, signed=True, fraction=0, unit='ustep'),
    Command(name='GET_VEL', code=75, write=0, read=2, up_to=0, clause='PMD-CMD-19', title='Get command velocity', note='', scope='c', hook='', parameter='buffer.velocity', value=None, bits=0, least=0, buffered=True, signed=False, fraction=16, unit='ustep/cycle'),
    Command(name='GET_ACC', code=76, write=0, read=2, up_to=0, clause='PMD-CMD-20', title='Get command acceleration', note='', scope='c', hook='', parameter='buffer.acceleration', value=None, bits=0, least=0, buffered=True, signed=True, fraction=16, unit='ustep/cycle/cycle'),
    Command(name='GET_MAX_ACC', code=79, write=0, read=1, up_to=0, clause='PMD-CMD-21', title='Get max acceleration (S-curve profile only)', note='', scope='c', hook='', parameter='buffer.max_acceleration', value=None, bits=0, least=0, buffered=True, signed=False, fraction=16, unit='ustep/cycle/cycle'),
    Command(name='GET_JERK', code=88, write=0, read=2, up_to=0, clause='PMD-CMD-22', title='Get command jerk', note='', scope='c', hook='', parameter='buffer.jerk', value=None, bits=0, least=0, buffered=True, signed=False, fraction=32, unit='ustep/cycle/cycle/cycle'),
    Command(name='GET_RATIO', code=89, write=0, read=2, up_to=0, clause='PMD-CMD-23', title='Get command electronic gear ratio', note='', scope='c', hook='', parameter='buffer.ratio', value=None, bits=0, least=0, buffered=True, signed=True, fraction=16, unit='ustep/cnt'),
    Command(name='GET_START_VEL', code=107, write=0, read=2, up_to=0, clause='PMD-CMD-24', title='Get starting velocity', note='', scope='c', hook='', parameter='start_velocity', value=None, bits=0, least=0, buffered=False, signed=False, fraction=16, unit='ustep/cycle'),
    Command(name='GET_TRGT_POS', code=29, write=0, read=2, up_to=0, clause='PMD-CMD-25', title='Get current target position', note='', scope='c', hook='', parameter='profile.target_position', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit='ustep'),
    Command(name='GET_TRGT_VEL', code=30, write=0, read=2, up_to=0, clause='PMD-CMD-26', title='Get current target velocity', note='', scope='c', hook='', parameter='profile.target_velocity', value=None, bits=0, least=0, buffered=False, signed=True, fraction=16, unit='ustep/cycle'),
    Command(name='SET_TIME_BRK', code=23, write=0, read=0, up_to=0, clause='PMD-CMD-27', title='Set breakpoint mode to time', note='', scope='c', hook='', parameter='breakpoint_mode', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_POS_BRK', code=24, write=0, read=0, up_to=0, clause='PMD-CMD-28', title='Set breakpoint mode to positive target position', note='', scope='c', hook='', parameter='breakpoint_mode', value=2, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_NEG_BRK', code=25, write=0, read=0, up_to=0, clause='PMD-CMD-29', title='Set breakpoint mode to negative target position', note='', scope='c', hook='', parameter='breakpoint_mode', value=3, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_ACTL_POS_BRK', code=27, write=0, read=0, up_to=0, clause='PMD-CMD-30', title='Set breakpoint mode to positive actual position', note='', scope='c', hook='', parameter='breakpoint_mode', value=4, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_ACTL_NEG_BRK', code=28, write=0, read=0, up_to=0, clause='PMD-CMD-31', title='Set breakpoint mode to negative actual position', note='', scope='c', hook='', parameter='breakpoint_mode', value=5, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_MTN_CMPLT_BRK', code=53, write=0, read=0, up_to=0, clause='PMD-CMD-32', title='Set breakpoint mode to motion complete', note='', scope='c', hook='', parameter='breakpoint_mode', value=6, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_EXT_BRK', code=94, write=0, read=0, up_to=0, clause='PMD-CMD-33', title='Set breakpoint mode to external', note='', scope='c', hook='', parameter='breakpoint_mode', value=7, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_BRK_OFF', code=109, write=0, read=0, up_to=0, clause='PMD-CMD-34', title='Set breakpoint mode off', note='', scope='c', hook='', parameter='breakpoint_mode', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_BRK_PNT', code=22, write=2, read=0, up_to=0, clause='PMD-CMD-35', title='Set breakpoint comparison value', note='', scope='c', hook='', parameter='breakpoint_value', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit=''),
    Command(name='UPDATE', code=26, write=0, read=0, up_to=0, clause='PMD-CMD-36', title='Immediate parameter update', note='', scope='c', hook='request_update', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='MULTI_UPDATE', code=91, write=1, read=0, up_to=0, clause='PMD-CMD-37', title='Multiple axis immediate parameter update', note='', scope='g', hook='update_several', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_AUTO_UPDATE_ON', code=92, write=0, read=0, up_to=0, clause='PMD-CMD-38', title='Set automatic profile update on', note='', scope='c', hook='', parameter='auto_update', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_AUTO_UPDATE_OFF', code=93, write=0, read=0, up_to=0, clause='PMD-CMD-39', title='Set automatic profile update off', note='', scope='c', hook='', parameter='auto_update', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_BRK_PNT', code=87, write=0, read=2, up_to=0, clause='PMD-CMD-40', title='Get breakpoint comparison value', note='', scope='c', hook='', parameter='breakpoint_value', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit=''),
    Command(name='SET_INTRPT_MASK', code=47, write=1, read=0, up_to=0, clause='PMD-CMD-41', title='Set interrupt mask', note='', scope='c', hook='', parameter='interrupt_mask', value=None, bits=8, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_INTRPT', code=48, write=0, read=1, up_to=0, clause='PMD-CMD-42', title='Get status of interrupting axis', note='', scope='i', hook='interrupting_status', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='RST_INTRPT', code=50, write=1, read=0, up_to=0, clause='PMD-CMD-43', title='Reset interrupting events', note='', scope='i', hook='reset_interrupt', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_INTRPT_MASK', code=86, write=0, read=1, up_to=0, clause='PMD-CMD-44', title='Get interrupt mask', note='', scope='c', hook='', parameter='interrupt_mask', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='CLR_STATUS', code=51, write=0, read=0, up_to=0, clause='PMD-CMD-45', title='Reset status of current axis', note='', scope='c', hook='clear_events', parameter='', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='RST_STATUS', code=52, write=1, read=0, up_to=0, clause='PMD-CMD-46', title='Reset events for current axis', note='', scope='c', hook='clear_events', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_STATUS', code=49, write=0, read=1, up_to=0, clause='PMD-CMD-47', title='Get axis status word', note='', scope='c', hook='', parameter='status', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_MODE', code=72, write=0, read=1, up_to=0, clause='PMD-CMD-48', title='Get axis mode word', note='', scope='c', hook='', parameter='mode', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_ACTL_POS', code=55, write=0, read=2, up_to=0, clause='PMD-CMD-49', title='Get current actual axis location', note='', scope='c', hook='', parameter='encoder.actual', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit='cnt'),
    Command(name='SET_CAPT_INDEX', code=100, write=0, read=0, up_to=0, clause='PMD-CMD-50', title='Set index signal as position capture trigger', note='', scope='c', hook='set_capture', parameter='', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_CAPT_HOME', code=101, write=0, read=0, up_to=0, clause='PMD-CMD-51', title='Set home signal as position capture trigger', note='', scope='c', hook='set_capture', parameter='', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_CAPT', code=54, write=0, read=2, up_to=0, clause='PMD-CMD-52', title='Get current axis position capture location', note='', scope='c', hook='captured', parameter='', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit='cnt'),
    Command(name='SET_STEP_RATIO', code=104, write=1, read=0, up_to=0, clause='PMD-CMD-53', title='Set number of encoder counts per step', note='', scope='c', hook='set_step_ratio', parameter='', value=None, bits=15, least=0, buffered=False, signed=False, fraction=8, unit='cnt/ustep'),
    Command(name='GET_STEP_RATIO', code=111, write=0, read=1, up_to=0, clause='PMD-CMD-54', title='Get number of encoder counts per step', note='', scope='c', hook='', parameter='step_ratio', value=None, bits=0, least=0, buffered=False, signed=False, fraction=8, unit='cnt/ustep'),
    Command(name='SET_AUTO_STOP_ON', code=69, write=0, read=0, up_to=0, clause='PMD-CMD-55', title='Set auto stop on motion error mode on', note='', scope='c', hook='', parameter='auto_stop', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_AUTO_STOP_OFF', code=68, write=0, read=0, up_to=0, clause='PMD-CMD-56', title='Set auto stop on motion error mode off', note='', scope='c', hook='', parameter='auto_stop', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_POS_ERR', code=41, write=1, read=0, up_to=0, clause='PMD-CMD-57', title='Set maximum position error limit', note='', scope='c', hook='', parameter='position_error_limit', value=None, bits=15, least=0, buffered=False, signed=False, fraction=0, unit='cnt'),
    Command(name='GET_POS_ERR', code=85, write=0, read=1, up_to=0, clause='PMD-CMD-58', title='Get maximum position error limit', note='', scope='c', hook='', parameter='position_error_limit', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit='cnt'),
    Command(name='GET_ACTL_POS_ERR', code=96, write=0, read=1, up_to=0, clause='PMD-CMD-59', title='Get actual position error', note='', scope='c', hook='', parameter='position_error', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit='cnt'),
    Command(name='SET_OUTPUT_PWM', code=60, write=0, read=0, up_to=0, clause='PMD-CMD-60', title='Set motor output mode to PWM', note='', scope='g', hook='', parameter='output_mode', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_OUTPUT_DAC16', code=59, write=0, read=0, up_to=0, clause='PMD-CMD-61', title='Set motor output mode to 16-bit DAC', note='', scope='g', hook='', parameter='output_mode', value=2, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='MTR_ON', code=67, write=0, read=0, up_to=0, clause='PMD-CMD-62', title='Enable profile generator', note='', scope='c', hook='enable', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='MTR_OFF', code=66, write=0, read=0, up_to=0, clause='PMD-CMD-63', title='Disable profile generator', note='', scope='c', hook='disable', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_MTR_CMD', code=98, write=1, read=0, up_to=0, clause='PMD-CMD-64', title='Write direct value to motor output', note='', scope='c', hook='set_motor_command', parameter='', value=None, bits=16, least=-32767, buffered=False, signed=True, fraction=0, unit=''),
    Command(name='GET_MTR_CMD', code=58, write=0, read=1, up_to=0, clause='PMD-CMD-65', title='Read motor output command', note='', scope='c', hook='', parameter='active.motor_command', value=None, bits=0, least=0, buffered=False, signed=True, fraction=0, unit=''),
    Command(name='SET_BUF_MTR_CMD', code=119, write=1, read=0, up_to=0, clause='PMD-CMD-66', title='Write double buffered motor command output', note='', scope='c', hook='set_buffered_motor_command', parameter='', value=None, bits=16, least=-32767, buffered=True, signed=True, fraction=0, unit=''),
    Command(name='GET_BUF_MTR_CMD', code=105, write=0, read=1, up_to=0, clause='PMD-CMD-67', title='Get double buffered motor command value', note='', scope='c', hook='', parameter='buffer.motor_command', value=None, bits=0, least=0, buffered=True, signed=True, fraction=0, unit=''),
    Command(name='GET_OUTPUT_MODE', code=110, write=0, read=1, up_to=0, clause='PMD-CMD-68', title='Get current output mode', note='', scope='g', hook='', parameter='output_mode', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_ACTL_POS', code=77, write=2, read=0, up_to=0, clause='PMD-CMD-69', title='Set axis position', note='', scope='c', hook='set_actual_position', parameter='', value=None, bits=31, least=0, buffered=False, signed=True, fraction=0, unit=''),
    Command(name='SET_LMT_SENSE', code=102, write=1, read=0, up_to=0, clause='PMD-CMD-70', title='Set limit switch bit sense', note='', scope='g', hook='', parameter='limit_sense', value=None, bits=4, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_LMT_SWTCH', code=103, write=0, read=1, up_to=0, clause='PMD-CMD-71', title='Get state of limit switches', note='', scope='g', hook='limit_switches', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='LMTS_ON', code=112, write=0, read=0, up_to=0, clause='PMD-CMD-72', title='Set limit switch sensing on', note='', scope='g', hook='set_sensing', parameter='', value=1, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='LMTS_OFF', code=113, write=0, read=0, up_to=0, clause='PMD-CMD-73', title='Set limit switch sensing off', note='', scope='g', hook='set_sensing', parameter='', value=0, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_HOME', code=5, write=0, read=1, up_to=0, clause='PMD-CMD-74', title='Get state of home switches', note='', scope='g', hook='home_switches', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='RESET', code=57, write=0, read=0, up_to=0, clause='PMD-CMD-75', title='Reset chipset', note='', scope='g', hook='reset', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_VRSN', code=108, write=0, read=1, up_to=0, clause='PMD-CMD-76', title='Get chipset software version information', note='', scope='g', hook='version', parameter='', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_TIME', code=62, write=0, read=2, up_to=0, clause='PMD-CMD-77', title='Get current chip set time (# cycles)', note='', scope='g', hook='', parameter='time', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit='cycles'),
    Command(name='SET_PHASE_2', code=116, write=0, read=0, up_to=0, clause='PMD-CMD-78', title='Set waveform to 2-phase', note='', scope='c', hook='set_phases', parameter='', value=2, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='SET_PHASE_3', code=115, write=0, read=0, up_to=0, clause='PMD-CMD-79', title='Set waveform to 3-phase', note='', scope='c', hook='set_phases', parameter='', value=3, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
    Command(name='GET_PHASE_INFO', code=127, write=0, read=1, up_to=0, clause='PMD-CMD-80', title='Get commutation flags set by host', note='', scope='c', hook='', parameter='stepper.phase_info', value=None, bits=0, least=0, buffered=False, signed=False, fraction=0, unit=''),
)
COMMAND_PORT = 1
DATA_PORT = 0
EVENTS = 255
FAMILY = 'mc1241a'
FAMILY_CODES = {6: ('SET_MTR_LMT', 1, 0), 7: ('GET_MTR_LMT', 0, 1), 15: ('SET_MTR_BIAS', 1, 0), 37: ('SET_KP', 1, 0), 38: ('SET_KI', 1, 0), 39: ('SET_KD', 1, 0), 40: ('SET_I_LM', 1, 0), 43: ('SET_KVFF', 1, 0), 45: ('GET_MTR_BIAS', 0, 1), 46: ('GET_INTGR', 0, 2), 56: ('SET_SMPL_TIME', 1, 0), 64: ('AXIS_OFF', 0, 0), 65: ('AXIS_ON', 0, 0), 80: ('GET_KP', 0, 1), 81: ('GET_KI', 0, 1), 82: ('GET_KD', 0, 1), 83: ('GET_I_LM', 0, 1), 84: ('GET_KVFF', 0, 1), 97: ('GET_SMPL_TIME', 0, 1)}
ILLEGAL_CODES = frozenset([0, 3, 4, 34, 128, 129, 130, 131, 132, 133, 134, 135, 136, 137, 138, 139, 140, 141, 142, 143, 144, 145, 146, 147, 148, 149, 150, 151, 152, 153, 154, 155, 156, 157, 158, 159, 160, 161, 162, 163, 164, 165, 166, 167, 168, 169, 170, 171, 172, 173, 174, 175, 176, 177, 178, 179, 180, 181, 182, 183, 184, 185, 186, 187, 188, 189, 190, 191, 192, 193, 194, 195, 196, 197, 198, 199, 200, 201, 202, 203, 204, 205, 206, 207, 208, 209, 210, 211, 212, 213, 214, 215, 216, 217, 218, 219, 220, 221, 222, 223, 224, 225, 226, 227, 228, 229, 230, 231, 232, 233, 234, 235, 236, 237, 238, 239, 240, 241, 242, 243, 244, 245, 246, 247, 248, 249, 250, 251, 252, 253, 254, 255])
MODE_BITS = (Bit(number=7, name='auto stop', title='a motion error turns the motor off'), Bit(number=10, name='auto update off', title='a breakpoint does not update'), Bit(number=11, name='profile, low bit', title='00 trapezoidal, 01 velocity, 10 S-curve, 11 gear'), Bit(number=12, name='profile, high bit', title=''), Bit(number=13, name='S-curve phase, low bit', title='0 at rest, 1 to 7'), Bit(number=14, name='S-curve phase, middle bit', title=''), Bit(number=15, name='S-curve phase, high bit', title=''))
OUTPUT_DAC16 = 2
OUTPUT_PWM = 0
PHASE_SHIFT = 13
PROFILES = ('trapezoidal', 'velocity', 'S-curve', 'gear')
PROFILE_SHIFT = 11
RESERVED_CODE = 73
RESET_PORT = 2
STATUS_BITS = (Bit(number=0, name='motion complete', title='the trajectory has ended'), Bit(number=1, name='wrap', title='a position has passed one end of its range and goes on from the other'), Bit(number=2, name='breakpoint', title="a breakpoint's condition was met"), Bit(number=3, name='capture', title='index or home has captured the actual position'), Bit(number=4, name='motion error', title='the position error has exceeded its limit'), Bit(number=5, name='positive limit', title='the positive limit switch has stopped the axis'), Bit(number=6, name='negative limit', title='the negative limit switch has stopped the axis'), Bit(number=7, name='command error', title='a command was refused for the state the axis was in'), Bit(number=8, name='motor on', title='the profile generator is enabled'), Bit(number=9, name='axis on', title='always 1'), Bit(number=10, name='in motion', title='the trajectory is in motion'), Bit(number=12, name='axis 2', title='number of the axis, less one'))
STATUS_NO_INTERRUPT = 64
STATUS_READY = 128
