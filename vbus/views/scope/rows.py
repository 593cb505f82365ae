"""Rows of lanes, made from frames again: for pictures, and for the viewers of others."""

from dataclasses import dataclass
from math import tau
from operator import itemgetter
from typing import Any, Final, Literal

from vbus.core.kernel import SECOND
from vbus.views.scope.frames import LABELS, MARKS, NOW, PACKETS, SAMPLES, Frame, read
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import LINE, MARK_LANE, NUMBER, PACKET_LANE

DRAWN: Final = (NUMBER, LINE, PACKET_LANE, MARK_LANE)
"""Kinds of lanes that are drawn over time; rows of others are for the page alone."""

Units = Literal["counts", "rev", "SI"]


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


Row = tuple[int, Lane, Any]
"""Instant (ps), lane, and what is from then on: a number, a level, a packet, or a mark's object."""


class Rows:
    """Reads frames as they come.

    Args:
        description: what a page gets first.

    Attributes:
        lanes: every lane, by its number.
        axes: the description of each axis, by its name.
        now: the instant (ps) up to which all is known.
    """

    def __init__(self, description: dict[str, Any]) -> None:
        self.axes: dict[str | None, dict[str, Any]] = {
            axis["name"]: axis for axis in description["axes"]
        }
        keys = "axis", "name", "title", "kind", "unit", "scale"
        self.lanes: list[Lane] = [
            Lane(number, *(lane[key] for key in keys))
            for number, lane in enumerate(description["lanes"])
        ]
        self.now: int = 0
        self._labels: list[str] = []

    def shown_in(self, lane: Lane, units: Units) -> tuple[float, str]:
        """Return the unit of a lane's values for people who count, think in turns, or in SI units.

        Returns:
            What a value of the lane is multiplied by, and the name of the unit.
        """
        of = self.axes.get(lane.axis, {})
        steps, slash, per = lane.unit.partition("/")
        turn = of.get("counts_per_rev")
        # Volts and shares of full scale are the same in every choice of units.
        if units == "counts" or steps != "counts" or not turn:
            return 1.0, lane.unit
        factor = (1.0 if units == "rev" else tau) / turn
        sample = of.get("sample")
        if per == "sample" and sample:
            # Counts a sample become a speed.
            factor, per = factor * SECOND / sample, "s"
        return factor, ("rev" if units == "rev" else "rad") + slash + per

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
        # Lanes come one after the other within a frame; viewers want one order of time.
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
