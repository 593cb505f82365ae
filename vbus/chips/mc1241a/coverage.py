"""MC1241A/MC1141A: what a host can exercise."""

from collections.abc import Iterator
from typing import Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.packets import Packet
from vbus.views.coverage.tables import (
    ANSWERS,
    BITS,
    FLAGS,
    MODES,
    Exercises,
    Item,
    Key,
    bit_items,
    bit_keys,
    first_word,
)

_STATUS_COMMANDS: Final = frozenset(
    ("SET_1", "SET_2", "SET_I", "GET_STATUS", "GET_INTRPT"),
)
_PMD_STATUS: Final = tuple(bit for bit in ds.STATUS_BITS if bit.number < ds.AXIS_SHIFT)
_PMD_MODE: Final = tuple(bit for bit in ds.MODE_BITS if bit.number < ds.PROFILE_SHIFT)
_PMD_EVENTS: Final = tuple(bit for bit in ds.STATUS_BITS if bit.mask & ds.EVENTS)
_SETS_PROFILE: Final = {
    row.name: ds.PROFILES[row.value]
    for row in ds.COMMANDS
    if row.hook == "set_profile" and row.value is not None
}


class Mc1241aExercises(Exercises):
    """Commands, events, modes, flags and checksums."""

    def items(self) -> Iterator[Item]:
        """Give what the tables have, and the words."""
        yield from super().items()
        yield from bit_items(BITS, "SET_INTRPT_MASK", _PMD_EVENTS, "PMD-STA-1")
        for name in ds.PROFILES:
            yield Item(MODES, name, "PMD-STA-5", "profile mode, set or read by GET_MODE")
        yield from bit_items(FLAGS, "status", _PMD_STATUS, "PMD-STA-1")
        yield from bit_items(FLAGS, "mode", _PMD_MODE, "PMD-STA-5")
        yield Item(ANSWERS, "checksum right", "PMD-PKT-2", "read after a packet")
        yield Item(ANSWERS, "checksum wrong", "PMD-PKT-2", "another one than the packet's")
        yield Item(ANSWERS, "checksum 0", "PMD-PKT-4", "after an illegal command")

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give what one packet exercises."""
        yield from super().exercised(packet)
        name = packet.name
        if name == "checksum":
            yield ANSWERS, f"checksum {_verdict(packet.values)}"
            return
        if name in _SETS_PROFILE:
            yield MODES, _SETS_PROFILE[name]
        if len(packet.cycles) < 3:
            return
        value = first_word(packet)
        if name in _STATUS_COMMANDS:
            yield from bit_keys(FLAGS, "status", _PMD_STATUS, value)
        elif name == "GET_MODE":
            yield MODES, ds.PROFILES[value >> ds.PROFILE_SHIFT & 3]
            yield from bit_keys(FLAGS, "mode", _PMD_MODE, value)
        elif name == "SET_INTRPT_MASK":
            yield from bit_keys(BITS, name, _PMD_EVENTS, value)


def _verdict(values: str) -> str:
    if " wrong" in values:
        return "wrong"
    return "right" if values.endswith(" right") else "0"
