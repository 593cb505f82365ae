"""``vbus monitor`` of a machine: what happens on the buses of all its nodes, as of one board."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from tests.nodes.processes import Bench
from tests.nodes.test_realtime import REAL, order
from tests.waiting import PATIENCE
from vbus.cli.sources import MachineFeed, boards_of
from vbus.core.kernel import MS

AHEAD = 5000 * MS
"""How far ahead cycles are ordered: all nodes must have heard of them by then."""


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Bench]:
    """Four nodes in two processes, in real time."""
    bench = Bench(tmp_path, REAL)
    try:
        for nodes in ("a", "bcd"):
            bench.start(nodes, script=False)
        bench.until(lambda: all(bench.node(n).get("skew", {}).get("marks", 0) > 0 for n in "abcd"))
        yield bench
    finally:
        bench.close()


def monitor(bench: Bench, *options: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "vbus", "monitor", "four", *options],
        env={**os.environ, "VBUS_RUNTIME": str(bench.folder / "run")},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def told(process: "subprocess.Popen[str]") -> tuple[int, list[dict[str, Any]], str]:
    out, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, [json.loads(line) for line in out.splitlines()], errors


def test_packets_of_all_nodes_are_shown_together(machine: Bench) -> None:
    process = monitor(machine, "--json", "--count", "2")
    assert process.stdout is not None
    assert json.loads(process.stdout.readline()) == {"board": "four"}
    order(machine, "0us x w 0 1\n1ms y w 0 1", AHEAD)
    code, lines, errors = told(process)
    assert (code, errors) == (0, "")
    packets = [line for line in lines if "rule" not in line]  # the axes have no trajectory
    assert sorted((line["chip"], line["text"]) for line in packets) == [
        ("x", "STT"), ("y", "STT"),
    ]  # fmt: skip


def test_values_of_all_nodes_come_together_at_the_instant_all_have_come_to(
    machine: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(machine.folder / "run"))
    with closing(MachineFeed(boards_of(["four"]))) as together:
        together.watch()
        told = [rest for kind, *rest in islice(together, 20) if kind == "t"]
    assert together.hello["board"] == "four"
    assert [chip["name"] for chip in together.hello["chips"]] == ["x", "y", "m", "p"]
    assert all({*values} == {"x", "y", "m", "p"} for _, values in told)
    instants = [now for now, _ in told]
    assert len({*instants}) > 10
    assert instants == sorted(instants)


def test_a_condition_is_looked_for_on_the_node_whose_chips_it_is_about(machine: Bench) -> None:
    process = monitor(machine, "--json", "--until", "falling(y./CS)")
    assert process.stdout is not None
    assert json.loads(process.stdout.readline()) == {"board": "four"}
    order(machine, "0us y w 0 1", AHEAD)
    code, lines, errors = told(process)
    assert (code, errors) == (0, "")
    assert lines[-1]["until"] == "falling(y./CS)"
    assert lines[-1]["when_ps"] > 0


def test_a_condition_that_no_node_can_look_for_is_refused(machine: Bench) -> None:
    code, _, errors = told(monitor(machine, "--json", "--until", "x.real > 1 and y.real > 1"))
    assert code == 1
    assert "a condition is about chips of one node" in errors


def test_what_is_for_one_board_names_the_nodes_of_a_machine(machine: Bench) -> None:
    named = '"four" is a machine of nodes; name one of them: four.a, four.b, four.c, four.d'
    for command in (["fault", "list", "four"], ["wave", "four", "-o", "x.vcd"]):
        done = machine.vbus(*command)
        assert done.returncode == 4, command
        assert named in done.stderr, command
