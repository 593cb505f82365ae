"""Pacer: wall time to chip time, with a wall clock under the test's control."""

import pytest

from tests.unit.board.toy import Toy
from vbus.board.board import Board
from vbus.kernel import MS, NEVER, SECOND
from vbus.server.pacer import AHEAD, SLICE, Pacer


class WallClock:
    def __init__(self) -> None:
        self.ns = 5_000_000_000

    def __call__(self) -> int:
        return self.ns


def paced(rate: float = 1.0, stall: str = "catch_up", policy: str = "realtime") -> tuple[
    Board, Pacer, WallClock
]:  # fmt: skip
    board = Board("bench", policy, rate=rate)
    board.add_chip(Toy, "t", "TOY", 8_000_000)
    wall = WallClock()
    return board, Pacer(board, stall, wall), wall


def test_chip_time_is_wall_time_since_the_start() -> None:
    board, pacer, wall = paced()

    wall.ns += 1_234_567
    pacer.catch_up()

    assert board.now == 1_234_567_000


@pytest.mark.parametrize(("rate", "expected"), [(0.5, 5 * MS), (2.0, 20 * MS), (0.1, MS)])
def test_the_rate_is_chip_seconds_per_wall_second(rate: float, expected: int) -> None:
    board, pacer, wall = paced(rate)

    wall.ns += 10_000_000
    pacer.catch_up()

    assert board.now == expected


def test_an_hour_of_small_steps_does_not_drift() -> None:
    board, pacer, wall = paced(1 / 3)

    for _ in range(1_000):
        wall.ns += 7_000_001
        pacer.catch_up()

    assert board.now == 7_000_001 * 1_000 * 1_000 // 3


def test_time_may_run_two_milliseconds_ahead_of_the_wall_clock_and_no_further() -> None:
    board, pacer, wall = paced()
    assert board.limit == AHEAD == 2 * MS

    wall.ns += 3_000_000
    pacer.catch_up()

    assert board.limit == 5 * MS


def test_chips_that_are_ahead_are_not_pulled_back() -> None:
    board, pacer, wall = paced()
    board.run_until(1 * MS)

    wall.ns += 400_000
    pacer.catch_up()

    assert board.now == 1 * MS


def test_after_a_stall_time_catches_up_in_slices_and_the_lag_is_reported() -> None:
    board, pacer, wall = paced()

    wall.ns += 150_000_000
    steps = 0
    while not pacer.catch_up():
        steps += 1
        assert board.now == steps * SLICE
        assert pacer.lag == 150 * MS - steps * SLICE

    assert steps == 5
    assert board.now == 150 * MS
    assert pacer.worst_lag == 140 * MS
    assert pacer.slipped == 0


def test_after_a_stall_with_slip_time_goes_on_where_it_was_and_the_slip_is_reported() -> None:
    board, pacer, wall = paced(stall="slip")

    wall.ns += 3_000_000_000
    pacer.catch_up()
    assert board.now == 0
    assert pacer.slipped == 3 * SECOND

    wall.ns += 1_000_000
    pacer.catch_up()
    assert board.now == 1 * MS


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
def test_the_wall_clock_does_not_move_a_board_whose_host_is_master_of_time(policy: str) -> None:
    board, pacer, wall = paced(policy=policy)

    wall.ns += 10_000_000_000
    pacer.catch_up()

    assert board.now == 0
    assert board.limit == NEVER


def test_an_unknown_stall_policy_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^stall = 'jump': allowed are catch_up, slip$"):
        Pacer(Board("b"), "jump")


def test_looking_often_or_seldom_is_no_lag_while_the_machine_keeps_up() -> None:
    board, pacer, wall = paced()

    for step in (50_000, 9_000_000, 99_000_000):
        wall.ns += step
        pacer.catch_up()

    assert board.now == 108_050_000_000
    assert (pacer.lag, pacer.worst_lag) == (0, 0)
