"""The lanes of a board: what is drawn of it over time, and where each comes from."""

from typing import Any, Final, NamedTuple

from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.core.signals import Net, Plant, Value
from vbus.plant.encoder import EncodedPlant
from vbus.version import __version__
from vbus.views.scope.lane import Lane
from vbus.views.wave.signals import nets_of

FORMAT: Final = 1

NUMBER: Final = "number"
LINE: Final = "line"
PACKET_LANE: Final = "packets"
MARK_LANE: Final = "marks"
REGISTER_LANE: Final = "register"
"""Of a chip's view alone: not drawn over time."""

MARK_TITLES: Final = {
    "violation": "violations", "fault": "faults", "interrupt": "interrupts", "host": "hosts",
    "bookmark": "bookmarks",
}  # fmt: skip
"""Kinds of marks, each a lane of its own."""
GAP_MARK: Final = "gap"
"""Kind of the marks where something of a board that runs is left out."""
GAPS: Final = "left out"
"""Name of their lane."""
NODE_MARK: Final = "node"
"""Kind of the marks of nodes that go and come back, on a page of several boards that run."""


class Lateness(NamedTuple):
    """How well a board that runs keeps to the wall clock.

    Attributes:
        lag: how late chip time is (ps).
        overload: how many times the machine would be enough for it; 0 while it keeps up.
        skew: how far apart in wall time all nodes have reached one instant, the last time that was
            measured (ns); None of a board that is no node in real time.
    """

    lag: int = 0
    overload: float = 0.0
    skew: int | None = None


class Lanes:
    """All lanes of a board.

    Args:
        board: the board.
        strobes: whether the lines of the host buses are among them.
        late: how a board that runs now keeps to the wall clock; None of one that does not.

    Attributes:
        all: every lane, by its number.
        axes: the axes, as in the description for a page.
        values: by chip: its lanes, as its ``VALUES`` have them.
        plants: by chip: the mechanics behind its axes, each with its lanes.
        nets: by name of a net: net and lane.
        packets: lane of the packets by chip.
        marks: lanes of the marks by kind; those of gaps are of a board that runs alone.
        lag: how late chip time is, of a board that runs in real time.
        overload: how many times the machine would be enough for it; 0 while it keeps up.
        skew: how far apart in wall time the nodes are that it is one of.
    """

    def __init__(self, board: Board, strobes: bool, late: Lateness | None = None) -> None:
        self.all: list[Lane] = []
        self.axes: list[dict[str, Any]] = []
        self.values: dict[str, list[Lane]] = {}
        self.plants: dict[str, list[tuple[Plant, list[Lane]]]] = {}
        self.nets: dict[str, tuple[Net, Lane]] = {}
        self.packets: dict[str, Lane] = {}
        self.marks: dict[str, Lane] = {}
        self._board: Board = board
        for chip in board.chips:
            self._add_chip(chip)
        for chip in board.chips:
            self.packets[chip.name] = self._add(
                None, f"{chip.name} bus", f"{chip.name}: packets", PACKET_LANE
            )
        bus = {pin.net for chip in board.chips for pin in chip.bus_pins}
        for net in nets_of(board, ()):
            # The strobes of one bus cycle are ten edges: they are shown on demand.
            if strobes or net not in bus:
                kind = LINE if net.width == 1 else NUMBER
                self.nets[net.name] = net, self._add(None, net.name, net.name, kind)
        for kind, title in MARK_TITLES.items():
            self.marks[kind] = self._add(None, title, title, MARK_LANE)
        if late is not None:
            self.marks[GAP_MARK] = self._add(None, GAPS, GAPS, MARK_LANE)
        self.lag: Lane | None = None
        self.overload: Lane | None = None
        self.skew: Lane | None = None
        if late is not None and board.policy == "realtime":
            self.lag = self._add(None, "wall lag", "wall lag", NUMBER, "s", 1e-12)
            self.overload = self._add(None, "overload", "overload", NUMBER, "x", 0.01)
            if late.skew is not None:
                self.skew = self._add(None, "skew", "wall skew between nodes", NUMBER, "s", 1e-9)

    def _add_chip(self, chip: Chip) -> None:
        rows = chip.VALUES.lanes(chip.axis_count)
        values = self.values[chip.name] = []
        plants = self.plants[chip.name] = []
        # A chip without an axis has lanes of its own all the same.
        for number in range(max(chip.axis_count, 1)):
            # Of several axes each has its number; one alone is called as its chip.
            axis = chip.name if chip.axis_count < 2 else f"{chip.name}.{number + 1}"
            plant = self._board.axes.get(f"{chip.name}.{number + 1}")
            turn = plant.encoder.counts if isinstance(plant, EncodedPlant) else None
            told_of = {"name": axis, "part": chip.part, "counts_per_rev": turn, "counts": "counts"}
            # Counts a sample become a speed only with the period.
            if chip.PERIOD_CLK and any(row.plain_unit.endswith("/sample") for row, _ in rows):
                told_of["sample"] = int(chip.clock.ps(chip.PERIOD_CLK))
            if chip.axis_count:
                self.axes.append(told_of)
            values += [self._of_value(axis, row) for row, of in rows if of == number]
            if plant is not None:
                behind = [self._of_value(axis, row) for row, _ in plant.VALUES.lanes(1)]
                plants.append((plant, behind))

    def _of_value(self, axis: str, row: Value) -> Lane:
        return self._add(axis, row.lane, row.name, NUMBER, row.plain_unit, row.scale)

    def add_register(self, chip: str, name: str) -> Lane:
        """Return a lane for a register of a chip."""
        return self._add(None, f"{chip}: {name}", name, REGISTER_LANE)

    def _add(self, axis: str | None, name: str, title: str, kind: str, *values: Any) -> Lane:
        lane = Lane(len(self.all), axis, name, title, kind, *values)
        self.all.append(lane)
        return lane

    def described(self, live: bool, control: bool = False) -> dict[str, Any]:
        """Return the description that a page gets before the first frame."""
        board = self._board
        pairs = [axis["name"] for axis in self.axes][:2]
        xy = [[f"{name}.{what}" for what in ("real", "desired") for name in pairs]]
        return {
            "format": FORMAT, "vbus": __version__, "board": board.name, "time": board.policy,
            "live": live, "control": control, "origin": "0", "now": str(board.now),
            "axes": self.axes, "lanes": [lane.described() for lane in self.all],
            "xy": xy if len(pairs) == 2 else [],
        }  # fmt: skip
