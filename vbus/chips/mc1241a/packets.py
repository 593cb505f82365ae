"""MC1241A/MC1141A: bus cycles to packets."""

from collections.abc import Mapping
from typing import Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.packets import (
    CUT,
    STATUS,
    UNEXPECTED,
    UNKNOWN,
    WHOLE,
    CommandPackets,
    Cycle,
    Packet,
    flags,
)
from vbus.chips.tables import Command

_EVENTS: Final = tuple(bit for bit in ds.STATUS_BITS if 1 << bit.number & ds.EVENTS)
_SETS: Final = {"SET_INTRPT_MASK", "GET_INTRPT_MASK"}
_RESETS: Final = {"RST_INTRPT", "RST_STATUS"}
_STATUS: Final = {"SET_1", "SET_2", "SET_I", "GET_STATUS", "GET_INTRPT"}
_HEX: Final = {"SET_LMT_SENSE", "GET_LMT_SWTCH", "GET_HOME", "GET_PHASE_INFO", "MULTI_UPDATE"}
_PARTS: Final = ("00", "01", "31", "41", "51", "5", "6", "7")


class Mc1241aDecoder(CommandPackets):
    """Commands with their words, and checksums (PMD-PKT-1)."""

    FAMILY = ds.FAMILY
    WORDS = {"status": 16, "mode": 16, "version": 16, "adapter": 8}
    SETTINGS = ("family_codes",)
    NAMES = ("adapter status", "adapter reset", "checksum")
    LOST = frozenset({"mc1241a.not-ready"})
    APART = frozenset({STATUS})
    COMMANDS = ds.COMMANDS
    COMMAND_PORT = ds.COMMAND_PORT
    DATA_PORT = ds.DATA_PORT
    CUT_SHORT = "PMD-BUS-10"
    UNWANTED = "PMD-BUS-11"

    def __init__(self) -> None:
        super().__init__()
        self._checksum: int = -1
        self._tail: list[Cycle] = []
        self._family_codes: bool = False

    def configure(self, settings: Mapping[str, object]) -> None:
        """Take what the codes of the family's servo chips do (PMD-PKT-6)."""
        self._family_codes = settings.get("family_codes") == "noop"

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        if cycle.address == ds.DATA_PORT:
            tail = self.row is None and not cycle.write
            return self._read_behind(cycle) if tail else self.data(cycle)
        if not cycle.write:
            values = self.show_word("adapter", cycle.data)
            return [Packet(STATUS, "adapter status", values, "PMD-BUS-12", (cycle,))]
        packets = self.finish()
        if cycle.address == ds.RESET_PORT:
            self.last, self._checksum = "reset", -1
            return [*packets, Packet(WHOLE, "adapter reset", "", "PMD-BUS-12", (cycle,))]
        return packets + self._command(cycle)

    def _command(self, cycle: Cycle) -> list[Packet]:
        code = cycle.data
        row = ds.COMMANDS.at(code)
        family = ds.FAMILY_CODES.get(code)
        if row is None and self._family_codes and family is not None:
            name, writes, reads = family
            row = Command(name, code, writes, reads, clause="PMD-PKT-6")
        if row is not None:
            return self.begin(row, cycle)
        self.last = f"{code:02X}H"
        if code == ds.RESERVED_CODE:
            self._checksum = code
            return [Packet(UNKNOWN, f"reserved command {code:02X}H", "", "PMD-PKT-5", (cycle,))]
        self._checksum = 0
        name = f"illegal command {code:02X}H"
        if family is not None:
            name += f" ({family[0]} of the servo chips)"
        clause = "PMD-PKT-4" if code in ds.ILLEGAL_CODES else "PMD-PKT-6"
        return [Packet(UNKNOWN, name, "", clause, (cycle,))]

    def _read_behind(self, cycle: Cycle) -> list[Packet]:
        """Take a byte that is read behind a packet: half of its checksum, if it has one."""
        self._tail.append(cycle)
        if len(self._tail) < 2:
            return []
        word = self._tail[0].data << 8 | self._tail[1].data
        cycles = tuple(self._tail)
        self._tail = []
        if self._checksum < 0:
            return [Packet(UNEXPECTED, f"read of {word:04X}H", "", self.UNWANTED, cycles)]
        if word != self._checksum:
            values = f"{word:04X}H wrong, {self._checksum:04X}H belongs to {self.last}"
        elif word == 0 and self._checksum == 0:
            values = f"0000H: {self.last} is illegal"
        else:
            values = f"{word:04X}H right"
        return [Packet(WHOLE, "checksum", values, "PMD-PKT-2", cycles)]

    def done(self, row: Command) -> None:
        """A packet is whole: its checksum may be read."""
        self._checksum = (row.code + sum(self.words)) & 0xFFFF
        self.last = row.name

    def finish(self) -> list[Packet]:
        """Return what is still open: it was cut short (PMD-BUS-10)."""
        packets: list[Packet] = []
        if self._tail:
            what = f"first byte of a word, {self._tail[0].data:02X}H"
            packets.append(Packet(CUT, what, "", "PMD-BUS-5", tuple(self._tail)))
            self._tail = []
        row = self.row
        packets += super().finish()
        if row is not None:
            self.last, self._checksum = row.name, -1
        return packets

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the packet that is open, if one is."""
        return self._tail[-1].when if self._tail else super().unfinished()

    # -- values -------------------------------------------------------------------------------

    def values(self, row: Command, words: list[int]) -> str:
        """Return the words of a packet as people read them."""
        name = row.name
        if name in _STATUS:
            return self.show_word("status", words[0])
        if name == "GET_MODE":
            return self.show_word("mode", words[0])
        if name == "GET_VRSN":
            return self.show_word("version", words[0])
        if name in _SETS:
            return f"enables {flags(words[0], _EVENTS)}"
        if name in _RESETS:
            return f"resets {flags(~words[0] & ds.EVENTS, _EVENTS)}"
        if name in _HEX:
            return f"{words[0]:04X}H"
        if name == "GET_OUTPUT_MODE":
            modes = {ds.OUTPUT_PWM: "PWM", ds.OUTPUT_DAC16: "DAC16"}
            return modes.get(words[0], f"{words[0]:04X}H")
        return super().values(row, words)

    def show_word(self, name: str, value: int) -> str:
        """Explain a status, mode or version word, or an adapter's status byte."""
        if name == "adapter":
            ready = "ready" if value & ds.STATUS_READY else "busy"
            interrupt = "" if value & ds.STATUS_NO_INTERRUPT else " interrupt"
            return f"{value:02X}H {ready}{interrupt}"
        if name == "status":
            axis = (value >> ds.AXIS_SHIFT & 3) + 1
            rest = tuple(bit for bit in ds.STATUS_BITS if bit.number < ds.AXIS_SHIFT)
            return f"{value:04X}H axis {axis}: {flags(value, rest)}"
        if name == "mode":
            profile = ds.PROFILES[value >> ds.PROFILE_SHIFT & 3]
            phase = value >> ds.PHASE_SHIFT & 7
            rest = tuple(bit for bit in ds.MODE_BITS if bit.number < ds.PROFILE_SHIFT)
            return f"{value:04X}H {profile} phase {phase}: {flags(value, rest)}"
        part = _PARTS[value >> 8 & 7]
        axes = (value >> 11 & 7) + 1
        version = f"{value >> 3 & 3}.{value & 7}"
        dash = f" dash {value >> 5 & 7}" if value >> 5 & 7 else ""
        return (
            f"{value:04X}H generation {value >> 14}, {axes} axes, part {part}{dash},"
            f" version {version}"
        )
