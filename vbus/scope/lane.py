"""One lane of a board: what a value was, from which instant on."""

from typing import Any, Final

TICK: Final = 1
"""Picoseconds of a tick: instants are as exact as the board's."""

Number = int | float


class Lane:
    """One lane and the rows that nobody has taken yet.

    Args:
        number: its id.
        axis: name of its axis, or None.
        name: short name.
        title: for people.
        kind: ``NUMBER``, ``LINE``, ...; see :mod:`vbus.scope.lanes`.
        unit: what ``scale`` times a value is in.
        scale: what a value is multiplied by.

    Attributes:
        last: the latest value, as it was told; None before the first.
        rows: of packets begin, length, label, kind; of marks instant, object.
        times: of values the instants (ps), as they were told; no tuples, which a collector counts.
        values: as many values, in steps of the scale.
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
        self.last: Number | None = None
        self.rows: list[tuple[Any, ...]] = []
        self.times: list[int] = []
        self.values: list[Number] = []
        self._early: bool = False
        self._latest: int = 0

    def note(self, when: int, value: Number) -> None:
        """Take a value that holds from ``when`` (ps) on."""
        if value != self.last:
            self.last = value
            if when < self._latest:
                self._early = True
            self._latest = when
            self.times.append(when)
            self.values.append(value if self.scale == 1.0 else round(value / self.scale))

    def take_values(self) -> tuple[list[int], list[Number]]:
        """Return the instants, in their order, and values that nobody has taken yet."""
        times, values = self.times, self.values
        self.times, self.values = [], []
        if self._early:  # some are known later than others that began after them
            self._early = False
            order = sorted(range(len(times)), key=times.__getitem__)
            times = [times[place] for place in order]
            values = [values[place] for place in order]
        return times, values

    def forget(self) -> None:
        """Forget what nobody has taken, and take the next value whatever it is."""
        self.rows.clear()
        self.times.clear()
        self.values.clear()
        self.last = None

    def described(self) -> dict[str, Any]:
        """Return what a page is told of it."""
        return {
            "id": self.number, "axis": self.axis, "name": self.name, "title": self.title,
            "kind": self.kind, "unit": self.unit, "scale": self.scale, "tick": TICK,
            "shape": "steps",
        }  # fmt: skip
