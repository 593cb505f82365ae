"""The buses that cards plug into: their lines and their usual times, a row each."""

from typing import Final

from msgspec import Struct

from vbus.chips.tables import PinRow
from vbus.core.kernel import NS
from vbus.core.signals import LOW

DATA: Final = "D0-D7"
FLOATING: Final = 0xFF
LATCH: Final = "ALE"
"""High while D0-D7 carry address lines 0 to 7, on a bus that has it."""


class BusRow(Struct, frozen=True):
    """One kind of bus.

    Attributes:
        bus: its name.
        title: what it is.
        lines: how many address lines it has.
        ports: its strobes for I/O ports, read and write; empty: it has no I/O ports.
        memory: its strobes for memory.
        others: its further lines.
        setup: from when address and data stand before the strobe falls (ps).
        strobe: how long the strobe is low (ps).
        hold: how long written data stays after it (ps).
        wait: a cycle of its clock, by which each wait state makes the strobe longer (ps).
        window: whether it is a window of a larger space: the rest of an address selects the bus.
    """

    bus: str
    title: str
    lines: int
    ports: tuple[str, ...]
    memory: tuple[str, ...]
    others: tuple[PinRow, ...]
    setup: int
    strobe: int
    hold: int
    wait: int
    window: bool = False

    def strobes_of(self, memory: bool) -> tuple[str, ...]:
        """Return the strobes of its memory, or of its I/O ports if it has any: read and write."""
        return self.memory if memory or not self.ports else self.ports

    @property
    def strobes(self) -> tuple[str, ...]:
        """Every strobe it has."""
        return (*self.ports, *self.memory)

    @property
    def address(self) -> tuple[str, ...]:
        """Its address lines, lowest first."""
        return tuple(f"A{number}" for number in range(self.lines))

    def on_lines(self, address: int) -> int:
        """Return what of an address is on its address lines."""
        return address & ((1 << self.lines) - 1)

    @property
    def latched(self) -> bool:
        """Whether D0-D7 carry a part of the address first."""
        return any(row.name == LATCH for row in self.others)

    @property
    def steady(self) -> tuple[str, ...]:
        """Lines that cycles do not move."""
        return tuple(row.name for row in self.others if row.name != LATCH)

    @property
    def pins(self) -> tuple[PinRow, ...]:
        """Its lines, as pins of a connector."""
        titles = {"R": "a read is under way while it is low", "W": "a write is under way"}
        strobes = [
            PinRow(name, "in", strobe=True, title=titles["RW"[place % 2]])
            for place, name in enumerate(self.strobes)
        ]
        return (
            *(PinRow(name, "in", rest=LOW, title="address") for name in self.address),
            *strobes,
            PinRow(DATA, "io", rest=FLOATING, width=8, title="data, pulled high"),
            *self.others,
        )


_RESET: Final = PinRow("RESET", "in", rest=LOW, title="reset of the whole bus, active high")
_ALE: Final = PinRow(LATCH, "in", rest=LOW, title="address latch enable: D0-D7 carry A0 to A7")

_ROWS: Final = (
    # A wait state is a clock of the bus: 120 ns at 8.33 MHz.
    BusRow(
        "ISA", "ISA and PC/104: I/O ports, or memory with memory = true", 20,
        ("/IOR", "/IOW"), ("/MEMR", "/MEMW"),
        (PinRow("AEN", "in", rest=LOW, title="high while addresses are those of DMA"), _RESET),
        100 * NS, 500 * NS, 30 * NS, 120 * NS,
    ),
    # A clock of 16 MHz is 62.5 ns.
    BusRow(
        "XMEM", "external memory of an AVR at 16 MHz, with its address latch", 16,
        (), ("/RD", "/WR"),
        (_ALE,),
        125 * NS, 52 * NS + 500, 47 * NS + 500, 62 * NS + 500,
    ),
    BusRow(
        "SRAM", "asynchronous memory of a processor; the rest of the address selects it", 24,
        (), ("/OE", "/WE"), (), 10 * NS, 100 * NS, 10 * NS, 10 * NS, window=True,
    ),
    BusRow(
        "MUX", "the same with A0 to A7 on D0-D7 first, under its address latch enable", 24,
        (), ("/RD", "/WR"), (_ALE,), 125 * NS, 200 * NS, 50 * NS, 50 * NS, window=True,
    ),
)  # fmt: skip

BUSES: Final = {row.bus: row for row in _ROWS}
