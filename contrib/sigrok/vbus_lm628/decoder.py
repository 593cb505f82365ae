# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/chips/lm628/packets.py; change that, or the generator.
"""LM628/LM629: bus cycles to packets."""

from typing import Final

from . import tables as ds
from .tables import Command
from .packets import (
    CUT,
    STATUS,
    UNEXPECTED,
    UNKNOWN,
    WHOLE,
    Cycle,
    Decoder,
    Packet,
    flags,
    number,
    signed,
)

_TRAJECTORY_FLAGS: Final = tuple(bit for bit in ds.TRAJECTORY if bit.number >= 8)
_COUNTS: Final = {"SBPA", "SBPR", "RDIP", "RDDP", "RDRP", "LPEI", "LPES"}


class Lm628Packets(Decoder):
    """Status reads, and commands with their words (LM-BUS-1, LM-BUS-6)."""

    FAMILY = ds.FAMILY
    WORDS = {"status": 8, "signals": 16}
    LOST = frozenset({"lm628.busy-write", "lm628.busy-read", "lm628.reset-write"})

    def __init__(self) -> None:
        self._row: Command | None = None
        self._done: str = ""
        self._need: int = 0
        self._words: list[int] = []
        self._half: int = -1
        self._cycles: list[Cycle] = []

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        if cycle.address == ds.DATA_PORT:
            return self._data(cycle)
        if cycle.write:
            return self._command(cycle)
        text = f"{cycle.data:02X}H {flags(cycle.data, ds.STATUS)}"
        return [Packet(STATUS, "RDSTAT", text, "LM-CMD-23", (cycle,))]

    def _command(self, cycle: Cycle) -> list[Packet]:
        packets = self.finish()
        row = ds.COMMANDS.by_code(cycle.data)
        if row is None:
            self._done = f"undefined command {cycle.data:02X}H"
            return [*packets, Packet(UNKNOWN, self._done, "", "LM-BUS-13", (cycle,))]
        self._row = row
        self._need = row.write or row.read
        self._cycles = [cycle]
        return packets + self._complete()

    def _data(self, cycle: Cycle) -> list[Packet]:
        row = self._row
        way = "write" if cycle.write else "read"
        if row is None or cycle.write != bool(row.write):
            after = f"inside {row.name}" if row else f"after {self._done or 'no command'}"
            what = f"data {way} of {cycle.data:02X}H {after}"
            return [Packet(UNEXPECTED, what, "", "LM-BUS-12", (cycle,))]
        self._cycles.append(cycle)
        if self._half < 0:
            self._half = cycle.data
            return []
        self._words.append(self._half << 8 | cycle.data)
        self._half = -1
        if len(self._words) == 1 and row.up_to:
            self._need = _words_of(row, self._words[0])
        return self._complete()

    def _complete(self) -> list[Packet]:
        row = self._row
        if row is None or len(self._words) < self._need:
            return []
        packet = Packet(WHOLE, row.name, self._values(row), row.clause, tuple(self._cycles))
        self._done = f"the end of {row.name}"
        self._forget()
        return [packet]

    def _forget(self) -> None:
        self._row = None
        self._words = []
        self._half = -1
        self._cycles = []

    def finish(self) -> list[Packet]:
        """Return the packet that is still open: it was cut short (LM-BUS-11)."""
        row = self._row
        if row is None:
            return []
        have = f"{len(self._words)} of {self._need} words"
        odd = f", byte {self._half:02X}H dropped" if self._half >= 0 else ""
        packet = Packet(CUT, row.name, f"cut after {have}{odd}", "LM-BUS-11", tuple(self._cycles))
        self._done = f"{row.name}, cut short"
        self._forget()
        return [packet]

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the packet that is open, if one is."""
        return self._cycles[-1].when if self._cycles else None

    # -- values -------------------------------------------------------------------------------

    def _values(self, row: Command) -> str:
        words = self._words
        if not words:
            return ""
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
        value = 0
        for word in words:
            value = value << 16 | word
        if row.signed:
            value = signed(value, 16 * len(words))
        unit = " cnt" if row.name in _COUNTS else " cnt/sample" if row.name[3:] == "V" else ""
        return number(value, row.fraction, row.signed) + unit

    def show_word(self, name: str, value: int) -> str:
        """Explain a status byte or a signals word."""
        if name == "status":
            return f"{value:02X}H {flags(value, ds.STATUS)}"
        return f"{value:04X}H {flags(value, ds.SIGNALS)}"

    def typed(self, data: list[int]) -> list[Cycle]:
        """Read a command byte, then as many data bytes as it takes, and so on."""
        cycles: list[Cycle] = []
        need = 0
        write = True
        row: Command | None = None
        words: list[int] = []
        for byte in data:
            if not need:
                row = ds.COMMANDS.by_code(byte)
                words = []
                write = row is None or not row.read
                need = 2 * (row.write or row.read) if row else 0
                cycles.append(Cycle(0, True, ds.COMMAND_PORT, byte))
                continue
            cycles.append(Cycle(0, write, ds.DATA_PORT, byte))
            words.append(byte)
            need -= 1
            if row and row.up_to and len(words) == 2:
                need = 2 * (_words_of(row, words[0] << 8 | words[1]) - 1)
        return cycles


def _words_of(row: Command, control: int) -> int:
    """Return how many words a packet has whose first one is ``control``."""
    if row.name == "LTRJ":
        return 1 + sum(2 for bit in ds.LOADS if control & bit)
    return 1 + sum(1 for bit in ds.FILTER if control & bit.mask)


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
