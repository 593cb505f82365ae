"""The page of a machine: all nodes on one time axis, live and from their journals."""

import os
import re
import signal
import subprocess
from collections.abc import Callable
from typing import Any

import pytest

from tests.e2e.test_scope import link_in, seen_by_a_page
from tests.nodes.four_chips import BOARD, scenario
from tests.nodes.processes import Bench, ended
from tests.unit.views.scope.decoded import Seen, of_page
from vbus.board.config import read_board_text
from vbus.core.kernel import MS, US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.views.scope.merged import Merged
from vbus.views.scope.recording import Recorder

END = 20 * MS
PACKET = 5 * MS
"""Longer than any packet of the scenario takes until it is known: registers of which some bytes are
read at 16 ms become known at the end."""
SAMPLE = 256 * US
"""The longest of a chip here: who begins to look between two sees what the next one will tell."""
HOMES = {"a": "x", "c": "m"}
LANES = ("x.real", "x.desired", "y.desired", "m.real", "p.1.real", "p.1.desired")


def scope_of(process: "subprocess.Popen[str]") -> tuple[str, int]:
    """Return the link that a process prints before time begins, and whose process serves it."""
    assert process.stdout is not None
    for line in process.stdout:
        if found := re.search(r"^scope: .*\(process (\d+)\)$", line):
            return link_in(line), int(found[1])
    raise AssertionError("no link")


def journals(bench: Bench) -> list[str]:
    return [f"run.{node}.vbj" for node in "abcd"]


def packets(seen: Seen) -> dict[str, list[tuple[int, int, str, int]]]:
    """All packets of each bus in order of time; what they say comes when it is known."""
    return {name: sorted(seen.packets(name)) for name in seen.rows if name.endswith(" bus")}


@pytest.mark.parametrize("groups", [["abcd"], ["ac", "bd"]])
def test_a_page_has_all_nodes_from_the_first_instant_on_and_changes_nothing(
    bench: Bench, reference: str, groups: list[str]
) -> None:
    first, *others = groups
    for nodes in others:
        bench.start(nodes, "--journal", "run.vbj")
        bench.until(lambda nodes=nodes: all(bench.node(name) for name in nodes))  # type: ignore[misc]
    process = bench.start(first, "--journal", "run.vbj", "--scope", "127.0.0.1:0")
    link, page = scope_of(process)
    try:
        seen = seen_by_a_page(link, all_of(recorded()[1]))
    finally:
        os.kill(page, signal.SIGTERM)
    for process in bench.started:
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(groups) == reference
    done = bench.vbus("scope", *journals(bench), "-o", "four.html")
    assert (done.returncode, done.stderr) == (0, "")
    written = of_page((bench.folder / "four.html").read_bytes())
    assert written.now == END
    assert [axis["name"] for axis in seen.description["axes"]] == ["x", "y", "m", "p.1", "p.2"]
    for lane in LANES:
        assert len(written.rows[lane]) > 5 or lane.startswith("y"), lane
        assert seen.rows[lane] == written.rows[lane], lane
    assert packets(seen) == packets(written)
    assert packets(seen)["m bus"]
    wires = [name for name in written.rows if name.rpartition(".")[2] in ("DONE", "TRIG")]
    assert {"a.DONE", "d.DONE"} <= {*wires}


def test_nodes_are_shown_by_the_name_of_their_machine_and_never_halted(bench: Bench) -> None:
    bench.start("ab", "--patience", "60")
    bench.until(lambda: bool(bench.node("a")) and bool(bench.node("b")))
    done = bench.vbus("scope", "four.a", "--control")
    assert done.returncode == 1
    assert "four.a is a node: its time is that of all nodes" in done.stderr
    done = bench.vbus("scope", "four", "--control", "--listen", "127.0.0.1:0")
    assert done.returncode == 1
    assert "four: shown without c, d, which run on another computer, or not yet" in done.stderr
    assert "--control is for one board that has no nodes" in done.stderr


@pytest.mark.parametrize("killed", ["c", "a"])
def test_a_node_that_is_killed_and_rejoins_goes_on_where_it_was_on_the_page(
    bench: Bench, reference: str, killed: str
) -> None:
    whole, at_end = recorded()
    others = ["ac".replace(killed, ""), "bd"]
    running = [bench.start(others[0], "--patience", "60", disturb="1:20")]
    file = bench.folder / "node.snap"
    first = bench.start(killed, "--snapshot", str(file), "--patience", "60", disturb="2:20")
    for name in (*others[0], killed):
        bench.until(lambda name=name: bool(bench.node(name)))  # type: ignore[misc]
    last = bench.start(others[1], "--patience", "60", "--scope", "127.0.0.1:0")
    link, page = scope_of(last)
    try:
        bench.until(lambda: file.exists() and bench.node(killed).get("round", 0) > 20)
        first.kill()
        first.wait()
        bench.until(lambda: bench.node("b").get("others", {}).get(killed) == "lost")
        running.append(bench.start(killed, "--from", str(file), "--patience", "60"))
        seen = seen_by_a_page(link, all_of(at_end, killed))
    finally:
        os.kill(page, signal.SIGTERM)
    for process in (*running, last):
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged([*others, killed]) == reference
    back, unseen, halved = away(seen, killed)
    # At the end all go, on a busy machine far apart.
    told = {mark["text"] for _, mark in seen.rows["nodes"]}
    assert told - {back} <= {f"{name} has gone" for name in "abcd"}
    had = packets(seen)
    for lane in LANES:
        assert changes(seen.rows[lane], unseen) == changes(whole.rows[lane], unseen), lane
    for bus, rows in packets(whole).items():
        part = halved if bus == f"{HOMES[killed]} bus" else range(0)
        # What was told at the last instant before it went may be told again.
        assert outside(list(dict.fromkeys(had[bus])), part) == outside(rows, part), bus


def away(seen: Seen, node: str) -> tuple[str, range, range]:
    """Return what tells of a node's return, when it was not seen, and when packets not whole."""
    told = [mark["text"] for _, mark in seen.rows["nodes"]]
    said = re.compile(rf"{node} is back at (\d+) ps(?:, not seen since (\d+) ps)?")
    (back,) = filter(None, map(said.fullmatch, told))
    begun = int(back[1])
    unseen = range(int(back[2] or begun), begun + SAMPLE)
    # Packets under way where the page begins to look are not whole.
    return back[0], unseen, range(unseen.start - PACKET, begun + PACKET)


def all_of(
    at_end: dict[str, list[tuple[int, int, str, int]]], killed: str = ""
) -> Callable[[Seen], bool]:
    """Whether a page has come to the end, and has the packets that are known then only."""

    def enough(seen: Seen) -> bool:
        if seen.now != END:
            return False
        had = packets(seen)
        for bus, rows in at_end.items():
            mine = killed and bus == f"{HOMES[killed]} bus"
            wanted = outside(rows, away(seen, killed)[2]) if mine else rows
            if not all(row in had.get(bus, ()) for row in wanted):
                return False
        return True

    return enough


def outside(rows: list[tuple[Any, ...]], unseen: range) -> list[tuple[Any, ...]]:
    """Rows but those of a time, its two ends among it: what is at an end may have been seen."""
    return [row for row in rows if not unseen.start <= row[0] <= unseen.stop]


def changes(rows: list[tuple[Any, ...]], unseen: range) -> list[tuple[Any, ...]]:
    """The rows of a lane that differ from those before, but for a time."""
    before = [(0, None), *rows]
    new = [row for row, last in zip(rows, before, strict=False) if row[1] != last[1]]
    return outside(new, unseen)


def recorded() -> tuple[Seen, dict[str, list[tuple[int, int, str, int]]]]:
    """What a page has of the same run in one process; and of that, packets known at its end only.

    Those that are last on their bus are among them: a node's last message has come with them.
    """
    file, source = read_board_text(BOARD)
    machine = Machine(file, source, read_scenario(scenario(), "s", pins_of(file), US))
    recorders = [Recorder(node.board, edges=False) for node in machine.nodes]
    for recorder in recorders:
        recorder.start()
    machine.run()
    told = [recorder.lanes.described(live=True) for recorder in recorders]
    merged = Merged(told)

    def taken() -> bytes:
        return b"".join(
            merged.take(part, message)
            for part, recorder in enumerate(recorders) for message in recorder.take()
        )  # fmt: skip

    data = taken()
    before = packets(Seen(merged.description, data))
    for recorder in recorders:
        recorder.stop()
    whole = Seen(merged.description, data + taken())
    return whole, {
        bus: [row for row in rows if row not in before.get(bus, ()) or row == rows[-1]]
        for bus, rows in packets(whole).items()
    }
