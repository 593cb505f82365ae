"""A machine of nodes in a test: one virtual time, and each node watched as a board is."""

import shlex
import subprocess
import sys

import pytest

from tests.nodes.four_chips import BOARD
from vbus.board.config import read_board_text
from vbus.core.errors import ConfigError, VbusError
from vbus.core.kernel import MS, US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.testing.limits import BUDGET, HostStuck, Limits
from vbus.testing.machine import TestedMachine

pytest_plugins = "pytester"

TWO = """\
[board]
name = "two"
time = "lockstep"

[nodes.left]
[nodes.right]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "x"
node = "left"

[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "y"
node = "right"

[plants.x]
model = "dc_motor"

[plants.y]
model = "dc_motor"

[nets]
"BRAKE" = { pins = ["x.HI", "y./IN"], delay = "500 us" }
"""


def made(text: str = TWO, budget: Limits = BUDGET) -> TestedMachine:
    return TestedMachine(*read_board_text(text), False, budget)


def drive(machine: TestedMachine) -> list[object]:
    """A test's own program: it goes from node to node, and looks at what it moves."""
    x, y = machine.chip("x"), machine.chip("y")
    for axis in (x, y):
        axis.host.check_reset()
        axis.host.load_filter(kp=300, kd=2000)
    x.host.load_trajectory(acc=400, vel=4 << 16, pos=300, start=True)
    y.host.load_trajectory(acc=400, vel=4 << 16, pos=-200, start=True)
    seen: list[object] = []
    for _ in range(20):
        machine.advance("5ms")
        seen.append((machine.now, x.host.rdrp(), y.host.rdrp(), x.plant.count))
        seen.append((machine.now, y.plant.count, y.host.status()))
    return seen


def test_a_test_is_one_program_whose_time_never_runs_back_and_every_run_is_the_same() -> None:
    runs = []
    for _ in range(2):
        machine = made()
        machine.trace()
        seen = drive(machine)
        runs.append((seen, machine.trace_hash()))
        machine.close()
    assert runs[0] == runs[1]
    seen, _ = runs[0]
    instants = [row[0] for row in seen]  # type: ignore[index]
    assert instants == sorted(instants)
    assert seen[-2][1] == pytest.approx(300, abs=10)  # type: ignore[index]
    assert seen[-1][1] == pytest.approx(-200, abs=10)  # type: ignore[index]


def test_what_a_test_does_is_what_a_scenario_of_the_same_cycles_does() -> None:
    machine = made()
    machine.trace()
    drive(machine)
    machine.advance("1ms")
    hash_, now = machine.trace_hash(), machine.now
    lines = []
    for node in machine.nodes:
        trace = machine.board(node).observers
        (notes,) = [one.lines() for one in trace if type(one).__name__ == "NodeTrace"]  # type: ignore[attr-defined]
        for when, text in notes:
            kind, *words = text.split()
            if kind in "rw":
                chip, address, data = words
                at = f"{when // US}.{when % US:06}us"
                what = data if kind == "w" else "1"
                lines.append((when, f"{at} {chip} {kind} {address} {what}"))
    machine.close()
    assert len(lines) > 300
    text = "\n".join(line for _, line in sorted(lines))
    file, source = read_board_text(TWO)
    played = read_scenario(f"{text}\nend {now // US}us\n", "s", pins_of(file), US)
    again = Machine(file, source, played)
    again.run()
    assert again.trace_hash() == hash_


def test_what_a_node_is_asked_has_happened_by_now_also_from_other_nodes() -> None:
    """x is done, HI rises, and half a millisecond later y sees its index pin."""
    machine = made()
    x = machine.chip("x")
    x.host.load_filter(kp=300, kd=2000)
    x.host.rsti(0)  # it is complete after reset, too
    x.host.mski(0x04)
    x.host.load_trajectory(acc=400, vel=4 << 16, pos=20, start=True)
    while not x.host.status() & 0x04:
        machine.advance("10us")
    rose = machine.now
    pin = machine.board("right").chip("y").pins["/IN"]
    machine.run_until(rose + 400 * US)
    assert not pin.value
    machine.run_until(rose + 510 * US)
    board = machine.board("right")
    assert board.now == machine.now == rose + 510 * US
    assert pin.value
    machine.close()


def test_a_host_that_goes_from_node_to_node_loses_no_time() -> None:
    machine = made(BOARD)
    buses = [machine.connect(chip) for chip in "xymp"]
    before = machine.now
    for bus, chip in zip(buses, "xymp", strict=True):
        bus.chip(chip).read(0)
    # A cycle each takes a microsecond, and no quantum of the nodes is between them.
    assert machine.now - before == 4 * US
    machine.close()


def test_a_host_that_polls_for_another_node_is_not_stuck_until_its_budget_is_over() -> None:
    machine = made(budget=Limits(20_000, 60 * 1000 * MS, 50, float("inf")))
    bus = machine.connect("y")

    def poll(count: int) -> None:  # nothing can change on its own node
        for _ in range(count):
            bus.reads(0, 5)

    poll(2000)
    assert machine.tested[1].watch.cycles == 10_000
    with pytest.raises(HostStuck, match="it made more than 20000 bus cycles"):
        poll(3000)
    machine.close()


def test_what_makes_no_sense_is_refused_in_words() -> None:
    machine = made()
    for call, said in (
        (lambda: machine.board("up"), 'the machine has no node "up"; it has left, right'),
        (lambda: machine.chip("z"), 'the machine has no chip "z"; it has x, y'),
        (lambda: machine.connect("x", "y"), "a host is at one node, and x, y are on several"),
        (machine.connect, "connect: to which chips? name at least one"),
        (lambda: machine.advance(-1), "advance by -1: time does not run backwards"),
        (lambda: machine.advance("1 parsec"), "parsec"),
        (machine.trace_hash, "no trace is running"),
        (lambda: machine.board("left").wait_until("x.HI == 1"), "time of a node is that of all"),
        (lambda: machine.run_until(1 << 63), "time ends at"),
    ):
        with pytest.raises(VbusError) as caught:
            call()
        assert said in str(caught.value)
    machine.advance("1ms")
    with pytest.raises(VbusError, match=r"^run_until 0\.5 ms: it is 1 ms already$|already"):
        machine.run_until("500us")
    with pytest.raises(VbusError, match="ask for it first"):
        machine.trace()
    port = machine.board("left").open_port("own")
    port.delay(10 * US)
    with pytest.raises(VbusError, match="a port that was opened on its board holds its time"):
        machine.advance("5ms")
    port.close()
    machine.advance("5ms")
    chip = machine.chip("x")
    then = machine.now + MS
    chip.clock.advance("1ms")
    assert machine.now == machine.board("right").now == chip.clock.now == then
    with pytest.raises(VbusError, match="time of a node is that of all"):
        chip.clock.wait_until("x.HI == 1")
    machine.close()
    bare = '[board]\nname = "b"\n[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
    with pytest.raises(ConfigError, match='has no nodes: take the fixture "vbus_board"'):
        made(bare)
    with pytest.raises(ConfigError, match="follow the wall clock in processes of their own"):
        made(TWO.replace("lockstep", "realtime"))


# -- as a fixture ------------------------------------------------------------------------------


@pytest.fixture
def suite(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    monkeypatch.setenv("PYTEST_ADDOPTS", "-p no:hypothesispytest")  # it takes long to import
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function\n")
    pytester.makefile(".toml", two=TWO)
    return pytester


def test_a_violation_on_any_node_fails_the_test_and_the_nodes_journals_replay(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(
        """
        import pytest

        pytestmark = pytest.mark.vbus(board="two.toml")

        def test_right(vbus_machine):
            axis = vbus_machine.chip("y")
            axis.host.check_reset()
            assert axis.node == "right"
            assert repr(axis) == '<LM629N-8 y on node "right">'

        def test_wrong(vbus_machine):
            vbus_machine.chip("x").host.check_reset()
            bus = vbus_machine.connect("y")
            bus.chip("y").write(0, 0x1E)
            bus.chip("y").write(0, 0x1E)  # while it is busy
        """
    )
    done = suite.runpytest("-q", "--vbus-dir", "kept", "--vbus-wave", "on-failure")
    done.assert_outcomes(passed=1, failed=1)
    done.stdout.fnmatch_lines(
        ["*lm628.busy-write*", 'board "two.left" at *', 'board "two.right" *']
    )
    kept = sorted(path.name for path in (suite.path / "kept").iterdir())
    assert [name.rpartition(".")[2] for name in kept].count("vbj") == 2
    assert [name.rpartition(".")[2] for name in kept].count("vcd") == 2
    assert [name.rpartition(".")[2] for name in kept].count("html") == 2
    for name in kept:
        if name.endswith(".vbj"):
            replayed = subprocess.run(
                [sys.executable, "-m", "vbus", "replay", shlex.quote(name)],
                cwd=suite.path / "kept", capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
            assert replayed.returncode == 0, replayed.stderr


def test_the_fixtures_of_boards_and_of_machines_name_each_other(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.vbus(board="two.toml")
        def test_board(vbus_board):
            pass

        def test_machine(vbus_machine):
            pass

        @pytest.mark.vbus(board="two.toml", rate=2)
        def test_real_time(vbus_machine):
            pass
        """
    )
    done = suite.runpytest("-q")
    done.assert_outcomes(errors=3)
    for said in (
        '*this board has nodes: take the fixture "vbus_machine"*',
        '*this board has no nodes: take the fixture "vbus_board"*',
        "*a test has them in virtual time: leave rate out*",
    ):
        done.stdout.fnmatch_lines([said])


def test_seeds_strictness_and_faults_are_those_of_every_node(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.vbus(board="two.toml", seed=7, strict=True)
        def test_it(vbus_machine):
            boards = [vbus_machine.board(node) for node in vbus_machine.nodes]
            assert [board.seed for board in boards] == [7, 7]
            assert all(board.violation_policy.default == 2 for board in boards)
            boards[1].faults.arm("jam", when="at 1 ms")
            vbus_machine.advance("2 ms")

        @pytest.mark.vbus(board="two.toml")
        def test_never(vbus_machine):
            vbus_machine.board("left").faults.arm("jam", when="at 1 s")
        """
    )
    done = suite.runpytest("-q")
    done.assert_outcomes(passed=1, failed=1)
    done.stdout.fnmatch_lines(['*of board "two.left" never fired*'])
