"""How a host moves register values to and from an MCP-1200, for asyncio."""

from typing import Final

from vbus.chips.mcp1200.datasheet import CONFIG, EXTENDED
from vbus.client.aio.access import RegisterCycles
from vbus.client.aio.bus import ChipCycles

FIRST_EXTENDED: Final = 0x40
"""First address that needs extended addressing (MCP-BUS-9)."""


class Mcp1200Access(RegisterCycles):
    """One MCP-1200: values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
    """

    def __init__(self, cycles: ChipCycles) -> None:
        super().__init__(cycles)
        self._extended: bool = False

    async def extend(self) -> None:
        """Switch extended addressing on (R02 bit 0), whatever else R02 holds."""
        config = await self.cycles.read(CONFIG)
        if not config & EXTENDED:
            await self.cycles.write(CONFIG, config | EXTENDED)
        self._extended = True

    async def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` as a number, by extended addressing if need be."""
        await self._reach(addresses)
        return await super().read_bytes(addresses, signed)

    async def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write the register at ``addresses``, by extended addressing if need be.

        Raises:
            ValueError: the value does not fit.
        """
        await self._reach(addresses)
        await super().write_bytes(addresses, value)
        if addresses == (CONFIG,):
            self._extended = bool(value & EXTENDED)

    async def _reach(self, addresses: tuple[int, ...]) -> None:
        if addresses[0] >= FIRST_EXTENDED and not self._extended:
            await self.extend()
