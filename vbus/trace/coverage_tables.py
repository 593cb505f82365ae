"""What a host can exercise of a chip, from the chip's tables, and what a packet exercises of it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Final

from vbus.chips.lm628 import datasheet as lm628
from vbus.chips.mc1241a import datasheet as mc1241a
from vbus.chips.mcp1200 import datasheet as mcp1200
from vbus.chips.tables import Bit, Register
from vbus.signals import Rule
from vbus.trace.packets import STATUS, WHOLE, Packet
from vbus.trace.tables import ac_rules

COMMANDS: Final = "commands"
READS: Final = "registers read"
WRITES: Final = "registers written"
BITS: Final = "control bits"
MODES: Final = "modes"
FLAGS: Final = "flags seen"
ANSWERS: Final = "error answers"
RULES: Final = "rules broken"
LIMITS: Final = "AC limits broken"

GROUPS: Final = (COMMANDS, READS, WRITES, BITS, MODES, FLAGS, ANSWERS, RULES, LIMITS)
"""In the order of a report."""
COUNTED: Final = GROUPS[:7]
"""What makes up the percentage. Broken rules do not: no driver should aim at them."""

Key = tuple[str, str]
"""Group and name."""


@dataclass(frozen=True, slots=True)
class Item:
    """One thing a host may exercise.

    Attributes:
        group: one of :data:`GROUPS`.
        name: the manual's name for it.
        clause: clause of the specification, or "".
        title: what it is, in a few words.
    """

    group: str
    name: str
    clause: str = ""
    title: str = ""

    @property
    def key(self) -> Key:
        """Group and name."""
        return self.group, self.name


_CONTROL_WORDS: Final[dict[str, tuple[tuple[Bit, ...], str]]] = {
    "LTRJ": (lm628.TRAJECTORY, "LM-TRJ-1"),
    "LFIL": (lm628.FILTER, "LM-PID-1"),
    "MSKI": (tuple(bit for bit in lm628.STATUS if bit.mask & lm628.INTERRUPTS), "LM-CMD-17"),
    "RSTI": (tuple(bit for bit in lm628.STATUS if bit.mask & lm628.INTERRUPTS), "LM-CMD-18"),
}
"""LM62x commands whose first word is made of bits. RSTI acts by those that are 0."""

_STATUS_COMMANDS: Final = frozenset(
    ("SET_1", "SET_2", "SET_I", "GET_STATUS", "GET_INTRPT"),
)
_PMD_STATUS: Final = tuple(bit for bit in mc1241a.STATUS_BITS if bit.number < mc1241a.AXIS_SHIFT)
_PMD_MODE: Final = tuple(bit for bit in mc1241a.MODE_BITS if bit.number < mc1241a.PROFILE_SHIFT)
_PMD_EVENTS: Final = tuple(bit for bit in mc1241a.STATUS_BITS if bit.mask & mc1241a.EVENTS)
_PROFILES: Final = ("trapezoidal", "velocity", "S-curve", "gear")
_SETS_PROFILE: Final = {
    "SET_PRFL_TRAP": "trapezoidal",
    "SET_PRFL_VEL": "velocity",
    "SET_PRFL_S_CRV": "S-curve",
    "SET_PRFL_GEAR": "gear",
}

_MCP_CONTROL: Final = {
    "CONFIG": mcp1200.CONFIG_BITS,
    "FEATURE": mcp1200.FEATURE_BITS,
    "CAPTURE_CONTROL": mcp1200.CAPTURE_BITS[:-1],
}
_MCP_SEEN: Final = {
    "STATUS": mcp1200.STATUS_BITS,
    "FLAG": mcp1200.FLAG_BITS,
    "CAPTURE_CONTROL": mcp1200.CAPTURE_BITS,
}
_MCP_MODES: Final = ("soft reset", "idle", "halt motion", "control")
_ACTIONS: Final = ("report", "idle", "decelerate", "abrupt")
_EXCEPTIONS: Final = (("error", 6), ("breakpoint", 4), ("stop", 2), ("limit", 0))


def _low(bit: Bit) -> bool:
    """Whether a flag says something by being 0."""
    return "active low" in bit.title


def _bits(group: str, word: str, bits: Iterable[Bit], clause: str) -> Iterator[Item]:
    for bit in bits:
        level = "=0" if _low(bit) else ""
        yield Item(group, f"{word} {bit.name}{level}", clause, bit.title)


def _lm628() -> Iterator[Item]:
    for row in lm628.COMMANDS:
        yield Item(COMMANDS, row.name, row.clause, row.title)
    yield Item(COMMANDS, "RDSTAT", "LM-CMD-23", "Read status byte")
    for word, (bits, clause) in _CONTROL_WORDS.items():
        yield from _bits(BITS, word, bits, clause)
    yield Item(MODES, "position mode", "LM-TRJ-12", "LTRJ without bit 11")
    yield Item(MODES, "velocity mode", "LM-TRJ-13", "LTRJ with bit 11")
    yield from _bits(FLAGS, "status", lm628.STATUS, "LM-CMD-23")
    rest = tuple(bit for bit in lm628.SIGNALS if bit not in lm628.STATUS)
    yield from _bits(FLAGS, "signals", rest, "LM-STA-2")


def _mc1241a() -> Iterator[Item]:
    for row in mc1241a.COMMANDS:
        yield Item(COMMANDS, row.name, row.clause, row.title)
    yield from _bits(BITS, "SET_INTRPT_MASK", _PMD_EVENTS, "PMD-STA-1")
    for name in _PROFILES:
        yield Item(MODES, name, "PMD-STA-5", "profile mode, set or told by GET_MODE")
    yield from _bits(FLAGS, "status", _PMD_STATUS, "PMD-STA-1")
    yield from _bits(FLAGS, "mode", _PMD_MODE, "PMD-STA-5")
    yield Item(ANSWERS, "checksum right", "PMD-PKT-2", "read after a packet")
    yield Item(ANSWERS, "checksum wrong", "PMD-PKT-2", "another one than the packet's")
    yield Item(ANSWERS, "checksum 0", "PMD-PKT-4", "after an illegal command")


def _mcp1200() -> Iterator[Item]:
    for group, way in ((READS, "r"), (WRITES, "w")):
        for row in mcp1200.REGISTERS:
            if way in row.access:
                yield Item(group, row.name, row.clause, row.title)
    for name, bits in _MCP_CONTROL.items():
        yield from _bits(BITS, name, bits, mcp1200.REGISTERS[name].clause)
    flag = mcp1200.REGISTERS["FLAG"].clause
    for bit in mcp1200.FLAG_BITS:
        for verb in ("sets", "clears"):
            yield Item(BITS, f"FLAG {verb} {bit.name}", flag, bit.title)
    for name, _ in _EXCEPTIONS:
        for action in _ACTIONS:
            clause = mcp1200.REGISTERS["EXCEPTION"].clause
            yield Item(BITS, f"EXCEPTION {name}={action}", clause, f"what a {name} does")
    for name in _MCP_MODES:
        yield Item(MODES, name, mcp1200.REGISTERS["MODE"].clause, "written to the mode brancher")
    for name, bits in _MCP_SEEN.items():
        yield from _bits(FLAGS, name, bits, mcp1200.REGISTERS[name].clause)


_CATALOGUES: Final = {
    lm628.FAMILY: (_lm628, lm628.RULES),
    mc1241a.FAMILY: (_mc1241a, mc1241a.RULES),
    mcp1200.FAMILY: (_mcp1200, mcp1200.RULES),
}


def of_rule(rule: Rule) -> Item:
    """Return what breaking ``rule`` counts as."""
    group = LIMITS if rule.name in ac_rules() else RULES
    return Item(group, rule.name, rule.clause, rule.title)


@cache
def items(family: str) -> tuple[Item, ...]:
    """Return everything a host can exercise of a chip family; nothing for one without tables."""
    found = _CATALOGUES.get(family)
    if found is None:
        return ()
    make, rules = found
    seen: dict[Key, Item] = {}
    for item in (*make(), *map(of_rule, rules)):
        seen.setdefault(item.key, item)
    return tuple(sorted(seen.values(), key=lambda item: GROUPS.index(item.group)))


# -- what a packet exercises --------------------------------------------------------------------


def exercised(family: str, packet: Packet) -> Iterator[Key]:
    """Give the keys of what one packet exercises; one cut short exercises nothing."""
    if packet.kind not in (WHOLE, STATUS):
        return
    if family == lm628.FAMILY:
        yield from _of_lm628(packet)
    elif family == mc1241a.FAMILY:
        yield from _of_mc1241a(packet)
    elif family == mcp1200.FAMILY:
        yield from _of_mcp1200(packet)


def _set(group: str, word: str, bits: Iterable[Bit], value: int) -> Iterator[Key]:
    for bit in bits:
        low = _low(bit)
        if bool(value & bit.mask) != low:
            yield group, f"{word} {bit.name}{'=0' if low else ''}"


def _word(packet: Packet) -> int:
    """Return the first word after a command byte."""
    return packet.cycles[1].data << 8 | packet.cycles[2].data


def _of_lm628(packet: Packet) -> Iterator[Key]:
    yield COMMANDS, packet.name
    if packet.kind == STATUS:
        yield from _set(FLAGS, "status", lm628.STATUS, packet.cycles[0].data)
        return
    if packet.name == "RDSIGS":
        rest = (bit for bit in lm628.SIGNALS if bit not in lm628.STATUS)
        yield from _set(FLAGS, "signals", rest, _word(packet))
    elif packet.name in _CONTROL_WORDS:
        value = _word(packet)
        if packet.name == "LTRJ":
            yield MODES, f"{'velocity' if value & lm628.VELOCITY_MODE else 'position'} mode"
        elif packet.name == "RSTI":
            value = ~value
        yield from _set(BITS, packet.name, _CONTROL_WORDS[packet.name][0], value)


def _of_mc1241a(packet: Packet) -> Iterator[Key]:
    name = packet.name
    if name == "checksum":
        yield ANSWERS, f"checksum {_verdict(packet.values)}"
    if name not in _names():
        return
    yield COMMANDS, name
    if name in _SETS_PROFILE:
        yield MODES, _SETS_PROFILE[name]
    if len(packet.cycles) < 3:
        return
    value = _word(packet)
    if name in _STATUS_COMMANDS:
        yield from _set(FLAGS, "status", _PMD_STATUS, value)
    elif name == "GET_MODE":
        yield MODES, _PROFILES[value >> mc1241a.PROFILE_SHIFT & 3]
        yield from _set(FLAGS, "mode", _PMD_MODE, value)
    elif name == "SET_INTRPT_MASK":
        yield from _set(BITS, name, _PMD_EVENTS, value)


def _verdict(values: str) -> str:
    if " wrong" in values:
        return "wrong"
    return "right" if values.endswith(" right") else "0"


@cache
def _names() -> frozenset[str]:
    return frozenset(row.name for row in mc1241a.COMMANDS)


def _of_mcp1200(packet: Packet) -> Iterator[Key]:
    first = packet.cycles[0]
    name = packet.name.partition(" ")[2]
    row: Register = mcp1200.REGISTERS[name]
    yield WRITES if first.write else READS, row.name
    value = first.data
    if not first.write:
        yield from _set(FLAGS, name, _MCP_SEEN.get(name, ()), value)
    elif name == "FLAG":
        if value & 7 < len(mcp1200.FLAG_BITS):
            verb = "sets" if value & 8 else "clears"
            yield BITS, f"FLAG {verb} {mcp1200.FLAG_BITS[value & 7].name}"
    elif name == "EXCEPTION":
        for part, shift in _EXCEPTIONS:
            yield BITS, f"EXCEPTION {part}={_ACTIONS[value >> shift & 3]}"
    elif name == "MODE":
        yield MODES, _MCP_MODES[min(value, 3)]
    else:
        yield from _set(BITS, name, _MCP_CONTROL.get(name, ()), value)
