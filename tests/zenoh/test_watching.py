"""What a board publishes, who finds it, and the router in between."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgpack

from tests.e2e.serving import served
from tests.unit.faults.bench import MS, Lm, build
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import Processes, connected_to, session_at
from tests.zenoh.test_bus import board
from vbus.client import connect
from vbus.network import places
from vbus.network.session import Network, close_session
from vbus.serve.server import LinkSpec
from vbus.transports.base import Served
from vbus.transports.zenoh_publications import _PinEdges


class Watcher:
    def __init__(self, endpoint: str) -> None:
        self.session = session_at(endpoint)
        self.heard: dict[str, list[Any]] = {}

    def listen(self, key: str) -> None:
        self.heard[key] = []
        subscriber = self.session.declare_subscriber(key, self._take)
        until(lambda: subscriber, key)
        self.kept = [*getattr(self, "kept", []), subscriber]

    def _take(self, sample: Any) -> None:
        self.heard[str(sample.key_expr)].append(sample.payload.to_bytes())

    def ask(self, key: str) -> dict[str, bytes]:
        replies = self.session.get(key, timeout=PATIENCE)
        return {
            str(reply.ok.key_expr): reply.ok.payload.to_bytes() for reply in replies if reply.ok
        }


@contextmanager
def watcher(endpoint: str) -> Iterator[Watcher]:
    made = Watcher(endpoint)
    try:
        yield made
    finally:
        close_session(made.session)


def endpoint_of(url: str) -> str:
    return url.partition("connect=")[2]


def test_whoever_asks_is_told_status_telemetry_and_pins() -> None:
    with served(board(), LinkSpec("zenoh:")) as server, watcher(endpoint_of(server.urls[0])) as who:
        status = who.ask("vbus/*/status")
        assert list(status) == ["vbus/bench/status"]
        assert json.loads(status["vbus/bench/status"])["board"] == "bench"
        telemetry = who.ask("vbus/bench/*/telemetry")
        assert sorted(telemetry) == ["vbus/bench/x/telemetry", "vbus/bench/y/telemetry"]
        now, values = msgpack.unpackb(telemetry["vbus/bench/x/telemetry"])
        assert now >= 0
        assert values["real"] == 0
        pins = who.ask("vbus/bench/x/pins/*")
        assert {"vbus/bench/x/pins/~RST", "vbus/bench/x/pins/HI"} <= set(pins)
        assert msgpack.unpackb(pins["vbus/bench/x/pins/~RST"])[1] == 1


def test_streams_tell_every_cycle_and_every_edge_with_its_instant() -> None:
    made = board("realtime")
    with served(made, LinkSpec("zenoh:")) as server, watcher(endpoint_of(server.urls[0])) as who:
        for name in ("cycles", "pins/~RST", "telemetry"):
            who.listen(f"vbus/bench/x/{name}")
        who.listen("vbus/bench/status")
        until(lambda: who.heard["vbus/bench/x/pins/~RST"], "the pin's level at the start")
        until(lambda: len(who.heard["vbus/bench/x/telemetry"]) > 2, "telemetry again and again")
        until(lambda: who.heard["vbus/bench/status"], "the board's status")
        with connect("zenoh:bench") as bus:
            bus.chip("x").write(1, 0x5A)
            bus.chip("y").write(1, 0xA5)
            before = bus.now()
            bus.pin("x./RST", 0)
            bus.pin("x./RST", 1)
            after = bus.now()
            bus.chip("x").read(0)
        cycles = who.heard["vbus/bench/x/cycles"]
        until(lambda: sum(len(msgpack.unpackb(item)[1]) for item in cycles) >= 2, "both cycles")
        rows = [row for item in cycles for row in msgpack.unpackb(item)[1]]
        assert [row[2:4] for row in rows] == [[1, 1], [0, 0]]
        assert rows[0][4] == 0x5A
        pin = who.heard["vbus/bench/x/pins/~RST"]
        until(lambda: sum(len(msgpack.unpackb(item)[1]) for item in pin) >= 3, "both edges")
        edges = [row for item in pin for row in msgpack.unpackb(item)[1]]
        assert [level for _, level in edges] == [1, 0, 1]
        assert before <= edges[1][0] <= edges[2][0] <= after


def test_the_level_of_an_output_is_that_of_now() -> None:
    """A chip is computed when it is looked at."""
    bench = build()
    host = Lm(bench)
    host.command(0x1C, 0x0004)  # MSKI: trajectory complete
    host.command(0x1D, 0x0000)
    host.move(20)
    host.port.delay(200 * MS)
    served = Served(bench, ("x",), dict, lambda: None)
    assert msgpack.unpackb(_PinEdges(served, bench.chips[0], "HI").answer()) == [bench.now, 1]


def test_a_board_that_nobody_watches_is_not_observed() -> None:
    made = board()
    with served(made, LinkSpec("zenoh:")) as server:
        with watcher(endpoint_of(server.urls[0])) as who:
            who.listen("vbus/bench/x/cycles")
            until(lambda: len(made.observers) == 1, "the watcher")
        until(lambda: not made.observers, "the end of the watcher")


def test_ls_finds_boards_by_a_router_and_says_when_there_is_none(processes: Processes) -> None:
    def listed(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "vbus", "ls", "--json", *arguments],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )

    _, endpoint = processes.router()
    elsewhere = processes.folder / "elsewhere"
    assert json.loads(listed().stdout) == []
    for name in ("one", "two"):
        started = processes.start_elsewhere(name, connected_to(endpoint), elsewhere)
        assert started.ready, started.said

    # The router is registered on this computer, so plain ls knows where to look.
    assert [found["board"] for found in json.loads(listed().stdout)] == ["one", "two"]
    assert [found["board"] for found in json.loads(listed("two").stdout)] == ["two"]
    processes.running[0].stop()
    assert places.endpoints_at(places.router_place()) == ()
    assert json.loads(listed().stdout) == []
    refused = listed("--zenoh", endpoint)
    assert f"{endpoint} cannot be reached: no process listens there" in refused.stderr


def test_a_program_that_forgets_to_close_its_link_says_good_bye_all_the_same() -> None:
    script = (
        "from vbus.client import connect\n"
        "bus = connect('zenoh:bench/x')\n"
        "for _ in range(200):\n"
        "    bus.read(0)\n"
        "    bus.write(1, 0)\n"
    )
    with served(board(), LinkSpec("zenoh:", network=Network(grace_seconds=3600))) as server:
        done = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, timeout=PATIENCE
        )
        assert (done.returncode, done.stderr) == (0, "")
        until(lambda: server.statistics()["links"][0]["sessions"] == 0, "the end of the session")


def test_each_node_of_a_board_is_a_board_of_its_own_on_the_network(processes: Processes) -> None:
    path = processes.folder / "two.toml"
    chip = '[chips.{}]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\nnode = "{}"\n'
    host = '[[hosts]]\ntransport = "zenoh:"\nchips = ["{}"]\n'
    path.write_text(
        '[board]\nname = "two"\ntime = "lockstep"\npower_on = "done"\n[nodes.left]\n[nodes.right]\n'
        + chip.format("x", "left")
        + chip.format("y", "right")
        + '[nets]\nwire = {pins = ["x.HI", "y./IN"], delay = "1 ms"}\n'
        + host.format("x")
        + host.format("y")
    )
    started = processes.start("run", str(path))
    assert started.ready, started.said
    for link, chips in (("zenoh:two.left/x", ["x"]), ("zenoh:two.right", ["y"])):
        with connect(link) as bus:
            assert [found.name for found in bus.info.chips] == chips
            assert bus.read(0) == 0x84
