# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/chips/mcp1200/packets.py; change that, or the generator.
"""MCP-1200: bus cycles to accesses of whole registers."""

from typing import Final

from . import tables as ds
from .tables import Register
from .packets import (
    CUT,
    STATUS,
    UNKNOWN,
    WHOLE,
    Cycle,
    Decoder,
    Packet,
    flags,
    number,
    signed,
)

_BITS: Final = {
    "FEATURE": ds.FEATURE_BITS,
    "CONFIG": ds.CONFIG_BITS,
    "CAPTURE_CONTROL": ds.CAPTURE_BITS,
    "STATUS": ds.STATUS_BITS,
}
_MODES: Final = {0: "soft reset", 1: "idle", 2: "halt motion", 3: "control"}
_ACTIONS: Final = ("report", "idle", "decelerate", "abrupt")
_COMPATIBLE: Final = 0x3F
_PATIENCE: Final = 1000
"""Bus cycles after which the other bytes of a register are not waited for any more."""


class Mcp1200Packets(Decoder):
    """Bytes of registers; a register of several bytes is a packet once all of them have moved.

    One of which only some have moved is told a thousand bus cycles later, or at the end.

    Whether addresses have six or seven bits is taken from the last write to the configuration
    register (MCP-BUS-9); until one is seen, six, as after reset.
    """

    FAMILY = ds.FAMILY
    WORDS = {"status": 8, "flag": 8, "feature": 8, "config": 8, "capture": 8, "exception": 8}

    def __init__(self) -> None:
        self._extended: bool = False
        self._open: dict[tuple[str, bool], dict[int, Cycle]] = {}
        """Registers of which some bytes have moved; the one whose last byte is oldest first."""
        self._moved: dict[tuple[str, bool], int] = {}
        """Bus cycle in which the last byte of each of them moved."""
        self._count: int = 0

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        self._count += 1
        return [*self._given_up(), *self._taken(cycle)]

    def _given_up(self) -> list[Packet]:
        for key, moved in self._moved.items():
            if self._count - moved < _PATIENCE:
                break
            del self._moved[key]
            return [_partial(ds.REGISTERS[key[0]], self._open.pop(key))]
        return []

    def _taken(self, cycle: Cycle) -> list[Packet]:
        address = cycle.address if self._extended else cycle.address & _COMPATIBLE
        row = ds.REGISTERS.at(address)
        way = "write" if cycle.write else "read"
        if row is None:
            what = f"{way} {address:02X}H, which is no register"
            return [Packet(UNKNOWN, what, f"{cycle.data:02X}H", "MCP-BUS-10", (cycle,))]
        if cycle.write and address == ds.CONFIG:
            self._extended = bool(cycle.data & ds.EXTENDED)
        if len(row.addresses) == 1:
            kind = STATUS if row.name == "STATUS" and not cycle.write else WHOLE
            name = f"{way} {row.name}"
            return [Packet(kind, name, _value(row, cycle.data, cycle.write), row.clause, (cycle,))]
        key = (row.name, cycle.write)
        seen = self._open.pop(key, {})
        self._moved.pop(key, 0)
        packets: list[Packet] = []
        if address in seen:
            packets.append(_partial(row, seen))
            seen = {}
        seen[address] = cycle
        if len(seen) < len(row.addresses):
            self._open[key] = seen
            self._moved[key] = self._count
        else:
            value = 0
            for place in row.addresses:
                value = value << 8 | seen[place].data
            cycles = tuple(seen.values())
            text = _value(row, value, cycle.write)
            packets.append(Packet(WHOLE, f"{way} {row.name}", text, row.clause, cycles))
        return packets

    def finish(self) -> list[Packet]:
        """Return the registers of which only some bytes have moved."""
        packets = [_partial(ds.REGISTERS[name], seen) for (name, _), seen in self._open.items()]
        self._open = {}
        self._moved = {}
        return packets

    def unfinished(self) -> int | None:
        """Return the instant of the oldest last byte of a register that is open, if one is."""
        for seen in self._open.values():
            return next(reversed(seen.values())).when
        return None

    def show_word(self, name: str, value: int) -> str:
        """Explain a control register's byte as it reads."""
        known = {"capture": "CAPTURE_CONTROL"}.get(name, name.upper())
        return _value(ds.REGISTERS[known], value, False)

    def typed(self, data: list[int]) -> list[Cycle]:
        """Read pairs of address and byte written."""
        if len(data) % 2:
            raise ValueError(
                "write pairs of address and data byte; the last address has no data byte"
            )
        pairs = zip(data[::2], data[1::2], strict=True)
        return [Cycle(0, True, address & 0x7F, byte) for address, byte in pairs]


def _partial(row: Register, seen: dict[int, Cycle]) -> Packet:
    cycles = tuple(seen.values())
    way = "write" if cycles[0].write else "read"
    values = " ".join(f"{address:02X}H={cycle.data:02X}H" for address, cycle in seen.items())
    missing = len(row.addresses) - len(seen)
    text = f"{values}, {missing} of {len(row.addresses)} bytes not touched"
    return Packet(CUT, f"{way} {row.name}", text, row.clause, cycles)


def _value(row: Register, value: int, write: bool) -> str:
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
    if row.signed:
        return number(signed(value, row.bits), row.fraction, True)
    if row.fraction or row.bits > 8:
        return number(value, row.fraction)
    return f"{value:02X}H ({value})"
