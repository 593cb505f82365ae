"""How a host moves register values to and from an MCP-1200, for asyncio."""

from typing import Final

from vbus.chips.mcp1200.datasheet import CONFIG, EXTENDED, REGISTERS
from vbus.client.aio.access import RegisterCycles
from vbus.client.aio.bus import ChipCycles
from vbus.client.aio.twice import twice
from vbus.core.errors import ReadBackError

FIRST_EXTENDED: Final = 0x40
"""First address that needs extended addressing (MCP-BUS-9)."""
_STORED: Final = {
    row.addresses
    for row in REGISTERS
    if row.access == "rw" and not (row.on_read or row.on_write or row.moves)
}
"""Registers that read as they were written."""


class Mcp1200Access(RegisterCycles):
    """One MCP-1200: values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        checked: read back every register that reads as it was written.
    """

    def __init__(self, cycles: ChipCycles, *, checked: bool = False) -> None:
        super().__init__(cycles)
        self.checked: bool = checked
        self._extended: bool = False

    async def extend(self) -> None:
        """Switch extended addressing on (R02 bit 0), whatever else R02 holds."""
        if self.checked:
            config = await twice(lambda: self.cycles.read(CONFIG), 0)
        else:
            config = await self.cycles.read(CONFIG)
        if not config & EXTENDED:
            await self.cycles.write(CONFIG, config | EXTENDED)
            if self.checked and (found := await self.cycles.read(CONFIG)) != config | EXTENDED:
                raise ReadBackError(
                    f"R02H reads {found:02X}h after {config | EXTENDED:02X}h was written"
                )
        self._extended = True

    async def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` as a number, by extended addressing if need be."""
        await self._reach(addresses)
        return await super().read_bytes(addresses, signed)

    async def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write the register at ``addresses``, by extended addressing if need be.

        Raises:
            ReadBackError: the register reads otherwise (``checked``).
            ValueError: the value does not fit.
        """
        await self._reach(addresses)
        await super().write_bytes(addresses, value)
        if self.checked and addresses in _STORED:
            found = await super().read_bytes(addresses)
            written = value & (1 << 8 * len(addresses)) - 1
            if found != written:
                raise ReadBackError(
                    f"R{addresses[0]:02X}H reads {found:X}h after {written:X}h was written"
                )
        if addresses == (CONFIG,):
            self._extended = bool(value & EXTENDED)

    async def _reach(self, addresses: tuple[int, ...]) -> None:
        if addresses[0] >= FIRST_EXTENDED and not self._extended:
            await self.extend()
