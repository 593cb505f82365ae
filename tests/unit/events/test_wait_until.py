"""A condition becomes true at the very instant at which the board shows it."""

from pathlib import Path

import pytest

from tests.unit.faults.bench import LM, MC, MCP, SAMPLE, STEPPER, Lm, Mc, Mcp, build
from vbus.board.board import Board
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, SECOND
from vbus.core.signals import Observer
from vbus.events.condition import Condition
from vbus.events.watch import Watch, wait_until
from vbus.testing.bench import Bench


def moving(target: int = 500) -> Board:
    board = build()
    host = Lm(board)
    host.command(0x1C, 0x0004)  # MSKI: the end of the trajectory interrupts
    host.command(0x1D, 0x0000)
    host.move(target)
    return board


def sample(board: Board, name: str) -> object:
    return board.chips[0].telemetry()[name]


def test_a_value_holds_from_its_sample_on() -> None:
    board, twin = moving(), moving()
    met = wait_until(board, "x.real > 400", SECOND)
    assert met == board.now
    assert met % SAMPLE == 0
    twin.run_until(met - 1)
    assert sample(twin, "real") <= 400  # type: ignore[operator]
    twin.run_until(met)
    assert sample(twin, "real") > 400  # type: ignore[operator]


def test_an_edge_holds_at_the_edge() -> None:
    edges = []

    class Edges(Observer):
        def edge(self, when: int, net: str, level: int) -> None:
            edges.append((when, level))

    twin = moving()
    twin.watch("x.HI", Edges())
    twin.run_for(SECOND)
    assert len(edges) == 1
    for text in ("x.HI", "x.HI == 1", "rising(x.HI)", "x.HI rises", "changed(x.HI)"):
        assert wait_until(moving(), text, SECOND) == edges[0][0], text
    board = moving()
    with pytest.raises(VbusError, match="has not come to hold within 1000000us"):
        wait_until(board, "x.HI falls", SECOND)


def test_a_flag_by_the_name_of_the_manual() -> None:
    met = wait_until(moving(), "x.status.TRAJECTORY_COMPLETE", SECOND)
    assert met == wait_until(moving(), "x.HI rises", SECOND)
    assert met == wait_until(moving(), "x.signals.TRAJECTORY_COMPLETE", SECOND)
    assert met == wait_until(moving(), "x.status >= 04H and rising(x.status)", SECOND)


def test_what_holds_already_takes_no_time() -> None:
    board = moving()
    now = board.now
    assert wait_until(board, "x.real < 400", 0) == now == board.now


def test_a_number_rises_while_it_grows_and_falls_while_it_shrinks() -> None:
    soon = wait_until(moving(), "x.real > 100", SECOND)
    assert wait_until(moving(), "rising(x.real)", SECOND) < soon
    assert wait_until(moving(-500), "falling(x.real)", SECOND) < soon
    assert wait_until(moving(), "rising(x.real + 1)", SECOND) < soon
    assert wait_until(moving(-500), "falling(x.real + 1)", SECOND) < soon


def test_and_or_not() -> None:
    both = wait_until(moving(), "x.real > 100 and x.real > 400", SECOND)
    assert both == wait_until(moving(), "x.real > 400", SECOND)
    either = wait_until(moving(), "x.real > 100 or x.real > 400", SECOND)
    assert either == wait_until(moving(), "not x.real <= 100", SECOND) < both


def test_stable_is_counted_from_the_instant_on() -> None:
    since = wait_until(moving(), "x.real > 400", SECOND)
    met = wait_until(moving(), "x.real > 400 stable for 1.5 ms", SECOND)
    assert met == since + 1_500_000_000
    board = moving()
    with pytest.raises(VbusError):
        wait_until(board, "x.real > 400 and x.real < 410 stable for 100 ms", SECOND)


def test_previous_is_the_value_before_the_latest_change() -> None:
    board, twin = moving(), moving()
    met = wait_until(board, "x.real - previous(x.real) >= 4", SECOND)
    before = None
    seen = []
    while twin.now < met:
        twin.run_until((twin.now // SAMPLE + 1) * SAMPLE)
        here = sample(twin, "real")
        if before is not None and here - before >= 4:  # type: ignore[operator]
            seen.append(twin.now)
        before = here
    assert seen == [met]


def test_units_of_a_value() -> None:
    """One count a sample of 256 us is 3906.25 counts a second."""
    plain = wait_until(moving(), "x.velocity > 2", SECOND)
    assert plain == wait_until(moving(), "x.velocity > 2 counts/sample", SECOND)
    assert plain == wait_until(moving(), "x.velocity > 7812.5 counts/s", SECOND)
    assert plain < wait_until(moving(), "x.velocity > 9000 counts/s", SECOND)
    assert wait_until(moving(), "abs(x.error) > 3 counts", SECOND) > 0


def test_chip_time() -> None:
    assert wait_until(build(), "time >= 1.234 ms", SECOND) == 1_234_000_000
    assert wait_until(build(), "time > 5 us", SECOND) == 5_000_001
    assert wait_until(build(), "time == 7 ns and x.HI", SECOND) == 7_000


def test_a_fault_wakes_what_rests() -> None:
    board = build()
    board.run_for(MS)
    board.faults.arm("supply_dip", "x", "at 5 ms")
    assert wait_until(board, "x.status == 0", SECOND) == 5 * MS


def test_registers_of_an_mcp_1200() -> None:
    board = build(MCP)
    host = Mcp(board)
    host.write(0x3C, 0xFB)
    assert wait_until(board, "x.VELOCITY_COMMAND == -5", MS) - board.now <= 200_000
    assert wait_until(board, "x.R3CH == -5 and x.KP == 40H", 0) == board.now
    assert wait_until(board, "x.STATUS.LIMIT_OK and x.status.LIMIT_OK", MS) == board.now
    host.spin()
    met = wait_until(board, "x.actual > 200 and x.ACTUAL_VELOCITY > 0", 9 * SECOND)
    assert board.chips[0].telemetry()["actual"] > 200  # type: ignore[operator]
    assert met == board.now


def test_a_sample_of_the_other_chips_is_met_exactly() -> None:
    """No output of these chips is heard, so that only their own clock says when to look."""

    def mcp() -> Board:
        board = build(MCP)
        Mcp(board).spin()
        return board

    def mc() -> Board:
        board = build(MC, STEPPER)
        Mc(board).spin()
        return board

    for make, text, name in (
        (mcp, "x.velocity > 1", "velocity"),
        (mc, "x.target_1 > 30", "target 1"),
    ):
        board, twin = make(), make()
        limit = int(text.rpartition(" ")[2])
        met = wait_until(board, text, SECOND)
        twin.run_until(met - 1)
        assert sample(twin, name) <= limit  # type: ignore[operator]
        twin.run_until(met)
        assert sample(twin, name) > limit  # type: ignore[operator]


def test_a_text_and_a_word() -> None:
    board = build(MCP)
    assert wait_until(board, "x.mode == idle", MS) == board.now
    assert wait_until(board, "x.mode == 'idle' and x.mode != reset", MS) == board.now


def test_the_axes_of_an_mc1241a_and_names_with_blanks() -> None:
    board = build(MC, STEPPER)
    Mc(board).spin()
    met = wait_until(board, 'x.status_1."in motion" and x.actual_1 > 20', 9 * SECOND)
    assert met == board.now
    assert wait_until(board, 'x."actual 1" > 20 and x.status_1.in_motion', 0) == met
    assert wait_until(board, "not x.~HostSlct or x.~HostSlct", 0) == met


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x.reel > 4", 'no "x.reel" at character 1; did you mean "x.real"? x has the values desi'),
        ("y.HI", 'no "y.HI" at character 1; did you mean "x.HI"? this board has x'),
        ("x.HI=high", 'no "high" at character 6'),
        ("x.status.TRAJECTORY", 'did you mean "TRAJECTORY_COMPLETE"? x.status has MOTOR_OFF, BRE'),
        ("x.command == SST", 'no command "SST" at character 14; did you mean "STT"? there are RE'),
        ("x.real > 4 V", 'no unit "V" of the number at character 10; "V" is the unit of a volt'),
        ("x.HI > 3 counts", 'the unit here is not "counts" at character 8; allowed: none'),
        ("x.real > 3 counts/s", 'the unit here is not "counts/s" at character 10; allowed: counts'),
        ("x.signal_names", "a text does not hold or not: a comparison is missing at character 1"),
        ("x.signal_names > 3", "a text is compared with a number at character 18"),
        ("time > 3", "a time is compared with a number at character 8"),
        ("rising(time)", "rising() is not of a time, as it stands at character 8"),
        ("x.real + 2 ms > 3", "only plain numbers are added, not what stands at character 10"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_on_this_board_is_refused_where_it_stands(
    text: str, message: str
) -> None:
    with pytest.raises(VbusError) as caught:
        Condition(text, build(LM))
    assert message in str(caught.value)


def test_what_has_not_come_is_told_with_what_there_is() -> None:
    board = build()
    with pytest.raises(VbusError) as caught:
        wait_until(board, "x.real > 400 and x.A", 2 * MS)
    assert str(caught.value) == (
        '"x.real > 400 and x.A" has not come to hold within 2000us of chip time, since 0us;'
        " x.real is 0, x.A is 0"
    )
    assert board.now == 2 * MS
    assert not board.observers
    assert board.kernel.observed == 0


def test_a_test_has_it_by_its_board_and_by_its_clock() -> None:
    """The time that passes is none that a host let pass."""
    bench = Bench("test", {"budget": {"chip_time": "3 ms"}}, [Path.cwd()], Path.cwd)
    x = bench.chip("LM629")
    met = x.board.wait_until("time >= 50 ms")
    assert met == 50 * MS == x.clock.now
    assert x.clock.wait_until("x.status.TRAJECTORY_COMPLETE") == 50 * MS
    with pytest.raises(
        VbusError, match=r'"x\.real > 4" has not come to hold within 2000us of chip'
    ):
        x.board.wait_until("x.real > 4", within="2 ms")
    x.bus.read(0)
    assert bench.complaints() == []
    with pytest.raises(VbusError, match="no duration"):
        x.board.wait_until("x.real > 4", within="2 hours")
    with x.clock.freeze(), pytest.raises(VbusError, match="time is frozen"):
        x.board.wait_until("x.real > 4")


def test_a_board_of_nobody_has_it_too() -> None:
    assert build().wait_until("time >= 2 ms", within="5 ms") == 2 * MS


def test_a_value_that_a_host_writes_holds_with_the_cycle_that_writes_it() -> None:
    board = build(MCP)
    host = Mcp(board)
    met: list[int] = []
    watch = Watch("x.R3CH == -5", board, met=lambda: met.append(board.now))
    watch.begin()
    board.run_for(MS // 3)
    host.write(0x3C, 0xFB)
    written = board.now
    board.run_for(3 * MS)
    watch.end()
    assert 0 <= met[0] - written <= 200_000


def test_chips_that_no_condition_names_have_come_as_far_as_the_board() -> None:
    board, twin = moving(), moving()
    met = wait_until(board, "time >= 100.1 ms", SECOND)
    twin.run_until(met)
    twin.chips[0].advance()
    assert sample(board, "real") == sample(twin, "real")
    assert board.caught == met
