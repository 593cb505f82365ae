"""A card's bus connector: whole cycles at addresses of the card become strobes on its lines."""

from typing import ClassVar, Final

from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.kernel import NEVER, NS
from vbus.options import Option
from vbus.signals import HIGH, LOW, Observer, Z
from vbus.state import Names

ISA: Final = "ISA"
CLOCK: Final = 8_333_333
SETUP: Final = 100 * NS
HOLD: Final = 30 * NS
FLOATING: Final = 0xFF
ADDRESS_LINES: Final = 16
MOST: Final = 256
"""Addresses of one card: requests carry eight bits."""


class CardBus(Chip):
    """What a card has of the computer's bus: A0 to A15, D0-D7, /IOR, /IOW, AEN and RESET.

    It answers nothing by itself: address ``n`` of a cycle is the card's base and n on the address
    lines, and the byte read is what stands on D0-D7 as ``/IOR`` rises. Address and data are there
    before the strobe falls and after it rises. Every cycle is played as strobes, on wires that
    glue and chips listen to.
    """

    FAMILY = "card"
    ADDRESS_BITS = 8
    AXES = 0
    PARTS = (ISA,)
    PINS = (
        *(PinRow(f"A{n}", "in", rest=LOW, title="address") for n in range(ADDRESS_LINES)),
        PinRow("/IOR", "in", strobe=True, title="a read is under way while it is low"),
        PinRow("/IOW", "in", strobe=True, title="a write is under way while it is low"),
        PinRow("D0-D7", "io", rest=FLOATING, width=8, title="data, pulled high"),
        PinRow("AEN", "in", rest=LOW, title="high while addresses are those of DMA"),
        PinRow("RESET", "in", rest=LOW, title="reset of the whole bus, active high"),
    )
    OPTIONS = (
        Option("base", "count", 0, "address of the card's first port", low=0, high=0xFFFF),
        Option("strobe", "s", 500 * NS, "how long a strobe is low", low=1),
    )
    STATE: ClassVar[Names] = ()
    WIRING: ClassVar[Names] = ("chips",)

    chips: tuple[Chip, ...] = ()
    """The chips of the board, which show what they drive when somebody looks."""

    def power_on(self, done: bool) -> None:
        """A cycle is always played: somebody always listens to the strobes."""
        self.pins["/IOR"].net.observe(Observer())

    def advance(self) -> None:
        """Let the chips show what they drive by now."""
        for chip in self.chips:
            chip.advance()

    def next_event(self) -> int:
        """Nothing happens of itself."""
        return NEVER

    def resting(self) -> bool:
        """Nothing comes of leaving it alone."""
        return True

    def ready_at(self) -> int:
        """It is always ready."""
        return self.kernel.now

    def strobes(self, write: bool, address: int, data: int) -> list[tuple[int, str, int]]:
        """Return the edges of a whole cycle."""
        low = int(self.settings["strobe"])
        where = int(self.settings["base"]) + address
        strobe = "/IOW" if write else "/IOR"
        edges = [(-low - SETUP, f"A{n}", where >> n & 1) for n in range(ADDRESS_LINES)]
        if write:
            edges.append((-low - SETUP, "D0-D7", data))
        edges += [(-low, strobe, LOW), (0, strobe, HIGH)]
        if write:
            edges.append((HOLD, "D0-D7", Z))
        return edges
