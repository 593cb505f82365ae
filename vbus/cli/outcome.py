"""What became of each axis in a run: for the summary of ``vbus exec``."""

from dataclasses import dataclass, field
from typing import Any, Final

from vbus.board.board import Board
from vbus.core.kernel import MS
from vbus.core.signals import Observer
from vbus.nodes.machine import board_of
from vbus.record.format import JournalReader
from vbus.record.replay import Replay

_DRIVES: Final = ("drive", "command")
_SIZES: Final = ("error", "velocity", "profile")
"""Lanes whose greatest size is reported."""
# Three overshoots to either side: a well damped move to and back has two or three reversals.
_REVERSALS: Final = 6
"""Turns to and fro after which an axis is said to oscillate."""
# As in views/runs/motion.py: an encoder at rest shows up to one count to either side.
_NOISE: Final = 2
"""Counts that are no turn."""
# A run of hours that is played again must not take minutes.
_LOOKS: Final = 50_000
"""Looks until they become rarer: after 50 s of chip time."""
# 10 ms: a profile that passes through 0 with a motor command of 0 takes a sample or two.
_IDLE: Final = 10
"""Looks in a row at an axis that stands while its profile runs and its motor command is 0."""


@dataclass(slots=True)
class _AxisPath:
    """Where an axis has been.

    Attributes:
        first: position at the first look.
        last: at the last one.
        least: the least position.
        most: the greatest.
        turn: where it turned last, or was furthest since.
        rising: whether it moves up; None before it has moved.
        reversals: how often it has turned.
        desired: the profile's position at the last look.
        idle: looks in a row that found the profile running and no drive.
        idled: whether they were enough to be reported.
        running: whether the profile has a speed at the last look.
        undriven: why the chip could not move it at the last look; "" if it could.
        in_vain: the same at looks between which its profile ran.
        largest: the greatest size at any look, by lane (:data:`_SIZES`).
        unit: of its speed.
    """

    first: float
    last: float
    least: float
    most: float
    turn: float
    rising: bool | None = None
    reversals: int = 0
    desired: float | None = None
    idle: int = 0
    idled: bool = False
    running: bool = False
    undriven: str = ""
    in_vain: str = ""
    largest: dict[str, float] = field(default_factory=dict)
    unit: str = ""

    def measure(self, lane: str, value: float) -> None:
        """Take a value of a lane as it is now."""
        if lane == "profile":
            self.running = value != 0
        self.largest[lane] = max(self.largest.get(lane, 0), abs(value))

    def look(
        self, position: float, desired: float | None, drive: float | None, undriven: str
    ) -> None:
        """Take the axis as it is now."""
        stands = position == self.last
        self.last = position
        self.least = min(self.least, position)
        self.most = max(self.most, position)
        if self.rising is None:
            if abs(position - self.turn) > _NOISE:
                self.rising, self.turn = position > self.turn, position
        # The turning point moves along while the axis goes on in its direction.
        elif (position > self.turn) == self.rising:
            self.turn = position
        elif abs(position - self.turn) > _NOISE:
            self.rising, self.turn = not self.rising, position
            self.reversals += 1
        # A profile runs if the desired position has changed since the last look.
        runs = None not in (desired, self.desired) and desired != self.desired
        # Twice in a row: a filter that takes effect in the sample after STT is no mistake.
        if runs and undriven and self.undriven:
            self.in_vain = undriven
        self.undriven = undriven
        # An ideal motor follows with a command of 0; at the start of a slow move there is no error.
        lags = desired is not None and abs(desired - position) > _NOISE
        self.idle = self.idle + 1 if runs and stands and lags and drive == 0 else 0
        self.idled |= self.idle >= _IDLE
        self.desired = desired

    def sentence(self) -> str:
        """Return what became of it."""
        parts = [f"ended at {self.last:g} counts"]
        if error := self.largest.get("error"):
            parts.append(f"was {error:g} counts off at most")
        # The same words for no motion in either way: a range from 0 to 0 says less.
        if self.least == self.most:
            parts.append("did not move")
        else:
            parts.append(f"moved from {self.first:g} between {self.least:g} and {self.most:g}")
            if speed := self.largest.get("velocity"):
                commanded = self.largest.get("profile")
                of = "" if commanded is None else f" (commanded {commanded:.6g})"
                parts.append(f"at up to {speed:.6g}{of} {self.unit}")
        if self.in_vain:
            parts.append(f"its profile ran in vain: {self.in_vain}")
        elif self.undriven and self.least == self.most:
            parts.append(self.undriven)
        elif self.idled:
            parts.append("its profile ran while the motor command was 0")
        elif self.running:
            parts.append("its profile still ran then")
        if self.reversals >= _REVERSALS:
            parts.append(f"oscillated ({self.reversals} reversals)")
        return ", ".join(parts)


MOST_PLAYED: Final = 100_000
"""Bus cycles of a run that is played again for what became of its axes: some seconds."""


class AxisOutcomes(Observer):
    """Looks at the axes of a board once in a millisecond: as an observer at bus cycles, or always.

    Args:
        board: the board.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._courses: dict[str, _AxisPath] = {}
        self._next = 0
        self._timer = board.kernel.onlooker(self._pass)

    def watch(self) -> None:
        """Look also while no host does anything: one may sleep, or wait for an interrupt."""
        self._timer.at(self._board.now + MS)

    def _pass(self) -> None:
        self.look()
        now = self._board.now
        self._timer.at(now + max(MS, now // _LOOKS))

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Look, if it is time."""
        if when >= self._next:
            self._next = when + MS
            self.look()

    def look(self) -> None:
        """Look at every axis."""
        for chip in self._board.chips:
            values: dict[str, Any] = chip.telemetry()
            drive = next((values[key] for key in _DRIVES if key in values), None)
            drawn: dict[tuple[str, int], str] = {
                (row.lane, axis): row.key.format(axis + 1)
                for row, axis in chip.VALUES.lanes(chip.axis_count)
            }
            for axis in range(chip.axis_count):
                # An axis whose chip has no lane of its real position has no course.
                if ("real", axis) not in drawn:
                    continue
                key = drawn["real", axis]
                real, desired = values[key], values.get(drawn.get(("desired", axis), ""))
                _, _, number = key.partition(" ")
                course = self._courses.setdefault(
                    f"{chip.name}.{number}" if number else chip.name,
                    _AxisPath(real, real, real, real, real),
                )
                course.look(real, desired, drive, chip.undriven(axis))
                for lane in _SIZES:
                    if (lane, axis) in drawn:
                        course.measure(lane, values[drawn[lane, axis]])
                speed = chip.VALUES.lane("velocity")
                course.unit = speed.unit if speed is not None else ""

    def brief(self) -> list[str]:
        """Return where each axis is that has moved or is to: of a board looked at now and then."""
        return [
            f"{axis}: began at {course.first:g} counts, ended at {course.last:g}"
            + ("" if course.desired is None else f"; its profile is at {course.desired:g}")
            + (f"; {course.undriven}" if course.undriven else "")
            for axis, course in self._courses.items()
            if course.first != course.last or course.desired not in (None, course.last)
        ]

    def lines(self) -> list[str]:
        """Return a sentence for each axis."""
        return [f"{axis}: {course.sentence()}" for axis, course in self._courses.items()]


def axes_played(reader: JournalReader, name: str) -> tuple[list[str], Board]:
    """Play a recorded run again.

    Args:
        reader: its journal, read from the beginning.
        name: of the journal, for messages.

    Returns:
        A sentence for each axis, and the board at the end.

    Raises:
        VbusError: its board cannot be made again.
    """
    board = board_of(reader.header, name)
    outcomes = AxisOutcomes(board)
    outcomes.watch()
    Replay(board, reader, reader.header.families).run()
    outcomes.look()
    return outcomes.lines(), board
