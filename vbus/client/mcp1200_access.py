# Made from aio/mcp1200_access.py by vbus.tools.generate; change that file.
"""How a host moves register values to and from an MCP-1200, blocking."""

from vbus.chips.mcp1200.datasheet import CONFIG, EXTENDED
from vbus.client.bus import Cycles

FIRST_EXTENDED = 0x40
"""First address that needs extended addressing (MCP-BUS-9)."""


class Mcp1200Access:
    """One MCP-1200: values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`Bus.chip`; or a bus with one chip.
    """

    def __init__(self, cycles: Cycles) -> None:
        self.cycles: Cycles = cycles
        self._extended: bool = False

    def extend(self) -> None:
        """Switch extended addressing on (R02 bit 0), whatever else R02 holds."""
        config = self.cycles.read(CONFIG)
        if not config & EXTENDED:
            self.cycles.write(CONFIG, config | EXTENDED)
        self._extended = True

    def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` (most significant byte first) as a number.

        The least significant byte is read first: it freezes the others where they are live.
        """
        self._reach(addresses)
        with self.cycles.batch() as batch:
            later = [batch.read(address) for address in reversed(addresses)]
        data = bytes(byte.value for byte in later)
        return int.from_bytes(data, "little", signed=signed)

    def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write ``value`` to the register at ``addresses``, most significant byte first.

        Raises:
            ValueError: the value does not fit.
        """
        bits = 8 * len(addresses)
        if not -(1 << (bits - 1)) <= value < 1 << bits:
            raise ValueError(f"{value} does not fit into {bits} bits")
        if addresses == (CONFIG,):
            self._extended = bool(value & EXTENDED)
        self._reach(addresses)
        with self.cycles.batch() as batch:
            for place, address in enumerate(addresses):
                batch.write(address, value >> (bits - 8 - 8 * place) & 0xFF)

    def _reach(self, addresses: tuple[int, ...]) -> None:
        if addresses[0] >= FIRST_EXTENDED and not self._extended:
            self.extend()
