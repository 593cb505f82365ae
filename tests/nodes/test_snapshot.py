"""Snapshots of a whole machine: taken while it runs, gone on from in any number of processes."""

import base64
import hashlib
import json
import random
import threading
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nodes.four_chips import BOARD, scenario
from tests.nodes.processes import Bench, ended
from tests.nodes.test_hosts import BOARD as BOARD_WITH_HOSTS
from vbus.board.board import Board
from vbus.board.config import read_board_text
from vbus.board.snapshot import seal, take
from vbus.board.snapshot import write as write_board
from vbus.cli.run.snap import save, save_machine
from vbus.client import connect
from vbus.client.lm628 import Lm628
from vbus.core.errors import SnapshotError, VbusError
from vbus.core.kernel import MS, US
from vbus.nodes.conductor import Conductor
from vbus.nodes.machine import Machine
from vbus.nodes.machine_snapshot import MAGIC, MachineSnapshot, read, write
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario

HOSTS = BOARD_WITH_HOSTS.replace('chips = ["y"]\nawaited = true', 'chips = ["y"]')
"""Time waits for the host of x alone."""


def saved(bench: Bench, groups: list[str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """Run nodes with slow messages, take a snapshot on the way, and let them come to their end."""
    monkeypatch.setenv("VBUS_RUNTIME", str(bench.folder / "run"))
    processes = [bench.start(nodes, disturb=f"{n}:40") for n, nodes in enumerate(groups, 1)]
    bench.until(lambda: all(bench.node(nodes[0]).get("round", 0) > 8 for nodes in groups))
    # In this process: time goes on while another one would start.
    done = CliRunner().invoke(save, ["four", str(bench.folder / "four.snap"), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert told["nodes"] == [*"abcd"]
    assert 0 < told["when_ps"] < 20 * MS
    assert told["bytes"] == (bench.folder / "four.snap").stat().st_size
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
    return bench.folder / "four.snap"


def at_rest(bench: Bench) -> Path:
    """Take a snapshot of a machine whose hosts want nothing, and stop it."""
    process = bench.start("abcd", script=False)
    bench.until(lambda: all(bench.node(node).get("state") == "rests" for node in "abcd"))
    done = bench.vbus("snap", "save", "four", "four.snap")
    assert done.returncode == 0, done.stderr
    process.terminate()
    ended(process)
    return bench.folder / "four.snap"


def test_what_follows_a_snapshot_is_the_same_in_one_two_and_four_processes(
    bench: Bench, reference: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    groups = ["a", "bd", "c"]
    file = saved(bench, groups, monkeypatch)
    assert bench.merged(groups) == reference  # it was looked at only
    draw = random.Random(7)
    for groups in (["abcd"], ["ac", "bd"], ["a", "b", "c", "d"]):
        for trace in bench.folder.glob("*.trace"):
            trace.unlink()
        processes = [
            bench.start(nodes, "--from", str(file), hash_seed=draw.randrange(1, 1 << 30))
            for nodes in groups
        ]
        for process in processes:
            code, out = ended(process)
            assert code == 0, out
            assert "the scenario is over at 20.000000 ms" in out
        assert bench.merged(groups) == reference


def test_a_snapshot_has_all_nodes_at_the_end_of_one_round(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = saved(bench, ["ab", "cd"], monkeypatch)
    found = read(file.read_bytes())
    assert list(found.nodes) == [*"abcd"]
    assert {part.text for part in found.nodes.values()} == {bench.board.read_text()}
    # At most a quantum lies between nodes that have ended the same round.
    assert found.when - min(part.when for part in found.nodes.values()) <= 200 * US
    told = json.loads(bench.vbus("snap", "info", "four.snap", "--json").stdout)
    assert (told["board"], told["round"], told["when_ps"]) == ("four", found.round, found.when)
    assert told["nodes"]["c"]["when_ps"] == found.nodes["c"].when
    lines = bench.vbus("snap", "info", "four.snap").stdout.splitlines()
    assert lines[0].startswith("four (")
    assert lines[0].endswith(f"the end of round {found.round}")
    assert len(lines) == 6
    done = bench.vbus("snap", "info", "four.snap", "--board-file")
    assert done.stdout == bench.board.read_text()


def test_a_machine_whose_hosts_want_nothing_is_saved_where_it_rests(bench: Bench) -> None:
    for nodes in ("ab", "cd"):
        bench.start(nodes, script=False)
    bench.until(lambda: all(bench.node(node).get("state") == "rests" for node in "abcd"))
    for file in ("one.snap", "two.snap"):
        done = bench.vbus("snap", "save", "four", file)
        assert done.returncode == 0, done.stderr
    one, two = (read((bench.folder / name).read_bytes()) for name in ("one.snap", "two.snap"))
    assert one.when == two.when


def test_a_snapshot_of_half_a_machine_is_refused(bench: Bench) -> None:
    bench.start("ab", script=False)
    bench.until(lambda: bench.node("a") != {} and bench.node("b") != {})
    done = bench.vbus("snap", "save", "four", "four.snap")
    assert done.returncode == 1
    assert done.stderr == (
        "vbus: four: c (not here yet), d (not here yet) do not answer, and a snapshot has all nodes"
        " of a machine; say it again when they are here (vbus ls)\n"
    )
    assert not (bench.folder / "four.snap").exists()
    done = bench.vbus("snap", "save", "four.a", "a.snap")
    assert done.returncode == 1
    assert "vbus snap save with the name of the machine" in done.stderr


def test_where_a_snapshot_does_not_fit_a_machine_says_why(bench: Bench) -> None:
    file = at_rest(bench)
    other = bench.folder / "other.toml"
    other.write_text(bench.board.read_text().replace("300 us", "301 us"))
    code, out = ended(bench.start("abcd", "--from", str(file), board=other))
    assert code == 1
    assert 'the snapshot was taken on another version of the board file of "four.a"' in out
    code, out = ended(bench.start("abcd", "--from", str(file), "--journal", "run.vbj"))
    assert code == 2
    assert "nothing can be recorded of a node that goes on from a snapshot" in out
    assert out.rstrip().endswith("leave it out with --from")
    (bench.folder / "cut.snap").write_bytes(file.read_bytes()[:-1])
    code, out = ended(bench.start("abcd", "--from", "cut.snap"))
    assert code == 1
    assert "cut.snap: cut short or damaged: its checksum does not fit" in out
    bench.started.clear()
    bench.start("abcd", script=False)
    bench.until(lambda: all(bench.node(node) for node in "abcd"))
    done = bench.vbus("snap", "load", "four.a", "four.snap")
    assert done.returncode == 1
    assert "four.snap: a machine that runs is not brought back to a snapshot" in done.stderr


def test_a_machine_in_real_time_has_no_snapshot(tmp_path: Path) -> None:
    bench = Bench(tmp_path, BOARD.replace('"lockstep"', '"realtime"'))
    try:
        bench.start("abcd", script=False)
        bench.until(lambda: all(bench.node(node) for node in "abcd"))
        done = bench.vbus("snap", "save", "four", "four.snap")
        assert done.returncode == 1
        assert "a snapshot is for virtual time; this board is realtime" in done.stderr
    finally:
        bench.close()


def test_a_machine_is_saved_while_its_hosts_work_and_goes_on_without_them(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HOSTS)
    far = f"unix:{bench.folder}/run/x.sock"
    try:
        processes = [bench.start(node, script=False) for node in "ab"]
        bench.until((bench.folder / "run" / "x.sock").exists)
        enough = threading.Event()

        def work() -> None:
            with connect(far) as bus, bus.claim():
                axis = Lm628(bus)
                axis.check_reset()
                axis.load_filter(kp=300, kd=2000)
                axis.load_trajectory(acc=100, vel=400_000, pos=3000, start=True)
                while not enough.is_set():
                    bus.delay("1ms")
                assert abs(axis.rdrp()) > 10

        working = threading.Thread(target=work)
        working.start()
        bench.until(lambda: bench.node("a").get("round", 0) > 20)
        done = bench.vbus("snap", "save", "four", "four.snap")
        enough.set()
        working.join()
        assert done.returncode == 0, done.stderr
        for process in processes:
            process.terminate()
            ended(process)
        bench.started.clear()
        snapshot = read((bench.folder / "four.snap").read_bytes())
        assert [host.chips for host in snapshot.nodes["a"].hosts] == [("x",)]
        assert snapshot.nodes["b"].hosts == ()
        seen = []
        for groups in (["ab"], ["a", "b"]):
            processes = [
                bench.start(nodes, "--from", "four.snap", script=False) for nodes in groups
            ]
            bench.until((bench.folder / "run" / "x.sock").exists)
            with connect(far) as bus, bus.claim():  # that of the host before is let go
                began = bus.now()
                bus.delay("1s")
                seen.append((began, bus.now(), Lm628(bus).rdrp(), Lm628(bus).rddp()))
            for process in processes:
                process.terminate()
                ended(process)
            bench.started.clear()
    finally:
        bench.close()
    assert seen[0] == seen[1]
    began, now, real, desired = seen[0]
    assert began == snapshot.nodes["a"].when
    assert now - began >= 10**12
    assert (abs(real - 3000) < 10, desired) == (True, 3000)


def test_a_host_that_thinks_is_waited_for_and_then_named(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HOSTS)
    try:
        bench.start("ab", script=False)
        bench.until((bench.folder / "run" / "x.sock").exists)
        with connect(f"unix:{bench.folder}/run/x.sock") as bus:
            bus.delay("3ms")
            done = bench.vbus("snap", "save", "four", "four.snap")
        assert done.returncode == 1
        assert "node a waits for its host, so round " in done.stderr
        assert " has not ended; say it again when time runs" in done.stderr
    finally:
        bench.close()


# -- the file ------------------------------------------------------------------------------


def machine() -> Machine:
    file, source = read_board_text(BOARD)
    return Machine(file, source, read_scenario(scenario(), "s", pins_of(file), US))


def snapshot_of(made: Machine, number: int) -> MachineSnapshot:
    """Run to the end; return the snapshot at the end of a round."""
    parts = {}

    def keep(conductor: Conductor) -> None:
        parts[conductor.node.name] = conductor.save()

    for conductor in made.conductors:
        conductor.at_round.append((number, partial(keep, conductor)))
    made.run()
    return MachineSnapshot("four", number, {node: parts[node] for node in "abcd"})


@settings(max_examples=15, deadline=None)
@given(number=st.integers(1, 100))
def test_any_round_will_do(number: int) -> None:
    whole = machine()
    file = write(snapshot_of(whole, number))
    again = machine()
    again.load(read(file))
    again.run()
    assert again.trace_hash() == whole.trace_hash()


def test_it_goes_on_with_what_it_was_taken_with_only() -> None:
    file, source = read_board_text(BOARD)
    pins = pins_of(file)
    text = scenario()
    snapshot = snapshot_of(machine(), 20)
    bare = Machine(file, source)
    with pytest.raises(SnapshotError, match=r"^the snapshot is of a run with a scenario: give it$"):
        bare.load(snapshot)
    line = next(line for line in text.splitlines() if line.startswith("16000"))
    for other in (text.replace(line, ""), text.replace(line, line.replace("16", "17", 1))):
        another = Machine(file, source, read_scenario(other, "s", pins, US))
        with pytest.raises(SnapshotError, match=r"^the snapshot is of a run with another scenario"):
            another.load(snapshot)
    part = snapshot.nodes["a"]
    beyond = part.state["beyond"]
    for change in ({"waiting": 7}, {"waiting": ({},)}, {"_given": None}):
        orders = ({**beyond["orders"][0], **change},)
        forged = replace(part, state={**part.state, "beyond": {**beyond, "orders": orders}})
        nodes = {**snapshot.nodes, "a": forged}
        with pytest.raises(SnapshotError, match=r"^the snapshot is of a run with another scenario"):
            machine().load(msgspec.structs.replace(snapshot, nodes=nodes))
    resting = snapshot_of(bare, 1)
    with pytest.raises(
        SnapshotError, match=r"^the snapshot is of a run without a scenario: leave --scenario out$"
    ):
        machine().load(resting)
    traced = Machine(file, source)
    for node in traced.nodes:
        node.start_trace()
    with pytest.raises(SnapshotError, match=r"without a trace: leave --trace out$"):
        traced.load(resting)
    noted = snapshot_of(traced, 1)
    with pytest.raises(SnapshotError, match=r"with a trace: give --trace FILE$"):
        Machine(file, source).load(noted)


def test_a_file_that_is_damaged_or_of_another_format_is_refused() -> None:
    snapshot = snapshot_of(machine(), 20)
    data = write(snapshot)
    assert read(data) == snapshot
    with pytest.raises(
        SnapshotError, match=r"^x\.snap is no snapshot of a machine of nodes: it looks like "
    ):
        read(b"vbus snapshot\n", "x.snap")
    for cut in (len(MAGIC), len(MAGIC) + 20, len(data) - 1):
        with pytest.raises(SnapshotError, match=r"^x: cut short or damaged: its checksum does not"):
            read(data[:cut], "x")
    with pytest.raises(SnapshotError, match=r"^x: format 2; this vbus reads format 1$"):
        read(seal(MAGIC, 2, "four", 20, {}), "x")
    for body in (b"", b"\x93\x01\x02\x03", b"\xc1", b"\x07", b"\x94\x01\xa1m\x05\x80"):
        with pytest.raises(SnapshotError, match=r"^x: its content makes no sense: "):
            read(MAGIC + hashlib.sha256(body).digest() + body, "x")
    with pytest.raises(SnapshotError, match=r"^x, node a is no snapshot of vbus"):
        read(seal(MAGIC, 1, "four", 20, {"a": b"state"}), "x")
    three = {node: part for node, part in snapshot.nodes.items() if node != "d"}
    lesser = msgspec.structs.replace(snapshot, nodes=three)
    with pytest.raises(SnapshotError, match=r"^the snapshot has no node d$"):
        machine().load(lesser)


SOME = write_board(take(Board("m.a")))


@pytest.mark.parametrize("until_together", [0, 1, 3, 4])
def test_nodes_that_were_asked_too_late_for_one_round_are_asked_for_a_later_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, until_together: int
) -> None:
    asked: list[tuple[str, int]] = []

    def order(board: str, do: str, **values: int) -> dict[str, object]:
        number = values["round"]
        asked.append((board, number))
        late = board == "m.b" and len({n for _, n in asked}) <= until_together
        return {"round": number + 7 * late, "data": base64.b64encode(SOME).decode()}

    monkeypatch.setattr("vbus.serve.registry.order", order)
    nodes = {name: {"round": 10, "others": {}} for name in "ab"}
    file = tmp_path / "m.snap"
    if until_together < 4:
        save_machine("m", nodes, file, True)
        found = read(file.read_bytes())
        numbers = list(dict.fromkeys(number for _, number in asked))
        assert len(numbers) == until_together + 1
        assert numbers[0] == 12
        assert all(later > before + 7 for before, later in pairwise(numbers))
        assert (found.round, list(found.nodes)) == (numbers[-1], ["a", "b"])
    else:
        with pytest.raises(
            VbusError, match=r"^m: its rounds pass faster than all its nodes can be"
        ):
            save_machine("m", nodes, file, True)
        assert not file.exists()
