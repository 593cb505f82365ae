"""MCP-1200: edges of the host bus to bus cycles."""

from vbus.chips.bus_watch import BusWatch
from vbus.chips.packets import Cycle


class Mcp1200Watch(BusWatch):
    """MCP-1200: the address is latched by /ALE or /CS, a write ends with /CS, a read with /OE.

    What is accessed before the first address has been seen is passed over.
    """

    PINS = ("/ALE", "/CS", "/OE", "R/W")
    DATA = "DB0-DB7"
    STATE = ("_address", "_closed: bool", "_read")

    def __init__(self) -> None:
        super().__init__()
        self._address: int = -1
        self._closed: bool = True
        self._read: int = -1

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Follow the address latch (MCP-BUS-2), /CS (MCP-BUS-4) and /OE (MCP-BUS-7)."""
        ale, cs, oe, write_not = before
        cycles = []
        if not oe and after[2] and self._read >= 0:
            cycles.append(Cycle(when, False, self._read, data))
            self._read = -1
        if ale and not after[0]:
            self._closed = False
        if not self._closed and ((not ale and after[0]) or (cs and not after[1])):
            self._address = old & 0x7F
            self._closed = True
        if not cs and after[1] and self._address >= 0:
            if write_not:
                self._read = self._address
            else:
                cycles.append(Cycle(when, True, self._address, old))
        return cycles

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether /OE is low, and no write is under way (MCP-BUS-7)."""
        return not levels[2] and bool(levels[1] or levels[3])

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether /ALE, /CS and /OE are high."""
        return bool(levels[0] and levels[1] and levels[2])
