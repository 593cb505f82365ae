"""A card's bus connector: whole cycles at addresses of the card become strobes on its lines."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.board.host_pins import HostPins
from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.kernel import NEVER, NS
from vbus.options import Option
from vbus.signals import HIGH, LOW, Guard, Z
from vbus.state import Names

ISA: Final = "ISA"
CONNECTOR: Final = "card"
"""What stands in the place of a chip family where a connector is told of."""
CLOCK: Final = 8_333_333
SETUP: Final = 100 * NS
HOLD: Final = 30 * NS
FLOATING: Final = 0xFF
ADDRESS_LINES: Final = 16
MOST: Final = 256
"""Addresses of one card: requests carry eight bits."""


class CyclePath(Guard):
    """What brings whole cycles from a connector to the chips behind it."""

    def read(self, pins: HostPins, address: int, when: i64) -> int:
        """Run a read cycle with its latching edge at ``when`` (ps); return the byte."""
        raise NotImplementedError

    def write(self, pins: HostPins, address: int, data: int, when: i64) -> None:
        """Run a write cycle with its latching edge at ``when`` (ps)."""
        raise NotImplementedError

    def forget(self) -> None:
        """Another state has been loaded."""
        raise NotImplementedError


class CardBus(Chip):
    """What a card has of the computer's bus: A0 to A15, D0-D7, /IOR, /IOW, AEN and RESET.

    It answers nothing by itself: address ``n`` of a cycle is the card's base and n on the address
    lines, and the byte read is what stands on D0-D7 as ``/IOR`` rises. Address and data are there
    before the strobe falls and after it rises. Cycles are strobes on wires that glue and chips
    listen to; where what comes of them is known beforehand, they are made at the chips: see
    :class:`~vbus.board.card_path.CardPath`.
    """

    FAMILY = CONNECTOR
    CONNECTOR = True
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
        Option("hold", "s", HOLD, "how long written data stays after the strobe", low=0),
    )
    STATE: ClassVar[Names] = ("free_at: i64",)
    WIRING: ClassVar[Names] = ("chips", "path")

    chips: tuple[Chip, ...] = ()
    """The chips of the board, which show what they drive when somebody looks."""
    path: CyclePath | None = None
    """What brings cycles to them."""
    free_at: int = 0
    """Instant from which the next cycle may begin, so that it is one the bus could make (ps)."""

    def power_on(self, done: bool) -> None:
        """There is nothing to reset."""

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

    def after_load(self) -> None:
        """Nobody owes anything to wires that have been loaded."""
        if self.path is not None:
            self.path.forget()

    def strobes(self, write: bool, address: int, data: int) -> list[tuple[int, str, int]]:
        """Return the edges of a whole cycle."""
        low = int(self.settings["strobe"])
        where = int(self.settings["base"]) + address
        strobe = "/IOW" if write else "/IOR"
        edges = [(-low - SETUP, f"A{n}", where >> n & 1) for n in range(ADDRESS_LINES)]
        edges += [(-low - SETUP, name, HIGH) for name in ("/IOR", "/IOW")]
        if write:
            edges.append((-low - SETUP, "D0-D7", data))
        edges += [(-low, strobe, LOW), (0, strobe, HIGH)]
        if write:
            edges.append((int(self.settings["hold"]), "D0-D7", Z))
        return edges
