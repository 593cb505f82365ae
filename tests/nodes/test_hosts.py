"""Host programs at nodes that keep one virtual time: what they see does not depend on processes."""

import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.nodes.processes import Bench, ended
from vbus.client import connect
from vbus.client.lm628 import Lm628
from vbus.core.errors import TransportError

BOARD = """\
[board]
name = "four"
time = "lockstep"
power_on = "done"

[nodes.a]
[nodes.b]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "x"
node = "a"

[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "y"
node = "b"

[plants.x]
model = "dc_motor"

[plants.y]
model = "dc_motor"

[nets]
"BRAKE" = { pins = ["x.HI", "y./RST"], delay = "1 ms" }

[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
chips = ["x"]
awaited = true

[[hosts]]
transport = "unix:$VBUS_RUNTIME/y.sock"
chips = ["y"]
awaited = true

[[hosts]]
transport = "unix:$VBUS_RUNTIME/text.sock"
protocol = "text"
chips = ["y"]
"""


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path, BOARD.replace("awaited = true\n", ""))
    yield made
    made.close()


def move(path: Path, target: int, seen: list[object]) -> None:
    """An ordinary host program: it polls the busy bit, moves, and reads while it moves."""
    with connect(f"unix:{path}") as bus:
        axis = Lm628(bus)
        seen.append(axis.check_reset())
        axis.load_filter(kp=300, kd=2000)
        axis.load_trajectory(acc=100, vel=400_000, pos=target, start=True)
        for _ in range(20):
            bus.delay("2ms")
            seen.append((bus.now(), axis.rdrp(), axis.status(), bus.reads(0, 3)))
        seen.append(bus.now())


def both(bench: Bench) -> list[list[object]]:
    run = bench.folder / "run"
    bench.until(lambda: (run / "x.sock").exists() and (run / "y.sock").exists())
    seen: list[list[object]] = [[], []]
    hosts = [
        threading.Thread(target=move, args=(run / "x.sock", 3000, seen[0])),
        threading.Thread(target=move, args=(run / "y.sock", -2000, seen[1])),
    ]
    for host in hosts:
        host.start()
    for host in hosts:
        host.join()
    return seen


def test_hosts_of_two_nodes_see_the_same_in_one_process_and_in_two(tmp_path: Path) -> None:
    results = []
    for number, groups in enumerate((["ab"], ["a", "b"], ["a", "b"])):
        bench = Bench(tmp_path / str(number), BOARD, make=True)
        for nodes in groups:
            bench.start(nodes, script=False, disturb="1:3" if number == 2 else "")
        try:
            results.append(both(bench))
        finally:
            bench.close()
    assert results[0] == results[1] == results[2]
    assert all(len(seen) == 22 for seen in results[0])
    assert results[0][0][10] != results[0][1][10]


def test_time_stands_still_while_a_host_that_uses_time_thinks(bench: Bench) -> None:
    bench.start("a", script=False)
    bench.start("b", script=False)
    run = bench.folder / "run"
    bench.until(lambda: (run / "x.sock").exists() and (run / "text.sock").exists())
    with connect(f"unix:{run / 'x.sock'}") as bus, socket.socket(socket.AF_UNIX) as person:
        person.connect(str(run / "text.sock"))
        stream = person.makefile("rw", newline="\n")
        bus.delay("3ms")
        # A session that only looks does not stop time for others.
        stream.write("now\n")
        stream.flush()
        assert stream.readline().endswith("us\n")
        bus.delay("3ms")
        assert bus.now() == 6_000_000_000
        stream.write("step 20ms\n")
        stream.flush()
        bench.until(lambda: bench.node("b").get("state") != "runs")
        granted = bench.node("a")["granted_ps"]
        assert granted <= 6_000_000_000 + 1_000_000_000 + 1
        assert bench.node("a")["state"] == "waits for its host"
        bus.delay("30ms")
        assert stream.readline().endswith("us\n")
        # Now the other one thinks; it lets go when it leaves.
        stream.close()
        person.close()
        assert bus.now() == 36_000_000_000


def test_a_host_that_leaves_does_not_stop_time_for_others(bench: Bench) -> None:
    bench.start("ab", script=False)
    run = bench.folder / "run"
    bench.until(lambda: (run / "x.sock").exists() and (run / "y.sock").exists())
    with connect(f"unix:{run / 'y.sock'}") as other:
        with connect(f"unix:{run / 'x.sock'}") as bus:
            bus.delay("1ms")
        other.delay("50ms")
        assert other.now() >= 50_000_000_000


def test_hosts_are_told_when_another_node_dies(bench: Bench) -> None:
    first = bench.start("a", script=False)
    second = bench.start("b", script=False)
    run = bench.folder / "run"
    bench.until(lambda: (run / "x.sock").exists() and (run / "y.sock").exists())
    with connect(f"unix:{run / 'x.sock'}") as bus:
        bus.delay("1ms")
        assert bus.now() == 1_000_000_000
        second.kill()
        code, out = ended(first)
        assert code == 1
        assert "node b has died" in out
        with pytest.raises(TransportError, match="closed by the other end"):
            bus.now()


def test_a_node_killed_in_a_packet_is_named_and_its_host_told(bench: Bench) -> None:
    first = bench.start("a", script=False)
    second = bench.start("b", script=False)
    run = bench.folder / "run"
    bench.until(lambda: (run / "x.sock").exists() and (run / "y.sock").exists())
    with connect(f"unix:{run / 'x.sock'}") as bus:
        bus.write(0, 0x1F)  # LTRJ: a packet follows
        bus.write(1, 0)
        bus.echo()
        first.kill()
        with pytest.raises(TransportError, match="closed by the other end"):
            bus.read(0)
    code, out = ended(second)
    assert code == 1
    assert "node a has died" in out
