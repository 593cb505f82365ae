"""Journals of nodes: each process writes those of its own, and one process replays the machine."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from tests.nodes.four_chips import BOARD as FOUR
from tests.nodes.processes import Bench, ended
from tests.nodes.test_faults import JAMMED, run
from tests.nodes.test_hosts import BOARD, both
from vbus.board.board import Board
from vbus.cli.test.replay import machine_hash
from vbus.core.kernel import MS
from vbus.nodes.machine import board_of
from vbus.nodes.node import Node
from vbus.record.format import Entry, JournalReader
from vbus.record.replay import Outcome, Replay
from vbus.serve.registry import order


def entries(path: Path) -> list[Entry]:
    with path.open("rb") as file:
        return list(JournalReader(file))


def replayed(path: Path, traced: bool = False) -> tuple[Board, Outcome]:
    with path.open("rb") as file:
        reader = JournalReader(file)
        board = board_of(reader.header, str(path))
        assert isinstance(board.beyond, Node)
        if traced:
            board.beyond.start_trace()
        return board, Replay(board, reader, reader.header.families).run()


def test_a_machine_of_two_processes_replays_in_one_to_the_same_hash(tmp_path: Path) -> None:
    bench = Bench(tmp_path, FOUR + JAMMED)
    try:
        outputs = ("--journal", "run.vbj", "--coverage", "c.json", "--report", "r.txt")
        for process in [bench.start(nodes, *outputs) for nodes in ("ac", "bd")]:
            assert ended(process)[0] == 0
        done = bench.vbus("replay", *(f"run.{node}.vbj" for node in "abcd"))
        assert done.returncode == 0, done.stdout
        assert done.stdout.count("no difference") == 4
        live = bench.merged(["ac", "bd"])
        assert done.stdout.endswith(f"trace hash {live}\n")
        assert live == run(FOUR + JAMMED).trace_hash()
        text = (tmp_path / "r.b.txt").read_text()
        assert "board.contention" in text
        assert {path.name for path in tmp_path.glob("c.*")} == {f"c.{n}.json" for n in "abcd"}
        explained = bench.vbus("explain", "run.a.vbj").stdout
        assert "UDF" in explained
        # All that reached node d over wires stands in its journal: without it the run is another.
        path = tmp_path / "run.d.vbj"
        kept = [entry for entry in entries(path) if entry.op != "arrive"]
        assert len(kept) < len(entries(path))
        numbered = [replace(entry, number=n) for n, entry in enumerate(kept)]
        end = numbered[-1]
        numbered[-1] = replace(end, args=(end.number, *end.args[1:]))
        with path.open("rb") as file:
            header = JournalReader(file).header
        again = Replay(board_of(header, ""), numbered, header.families).run()
        assert again.divergence is not None
    finally:
        bench.close()


@pytest.mark.parametrize("groups", [["ab"], ["a", "b"]])
def test_what_hosts_and_faults_did_to_nodes_is_replayed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, groups: list[str]
) -> None:
    bench = Bench(tmp_path, BOARD)
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    try:
        started = [bench.start(nodes, "--journal", "run.vbj", script=False) for nodes in groups]
        bench.until(lambda: bench.node("a") != {} != bench.node("b"))
        order("four.b", "fault.arm", name="jam", target="y", when="at 25 ms", until="cleared")
        seen = both(bench)
        assert order("four.b", "journal.save")["file"].endswith(".vbj")
        for process in started:
            process.terminate()
        assert [ended(process)[0] for process in started] == [0] * len(groups)
        played = [replayed(tmp_path / f"run.{node}.vbj", traced=True) for node in "ab"]
        for recorded, outcome in played:
            assert outcome.divergence is None
            assert outcome.ended
            assert outcome.cycles > 400
            assert recorded.now >= 40 * MS
        assert len(machine_hash([recorded for recorded, _ in played])) == 64
        assert machine_hash([played[0][0]]) == ""
        assert len(seen[0]) == 22
        # The whole state is compared where no trace looks on; a byte that differs is found.
        assert replayed(tmp_path / "run.a.vbj")[1].divergence is None
        path = tmp_path / "run.b.vbj"
        changed = [
            replace(entry, reply=entry.reply ^ 1)
            if entry.op == "read" and not entry.error and entry.when > 20 * MS
            else entry
            for entry in entries(path)
        ]
        assert any(entry.op == "arm" for entry in changed)
        with path.open("rb") as file:
            header = JournalReader(file).header
        outcome = Replay(board_of(header, ""), changed, header.families).run()
        assert outcome.divergence is not None
        assert outcome.divergence.what == "reply"
    finally:
        bench.close()


def test_journals_of_nodes_give_one_waveform_however_many_processes(tmp_path: Path) -> None:
    texts: list[bytes] = []
    for groups, given in ((["abcd"], "dbca"), (["ac", "bd"], "abcd")):
        folder = tmp_path / str(len(groups))
        folder.mkdir()
        bench = Bench(folder, FOUR + JAMMED)
        try:
            for process in [bench.start(nodes, "--journal", "run.vbj") for nodes in groups]:
                assert ended(process)[0] == 0
            names = [f"run.{node}.vbj" for node in given]
            done = bench.vbus("wave", *names, "-o", "run.vcd")
            assert done.returncode == 0, done.stdout
            texts.append((folder / "run.vcd").read_bytes())
            done = bench.vbus("wave", "run.b.vbj", "-o", "b.vcd")
            assert done.returncode == 0, done.stdout
            assert bench.vbus("wave", names[0], names[0], "-o", "no.vcd").returncode != 0
            refused = bench.vbus("wave", *names, "-o", "no.vcd", "--trigger", "violation")
            assert refused.returncode != 0
            assert not (folder / "no.vcd").exists()
            merged, alone = courses(folder / "run.vcd"), courses(folder / "b.vcd")
            assert {path[0] for path in merged} == set("abcd")
            assert {path[1:]: seen for path, seen in merged.items() if path[0] == "b"} == alone
            assert any(len(seen) > 10 for seen in alone.values())
        finally:
            bench.close()
    assert texts[0] == texts[1]


def courses(path: Path) -> dict[tuple[str, ...], list[tuple[int, str]]]:
    """Return the instants and values of every variable of a VCD file, by scopes and name."""
    scopes: list[str] = []
    found: dict[tuple[str, ...], list[tuple[int, str]]] = {}
    of: dict[str, list[tuple[int, str]]] = {}
    tick = -1
    for line in path.read_text().splitlines():
        words = line.split()
        if line.startswith("$scope"):
            scopes.append(words[2])
        elif line.startswith("$upscope"):
            scopes.pop()
        elif line.startswith("$var"):
            assert words[3] not in of
            of[words[3]] = found[(*scopes, words[4])] = []
        elif line.startswith("#"):
            assert int(line[1:]) > tick
            tick = int(line[1:])
        elif tick >= 0 and not line.startswith("$"):
            value, _, code = line.rpartition(" ") if line[0] in "brs" else (line[0], "", line[1:])
            of[code].append((tick, value))
    return found
