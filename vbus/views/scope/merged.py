"""Several recordings as one: nodes of a machine, or boards beside each other, on one page."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final

from vbus.views.scope.frames import (
    ALL,
    CHIPS,
    HEAD,
    LABELS,
    MARKS,
    NOW,
    PACKETS,
    WORDS,
    Column,
    columns_at,
    frame,
    numbers,
    texts,
    values_of,
)
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import MARK_LANE, NODE_MARK, PACKET_LANE

_LABEL_COLUMN: Final = 2


class Merged:
    """Makes one recording of several; each part has its own lanes, packets and labels there.

    A name that two parts have stands with that of its board in front; marks of one kind are one
    lane. Time is that of the part that is farthest behind while parts run.

    Args:
        descriptions: the description of each part, as for a page of its own.

    Attributes:
        description: that of all of them together.

    Raises:
        ValueError: more lanes than frames can number.
    """

    def __init__(self, descriptions: Sequence[dict[str, Any]]) -> None:
        self._lanes: list[list[int]] = []
        """Number of each lane here, by its number in each part."""
        self._labels: list[list[int]] = [[] for _ in descriptions]
        self._label_count: int = 0
        self._chips: list[list[dict[str, Any]]] = [[] for _ in descriptions]
        self._nows: dict[int, int] = dict.fromkeys(range(len(descriptions)), 0)
        self._came: list[int] = [0 for _ in descriptions]
        """How far each part has come, also one that has gone, or is not as far again."""
        self._now: int = 0
        self._began: list[tuple[Any, Any]] = [_shape(part) for part in descriptions]
        self._parts: list[str] = _distinct([part["board"] for part in descriptions])
        self._fronts: list[str] = self._parts if _clash(descriptions) else [""] * len(descriptions)
        self._nodes: int = -1
        """Lane of the nodes that go and come back; -1 if no node runs any more."""
        self.description: dict[str, Any] = self._described(descriptions)

    def _described(self, parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
        axes: list[dict[str, Any]] = []
        lanes: list[dict[str, Any]] = []
        marks: dict[str, int] = {}
        names = Counter(_name(lane) for part in parts for lane in part["lanes"])
        for part, front, own in zip(parts, self._fronts, self._parts, strict=True):
            axes += [axis | {"name": front + axis["name"]} for axis in part["axes"]]
            known: list[int] = []
            for lane in part["lanes"]:
                number = len(lanes)
                if lane["kind"] == MARK_LANE:
                    number = marks.setdefault(lane["name"], number)
                # Marks of one kind share a lane, so that all faults stand in one row.
                if number == len(lanes):
                    lanes.append(self._lane(lane, number, front, own, names))
                known.append(number)
            self._lanes.append(known)
        # One that still runs makes the page a live one.
        live = any(part["live"] for part in parts)
        if live:
            self._nodes = len(lanes)
            lanes.append(Lane(self._nodes, None, "nodes", "nodes", MARK_LANE).described())
        # The number of a lane has 16 bits, and the last stands for "none of them".
        if len(lanes) >= ALL:
            raise ValueError(f"{len(lanes)} lanes are more than one page has: {ALL - 1}")
        times = list(dict.fromkeys(part["time"] for part in parts))
        pair = [axis["name"] for axis in axes[:2]]
        return parts[0] | {
            "board": title_of([part["board"] for part in parts]), "time": ", ".join(times),
            "live": live, "control": False,
            "now": str(max(int(part["now"]) for part in parts)), "axes": axes, "lanes": lanes,
            "xy": [[f"{name}.{what}" for what in ("real", "desired") for name in pair]]
            if len(pair) == 2 else [],
        }  # fmt: skip

    def _lane(
        self, lane: dict[str, Any], number: int, front: str, own: str, names: Counter[str]
    ) -> dict[str, Any]:
        """Return a lane's description here."""
        axis, name, title = lane["axis"], lane["name"], lane["title"]
        if axis is not None:
            axis = front + axis
        elif lane["kind"] != MARK_LANE:
            before = front or (own if names[_name(lane)] > 1 else "")
            name, title = before + name, before + title
        return lane | {"id": number, "axis": axis, "name": name, "title": title}

    # -- frames -------------------------------------------------------------------------------

    def take(self, part: int, frames: bytes) -> bytes:
        """Return frames of a part as they are here."""
        return b"".join(self._frames(part, frames))

    def end(self, part: int) -> bytes:
        """A part has ended: time goes on without it; return the frames about that."""
        # Time is the least of those that run: one that has ended must not hold it.
        self._nows.pop(part, None)
        return self._told_now()

    def came(self, part: int) -> int:
        """How far a part has come (ps); what is at that instant may have come or not."""
        return self._came[part]

    def fits(self, part: int, description: dict[str, Any]) -> bool:
        """Whether a description has the axes and lanes that a part has."""
        return _shape(description) == self._began[part]

    def begin_again(self, part: int, description: dict[str, Any]) -> bytes:
        """A part that had ended has come back; return the frames about that.

        Args:
            part: its number.
            description: its new description; it fits. Of what it does until where the part had
                come to before, only the labels are sent again.
        """
        self._labels[part] = []
        self._nows[part] = now = int(description["now"])
        came = self._came[part]
        unseen = f", not seen since {came} ps" if now > came else ""
        return self.event(part, f"is back at {now} ps{unseen}")

    def event(self, part: int, text: str) -> bytes:
        """Return a mark where all parts have come to: of a part that goes or comes back.

        Args:
            part: its number.
            text: what stands behind its name.
        """
        text = f"{self._parts[part].rstrip('.')} {text}"
        mark = {"text": text, "kind": NODE_MARK, "rule": None, "clause": None, "label": None}
        return frame(MARKS, self._nodes, 1, self._now, numbers([0]), texts([mark]))

    def by_end(self) -> list[int]:
        """Return the parts of a recording that is over in the order in which they have ended."""
        return sorted(self._nows, key=self._nows.__getitem__)

    def _frames(self, part: int, data: bytes) -> Iterator[bytes]:
        place = 0
        while place < len(data):
            kind, count, lane, rows, first = HEAD.unpack_from(data, place)
            begin = place + HEAD.size
            columns, place = columns_at(data, begin, count)
            if kind == NOW:
                self._nows[part] = first
                self._came[part] = max(self._came[part], first)
                yield self._told_now()
            elif lane != ALL:
                lane = self._lanes[part][lane]
                if kind in (PACKETS, MARKS):
                    columns = self._labelled(part, kind, columns)
                    yield frame(kind, lane, rows, first, *columns)
                else:
                    yield HEAD.pack(kind, count, lane, rows, first) + data[begin:place]
            elif kind in (CHIPS, WORDS):
                table = json.loads(columns[0][1])
                made = self._chips_of(part, table) if kind == CHIPS else self._words(part, table)
                yield frame(kind, ALL, len(made), first, texts(made))
            else:
                # Labels are numbered through: a packet of each part names its own by an offset.
                if kind == LABELS:
                    self._labels[part] += range(self._label_count, self._label_count + rows)
                    self._label_count += rows
                yield HEAD.pack(kind, count, lane, rows, first) + data[begin:place]

    def _told_now(self) -> bytes:
        """Return how far time has come in all parts, if that is news."""
        # A page draws what is known of all parts.
        now = min(self._nows.values(), default=self._now)
        if now <= self._now:
            return b""
        self._now = now
        return frame(NOW, ALL, 0, now)

    def _labelled(self, part: int, kind: int, columns: list[Column]) -> list[Column]:
        """Return the columns of packets or marks with the labels they have here."""
        known = self._labels[part]
        if kind == PACKETS:
            labels = [known[round(label)] for label in values_of(*columns[_LABEL_COLUMN])]
            columns[_LABEL_COLUMN] = numbers(labels)
            return columns
        marks = values_of(*columns[1])
        for mark in marks:
            if mark["label"] is not None:
                mark["label"] = known[mark["label"]]
        return [columns[0], texts(marks)]

    def _chips_of(self, part: int, chips: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return the chips of all parts that are known: a page takes them all at once."""
        lanes = self._lanes[part]
        for chip in chips:
            chip["name"] = self._fronts[part] + chip["name"]
            for register in chip["registers"]:
                register["lane"] = lanes[register["lane"]]
        self._chips[part] = chips
        return [chip for mine in self._chips for chip in mine]

    def _words(self, part: int, words: list[list[Any]]) -> list[list[Any]]:
        lanes = self._lanes[part]
        return [[lanes[lane], *rest] for lane, *rest in words]


def title_of(boards: Sequence[str]) -> str:
    """Return what some boards are called together: nodes by their machine."""
    machines = list(dict.fromkeys(name.rpartition(".")[0] or name for name in boards))
    return " + ".join(machines)


def _shape(description: dict[str, Any]) -> tuple[Any, Any]:
    """Return what a part that comes back must have as before."""
    return description["axes"], description["lanes"]


def _name(lane: dict[str, Any]) -> str:
    return f"{lane['axis']}.{lane['name']}" if lane["axis"] else str(lane["name"])


def _is_own(row: dict[str, Any]) -> bool:
    """Whether an axis, or the bus of a chip: names of chips."""
    return bool(row.get("kind", PACKET_LANE) == PACKET_LANE)


def _clash(parts: Sequence[dict[str, Any]]) -> bool:
    """Whether chips of two parts have one name."""
    names = Counter(
        name for part in parts
        for name in {row["name"] for row in (*part["axes"], *part["lanes"]) if _is_own(row)}
    )  # fmt: skip
    return any(count > 1 for count in names.values())


def _distinct(boards: Sequence[str]) -> list[str]:
    """Return what tells parts apart, with a dot behind it: names of nodes or boards, or numbers."""
    nodes = [name.rpartition(".")[2] for name in boards]
    # The short names first: "left" rather than "two.left", if no two are alike.
    names = nodes if len({*nodes}) == len(nodes) else boards
    if len({*names}) < len(names):
        names = [f"{name}_{number}" for number, name in enumerate(names, 1)]
    return [f"{name}." for name in names]
