"""A capture of a card's bus: its strobes and address lines to accesses of the card."""

from vbus.board.card.card_bus import CardBus
from vbus.chips.bus_watch import BusTable, BusWatch
from vbus.chips.packets import Cycle
from vbus.views.silicon.channel_map import Wiring

READ, WRITE = 0, 1


class CardWatch(BusWatch):
    """Follows the connector of a card.

    Of the address lines those are needed that tell its ports apart; others may be captured, too,
    and then accesses elsewhere are passed over.

    Args:
        bus: the connector.
        wiring: channels of the capture, once they are known.
    """

    def __init__(self, bus: CardBus, wiring: Wiring | None = None) -> None:
        first, last = bus.where(0), bus.where(int(bus.settings["size"]) - 1)
        self._lines: list[int] = [
            number for number, line in enumerate(bus.row.address)
            # Lines above the highest that differs choose the card itself, and need not be captured.
            if (first ^ last) >> number or (wiring is not None and line in wiring.bits)
        ]  # fmt: skip
        lines = [bus.row.address[number] for number in self._lines]
        lines = [bus.read_strobe, bus.write_strobe, *lines]
        super().__init__(BusTable(tuple(lines), (), (), ()))
        self._ports: dict[int, int] = {
            self._shown(bus.where(port)): port for port in range(int(bus.settings["size"]))
        }

    def _shown(self, address: int) -> int:
        """Return an address as the lines followed show it."""
        return sum((address >> number & 1) << place for place, number in enumerate(self._lines))

    def _port(self, levels: tuple[int, ...]) -> int | None:
        lines = levels[WRITE + 1 :]
        return self._ports.get(sum(level << place for place, level in enumerate(lines)))

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return a write or a read, whose strobe has risen."""
        port = self._port(before)
        if port is None:
            return []
        cycles = []
        if not before[WRITE] and after[WRITE]:
            # A card latches at the rising strobe what was on the bus before it.
            cycles.append(Cycle(when, True, port, old))
        if not before[READ] and after[READ]:
            cycles.append(Cycle(when, False, port, data))
        return cycles

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether the card is read."""
        return not levels[READ] and self._port(levels) is not None

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether neither strobe is low."""
        return bool(levels[READ] and levels[WRITE])


def tie_others(bus: CardBus, wiring: Wiring) -> None:
    """Let address lines that were not captured have the levels of the card's first port."""
    for number, line in enumerate(bus.row.address):
        if line not in wiring.bits:
            wiring.tied.setdefault(line, bus.where(0) >> number & 1)
