"""What one host reaches: its chips, their pins, a card's addresses, and all of it by name."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import mypyc_attr

from vbus.board.cards import Card
from vbus.board.circuit import Circuit
from vbus.board.host_clock import HostClock
from vbus.board.host_pins import HostPins
from vbus.board.pin_maps import PinMap, wiring
from vbus.chips.base import Chip
from vbus.kernel import US
from vbus.protocols import codes
from vbus.protocols.port import ChipInfo, PortError, PortInfo
from vbus.protocols.requests import FORESEEING
from vbus.state import Names

LOCKSTEP_CYCLE: Final = US
"""Default duration of a whole bus cycle where time moves only by cycles: an ISA bus, a fast MCU.
Drivers that give up after some thirty polls must see the busy time pass (decision 7)."""


@mypyc_attr(allow_interpreted_subclasses=True)
class HostReach(HostClock):
    """The part of a port that knows what the host is connected to.

    Args:
        board: the board.
        label: the host's name in traces.
        chips: what the session may select, in order.
        cycle_ps: cost of a whole cycle; 0: 1 us, or the chip's minimum in real time.
        card: address decoding, if the host speaks card addresses.
    """

    WIRING: ClassVar[Names] = (
        "_card", "_cycles", "chips", "cycle_ps", "label", "on_events", "on_resume", "pin_map",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_chip", "_mask", "_selected")

    def __init__(
        self, board: Circuit, label: str, chips: list[Chip], cycle_ps: int, card: Card | None
    ) -> None:
        super().__init__(board)
        self.label: str = label
        self.chips: list[Chip] = chips
        self.on_resume: Callable[[], None] | None = None
        self.on_events: Callable[[], None] | None = None
        self.cycle_ps: int = cycle_ps
        self._card: Card | None = card
        self.pin_map: PinMap | None = None
        self._cycles: list[int] = [cycle_ps or self._default_cycle(chip) for chip in chips]
        self._mask: int = 1
        self._selected: list[Chip] = chips[:1]
        self._chip: Chip | None = chips[0] if chips else None
        self._cycle = self._cycles[0] if chips else US
        self._pins: HostPins = HostPins(board.kernel, label, chips, self._edge_seen)

    def _default_cycle(self, chip: Chip) -> int:
        return chip.cycle_ps if self.board.policy == "realtime" else LOCKSTEP_CYCLE

    def cost(self, *cycles: int) -> list[int]:
        """Set what a whole cycle costs (ps), for all chips or for each; return what it did."""
        before = self._cycles
        self._cycles = list(cycles) if len(cycles) > 1 else [cycles[0]] * len(self.chips)
        chosen = (c for n, c in enumerate(self._cycles) if self._mask >> n & 1)
        self._cycle = max(chosen, default=cycles[0])
        return before

    def info(self) -> PortInfo:
        """Return what HELLO tells."""
        board = self.board
        return PortInfo(
            board.name,
            board.policy,
            board.rate if board.policy == "realtime" else 0.0,
            [
                ChipInfo(chip.name, chip.part, chip.FAMILY, chip.ADDRESS_BITS, cycle)
                for chip, cycle in zip(self.chips, self._cycles, strict=True)
            ],
            self._pins.line_names(),
            self._pins.output_names(),
            self._pins.side_names(),
            ["claim", "events", "leases", FORESEEING, "lines", "pass", "polled_at", "sync"],
            wiring(self.pin_map, self.chips, self._pins),
            self._card.text() if self._card is not None else "",
            self._program(),
        )

    def _program(self) -> str:
        if self._card is None:
            return f"step={self.board.clock_step};" if self.pin_map is not None else ""
        return f"step={self.board.clock_step};{self._card.program_text(self._pins.output_names())}"

    def _edge_seen(self) -> None:
        if self.on_events is not None:
            self.on_events()

    def chip_number(self, name: str) -> int:
        """Return the bit number of the chip called ``name``."""
        names = [chip.name for chip in self.chips]
        if name in names:
            return names.index(name)
        known = ", ".join(names)
        raise PortError(codes.NO_SUCH, f"no chip {name!r}; this session has {known}")

    def pin_number(self, name: str) -> int:
        """Return the number of a side pin."""
        return self._pins.number(self._pins.sides, self._pins.side_names(), name, self._selected)

    def line_number(self, name: str) -> int:
        """Return the number of a control line."""
        return self._pins.number(self._pins.lines, self._pins.line_names(), name, self._selected)

    def card(self, address: int, write: bool = False) -> tuple[int, int] | None:
        """Decode a card address into (chip number, chip address)."""
        return self._card.decode(address, write) if self._card is not None else None

    def card_floating(self, address: int) -> int:
        """Return the data bits that nobody drives when a card address is read."""
        return self._card.floating(address) if self._card is not None else 0
