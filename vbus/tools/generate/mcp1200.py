"""MCP-1200: calls that read and write each row of the register table."""

from collections.abc import Iterable

from vbus.chips.tables import Register
from vbus.tools.generate.layout import docstring, formatted

_HEAD = '''\
# Generated from the register table by vbus.tools.generate; change the table or the generator.
"""The MCP-1200's registers, one call to read and one to write each, for asyncio."""

from vbus.client.aio.mcp1200_access import Mcp1200Access


class Mcp1200Registers(Mcp1200Access):
    """Every register of the manual by name, as a whole value in the chip's own units.

    Several bytes are written most significant byte first and read least significant byte first,
    as the manual asks; extended addressing is switched on where it is needed.
    """
'''


def registers(table: Iterable[Register]) -> str:
    """Return the source of the asyncio register calls."""
    lines = [_HEAD]
    for row in table:
        lines += [*_read(row), ""]
        if row.access != "r":
            lines += [*_write(row), ""]
    return formatted("\n".join(lines), "vbus/client/aio/mcp1200_registers.py")


def _read(row: Register) -> list[str]:
    call = f"self.read_bytes({_bytes(row)}, signed=True)" if row.signed else (
        f"self.read_bytes({_bytes(row)})"
    )  # fmt: skip
    return [
        f"    async def read_{row.name.lower()}(self) -> int:",
        *docstring(f"Read {_title(row)}", [f"Returns {_sense(row)}."]),
        f"        return await {call}",
    ]


def _write(row: Register) -> list[str]:
    return [
        f"    async def write_{row.name.lower()}(self, value: int) -> None:",
        *docstring(f"Write {_title(row)}", [f"Args:\n    value: {_sense(row)}."]),
        f"        await self.write_bytes({_bytes(row)}, value)",
    ]


def _bytes(row: Register) -> str:
    listed = ", ".join(f"0x{address:02X}" for address in row.addresses)
    return f"({listed},)" if len(row.addresses) == 1 else f"({listed})"


def _title(row: Register) -> str:
    names = ", ".join(f"R{address:02X}H" for address in row.addresses)
    return f"{row.title} ({names}, {row.clause})."


def _sense(row: Register) -> str:
    scale = f", in 1/{1 << row.fraction}" if row.fraction else ""
    sense = "two's complement" if row.signed else "unsigned"
    return f"{row.bits} bits, {sense}{scale}"


def from_datasheet() -> str:
    """Return the calls for the register table of the chip's own datasheet."""
    from vbus.chips.mcp1200.datasheet import REGISTERS

    return registers(REGISTERS)
