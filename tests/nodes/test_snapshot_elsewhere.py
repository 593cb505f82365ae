"""Snapshots of machines on several computers, here with a runtime directory for each."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from click.testing import CliRunner, Result

from tests.nodes.four_chips import BOARD
from tests.nodes.processes import Bench, ended
from tests.nodes.test_hosts import BOARD as BOARD_WITH_HOSTS
from tests.nodes.test_security import Computers
from tests.waiting import PATIENCE
from tests.zenoh.processes import session_at
from vbus.board.config import read_board_text
from vbus.cli.run.snap import save
from vbus.client import connect
from vbus.core.errors import TransportError
from vbus.core.kernel import MS
from vbus.network.security import Security
from vbus.network.session import close_session
from vbus.nodes.machine_snapshot import read
from vbus.nodes.plan import plan_of
from vbus.serve.nodes.ordering import Answer, NodeRequest, read_answer
from vbus.serve.registry import ask

HOSTS = BOARD_WITH_HOSTS.replace('chips = ["y"]\nawaited = true', 'chips = ["y"]')
"""Time waits for the host of x alone."""


def start(
    bench: Bench, number: int, nodes: str, *options: str, disturb: str = "", script: bool = True
) -> subprocess.Popen[str]:
    """Start nodes on another computer: what finds boards on one finds none of another's."""
    inside = ("env", f"VBUS_RUNTIME={runtime(bench, number)}")
    return bench.start(nodes, *options, disturb=disturb, script=script, inside=inside)


def runtime(bench: Bench, number: int) -> Path:
    return bench.folder / f"run{number}"


def node(bench: Bench, number: int, name: str) -> dict[str, Any]:
    """Return what a node on another computer tells of itself; empty if it does not run."""
    try:
        found: dict[str, Any] = ask(runtime(bench, number) / "boards" / f"four.{name}.sock")["node"]
    except TransportError:
        return {}
    return found


def save_there(bench: Bench, number: int) -> subprocess.CompletedProcess[str]:
    """Have a snapshot taken by a command on another computer."""
    return subprocess.run(
        [sys.executable, "-m", "vbus", "snap", "save", "four", "four.snap"],
        cwd=bench.folder,
        env={"VBUS_RUNTIME": str(runtime(bench, number)), "PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


@pytest.mark.parametrize("where", [1, 3])
def test_one_command_saves_the_nodes_of_all_computers(
    bench: Bench, reference: str, monkeypatch: pytest.MonkeyPatch, where: int
) -> None:
    """From that in the middle of the star, and from one at its end."""
    groups = ["a", "bd", "c"]
    processes = [
        start(bench, number, nodes, disturb=f"{number}:40")
        for number, nodes in enumerate(groups, 1)
    ]
    bench.until(
        lambda: all(
            node(bench, n, nodes[0]).get("round", 0) > 8 for n, nodes in enumerate(groups, 1)
        )
    )
    monkeypatch.setenv("VBUS_RUNTIME", str(runtime(bench, where)))
    # In this process: time goes on while another one would start.
    done: Result = CliRunner().invoke(save, ["four", str(bench.folder / "four.snap"), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert told["nodes"] == [*"abcd"]
    assert 0 < told["when_ps"] < 20 * MS
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(groups) == reference  # they were looked at only
    snapshot = read((bench.folder / "four.snap").read_bytes())
    assert list(snapshot.nodes) == [*"abcd"]
    assert snapshot.nodes["d"].text == bench.board.read_text()
    for trace in bench.folder.glob("*.trace"):
        trace.unlink()
    code, out = ended(bench.start("abcd", "--from", "four.snap"))
    assert code == 0, out
    assert bench.merged(["abcd"]) == reference


def test_a_machine_that_rests_is_saved_from_each_of_its_computers(bench: Bench) -> None:
    start(bench, 1, "ab", script=False)
    start(bench, 2, "cd", script=False)
    bench.until(
        lambda: all(node(bench, n, x).get("state") == "rests" for n, x in ((1, "a"), (2, "c")))
    )
    seen = []
    for number in (1, 2):
        done = save_there(bench, number)
        assert done.returncode == 0, done.stderr
        seen.append(read((bench.folder / "four.snap").read_bytes()))
    assert seen[0].when == seen[1].when
    assert seen[0].round < seen[1].round


def test_a_node_that_has_died_is_named_and_none_is_kept_waiting(bench: Bench) -> None:
    start(bench, 1, "ab", "--patience", "600", script=False)
    gone = start(bench, 2, "cd", script=False)
    bench.until(lambda: node(bench, 1, "a").get("state") == "rests")
    gone.kill()
    gone.communicate()
    bench.started.remove(gone)
    bench.until(
        lambda: all(node(bench, 1, "a").get("others", {}).get(name) == "lost" for name in "cd")
    )
    done = save_there(bench, 1)
    assert done.returncode == 1
    assert done.stderr == (
        "vbus: four: c (lost), d (lost) do not answer, and a snapshot has all nodes of a machine;"
        " say it again when they are here (vbus ls)\n"
    )
    assert not (bench.folder / "four.snap").exists()


def test_before_the_nodes_have_met_those_that_lack_are_named(bench: Bench) -> None:
    start(bench, 2, "cd", script=False)  # where they meet nobody listens yet
    bench.until(lambda: node(bench, 2, "c") != {} and node(bench, 2, "d") != {})
    done = save_there(bench, 2)
    assert done.returncode == 1
    assert "vbus: four: a (not here yet), b (not here yet) do not answer" in done.stderr


def test_a_host_elsewhere_that_thinks_is_waited_for_and_then_named(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HOSTS)
    try:
        start(bench, 1, "a", script=False)
        start(bench, 2, "b", script=False)
        far = runtime(bench, 1) / "x.sock"
        bench.until(lambda: node(bench, 2, "b").get("others", {}).get("a") == "waits for its host")
        with connect(f"unix:{far}") as bus:
            bus.delay("3ms")
            done = save_there(bench, 2)
        assert done.returncode == 1
        assert "node a waits for its host, so round " in done.stderr
        assert " has not ended; say it again when time runs" in done.stderr
    finally:
        bench.close()


def test_a_machine_in_real_time_on_several_computers_has_no_snapshot(tmp_path: Path) -> None:
    bench = Bench(tmp_path, BOARD.replace('"lockstep"', '"realtime"'))
    try:
        start(bench, 1, "abc", script=False)
        start(bench, 2, "d", script=False)
        bench.until(
            lambda: all(
                node(bench, number, name).get("others", {}).get(other) == "runs"
                for number, name, other in ((1, "a", "d"), (2, "d", "a"))
            )
        )
        for number in (1, 2):
            done = save_there(bench, number)
            assert done.returncode == 1
            assert "a snapshot is for virtual time; this board is realtime" in done.stderr
    finally:
        bench.close()


# -- orders at the nodes' queryables -------------------------------------------------------------


def asked(session: zenoh.Session, name: str, data: bytes) -> list[Answer]:
    """Return what a node answers to an order."""
    replies = session.get(f"vbus/four/@nodes/{name}/orders", payload=data, timeout=PATIENCE)
    return [
        read_answer(name, reply.ok.payload.to_bytes()) for reply in replies if reply.ok is not None
    ]


BAD: dict[bytes, str] = {
    b"": "this is no order: Input data was truncated",
    b"\xff\xfe": "this is no order: ",
    b"[" * 100_000: "this is no order: ",
    b"{}": "this is no order: Object missing required field `digest`",
    b'{"digest": "x", "save": 1, "to": "a"}': "this is no order: Object contains unknown field",
    b'{"digest": "x", "save": "soon"}': "this is no order: Expected `int`, got `str`",
    b'{"digest": "x", "save": 1}': "runs another board file or version of vbus",
    bytes(20_000_000): "this is no order: it has 20000000 bytes; at most 16777216 are read",
    msgspec.json.encode(
        NodeRequest("DIGEST", 10**9, "0us x w 0 1")
    ): "in virtual time a scenario says",
}
"""Orders that are none, and what is said to them."""


def orders(digest: str) -> Iterator[tuple[bytes, str]]:
    for data, said in BAD.items():
        yield data.replace(b"DIGEST", digest.encode()), said


def test_what_makes_no_sense_is_refused_in_words_and_the_node_goes_on(
    bench: Bench, reference: str
) -> None:
    processes = [bench.start(nodes) for nodes in ("ab", "d")]
    bench.until(lambda: bench.node("d").get("others", {}).get("b") not in (None, "not here yet"))
    plan = plan_of(read_board_text(BOARD)[0])
    session = session_at(bench.endpoint)
    try:
        for name in "ad":
            for data, said in orders(plan.digest):
                (answer,) = asked(session, name, data)
                assert said in answer.error
                assert (answer.node, answer.part) == (name, None)
            (answer,) = asked(session, name, msgspec.json.encode(NodeRequest(plan.digest)))
            assert (answer.node, answer.error, answer.part) == (name, "", None)
        assert asked(session, "c", b"") == []
    finally:
        close_session(session)
    processes.append(bench.start("c"))
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(["ab", "c", "d"]) == reference


def test_with_certificates_nodes_are_asked_and_nobody_else_may_ask(tmp_path: Path) -> None:
    computers = Computers(tmp_path)
    try:
        left, right = computers.bench("left"), computers.bench("right")
        for bench, name in ((left, "a"), (right, "b")):
            bench.start(name, script=False)
        left.until(lambda: left.node("a").get("state") == "rests")
        right.until(lambda: right.node("b").get("state") == "rests")
        for bench in (left, right):
            done = bench.vbus("snap", "save", "four", "four.snap")
            assert done.returncode == 0, done.stderr
            found = read((bench.folder / "four.snap").read_bytes())
            assert list(found.nodes) == ["a", "b"]
        plan = plan_of(read_board_text(left.board.read_text())[0])
        for name, heard in (("visitor", 0), ("all", 0), ("stranger", 0), ("right", 1)):
            folder = computers.bench(name).folder
            own = [str(folder / file) for file in ("own.pem", "own.key", "authority.pem")]
            session = session_at(computers.endpoint, Security(*own))
            try:
                for node in "ab":
                    for save in (-1, 0):
                        data = msgspec.json.encode(NodeRequest(plan.digest, save=save))
                        answers = asked(session, node, data)
                        assert [answer.error for answer in answers] == [""] * heard
                        assert [answer.part is not None for answer in answers] == [
                            save == 0
                        ] * heard
            finally:
                close_session(session)
    finally:
        for bench in computers.benches:
            bench.close()
