"""What became of one run, and what its bus cycles were."""

from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import pairwise
from typing import Any, Final

from msgspec import Struct

from vbus.board.board import Board
from vbus.campaign.world import longest_cycle
from vbus.chips.base import Chip
from vbus.chips.packets import STATUS, Packet
from vbus.circuit.stream import PacketReader, PacketStream
from vbus.core.kernel import MS, US
from vbus.core.signals import EdgeTaker, Observer, ValueTable, Violation
from vbus.core.signals.values import reader
from vbus.plugins import family_of
from vbus.views.runs.motion import STEP, AxisCourse, Motion

_SETTLE: Final = 10 * MS
"""Chip time between two looks whether the motors of a run have come to rest; not measured."""
_ON: Final = 1171 * US
"""After so much time a value is looked at again: one that goes on changing is not compared.
Not measured."""
_PARTS: Final = 8
"""Looks in a cycle of the chips at the end of a reference run; not measured."""
_LOOKS: Final = 50
"""For how long a motor may come to rest when the host has ended: so many looks, half a second."""


Values = dict[str, tuple[float | str, float]]


class SeenCycle(Struct, frozen=True):
    """One bus cycle of the reference run.

    Attributes:
        chip: the chip.
        number: of the cycle among those of its chip, from 1 on.
        write: whether the host wrote.
        when: its instant (ps).
        group: what it is: packet, place in the packet, and the packet before.
    """

    chip: str
    number: int
    write: bool
    when: int
    group: str


class Axis(Struct, frozen=True):
    """What an axis did.

    Attributes:
        moves: first, last, least and greatest position of each move (counts).
        last: where it was at the end (counts).
        speed: its greatest speed (counts in a millisecond).
        runs: whether it was in motion at the end.
        peaks: of each move its greatest speed, and the first instant of that (ps).
        drive: what its chip gives the motor at the end, as a share of full command.
    """

    moves: list[tuple[int, int, int, int]]
    last: int
    speed: int
    runs: bool
    peaks: list[tuple[int, int]] = []
    drive: float = 0.0


class Account(Struct):
    """What became of one run.

    Attributes:
        code: exit code of a program, 0 or 1 of a test or function.
        stuck: why it was ended, if it hung.
        slow: whether the machine was too slow for a verdict.
        unfired: faults that have not come about: name, target and when.
        output: what it has said.
        errors: what it has complained of.
        cycles: bus cycles it made.
        now: instant at its end (ps).
        findings: what it broke, as ``"x lm628.busy-write"``, each once.
        values: what chips have at the end, by chip and name: the value, and how far another one
            may be from it; of flags :data:`FLAGS`, less the bits that go on changing.
        axes: what each axis did.
        seen: its bus cycles, of a reference run.
        edges: of outputs that hosts look at, of a reference run: output, instant (ps), level.
        turns: whether threads of the host take turns, in an order that a world may change.
        links: whether the host's link is in this process: no wait of it is the wall clock's.
    """

    code: int = 0
    stuck: str = ""
    slow: bool = False
    unfired: list[tuple[str, str, str]] = []
    output: str = ""
    errors: str = ""
    cycles: int = 0
    now: int = 0
    findings: list[str] = []
    values: Values = {}
    axes: dict[str, Axis] = {}
    seen: list[SeenCycle] = []
    edges: list[tuple[str, int, int]] = []
    turns: bool = False
    links: bool = False


class _Groups(PacketReader):
    """Says what the bus cycles of a chip are, by the packets they make."""

    def __init__(self, board: Board) -> None:
        self._stream = PacketStream.of(board.chips, (self,))
        self._open: dict[str, dict[tuple[int, bool, int], list[int]]] = {}
        self._before: dict[str, str] = {}
        self.rows: list[SeenCycle] = []
        self._count: dict[str, int] = {}
        self._buses = {chip.name for chip in board.chips if chip.BUS is not None}

    def take(self, when: int, names: str, write: bool, address: int, data: int) -> None:
        """Take a bus cycle; its group comes with its packet."""
        for name in names.split("+"):
            if name not in self._buses:
                continue
            number = self._count[name] = self._count.get(name, 0) + 1
            waiting = self._open.setdefault(name, {})
            waiting.setdefault((when, write, address), []).append(len(self.rows))
            self.rows.append(SeenCycle(name, number, write, when, "part of no packet"))
        self._stream.bus_cycle(when, "", names, write, address, data)

    def packet(self, chip: str, packet: Packet) -> None:
        """Name the cycles of a packet."""
        before = self._before.get(chip, "the beginning")
        waiting = self._open.get(chip, {})
        for place, cycle in enumerate(packet.cycles, 1):
            rows = waiting.pop((cycle.when, cycle.write, cycle.address), [])
            of = f" {place} of {len(packet.cycles)}" if len(packet.cycles) > 1 else ""
            way = "write" if cycle.write else "read"
            for row in rows:
                seen = self.rows[row]
                group = f"{packet.name}{of} ({way}) after {before}"
                self.rows[row] = SeenCycle(chip, seen.number, seen.write, seen.when, group)
        # Polls stand between all packets, and would hide what came before.
        if packet.kind != STATUS:
            self._before[chip] = packet.name

    def finish(self) -> list[SeenCycle]:
        """Return all cycles."""
        self._stream.finish()
        return self.rows


class Witness(Observer):
    """Sees one run, from now on.

    Args:
        board: the board, on which no host is yet.
        reference: whether bus cycles and edges are noted one by one.
    """

    def __init__(self, board: Board, reference: bool = False) -> None:
        self._board = board
        self._motion = Motion(board)
        self._findings: dict[str, None] = {}
        self._cycles = 0
        self._groups = _Groups(board) if reference else None
        self._edges: list[tuple[str, int, int]] = []
        board.observe(self)
        outputs = [
            f"{chip.name}.{output}"
            for chip in (board.chips if reference else ())
            if not chip.CONNECTOR
            for output in family_of(chip.part).outputs
        ]
        self._watched = [
            (board.find_pin(one).net, EdgeTaker(partial(self._edge, one))) for one in outputs
        ]
        for net, observer in self._watched:
            net.observe(observer)

    def _edge(self, output: str, when: int, net: str, level: int) -> None:
        self._edges.append((output, when, level))

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Count one."""
        self._cycles += 1
        if self._groups is not None:
            self._groups.take(when, chip, write, address, data)

    def violation(self, violation: Violation) -> None:
        """Note a finding."""
        self._findings.setdefault(f"{violation.chip} {violation.rule}")

    def account(self, **of_host: Any) -> Account:
        """Let motors come to rest, and return what became of the run.

        Args:
            of_host: what is known of the host: ``code``, ``stuck``, ``slow``, ``output``,
                ``errors``, ``turns``, ``links``.
        """
        # What follows is no doing of the host: its cycles and its end are noted before.
        board, cycles, now = self._board, self._cycles, self._board.now
        # A line that this witness alone listens to is not wired to a host.
        for net, observer in self._watched:
            net.unobserve(observer)
        for found in board.left_over():
            self.violation(found)
        unfired = [(one.name, one.target, one.when.text) for one in board.faults.unfired()]
        counts: list[int] = []
        # Half a second at most: an axis that runs on by order never comes to rest.
        for _ in range(_LOOKS):
            before, counts = counts, [axis.count for axis in board.axes.values()]
            if before == counts:
                break
            board.run_for(_SETTLE)
        values = _values(board)
        there = {name: int(axis.count) for name, axis in board.axes.items()}
        # No multiple of a sample of 256, 341.3 or 520 us: a value that repeats with it is found.
        board.run_for(_ON)
        later = [_values(board)]
        # What changes within a cycle of the chips tells when it was looked at: STATUS has BUSY.
        for _ in range(_PARTS if self._groups else 0):
            board.run_for(longest_cycle(board) // _PARTS)
            later.append(_values(board))
        drives = _drives(board)
        axes = {
            name: _axis(
                course, abs(int(board.axes[name].count) - there[name]) > _NEAR, drives.get(name, 0)
            )
            for name, course in self._motion.stop().items()
        }
        board.unobserve(self)
        return Account(
            cycles=cycles, now=now, findings=sorted(self._findings), axes=axes,
            values=dict(_steady(values, later)),
            seen=self._groups.finish() if self._groups else [],
            edges=self._edges, unfired=unfired, **of_host,
        )  # fmt: skip


def _axis(course: AxisCourse, runs: bool, drive: float) -> Axis:
    """Return what an axis did that ``runs`` at the end, its motor at this share of full command."""
    ends, peaks = [], []
    for move in course.moves:
        path = move.path
        steps = [abs(b - a) for a, b in pairwise(path)]
        ends.append((path[0], path[-1], min(path), max(path)))
        peaks.append((max(steps), move.begin + steps.index(max(steps)) * STEP))
    speed = max((speed for speed, _ in peaks), default=0)
    return Axis(ends, course.final, speed, runs, peaks, drive)


def _drives(board: Board) -> dict[str, float]:
    """Return by axis what its chip gives the motor, as a share of full command."""
    found = {}
    for chip in board.chips:
        row = chip.VALUES.lane("output")
        if row is not None:
            values = chip.telemetry()
            for axis in range(chip.axis_count):
                name = f"{chip.name}.{axis + 1}"
                found[name] = abs(float(values[row.key.format(axis + 1)]))
    return found


def _steady(values: Values, later: list[Values]) -> Iterator[tuple[str, tuple[float | str, float]]]:
    """Give what tells more than when it was looked at: not what goes on changing, but for flags."""
    for name, (value, near) in values.items():
        looks = [look[name][0] for look in later]
        if near == FLAGS and isinstance(value, int):
            moving = 0
            for look in looks:
                moving |= value ^ int(look)
            yield name, (value, FLAGS - moving)
        elif all(look == value for look in looks):
            yield name, (value, near)


_MEASURED: Final = ("velocity", "output", "error")
"""Lanes of what is measured or worked out in each sample: motion tells more of it."""
_NEAR: Final = 4
"""Counts by which a position may differ: an encoder line. Not measured."""


FLAGS: Final = -1
"""In place of a tolerance: the value is made of bits, or of their names, in which specimens differ:
a reset leaves 84h or C4h (LM-RST-5)."""


@cache
def _rows(
    table: ValueTable, axes: int
) -> tuple[list[tuple[str, float]], Callable[[Chip], list[float | str]]]:
    """Return axis, name and tolerance of each value that hosts decide, and what reads them all."""
    rows: list[tuple[str, float]] = []
    places = []
    for row in table.rows:
        # What samples change is compared as motion, with a tolerance of its own.
        if row.moves or row.lane in _MEASURED or not row.place:
            continue
        for axis in row.of_axes(axes):
            at = f".{axis + 1}" if axes > 1 and "{}" in row.place else ""
            bits = bool(row.fields) or row.text
            near = _NEAR if row.lane in ("desired", "real") else FLAGS if bits else 0
            rows.append((f"{at} {row.name}", near))
            places.append(row.number(axis))
    return rows, reader(f"[{', '.join(places)}]")


def _values(board: Board) -> Values:
    """Return what the chips of a board have: what hosts have loaded, and where axes are."""
    board.catch_up()
    found: Values = {}
    for chip in board.chips:
        rows, read = _rows(chip.VALUES, chip.axis_count)
        for (name, near), value in zip(rows, read(chip), strict=True):
            found[f"{chip.name}{name}"] = (value, near)
    return found
