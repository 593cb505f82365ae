"""Boards with nodes: what a round costs in virtual time, and lag and skew in real time.

    python benchmarks/nodes.py [--nodes 2,4,8] [--soak SECONDS]

Virtual time: nodes in one process (no network), then as many processes joined by Zenoh over
loopback, each with one LM629 whose interrupt line goes to the next node, and where the time of a
round goes in the slowest of them. A raw Zenoh ping-pong
beside it shows what a message costs here. Real time: the same in processes that follow the wall
clock for 0.6 s.
Ends within 15 s for 2, 4 and 8 nodes. With --soak the nodes follow the wall clock for so long
instead, and how far apart they were comes as a histogram.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from vbus.board.config import read_board_text
from vbus.kernel import US
from vbus.network.session import free_endpoint, open_session
from vbus.nodes.machine import Machine
from vbus.nodes.messages import encode
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario

ROUNDS = 150


def board(nodes: int, policy: str, endpoint: str) -> str:
    lines = [f'[board]\nname = "bench"\ntime = "{policy}"\npower_on = "done"\n']
    for n in range(nodes):
        listen = f'listen = "{endpoint}"\n' if n == 0 else ""
        lines.append(f'[nodes.n{n}]\n{listen}deadline = "20 s"\n')
        lines.append(
            f'[chips.x{n}]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\nnode = "n{n}"\n'
        )
    lines.append("[nets]")
    for n in range(nodes):
        lines.append(
            f'"W{n}" = {{ pins = ["x{n}.HI", "x{(n + 1) % nodes}./IN"], delay = "100 us" }}'
        )
    return "\n".join(lines) + "\n"


def script(nodes: int, end_us: int, step_us: int) -> str:
    """Every node reads its status every step: with 100 us of delay that makes a round each."""
    lines = [f"{at}us x{n} r 0" for at in range(100, end_us, step_us) for n in range(nodes)]
    return "\n".join([*lines, f"end {end_us}us"]) + "\n"


def in_process(nodes: int) -> tuple[int, int, float]:
    """Return rounds, bytes that all reports would take, and seconds of a run without network."""
    text = board(nodes, "lockstep", "tcp/127.0.0.1:1")
    file, source = read_board_text(text)
    played = read_scenario(script(nodes, ROUNDS * 100, 100), "bench", pins_of(file), US)
    machine = Machine(file, source, played)
    start = time.perf_counter()
    machine.run()
    seconds = time.perf_counter() - start
    participants = [conductor.participant for conductor in machine.conductors]
    sent = sum(len(encode(told)) for one in participants for told in one.log.values())
    return participants[0].round, sent, seconds


def processes(nodes: int, folder: Path, seconds: float = 0.6) -> list[dict[str, Any]]:
    """Run one process for each node, in virtual and then in real time; return what each says."""
    end = f"end {seconds * 1000:.0f}ms\n"
    texts = {"lockstep": script(nodes, ROUNDS * 100, 100), "realtime": end}
    files = []
    for policy, text in texts.items():
        files += [folder / f"{policy}{nodes}.toml", folder / f"{policy}.txt"]
        files[-2].write_text(board(nodes, policy, free_endpoint()))
        files[-1].write_text(text)
    started = [
        subprocess.Popen(
            [sys.executable, __file__, "--run", *map(str, files), f"n{n}"],
            env={**os.environ, "VBUS_RUNTIME": str(folder / "run")},
            stdout=subprocess.PIPE,
            text=True,
        )
        for n in range(nodes)
    ]
    try:
        outputs = [process.communicate(timeout=60 + 2 * seconds)[0] for process in started]
        return [json.loads(output.splitlines()[-1]) for output in outputs]
    finally:
        for process in started:
            if process.poll() is None:
                process.kill()


def run_one(virtual: str, script: str, real: str, nothing: str, node: str) -> None:
    """The body of one process: run a node twice, print what it measured."""
    from vbus.board.config import read_board_file
    from vbus.cluster.nodes import NodeOptions, serve_nodes
    from vbus.server.server import Server

    timing = serve_nodes(
        *read_board_file(virtual), NodeOptions((node,), script), None, lambda text: None
    ).timing
    servers: list[Server] = []
    skew = serve_nodes(
        *read_board_file(real), NodeOptions((node,), nothing), servers.extend, lambda text: None
    ).skew
    print(json.dumps({**timing, "skew": skew, "lag_ps": servers[0].pacer.worst_lag}))


def ping_pong(count: int = 300) -> float:
    """Return the median round trip of a raw Zenoh message between two sessions (us)."""
    import threading

    endpoint = free_endpoint()
    hub = open_session(listen=[endpoint], mode="router")
    leaf = open_session(connect=[endpoint], mode="client")
    came = threading.Event()
    answer = leaf.declare_publisher("bench/pong", express=True)
    leaf_end = leaf.declare_subscriber("bench/ping", lambda sample: answer.put(b"x"))
    hub_end = hub.declare_subscriber("bench/pong", lambda sample: came.set())
    ask = hub.declare_publisher("bench/ping", express=True)
    time.sleep(0.3)
    trips = []
    for _ in range(count):
        came.clear()
        start = time.perf_counter()
        ask.put(b"x")
        if came.wait(1):
            trips.append(time.perf_counter() - start)
    del leaf_end, hub_end
    leaf.close()
    hub.close()
    return sorted(trips)[len(trips) // 2] * 1e6


def soak(counts: list[int], seconds: float) -> None:
    """Print how far apart nodes were that have followed the wall clock for so long."""
    for nodes in counts:
        with tempfile.TemporaryDirectory() as name:
            states = processes(nodes, Path(name), seconds)
        skew = states[0]["skew"]
        print(
            f"{nodes} nodes, {seconds:.0f} s: {skew['marks']} marks, each"
            f" ±{skew['uncertainty_ns'] / 1000:.0f} us; worst {skew['max_ns'] / 1000:.0f} us"
        )
        for bound, count in skew["histogram"]:
            what = "more" if bound is None else f"<= {bound / 1000:.0f} us"
            print(f"  {what:>12} {count:8}  {count / skew['marks']:8.3%}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--nodes", default="2,4,8")
    parser.add_argument("--soak", type=float, metavar="SECONDS", help="an hour is 3600")
    parser.add_argument("--run", nargs=5, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        run_one(*options.run)
        return
    counts = [int(word) for word in options.nodes.split(",")]
    if options.soak:
        soak(counts, options.soak)
        return
    print(f"raw Zenoh message and answer, loopback: {ping_pong():.0f} us (median)")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for nodes in counts:
            rounds, sent, seconds = in_process(nodes)
            states = processes(nodes, folder)
            skew = states[0]["skew"]
            lag = max(state["lag_ps"] for state in states) / 1e6
            print(
                f"{nodes} nodes, virtual time: {rounds} rounds of {sent / rounds:.0f} bytes;"
                f" {seconds / rounds * 1e6:.0f} us a round in one"
                f" process, {max(state['us_per_round'] for state in states):.0f} us in"
                f" {nodes} processes"
            )
            where = max(states, key=lambda state: state["us_per_round"])
            spent = {key: where[f"us_{key}"] for key in ("computing", "sending")}
            waiting = max(where["us_per_round"] - sum(spent.values()), 0.0)
            print(
                f"  of that {spent['computing']:.0f} us computing, {spent['sending']:.0f} us"
                f" sending, {waiting:.0f} us until the others' reports are here"
            )
            print(
                f"{nodes} nodes, real time: skew p50 {skew['p50_ns'] / 1000:.0f} us, p99"
                f" {skew['p99_ns'] / 1000:.0f} us, max {skew['max_ns'] / 1000:.0f} us;"
                f" worst lag {lag:.0f} us"
            )


if __name__ == "__main__":
    main()
