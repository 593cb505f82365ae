"""One lane of a board: what a value was, from which instant on."""

from typing import Any, Final

from vbus.core.bits import nearest

TICK: Final = 1
"""Picoseconds of a tick: instants are as exact as the board's."""

# Below any value of 48 bits, and still a small integer of a compiled core.
NO_STEP: Final = -(1 << 61)
"""The latest value of a lane that has none, or whose latest is no whole number of steps."""

Number = int | float


class Lane:
    """One lane and the rows that are not sent yet.

    Args:
        number: its id.
        axis: name of its axis, or None.
        name: short name.
        title: for people.
        kind: ``NUMBER``, ``LINE``, ...; see :mod:`vbus.views.scope.lanes`.
        unit: what ``scale`` times a value is in.
        scale: what a value is multiplied by.

    Attributes:
        rows: of packets begin, length, label, kind; of marks instant, object.
        times: of values the instants (ps), as they came; no tuples, which a collector counts.
        values: as many values, in steps of the scale: whole numbers, unless that is 1.
        early: whether some came later than others that began after them.
    """

    def __init__(
        self, number: int, axis: str | None, name: str, title: str, kind: str, unit: str = "",
        scale: float = 1.0,
    ) -> None:  # fmt: skip
        self.number: int = number
        self.axis: str | None = axis
        self.name: str = name
        self.title: str = title
        self.kind: str = kind
        self.unit: str = unit
        self.scale: float = scale
        self._step: int = NO_STEP
        self._fraction: Number | None = None
        """The latest value, if it is no whole number of steps."""
        self.rows: list[tuple[Any, ...]] = []
        self.times: list[int] = []
        self.values: list[Number] = []
        self.early: bool = False

    @property
    def full_name(self) -> str:
        """Its name with that of its axis: ``"x.real"``."""
        return self.name if self.axis is None else f"{self.axis}.{self.name}"

    @property
    def untold(self) -> bool:
        """Whether it has no value yet."""
        return self._step == NO_STEP and self._fraction is None

    def take(self, when: object, step: int) -> None:
        """Take a value in steps of the scale; it holds from ``when`` (int, ps) on.

        An object, since lanes that move together then hold the same one.
        """
        # Only changes are rows: an axis that rests costs nothing.
        if step != self._step:
            self._step = step
            self.times.append(when)  # type: ignore[arg-type]
            self.values.append(step)

    def note(self, when: int, value: Number) -> None:
        """Take a value that holds from ``when`` (ps) on."""
        if self.scale != 1.0:
            self.take(when, nearest(value / self.scale))
        elif isinstance(value, int):
            self.take(when, value)
        elif self._step != NO_STEP or value != self._fraction:
            self._step, self._fraction = NO_STEP, value
            self.times.append(when)
            self.values.append(value)

    def take_values(self) -> tuple[list[int], list[Number]]:
        """Return the instants, in their order, and values that are not sent yet."""
        times, values = self.times, self.values
        self.times, self.values = [], []
        if self.early:
            self.early = False
            # Stable: of two values at one instant the later one stays the later.
            order = sorted(range(len(times)), key=times.__getitem__)
            times = [times[place] for place in order]
            values = [values[place] for place in order]
        return times, values

    def leave_out(self) -> None:
        """Forget rows that are not sent; values go on from the latest there was."""
        self.rows.clear()
        self.times.clear()
        self.values.clear()

    def forget(self) -> None:
        """Forget rows that are not sent, and take the next value whatever it is."""
        self.leave_out()
        self._step, self._fraction = NO_STEP, None

    def described(self) -> dict[str, Any]:
        """Return its description for a page."""
        return {
            "id": self.number, "axis": self.axis, "name": self.name, "title": self.title,
            "kind": self.kind, "unit": self.unit, "scale": self.scale, "tick": TICK,
            "shape": "steps",
        }  # fmt: skip
