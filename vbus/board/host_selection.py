"""The chips of one host: which of them its next cycles concern, and what those cost."""

from typing import ClassVar, Final

from vbus.board.card.card_bus import CardBus, CyclePath
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.core.kernel import US
from vbus.core.signals import Z
from vbus.core.state import Names
from vbus.protocols import codes
from vbus.protocols.port import PortError

FLOATING: Final = 0xFF
LOCKSTEP_CYCLE: Final = US
"""Default duration of a whole bus cycle where time moves only by cycles: an ISA bus, a fast MCU.
Drivers that give up after some thirty polls must see the busy time pass (decision 7)."""


class Selection:
    """What SELECT has chosen.

    Args:
        board: the board.
        chips: what the session may select, in order.
        cycle_ps: what a whole cycle costs; 0: 1 us, or the chip's minimum in real time.

    Attributes:
        selected: the chips of following cycles.
        chip: the one chip selected; None if there are more, or none.
        path: what brings cycles from it to the chips behind, if it is a card's connector.
        cycle: what a whole cycle costs now (ps).
        cycles: what it costs with each chip.
        decoded: chips whose strobes or select glue drives: whole cycles are made at the chip.
    """

    STATE: ClassVar[Names] = ("mask",)
    WIRING: ClassVar[Names] = ("chips", "cycles", "decoded")
    DERIVED: ClassVar[Names] = ("_mask", "chip", "cycle", "path", "selected")

    def __init__(self, board: Circuit, chips: list[Chip], cycle_ps: int) -> None:
        least = [
            chip.cycle_ps if board.policy == "realtime"
            else max(LOCKSTEP_CYCLE, chip.cycle_ps if chip.CONNECTOR else 0)
            for chip in chips
        ]  # fmt: skip
        # What a host says of its own cycles goes before any default.
        cycles = [cycle_ps or cost for cost in least]
        self.chips: list[Chip] = chips
        self.cycles: list[int] = cycles
        self.decoded: list[Chip] = board.glue.behind(chips)
        self._mask: int = 1
        self.selected: list[Chip] = chips[:1]
        self.chip: Chip | None = chips[0] if chips else None
        self.path: CyclePath | None = _path(self.chip)
        self.cycle: int = cycles[0] if cycles else US

    @property
    def mask(self) -> int:
        """The chips of following cycles, a bit each."""
        return self._mask

    @mask.setter
    def mask(self, mask: int) -> None:
        if mask >> len(self.chips):
            raise PortError(
                codes.NO_SUCH, f"select {mask:X}: this session has {len(self.chips)} chips"
            )
        self._mask = mask
        self.selected = [chip for n, chip in enumerate(self.chips) if mask >> n & 1]
        self.chip = self.selected[0] if len(self.selected) == 1 else None
        self.path = _path(self.chip)
        if self.selected:
            self.cycle = max(self._chosen())

    def _chosen(self) -> list[int]:
        return [cycle for n, cycle in enumerate(self.cycles) if self._mask >> n & 1]

    def cost(self, *cycles: int) -> list[int]:
        """Set what a whole cycle costs (ps), for all chips or for each; return what it did."""
        before = self.cycles
        self.cycles = list(cycles) if len(cycles) > 1 else [cycles[0]] * len(self.chips)
        self.cycle = max(self._chosen(), default=cycles[0])
        return before

    def number(self, name: str) -> int:
        """Return the bit number of the chip called ``name``.

        Raises:
            PortError: there is none; the message lists what there is.
        """
        names = [chip.name for chip in self.chips]
        if name in names:
            return names.index(name)
        raise PortError(codes.NO_SUCH, f"no chip {name!r}; this session has {', '.join(names)}")

    @property
    def names(self) -> str:
        """How observers see the chips selected: ``"x"``, ``"x+y"``, ``"-"``."""
        return "+".join(chip.name for chip in self.selected) or "-"

    def observed(self) -> bool:
        """Whether a bus net of the chips selected, which hosts drive, is observed."""
        if self.decoded and any(chip in self.decoded for chip in self.selected):
            return False
        for chip in self.selected:
            if chip.CONNECTOR:
                return True
            for pin in chip.bus_pins:
                if pin.net.observers:
                    return True
        return False

    def steady(self, address: int) -> tuple[Chip | None, int] | None:
        """Return the chip that answers polls at an address, without effect, and the address there.

        Chip None: what stands on the wires of a card does. None: a poll may have an effect, or more
        than one chip is selected.
        """
        chip = self.chip
        found: tuple[Chip | None, int] | None = (chip, address) if chip is not None else None
        if self.path is not None:
            found = self.path.steady(address)
        if found is not None and found[0] is not None and found[1] not in found[0].FREE_READS:
            return None
        return found

    def floating(self) -> int:
        """Return what a read finds with no chip selected."""
        net = self.chips[0].bus_net if self.chips else None
        return net.value if net is not None and net.rest == Z else FLOATING


def _path(chip: Chip | None) -> CyclePath | None:
    return chip.path if isinstance(chip, CardBus) else None
