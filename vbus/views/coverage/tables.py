"""What a host can exercise of a chip, from the chip's tables, and what a packet exercises of it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Final, NamedTuple

from vbus import plugins
from vbus.chips.family import Family
from vbus.chips.packets import STATUS, WHOLE, Packet
from vbus.chips.tables import Bit
from vbus.core.signals import Rule
from vbus.views.clauses import ac_rules

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


class Word(NamedTuple):
    """A word, or the byte of a register, whose bits a host may exercise one by one.

    Attributes:
        group: one of :data:`GROUPS`.
        name: what a report calls it.
        bits: the bits that count.
        clause: clause of the specification.
        packets: names of the packets that have it.
        zeros: it acts by the bits that are 0.
    """

    group: str
    name: str
    bits: tuple[Bit, ...]
    clause: str
    packets: tuple[str, ...]
    zeros: bool = False


class Exercises:
    """Base: what a host can exercise of a chip family, and what one of its packets exercises.

    This much follows from the tables: every command, every register read and written, and the bits
    of the words that a family names.

    Args:
        family: the family.
    """

    WORDS: ClassVar[tuple[Word, ...]] = ()

    def __init__(self, family: Family) -> None:
        self.family: Family = family
        self._commands: frozenset[str] = frozenset(row.name for row in family.commands)
        self._registers: frozenset[str] = frozenset(row.name for row in family.registers)

    def items(self) -> Iterator[Item]:
        """Give what a host may exercise, but for broken rules."""
        for row in self.family.commands:
            yield Item(COMMANDS, row.name, row.clause, row.title)
        for group, way in ((READS, "r"), (WRITES, "w")):
            for register in self.family.registers:
                if way in register.access:
                    yield Item(group, register.name, register.clause, register.title)
        for word in self.WORDS:
            for bit in word.bits:
                yield Item(word.group, _name(word, bit), word.clause, bit.title)

    def exercised(self, packet: Packet) -> Iterator[Key]:
        """Give the keys of what one whole packet exercises."""
        # A register's packet is named with what is done to it before its name.
        name = packet.name.rpartition(" ")[2]
        if name in self._registers:
            yield WRITES if packet.cycles[0].write else READS, name
        elif packet.name in self._commands:
            yield COMMANDS, packet.name
        for word in self.WORDS:
            if packet.name in word.packets:
                value = first_value(packet)
                for bit in word.bits:
                    if bool(value & bit.mask) != (low(bit) or word.zeros):
                        yield word.group, _name(word, bit)


def low(bit: Bit) -> bool:
    """Whether a flag says something by being 0."""
    # The manual's own words in the title: no column of the table says it.
    return "active low" in bit.title


def _name(word: Word, bit: Bit) -> str:
    return f"{word.name} {bit.name}{'=0' if low(bit) else ''}"


def first_value(packet: Packet) -> int:
    """Return the first word behind a command byte, or the byte of a packet of one cycle."""
    cycles = packet.cycles
    return cycles[0].data if len(cycles) < 3 else cycles[1].data << 8 | cycles[2].data


def of_rule(rule: Rule) -> Item:
    """Return what breaking ``rule`` counts as."""
    group = LIMITS if rule.name in ac_rules() else RULES
    return Item(group, rule.name, rule.clause, rule.title)


@cache
def exercises_of(family: str) -> Exercises:
    """Return what says of a chip family what a host can exercise."""
    found = plugins.family(family)
    return (found.load("coverage", Exercises) or Exercises)(found)


@cache
def items(family: str) -> tuple[Item, ...]:
    """Return everything a host can exercise of a chip family; nothing for one without tables."""
    made = exercises_of(family)
    # A plug-in need not have tables; then nothing can be counted.
    if made.family.tables is None:
        return ()
    seen: dict[Key, Item] = {}
    for item in (*made.items(), *map(of_rule, made.family.rules)):
        # Two rows of one name are one thing to a host: the first has the clause.
        seen.setdefault(item.key, item)
    return tuple(sorted(seen.values(), key=lambda item: GROUPS.index(item.group)))


def exercised(family: str, packet: Packet) -> Iterable[Key]:
    """Return the keys of what one packet exercises; one cut short exercises nothing."""
    return exercises_of(family).exercised(packet) if packet.kind in (WHOLE, STATUS) else ()
