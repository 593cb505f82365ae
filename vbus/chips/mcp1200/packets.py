"""MCP-1200: bus cycles to accesses of whole registers."""

from typing import Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.tables import Register
from vbus.trace.packets import Cycle, RegisterPackets, flags

_BITS: Final = {
    "FEATURE": ds.FEATURE_BITS,
    "CONFIG": ds.CONFIG_BITS,
    "CAPTURE_CONTROL": ds.CAPTURE_BITS,
    "STATUS": ds.STATUS_BITS,
}
_MODES: Final = {0: "soft reset", 1: "idle", 2: "halt motion", 3: "control"}
_ACTIONS: Final = ("report", "idle", "decelerate", "abrupt")
_COMPATIBLE: Final = 0x3F


class Mcp1200Packets(RegisterPackets):
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
        if row.name in _BITS:
            return f"{value:02X}H {flags(value, _BITS[row.name])}"
        if row.name == "FLAG":
            if not write:
                return f"{value:02X}H {flags(value, ds.FLAG_BITS)}"
            return f"{value:02X}H {'sets' if value & 8 else 'clears'} F{value & 7}"
        if row.name == "MODE":
            return f"{value:02X}H {_MODES.get(value, 'control')}"
        if row.name == "EXCEPTION":
            actions = [
                f"{name}={_ACTIONS[value >> shift & 3]}"
                for name, shift in (("error", 6), ("breakpoint", 4), ("stop", 2), ("limit", 0))
            ]
            return f"{value:02X}H {' '.join(actions)}"
        return super().value(row, value, write)
