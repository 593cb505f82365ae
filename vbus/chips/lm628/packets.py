"""LM628/LM629: bus cycles to packets."""

from functools import cache
from typing import Final

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.packets import (
    STATUS,
    UNKNOWN,
    CommandPackets,
    Cycle,
    Packet,
    flags,
    number,
    signed,
)
from vbus.chips.tables import Command

_TRAJECTORY_FLAGS: Final = tuple(bit for bit in ds.TRAJECTORY if bit.number >= 8)


@cache
def _status(byte: int) -> str:
    """Return a status as people read it; it is what drivers poll."""
    return f"{byte:02X}H {flags(byte, ds.STATUS)}"


class Lm628Decoder(CommandPackets):
    """Status reads, and commands with their words (LM-BUS-1, LM-BUS-6)."""

    FAMILY = ds.FAMILY
    WORDS = {"status": 8, "signals": 16}
    NAMES = ("RDSTAT",)
    LOST = frozenset({"lm628.busy-write", "lm628.busy-read", "lm628.reset-write"})
    APART = frozenset({STATUS})
    COMMANDS = ds.COMMANDS
    COMMAND_PORT = ds.COMMAND_PORT
    DATA_PORT = ds.DATA_PORT
    CUT_SHORT = "LM-BUS-11"
    DROPPED = ", byte {:02X}H dropped"
    UNWANTED = "LM-BUS-12"

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        if cycle.address == ds.DATA_PORT:
            return self.data(cycle)
        if not cycle.write:
            return [Packet(STATUS, "RDSTAT", _status(cycle.data), "LM-CMD-23", (cycle,))]
        packets = self.finish()
        row = ds.COMMANDS.at(cycle.data)
        if row is not None:
            return packets + self.begin(row, cycle)
        self.last = f"undefined command {cycle.data:02X}H"
        return [*packets, Packet(UNKNOWN, self.last, "", "LM-BUS-13", (cycle,))]

    def words_of(self, row: Command, control: int) -> int:
        """Return how many words a packet has whose first one is ``control``."""
        if row.name == "LTRJ":
            return 1 + sum(2 for bit in ds.LOADS if control & bit)
        return 1 + sum(1 for bit in ds.FILTER if control & bit.mask)

    def values(self, row: Command, words: list[int]) -> str:
        """Return the words of a packet as people read them."""
        if row.name == "LTRJ":
            return _trajectory(words)
        if row.name == "LFIL":
            return _filter(words)
        if row.name == "RDSIGS":
            return self.show_word("signals", words[0])
        if row.name == "MSKI":
            return f"enables {flags(words[0] & ds.INTERRUPTS, ds.STATUS)}"
        if row.name == "RSTI":
            return f"resets {flags(~words[0] & ds.INTERRUPTS, ds.STATUS)}"
        return super().values(row, words)

    def show_word(self, name: str, value: int) -> str:
        """Explain a status byte or a signals word."""
        if name == "status":
            return f"{value:02X}H {flags(value, ds.STATUS)}"
        return f"{value:04X}H {flags(value, ds.SIGNALS)}"


def _trajectory(words: list[int]) -> str:
    control = words[0]
    values: list[str] = []
    place = 1
    for name, bit, unit in zip(
        ("acc", "vel", "pos"), ds.LOADS, ("cnt/sample/sample", "cnt/sample", ""), strict=True
    ):
        if control & bit:
            raw = signed(words[place] << 16 | words[place + 1], 32)
            place += 2
            relative = bool(control & bit >> 1)
            text = number(raw, 0 if name == "pos" else 16, relative or name == "pos")
            values.append(f"{name}={text}{' ' + unit if unit else ''}{' rel' * relative}")
    values.reverse()
    named = flags(control, _TRAJECTORY_FLAGS)
    if named != "-":
        values.append(named)
    return " ".join(values) or "nothing loaded"


def _filter(words: list[int]) -> str:
    control = words[0]
    values: list[str] = []
    place = 1
    for bit in ds.FILTER:
        if control & bit.mask:
            values.append(f"{bit.name[-2:].lower()}={words[place]}")
            place += 1
    values.append(f"ds={(control >> 8) + 1} samples")
    return " ".join(values)
