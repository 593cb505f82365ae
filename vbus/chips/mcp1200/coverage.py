"""MCP-1200: what a host can exercise."""

from collections.abc import Iterator
from typing import Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.packets import Packet
from vbus.views.coverage.tables import BITS, FLAGS, MODES, Exercises, Item, Key, bit_items, bit_keys

_CONTROL: Final = {
    "CONFIG": ds.CONFIG_BITS,
    "FEATURE": ds.FEATURE_BITS,
    "CAPTURE_CONTROL": ds.CAPTURE_BITS[:-1],
}
_SEEN: Final = {
    "STATUS": ds.STATUS_BITS,
    "FLAG": ds.FLAG_BITS,
    "CAPTURE_CONTROL": ds.CAPTURE_BITS,
}


class Mcp1200Exercises(Exercises):
    """Registers, control bits, modes and flags."""

    def items(self) -> Iterator[Item]:
        """Give what the tables have, and the bits."""
        yield from super().items()
        for name, bits in _CONTROL.items():
            yield from bit_items(BITS, name, bits, ds.REGISTERS[name].clause)
        flag = ds.REGISTERS["FLAG"].clause
        for bit in ds.FLAG_BITS:
            for verb in ("sets", "clears"):
                yield Item(BITS, f"FLAG {verb} {bit.name}", flag, bit.title)
        for name, _ in ds.EXCEPTIONS:
            for action in ds.ACTIONS:
                clause = ds.REGISTERS["EXCEPTION"].clause
                yield Item(BITS, f"EXCEPTION {name}={action}", clause, f"what a {name} does")
        for name in ds.MODES:
            yield Item(MODES, name, ds.REGISTERS["MODE"].clause, "written to the mode brancher")
        for name, bits in _SEEN.items():
            yield from bit_items(FLAGS, name, bits, ds.REGISTERS[name].clause)

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give what one packet exercises."""
        yield from super().exercised(packet)
        first = packet.cycles[0]
        name = packet.name.partition(" ")[2]
        value = first.data
        if not first.write:
            yield from bit_keys(FLAGS, name, _SEEN.get(name, ()), value)
        elif name == "FLAG":
            if value & 7 < len(ds.FLAG_BITS):
                verb = "sets" if value & 8 else "clears"
                yield BITS, f"FLAG {verb} {ds.FLAG_BITS[value & 7].name}"
        elif name == "EXCEPTION":
            for part, shift in ds.EXCEPTIONS:
                yield BITS, f"EXCEPTION {part}={ds.ACTIONS[value >> shift & 3]}"
        elif name == "MODE":
            yield MODES, ds.MODES[min(value, 3)]
        else:
            yield from bit_keys(BITS, name, _CONTROL.get(name, ()), value)
