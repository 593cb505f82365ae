"""Pacer: wall time to chip time, with a wall clock under the test's control."""

import asyncio
import os
from collections.abc import Callable
from contextlib import closing
from fractions import Fraction
from typing import Any

import pytest

from tests.unit.board.toy import Toy
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.mc1241a.datasheet import COMMANDS
from vbus.core.errors import TimeEndedError
from vbus.core.kernel import END, MS, NEVER, SECOND, US
from vbus.serve.time.overload import Overload
from vbus.serve.time.pacer import (
    AHEAD,
    DAY,
    FREE_NS,
    FREE_SLICE,
    LEASE,
    PIECE_NS,
    SLICE,
    STALL,
    Tick,
    WallClockPacer,
)
from vbus.serve.time.time_slicer import SLICE_NS


class WallClock:
    def __init__(self) -> None:
        self.ns = 5_000_000_000

    def __call__(self) -> int:
        return self.ns


def paced(rate: float = 1.0, stall: str = "catch_up", policy: str = "realtime") -> tuple[
    Board, WallClockPacer, WallClock
]:  # fmt: skip
    board = Board("bench", policy, rate=rate)
    board.add_chip(Toy, "t", "TOY", 8_000_000)
    wall = WallClock()
    return board, WallClockPacer(board, stall, wall), wall


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


@pytest.mark.parametrize("rate", [1.0, 1 / 3, 1.5, 1.25e6])
@pytest.mark.parametrize("power", [51, 52, 53])
@pytest.mark.parametrize("off", [-1, 0, 1])
def test_chip_time_is_exact_however_long_it_has_run(rate: float, power: int, off: int) -> None:
    _, pacer, wall = paced(rate)
    elapsed = (1 << power) + off

    wall.ns += elapsed

    exact = Fraction(rate).limit_denominator(10**6)
    assert pacer.wall() == elapsed * 1000 * exact.numerator // exact.denominator


def test_an_hour_of_small_steps_does_not_drift() -> None:
    board, pacer, wall = paced(1 / 3)

    for _ in range(1_000):
        wall.ns += 7_000_001
        pacer.catch_up()

    assert board.now == 7_000_001 * 1_000 * 1_000 // 3


def test_time_may_run_two_milliseconds_ahead_of_the_wall_clock_and_no_further() -> None:
    board, pacer, wall = paced()
    assert board.limit == END, "nobody holds it back yet"
    with closing(asyncio.new_event_loop()) as loop:
        pacer.start(loop)
        assert board.limit == AHEAD == 2 * MS

        wall.ns += 3_000_000
        pacer.catch_up()
        pacer.stop()

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
    assert board.limit == LEASE


def test_an_unknown_stall_policy_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^stall = 'jump': allowed are catch_up, slip$"):
        WallClockPacer(Board("b"), "jump")


def test_looking_often_or_seldom_is_no_lag_while_the_machine_keeps_up() -> None:
    board, pacer, wall = paced()

    for step in (50_000, 9_000_000, 99_000_000):
        wall.ns += step
        pacer.catch_up()

    assert board.now == 108_050_000_000
    assert (pacer.lag, pacer.worst_lag) == (0, 0)


def test_a_held_host_is_woken_by_the_wall_clock_though_another_one_has_run_ahead() -> None:
    board, pacer, wall = paced()
    woken: list[int] = []
    moved: list[int] = []
    pacer.on_moved = lambda: moved.append(wall.ns)
    pacer.wake_at(5 * MS, lambda: woken.append(wall.ns))
    board.run_until(4 * MS)

    for _ in range(4):
        wall.ns += 1_000_000
        pacer._woken()
        assert moved[-1] == wall.ns

    # Time may run to 5 ms as soon as the wall clock is at 3 ms.
    assert woken == [5_003_000_000]


class Loop:
    """As much of an event loop as a host-paced board needs; the test runs it step by step."""

    def __init__(self) -> None:
        self.soon: list[Callable[[], None]] = []

    def call_soon(self, callback: Callable[[], None]) -> None:
        self.soon.append(callback)

    def step(self) -> bool:
        due, self.soon = self.soon, []
        for callback in due:
            callback()
        return bool(self.soon)


class Labour(Toy):
    """A chip whose computing takes wall time."""

    wall: WallClock
    cost_ns = 0

    def advance(self) -> None:
        super().advance()
        self.wall.ns += self.cost_ns

    def resting(self) -> bool:
        return False


def laborious(cost_ns: int, rate: float = 1.0, policy: str = "lockstep") -> tuple[
    Board, WallClockPacer, Loop
]:  # fmt: skip
    board = Board("bench", policy, rate=rate)
    chip = board.add_chip(Labour, "t", "TOY", 8_000_000)
    assert isinstance(chip, Labour)
    chip.wall, chip.cost_ns = WallClock(), cost_ns
    pacer, loop = WallClockPacer(board, clock=chip.wall), Loop()
    started: Any = loop
    pacer.start(started)
    return board, pacer, loop


def test_a_long_delay_of_a_host_that_is_master_of_time_is_computed_in_slices() -> None:
    board, pacer, loop = laborious(cost_ns=SLICE_NS + 1)
    woken: list[int] = []
    pacer.wake_at(SECOND + 1, lambda: woken.append(board.now))

    steps = 1
    while loop.step():
        assert board.now == steps * SLICE
        assert board.limit == board.now + LEASE
        steps += 1

    assert steps == SECOND // SLICE + 1
    assert woken == [SECOND + 1]
    assert board.now == SECOND + 1, "and not a picosecond further"


def test_a_month_of_rest_takes_few_slices() -> None:
    board, pacer, loop = laborious(cost_ns=0)
    month = 30 * 24 * 3600 * SECOND
    pacer.wake_at(month, lambda: None)

    steps = 1
    while loop.step():
        steps += 1

    assert steps == 28, "each slice is twice the one before"
    assert board.now == month


def test_the_next_delay_starts_with_short_slices_again() -> None:
    board, pacer, loop = laborious(cost_ns=0)
    pacer.wake_at(3600 * SECOND, lambda: None)
    while loop.step():
        pass

    pacer.wake_at(7200 * SECOND, lambda: None)
    loop.step()

    assert board.now == 3600 * SECOND + SLICE


def test_without_a_limit_of_rate_time_runs_by_itself_one_slice_at_a_time() -> None:
    board, _, loop = laborious(cost_ns=FREE_NS // 2, rate=float("inf"), policy="realtime")

    for step in range(1, 6):
        assert loop.step()
        assert board.now == step * SLICE


def slices(board: Board, loop: Loop, count: int) -> list[int]:
    """Return how much chip time passes in each slice."""
    found = []
    for _ in range(count):
        begun = board.now
        assert loop.step()
        found.append(board.now - begun)
    return found


def test_without_a_limit_of_rate_what_moves_cheaply_goes_on_in_longer_slices() -> None:
    board, _, loop = laborious(cost_ns=FREE_NS // 4 - 1, rate=float("inf"), policy="realtime")
    chip = board.chips[0]
    assert isinstance(chip, Labour)

    assert slices(board, loop, 11) == [SLICE << n for n in range(10)] + [FREE_SLICE]
    chip.cost_ns = FREE_NS + 1
    assert slices(board, loop, 3) == [FREE_SLICE, FREE_SLICE // 2, FREE_SLICE // 4]


def test_without_a_limit_of_rate_a_board_at_rest_does_not_run_away() -> None:
    board = Board("bench", "realtime", rate=float("inf"))
    chip = board.add_chip(Idler, "t", "TOY", 8_000_000)
    assert isinstance(chip, Idler)
    chip.wall = WallClock()
    loop: Any = Loop()
    WallClockPacer(board, clock=chip.wall).start(loop)

    assert slices(board, loop, 50) == [SLICE] * 50


def test_time_without_a_limit_of_rate_ends_and_the_board_with_it() -> None:
    board, pacer, loop = laborious(cost_ns=FREE_NS // 2, rate=float("inf"), policy="realtime")
    ended: list[int] = []
    pacer.on_end = lambda: ended.append(board.now)
    board.run_until(END - 2 * SLICE)

    steps = 0
    while loop.step():
        steps += 1

    assert board.now == END
    assert (steps, len(ended)) == (2, 1), "and nothing is left to be done"
    with pytest.raises(
        TimeEndedError, match=rf"^board bench has ended: chip time ends at {END} ps"
    ):
        pacer.check_over()


@pytest.mark.parametrize("rate", [1.0, 1000.0, 10**6])
def test_real_time_stands_at_the_end_and_the_board_ends(rate: float) -> None:
    board, pacer, wall = paced(rate)
    board.run_until(END - AHEAD - 1)
    pacer.jumped()
    ended: list[int] = []
    pacer.on_end = lambda: ended.append(board.now)
    pacer.check_over()

    for _ in range(3):
        wall.ns += 50_000_000
        pacer.catch_up()

    assert board.now == END - AHEAD
    assert board.limit == END, "hosts may be ahead of the wall clock, and not of the end"
    assert len(ended) == 1


@pytest.mark.parametrize("policy", ["realtime", "lockstep", "slaved"])
def test_people_are_told_once_when_less_than_a_day_is_left(policy: str) -> None:
    board, pacer, wall = paced(policy=policy)
    told: list[str] = []
    pacer.report = told.append
    board.run_until(END - DAY - LEASE - 1)
    pacer.jumped()
    pacer.catch_up()
    assert not told

    board.run_until(board.now + LEASE + 2)
    pacer.jumped()
    for _ in range(3):
        wall.ns += 1_000_000
        pacer.catch_up()

    assert told == [
        f"board bench: chip time ends at {END} ps, 106 days after power-on; less than a day is left"
    ]


def test_a_board_that_is_moved_by_its_hosts_does_not_end() -> None:
    board, pacer, _ = paced(policy="lockstep")
    board.run_until(END - 1)
    pacer.jumped()
    assert pacer.catch_up()
    assert board.limit == END
    pacer.check_over()


def test_a_stall_is_a_gap_in_wall_time_at_any_rate() -> None:
    board, pacer, wall = paced(rate=1000.0)

    wall.ns += 99_000_000
    assert pacer.catch_up()
    assert board.now == 99 * SECOND

    wall.ns += 101_000_000
    assert not pacer.catch_up()
    assert board.now == 99 * SECOND + SLICE


@pytest.mark.parametrize(
    ("cost_ns", "ticks"),
    [
        (0, [20, 40, 80, 160, 320, 640, 1000, 1000]),
        (30_000, [20, 40, 80, 160, 200, 200]),
        (100_000, [10, 10, 10, 10]),
        (300_000, [5, 5, 5, 5]),
    ],
)
def test_chips_that_owe_little_are_brought_up_to_date_less_often(
    cost_ns: int, ticks: list[int]
) -> None:
    board = Board("bench", "realtime")
    chip = board.add_chip(Labour, "t", "TOY", 8_000_000)
    assert isinstance(chip, Labour)
    chip.wall, chip.cost_ns = WallClock(), cost_ns
    pacer = WallClockPacer(board, clock=chip.wall)

    found = []
    for _ in ticks:
        chip.wall.ns += max(10 * MS, pacer._tick_at - pacer.wall()) // 1000
        pacer._woken()
        found.append((pacer._tick_at - board.now) // MS)

    assert found == ticks
    assert pacer.worst_lag < MS, "sleeping is no stall"


def test_what_somebody_looks_on_is_brought_up_to_date_more_often() -> None:
    tick = Tick()
    for _ in range(6):
        tick.adapt(30_000, 1, False)
    assert tick.span == 200 * MS

    tick.adapt(100_000, 1, True)
    assert tick.span == 50 * MS

    tick.adapt(300_000, 1, True)
    assert tick.span == 25 * MS


def resting() -> tuple[Board, WallClockPacer, WallClock]:
    """A real-time board that has been left alone for a minute."""
    board = load_board_text(
        '[board]\nname = "b"\ntime = "realtime"\npower_on = "done"\n'
        + "".join(
            f'[chips.{chip}]\npart = "{part}"\nclock = "8 MHz"\nplant = "{chip}"\n'
            f'[plants.{chip}]\nmodel = "dc_motor"\n'
            for chip, part in (("x", "LM629N-8"), ("y", "MCP-1200"))
        )
    )
    wall = WallClock()
    pacer = WallClockPacer(board, clock=wall)
    pacer.arm()
    sleep(pacer, wall, 60 * SECOND)
    return board, pacer, wall


def sleep(pacer: WallClockPacer, wall: WallClock, duration: int) -> int:
    """Let wall time pass; return how often the pacer woke up."""
    end, wakes = wall.ns + duration // 1000, 0
    while True:
        due = wall.ns + max(0, pacer._asleep - pacer.wall()) // 1000
        if due > end:
            wall.ns = end
            return wakes
        wall.ns = due
        pacer._woken()
        wakes += 1


def test_a_board_at_rest_wakes_the_machine_once_a_second() -> None:
    board, pacer, wall = resting()

    assert sleep(pacer, wall, 600 * SECOND) in (600, 601)
    assert pacer.worst_lag == 0
    assert board.next_due() == NEVER, "no chip has set a timer"


def test_a_host_that_asks_finds_a_resting_board_at_the_present_and_awake() -> None:
    board, pacer, wall = resting()
    port = board.open_port("host")

    wall.ns += (pacer._asleep - pacer.wall()) // 1000 - 1
    assert pacer.catch_up()
    assert board.now == pacer.wall()
    port.write(0, 0x1F)
    pacer.served()

    assert pacer._asleep <= board.now + 10 * MS
    assert pacer.lag == 0


def test_a_stall_while_the_board_rests_is_seen_and_what_it_slept_is_no_part_of_it() -> None:
    for stall, slipped in (("catch_up", 0), ("slip", 2 * SECOND)):
        _, pacer, wall = resting()
        pacer.stall = stall
        due = pacer._asleep
        wall.ns += (due - pacer.wall() + 2 * SECOND) // 1000

        pacer._woken()

        assert pacer.slipped == slipped
        assert pacer.worst_lag >= 2 * SECOND - SLICE


def many(count: int, cost_ns: int, policy: str, rate: float = 1.0) -> tuple[
    Board, WallClockPacer, WallClock
]:  # fmt: skip
    """A board of many chips that each take a while to bring up to date."""
    wall = WallClock()
    board = Board("bench", policy, rate=rate)
    for number in range(count):
        chip = board.add_chip(Labour, f"t{number}", "TOY", 8_000_000)
        assert isinstance(chip, Labour)
        chip.wall, chip.cost_ns = wall, cost_ns
    return board, WallClockPacer(board, clock=wall, spent=wall), wall


@pytest.mark.parametrize("rate", [1.0, float("inf")])
def test_no_slice_takes_longer_than_its_time_and_one_chip(rate: float) -> None:
    """A thousand chips, each slower than real time: whoever waits for the loop waits 20 ms."""
    cost = 700_000
    board, pacer, wall = many(1000, cost, "realtime", rate)
    loop: Any = Loop()
    if rate != 1.0:
        pacer.start(loop)

    for _ in range(200):
        begun = wall.ns
        if rate == 1.0:
            wall.ns += 1
            pacer._woken()
            assert pacer._asleep <= pacer.wall()
        else:
            loop.step()
        assert wall.ns - begun <= SLICE_NS + cost + 1

    assert board.now > 4 * SLICE - 1, "and yet time goes on"


def keep_up(pacer: WallClockPacer, wall: WallClock, board: Board, duration: int) -> int:
    """Serve for a while; return how long the longest wait for the event loop was (ns)."""
    end, longest = wall.ns + duration // 1000, 0
    while wall.ns < end:
        wall.ns += max(1, (pacer._asleep - pacer.wall()) // 1000)
        begun = wall.ns
        pacer._woken()
        longest = max(longest, wall.ns - begun)
    return longest


def test_many_chips_are_brought_up_to_date_in_pieces_while_time_runs_on() -> None:
    """Long visits take less than many short ones; who waits for the event loop waits a piece."""
    cost = 40_000
    board, pacer, wall = many(4000, cost, "realtime")
    pacer.arm()
    told: list[str] = []
    pacer.report = told.append

    longest = keep_up(pacer, wall, board, 2 * SECOND)

    assert longest <= PIECE_NS + cost
    assert pacer.wall() - board.now <= 2 * PIECE_NS * 1000
    assert pacer.worst_lag <= 2 * PIECE_NS * 1000
    assert pacer._tick.span == 200 * MS, "40 us of 200 ms: 4000 chips take 80 %"
    assert told == []
    assert pacer.overload.worst == 0.0


def test_time_runs_on_through_a_round_of_chips_that_lasts_longer_than_a_stall() -> None:
    board, pacer, wall = many(4000, 40_000, "realtime")
    pacer.arm()
    keep_up(pacer, wall, board, SECOND)
    assert 4000 * 40 * US > STALL, "as long as a round takes"

    for _ in range(400):
        wall.ns += max(1, (pacer._asleep - pacer.wall()) // 1000)
        pacer._woken()
        assert pacer.wall() - board.now <= 2 * PIECE_NS * 1000


def test_after_a_jump_the_round_of_chips_begins_anew() -> None:
    board, pacer, wall = many(3, 0, "realtime")
    for number, chip in enumerate(board.chips):
        assert isinstance(chip, Labour)
        chip.cost_ns = 10_000_000 << number
    rounds = []
    for jump in (False, False, True):
        if jump:
            pacer.jumped()
        wall.ns += max(1, (pacer._asleep - pacer.wall()) // 1000)
        begun = wall.ns
        pacer._woken()
        rounds.append((wall.ns - begun) // 10_000_000)
    assert rounds == [1, 2, 1], "which chip was brought up to date"


def test_who_is_not_woken_by_a_jump_because_the_board_was_paused_is_woken_later() -> None:
    _, pacer, _ = paced()
    woken: list[str] = []

    def pause() -> None:
        woken.append("first")
        pacer.halt()

    pacer.wake_at(8 * MS, pause)
    pacer.wake_at(9 * MS, lambda: woken.append("second"))
    pacer.jumped()
    assert woken == ["first"]
    pacer.confine(NEVER)
    assert woken == ["first", "second"]


@pytest.mark.parametrize("stall", ["catch_up", "slip"])
def test_more_than_the_machine_can_follow_is_told_once_with_how_much(stall: str) -> None:
    class Dear(Labour):
        """A chip that takes 60 us to compute a millisecond."""

        last = 0
        still = False

        def resting(self) -> bool:
            return self.still

        def advance(self) -> None:
            owed, self.last = self.kernel.now - self.last, int(self.kernel.now)
            self.wall.ns += owed * 60 // 1_000_000

    wall = WallClock()
    board = Board("bench", "realtime")
    for number in range(25):
        chip = board.add_chip(Dear, f"t{number}", "TOY", 8_000_000)
        assert isinstance(chip, Dear)
        chip.wall = wall
    pacer = WallClockPacer(board, stall, wall, wall)
    pacer.arm()
    told: list[str] = []
    pacer.report = told.append

    keep_up(pacer, wall, board, 20 * SECOND)

    assert len(told) == 1
    assert told[0].startswith("board bench: more moves than this machine can follow: chip time")
    assert pacer.overload.times == pytest.approx(1.5, abs=0.05)
    assert pacer.overload.worst < 1.8

    # Half of them come to rest: what is owed is made up for, and nobody is overloaded.
    for chip in board.chips[:13]:
        chip.still = True  # type: ignore[attr-defined]
    keep_up(pacer, wall, board, 40 * SECOND)

    assert pacer.overload.times == 0.0
    assert pacer.overload.worst > 1.4
    assert len(told) == 1


@pytest.mark.parametrize(("share", "times"), [(0.5, 0.0), (0.75, 1.125)])
def test_what_others_take_of_the_processor_is_no_overload(share: float, times: float) -> None:
    """Chip time runs at two thirds of its rate, while the board has a share of the processor."""
    overload, told = Overload(), []
    for second in range(10):
        now, wall = second * SECOND * 2 // 3, second * 10**9
        told.append(overload.look(now, wall, lambda wall=wall: int(wall * share), (1000, 1)))
    assert overload.times == pytest.approx(times)
    assert sum(told) == (times > 0.0)


def test_chips_that_take_longer_than_a_look_do_not_make_the_overload_endless() -> None:
    """Chip time comes by 100 ms every two seconds, and is looked at each second."""
    overload = Overload()
    for second in range(10):
        now, wall = second // 2 * 100 * MS, second * 10**9
        overload.look(now, wall, lambda wall=wall: wall, (1000, 1))
    assert overload.worst == pytest.approx(20.0)


def test_a_stall_of_the_machine_is_no_overload() -> None:
    board, pacer, wall = many(4, 1_000, "realtime")
    pacer.arm()
    for gap in (400, 900, 1500, 3000, 400, 400):
        keep_up(pacer, wall, board, 5 * SECOND)
        wall.ns += gap * 1_000_000
    keep_up(pacer, wall, board, 5 * SECOND)

    assert pacer.worst_lag >= 2 * SECOND
    assert pacer.overload.worst == 0.0


class Ticking(Labour):
    """A chip whose every edge is listened to, and takes a while."""

    def ticks(self) -> None:
        self.beat = self.kernel.timer(self._beat, saved=False)
        self.beat.at(US)

    def _beat(self) -> None:
        self.wall.ns += self.cost_ns
        self.beat.at(self.kernel.now + US)


def test_edges_that_are_listened_to_come_in_slices_too() -> None:
    wall = WallClock()
    board = Board("bench", "realtime", rate=float("inf"))
    chip = board.add_chip(Ticking, "t", "TOY", 8_000_000)
    assert isinstance(chip, Ticking)
    chip.wall, chip.cost_ns = wall, 500_000
    pacer = WallClockPacer(board, clock=wall)
    loop: Any = Loop()
    pacer.start(loop)
    chip.ticks()

    longest = []
    for _ in range(100):
        begun, then = wall.ns, board.now
        loop.step()
        longest.append(wall.ns - begun)
        assert board.now > then

    # Only the first one does not know yet how long a stretch takes.
    assert max(longest[12:]) <= SLICE_NS + 20 * 500_000


class Idler(Labour):
    """A chip at rest that takes a while if it is brought up to date all the same."""

    def resting(self) -> bool:
        return True


def test_chips_at_rest_are_left_alone_however_many_there_are() -> None:
    wall = WallClock()
    board = Board("bench", "realtime")
    for number in range(200):
        chip = board.add_chip(Idler, f"t{number}", "TOY", 8_000_000)
        assert isinstance(chip, Idler)
        chip.wall, chip.cost_ns = wall, 100_000
    pacer = WallClockPacer(board, clock=wall)
    pacer.arm()

    wakes = sleep(pacer, wall, 600 * SECOND)

    assert wakes < 620
    assert pacer.worst_lag == 0


def test_an_lm629_is_at_rest_only_while_nothing_is_due_inside() -> None:
    board, pacer, wall = resting()
    chip = board.chip("x")
    assert chip.resting()

    port = board.open_port("host", ["x"])
    port.write(0, 0x06)
    assert not chip.resting(), "the command has its effect when busy falls"
    pacer.served()
    sleep(pacer, wall, 60 * SECOND)
    assert chip.resting()


def test_an_mcp_1200_is_at_rest_only_while_nothing_is_due_inside() -> None:
    board, pacer, wall = resting()
    chip = board.chip("y")
    assert chip.resting()

    port = board.open_port("host", ["y"])
    port.write(0x09, 40)
    assert not chip.resting(), "the byte is visible some clocks later"
    pacer.served()
    sleep(pacer, wall, 20 * MS)
    assert not chip.resting(), "the motor turns, in idle mode too"

    port.write(0x09, 0)
    pacer.served()
    sleep(pacer, wall, 60 * SECOND)
    assert chip.resting(), "it has come to a stand"


@pytest.mark.parametrize(
    ("part", "plant"), [("MC1241A", 'plants = ["m"]'), ("MC1141A", 'plant = "m"')]
)
def test_a_stepper_chip_set_is_at_rest_only_while_nothing_is_due_inside(
    part: str, plant: str
) -> None:
    board = load_board_text(
        '[board]\nname = "b"\ntime = "realtime"\npower_on = "done"\n'
        f'[chips.x]\npart = "{part}"\nclock = "25 MHz"\n{plant}\n'
        '[plants.m]\nmodel = "stepper"\n'
    )
    wall = WallClock()
    pacer = WallClockPacer(board, clock=wall)
    pacer.arm()
    sleep(pacer, wall, 2 * SECOND)
    chip = board.chip("x")
    assert chip.resting()
    port = board.open_port("host", ["x"])

    def send(name: str, *words: int) -> None:
        for address, byte in (
            (1, COMMANDS[name].code), *((0, byte) for word in words for byte in divmod(word, 256)),
        ):  # fmt: skip
            wall.ns += 1_000_000
            assert pacer.catch_up()
            port.write(address, byte)
        pacer.served()

    send("GET_TIME")
    assert not chip.resting(), "the command is carried out when HostRdy rises"
    sleep(pacer, wall, SECOND)
    assert chip.resting()

    send("SET_BUF_MTR_CMD", 0x4000)
    for name, *words in (("SET_POS", 1, 0), ("SET_VEL", 0, 0x4000), ("SET_ACC", 0, 0x100)):
        send(name, *words)
    send("UPDATE")
    sleep(pacer, wall, SECOND)
    assert not chip.resting(), "it moves"
    moved = board.plants[0].count
    sleep(pacer, wall, SECOND)
    assert board.plants[0].count > moved, "though nobody has looked at the chip"


def test_a_chip_that_begins_to_move_is_brought_up_to_date_again() -> None:
    board, pacer, wall = resting()
    port = board.open_port("host", ["x"])
    for code, *data in (
        (0x1E, 0, 0x0A, 1, 44, 7, 208), (0x04,), (0x1F, 0x18, 0x28, 0, 0, 3, 232, 0, 1, 0, 0),
        (0x01,),
    ):  # fmt: skip
        wall.ns += 1_000_000
        assert pacer.catch_up()
        port.write(0, code)
        for byte in data:
            wall.ns += 1_000_000
            assert pacer.catch_up()
            port.write(1, byte)
    pacer.served()

    sleep(pacer, wall, 10 * SECOND)

    assert not board.chip("x").resting()
    moved = board.plants[0].count
    sleep(pacer, wall, SECOND)
    assert board.plants[0].count > moved, "though nobody has looked at the chip"


def test_a_host_of_a_node_is_woken_when_the_nodes_grant_what_it_waits_for() -> None:
    board, pacer, loop = laborious(cost_ns=0)
    board.granted = True
    board.limit = MS
    moved: list[int] = []
    woken: list[int] = []
    pacer.on_moved = lambda: moved.append(board.now)
    pacer.wake_at(2 * MS, lambda: woken.append(board.limit))
    assert pacer.catch_up()
    assert (board.now, board.limit, loop.step(), moved) == (0, MS, False, [0])
    for board.limit in (2 * MS - 1, 2 * MS):
        pacer.grant_came()
    assert woken == [2 * MS]
    pacer.served()
    assert len(moved) == 2


def test_the_time_of_nodes_counts_from_their_epoch_and_follows_its_drift() -> None:
    board, _, wall = paced()
    pacer = WallClockPacer(board, clock=wall, epoch=wall.ns - 3_000_000)
    moved: list[int] = []
    pacer.on_moved = lambda: moved.append(board.now)
    with closing(asyncio.new_event_loop()) as loop:
        pacer.start(loop)
        pacer.catch_up()
        assert board.now == 3 * MS
        pacer.shift(1_000_000)
        wall.ns += 2_000_000
        pacer.catch_up()
        assert board.now == 4 * MS
        pacer.served()
        assert moved == [4 * MS]
        pacer.stop()


def test_hosts_of_a_board_that_cannot_follow_do_not_wait_for_a_slice_each() -> None:
    """Chips have half of the time, however many hosts ask: 300 waited 6 s for as many slices."""
    board = Board("bench", "realtime", rate=1.0)
    chip = board.add_chip(Ticking, "t", "TOY", 8_000_000)
    assert isinstance(chip, Ticking)
    wall = chip.wall = WallClock()
    chip.cost_ns = 50_000  # of each us of chip time
    pacer = WallClockPacer(board, clock=wall)
    chip.ticks()

    shares = []
    for _ in range(20):
        begun, reached = wall.ns, board.now
        for _ in range(300):
            pacer.catch_up()
            wall.ns += 100_000
        shares.append((wall.ns - begun) // 300)
    assert board.now > reached, "and yet time goes on"

    # Only the first ones do not know yet how long a stretch takes.
    assert max(shares[10:]) <= 100_000 * 2 + SLICE_NS * 2 // 300


@pytest.mark.parametrize(("rate", "wait"), [(1.0, 500_000), (0.3, 1_666_667), (2.0, 250_000)])
def test_the_timer_is_set_to_the_wall_time_until_the_next_wake_up_rounded_up(
    rate: float, wait: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[int] = []

    class Timer:
        """Notes what it is set to."""

        def __init__(self) -> None:
            self.fd = os.eventfd(0)

        def set(self, ns: int) -> None:
            waits.append(ns)

        def close(self) -> None:
            os.close(self.fd)

    monkeypatch.setattr("vbus.serve.time.pacer.TimerFd", Timer)
    board, pacer, _ = paced(rate)
    with closing(asyncio.new_event_loop()) as loop:
        pacer.start(loop)
        timer = pacer._timer
        pacer.set_rate(rate)
        assert pacer._timer is timer
        pacer.wake_at(board.now + AHEAD + 500 * US, lambda: None)
        pacer.stop()
    assert waits[-1] == wait
