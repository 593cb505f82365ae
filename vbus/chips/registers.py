"""The bytes of a register map: what the bus sees, and whole values for the chip."""

from typing import ClassVar

from vbus.bits import sign_extend
from vbus.chips.tables import RegisterMap
from vbus.state import Names


class RegisterFile:
    """Storage behind a :class:`~vbus.chips.tables.RegisterMap`.

    The bus reads and writes single bytes; the chip takes and gives whole values by name. Hot
    code may read :attr:`bytes` by address; the array itself is never replaced.

    Args:
        rows: the map.
    """

    __slots__ = ("bytes", "rows")
    STATE: ClassVar[Names] = ("bytes: bytearray",)
    WIRING: ClassVar[Names] = ("rows",)

    def __init__(self, rows: RegisterMap) -> None:
        self.rows: RegisterMap = rows
        self.bytes: bytearray = bytearray(rows.size)

    def value(self, name: str) -> int:
        """Return the whole value of the register ``name``, with its sign if it has one."""
        row = self.rows[name]
        value = 0
        for address in row.addresses:
            value = value << 8 | self.bytes[address]
        return sign_extend(value, row.bits) if row.signed else value

    def put(self, name: str, value: int) -> None:
        """Store ``value`` in the register ``name``; bits beyond its width are dropped."""
        for address in reversed(self.rows[name].addresses):
            self.bytes[address] = value & 0xFF
            value >>= 8

    def reset(self, *names: str) -> None:
        """Load the reset values of the registers named, or of all."""
        for name in names or tuple(row.name for row in self.rows):
            self.put(name, self.rows[name].reset)
