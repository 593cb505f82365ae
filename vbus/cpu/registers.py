"""Registers of peripherals as tables, and what firmware finds at their addresses."""

from collections.abc import Callable
from typing import Any, ClassVar, Final

from msgspec import Struct

from vbus.cpu.machine import CpuMachine, Peripheral


class IoRegister(Struct, frozen=True):
    """A register of a peripheral, or several of the same kind one behind the other.

    Attributes:
        name: as the reference manual has it.
        offset: its distance from the block's base.
        reset: what it holds after a reset.
        title: what it does; empty: it is storage.
        read: method that gives its value; else it is what was written.
        write: method that takes a value; else the value is stored.
        count: how many there are.
    """

    name: str
    offset: int
    reset: int = 0
    title: str = ""
    read: str = ""
    write: str = ""
    count: int = 1


def stored(*names: str, first: int = 0) -> tuple[IoRegister, ...]:
    """Return rows of storage, one behind the other."""
    return tuple(IoRegister(name, first + 4 * place) for place, name in enumerate(names))


class RegisterBlock(Peripheral):
    """A peripheral: its registers, the lowest byte of each at the lowest address.

    Args:
        machine: what it is part of.
        name: as the reference manual has it.
        base: its address.

    Attributes:
        REGISTERS: its rows.
        SIZE: of one register in bytes.
        enable: the block, register and bit that turn its clock on; None: it always has one.
    """

    REGISTERS: ClassVar[tuple[IoRegister, ...]] = ()
    SIZE: ClassVar[int] = 4

    def __init__(self, machine: CpuMachine, name: str, base: int) -> None:
        super().__init__(base)
        self.machine: Final = machine
        self.name: Final = name
        self.enable: tuple[RegisterBlock, str, int] | None = None
        self.values: Final[dict[int, int]] = {}
        self._rows: Final[dict[int, IoRegister]] = {}
        for row in self.REGISTERS:
            for number in range(row.count):
                place = row.offset + number * self.SIZE
                self.values[place] = row.reset
                self._rows[place] = row

    def of(self, name: str) -> int:
        """Return what a register holds, by its name."""
        return next(self.values[row.offset] for row in self.REGISTERS if row.name == name)

    def has_clock(self, offset: int) -> bool:
        """Whether it has its clock; without one a real peripheral does not answer."""
        if self.enable is None:
            return True
        block, register, bit = self.enable
        on = bool(block.of(register) >> bit & 1)
        if not on:
            self.machine.once(
                f"clock {self.name}",
                f"{self.name} has no clock (bit {bit} of {block.name} {register} is 0): accesses"
                f" are lost, reads give 0; the first is at offset {offset:02X}h, by the"
                f" instruction at {self.machine.at()}",
            )
        return on

    def read(self, offset: int, size: int) -> int:
        """Return what is read at an offset."""
        if not self.has_clock(offset):
            return 0
        place = offset - offset % self.SIZE
        row = self._rows.get(place)
        if row is None:
            self.machine.missing(f"{self.name}+{offset:02X}h", self.base + offset, False)
            return 0
        value = self.values[place]
        # A method gives the whole register, of which bytes or halves may be read.
        if row.read:
            method: Callable[[int], Any] = getattr(self, row.read)
            value = method(place - row.offset)
        self.settle()
        return (value >> 8 * (offset - place)) & ((1 << 8 * size) - 1)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written at an offset."""
        if not self.has_clock(offset):
            return
        place = offset - offset % self.SIZE
        row = self._rows.get(place)
        if row is None:
            self.machine.missing(f"{self.name}+{offset:02X}h", self.base + offset, True)
            return
        shift = 8 * (offset - place)
        # A method takes a narrow access as one of the whole register, with 0 beside it.
        if row.write:
            method: Callable[[int, int], Any] = getattr(self, row.write)
            method(place - row.offset, value << shift)
        else:
            mask = ((1 << 8 * size) - 1) << shift
            self.values[place] = (self.values[place] & ~mask) | (value << shift & mask)
        self.settle()

    def nothing(self, _: int, __: int) -> None:
        """Take what is written to a register that cannot be written."""

    def settle(self) -> None:
        """Do what an access has led to: interrupt, or ask for a transfer."""
