"""LM628/LM629: what a host can exercise."""

from collections.abc import Iterator
from typing import Final

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.packets import STATUS, Packet
from vbus.views.coverage.tables import (
    BITS,
    COMMANDS,
    FLAGS,
    MODES,
    Exercises,
    Item,
    Key,
    Word,
    first_value,
)

_ENABLED: Final = tuple(bit for bit in ds.STATUS if bit.mask & ds.INTERRUPTS)


class Lm628Exercises(Exercises):
    """Commands, bits of control words, modes and flags."""

    WORDS = (
        Word(BITS, "LTRJ", ds.TRAJECTORY, "LM-TRJ-1", ("LTRJ",)),
        Word(BITS, "LFIL", ds.FILTER, "LM-PID-1", ("LFIL",)),
        Word(BITS, "MSKI", _ENABLED, "LM-CMD-17", ("MSKI",)),
        Word(BITS, "RSTI", _ENABLED, "LM-CMD-18", ("RSTI",), zeros=True),
        Word(FLAGS, "status", ds.STATUS, "LM-CMD-23", ("RDSTAT",)),
        Word(FLAGS, "signals", tuple(bit for bit in ds.SIGNALS if bit not in ds.STATUS),
             "LM-STA-2", ("RDSIGS",)),
    )  # fmt: skip

    def items(self) -> Iterator[Item]:
        """Give what the tables have, and modes."""
        yield from super().items()
        yield Item(COMMANDS, "RDSTAT", "LM-CMD-23", "Read status byte")
        yield Item(MODES, "position mode", "LM-TRJ-12", "LTRJ without bit 11")
        yield Item(MODES, "velocity mode", "LM-TRJ-13", "LTRJ with bit 11")

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give what one packet exercises."""
        yield from super().exercised(packet)
        if packet.kind == STATUS:
            yield COMMANDS, packet.name
        elif packet.name == "LTRJ":
            velocity = first_value(packet) & ds.VELOCITY_MODE
            yield MODES, f"{'velocity' if velocity else 'position'} mode"
