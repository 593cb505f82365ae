"""What is in a chip: its registers and commands as its tables name them, and their values.

Looking at them changes nothing. What a chip moves by itself is looked at from time to time only,
what its host does to it after each bus cycle.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from vbus import plugins
from vbus.chips.base import Chip
from vbus.chips.family import Family, InnerRegister
from vbus.chips.packets import Decoder, RegisterPackets
from vbus.chips.tables import Bit, Register
from vbus.circuit.stream import decoder_of
from vbus.kernel import MS
from vbus.scope.lane import Lane
from vbus.scope.lanes import Lanes

EVERY: Final = 10 * MS
"""How often registers are looked at that nobody has touched (ps)."""
NOT_LOOKED_AT: Final = float("nan")
"""The value of a register while nobody looks."""


class ChipRegisters:
    """The registers of one chip, each with the lane that has its value.

    Args:
        chip: the chip.
        lanes: all lanes; it adds those of its own.

    Attributes:
        described: what a page is told of the chip.
    """

    def __init__(self, chip: Chip, lanes: Lanes) -> None:
        self._chip: Chip = chip
        self._all: Lanes = lanes
        self._told: list[tuple[str, Lane]] = []
        self._looked: list[tuple[Callable[[], int], Lane]] = []
        self._worded: dict[int, Callable[[int], str]] = {}
        self._seen: set[tuple[int, int]] = set()
        self._due: int = 0
        self._words: list[tuple[int, int, str]] = []
        """What values mean: lane, value, text; those nobody has taken yet."""
        family = plugins.family(chip.FAMILY)
        self._keys: tuple[str, ...] = tuple(chip.telemetry())
        self._lanes: dict[tuple[str | None, str], Lane] = {
            (lane.axis, lane.name): lane for lane in lanes.all
        }
        self._rows: list[dict[str, Any]] = []
        decoder = decoder_of(chip.FAMILY)
        for register in family.registers:
            self._add_register(family, register, decoder)
        for inner in family.inner_registers:
            for axis in range(chip.axis_count if "{}" in inner.path else 1):
                self._add_inner(family, inner, axis)
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

    def _add_register(self, family: Family, row: Register, decoder: Decoder) -> None:
        lane = self._known(family, row.name, row.fields, 0)
        if lane is None:
            try:
                self._peek(row)
            except ValueError:  # it cannot be looked at: perhaps the chip tells it
                lane = self._told_as(row.name.lower(), row.name)
                if lane is None:
                    return
            else:
                lane = self._lane(row.name)
                self._looked.append((partial(self._peek, row), lane))
        if isinstance(decoder, RegisterPackets) and row.bits == 8 and not row.fields:
            self._worded[lane.number] = partial(_word, decoder, row)
        self._describe(
            lane, row.name, row.title, row.clause, row.fields, "registers", row.unit,
            row.fraction, 2 * len(row.addresses) if row.fields or row.bits == 8 else 0, row.moves,
            addresses=list(row.addresses), signed=row.bits if row.signed else 0,
            access=row.access, reset=row.reset,
        )  # fmt: skip

    def _add_inner(self, family: Family, row: InnerRegister, axis: int) -> None:
        several = "{}" in row.path and self._chip.axis_count > 1
        name = f"{row.name} {axis + 1}" if several else row.name
        lane = self._known(family, row.name, row.fields, axis)
        if lane is None:
            lane = self._lane(name)
            steps = [int(s) if s.isdigit() else s for s in row.path.format(axis).split(".")]
            self._looked.append((partial(_follow, self._chip, steps), lane))
        group = f"axis {axis + 1}: {row.group}" if several else row.group
        self._describe(
            lane, name, row.title, row.clause, row.fields, group, row.unit, row.fraction,
            row.digits, row.moves, words=list(row.words),
        )  # fmt: skip

    def _describe(
        self, lane: Lane, name: str, title: str, clause: str, fields: tuple[Bit, ...], group: str,
        unit: str, fraction: int, digits: int, moves: bool, **more: Any,
    ) -> None:  # fmt: skip
        self._rows.append(
            {
                "lane": lane.number, "name": name, "title": title, "clause": clause,
                "group": group, "unit": unit, "fraction": fraction, "digits": digits,
                "moves": moves, "fields": [[b.number, b.name, b.title] for b in fields], **more,
            }
        )  # fmt: skip

    def _known(self, family: Family, name: str, fields: tuple[Bit, ...], axis: int) -> Lane | None:
        """Return the lane of what the chip tells of a register by itself, if it does."""
        several = self._chip.axis_count > 1
        holder = f"{self._chip.name}.{axis + 1}" if several else self._chip.name
        for row in family.lanes:
            if row.register == name:
                return self._lanes[holder, row.name]
        for key in self._keys:
            word, _, number = key.partition(" ")
            table = family.flags.get(key) or family.flags.get(word)
            mine = not number or number == str(axis + 1)
            if table and fields and mine and getattr(family.tables, table) is fields:
                return self._told_as(key, f"{name} {number}".rstrip())
        return None

    def _told_as(self, key: str, name: str) -> Lane | None:
        if key not in self._keys:
            return None
        known = self._lanes.get((self._chip.name, key))
        if known is None:
            known = self._lane(name)
            self._told.append((key, known))
        return known

    def _lane(self, name: str) -> Lane:
        return self._all.add_register(self._chip.name, name)

    def _peek(self, row: Register) -> int:
        value = 0
        for address in row.addresses:
            value = value << 8 | self._chip.peek(address)
        return value

    # -- what they hold -----------------------------------------------------------------------

    def note(self, now: int, told: Mapping[str, Any]) -> None:
        """Take what the chip tells at a sample, and look at the rest now and then."""
        for key, lane in self._told:
            lane.note(now, told[key])
        if now >= self._due:
            self._look(now)

    def look(self, now: int) -> None:
        """Look at all of it: a bus cycle has been, or what it does has been done."""
        told = self._chip.telemetry()
        for key, lane in self._told:
            lane.note(now, told[key])  # type: ignore[arg-type]
        self._look(now)
        self._due = 0  # what a sample makes of it is looked at as well

    def _look(self, now: int) -> None:
        self._due = now + EVERY
        self._chip.advance()
        for read, lane in self._looked:
            value = int(read())
            lane.note(now, value)
            word = self._worded.get(lane.number)
            if word is not None and (lane.number, value) not in self._seen:
                self._seen.add((lane.number, value))
                self._words.append((lane.number, value, word(value)))

    def take_words(self) -> list[tuple[int, int, str]]:
        """Return lane, value and meaning of values that were not seen before."""
        words, self._words = self._words, []
        return words

    def forget(self, now: int) -> None:
        """Nobody looks from ``now`` on: what they hold is not known."""
        self._due = 0
        for _, lane in (*self._told, *self._looked):
            lane.note(now, NOT_LOOKED_AT)


def _follow(chip: Chip, steps: list[str | int]) -> Any:
    found: Any = chip
    for step in steps:
        found = found[step] if isinstance(step, int) else getattr(found, step)
    return found() if callable(found) else found


def _word(decoder: RegisterPackets, row: Register, value: int) -> str:
    return decoder.value(row, value, False)
