"""Rows of lanes, made from frames again: for pictures, and for the viewers of others."""

from dataclasses import dataclass
from math import tau
from operator import itemgetter
from typing import Any, Final, Literal

from vbus.core.kernel import SECOND
from vbus.views.scope.frames import LABELS, MARKS, NOW, PACKETS, SAMPLES, Frame, read
from vbus.views.scope.lanes import LINE, MARK_LANE, NUMBER, PACKET_LANE

DRAWN: Final = (NUMBER, LINE, PACKET_LANE, MARK_LANE)
"""Kinds of lanes that are drawn over time; rows of others are for the page alone."""

Units = Literal["counts", "rev", "SI"]


@dataclass(frozen=True, slots=True)
class Unit:
    """What a value is shown in.

    Attributes:
        factor: what a value of the lane is multiplied by.
        name: of the unit.
    """

    factor: float
    name: str


@dataclass(frozen=True, eq=False, slots=True)
class LaneTold:
    """A lane as a description tells of it.

    Attributes:
        axis: name of its axis, or None.
        name: short name.
        title: for people.
        kind: :data:`~vbus.views.scope.lanes.NUMBER`, ...
        unit: of its values.
        scale: what a number that was sent is multiplied by.
        of: the description of its axis.
    """

    axis: str | None
    name: str
    title: str
    kind: str
    unit: str
    scale: float
    of: dict[str, Any]

    @property
    def full_name(self) -> str:
        """Its name with that of its axis: ``"x.real"``."""
        return self.name if self.axis is None else f"{self.axis}.{self.name}"

    def shown_in(self, units: Units) -> Unit:
        """Return the unit of its values for people who count, think in turns, or in SI units."""
        steps, slash, per = self.unit.partition("/")
        turn = self.of.get("counts_per_rev")
        if units == "counts" or steps != "counts" or not turn:
            return Unit(1.0, self.unit)
        factor = (1.0 if units == "rev" else tau) / turn
        sample = self.of.get("sample")
        if per == "sample" and sample:
            factor, per = factor * SECOND / sample, "s"
        return Unit(factor, ("rev" if units == "rev" else "rad") + slash + per)


@dataclass(frozen=True, slots=True)
class PacketRow:
    """A packet on a bus.

    Attributes:
        length: from its first cycle to its last (ps).
        text: in the manual's words.
        kind: number of its kind, see :mod:`vbus.views.scope.recording`.
    """

    length: int
    text: str
    kind: int


Row = tuple[int, LaneTold, Any]
"""Instant (ps), lane, and what is from then on: a number, a level, a packet, or a mark's object."""


class Rows:
    """Reads frames as they come.

    Args:
        description: what a page gets first.

    Attributes:
        lanes: every lane, by its number.
        now: the instant (ps) up to which all is known.
    """

    def __init__(self, description: dict[str, Any]) -> None:
        axes = {axis["name"]: axis for axis in description["axes"]}
        self.lanes: list[LaneTold] = [
            LaneTold(
                lane["axis"], lane["name"], lane["title"], lane["kind"], lane["unit"],
                lane["scale"], axes.get(lane["axis"], {}),
            )
            for lane in description["lanes"]
        ]  # fmt: skip
        self.now: int = 0
        self._labels: list[str] = []

    def take(self, frames: bytes) -> list[Row]:
        """Return the rows of some frames in the order of their instants."""
        found: list[Row] = []
        for frame in read(frames):
            if frame.kind == LABELS:
                self._labels += frame.columns[0]
            elif frame.kind == NOW:
                self.now = frame.first
            elif frame.kind in (SAMPLES, PACKETS, MARKS):
                lane = self.lanes[frame.lane]
                found += [
                    (frame.first + round(tick), lane, value)
                    for tick, value in zip(frame.columns[0], self._values(frame), strict=True)
                    if lane.kind in DRAWN
                ]
        found.sort(key=itemgetter(0))
        return found

    def _values(self, frame: Frame) -> list[Any]:
        scale = self.lanes[frame.lane].scale
        if frame.kind == PACKETS:
            return [
                PacketRow(round(length), self._labels[round(label)], kind)
                for length, label, kind in zip(*frame.columns[1:4], strict=True)
            ]
        values = frame.columns[1]
        return [value * scale for value in values] if scale != 1 else values
