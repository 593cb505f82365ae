"""How a host moves register values to and from a chip with a register map, for asyncio."""

from vbus.client.aio.bus import ChipCycles


class RegisterCycles:
    """Values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
    """

    def __init__(self, cycles: ChipCycles) -> None:
        self.cycles: ChipCycles = cycles

    async def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` (most significant byte first) as a number.

        The least significant byte is read first: it freezes the others where they are live.
        """
        async with self.cycles.batch() as batch:
            later = [batch.read(address) for address in reversed(addresses)]
        data = bytes(byte.value for byte in later)
        return int.from_bytes(data, "little", signed=signed)

    async def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write ``value`` to the register at ``addresses``, most significant byte first.

        Raises:
            ValueError: the value does not fit.
        """
        bits = 8 * len(addresses)
        if not -(1 << (bits - 1)) <= value < 1 << bits:
            raise ValueError(f"{value} does not fit into {bits} bits")
        async with self.cycles.batch() as batch:
            for place, address in enumerate(addresses):
                batch.write(address, value >> (bits - 8 - 8 * place) & 0xFF)
