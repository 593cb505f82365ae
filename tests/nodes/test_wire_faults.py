"""Faults of wires between nodes: late, lost, doubled, reordered, cut; each at its instants."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nodes.four_chips import BOARD as FOUR
from tests.nodes.four_chips import scenario
from tests.nodes.processes import Bench, ended
from tests.nodes.test_snapshot import snapshot_of
from vbus.board.build import load_board_text
from vbus.board.config import read_board_text
from vbus.boardfile.source import BoardFileError
from vbus.core.kernel import MS, US
from vbus.core.signals import HIGH, LOW, Z
from vbus.nodes.machine import Machine, build_nodes
from vbus.nodes.machine_snapshot import read, write
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario

TWO = """\
[board]
name = "two"
time = "lockstep"
power_on = "done"

[nodes.left]
[nodes.right]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
node = "left"

[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
node = "right"

[nets]
"BRAKE" = { pins = ["x./IN", "y./IN"], delay = "500 us" }
"""
EDGES = "1ms x pin /IN 0\n2ms x pin /IN 1\n3ms x pin /IN 0\n4ms x pin /IN 1\nend 8ms\n"

ALL = "".join(
    f'[[faults]]\nfault = "{name}"\ntarget = "{wire}"\nwhen = "at {at} ms"\nuntil = "for 3 ms"\n'
    for name, wire, at in (
        ("wire_late", "DONE", 3), ("wire_lost", "READY", 17), ("wire_doubled", "TRIG", 14),
        ("wire_reordered", "/SYNC", 4), ("wire_cut", "TRIG", 4),
    )
)  # fmt: skip


def fault(name: str, more: str = "") -> str:
    return (
        f'[[faults]]\nfault = "{name}"\ntarget = "BRAKE"\nwhen = "at 2 ms"\nuntil = "for 2 ms"\n'
        f"{more}"
    )


def run(text: str, script: str) -> Machine:
    file, source = read_board_text(text)
    machine = Machine(file, source, read_scenario(script, "s", pins_of(file), US))
    machine.run()
    return machine


def seen(text: str) -> list[tuple[float, int]]:
    """Instants (ms) and levels of the wire at the other node."""
    trace = run(text, EDGES).nodes[1].trace
    assert trace is not None
    edges = [(when / MS, line.split()) for when, line in trace.lines()]
    return [(when, int(words[-1])) for when, words in edges if words[0] == "e"]


@pytest.mark.parametrize(
    ("faults", "expected"),
    [
        ("", [(1.5, LOW), (2.5, HIGH), (3.5, LOW), (4.5, HIGH)]),
        (fault("wire_late", 'by = "200 us"\n'), [(1.5, LOW), (2.7, HIGH), (3.7, LOW), (4.5, HIGH)]),
        (fault("wire_late"), [(1.5, LOW), (3.5, HIGH), (4.5, LOW)]),
        (fault("wire_lost"), [(1.5, LOW), (4.5, HIGH)]),
        (
            fault("wire_doubled"),
            [
                (1.5, LOW), (2.5, HIGH), (2.51, LOW), (2.52, HIGH), (3.5, LOW), (3.51, HIGH),
                (3.52, LOW), (4.5, HIGH),
            ],
        ),
        (fault("wire_reordered", 'gap = "30 us"\n'), [(1.5, LOW), (3.53, HIGH)]),
        (fault("wire_cut"), [(1.5, LOW), (2.0, HIGH), (4.0, LOW), (4.5, HIGH)]),
        (
            fault("wire_late", 'by = "200 us"\n') + fault("wire_doubled"),
            [
                (1.5, LOW), (2.7, HIGH), (2.71, LOW), (2.72, HIGH), (3.7, LOW), (3.71, HIGH),
                (3.72, LOW), (4.5, HIGH),
            ],
        ),
    ],
)  # fmt: skip
def test_what_comes_at_the_other_end(faults: str, expected: list[tuple[float, int]]) -> None:
    assert seen(TWO + faults) == expected


def test_an_edge_that_was_kept_back_comes_when_the_fault_ends() -> None:
    text = TWO + fault("wire_reordered").replace("for 2 ms", "for 1 ms")
    assert seen(text) == [(1.5, LOW), (3.0, HIGH), (3.5, LOW), (4.5, HIGH)]


def test_a_fault_is_at_the_end_where_it_is_armed_and_cleared() -> None:
    file, source = read_board_text(TWO)
    left, right = build_nodes(file, source)
    armed = right.board.faults.arm("wire_cut")  # the only wire
    assert str(armed.target) == "BRAKE"
    assert not left.board.faults.all()
    assert right.ends[0].latest == {0: (Z, False)}
    right.accept([(0, 0, 0, 0, LOW, False)])
    right.run_before(2 * MS)
    end = right.ends[0]
    assert (end.far[0].level, end.latest) == (Z, {0: (LOW, False)})
    assert end.value == HIGH
    right.board.faults.clear(armed)
    assert (end.far[0].level, end.value, end.wrongs) == (LOW, LOW, [])


def test_what_makes_no_sense_is_refused_in_words() -> None:
    file, source = read_board_text(FOUR)
    node = build_nodes(file, source)[0]
    with pytest.raises(ValueError, match="wire_cut: there is no wire CABLE here; there are DONE"):
        node.board.faults.arm("wire_cut", "CABLE")
    several = build_nodes(file, source)[3]
    with pytest.raises(ValueError, match="wire_cut: say on which wire; there are /SYNC, TRIG"):
        several.board.faults.arm("wire_cut")
    bare = '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
    with pytest.raises(BoardFileError, match="wire_cut is for wires between nodes, and none ends"):
        load_board_text(bare + '[[faults]]\nfault = "wire_cut"\n')
    with pytest.raises(BoardFileError, match='there is no wire "CABLE" between nodes; there are'):
        read_board_text(TWO + '[[faults]]\nfault = "wire_cut"\ntarget = "CABLE"\n')


@pytest.fixture(scope="module")
def broken() -> str:
    machine = run(FOUR + ALL, scenario())
    for node in machine.nodes:
        assert all(armed.fired for armed in node.board.faults.all())
    assert sum(len(node.board.faults.all()) for node in machine.nodes) == 12
    hash_ = machine.trace_hash()
    assert hash_ != run(FOUR, scenario()).trace_hash()
    return hash_


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path, FOUR + ALL)
    yield made
    made.close()


def test_the_hash_is_the_same_in_any_number_of_processes_and_in_replays(
    bench: Bench, broken: str
) -> None:
    for groups in (["ac", "bd"], ["a", "b", "c", "d"]):
        journal = ("--journal", "run.vbj")
        processes = [bench.start(nodes, *journal, disturb=f"{len(groups)}:3") for nodes in groups]
        for process in processes:
            code, out = ended(process)
            assert code == 0, out
        assert bench.merged(groups) == broken
    done = bench.vbus("replay", *(f"run.{node}.vbj" for node in "abcd"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert broken in done.stdout


@settings(max_examples=15, deadline=None)
@given(number=st.integers(20, 100))
def test_snapshots_go_on_with_what_is_wrong_with_wires(number: int) -> None:
    file, source = read_board_text(FOUR + ALL)
    played = read_scenario(scenario(), "s", pins_of(file), US)
    whole, again = Machine(file, source, played), Machine(file, source, played)
    snapshot = snapshot_of(whole, number)
    again.load(read(write(snapshot)))
    again.run()
    assert again.trace_hash() == whole.trace_hash()
