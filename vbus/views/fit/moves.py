"""A recorded move of an axis: what drove it, period by period, and where that led.

A move is read from a journal, which is played again; from a table of numbers; or from a capture of
a chip's PWM and of the encoder's channels.
"""

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

from mypy_extensions import i64

from vbus.board.board import Board
from vbus.core.errors import CaptureError, VbusError
from vbus.core.kernel import SECOND
from vbus.core.signals import Plant
from vbus.faults.plant import FaultyPlant
from vbus.faults.upsets import upsets_of
from vbus.plant.shaft import Shaft
from vbus.record.format import JournalReader
from vbus.record.replay import Replay
from vbus.views.silicon.capture import Capture
from vbus.views.silicon.capture_csv import unit_of_time

MOST_STEPS: Final = 20_000
"""Periods of a move: some seconds for each of the twenty times that a fit simulates it."""
STANDS: Final = 20
"""Periods that a move goes on for after its axis has come to rest."""
UNEVEN: Final = 0.05
"""How far from even the times of a table may be, in periods."""
COLUMNS: Final = {
    "command": ("command", "pwm", "duty", "drive"),
    "volts": ("volts", "voltage"),
    "counts": ("counts", "count", "position"),
    "current": ("current", "amps"),
}
"""What a table's columns mean, by what their titles begin with."""
CHANNELS: Final = ("pwm", "sign", "a", "b")


class Driven(NamedTuple):
    """A period in which the drive holds.

    Attributes:
        seconds: how long it is.
        command: of full scale, -1.0 to 1.0.
        counted: the encoder's count at its end; None: not seen.
        current: the motor's at its end (A); None: not recorded.
    """

    seconds: float
    command: float
    counted: int | None
    current: float | None = None


@dataclass(frozen=True, slots=True)
class RecordedMove:
    """A move that begins at rest.

    Attributes:
        first: the count at its beginning.
        steps: what came then.
    """

    first: int
    steps: list[Driven]

    def cut(self, name: str, begin: float = 0.0, end: float = float("inf")) -> "RecordedMove":
        """Return the part of it in which the axis is driven and moves.

        Args:
            name: what errors call the run.
            begin: seconds that are left out before it.
            end: seconds at which it ends.

        Raises:
            VbusError: nothing moves in it, it begins in motion, or is too long.
        """
        first, now, steps = self.first, 0.0, []
        for step in self.steps:
            now += step.seconds
            if now > begin and now <= end + 1e-12:
                steps.append(step)
            elif now <= begin and step.counted is not None:
                first = step.counted
        driven = next((n for n, step in enumerate(steps) if step.command), len(steps))
        held = driven or STANDS  # an axis may also be held by its drive
        early = [step.counted for step in steps[:held] if step.counted is not None]
        # At rest a count flickers by one; noise of 0.4 counts seldom makes it two.
        if any(abs(count - first) > 2 for count in early):
            raise VbusError(
                f"{name}: the axis moves at the beginning, before its drive does anything: let the"
                " record begin at rest, a row before the drive, or give such an instant with --from"
            )
        moved = last = 0
        there = first
        for number, step in enumerate(steps, 1):
            if step.counted is not None and step.counted != there:
                there, moved, last = step.counted, moved + abs(step.counted - there), number
        steps = steps[driven : last + STANDS]
        if moved < 2 * STANDS:
            raise VbusError(
                f"{name}: the axis moves by {moved} counts; a fit needs some hundred: record a"
                " longer move, or look whether this is the axis and the time (--axis, --from, --to)"
            )
        if len(steps) > MOST_STEPS:
            raise VbusError(
                f"{name}: the axis is driven for {len(steps)} periods; at most {MOST_STEPS} are"
                " fitted: choose some moves with --from and --to"
            )
        return replace(self, first=first, steps=steps)


class _Tap(FaultyPlant):
    """Stands between a chip and its plant, changes nothing, and takes down what passes."""

    def __init__(self, inner: Plant, period: float) -> None:
        super().__init__(inner)
        self.first: int = int(inner.count)
        self.steps: list[Driven] = []
        self.period: float = period

    def prepare(self, period: float) -> None:
        """Take down how long a period is."""
        self.period = period
        super().prepare(period)

    def drive(self, command: float, error: i64) -> i64:
        """Take down what the drive was, and where it has led."""
        count = super().drive(command, error)
        self.steps.append(Driven(self.period, command, int(count)))
        return count

    def resting(self) -> bool:
        """Have every period run."""
        return False  # a period at rest is one of the move, too


def journal_move(board: Board, reader: JournalReader, name: str, axis: str) -> RecordedMove:
    """Return what an axis did in a recorded run, which is played again.

    Args:
        board: built from the same file, at instant 0, with no ports open.
        reader: its journal, read from the beginning.
        name: what errors call it.
        axis: such as ``"x.1"``.

    Raises:
        VbusError: its board lacks the axis, or the run is another one now.
    """
    plant = board.axes.get(axis)
    if plant is None or "drive" not in plant.TAKES:
        servos = [key for key, one in board.axes.items() if "drive" in one.TAKES]
        raise VbusError(
            f"{name}: its board has no motor that takes a drive at axis {axis}; choose with --axis"
            f" one of {', '.join(servos) or 'another run: there is none in this one'}"
        )
    chip_name, _, number = axis.rpartition(".")
    chip = board.chip(chip_name)
    period = plant.period if isinstance(plant, Shaft) else chip.PERIOD_CLK / chip.clock.hz
    tap = _Tap(plant, period)
    upsets_of(chip).exchange(int(number) - 1, tap)
    found = Replay(board, reader, reader.header.families).run().divergence
    if found is not None and found.what != "state":  # at the end, the tap is no part of the board
        raise VbusError(
            f"{name}: its run is another one when it is played again, from entry {found.entry} on"
            f' ({found.where}); "vbus replay" shows more'
        )
    return RecordedMove(tap.first, tap.steps)


def table_move(lines: Iterable[str], name: str, gain: float) -> RecordedMove:
    """Return the move in a table: time, drive, counts, and the current if there is one.

    A row's drive holds from its instant to that of the next row. Rows may be missing.

    Args:
        lines: of text: titles, then numbers; separated by commas, semicolons or tabs.
        name: what errors call it.
        gain: the voltage at full command, for a column of volts.

    Raises:
        CaptureError: it is no such table; names the line.
    """
    text = list(lines)
    mark = max(",;\t", key=(text or [""])[0].count)
    rows = csv.reader(text, delimiter=mark)
    titles = [title.strip() for title in next(rows, [])]
    units = [unit_of_time(title, 0) for title in titles]
    at = {
        key: next((n for n, title in enumerate(titles) if title.lower().startswith(begins)), -1)
        for key, begins in COLUMNS.items()
    }
    drive = at["command"] if at["command"] >= 0 else at["volts"]
    if not any(units) or drive < 0 or at["counts"] < 0:
        raise CaptureError(
            f"{name}: line 1: the columns are {', '.join(titles) or 'missing'}; a fit needs time"
            ' (such as "time (ms)"; else seconds), command (-1 to 1) or volts, and counts; current'
            " (A) if there is one"
        )
    when = next(n for n, unit in enumerate(units) if unit)
    scale = 1.0 if drive == at["command"] else 1.0 / gain
    found: list[tuple[float, float, int, float | None]] = []
    for line, row in enumerate(rows, 2):
        if not row:
            continue
        try:
            command = float(row[drive]) * scale
            found.append((
                float(row[when]) * units[when] / SECOND, command, round(float(row[at["counts"]])),
                float(row[at["current"]]) if at["current"] >= 0 else None,
            ))  # fmt: skip
        except (ValueError, IndexError, OverflowError):
            raise CaptureError(
                f"{name}: line {line}: {mark.join(row)[:60]!r}: a number is missing or is none;"
                f" there are {len(titles)} columns"
            ) from None
        if not abs(command) <= 1.0 + 1e-6 and scale == 1.0:
            raise CaptureError(
                f"{name}: line {line}: a command of {command:g}; it is of full scale, -1 to 1"
            )
    if len(found) < 3:
        raise CaptureError(f"{name}: {len(found)} rows; a move has some hundred")
    return RecordedMove(found[0][2], list(_held(found, name)))


def _held(rows: list[tuple[float, float, int, float | None]], name: str) -> Iterator[Driven]:
    """Give the periods between rows; times are made even, so that they share one length."""
    times = [row[0] for row in rows]
    gaps = sorted(later - when for when, later in pairwise(times))
    usual = gaps[len(gaps) // 2]  # the median: rows that are missing do not move it
    if gaps[0] <= 0:
        raise CaptureError(f"{name}: time stands or runs backwards; sort its rows by time")
    spans = [max(round((later - when) / usual), 1) for when, later in pairwise(times)]
    # Over the whole table the rounding of single times does not count.
    period = (times[-1] - times[0]) / sum(spans)
    place = 0
    for number, (row, after, span) in enumerate(zip(rows, rows[1:], spans, strict=False), 2):
        place += span
        if abs(after[0] - times[0] - place * period) > UNEVEN * period * max(place, 10) / 10:
            raise CaptureError(
                f"{name}: line {number + 1}: its rows are not evenly apart: {after[0]:g} s is not"
                f" {place} periods of {period:g} s from the beginning; record at a constant rate"
            )
        yield from [Driven(period, row[1], None)] * (span - 1)
        yield Driven(period, row[1], after[2], after[3])


def capture_move(capture: Capture, name: str, wiring: dict[str, str], period: int) -> RecordedMove:
    """Return the move in a capture of PWM, its sign, and both channels of the encoder.

    Args:
        capture: of a logic analyser.
        name: what errors call it.
        wiring: the channels of ``pwm`` (high: on), ``sign`` (low: forward; may be left out), ``a``
            and ``b``.
        period: over which the PWM's mean is taken, best a whole number of its periods (ps).

    Raises:
        CaptureError: a channel is missing, or both channels of the encoder change at once.
    """
    bits: list[int] = []
    for signal in CHANNELS:
        channel = wiring.get(signal, "")
        if channel not in capture.channels and (signal != "sign" or channel):
            missing = f"there is no channel {channel!r}" if channel else "its channel is not given"
            raise CaptureError(
                f"{name}: {signal}: {missing}; give it with --map {signal}=CHANNEL; there are"
                f" {', '.join(capture.channels)}"
            )
        bits.append(capture.channels.index(channel) if channel else -1)
    pwm, sign, a, b = bits
    steps: list[Driven] = []
    before, drive, mean, count, place = 0, 0, 0, 0, -1
    for when, levels in capture.samples:
        begun = len(steps) * period
        while when >= begun + period and place >= 0:
            mean += drive * (begun + period - before)
            steps.append(Driven(period / SECOND, mean / period, count))
            before, mean, begun = begun + period, 0, begun + period
        mean += drive * (when - before)
        before = when
        drive = levels >> pwm & 1
        if sign >= 0 and levels >> sign & 1:
            drive = -drive
        # A and B take the states 00, 10, 11, 01 on the way up: a place of 0 to 3.
        now = (levels >> b & 1) * 2 + ((levels >> a ^ levels >> b) & 1)
        if place >= 0 and now != place:
            if (now - place) % 4 == 2:
                raise CaptureError(
                    f"{name}: {when} ps: both channels of the encoder change at once; sample"
                    " faster, or look whether they are these channels (--map a=..., b=...)"
                )
            count += 1 if (now - place) % 4 == 1 else -1
        place = now
    return RecordedMove(0, steps)
