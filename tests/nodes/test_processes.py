"""The four-chip machine over one, two and four processes, and one of eight over eight: the same in
all, and never a hang."""

import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path

import pytest
from zenoh import CongestionControl

from tests.nodes.four_chips import BOARD, eight, eight_scenario
from tests.nodes.processes import Bench, ended
from tests.waiting import until
from tests.zenoh.processes import session_at

SEEDS = 20 if os.environ.get("VBUS_ALL_SEEDS") == "1" else 3
NODES = "abcd"


@pytest.mark.parametrize("groups", [["abcd"], ["ac", "bd"], ["a", "b", "c", "d"]])
def test_the_hash_is_the_same_for_one_two_and_four_processes(
    bench: Bench, reference: str, groups: list[str]
) -> None:
    draw = random.Random(len(groups))
    processes = [bench.start(nodes, hash_seed=draw.randrange(1, 1 << 30)) for nodes in groups]
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
        assert "the scenario is over at 20.000000 ms" in out
    assert bench.merged(groups) == reference


@pytest.mark.parametrize(
    ("groups", "killed"),
    [
        (["aceg", "bdfh"], ""),
        (["be", "cf", "dg", "ah"], ""),
        ([*"abcdefgh"], "f"),
    ],
)
def test_eight_nodes_have_the_hash_of_one_process_in_two_four_and_eight_with_delays_and_a_rejoin(
    tmp_path: Path, reference_of_eight: str, groups: list[str], killed: str
) -> None:
    bench = Bench(tmp_path, eight(), eight_scenario())
    options = ("--patience", "60")
    file = tmp_path / "node.snap"
    try:
        processes = {
            nodes: bench.start(
                nodes, *options, *(("--snapshot", str(file)) if nodes == killed else ()),
                disturb=f"{ord(nodes[0])}:20",
            )
            for nodes in groups
        }  # fmt: skip
        if killed:
            bench.until(lambda: file.exists() and bench.node(killed).get("round", 0) > 20)
            processes[killed].kill()
            processes[killed].wait()
            bench.until(lambda: bench.node("a").get("others", {}).get(killed) == "lost")
            processes[killed] = bench.start(killed, "--from", str(file), *options, disturb="3:20")
        for process in processes.values():
            code, out = ended(process)
            assert code == 0, out
        assert bench.merged(groups) == reference_of_eight
    finally:
        bench.close()


@pytest.mark.parametrize("seed", range(SEEDS))
def test_messages_that_come_late_and_out_of_order_change_nothing(
    bench: Bench, reference: str, seed: int
) -> None:
    groups = [["ab", "cd"], ["abd", "c"], ["a", "bc", "d"]][seed % 3]
    hashes = random.Random(seed)
    processes = [
        bench.start(nodes, disturb=f"{seed}:20", hash_seed=hashes.randrange(1, 1 << 30))
        for nodes in groups
    ]
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(groups) == reference


# -- faults --------------------------------------------------------------------------------


def until_time_runs(bench: Bench, processes: Mapping[str, subprocess.Popen[str]]) -> None:
    """Wait until time has run for a while.

    On a busy machine a look takes so long that processes may have come to their end.
    """
    bench.until(
        lambda: all(
            process.poll() is not None or bench.node(nodes[0]).get("round", 0) > 8
            for nodes, process in processes.items()
        )
    )


def endless(bench: Bench, groups: list[str]) -> dict[str, subprocess.Popen[str]]:
    """Start processes that do not come to their end by themselves; wait until time runs."""
    script = bench.script.read_text()
    assert script.endswith("end 20ms\n")
    bench.script.write_text(script.replace("end 20ms", "end 1000s"))
    processes = {nodes: bench.start(nodes, disturb=f"{len(nodes)}:20") for nodes in groups}
    until_time_runs(bench, processes)
    return processes


def test_a_node_that_is_killed_is_named_by_all_others(bench: Bench) -> None:
    processes = endless(bench, ["a", "b", "cd"])
    processes["b"].kill()
    for nodes in ("a", "cd"):
        code, out = ended(processes[nodes])
        assert code == 1, out
        assert "vbus: node b has died or was cut off: its process or its link is gone; time" in out


def test_the_node_in_the_middle_of_the_star_is_named_when_it_is_killed(bench: Bench) -> None:
    processes = endless(bench, ["a", "b", "cd"])
    processes["a"].kill()
    for nodes in ("b", "cd"):
        code, out = ended(processes[nodes])
        assert code == 1, out
        assert "vbus: node a has died or was cut off" in out


def test_a_node_that_stalls_is_named_after_its_deadline(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    text = bench.board.read_text()
    bench.board.write_text(re.sub(r"(?<=\[nodes\.c\]\n)deadline = .*", 'deadline = "3 s"', text))
    try:
        processes = endless(bench, ["a", "b", "c", "d"])
        processes["c"].send_signal(signal.SIGSTOP)
        for nodes in "abd":
            code, out = ended(processes[nodes])
            assert code == 1, out
            assert "vbus: node c " in out.splitlines()[-1]
    finally:
        bench.close()


def test_a_node_that_stands_still_for_less_than_its_deadline_is_waited_for(
    bench: Bench, reference: str
) -> None:
    groups = ["a", "b", "cd"]
    processes = {nodes: bench.start(nodes, disturb=f"{len(nodes)}:20") for nodes in groups}
    until_time_runs(bench, processes)
    for nodes in ("b", "a"):  # also the one in the middle of the star
        processes[nodes].send_signal(signal.SIGSTOP)
        time.sleep(1.5)  # longer than Zenoh waits for anybody who says nothing of a deadline
        processes[nodes].send_signal(signal.SIGCONT)
    for process in processes.values():
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(groups) == reference


def test_clocks_that_are_apart_and_are_set_while_nodes_run_change_nothing(
    bench: Bench, reference: str
) -> None:
    """The time of day, that is: someone, or a time server, may set it; who waits must not look."""
    groups = ["a", "b", "cd"]
    clocks = {nodes: bench.folder / f"clock.{nodes}" for nodes in groups}

    def put(*days: int) -> None:
        for clock, day in zip(clocks.values(), days, strict=True):
            new = clock.with_suffix(".new")
            new.write_text(f"{day:+}d\n")
            new.rename(clock)

    put(0, 3, -400)
    told = subprocess.run(
        [*beside(clocks["b"]), "date", "+%s"], capture_output=True, text=True, check=True
    )
    assert abs(int(told.stdout) - time.time() - 3 * 86400) < 600
    processes = {
        nodes: bench.start(nodes, disturb=f"{len(nodes)}:20", inside=beside(clock))
        for nodes, clock in clocks.items()
    }
    until_time_runs(bench, processes)
    for days in ((0, -3, 400), (2, 2, 2), (-1, 0, 0)):
        put(*days)
        seen = bench.node("a").get("round", 0)
        bench.until(lambda seen=seen: bench.node("a").get("round", 1 << 30) > seen)
    for process in processes.values():
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(groups) == reference


def beside(clock: Path) -> tuple[str, ...]:
    """Return what a command stands behind whose time of day is off as a file says."""
    libraries = [*Path("/usr").glob("lib/**/faketime/libfaketimeMT.so.1")]
    if not libraries:
        pytest.skip("no libfaketime: install faketime")
    return (
        "env", f"LD_PRELOAD={libraries[0]}", f"FAKETIME_TIMESTAMP_FILE={clock}",
        "FAKETIME_NO_CACHE=1", "DONT_FAKE_MONOTONIC=1", "FAKETIME_DONT_FAKE_MONOTONIC=1",
    )  # fmt: skip


def test_nodes_that_are_there_wait_for_one_that_comes_late(bench: Bench, reference: str) -> None:
    early = [bench.start(nodes) for nodes in ("b", "cd")]
    bench.until(lambda: bench.node("b") != {} and bench.node("d") != {})
    late = bench.start("a")
    assert all(ended(process)[0] == 0 for process in (*early, late))
    assert bench.merged(["a", "b", "cd"]) == reference


@pytest.mark.parametrize("killed", ["c", "a"])
def test_a_killed_node_rejoins_from_its_snapshot_and_the_hash_stays(
    bench: Bench, reference: str, killed: str
) -> None:
    """Also the one in the middle of the star, with whom all others lose each other."""
    file = bench.folder / "node.snap"
    groups = ["ac".replace(killed, ""), "bd"]
    others = {nodes: bench.start(nodes, "--patience", "60", disturb="1:20") for nodes in groups}
    options = ("--patience", "60")
    first = bench.start(killed, "--snapshot", str(file), *options, disturb="2:20")
    bench.until(lambda: file.exists() and bench.node(killed).get("round", 0) > 20)
    first.kill()
    first.wait()
    bench.until(lambda: bench.node("b").get("others", {}).get(killed) == "lost")
    done = bench.vbus("snap", "info", "node.snap")
    assert done.stdout.startswith(f"four.{killed} (")
    again = bench.start(killed, "--from", str(file), *options, disturb="3:20")
    for process in (again, *others.values()):
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged([*groups, killed]) == reference


def test_a_node_with_another_board_file_is_sent_away_and_the_right_one_waited_for(
    bench: Bench, reference: str
) -> None:
    other = bench.folder / "other.toml"
    other.write_text(bench.board.read_text().replace("300 us", "301 us"))
    processes = [bench.start(nodes) for nodes in ("a", "bc")]
    bench.until(lambda: bench.node("b").get("others", {}).get("a") not in (None, "not here yet"))
    code, out = ended(bench.start("d", board=other))
    assert code == 1, out
    assert "runs another board file or version of vbus: give every node the same" in out
    processes.append(bench.start("d"))
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
    assert bench.merged(["a", "bc", "d"]) == reference


def test_a_node_runs_once(bench: Bench) -> None:
    bench.start("a", script=False)
    bench.until(lambda: bench.node("a") != {})
    code, out = ended(bench.start("a", script=False))
    assert code == 4, out
    assert 'a board called "four.a" runs already' in out


def test_messages_that_make_no_sense_are_reported_and_ignored(bench: Bench, reference: str) -> None:
    processes = {nodes: bench.start(nodes) for nodes in ("a", "b", "d")}
    bench.until(lambda: bench.node("d").get("others", {}).get("b") not in (None, "not here yet"))
    bad = (b"", b"\x01garbage", b"\x01\x94\xa1a\x00\x00\x07", bytes(5000), b"\xff" * 100_000)
    sender = session_at(bench.endpoint)
    other = session_at(bench.endpoint)
    publisher = sender.declare_publisher(
        "vbus/four/@nodes/b", congestion_control=CongestionControl.BLOCK
    )
    seen = threading.Semaphore(0)
    huge = 100_000_000
    other.declare_subscriber(
        "vbus/four/@nodes/b",
        lambda sample: seen.release() if len(sample.payload) == huge else None,
    )
    for data in bad:
        publisher.put(data)

    def heard() -> bool:
        publisher.put(bytes(huge))
        return seen.acquire(timeout=3)

    until(heard, "that somebody hears the other's messages")
    sender.close()
    other.close()
    processes["c"] = bench.start("c")
    for nodes, process in processes.items():
        code, out = ended(process)
        assert code == 0, out
        if nodes in "ad":
            assert "node b has sent an empty message; this vbus speaks version 1" in out
            assert "node b has sent bytes that are no message" in out
            assert "node b has sent a message of 100000000 bytes; at most" in out
    assert bench.merged(list(processes)) == reference


def router(bench: Bench) -> subprocess.Popen[str]:
    """Start a router at the place where the nodes meet; return when it listens."""
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "router", "--listen", bench.endpoint],
        env={**os.environ, "VBUS_RUNTIME": str(bench.folder / "run")},
        stdout=subprocess.PIPE,
        text=True,
    )
    bench.routers.append(process)
    assert process.stdout is not None
    assert process.stdout.readline(), "the router has ended"
    return process


def test_a_router_between_nodes_is_killed_and_restarted_and_the_hash_stays(
    bench: Bench, reference: str
) -> None:
    text = bench.board.read_text().replace("listen", "# listen")
    bench.board.write_text(text + f'\n[zenoh]\nconnect = ["{bench.endpoint}"]\n')
    first = router(bench)
    options = ("--patience", "60")
    groups = ["ab", "cd"]
    processes = [bench.start(nodes, *options, disturb="1:20") for nodes in groups]
    bench.until(lambda: all(bench.node(name).get("round", 0) > 8 for name in "ac"))
    first.kill()
    first.wait()
    bench.until(lambda: bench.node("a").get("others", {}).get("c") == "lost")
    router(bench)
    for process in processes:
        code, out = ended(process)
        assert code == 0, out
        assert "is back" in out
    assert bench.merged(groups) == reference


def test_without_a_place_to_meet_the_user_is_told(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.board.write_text(BOARD)
    code, out = ended(bench.start("b"))
    assert code == 3, out
    assert 'where do the nodes meet? write listen = "tcp/127.0.0.1:7447" at one of them' in out
    code, out = ended(bench.start("z"))
    assert 'no node called "z"; this board has a, b, c, d' in out
