"""LM628/LM629: what a host can exercise."""

from collections.abc import Iterator
from typing import Final

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.packets import STATUS, Packet
from vbus.chips.tables import Bit
from vbus.views.coverage.tables import (
    BITS,
    COMMANDS,
    FLAGS,
    MODES,
    Exercises,
    Item,
    Key,
    bit_items,
    bit_keys,
    first_word,
)

_CONTROL_WORDS: Final[dict[str, tuple[tuple[Bit, ...], str]]] = {
    "LTRJ": (ds.TRAJECTORY, "LM-TRJ-1"),
    "LFIL": (ds.FILTER, "LM-PID-1"),
    "MSKI": (tuple(bit for bit in ds.STATUS if bit.mask & ds.INTERRUPTS), "LM-CMD-17"),
    "RSTI": (tuple(bit for bit in ds.STATUS if bit.mask & ds.INTERRUPTS), "LM-CMD-18"),
}
"""LM62x commands whose first word is made of bits. RSTI acts by those that are 0."""


class Lm628Exercises(Exercises):
    """Commands, bits of control words, modes and flags."""

    def items(self) -> Iterator[Item]:
        """Give what the tables have, and the words."""
        yield from super().items()
        yield Item(COMMANDS, "RDSTAT", "LM-CMD-23", "Read status byte")
        for word, (bits, clause) in _CONTROL_WORDS.items():
            yield from bit_items(BITS, word, bits, clause)
        yield Item(MODES, "position mode", "LM-TRJ-12", "LTRJ without bit 11")
        yield Item(MODES, "velocity mode", "LM-TRJ-13", "LTRJ with bit 11")
        yield from bit_items(FLAGS, "status", ds.STATUS, "LM-CMD-23")
        rest = tuple(bit for bit in ds.SIGNALS if bit not in ds.STATUS)
        yield from bit_items(FLAGS, "signals", rest, "LM-STA-2")

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give what one packet exercises."""
        yield from super().exercised(packet)
        if packet.kind == STATUS:
            yield COMMANDS, packet.name
            yield from bit_keys(FLAGS, "status", ds.STATUS, packet.cycles[0].data)
            return
        if packet.name == "RDSIGS":
            rest = (bit for bit in ds.SIGNALS if bit not in ds.STATUS)
            yield from bit_keys(FLAGS, "signals", rest, first_word(packet))
        elif packet.name in _CONTROL_WORDS:
            value = first_word(packet)
            if packet.name == "LTRJ":
                yield MODES, f"{'velocity' if value & ds.VELOCITY_MODE else 'position'} mode"
            elif packet.name == "RSTI":
                value = ~value
            yield from bit_keys(BITS, packet.name, _CONTROL_WORDS[packet.name][0], value)
