"""MCP-1200: what a host can exercise."""

from collections.abc import Iterator

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.packets import Packet
from vbus.chips.tables import Bit
from vbus.views.coverage.tables import BITS, FLAGS, MODES, Exercises, Item, Key, Word


def _word(group: str, way: str, name: str, bits: tuple[Bit, ...]) -> Word:
    return Word(group, name, bits, ds.REGISTERS[name].clause, (f"{way} {name}",))


class Mcp1200Exercises(Exercises):
    """Registers, control bits, modes and flags."""

    WORDS = (
        _word(BITS, "write", "CONFIG", ds.CONFIG_BITS),
        _word(BITS, "write", "FEATURE", ds.FEATURE_BITS),
        _word(BITS, "write", "CAPTURE_CONTROL", ds.CAPTURE_BITS[:-1]),
        _word(FLAGS, "read", "STATUS", ds.STATUS_BITS),
        _word(FLAGS, "read", "FLAG", ds.FLAG_BITS),
        _word(FLAGS, "read", "CAPTURE_CONTROL", ds.CAPTURE_BITS),
    )

    def items(self) -> Iterator[Item]:
        """Give what the tables have, what is done to flags, exceptions and modes."""
        yield from super().items()
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

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give what one packet exercises."""
        yield from super().exercised(packet)
        value = packet.cycles[0].data
        if packet.name == "write FLAG":
            if value & 7 < len(ds.FLAG_BITS):
                verb = "sets" if value & 8 else "clears"
                yield BITS, f"FLAG {verb} {ds.FLAG_BITS[value & 7].name}"
        elif packet.name == "write EXCEPTION":
            for part, shift in ds.EXCEPTIONS:
                yield BITS, f"EXCEPTION {part}={ds.ACTIONS[value >> shift & 3]}"
        elif packet.name == "write MODE":
            yield MODES, ds.MODES[min(value, 3)]
