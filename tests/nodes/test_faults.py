"""Faults of nodes: of the board file, and armed by hand; the same in any number of processes."""

import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.nodes.four_chips import BOARD as FOUR
from tests.nodes.four_chips import scenario
from tests.nodes.processes import Bench, ended
from tests.nodes.test_hosts import BOARD, both
from vbus.board.config import read_board_text
from vbus.boardfile.source import BoardFileError
from vbus.circuit.orders import PIN, Order, Orders
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, US
from vbus.nodes.machine import Machine, build_nodes
from vbus.nodes.plan import part_of, pins_of, plan_of
from vbus.nodes.scenario import read_scenario
from vbus.serve.registry import order

JAMMED = '[[faults]]\nfault = "jam"\ntarget = "x"\nwhen = "at 4 ms"\nuntil = "for 3 ms"\n'


def run(text: str) -> Machine:
    file, source = read_board_text(text)
    machine = Machine(file, source, read_scenario(scenario(), "s", pins_of(file), US))
    machine.run()
    return machine


def test_a_fault_of_the_board_file_acts_on_its_node_at_its_instant() -> None:
    healthy, broken = run(FOUR), run(FOUR + JAMMED)
    assert broken.trace_hash() != healthy.trace_hash()
    log = broken.nodes[0].board.faults.log
    assert [(one.when, one.target, one.what) for one in log] == [
        (4 * MS, "x.1", "begun"),
        (7 * MS, "x.1", "ended"),
    ]
    assert not any(node.board.faults.all() for node in broken.nodes[1:])


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path, FOUR + JAMMED)
    yield made
    made.close()


def test_a_fault_of_the_board_file_gives_one_hash_in_one_process_and_in_two(bench: Bench) -> None:
    for process in [bench.start("ac"), bench.start("bd")]:
        assert ended(process)[0] == 0
    assert bench.merged(["ac", "bd"]) == run(FOUR + JAMMED).trace_hash()


def test_a_fault_without_a_target_is_on_the_only_node_that_can_have_it() -> None:
    file, source = read_board_text(FOUR + '[[faults]]\nfault = "ready_stuck"\nwhen = "at 1 ms"\n')
    armed = [node.board.faults.all() for node in build_nodes(file, source)]
    assert [[one.target for one in node] for node in armed] == [[], [], [], ["p"]]
    with pytest.raises(BoardFileError, match='there is no link "hosts": count the'):
        read_board_text(FOUR + '[[faults]]\nfault = "link_dead"\ntarget = "hosts"\n')


def test_links_and_chips_of_faults_are_those_of_their_node() -> None:
    text = BOARD + "".join(
        f'[[faults]]\nfault = "{name}"\ntarget = "{target}"\nwhen = "at 9 ms"\n'
        for name, target in (("link_closed", "host1"), ("jam", "y"), ("link_dead", "host2"))
    )
    file, source = read_board_text(text)
    assert not part_of(file, "a").faults
    targets = [(fault.fault, fault.target) for fault in part_of(file, "b").faults]
    assert targets == [("link_closed", "host0"), ("jam", "y"), ("link_dead", "host1")]
    assert len(build_nodes(file, source)[1].board.faults.all()) == 3


def test_faults_of_messages_are_on_the_node_of_their_link() -> None:
    text = BOARD.replace('"unix:$VBUS_RUNTIME/text.sock"\nprotocol = "text"', '"zenoh:"')
    text += '[[faults]]\nfault = "message_lost"\ntarget = "host2"\nway = "reply"\nevery = 2\n'
    file, source = read_board_text(text)
    assert not part_of(file, "a").faults
    first, second = build_nodes(file, source)
    assert not first.board.faults.all()
    [armed] = second.board.faults.all()
    assert (armed.target, armed.values) == ("host1", {"way": "reply", "every": 2})


def test_each_node_has_its_own_faults_whatever_nodes_are_called() -> None:
    text = BOARD.replace("[nodes.a]", "[nodes.left]").replace("[nodes.b]", "[nodes.right]")
    text = text.replace('node = "a"', 'node = "left"').replace('node = "b"', 'node = "right"')
    for name in ("x", "y"):
        text += f'[[faults]]\nfault = "jam"\ntarget = "{name}"\nwhen = "at 9 ms"\n'
    file, _ = read_board_text(text)
    found = {node: [one.target for one in part_of(file, node).faults] for node in ("left", "right")}
    assert found == {"left": ["x"], "right": ["y"]}


@pytest.mark.parametrize(
    ("fault", "target", "message"),
    [
        ("jam", "", "faults[1].target: jam: say on which target; there are x, y"),
        ("jam", "z", 'faults[1].target: jam: there is no chip "z"; there are x, y'),
        ("link_dead", "host3", 'faults[1].target: there is no link "host3": count the [[hosts]]'),
        (
            "message_lost",
            "host1",
            "faults[1].target: message_lost: host1 (unix:$VBUS_RUNTIME/y.sock) is a stream of bytes"
            ", in which nothing is lost or doubled by itself and nothing overtakes; it is for links"
            ' of messages (transport = "zenoh:"), and a stream has answer_lost, answers_late and'
            " link_dead",
        ),
    ],
)
def test_a_target_that_is_on_no_node_is_named(fault: str, target: str, message: str) -> None:
    with pytest.raises(BoardFileError) as caught:
        read_board_text(f'{BOARD}[[faults]]\nfault = "{fault}"\ntarget = "{target}"\n', "b.toml")
    assert [str(problem).partition(": ")[2] for problem in caught.value.problems] == [message]


def test_a_fault_armed_by_hand_and_the_numbers_of_each_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hosts hold time at 0 until the fault is armed; it acts at 25 ms, wherever its node runs."""
    results = []
    for groups in (["ab"], ["a", "b"]):
        bench = Bench(tmp_path / str(len(groups)), BOARD, make=True)
        monkeypatch.setenv("VBUS_RUNTIME", str(bench.folder / "run"))
        try:
            for nodes in groups:
                bench.start(nodes, "--metrics", "127.0.0.1:0", script=False)
            bench.until(lambda bench=bench: bench.node("a") != {} != bench.node("b"))  # type: ignore[misc]
            given = {"name": "jam", "target": "y", "when": "at 25 ms", "until": "cleared"}
            assert "waiting" in order("four.b", "fault.arm", **given)["text"]
            with pytest.raises(VbusError, match=r"four.a is a node: its time and state are those"):
                order("four.a", "snap.save")
            seen = both(bench)
            (begun,) = order("four.b", "fault.log")
            assert (begun["when_ps"], begun["what"]) == (25 * MS, "begun")
            results.append(seen)
            pages = {told(bench, node)["metrics"] for node in "ab"}
            assert len(pages) == len(groups)
            text = "".join(urllib.request.urlopen(page).read().decode() for page in pages)
            for chip, node in (("x", "four.a"), ("y", "four.b")):
                row = f'vbus_bus_cycles_total{{board="{node}",chip="{chip}",direction="write"}}'
                assert text.count(row) == 1
            assert text.count("# TYPE vbus_lag_seconds ") == len(groups)
        finally:
            bench.close()
    assert results[0] == results[1]
    assert len(results[0][1]) == 22
    positions = [row[1] for row in results[0][1][1:-1]]  # type: ignore[index]
    assert len(set(positions[-5:])) == 1
    assert len(set(positions)) > 3


def told(bench: Bench, node: str) -> dict[str, str]:
    from vbus.serve.registry import ask

    state: dict[str, str] = ask(bench.folder / "run" / "boards" / f"four.{node}.sock")
    return state


def test_a_rate_is_for_real_time_and_the_same_on_all_nodes(bench: Bench) -> None:
    code, out = ended(bench.start("abcd", "--rate", "2"))
    assert code == 2
    assert "a rate makes sense in real time only; this board is lockstep" in out
    file, _ = read_board_text(FOUR.replace("lockstep", "realtime"))
    fast, _ = read_board_text(FOUR.replace('time = "lockstep"', 'time = "realtime"\nrate = 2'))
    assert plan_of(file).digest != plan_of(fast).digest


@pytest.mark.parametrize("heedless", [False, True])
def test_what_comes_from_outside_waits_until_its_edges_are_in_time(heedless: bool) -> None:
    """HI of x is put low and let go whenever node a is asked: node b hears of it in time."""
    file, source = read_board_text(BOARD)
    machine = Machine(file, source, read_scenario("end 20ms\n", "s", pins_of(file), US))
    first = machine.conductors[0]
    orders = Orders(first.node.board, "somebody", saved=False)
    poked = []

    def poke() -> None:
        poked.append(first.node.board.now)
        level = 0 if len(poked) % 2 else 2
        orders.give(Order(first.node.board.now, ("x",), PIN, 0, level, "HI"))

    moved = True
    while moved:
        moved = False
        for conductor in machine.conductors:
            if heedless and conductor.participant.reported and not poked:
                poke()
            elif not heedless and not first.outside:
                first.outside.append((0, poke))
            moved = machine.poll(conductor) or moved
    assert poked
    late = machine.nodes[1].late
    assert bool(late) == heedless
