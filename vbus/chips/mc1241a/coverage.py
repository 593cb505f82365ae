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
    Word,
    first_value,
)

_SETS_PROFILE: Final = {
    row.name: ds.PROFILES[row.value]
    for row in ds.COMMANDS
    if row.hook == "set_profile" and row.value is not None
}


class Mc1241aExercises(Exercises):
    """Commands, events, modes, flags and checksums."""

    WORDS = (
        Word(BITS, "SET_INTRPT_MASK", tuple(bit for bit in ds.STATUS_BITS if bit.mask & ds.EVENTS),
             "PMD-STA-1", ("SET_INTRPT_MASK",)),
        Word(FLAGS, "status", tuple(bit for bit in ds.STATUS_BITS if bit.number < ds.AXIS_SHIFT),
             "PMD-STA-1", ("SET_1", "SET_2", "SET_I", "GET_STATUS", "GET_INTRPT")),
        Word(FLAGS, "mode", tuple(bit for bit in ds.MODE_BITS if bit.number < ds.PROFILE_SHIFT),
             "PMD-STA-5", ("GET_MODE",)),
    )  # fmt: skip

    def items(self) -> Iterator[Item]:
        """Give what the tables have, modes, and checksums."""
        yield from super().items()
        for name in ds.PROFILES:
            yield Item(MODES, name, "PMD-STA-5", "profile mode, set or read by GET_MODE")
        yield Item(ANSWERS, "checksum right", "PMD-PKT-2", "read after a packet")
        yield Item(ANSWERS, "checksum wrong", "PMD-PKT-2", "another one than the packet's")
        yield Item(ANSWERS, "checksum 0", "PMD-PKT-4", "after an illegal command")

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give what one packet exercises."""
        yield from super().exercised(packet)
        name = packet.name
        if name == "checksum":
            yield ANSWERS, f"checksum {_verdict(packet.values)}"
        elif name in _SETS_PROFILE:
            yield MODES, _SETS_PROFILE[name]
        elif name == "GET_MODE":
            yield MODES, ds.PROFILES[first_value(packet) >> ds.PROFILE_SHIFT & 3]


def _verdict(values: str) -> str:
    if " wrong" in values:
        return "wrong"
    return "right" if values.endswith(" right") else "0"
