"""The values of a chip or of a plant, declared once, and the functions that read them.

A row says what a value is and where it is found. Telemetry, lanes, the chip view, names in
conditions and what is published over Zenoh follow from the rows.
"""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, Final, NamedTuple

from vbus.core.signals.lane import nearest

Reading = int | float | str
"""A value as telemetry has it."""

LANES: Final = ("desired", "real", "error", "velocity", "profile", "output")
"""Lanes that mean the same for every chip, in the order in which they are drawn."""
INTERRUPT: Final = "interrupt"
"""Key of the value that is not 0 while a chip interrupts its host."""
_SPELLED: Final = {"cnt": "counts", "count": "counts", "ustep": "microsteps"}


class Value(NamedTuple):
    """One value of a chip or of a plant.

    Attributes:
        name: as the manual calls it; the same for each axis.
        place: where it is found: a Python expression after ``chip.``, ``{}`` for the axis
            (0-based): ``"axes[{}].encoder.actual"``. "": where its register or parameter is.
        group: what it stands with in the chip view; "": it is not shown there.
        clause: clause id.
        title: what it is.
        unit: what it counts, abbreviated as in the manual: ``"cnt/sample"``.
        fraction: fraction bits of what is found at its place.
        digits: of its value in hexadecimal; 0 where it is a number.
        fields: its bits by name.
        words: what its values mean, from 0 on.
        moves: whether samples change it, not only its host.
        key: its name in telemetry and conditions, ``{}`` for the number of the axis (1-based);
            "": it is in neither.
        lane: its lane: one of :data:`LANES`, or a name of its own; "": it is not drawn over time.
        step: what its lane counts in, in its unit; 0: in the fraction. With a step and no unit the
            value is a share of full scale.
        register: the register of the map that reads the same.
        command: the command that reads or sets it, whose row says what is left out here.
        text: whether the value is a text.
    """

    name: str
    place: str = ""
    group: str = ""
    clause: str = ""
    title: str = ""
    unit: str = ""
    fraction: int = 0
    digits: int = 0
    fields: tuple[Any, ...] = ()
    words: tuple[str, ...] = ()
    moves: bool = False
    key: str = ""
    lane: str = ""
    step: float = 0.0
    register: str = ""
    command: str = ""
    text: bool = False

    @property
    def plain_unit(self) -> str:
        """The unit in full: ``"counts/sample"``."""
        noun, slash, rest = self.unit.partition("/")
        return _SPELLED.get(noun, noun) + slash + rest

    @property
    def scale(self) -> float:
        """The step of its lane, in its unit."""
        return self.step or 2.0**-self.fraction

    def of_axes(self, axes: int) -> range:
        """Return the axes (0-based) that have it, of a chip with so many; 0: the chip has it."""
        return range(axes if "{}" in self.place else 1)

    def raw(self, axis: int) -> str:
        """Return the expression of what is found at its place."""
        return f"chip.{self.place.format(axis)}"

    def number(self, axis: int) -> str:
        """Return the expression of its value in its unit."""
        return f"{self.raw(axis)} / {1 << self.fraction}" if self.fraction else self.raw(axis)

    def steps(self, axis: int) -> str:
        """Return the expression of its value in steps of its lane."""
        return f"nearest({self.number(axis)} / {self.step!r})" if self.step else self.raw(axis)


@cache
def reader(expression: str) -> Callable[[Any], Any]:
    """Return the function of a chip that gives the value of an expression of ``chip``."""
    # Of a compiled LM629 it takes 0.4 us for the seven numbers of its lanes, 2.5 us for telemetry.
    read: Callable[[Any], Any] = eval(f"lambda chip: {expression}", {"nearest": nearest})
    return read


class ValueTable:
    """The values of one family, or of one plant.

    A register of the map that no row names is a value too. Its number is the attribute of the
    chip that is called as the register, in lower case. A family without rows tells all its
    registers; one without lanes has a lane for each number that it tells.

    Args:
        rows: the values, in the order of the chip view.
        registers: the rows of the register map.
        commands: the rows of the command table.
        home: where the chip has its registers, or parameters of commands: ``"axis.registers."``.
        order: the keys in the order of telemetry; none: in the order of the rows.

    Attributes:
        rows: the values, with those of the registers last.
        registers: the value of each register, by the register's name.

    Raises:
        ValueError: ``order`` has other keys than the rows.
    """

    def __init__(
        self,
        *rows: Value,
        registers: Iterable[Any] = (),
        commands: Iterable[Any] = (),
        home: str = "",
        order: Iterable[str] = (),
    ) -> None:
        # Registers without a row are values all the same: a plug-in's map is enough for a chip
        # view.
        mapped = {row.name: row for row in registers}
        named = {row.register for row in rows}
        rows += tuple(
            Value(name, register=name, key="" if rows else name.lower())
            for name in mapped
            if name not in named
        )
        known = mapped | {row.name: row for row in commands}
        rows = tuple(
            _filled(row, known[row.register or row.command], home)
            if row.register or row.command
            else row
            for row in rows
        )
        # A family that names no lanes has all its numbers drawn.
        if not any(row.lane for row in rows):
            rows = tuple(row if row.text else row._replace(lane=row.key) for row in rows)
        self.rows: tuple[Value, ...] = rows
        self.registers: dict[str, Value] = {row.register: row for row in rows if row.register}
        self._keyed: dict[str, Value] = {row.key: row for row in rows if row.key}
        self._order: list[str] = [*order] or [*self._keyed]
        # Found at import: telemetry with a key missing would be found by a user.
        if {*self._order} != {*self._keyed}:
            strange = ", ".join({*self._order} ^ {*self._keyed})
            raise ValueError(f"order and rows differ in {strange}")
        drawn = [row for row in rows if row.lane]
        self._lanes: list[Value] = sorted(drawn, key=_place_of_lane)

    def by_key(self, axes: int) -> dict[str, tuple[Value, int]]:
        """Return row and axis (0-based) of each value of telemetry, by its key.

        Args:
            axes: how many axes the chip has.
        """
        rows = [self._keyed[key] for key in self._order]
        return {
            row.key.format(axis + 1): (row, max(axis, 0))
            for axis in range(-1, axes)
            for row in rows
            if ("{}" in row.key) == (axis >= 0)
        }

    def named(self, key: str) -> Value | None:
        """Return the row of a value of telemetry, of whatever axis."""
        name, _, number = key.rpartition(" ")
        return self._keyed.get(key) or self._keyed.get(f"{name} {{}}" if number.isdigit() else "")

    def lanes(self, axes: int) -> list[tuple[Value, int]]:
        """Return row and axis of each lane, axis by axis."""
        return [
            (row, axis)
            for axis in range(max(axes, 1))
            for row in self._lanes
            if axis in row.of_axes(axes)
        ]

    def lane(self, name: str) -> Value | None:
        """Return the row of a lane; None if there is none of this name."""
        return next((row for row in self._lanes if row.lane == name), None)

    def telemetry(self, axes: int) -> Callable[[Any], dict[str, Reading]]:
        """Return the function of a chip that gives every value of telemetry by its key."""
        rows = self.by_key(axes).items()
        return reader(f"{{{', '.join(f'{k!r}: {row.number(n)}' for k, (row, n) in rows)}}}")

    def steps(self, axes: int) -> Callable[[Any], list[int | float]]:
        """Return the function of a chip that gives its lanes in steps, in order of :meth:`lanes`.

        Steps are whole; a number with neither step nor fraction is given as it is. Last comes
        :data:`INTERRUPT`, 0 of a chip that has none.
        """
        # Last, outside of all lanes: the recorder draws it as a mark.
        row = self._keyed.get(INTERRUPT)
        steps = [row.steps(axis) for row, axis in self.lanes(axes)]
        return reader(f"[{', '.join([*steps, row.number(0) if row else '0'])}]")


def _filled(value: Value, row: Any, home: str) -> Value:
    """Return a value with what it has in common with its register or command."""
    place = value.place or home + (row.parameter if value.command else row.name.lower())
    unit, fraction = value.unit or row.unit, value.fraction or row.fraction
    if not value.command:
        fields = value.fields or row.fields
        return value._replace(place=place, unit=unit, fraction=fraction, fields=fields)
    title = value.title or (f"what {row.name} reads" if row.read else f"as {row.name} set it")
    clause = value.clause or row.clause
    return value._replace(place=place, unit=unit, fraction=fraction, title=title, clause=clause)


def _place_of_lane(row: Value) -> int:
    return LANES.index(row.lane) if row.lane in LANES else len(LANES)
