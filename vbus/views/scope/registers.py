"""What is in a chip: its registers and commands as its tables name them, and their values.

Looking at them changes nothing. What a chip moves by itself is looked at from time to time only,
what its host does to it after each bus cycle.
"""

from collections.abc import Callable
from typing import Any, Final

from vbus import plugins
from vbus.chips.base import Chip
from vbus.chips.packets import RegisterPackets
from vbus.chips.tables import Register
from vbus.circuit.stream import decoder_of
from vbus.core.kernel import MS
from vbus.core.signals import Value
from vbus.core.signals.values import reader
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import Lanes

# Faster than a page draws, and a fortieth of the samples of an LM629.
EVERY: Final = 10 * MS
"""How often registers are read that no bus cycle has touched (ps)."""
NOT_LOOKED_AT: Final = float("nan")
"""The value of a register while no page shows it."""


class ChipRegisters:
    """The registers of one chip, each with the lane that has its value.

    Args:
        chip: the chip.
        lanes: all lanes; it adds those of its own.

    Attributes:
        described: the chip's description for a page.
    """

    def __init__(self, chip: Chip, lanes: Lanes) -> None:
        self._chip: Chip = chip
        self._all: Lanes = lanes
        self._told: list[tuple[str, Lane]] = []
        """Expressions and lanes of what is looked at in each sample."""
        self._looked: list[tuple[str, Lane]] = []
        self._worded: dict[int, Callable[[int], str]] = {}
        self._seen: set[tuple[int, int]] = set()
        self._due: int = 0
        self._words: list[tuple[int, int, str]] = []
        """What values mean: lane, value, text; those that are not sent yet."""
        self._drawn: dict[tuple[str, int], Lane] = {
            (row.name, axis): lane
            for (row, axis), lane in zip(
                chip.VALUES.lanes(chip.axis_count), lanes.values[chip.name], strict=True
            )
        }
        self._rows: list[dict[str, Any]] = []
        family = plugins.family(chip.FAMILY)
        for register in family.registers:
            if register.name in chip.VALUES.registers:
                self._add(chip.VALUES.registers[register.name], 0, register)
        for value in chip.VALUES.rows:
            for axis in value.of_axes(chip.axis_count) if value.group else ():
                self._add(value, axis)
        self._read_told = _reading(self._told)
        self._read_looked = _reading(self._looked)
        self.described: dict[str, Any] = {
            "name": chip.name, "part": chip.part, "title": family.title or chip.part,
            "kind": family.kind, "registers": self._rows,
            "addresses": [list(row) for row in family.addresses],
            "commands": [
                {"name": row.name, "code": row.code, "title": row.title, "clause": row.clause}
                for row in family.commands
            ],
        }  # fmt: skip

    # -- what there is ------------------------------------------------------------------------

    def _add(self, value: Value, axis: int, register: Register | None = None) -> None:
        # A number behind the name only where there is more than one axis.
        several = "{}" in value.place and self._chip.axis_count > 1
        about = register or value
        name = f"{about.name} {axis + 1}" if several else about.name
        lane = self._drawn.get((value.name, axis))
        if lane is None:
            sampled = value.key and value.fields
            numbered = f"{value.name} {axis + 1}" if sampled and "{}" in value.key else name
            lane = self._all.add_register(self._chip.name, numbered)
            # The page shows bytes of the bus, which have no sign.
            unsigned = f" & {(1 << register.bits) - 1}" if register and register.signed else ""
            looked = self._told if sampled else self._looked
            looked.append((value.raw(axis) + unsigned, lane))
        self._rows.append(
            {
                "lane": lane.number, "name": name, "title": about.title, "clause": about.clause,
                "group": f"axis {axis + 1}: {value.group}" if several else value.group,
                "unit": about.unit, "fraction": about.fraction, "digits": value.digits,
                "moves": about.moves,
                "fields": [[bit.number, bit.name, bit.title] for bit in about.fields],
            }
            | ({"words": list(value.words)} if register is None else self._mapped(register, lane))
        )  # fmt: skip

    def _mapped(self, row: Register, lane: Lane) -> dict[str, Any]:
        """Return the description of a register that has an address, beside what all have."""
        decoder = decoder_of(self._chip.FAMILY)
        if isinstance(decoder, RegisterPackets) and row.bits == 8 and not row.fields:
            self._worded[lane.number] = lambda value: decoder.value(row, value, False)
        return {
            "group": "registers",
            "digits": 2 * len(row.addresses) if row.fields or row.bits == 8 else 0,
            "addresses": list(row.addresses), "signed": row.bits if row.signed else 0,
            "access": row.access, "reset": row.reset,
        }  # fmt: skip

    # -- what they hold -----------------------------------------------------------------------

    def note(self, now: int) -> None:
        """Take what is looked at in each sample, and look at the rest now and then."""
        self._take(now, self._told, self._read_told)
        if now >= self._due:
            self._look(now)

    def look(self, now: int) -> None:
        """Look at all of it: a bus cycle has been, or what it does has been done."""
        self._chip.advance()
        self._take(now, self._told, self._read_told)
        self._look(now)
        self._due = 0  # what a sample makes of it is looked at as well

    def _look(self, now: int) -> None:
        self._due = now + EVERY
        self._take(now, self._looked, self._read_looked)

    def _take(
        self, now: int, rows: list[tuple[str, Lane]], read: Callable[[Any], list[int]]
    ) -> None:
        for (_, lane), value in zip(rows, read(self._chip), strict=True):
            lane.note(now, int(value))
            word = self._worded.get(lane.number)
            # A text for each value once: a page keeps them.
            if word is not None and (lane.number, value) not in self._seen:
                self._seen.add((lane.number, value))
                self._words.append((lane.number, value, word(value)))

    def take_words(self) -> list[tuple[int, int, str]]:
        """Return lane, value and meaning of values that were not seen before."""
        words, self._words = self._words, []
        return words

    def forget(self, now: int) -> None:
        """No page shows them from ``now`` on: what they hold is not known."""
        self._due = 0
        for _, lane in (*self._told, *self._looked):
            lane.note(now, NOT_LOOKED_AT)


def _reading(rows: list[tuple[str, Lane]]) -> Callable[[Any], list[int]]:
    """Return the function of a chip that gives the values of all rows."""
    return reader(f"[{', '.join(expression for expression, _ in rows)}]")
