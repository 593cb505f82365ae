"""Nodes in real time: one epoch, starts ordered for one instant, skew that is measured."""

import asyncio
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import cast

import pytest

from tests.e2e.test_scope import link_in, seen_by_a_page
from tests.nodes.four_chips import BOARD, scenario
from tests.nodes.processes import Bench, ended
from tests.unit.views.scope.decoded import Seen
from tests.waiting import Starved
from vbus.board.config import read_board_file, read_board_text
from vbus.core.errors import ConfigError, NodeError
from vbus.core.kernel import MS, US
from vbus.nodes.machine import Machine, node_of
from vbus.nodes.messages import WireEdges
from vbus.nodes.plan import pins_of, plan_of
from vbus.nodes.scenario import read_scenario
from vbus.serve.nodes import ordering
from vbus.serve.nodes.node_link import NodeLink
from vbus.serve.nodes.peers import Group
from vbus.serve.nodes.realtime_nodes import BOUNDS_NS, ClockEstimate, RealTime, Skew

REAL = (
    BOARD.replace('"lockstep"', '"realtime"')
    .replace("200 us", "40 ms").replace("250 us", "41 ms")
    .replace("300 us", "42 ms").replace("220 us", "43 ms")
)  # fmt: skip
SCRIPT = scenario().replace("end 20ms", "end 250ms")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path, REAL, SCRIPT)
    yield made
    made.close()


def when(bench: Bench, nodes: str, text: str) -> list[int]:
    lines = bench.trace(nodes).read_text().splitlines()
    return [int(line.split(" ", 1)[0]) for line in lines if line.endswith(text)]


def test_a_scenario_begins_when_all_are_there_and_happens_at_its_instants(bench: Bench) -> None:
    """STT to both LM629, MULTI_UPDATE and /SYNC: exact in chip time, whatever the wall clock."""
    groups = ["ab", "c", "d"]
    processes = [bench.start(nodes) for nodes in groups]
    told = []
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
        told.append("wall skew between nodes: p50" in out)
    if not all(told):
        raise Starved(f"nodes stood still, and saw no mark of all: {told}")
    assert when(bench, "ab", "w x 0 1") == when(bench, "ab", "w y 0 1") == [3 * MS]
    virtual, source = read_board_text(REAL.replace('"realtime"', '"lockstep"'))
    machine = Machine(virtual, source, read_scenario(SCRIPT, "s", pins_of(virtual), US))
    machine.run()
    # What hosts do is where it is in virtual time, to the picosecond, on every node.
    for group in groups:
        real = [
            line
            for line in bench.trace(group).read_text().splitlines()
            if line.split(" ", 3)[2] == "w" or line.split(" ", 3)[2] == "r"
        ]
        assert real
        for line in real:
            instant, rank, text = line.split(" ", 2)
            trace = machine.nodes[int(rank)].trace
            assert trace is not None
            cycles = {(at, told.rpartition(" ")[0]) for at, told in trace.lines()}
            assert (int(instant), text.rpartition(" ")[0]) in cycles


def test_without_late_edges_real_time_gives_the_hash_of_virtual_time(tmp_path: Path) -> None:
    """In one process edges are late only where the computer let it wait: the same run, slower."""
    patient = re.sub(r'"4([0-3]) ms"', r'"14\1 ms"', REAL)
    assert patient.count('"14') == 4
    bench = Bench(tmp_path, patient, scenario().replace("end 20ms", "end 700ms"))
    try:
        for _ in range(20):
            code, out = ended(bench.start("abcd"))
            assert code == 0, out
            if out.endswith("no edge came late\n"):
                break
            assert "came late, the worst by" in out
        else:
            raise Starved("the computer was too busy: edges came late in each of 20 runs")
        bench.board.write_text(bench.board.read_text().replace('"realtime"', '"lockstep"'))
        code, virtual = ended(bench.start("abcd"))
        assert code == 0, virtual
        hashes = [text.partition("trace hash ")[2].split()[0] for text in (out, virtual)]
        assert hashes[0] == hashes[1]
    finally:
        bench.close()


def order(
    bench: Bench, lines: str, ahead: int = 100 * MS, align: int = 1, board: Path | None = None
) -> tuple[int, list[ordering.Answer]]:
    file, _ = read_board_file(str(board or bench.board))
    return ordering.order(file, lines, "script", ahead, align=align)


def shown(bench: Bench) -> "tuple[subprocess.Popen[str], str]":
    """Open the machine's page; return its process and its link."""
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "scope", "four", "--listen", "127.0.0.1:0"],
        env={**os.environ, "VBUS_RUNTIME": str(bench.folder / "run")},
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    return process, link_in(process.stdout.readline())


def skews(seen: Seen) -> dict[str, list[tuple[int, int]]]:
    return {name: rows for name, rows in seen.rows.items() if name.endswith("skew")}


def test_a_start_ordered_on_a_running_machine_lands_at_one_instant_on_all_nodes(
    tmp_path: Path,
) -> None:
    bench = Bench(tmp_path, REAL)
    try:
        processes = [
            bench.start(nodes, "--trace", str(bench.trace(nodes)), script=False)
            for nodes in ("a", "b", "cd")
        ]
        bench.until(lambda: all(bench.node(n).get("skew", {}).get("marks", 0) > 0 for n in "abcd"))

        lines = "0us x+y w 0 1\n5us m pin /SYNC 0\n9us m pin /SYNC 1"
        ordered, answers = order(bench, lines, 5000 * MS, 256 * US)

        assert [(answer.node, answer.taken) for answer in answers] == [("a", 1), ("b", 1), ("c", 2)]
        assert ordered % (256 * US) == 0
        with pytest.raises(ConfigError, match=r"^0 ps is no period to align to; give a time from"):
            order(bench, "0us x w 0 1", align=0)
        other = tmp_path / "other.toml"
        other.write_text(bench.board.read_text().replace('"6 MHz"', '"5 MHz"'))
        with pytest.raises(NodeError, match="node a runs another board file or version of vbus"):
            order(bench, lines, board=other)
        try:
            at, (answer,) = order(bench, "0us x w 0 1", 0)
        except NodeError as error:
            refused = str(error)
        else:
            raise Starved(f"the computer keeps node a behind its time: {at - answer.now} ps")
        assert refused.startswith("node a refuses: it comes")
        with pytest.raises(ConfigError, match=r"^script:1: unknown request 'w 0'"):
            order(bench, "0us x w 0")
        listed = bench.vbus("ls")
        assert "keeps the epoch" in listed.stdout
        assert "goes by the same clock" in listed.stdout
        assert "nodes: p50" in listed.stdout
        state = bench.node("d")
        assert state["clock_uncertainty_ns"] == 0
        assert state["skew"]["p50_ns"] <= state["skew"]["p99_ns"] <= state["skew"]["max_ns"]
        marks = state["skew"]["marks"]
        bench.until(lambda: bench.node("d")["skew"]["marks"] > marks + 6)
        page, link = shown(bench)
        seen = seen_by_a_page(
            link, lambda seen: sum(map(len, skews(seen).values())) > 8 and seen.now > ordered + MS
        )
        page.terminate()
        page.communicate(timeout=60)
        assert set(skews(seen)) == {f"{node}.skew" for node in "abcd"}
        worst = max(bench.node(node)["skew"]["max_ns"] for node in "abcd")
        assert 0 < max(value for rows in skews(seen).values() for _, value in rows) <= worst
        for process in processes:
            process.terminate()
            ended(process)
        starts = when(bench, "a", "w x 0 1") + when(bench, "b", "w y 0 1")
        assert len(starts) == 2
        assert starts[0] == starts[1] == ordered
        assert min(when(bench, "cd", "2 e /SYNC 0")) == starts[0] + 5 * US
    finally:
        bench.close()


def test_a_node_that_dies_in_real_time_is_named(bench: Bench) -> None:
    bench.script.write_text(SCRIPT.replace("end 250ms", "end 60s"))
    processes = {nodes: bench.start(nodes) for nodes in ("a", "b", "cd")}
    bench.until(lambda: bench.node("d").get("skew", {}).get("marks", 0) > 0)
    processes["b"].kill()
    for nodes in ("a", "cd"):
        code, out = ended(processes[nodes])
        assert code == 1, out
        assert "vbus: node b has died or was cut off" in out


def test_edges_that_were_lost_are_told() -> None:
    file, source = read_board_text(REAL)
    plan = plan_of(file)
    said: list[str] = []
    real = RealTime(Group(plan, report=said.append), [node_of(file, source, "a", None, False)])
    for number in (4, 5, 6, 9, 10, 0, 1):  # comes late; 7 and 8 lost; anew
        real.deliver(1, WireEdges(plan.digest, 1, number, ()))
    assert said == [
        "2 messages with edges of node b were lost while it was cut off; a wire it drives may stand"
        " wrong until its next edge"
    ]


class Sent:
    """Stands in for a link: keeps what is sent."""

    def __init__(self) -> None:
        self.messages: list[bytes] = []

    def send(self, rank: int, data: bytes) -> None:
        self.messages.append(data)

    def give(self, other: RealTime, rank: int) -> None:
        for data in self.messages:
            other.received(rank, data)
        self.messages.clear()


@pytest.mark.parametrize("apart", [True, False])
def test_nodes_estimate_clocks_that_are_apart_and_share_one_that_is_not(apart: bool) -> None:
    file, source = read_board_text(REAL)
    plan = plan_of(file)
    ahead = 7 * 10**12
    clocks = (lambda: time.monotonic_ns() + ahead, lambda: time.monotonic_ns())
    links = [Sent(), Sent()]
    keeper, other = (
        RealTime(
            Group(plan, link=cast(NodeLink, link)),
            [node_of(file, source, name, None, False)],
            clock=clock if apart else time.monotonic_ns,
        )
        for name, link, clock in zip("ab", links, clocks, strict=True)
    )
    loop = asyncio.new_event_loop()
    try:
        for real in (keeper, other):
            real.start(loop)
        for _ in range(6 if apart else 1):
            other._ping()
            links[1].give(keeper, 1)
            links[0].give(other, 0)
        assert other.clock.good
        assert other.details(1)["clock_shared"] is not apart
        if apart:
            assert other.details(1)["clock_uncertainty_ns"] > 0
            assert abs(other.clock.offset - ahead) <= other.clock.uncertainty
        else:
            assert other.details(1)["clock_uncertainty_ns"] == other.clock.offset == 0
    finally:
        keeper.stop()
        other.stop()
        loop.close()


def test_nothing_is_ordered_while_a_clock_is_not_known_to_the_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file, _ = read_board_text(REAL)
    asked: list[int] = []

    def answer(
        session: object, key: str, node: str, request: ordering.NodeRequest
    ) -> ordering.Answer:
        asked.append(request.at)
        return ordering.Answer(node, 10 * MS, uncertainty=300 * US if node == "b" else 0)

    monkeypatch.setattr(ordering, "_ask", answer)
    monkeypatch.setattr(ordering, "open_session", lambda **_: BytesIO())
    with pytest.raises(NodeError) as refused:
        ordering.order(file, "0us x+y w 0 1", "s", align=256 * US, connect=("tcp/x:1",))
    assert str(refused.value) == (
        "node b knows the time of all to 300 us only, which is more than the 256 us to align to,"
        " and nothing has been ordered; wait until vbus ls shows less, or align to a longer time"
    )
    assert asked == [-1] * 4
    at, _ = ordering.order(file, "0us x+y w 0 1", "s", align=512 * US, connect=("tcp/x:1",))
    assert asked[8:] == [at, at]
    assert at == 215 * 512 * US  # the first such instant 100 ms ahead


def test_the_fastest_exchange_decides_about_a_clock() -> None:
    clock = ClockEstimate()
    assert clock.uncertainty == -1
    for slow in range(5):  # the other clock is 1000 ns ahead; the way there takes longer
        clock.add(0, 1000 + 900 + 10 * slow, 1000 + 900 + 10 * slow, 1000 + 10 * slow)
    assert clock.offset == 1400
    assert abs(clock.offset - 1000) <= clock.uncertainty == 500
    clock.add(5000, 6020, 6030, 5040)
    assert (clock.offset, clock.uncertainty) == (1005, 15)
    assert clock.good


def test_skew_is_the_spread_of_all_nodes_at_a_mark() -> None:
    skew = Skew()
    for number in range(100):
        skew.note(number, 0, 1000, 0, 3)
        skew.note(number, 1, 1000 - number, 20, 3)
        assert skew.statistics()["marks"] == number
        skew.note(number, 2, 1001, 30, 3)
    assert skew.statistics() == {
        "marks": 100, "p50_ns": 50, "p99_ns": 99, "max_ns": 100, "uncertainty_ns": 50,
        "histogram": [[10_000, 100]],
    }  # fmt: skip
    for number, spread in enumerate((10_001, 20_000, 60_000_000), 100):
        for node, at in enumerate((0, 0, spread)):
            skew.note(number, node, at, 0, 3)
    assert skew.statistics()["histogram"] == [
        [10_000, 100], [20_000, 2], *([bound, 0] for bound in BOUNDS_NS[2:]), [None, 1],
    ]  # fmt: skip
    for number in range(1000, 2000):  # a node that has gone leaves nothing behind
        skew.note(number, 0, 1, 0, 3)
    assert skew.statistics()["marks"] == 103
