# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/trace/packets.py; change that, or the generator.
"""What a stretch of bus cycles says in the manual's words, and the base of those who read it.

The sigrok decoders use copies of this file and of the chips' decoders beside it, so nothing here
may need more than the standard library and the tables.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

WRITE: Final = "w"
READ: Final = "r"

WHOLE: Final = "packet"
STATUS: Final = "status"
CUT: Final = "cut"
UNKNOWN: Final = "unknown"
UNEXPECTED: Final = "unexpected"
IGNORED: Final = "ignored"


class NamedBit(Protocol):
    """A row of a bit table."""

    @property
    def number(self) -> int:
        """Its place; 0 is the least significant."""

    @property
    def name(self) -> str:
        """Its name."""


@dataclass(frozen=True, slots=True)
class Cycle:
    """One bus cycle.

    Attributes:
        when: instant of its latching edge (ps).
        write: whether the host wrote.
        address: 0 up.
        data: the byte.
    """

    when: int
    write: bool
    address: int
    data: int

    def __str__(self) -> str:
        return f"{WRITE if self.write else READ} {self.address:X} {self.data:02X}"


@dataclass(frozen=True, slots=True)
class Packet:
    """Bus cycles that belong together.

    Attributes:
        kind: ``"packet"``, ``"status"`` (read at any time, belongs to no packet), ``"cut"``,
            ``"unknown"``, ``"unexpected"`` or ``"ignored"`` (the chip did not take it).
        name: mnemonic or register.
        values: what came with it, scaled, flags by name; may be empty.
        clause: clause of the chip's specification, or "".
        cycles: its bus cycles.
    """

    kind: str
    name: str
    values: str
    clause: str
    cycles: tuple[Cycle, ...]

    @property
    def text(self) -> str:
        """Name and values in one line."""
        return f"{self.name} {self.values}" if self.values else self.name

    @property
    def begin(self) -> int:
        """Instant of its first cycle (ps)."""
        return self.cycles[0].when

    @property
    def end(self) -> int:
        """Instant of its last cycle (ps)."""
        return self.cycles[-1].when


class Decoder:
    """Base of the decoders: bus cycles of one chip in, packets out.

    It knows the bus, not the chip: what the host said, not what came of it.
    """

    FAMILY: str = ""
    WORDS: dict[str, int] = {}
    """Values that can be explained by themselves: name and width in bits."""
    SETTINGS: tuple[str, ...] = ()
    """Settings of the chip that decide how its bus is read; :meth:`configure` takes them."""
    LOST: frozenset[str] = frozenset()
    """Rules whose breach means that the chip did not take the cycle."""

    def configure(self, settings: Mapping[str, object]) -> None:
        """Take those of the chip's settings that :attr:`SETTINGS` names."""

    def feed(self, cycle: Cycle, lost: str = "") -> list[Packet]:
        """Take the next bus cycle; return what is complete now.

        Args:
            cycle: the cycle.
            lost: the rule for whose sake the chip has not taken it, if it has not.
        """
        if lost:
            way = "write" if cycle.write else "read"
            what = f"{way} of {cycle.data:02X}H at address {cycle.address:X}H not taken: {lost}"
            return [Packet(IGNORED, what, "", "", (cycle,))]
        return self.take(cycle)

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        raise NotImplementedError

    def finish(self) -> list[Packet]:
        """Return what is still open: it was cut short."""
        raise NotImplementedError

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the oldest packet still open (ps), if any is.

        No packet that comes later ends before it.
        """
        raise NotImplementedError

    def word(self, name: str, value: int) -> str:
        """Explain one of :attr:`WORDS`.

        Raises:
            ValueError: there is no such word, or the value does not fit into it.
        """
        bits = self.WORDS.get(name)
        if bits is None:
            known = ", ".join(self.WORDS) or "none"
            raise ValueError(f"{self.FAMILY} has no {name!r}; it has {known}")
        if not 0 <= value < 1 << bits:
            raise ValueError(f"{value:X}H does not fit into the {bits} bits of {name}")
        return self.show_word(name, value)

    def show_word(self, name: str, value: int) -> str:
        """Explain one of :attr:`WORDS` that is known to fit."""
        raise NotImplementedError

    def typed(self, data: list[int]) -> list[Cycle]:
        """Return bytes as people list them as the bus cycles they stand for.

        Raises:
            ValueError: they cannot stand for cycles of this chip.
        """
        raise NotImplementedError


# -- values as people read them -----------------------------------------------------------------


def signed(value: int, bits: int) -> int:
    """Return an unsigned number as two's complement of ``bits`` bits."""
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


def number(value: int, fraction: int = 0, sign: bool = False) -> str:
    """Return a number with ``fraction`` fraction bits in decimal.

    A fixed-point number keeps four decimals, and at least four digits that tell.
    """
    plus = "+" if sign else ""
    if not fraction:
        return f"{value:{plus}d}"
    scaled = value / (1 << fraction)
    if value and abs(scaled) < 0.1:
        return f"{scaled:{plus}.4g}"
    return f"{scaled:{plus}.4f}"


def flags(value: int, bits: Iterable[NamedBit]) -> str:
    """Return the names of the bits that are set, highest first; ``"-"`` if none is."""
    rows = sorted(bits, key=_place, reverse=True)
    return " ".join(row.name.replace(" ", "_") for row in rows if value >> row.number & 1) or "-"


def _place(row: NamedBit) -> int:
    return row.number
