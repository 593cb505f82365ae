"""Boards with nodes: what a round costs in virtual time, and lag and skew in real time.

    python benchmarks/nodes.py [--nodes 2,4,8] [--soak SECONDS]

Virtual time: nodes in one process (no network), then as many processes joined by Zenoh over
loopback, each with one LM629 whose interrupt line goes to the next node, and where the time of a
round goes in the slowest of them. A raw Zenoh ping-pong
beside it shows what a message costs here. Real time: the same in processes that follow the wall
clock for 0.6 s.
Ends within 15 s for 2, 4 and 8 nodes. With --soak the nodes follow the wall clock for so long
instead, and how far apart they were comes as a histogram. With --axes two nodes have so many
moving axes each instead: how much faster are two processes than one, without a wire between
them and with one on which nothing happens, beside two boards that know nothing of each other?
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from vbus.board.config import read_board_text
from vbus.core.kernel import MS, US
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


def machine_of_axes(axes: int, nodes: int, endpoint: str, wire: bool) -> str:
    """Return a board of nodes with so many LM629s each; without nodes, what one of them has."""
    lines = ['[board]\nname = "axes"\ntime = "lockstep"\npower_on = "done"\n']
    for n in range(nodes):
        listen = f'listen = "{endpoint}"\n' if n == 0 else ""
        lines.append(f'[nodes.n{n}]\n{listen}deadline = "60 s"\n')
    for n in range(max(nodes, 1)):
        node = f'node = "n{n}"\n' if nodes else ""
        for axis in range(axes):
            lines.append(f'[plants.m{n}_{axis}]\nmodel = "dc_motor"\n')
            lines.append(
                f'[chips.x{n}_{axis}]\npart = "LM629N-8"\nclock = "8 MHz"\n'
                f'plant = "m{n}_{axis}"\n{node}'
            )
    if wire:
        lines.append('[nets]\nQUIET = { pins = ["x0_0.HI", "x1_0./IN"], delay = "100 us" }')
    return "\n".join(lines) + "\n"


def script_of_axes(axes: int, nodes: int, seconds: float) -> str:
    """Every axis turns at one count a sample to the end, and is asked for its status each 50 ms."""
    cycles = []
    for code, words in (
        (0x1E, (0x000A, 300, 2000)), (0x04, ()), (0x1F, (0x1828, 0, 1000, 1, 0)), (0x01, ())
    ):  # fmt: skip
        cycles += [f"w 0 {code:x}", *(f"w 1 {word >> 8:x} {word & 255:x}" for word in words)]
    lines = [
        f"{100 + step * 4 * axes + 4 * axis}us x{n}_{axis} {cycle}"
        for step, cycle in enumerate(cycles)
        for axis in range(axes)
        for n in range(max(nodes, 1))
    ]
    lines += [
        f"{at * 50_000 + 4 * axis}us x{n}_{axis} r 0"
        for at in range(2, int(seconds * 20))
        for axis in range(axes)
        for n in range(max(nodes, 1))
    ]
    return "\n".join([*lines, f"end {seconds * 1000:.0f}ms"]) + "\n"


def together(commands: list[list[str]], folder: Path) -> float:
    """Start processes; return how long the slowest took when its board was there (s)."""
    env = {**os.environ, "VBUS_RUNTIME": str(folder / "run")}
    started = [
        subprocess.Popen(
            [sys.executable, __file__, *command], env=env, stdout=subprocess.PIPE, text=True
        )
        for command in commands
    ]
    return max(float(process.communicate()[0].split()[-1]) for process in started)


def run_nodes(board: str, script: str, nodes: str) -> None:
    """The body of one process with some of the nodes: print how long they took."""
    from vbus.board.config import read_board_file
    from vbus.serve.nodes.nodes import NodeOptions, serve_nodes

    options = NodeOptions(tuple(nodes.split(",")), script)
    timing = serve_nodes(*read_board_file(board), options, None, lambda text: None).timing
    # From the end of the first round on: until then one waits for the other to begin.
    print(timing["us_per_round"] * (timing["rounds"] - 1) / 1e6)


def run_alone(board: str, script: str) -> None:
    """The body of one process with a board that has no nodes: print how long it took."""
    from vbus.board.build import build
    from vbus.board.config import read_board_file

    made = build(*read_board_file(board))
    port = made.open_port("bench")
    start = time.perf_counter()
    end = 0
    for line in Path(script).read_text().splitlines():
        at, *words = line.split()
        if at == "end":
            end = int(words[0].removesuffix("ms")) * MS
            continue
        made.run_until(max(int(at.removesuffix("us")) * US, made.now))
        port.select(1 << [chip.name for chip in made.chips].index(words[0]))
        if words[1] == "r":
            port.read(int(words[2]))
        for data in words[3:]:
            port.write(int(words[2]), int(data, 16))
    made.run_until(end)
    made.catch_up()
    print(time.perf_counter() - start)


def cores(axes: int, seconds: float, turns: int = 5) -> None:
    """Print how much faster two processes are than one, beside two boards on their own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        boards = {"apart": (2, False), "wired": (2, True), "alone": (0, False)}
        for kind, (nodes, wire) in boards.items():
            text = machine_of_axes(axes, nodes, free_endpoint(), wire)
            (folder / f"{kind}.toml").write_text(text)
            (folder / f"{kind}.txt").write_text(script_of_axes(axes, nodes, seconds))
        ratios: dict[str, list[float]] = {kind: [] for kind in boards}
        for _ in range(turns):
            for kind in ("apart", "wired"):
                part = ["--part", str(folder / f"{kind}.toml"), str(folder / f"{kind}.txt")]
                one = together([[*part, "n0,n1"]], folder)
                two = together([[*part, node] for node in ("n0", "n1")], folder)
                ratios[kind].append(one / two)
            alone = ["--alone", str(folder / "alone.toml"), str(folder / "alone.txt")]
            limit = 2 * together([alone], folder) / together([alone, alone], folder)
            ratios["alone"].append(limit)
        found = {kind: statistics.median(values) for kind, values in ratios.items()}
        print(
            f"2 nodes of {axes} moving axes, {seconds:g} s: two processes {found['apart']:.2f}"
            f" times as fast as one (goal 1.7), {found['wired']:.2f} times with a quiet wire"
            " between them while hosts are busy; two boards on their own, at once and in turn:"
            f" {found['alone']:.2f}"
        )


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
    from vbus.serve.nodes.nodes import NodeOptions, serve_nodes
    from vbus.serve.server import Server

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
    parser.add_argument("--axes", type=int, metavar="N", help="of each of two nodes; 300 is much")
    parser.add_argument("--part", nargs=3, help=argparse.SUPPRESS)
    parser.add_argument("--alone", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--run", nargs=5, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        run_one(*options.run)
        return
    if options.part:
        run_nodes(*options.part)
        return
    if options.alone:
        run_alone(*options.alone)
        return
    if options.axes:
        cores(options.axes, seconds=10.0)
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
