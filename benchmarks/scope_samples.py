#!/usr/bin/env python3
"""What it costs a board to record the samples of 16 axes for the scope's page:
``python benchmarks/scope_samples.py``.

Three boards in turn: one watched by nobody; one asked by name for telemetry at each sample, by
interpreted code; one recorded by :class:`vbus.views.scope.axis_sampler.AxisSampler`. Frames are
made every 50 ms, as a server makes them.
"""

import argparse
import statistics
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from many_axes import moving

from vbus.board.board import Board
from vbus.chips.base import SAMPLE
from vbus.core.kernel import MS, NEVER, SECOND
from vbus.views.scope.frames import numbers
from vbus.views.scope.recording import Recorder

AXES = 16
EVERY = 50 * MS


class Asking:
    """Asks one chip and its plant for telemetry at each sample, from outside the core."""

    def __init__(self, recorder: Recorder, chip: Any, look: Any, levels: list[Any]) -> None:
        self.chip, self.registers = chip, look.registers
        self.now = lambda: recorder.board.now
        lanes = recorder.lanes
        rows = zip(chip.VALUES.lanes(chip.axis_count), lanes.values[chip.name], strict=True)
        self.told = [(row.key.format(axis + 1), lane) for (row, axis), lane in rows]
        self.plants = [
            (plant, row.key, lane)
            for plant, behind in lanes.plants[chip.name]
            for (row, _), lane in zip(plant.VALUES.lanes(1), behind, strict=True)
        ]
        self.levels = levels
        self.timer = recorder.board.kernel.onlooker(self.look)

    def look(self) -> None:
        now, values = self.now(), self.chip.telemetry()
        for key, lane in self.told:
            value = values.get(key)
            if isinstance(value, int | float):
                lane.note(now, value)
        due = self.chip.due(SAMPLE)
        for plant, key, lane in self.plants:
            lane.note(due, plant.telemetry()[key])
        for net, lane in self.levels:
            lane.note(now, net.value)
        assert due != NEVER, "an axis rests"
        self.timer.at(due)

    def look_inside(self, on: bool) -> None:
        pass


def recorder_of(board: Board, asking: bool) -> Recorder:
    recorder = Recorder(board, edges=False)
    if asking:
        for chip in board.chips:
            mine = {pin.net.name for pin in chip.pins.values()}
            levels = [row for name, row in recorder.lanes.nets.items() if name in mine]
            look: Any = Asking(recorder, chip, recorder._looks[chip.name], levels)
            recorder._looks[chip.name] = look
    return recorder


class Watched:
    """A board on which 16 axes turn, and who watches it, if anybody."""

    def __init__(self, watch: str) -> None:
        self.board = moving(AXES)
        self.recorder = recorder_of(self.board, watch == "asked") if watch else None
        self.bytes = 0
        if self.recorder is not None:
            self.recorder.start()
            self.recorder.take(numbers)

    def share(self, seconds: float) -> float:
        """Return seconds of computing per second of chip time."""
        begun = time.process_time()
        slices = round(seconds * SECOND / EVERY)
        for _ in range(slices):
            self.board.run_for(EVERY)
            self.board.catch_up()
            if self.recorder is not None:
                self.bytes += sum(map(len, self.recorder.take(numbers)))
        return (time.process_time() - begun) * SECOND / (slices * EVERY)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=1.0, help="chip time of a round")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    boards = {watch: Watched(watch) for watch in ("", "asked", "recorded")}
    took: dict[str, list[float]] = {watch: [] for watch in boards}
    for _ in range(options.rounds):  # in turn: what else the machine does hits all of them
        for watch, one in boards.items():
            took[watch].append(one.share(options.seconds))
    alone, asked, recorded = (statistics.median(shares) for shares in took.values())
    print(f"{AXES} LM629s moving in real time, 256 us a sample: {alone * 100:.1f} % of a core")
    for name, share in (("asked by name", asked), ("recorded in the core", recorded)):
        more = share - alone
        print(f"{name:22} {more * 100:6.1f} % of a core more, {share / alone:5.1f} x")
    print(f"recorded : asked = {(recorded - alone) / (asked - alone):.2f}; goal <= 15 % more")


if __name__ == "__main__":
    main()
