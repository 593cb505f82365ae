"""Oscillators that stand or are off their frequency, by what hosts and outputs show."""

import pytest

from tests.unit.faults.bench import (
    DC,
    LM,
    MC,
    MCP,
    SAMPLE,
    STEPPER,
    Lm,
    Mc,
    Mcp,
    build,
    settle,
    telemetry,
)  # fmt: skip
from vbus.board import snapshot
from vbus.board.board import Board
from vbus.core.kernel import MS, NS, US
from vbus.core.signals import Observer

ALL = [(LM, DC), (MCP, DC), (MC, STEPPER)]


class Edges(Observer):
    def __init__(self) -> None:
        self.rises: list[int] = []

    def edge(self, when: int, net: str, level: int) -> None:
        if level:
            self.rises.append(when)


def watched(board: Board, pin: str) -> list[int]:
    edges = Edges()
    board.watch(pin, edges)
    return edges.rises


def spinning(chip: str, plant: str) -> Board:
    board = build(chip, plant)
    {LM: Lm, MCP: Mcp, MC: Mc}[chip](board).spin()
    settle(board, 50)
    return board


# -- it stands ----------------------------------------------------------------------------------


def test_a_chip_whose_clock_stands_stays_busy_and_goes_on_where_it_was() -> None:
    board = build()
    host = Lm(board)
    host.port.write(0, 0x1E)
    falls = board.chip("x").ready_at()
    left = falls - board.now - 10 * US
    board.run_for(10 * US)
    fault = board.faults.arm("clock_stopped")
    settle(board, 500)
    assert host.status() & 1
    board.faults.clear(fault)
    now = board.now
    board.run_until(now + left - 1)
    assert board.chip("x").ready_at() == now + left
    board.run_until(now + left)
    board.catch_up()
    assert not host.status() & 1


def test_a_byte_that_is_written_while_it_stands_is_digested_afterwards() -> None:
    board = build()
    host = Lm(board)
    fault = board.faults.arm("clock_stopped")
    host.port.write(0, 0x1E)
    settle(board, 10)
    assert host.status() & 1
    board.faults.clear(fault)
    falls = board.chip("x").ready_at()
    assert board.now + 10 * US < falls < board.now + 100 * US
    board.run_until(falls - 1 * US - 1)
    assert host.status() & 1
    board.run_until(falls)
    assert not host.status() & 1


def test_a_reset_ends_only_when_the_clock_is_back() -> None:
    board = build(power_on="reset")
    host = Lm(board)
    board.faults.arm("clock_stopped", when="at 100 us", until="for 30 ms")
    board.run_until(30 * MS)
    assert host.status() == 0x00
    settle(board, 3)
    assert host.status() == 0x84


def test_a_reset_by_its_pin_does_not_run_without_a_clock() -> None:
    for chip, plant in ALL:
        board = build(chip, plant)
        board.faults.arm("clock_stopped", until="for 30 ms")
        board.chip("x").power_on(False)
        settle(board, 20)
        before = telemetry(board)
        settle(board, 9)
        assert telemetry(board) == before
        settle(board, 20)
        assert board.chip("x").ready_at() <= board.now


@pytest.mark.parametrize(("chip", "plant"), ALL)
def test_all_inside_stands_and_then_goes_on_as_if_nothing_had_been(chip: str, plant: str) -> None:
    board, twin = spinning(chip, plant), spinning(chip, plant)
    board.run_for(100 * NS)
    twin.run_for(100 * NS)
    fault = board.faults.arm("clock_stopped")
    before = telemetry(board)
    settle(board, 40)
    assert telemetry(board) == before
    board.faults.clear(fault)
    for each in (board, twin):
        settle(each, 30)
    after = telemetry(board)
    # But for a period of CLK, which begins anew.
    board.run_for(1 * US)
    assert after == telemetry(twin) or telemetry(board) == telemetry(twin)
    assert after != before


def test_output_edges_stand_with_the_clock_and_keep_their_distance() -> None:
    board = spinning(LM, DC)
    rises = watched(board, "x.MAG")
    settle(board, 5)
    board.faults.arm("clock_stopped", until="for 20 ms")
    seen = len(rises)
    settle(board, 19)
    assert len(rises) == seen
    settle(board, 3)
    assert len(rises) > seen
    assert rises[seen] - rises[seen - 1] >= 20 * MS


def test_a_host_of_an_mcp1200_without_a_clock_writes_into_the_void_until_it_is_back() -> None:
    board = build(MCP, DC)
    host = Mcp(board)
    settle(board, 5)
    fault = board.faults.arm("clock_stopped")
    host.write(0x26, 0x55)
    settle(board, 1)
    assert host.read(0x26) != 0x55
    board.faults.clear(fault)
    settle(board, 1)
    assert host.read(0x26) == 0x55


def test_hostrdy_stays_low_without_a_clock() -> None:
    board = build(MC, STEPPER)
    host = Mc(board, polls=50)
    host.ready()
    board.faults.arm("clock_stopped", until="for 10 ms")
    host.port.write(1, 0x00)
    with pytest.raises(TimeoutError, match="HostRdy stays low"):
        host.ready()
    board.run_for(10 * MS)
    settle(board, 1)
    host.ready()


# -- it is off ----------------------------------------------------------------------------------


@pytest.mark.parametrize("ppm", [-100_000, -37, 50, 100_000])
def test_samples_are_shorter_or_longer_by_what_the_clock_is_off(ppm: int) -> None:
    board = spinning(LM, DC)
    rises = watched(board, "x.MAG")
    settle(board, 10)
    board.faults.arm("clock_off", ppm=ppm)
    settle(board, 10)
    del rises[:]
    settle(board, 100)
    # The magnitude rises with a frame of 512 clocks, four to a sample.
    frame_ps = 512 * 125_000 / (1 + ppm / 1e6)
    frames = (rises[-1] - rises[0]) / frame_ps
    assert round(frames) > 100
    assert frames == pytest.approx(round(frames), abs=1e-6)


@pytest.mark.parametrize("ppm", [-100_000, 20_000])
def test_a_chip_set_counts_cycles_by_its_own_clock(ppm: int) -> None:
    board = build(MC, STEPPER)
    host = Mc(board)
    host.ready()
    board.faults.arm("clock_off", ppm=ppm)
    start, began = int(telemetry(board)["time"]), board.now
    settle(board, 10_000)
    cycles = int(telemetry(board)["time"]) - start
    exact = (board.now - began) * 25 * (10**6 + ppm) // (13568 * 10**12)
    assert abs(cycles - exact) <= 1


def test_what_was_gained_stays_when_the_clock_is_right_again() -> None:
    board = spinning(LM, DC)
    clock = board.chip("x").clock
    board.run_for(100 * NS)
    begin = board.now
    board.faults.arm("clock_off", until="for 100 ms", ppm=1000)
    board.run_for(100 * MS)
    board.run_for(100 * MS)
    nominal = begin * 8 // 10**6 + 200 * 8000
    # 1000 ppm of 100 ms are 800 cycles, and they are not given back.
    assert abs(clock.cycle_at(board.now) - nominal - 800) <= 1
    assert clock.frequency == 8e6
    board.run_for(1000 * MS)
    assert abs(clock.cycle_at(board.now) - nominal - 8_000_000 - 800) <= 1


@pytest.mark.parametrize(("chip", "plant"), ALL)
def test_a_slow_clock_makes_slow_motion(chip: str, plant: str) -> None:
    ends = []
    for ppm in (0, -100_000):
        board = spinning(chip, plant)
        start = int(board.plants[0].count)
        if ppm:
            board.faults.arm("clock_off", ppm=ppm)
        settle(board, 300)
        ends.append(int(board.plants[0].count) - start)
    assert ends[1] == pytest.approx(ends[0] * 0.9, rel=0.02)


# -- together, evidence, state ---------------------------------------------------------------------


def test_it_stands_while_one_fault_says_so_and_is_off_by_the_sum() -> None:
    board = build()
    clock = board.chip("x").clock
    slow = board.faults.arm("clock_off", ppm=-200)
    board.faults.arm("clock_off", ppm=500)
    assert clock.frequency == 8_000_000 * 1.0003
    one = board.faults.arm("clock_stopped")
    two = board.faults.arm("clock_stopped")
    board.faults.clear(one)
    board.faults.clear(slow)
    assert clock.stopped
    board.faults.clear(two)
    assert clock.frequency == 8_000_000 * 1.0005


def test_evidence_tells_where_the_clock_stood_and_how_it_went_on() -> None:
    board = build()
    board.run_until(1 * MS)
    board.faults.arm("clock_stopped", until="for 5 ms")
    board.run_for(10 * MS)
    board.faults.arm("clock_off", ppm=-100)
    told = [str(evidence) for evidence in board.faults.log]
    assert told == [
        "1.000000 ms #1 clock_stopped x: begun; CLK stands in cycle 8000",
        "6.000000 ms #1 clock_stopped x: ended; CLK runs at 8000000 Hz from cycle 8001 on",
        "11.000000 ms #2 clock_off x: begun; CLK runs at 7999200 Hz from cycle 48001 on",
    ]


@pytest.mark.parametrize(("chip", "plant"), ALL)
@pytest.mark.parametrize("stage", [0, 1, 2, 3])
def test_a_snapshot_has_the_clock_as_it_was(chip: str, plant: str, stage: int) -> None:
    board = spinning(chip, plant)
    faults = board.faults
    faults.arm("clock_off", when=board.now + 3 * MS, until="for 20 ms", ppm=2345)
    faults.arm("clock_stopped", when=board.now + 10 * MS, until="for 5 ms")
    board.run_for((1 * MS, 5 * MS, 12 * MS, 30 * MS)[stage] + 321 * NS)
    twin = snapshot.fork(board)
    assert twin.state_hash() == board.state_hash()
    for each in (board, twin):
        settle(each, 40)
    assert twin.state_hash() == board.state_hash()
    assert telemetry(twin) == telemetry(board)


def test_a_snapshot_from_before_has_a_clock_that_was_right() -> None:
    board = spinning(MCP, DC)
    kept, twin = snapshot.take(board), snapshot.fork(board)
    board.faults.arm("clock_off", ppm=99_999)
    settle(board, 20)
    board.faults.arm("clock_stopped")
    settle(board, 20)
    snapshot.restore(board, kept)
    for each in (board, twin):
        settle(each, 50)
    assert telemetry(board) == telemetry(twin)
    assert board.chip("x").clock.frequency == 20e6


def test_looking_at_a_chip_without_a_clock_changes_nothing() -> None:
    ends = []
    for looks in (1, 50):
        board = spinning(MC, STEPPER)
        board.faults.arm("clock_stopped", when=board.now + 777 * NS, until="for 9 ms")
        for _ in range(looks):
            board.run_for(20 * MS // looks)
            board.catch_up()
            telemetry(board)
            board.save()
        ends.append(board.state_hash())
    assert ends[0] == ends[1]


def test_it_is_no_longer_than_a_sample_away() -> None:
    board = spinning(LM, DC)
    board.faults.arm("clock_stopped", when=board.now + SAMPLE // 3, until="for 1 ms")
    before = telemetry(board)
    board.run_for(SAMPLE // 3 + MS + SAMPLE)
    board.catch_up()
    assert telemetry(board) != before
