"""What the core gives for lanes is what telemetry tells; who watches changes nothing."""

from typing import Any

import pytest

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.base import SAMPLE, Chip
from vbus.core.bits import nearest
from vbus.core.kernel import MS, NEVER
from vbus.core.signals import Value, ValueTable
from vbus.core.signals.values import reader
from vbus.plant.dc_motor import DcMotor
from vbus.record.journal import end_of
from vbus.views.scope.axis_sampler import PlantLanes
from vbus.views.scope.frames import SAMPLES, numbers, read
from vbus.views.scope.lane import Lane
from vbus.views.scope.recording import Recorder

CHIPS = {
    "LM629N-8": ('clock = "8 MHz"\nplant = "m"', "dc_motor"),
    "LM628N-8": ('clock = "8 MHz"\nplant = "m"', "ideal"),
    "MCP-1200": ('clock = "10 MHz"\nplant = "m"', "dc_motor"),
    "MC1241A": ('clock = "25 MHz"\nplants = ["m"]', "stepper"),
}
LM_MOVE = (
    (0, 0x1E), (1, 0), (1, 0x0A), (1, 1), (1, 44), (1, 7), (1, 208), (0, 0x04),
    (0, 0x1F), (1, 0), (1, 0x2A), (1, 0), (1, 0), (1, 0), (1, 200), (1, 0), (1, 8), (1, 0), (1, 0),
    (1, 0), (1, 0), (1, 1), (1, 0x2C), (0, 0x01),
)  # fmt: skip
MCP_MOVE = (
    (0x22, 0x10), (0x20, 0xE5), (0x21, 0x40), (0x26, 0), (0x27, 0x20), (0x28, 0x08),
    (0x29, 0), (0x2A, 0x10), (0x2B, 0), (0x05, 0x03), (0x00, 0x08),
)  # fmt: skip
PMD_MOVE = ((0x74,), (0x77, 24000), (0x0A,), (0x11, 5, 0), (0x12, 0, 1000), (0x1A,))


def made(part: str) -> Board:
    rows, model = CHIPS[part]
    return load_board_text(
        '[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n'
        f'[chips.x]\npart = "{part}"\n{rows}\n[plants.m]\nmodel = "{model}"\n'
    )


def give(board: Board, part: str) -> None:
    """Set the axis going."""
    port = board.open_port("h")
    if part.startswith("LM"):
        for address, data in LM_MOVE:
            while port.read(0) & 1:
                pass
            port.write(address, data)
    elif part == "MCP-1200":
        for address, data in MCP_MOVE:
            port.write(address, data)
            board.run_for(MS)
    else:
        for code, *words in PMD_MOVE:
            for address, data in ((1, code), *((0, word) for word in words)):
                port.wait(10 * MS)
                if not address:
                    port.write(0, data >> 8)
                port.write(address, data & 0xFF)


def named(board: Board) -> list[tuple[list[Any], list[Any]]]:
    """Return what chips and plants give for lanes, and the same of what telemetry names."""
    pairs = []
    for part in (*board.chips, *board.axes.values()):
        axes = part.axis_count if isinstance(part, Chip) else 1
        told = part.telemetry()
        by_name = [
            nearest(told[row.key.format(axis + 1)] / row.scale)  # type: ignore[operator]
            for row, axis in part.VALUES.lanes(axes)
        ]
        pairs.append((part.VALUES.steps(axes)(part), [*by_name, told.get("interrupt", 0)]))
    return pairs


def steps_of(chip: Chip) -> list[float]:
    """Return what the lanes of a chip are given."""
    chip.advance()
    return chip.VALUES.steps(chip.axis_count)(chip)


@pytest.mark.parametrize("part", CHIPS)
def test_values_for_lanes_are_those_that_telemetry_names(part: str) -> None:
    board = made(part)
    give(board, part)
    seen = set()
    for _ in range(400):
        due = board.chips[0].due(SAMPLE)
        board.run_until(due if due != NEVER else board.now + MS)
        for values, told in named(board):
            assert values == told
            assert [type(value) for value in values] == [type(value) for value in told]
        seen.add(repr(steps_of(board.chips[0])))
    assert len(seen) > 50


@pytest.mark.parametrize("part", CHIPS)
def test_each_value_has_its_place_in_the_chip(part: str) -> None:
    (chip,) = made(part).chips
    assert len(chip.VALUES.rows) > 30
    for row in chip.VALUES.rows:
        for axis in row.of_axes(chip.axis_count):
            value = reader(row.raw(axis))(chip)
            assert isinstance(value, str if row.text else int | float), row.name
    keys = [row.key for row in chip.VALUES.rows if row.key]
    assert len(keys) == len({*keys})


def rows_of(lane: Lane) -> list[tuple[int, float]]:
    return list(zip(lane.times, lane.values, strict=True))


def asked(part: str) -> dict[tuple[str | None, str], list[tuple[int, float]]]:
    """Return rows of the lanes of a board whose chip is asked for telemetry at each sample."""
    board = made(part)
    lanes = Recorder(board, edges=False).lanes
    (chip,) = board.chips
    give(board, part)
    rows = [
        (row.key.format(axis + 1), lane)
        for (row, axis), lane in zip(
            chip.VALUES.lanes(chip.axis_count), lanes.values["x"], strict=True
        )
    ]
    behind = [
        (plant, row.key, lane)
        for plant, those in lanes.plants["x"]
        for (row, _), lane in zip(plant.VALUES.lanes(1), those, strict=True)
    ]
    for lane in [lane for _, lane in rows] + [lane for _, _, lane in behind]:
        lane.forget()
    while board.now < 200 * MS:
        told = chip.telemetry()
        for key, lane in rows:
            lane.note(board.now, told[key])  # type: ignore[arg-type]
        due = chip.due(SAMPLE)
        for plant, key, lane in behind:
            first = lane.untold or due == NEVER
            value = plant.telemetry()[key]
            lane.note(board.now if first else due, value)  # type: ignore[arg-type]
        board.run_until(due if due != NEVER else board.now + MS)
    return {(lane.axis, lane.name): rows_of(lane) for lane in lanes.all if lane.axis}


@pytest.mark.parametrize("part", ["LM629N-8", "MCP-1200", "MC1241A"])
def test_what_is_recorded_is_what_asking_at_each_sample_gives(part: str) -> None:
    board = made(part)
    give(board, part)
    recorder = Recorder(board, edges=False)
    recorder.start()
    board.run_until(200 * MS - 1)
    recorded = {(lane.axis, lane.name): rows_of(lane) for lane in recorder.lanes.all if lane.axis}
    for name, rows in asked(part).items():
        assert recorded[name] == rows, name
    assert max(map(len, recorded.values())) > 100


@pytest.mark.parametrize("part", CHIPS)
@pytest.mark.parametrize("inside", [False, True])
def test_a_board_that_is_watched_ends_as_one_that_is_not(part: str, inside: bool) -> None:
    ends = []
    for watched in (False, True):
        board = made(part)
        recorder = Recorder(board, edges=False)
        if watched:
            recorder.start()
            recorder.look_inside(inside)
        give(board, part)
        board.run_until(300 * MS)
        recorder.take(numbers)
        recorder.stop()
        board.run_until(301 * MS)
        ends.append(end_of(board))
    assert ends[0] == ends[1]


def taken(recorder: Recorder, lane: int) -> list[tuple[int, float]]:
    """Take frames; return the rows of one lane in them."""
    return [
        (frame.first + round(tick), value)
        for frame in read(b"".join(recorder.take(numbers)))
        if frame.kind == SAMPLES and frame.lane == lane
        for tick, value in zip(*frame.columns, strict=True)
    ]


@pytest.mark.parametrize("part", ["LM629N-8", "MCP-1200", "MC1241A"])
def test_samples_between_two_sendings_can_be_left_out_and_taken_again(part: str) -> None:
    board = made(part)
    recorder = Recorder(board, edges=False)
    recorder.look_at_samples(False)
    recorder.start()
    give(board, part)
    position, real = next(
        (place, lane.number)
        for place, lane in enumerate(recorder.lanes.values["x"])
        if lane.name == "real"
    )
    taken(recorder, real)
    for _ in range(3):
        board.run_for(20 * MS)
        assert taken(recorder, real) == [(board.now, steps_of(board.chips[0])[position])]
    begun = board.now
    recorder.look_at_samples(True)
    board.run_for(20 * MS)
    rows = taken(recorder, real)
    assert len(rows) > 5
    assert begun < rows[0][0] < rows[-1][0] < board.now
    recorder.look_at_samples(False)
    board.run_for(20 * MS)
    assert len(taken(recorder, real)) == 1


def test_nothing_is_recorded_once_nobody_watches() -> None:
    board = made("LM629N-8")
    give(board, "LM629N-8")
    recorder = Recorder(board, edges=False)
    recorder.start()
    board.run_for(10 * MS)
    recorder.stop()
    recorder.take(numbers)
    board.run_for(10 * MS)
    assert not any(lane.times for lane in recorder.lanes.all)


@pytest.mark.core("interpreted")
def test_a_plant_may_have_a_lane_more_and_numbers_that_are_not_whole() -> None:
    class Warm(DcMotor):
        """A motor with a lane more."""

        VALUES = ValueTable(
            *DcMotor.VALUES.rows, Value("heat", "heat", unit="K", key="heat", lane="heat")
        )
        heat = 12.5

    plant = Warm()
    plant.prepare(256e-6)
    lanes = [
        Lane(n, "x", row.lane, row.name, "number", row.unit, row.scale)
        for n, (row, _) in enumerate(Warm.VALUES.lanes(1))
    ]
    PlantLanes(plant, lanes).note(5, 7)
    assert [rows_of(lane) for lane in lanes] == [[(5, 0)], [(5, 0)], [(5, 12.5)]]


def test_values_that_were_told_late_stand_where_they_began() -> None:
    lane = Lane(0, None, "x", "x", "number")
    for when, value in ((1, 5), (3, 6), (3, 7), (2, 8)):
        lane.note(when, value)
    lane.early = True
    assert lane.take_values() == ([1, 2, 3, 3], [5, 8, 6, 7])
    assert lane.take_values() == ([], [])
