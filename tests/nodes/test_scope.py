"""The page of a machine: all nodes on one time axis, live and from their journals."""

import os
import re
import signal
import subprocess

import pytest

from tests.e2e.test_scope import link_in, seen_by_a_page
from tests.nodes.processes import Bench, ended
from tests.unit.scope.decoded import Seen, of_page
from vbus.kernel import MS

END = 20 * MS
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
        seen = seen_by_a_page(link, lambda seen: seen.now == END)
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
