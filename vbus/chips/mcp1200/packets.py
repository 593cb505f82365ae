"""MCP-1200: bus cycles to accesses of whole registers."""

from typing import Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.packets import Cycle, RegisterPackets
from vbus.chips.tables import Register

_COMPATIBLE: Final = 0x3F


class Mcp1200Decoder(RegisterPackets):
    """Registers, their bits by name.

    Whether addresses have six or seven bits is taken from the last write to the configuration
    register (MCP-BUS-9); until one is seen, six, as after reset.
    """

    FAMILY = ds.FAMILY
    WORDS = {"status": 8, "flag": 8, "feature": 8, "config": 8, "capture": 8, "exception": 8}
    ROWS = ds.REGISTERS
    NO_REGISTER = "MCP-BUS-10"

    def __init__(self) -> None:
        super().__init__()
        self._extended: bool = False

    def address(self, cycle: Cycle) -> int:
        """Return the address a cycle goes to."""
        address = cycle.address if self._extended else cycle.address & _COMPATIBLE
        if cycle.write and address == ds.CONFIG:
            self._extended = bool(cycle.data & ds.EXTENDED)
        return address

    def show_word(self, name: str, value: int) -> str:
        """Explain a control register's byte as it reads."""
        known = {"capture": "CAPTURE_CONTROL"}.get(name, name.upper())
        return self.value(ds.REGISTERS[known], value, False)

    def value(self, row: Register, value: int, write: bool) -> str:
        """Return a register's value as people read it."""
        if row.name == "FLAG" and write:
            return f"{value:02X}H {'sets' if value & 8 else 'clears'} F{value & 7}"
        if row.name == "MODE":
            return f"{value:02X}H {ds.MODES[min(value, 3)]}"
        if row.name == "EXCEPTION":
            actions = [f"{name}={ds.ACTIONS[value >> at & 3]}" for name, at in ds.EXCEPTIONS]
            return f"{value:02X}H {' '.join(actions)}"
        return super().value(row, value, write)
