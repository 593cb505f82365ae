"""Rows of a datasheet: pins, commands, registers, bits, AC limits. Data, and checks on it."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from vbus.core.row_table import RowTable
from vbus.core.signals import HIGH


class PinRow(NamedTuple):
    """A pin of the package.

    Attributes:
        name: as the manual prints it, with slash or tilde.
        direction: ``"in"``, ``"out"``, ``"io"`` or ``"od"`` (open drain, can only pull low).
        rest: level read while no pin drives the net.
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
        # Selects are each chip's own: by them a decoder tells chips on one bus apart.
        return (self.strobe or (self.direction == "io" and self.width == 8)) and not self.select


class CardRow(NamedTuple):
    """One port of a plug-in card: what a read and a write at ``offset`` do at the chip.

    Attributes:
        offset: from the card's base address.
        read: chip address a read goes to, or None if no chip answers.
        write: chip address a write goes to, or None if no chip answers.
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


def names_of(bits: tuple[Bit, ...], value: int, between: str = ", ") -> str:
    """Return the names of the bits that are set in a value."""
    return between.join([bit.name for bit in bits if value & bit.mask])


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
        bits: how many bits of the data are stored; 0 for all.
        least: smallest value stored, where it is not that of its bits.
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

    @property
    def codes(self) -> tuple[int]:
        """The command byte."""
        return (self.code,)


class CommandTable(RowTable[Command]):
    """Commands of one chip, by code and by mnemonic."""

    def find_hooks(self, *owners: type) -> dict[str, type]:
        """Return which of ``owners`` has each hook, the first one that does.

        Raises:
            ValueError: a row names a hook that none has.
        """
        found: dict[str, type] = {}
        for row in self.rows:
            if row.hook:
                having = [owner for owner in owners if hasattr(owner, row.hook)]
                # The same for a hook that has no method.
                if not having:
                    raise ValueError(f"{row.name}: there is no method {row.hook!r}")
                found[row.hook] = having[0]
        return found


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
        on_loaded: method of the chip, called when its least significant byte has been stored.
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
    def codes(self) -> tuple[int, ...]:
        """Its addresses, each of which leads to it."""
        return self.addresses

    @property
    def bits(self) -> int:
        """Width of the whole value."""
        return 8 * len(self.addresses)

    @property
    def moves(self) -> bool:
        """Whether samples change its number, not only its host."""
        # What a sample reports moves unless it is a byte of bits.
        reported = self.counts == REPORTED and (self.unit != "" or self.access == "r")
        return not self.fields and (reported or self.on_read != "")

    @property
    def low(self) -> int:
        """Address of the least significant byte."""
        return self.addresses[-1]


class RegisterMap(RowTable[Register]):
    """Registers of one chip by name and by address."""

    __slots__ = ("size",)

    def __init__(self, size: int, *rows: Register) -> None:
        super().__init__(*rows)
        self.size: int = size
        for row in rows:
            for address in row.addresses:
                if not 0 <= address < size:
                    raise ValueError(f"{row.name}: address {address:02X}H is outside the map")

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
                # Of several bytes the least significant one loads all.
                addresses = row.addresses[-1:] if role == "on_loaded" else row.addresses
                found.update(dict.fromkeys(addresses, method))
        return found
