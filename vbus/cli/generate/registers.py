"""Makes what follows from a chip's register table: its bits and its registers as numbers."""

from collections.abc import Callable
from typing import Final

from vbus.chips.family import Family
from vbus.chips.tables import Register
from vbus.cli.generate.layout import formatted

_MODULE: Final = '''\
# Made from the register table by vbus.cli.generate; change the table or the generator.
"""The registers of the {title} as numbers."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.state import Names

NAMES: Final = {names}


class Registers:
    """A number for each row of the register table; the bytes on the bus are made of them.

    Attributes:
        {attributes}
    """

    __slots__ = NAMES
    DERIVED: ClassVar[Names] = NAMES

    def __init__(self) -> None:
        {zero}

    def copy(self, other: "Registers") -> None:
        """Become equal to ``other``."""
        {copy}

    def byte(self, address: i64) -> i64:
        """Return the byte at ``address``; 0 where there is no register."""
        {byte}
        return 0

    def put(self, address: i64, data: i64) -> None:
        """Store the byte ``data`` at ``address``, if there is a register."""
        {put}

    @property
    def image(self) -> bytes:
        """The bytes of all addresses."""
        return bytes(({image}))

    @image.setter
    def image(self, image: bytes) -> None:
        {whole}
'''
_BITS: Final = '''\
# Made from the datasheet's tables by vbus.cli.generate; change these or the generator.
"""The bits of the words and registers of the {title}."""

from typing import Final

{bits}
'''
_IN_CLASS: Final = "\n        "


def bits(family: Family) -> str:
    """Return the source of the bits of a family's registers, or of the words of its page."""
    tables = [row.fields for row in family.registers]
    tables += [getattr(family.tables, name) for _, name in family.bits]
    masks = {bit.name.upper().replace(" ", "_"): bit.mask for table in tables for bit in table}
    rows = "\n".join(f"{n}: Final = {mask:#04x}" for n, mask in masks.items() if n.isidentifier())
    return _BITS.format(title=family.title or family.name, bits=rows)


def registers(family: Family) -> str:
    """Return the source of a family's registers as numbers, typed for the compiled core."""
    rows = family.registers
    names = [row.name.lower() for row in rows]
    places = [(address, row) for row in rows for address in row.addresses]
    places.sort(key=lambda place: place[0])
    # Addresses without a register read 0, up to the power of two that the bus reaches.
    image = ["0"] * (1 << places[-1][0].bit_length())
    for address, row in places:
        image[address] = _number(row, address)
    text = _MODULE.format(
        title=family.title or family.name,
        attributes=_IN_CLASS.join(f"{row.name.lower()}: {_attribute(row)}" for row in rows),
        names=tuple(sorted(names)),
        zero=_IN_CLASS.join(f"self.{name}: i64 = 0" for name in names),
        copy=_IN_CLASS.join(f"self.{name} = other.{name}" for name in names),
        byte=_IN_CLASS.join(_halves(places, _byte)),
        put=_IN_CLASS.join(_halves(places, _put)),
        image=", ".join(image),
        whole=_IN_CLASS.join(f"self.{row.name.lower()} = {_whole(row)}" for row in rows),
    )
    return formatted(text, "registers.py")


def _attribute(row: Register) -> str:
    places = ", ".join(f"{address:02X}H" for address in row.addresses)
    unit = f"1/{1 << row.fraction} {row.unit}" if row.fraction and row.unit else row.unit
    notes = (places, "signed" if row.signed else "", unit, row.counts)
    return "; ".join(note for note in notes if note) + "."


def _shift(row: Register, address: int) -> int:
    return 8 * (len(row.addresses) - 1 - row.addresses.index(address))


def _number(row: Register, address: int) -> str:
    shift = _shift(row, address)
    return f"self.{row.name.lower()}{f' >> {shift}' if shift else ''} & 0xFF"


def _byte(row: Register, address: int) -> str:
    return f"return {_number(row, address)}"


def _put(row: Register, address: int) -> str:
    name, shift = f"self.{row.name.lower()}", _shift(row, address)
    if shift < row.bits - 8:
        return f"{name} = {name} & -{(0xFF << shift) + 1:#x} | data << {shift}"
    # The most significant byte, with the sign.
    data = "(data ^ 0x80) - 0x80" if row.signed else "data"
    below = f" << {shift} | {name} & {(1 << shift) - 1:#x}" if shift else ""
    return f"{name} = {data}{below}"


def _whole(row: Register) -> str:
    """Return what a register's number is, of the bytes of all addresses."""
    data = [f"image[{address:#04x}]" for address in row.addresses]
    if row.signed:
        data[0] = f"(({data[0]} ^ 0x80) - 0x80)"
    shifts = [_shift(row, address) for address in row.addresses]
    return " | ".join(
        f"{each} << {shift}" if shift else each for each, shift in zip(data, shifts, strict=True)
    )


def _halves(
    places: list[tuple[int, Register]], statement: Callable[[Register, int], str]
) -> list[str]:
    """Return a statement for each address, found by halves: an interpreter compares seldom."""
    if len(places) == 1:
        address, row = places[0]
        return [f"if address == {address:#04x}:", f"    {statement(row, address)}"]
    # Seven comparisons for 128 addresses, where a chain of tests would take 64 on average.
    middle = len(places) // 2
    return [
        f"if address < {places[middle][0]:#04x}:",
        *(f"    {line}" for line in _halves(places[:middle], statement)),
        "else:",
        *(f"    {line}" for line in _halves(places[middle:], statement)),
    ]
