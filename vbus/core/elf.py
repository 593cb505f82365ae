"""Programs as linkers write them (ELF): what is loaded where, and the functions by name."""

import struct
from collections.abc import Iterator
from typing import Final, NamedTuple

MAGIC: Final = b"\x7fELF"
LOADED: Final = 1
"""Kind of a segment that is in memory while the program runs."""
_FUNCTION: Final = 2
_TABLES: Final = (2, 11)
"""Types of sections: all symbols, and those that the dynamic loader needs."""


class ElfSegment(NamedTuple):
    """A row of the program header.

    Attributes:
        kind: such as :data:`LOADED`.
        offset: in the file.
        virtual: address while the program runs.
        physical: address at which it is loaded.
        size: bytes in the file.
        memory: bytes in memory.
    """

    kind: int
    offset: int
    virtual: int
    physical: int
    size: int
    memory: int


class Elf:
    """A program of 32 or 64 bits, of either byte order.

    Args:
        data: the whole file.

    Attributes:
        data: the file.
        machine: number of the processor.
        wide: whether addresses have 64 bits.
        entry: address of the first instruction.

    Raises:
        ValueError: the file is none, or its head is cut off.
    """

    def __init__(self, data: bytes) -> None:
        if data[:4] != MAGIC:
            raise ValueError("no ELF file")
        self.data: Final = data
        self.wide: Final = data[4:5] == b"\2"
        self._order: Final = "<" if data[5:6] == b"\1" else ">"
        # Byte 16 on; before it stand sixteen bytes of identification.
        head = self._unpack("HHIQQQIHHHHHH" if self.wide else "HHIIIIIHHHHHH", 16)
        self.machine: Final[int] = head[1]
        self.entry: Final[int] = head[3]
        self._programs: Final[tuple[int, int, int]] = head[4], head[8], head[9]
        self._sections: Final[tuple[int, int, int]] = head[5], head[10], head[11]

    def _unpack(self, form: str, place: int) -> tuple[int, ...]:
        try:
            return struct.unpack_from(self._order + form, self.data, place)
        except struct.error:
            raise ValueError("the ELF file is cut off") from None

    def segments(self) -> Iterator[ElfSegment]:
        """Give the program header's rows.

        Raises:
            ValueError: the file is damaged.
        """
        first, size, count = self._programs
        # A size of 0 in a damaged file must not make a loop without end.
        for place in range(first, first + size * count, size or 1):
            row = self._unpack("IIQQQQQ" if self.wide else "IIIIII", place)
            yield ElfSegment(row[0], *(row[2:7] if self.wide else row[1:6]))

    def functions(self) -> Iterator[tuple[str, int, int]]:
        """Give the functions: name, address, size in bytes (0 where it is not known).

        Raises:
            ValueError: the file is damaged.
        """
        first, size, count = self._sections
        form = "IIQQQQIIQQ" if self.wide else "10I"
        rows = [self._unpack(form, first + size * number) for number in range(count)]
        for row in rows:
            # Entries of size 0, and a string table that is not there, are damage, too.
            if row[1] not in _TABLES or not row[9] or row[6] >= len(rows):
                continue
            names = rows[row[6]][4]
            for place in range(row[4], row[4] + row[5], row[9]):
                if self.wide:
                    name, info, _, _, value, extent = self._unpack("IBBHQQ", place)
                else:
                    name, value, extent, info = self._unpack("IIIB", place)
                if info & 15 == _FUNCTION:
                    end = self.data.index(0, names + name)
                    text = self.data[names + name : end].decode("ascii", "replace")
                    yield text, value, extent
