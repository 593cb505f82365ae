"""MC1241A/MC1141A: bus cycles to packets."""

from collections.abc import Mapping
from typing import Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.tables import Command
from vbus.trace.packets import (
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

_EVENTS: Final = tuple(bit for bit in ds.STATUS_BITS if 1 << bit.number & ds.EVENTS)
_SETS: Final = {"SET_INTRPT_MASK", "GET_INTRPT_MASK"}
_RESETS: Final = {"RST_INTRPT", "RST_STATUS"}
_STATUS: Final = {"SET_1", "SET_2", "SET_I", "GET_STATUS", "GET_INTRPT"}
_HEX: Final = {"SET_LMT_SENSE", "GET_LMT_SWTCH", "GET_HOME", "GET_PHASE_INFO", "MULTI_UPDATE"}
_TARGETS: Final = {"SET_POS", "GET_POS", "GET_TRGT_POS"}
_COUNTS: Final = {"GET_ACTL_POS", "GET_CAPT", "SET_POS_ERR", "GET_POS_ERR", "GET_ACTL_POS_ERR"}
_PROFILES: Final = ("trapezoidal", "velocity", "S-curve", "gear")
_PARTS: Final = ("00", "01", "31", "41", "51", "5", "6", "7")


class Mc1241aPackets(Decoder):
    """Commands with their words, and checksums (PMD-PKT-1)."""

    FAMILY = ds.FAMILY
    WORDS = {"status": 16, "mode": 16, "version": 16, "adapter": 8}
    SETTINGS = ("family_codes",)
    LOST = frozenset({"mc1241a.not-ready"})

    def __init__(self) -> None:
        self._row: Command | None = None
        self._words: list[int] = []
        self._half: int = -1
        self._cycles: list[Cycle] = []
        self._last: str = ""
        self._checksum: int = -1
        self._tail: list[Cycle] = []
        self._family_codes: bool = False

    def configure(self, settings: Mapping[str, object]) -> None:
        """Take what the codes of the family's servo chips do (PMD-PKT-6)."""
        self._family_codes = settings.get("family_codes") == "noop"

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        if cycle.address == ds.DATA_PORT:
            return self._data(cycle)
        if not cycle.write:
            values = self.show_word("adapter", cycle.data)
            return [Packet(STATUS, "adapter status", values, "PMD-BUS-12", (cycle,))]
        packets = self.finish()
        if cycle.address == ds.RESET_PORT:
            self._last, self._checksum = "reset", -1
            return [*packets, Packet(WHOLE, "adapter reset", "", "PMD-BUS-12", (cycle,))]
        return packets + self._command(cycle)

    def _command(self, cycle: Cycle) -> list[Packet]:
        code = cycle.data
        row = ds.COMMANDS.by_code(code)
        if row is None and self._family_codes and code in ds.FAMILY_CODES:
            name, writes, reads = ds.FAMILY_CODES[code]
            row = Command(name, code, writes, reads, clause="PMD-PKT-6")
        if row is not None:
            self._row = row
            self._cycles = [cycle]
            return self._complete()
        self._last = f"{code:02X}H"
        if code == ds.RESERVED_CODE:
            self._checksum = code
            return [Packet(UNKNOWN, f"reserved command {code:02X}H", "", "PMD-PKT-5", (cycle,))]
        self._checksum = 0
        name = f"illegal command {code:02X}H"
        family = ds.FAMILY_CODES.get(code)
        if family is not None:
            name += f" ({family[0]} of the servo chips)"
        clause = "PMD-PKT-4" if code in ds.ILLEGAL_CODES else "PMD-PKT-6"
        return [Packet(UNKNOWN, name, "", clause, (cycle,))]

    def _data(self, cycle: Cycle) -> list[Packet]:
        row = self._row
        if row is not None:
            if cycle.write == bool(row.write):
                self._cycles.append(cycle)
                if self._half < 0:
                    self._half = cycle.data
                    return []
                self._words.append(self._half << 8 | cycle.data)
                self._half = -1
                return self._complete()
            way = "write" if cycle.write else "read"
            what = f"data {way} of {cycle.data:02X}H inside {row.name}"
            return [Packet(UNEXPECTED, what, "", "PMD-BUS-11", (cycle,))]
        if cycle.write:
            what = f"data write of {cycle.data:02X}H after {self._last or 'no command'}"
            return [Packet(UNEXPECTED, what, "", "PMD-BUS-11", (cycle,))]
        self._tail.append(cycle)
        if len(self._tail) < 2:
            return []
        word = self._tail[0].data << 8 | self._tail[1].data
        cycles = tuple(self._tail)
        self._tail = []
        if self._checksum < 0:
            return [Packet(UNEXPECTED, f"read of {word:04X}H", "", "PMD-BUS-11", cycles)]
        if word != self._checksum:
            values = f"{word:04X}H wrong, {self._checksum:04X}H belongs to {self._last}"
        elif word == 0 and self._checksum == 0:
            values = f"0000H: {self._last} is illegal"
        else:
            values = f"{word:04X}H right"
        return [Packet(WHOLE, "checksum", values, "PMD-PKT-2", cycles)]

    def _complete(self) -> list[Packet]:
        row = self._row
        if row is None or len(self._words) < row.write + row.read:
            return []
        packet = Packet(WHOLE, row.name, self._values(row), row.clause, tuple(self._cycles))
        self._checksum = (row.code + sum(self._words)) & 0xFFFF
        self._last = row.name
        self._forget()
        return [packet]

    def _forget(self) -> None:
        self._row = None
        self._words = []
        self._half = -1
        self._cycles = []

    def finish(self) -> list[Packet]:
        """Return what is still open: it was cut short (PMD-BUS-10)."""
        packets: list[Packet] = []
        if self._tail:
            what = f"first byte of a word, {self._tail[0].data:02X}H"
            packets.append(Packet(CUT, what, "", "PMD-BUS-5", tuple(self._tail)))
            self._tail = []
        row = self._row
        if row is not None:
            have = f"{len(self._words)} of {row.write + row.read} words"
            packets.append(
                Packet(CUT, row.name, f"cut after {have}", "PMD-BUS-10", tuple(self._cycles))
            )
            self._last, self._checksum = row.name, -1
            self._forget()
        return packets

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the packet that is open, if one is."""
        cycles = self._cycles or self._tail
        return cycles[-1].when if cycles else None

    # -- values -------------------------------------------------------------------------------

    def _values(self, row: Command) -> str:
        words = self._words
        if not words:
            return ""
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
        value = 0
        for word in words:
            value = value << 16 | word
        if row.signed:
            value = signed(value, 16 * len(words))
        unit = _unit(name)
        return number(value, row.fraction, row.signed) + (f" {unit}" if unit else "")

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
            profile = _PROFILES[value >> ds.PROFILE_SHIFT & 3]
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

    def typed(self, data: list[int]) -> list[Cycle]:
        """Read a command byte, then as many data bytes as it takes, and so on."""
        cycles: list[Cycle] = []
        need = 0
        write = True
        for byte in data:
            if not need:
                row = ds.COMMANDS.by_code(byte)
                need = 2 * (row.write + row.read) if row else 0
                write = row is not None and bool(row.write)
                cycles.append(Cycle(0, True, ds.COMMAND_PORT, byte))
            else:
                cycles.append(Cycle(0, write, ds.DATA_PORT, byte))
                need -= 1
        return cycles


def _unit(name: str) -> str:
    """Return the unit of a command's value, as the manual has it.

    Targets are microsteps; the encoder's positions, and errors against it, are counts. A
    breakpoint's value is either or cycles, and SET_ACTL_POS gives both positions a number.
    """
    if "JERK" in name:
        return "ustep/cycle/cycle/cycle"
    if "ACC" in name:
        return "ustep/cycle/cycle"
    if "VEL" in name:
        return "ustep/cycle"
    if "RATIO" in name:
        return "cnt/ustep" if "STEP" in name else "ustep/cnt"
    if name in _TARGETS:
        return "ustep"
    if name in _COUNTS:
        return "cnt"
    return "cycles" if name == "GET_TIME" else ""
