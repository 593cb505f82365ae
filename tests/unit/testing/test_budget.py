"""A host that goes on for ever ends its test, which says what it waited for."""

import runpy
import sys
import time
from itertools import count
from pathlib import Path

import pytest

from vbus.board.board import Board
from vbus.board.build import build
from vbus.chips.packets import STATUS, Cycle, Packet
from vbus.client.bus import Bus
from vbus.client.lm628 import Lm628
from vbus.core.errors import ConfigError
from vbus.core.kernel import MS, SECOND
from vbus.serve import host_limits
from vbus.serve.host_limits import GRACE, LOOK, Polls
from vbus.serve.in_process import connect_in_process
from vbus.testing.boards import for_test, of_part
from vbus.testing.limits import BUDGET, UNBOUNDED, HostStuck, HostWatch, Limits, budget_of

pytest_plugins = "pytester"

RSTI = 0x1D


def in_lockstep(part: str) -> Board:
    return build(*for_test(of_part(part), "board.toml"))


def polled(bus: Bus, times: int, *addresses: int) -> None:
    for _ in range(times):
        for address in addresses:
            bus.read(address)


@pytest.mark.parametrize(
    ("part", "address", "told"),
    [
        ("LM629N-8", 0, "x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE since 5001us"),
        ("MCP-1200", 7, "x read STATUS FCH LIMIT_OK STOP_OK BREAKPOINT_OK ERROR_OK TIMER_OK"),
        ("MC1241A", 1, "x adapter status FFH ready since 5001us"),
    ],
)
def test_polls_in_vain_end_a_host_where_nothing_can_change(
    part: str, address: int, told: str
) -> None:
    board = in_lockstep(part)
    watch = HostWatch(board, Limits(polls=700))
    board.run_until(5 * MS)
    bus = connect_in_process(board)
    polled(bus, 700, address)
    with pytest.raises(HostStuck, match="it polled 700 times and read nothing new, and noth"):
        polled(bus, 1, address)
    assert f"can change any more: {told}" in watch.stuck
    assert watch.cycles == 701


@pytest.mark.parametrize("why", ["another host", "something due", "a fault", "it moves"])
def test_a_host_may_poll_where_something_can_change(why: str) -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits(polls=100))
    board.run_until(2 * MS)
    bus = connect_in_process(board)
    if why == "another host":
        connect_in_process(board)
    elif why == "something due":
        board.kernel.timer(lambda: None).at(SECOND)
    elif why == "a fault":
        board.faults.arm("jam", when="at 1 s")
    else:
        axis = Lm628(bus)
        axis.load_filter(kp=300, kd=2000)
        axis.load_trajectory(acc=400, vel=4 << 16, pos=5000, start=True)
        board.run_for(5 * MS)
    polled(bus, 350, 0)
    assert watch.stuck == ""


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clocks that count what they are asked.

    Where processor time is limited, the kernel's own moves by ticks.
    """
    monkeypatch.setattr(host_limits, "monotonic", count(100.0, 1.0).__next__)
    monkeypatch.setattr(host_limits, "process_time", count(50.0, 0.25).__next__)


@pytest.mark.usefixtures("counted")
def test_polls_that_could_be_told_something_have_wall_time() -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits(polling=0.0))
    board.kernel.timer(lambda: None).at(SECOND)
    board.run_until(5 * MS)
    bus = connect_in_process(board)
    with pytest.raises(HostStuck, match="it has polled for 0 s of wall time and read nothing"):
        polled(bus, 3 * LOOK, 0)
    assert watch.cycles == 2 * LOOK + 1


@pytest.mark.parametrize(("velocity", "in_vain"), [(4 << 16, False), (4, True)])
def test_chip_time_decides_of_polls_until_a_move_is_over(velocity: int, in_vain: bool) -> None:
    """4/65536 counts per sample take months for 5000 counts."""
    board = in_lockstep("LM629N-8")
    board.run_until(2 * MS)
    watch = HostWatch(board, Limits(chip_time=2 * SECOND, polls=30, polling=BUDGET.polling))
    bus = connect_in_process(board)
    axis = Lm628(bus)
    axis.load_filter(kp=300, kd=2000)
    axis.rsti(0)
    axis.load_trajectory(acc=400, vel=velocity, pos=5000, start=True)
    board.run_for(5 * MS)
    if not in_vain:
        polled(bus, 2000, 0)
        assert watch.stuck == ""
        return
    now = board.now
    with pytest.raises(HostStuck, match="it polled 300 times and read nothing new, and would"):
        polled(bus, 400, 0)
    assert board.now < now + MS, "the board itself has not gone on"
    assert not watch.slow
    ahead = next(line for line in watch.details if "would have" in line)
    assert ahead.startswith("x would have desired 0.47")
    assert "target 5000" in ahead
    assert ahead.endswith(" at 2000000us")


@pytest.mark.parametrize(
    ("part", "cycles"),
    [("MC1241A", ((True, 1, 0x31), (False, 0, 0), (False, 0, 0))), ("MCP-1200", ((False, 0, 0),))],
)
def test_polls_of_every_family_are_foreseen(
    part: str, cycles: tuple[tuple[bool, int, int], ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    board = in_lockstep(part)
    board.run_until(5 * MS)
    watch = HostWatch(board, Limits(chip_time=SECOND, polls=3, polling=BUDGET.polling))
    monkeypatch.setattr(watch, "_unchanging", lambda: False)
    bus = connect_in_process(board)

    def poll() -> None:
        for _ in range(200):
            for write, address, data in cycles:
                bus.delay("70us")
                bus.write(address, data) if write else bus.read(address)

    with pytest.raises(HostStuck, match="would read nothing new before"):
        poll()
    assert not watch.slow


def moving(policy: str, limits: Limits) -> tuple[HostWatch, Bus]:
    """Return a board on which something is due, so that a poll may be told something new."""
    rate = 1.0 if policy == "realtime" else None
    board = build(*for_test(of_part("LM629N-8"), "board.toml", rate=rate))
    board.run_until(5 * MS)
    board.kernel.timer(lambda: None).at(3000 * SECOND)
    watch = HostWatch(board, limits)
    return watch, connect_in_process(board)


@pytest.mark.usefixtures("counted")
@pytest.mark.parametrize("policy", ["lockstep", "realtime"])
def test_wall_time_says_nothing_of_a_host_where_time_is_virtual(policy: str) -> None:
    watch, bus = moving(policy, Limits(polling=0.0))
    with pytest.raises(HostStuck) as stuck:
        polled(bus, 3 * LOOK, 0)
    if policy == "realtime":
        assert str(stuck.value).startswith("the host hangs: it has polled for 0 s of wall time")
    else:
        assert str(stuck.value).startswith("the machine was too slow: it has polled for 0 s")
        assert f"it had made {watch.cycles} bus cycles, at 7001us of chip time" in watch.stuck
        assert watch.verdict("the program hangs") == f"the machine was too slow: {watch.stuck}"


def test_bounds_of_chip_time_end_a_host_before_a_wall_clock_does() -> None:
    watch, bus = moving("lockstep", Limits(UNBOUNDED, 10 * MS, polling=BUDGET.polling))
    with pytest.raises(HostStuck, match=r"the host hangs: it was not done after 0\.01 s of chip"):
        polled(bus, 6000, 0)
    assert not watch.slow


@pytest.mark.parametrize("names", [["monotonic", "monotonic_ns"], ["time", "time_ns"], ["all"]])
def test_wall_time_ends_though_a_test_has_stopped_its_clock(
    monkeypatch: pytest.MonkeyPatch, names: list[str]
) -> None:
    """As freezegun does it: in the module, and in each that has one of its functions."""
    clocks = ("time", "monotonic", "perf_counter", "process_time", "thread_time")
    every = [*clocks, *(f"{name}_ns" for name in clocks)]
    stopped = {}
    with monkeypatch.context() as patched:
        for name in every if names == ["all"] else names:
            real, value = getattr(time, name), getattr(time, name)()
            stopped[id(real)] = lambda value=value: value
            patched.setattr(time, name, stopped[id(real)])
        for module in [one for one in sys.modules.values() if one.__name__.startswith("vbus")]:
            for name, value in list(vars(module).items()):
                if id(value) in stopped:
                    patched.setattr(module, name, stopped[id(value)])
        watch, bus = moving("lockstep", Limits(cycles=UNBOUNDED, polling=0.05))
        with pytest.raises(HostStuck, match="the machine was too slow"):
            polled(bus, 900_000, 0)
    assert watch.slow


def test_a_host_that_makes_bus_cycles_or_lets_time_pass_makes_progress() -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits())
    assert watch.progress == (0, 0)
    connect_in_process(board).read(0)
    assert watch.progress == (1, board.now)
    before = board.now
    board.run_for(MS)
    assert watch.progress == (1, before + MS)


def test_long_stretches_of_polls_that_tell_nothing_new_are_no_cycles() -> None:
    """They are bounded by ``polling``, where that is a bound."""
    board = in_lockstep("LM629N-8")
    board.run_until(2 * MS)
    bus = connect_in_process(board)
    board.kernel.timer(lambda: None).at(SECOND)
    watch = HostWatch(board, Limits(cycles=1500, polling=60.0))
    bounded = HostWatch(board, Limits(cycles=1500))
    polled(bus, 4 * LOOK + 1, 0)
    assert (watch.stuck, bounded.stuck) == ("", "it made more than 1500 bus cycles")
    while not watch.stuck:
        bus.write(0, RSTI)
    assert watch.cycles == 1500 + 4 * LOOK + 1
    assert watch.stuck == (
        "it made more than 1500 bus cycles, beside 4000 of polls that gave it nothing new"
    )


@pytest.mark.usefixtures("counted")
def test_news_do_not_make_the_wall_time_of_polls_begin_anew_and_a_write_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    polls = Polls(2)
    old, new, wrote = (
        Packet(STATUS, "RDSTAT", text, "", (Cycle(0, text == "w", 0, 0),))
        for text in ("old", "new", "w")
    )
    for _ in range(3):
        polls.take(old, "old")
    assert [polls.seconds() for _ in range(3)] == [0.0, 0.5, 1.0]  # twice the processor's time
    assert not polls.take(new, "new")
    assert [polls.seconds() for _ in range(2)] == [1.0, 1.5]
    monkeypatch.setattr(host_limits, "process_time", count(90.0, 40.0).__next__)
    assert polls.seconds() == 3.0  # never more than the wall clock's
    polls.take(wrote, "w")
    assert polls.seconds() == 0.0


def test_a_loop_of_several_polls_is_one_too() -> None:
    board = in_lockstep("MCP-1200")
    watch = HostWatch(board, Limits(polls=100))
    board.run_until(5 * MS)
    bus = connect_in_process(board)
    with pytest.raises(HostStuck) as found:
        polled(bus, 60, 0x07, 0x00)
    assert "read FLAG" in str(found.value)
    assert "x read STATUS FCH" in str(found.value)
    assert watch.cycles == 102


def test_news_and_writes_begin_anew() -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits(polls=100))
    board.run_until(2 * MS)
    bus = connect_in_process(board)
    for _ in range(3):
        for _ in range(100):
            bus.read(0)
        bus.write(0, RSTI)
        bus.wait("1 ms")
        bus.writes(1, b"\0\0")
        board.run_for(MS)
    assert watch.stuck == ""
    with pytest.raises(HostStuck) as found:
        bus.reads(0, 101)
    assert "commands before:\n    " in str(found.value)
    assert "x RSTI resets BREAKPOINT" in str(found.value)


def test_a_host_that_catches_everything_is_ended_again_and_has_a_grace() -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits(cycles=10))
    board.run_until(2 * MS)
    bus = connect_in_process(board)
    bus.reads(0, 10)
    for _ in range(2):
        with pytest.raises(HostStuck, match="it made more than 10 bus cycles"):
            bus.read(0)
    watch.relent()
    bus.reads(0, 100)
    assert watch.stuck == "it made more than 10 bus cycles"
    with pytest.raises(HostStuck):
        polled(bus, GRACE, 0)
    assert watch.cycles == 12 + GRACE + 1


def test_a_host_that_lets_time_pass_and_makes_no_bus_cycle_is_ended() -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits(chip_time=2 * SECOND))
    bus = connect_in_process(board)
    bus.delay("2 s")
    assert (board.now, watch.left) == (2 * SECOND, 0)
    with pytest.raises(HostStuck, match="it was not done after 2 s of chip time"):
        bus.delay("1 ps")
    watch.relent()
    bus.delay(GRACE * MS)
    with pytest.raises(HostStuck):
        bus.delay("1 ps")
    assert watch.cycles == 0


def test_time_that_no_host_lets_pass_does_not_count() -> None:
    board = in_lockstep("LM629N-8")
    watch = HostWatch(board, Limits(chip_time=2 * SECOND))
    with watch.excused():
        board.run_for(5 * SECOND)
    board.run_for(2 * SECOND)
    assert (watch.left, watch.stuck) == (0, "")
    watch.close()
    board.run_for(SECOND)
    connect_in_process(board).read(0)
    assert (watch.stuck, watch.cycles) == ("", 0)


@pytest.mark.parametrize(
    ("given", "limits"),
    [
        ({}, BUDGET),
        ({"cycles": 7, "chip_time": "2 s"}, Limits(7, 2 * SECOND, BUDGET.polls, BUDGET.polling)),
        ({"polls": 5, "polling": "1.5 s"}, Limits(BUDGET.cycles, BUDGET.chip_time, 5, 1.5)),
    ],
)
def test_a_budget_is_a_table(given: object, limits: Limits) -> None:
    assert budget_of("here", given, BUDGET) == limits


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (7, "here: budget = 7: write a table, "),
        ({"cycle": 7}, "unknown key 'cycle'; did you mean \"cycles\"? allowed are cycles, chip_"),
        ({"cycles": "2 s"}, "cycles = '2 s': write a number more than 0"),
        ({"cycles": 0}, "cycles = 0: write a number more than 0"),
        ({"chip_time": 5}, "chip_time = 5: write a time with its unit"),
        ({"polling": "long"}, "polling = 'long': write a time with its unit"),
    ],
)
def test_a_budget_that_makes_no_sense_is_refused(given: object, message: str) -> None:
    with pytest.raises(ConfigError) as found:
        budget_of("here", given, BUDGET)
    assert message in str(found.value)


def test_budgets_end_tests_of_every_kind(suite: pytest.Pytester) -> None:
    suite.makepyprojecttoml("[tool.vbus.budget]\npolls = 300\n")
    suite.makepyfile(
        driver="""
        import os
        from vbus import connect

        print("about to wait", flush=True)
        with connect(os.environ["VBUS_LINK"]) as bus:
            while True:
                bus.read(0)
        """,
        test_it="""
        import pytest
        import vbus

        @pytest.fixture
        def ready(vbus_lm629):
            yield vbus_lm629
            vbus_lm629.bus.read(0)

        def test_host(ready):
            try:
                while True:
                    ready.bus.read(0)
            except Exception:
                raise AssertionError("not caught by who tries again")

        def test_swallowed(ready):
            try:
                while True:
                    ready.bus.read(0)
            except BaseException:
                pass

        def test_program(vbus_exec):
            vbus_exec("driver.py")

        def test_terminal(vbus_pty, vbus_clock):
            vbus_clock.advance("5 ms")
            with vbus.connect(f"pty:{vbus_pty}") as bus:
                while True:
                    bus.read(0)

        @pytest.mark.asyncio
        async def test_coroutine(vbus_pty, vbus_clock):
            from vbus.client.aio import connect
            vbus_clock.advance("5 ms")
            async with await connect(f"pty:{vbus_pty}") as bus:
                while True:
                    await bus.read(0)

        @pytest.mark.vbus(budget={"cycles": 20})
        def test_cycles(vbus_lm629):
            vbus_lm629.bus.reads(0, 21)

        @pytest.mark.vbus(budget={"chip_time": "1 s"})
        def test_time(vbus_lm629):
            vbus_lm629.clock.advance("3 s")
            vbus_lm629.bus.delay("900 ms")
            vbus_lm629.bus.read(0)
            vbus_lm629.bus.delay("100 ms")
            vbus_lm629.bus.read(0)

        def test_goes_on(vbus_lm629):
            vbus_lm629.bus.reads(0, 255)

        @pytest.mark.vbus(budget={"cycles": "many"})
        def test_mistake(vbus_board):
            pass
        """,
    )
    result = suite.runpytest_subprocess("-q", "test_it.py", "-rfE")
    result.assert_outcomes(failed=7, passed=1, errors=1)
    result.stdout.fnmatch_lines(
        [
            "*test_host*",
            "E*the host hangs: it polled 300 times and read nothing new, and nothing on the*",
            "*test_swallowed*",
            "the host hung: it polled 300 times and read nothing new, and nothing on the*",
            "*test_program*",
            "E*the host hangs: it polled *",
            "about to wait",
            "*test_terminal*",
            "E*the host hangs: it polled *",
            "*test_coroutine*",
            "E*the host hangs: it polled *",
            "*test_cycles*",
            "E*the host hangs: it made more than 20 bus cycles*",
            "*test_time*",
            "E*the host hangs: it was not done after 1 s of chip time*",
        ]
    )
    assert "in_process.py" not in result.stdout.str()


def test_a_driver_that_hangs_in_a_thread_ends_with_its_test(suite: pytest.Pytester) -> None:
    suite.makeconftest(
        """
        import pytest

        @pytest.hookimpl(tryfirst=True)
        def pytest_runtest_teardown(item):
            item.module.over.set()
        """
    )
    suite.makepyfile(
        """
        import asyncio, threading, time
        import pytest
        import vbus

        pytestmark = pytest.mark.vbus("LM629N-8", budget={"polls": 1000})
        read = threading.Event()
        hung = threading.Event()
        over = threading.Event()

        def poll(terminal, until=None):
            with vbus.connect(f"pty:{terminal}") as bus:
                while not bus.read(0) & 0x40:
                    read.set()
                    if until is not None:  # else it may have hung before the test is over
                        until.wait()

        def never_ends(terminal):
            try:
                poll(terminal)
            except BaseException:
                hung.set()
                while True:
                    time.sleep(0.01)

        @pytest.mark.asyncio
        async def test_hangs(vbus_pty):
            await asyncio.to_thread(poll, vbus_pty)

        @pytest.mark.asyncio
        async def test_next(vbus_pty):
            from vbus.client.aio import connect
            async with await connect(f"pty:{vbus_pty}") as bus:
                assert await bus.read(0) == 0

        @pytest.mark.asyncio
        async def test_does_not_wait_for_it(vbus_pty):
            read.clear()
            over.clear()
            task = asyncio.ensure_future(asyncio.to_thread(poll, vbus_pty, over))
            while not read.is_set():
                await asyncio.sleep(0)

        def test_never_ends(vbus_pty):
            threading.Thread(target=never_ends, args=[vbus_pty], daemon=True, name="mine").start()
            assert hung.wait(60)

        def test_last(vbus_lm629):
            assert vbus_lm629.bus.read(0)
        """
    )
    result = suite.runpytest_subprocess("-q", "--vbus-scope=never")
    result.stdout.fnmatch_lines(
        [
            "*left behind what hung on its terminal, and it goes on in the thread mine at *.py:*",
            "*HostStuck: the host hangs: it polled 1000 times and read nothing new, and noth*",
        ]
    )
    outcomes = result.parseoutcomes()
    assert (outcomes["passed"], outcomes["errors"]) == (3, 1)
    assert outcomes["failed"] == 2


def test_a_host_that_hangs_is_told_what_its_chip_has_and_what_it_has_not_ended() -> None:
    watch, bus = moving("lockstep", Limits(polls=500))
    before = watch.progress
    for address, data in ((0, 0x1E), (1, 0), (1, 8), (1, 0), (1, 5)):  # kp 5, and no UDF
        bus.write(address, data)
        bus.delay("100us")
    assert watch.progress[0] == before[0] + 5
    assert watch.progress[1] > before[1]
    with pytest.raises(HostStuck):
        polled(bus, 900_000, 0)
    (values,) = [line for line in watch.details if line.startswith("x has ")]
    assert "real 0" in values
    assert [line for line in watch.details if line.startswith("x notes lm628.")]


@pytest.mark.parametrize(("reads", "ends"), [(8, True), (12, False)])
def test_the_driver_of_the_tutorial_has_its_whole_budget(reads: int, ends: bool) -> None:
    run = runpy.run_path(str(Path(__file__).parents[3] / "docs/live/live.py"))["run"]
    run.__globals__["BUDGET"] = Limits(cycles=10)
    driver = f"""
from vbus import connect
with connect("pty:x") as bus:
    for _ in range({reads}):
        bus.read(0)
print("done")
"""
    printed = run(of_part("LM629N-8"), driver)["printed"]
    assert ("done" in printed) == ends
    assert ("more than 10 bus cycles" in printed) != ends
