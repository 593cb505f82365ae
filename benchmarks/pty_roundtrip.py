"""Status reads through vbus against a bare C echo: the same C client, rounds in turn.

    python benchmarks/pty_roundtrip.py

Over a PTY, a Unix socket and TCP; client and server on one processor, and on one each. Absolute
times mean little on a shared machine; the ratio within one run is the result.
"""

import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

HERE = Path(__file__).parent
ROUNDS = 15
MESSAGES = 3000
BATCH = 64
GOALS = {"pty": (1.2, 1.15), "unix": (1.2, 1.2), "tcp": (1.2, 1.2)}
"""Ratios wanted on one processor, and across two."""

BOARD = """
[board]
name = "round-trip"
time = "realtime"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "dc_motor"
[[hosts]]
transport = "{transport}"
protocol = "byte"
chips = ["x"]
"""


def build(source: str, folder: Path) -> Path:
    program = folder / source
    subprocess.run(["gcc", "-O2", "-o", program, HERE / f"{source}.c"], check=True)
    return program


def measure(client: Path, cpu: int, place: str, messages: int, reads: int) -> float:
    """Return the median round trip of a message (us), asked from a processor."""
    done = subprocess.run(
        [client, place, str(messages), str(reads)], check=True, capture_output=True, text=True,
        preexec_fn=pin(cpu),
    )  # fmt: skip
    return int(done.stdout.split()[0]) / 1000


def pin(cpu: int) -> Callable[[], None]:
    return partial(os.sched_setaffinity, 0, {cpu})


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def free_port() -> int:
    with socket.socket() as link:
        link.bind(("127.0.0.1", 0))
        return int(link.getsockname()[1])


def places(kind: str, folder: Path) -> tuple[list[str], str, str]:
    """Return arguments of the C echo, the transport of vbus, and where the client finds that."""
    if kind == "tcp":
        mine = f"tcp:{free_port()}"
        return [f"tcp:{free_port()}"], mine, mine
    if kind == "unix":
        return [f"unix:{folder}/bare"], f"unix:{folder}/x", f"unix:{folder}/x"
    return [], f"pty:{folder}/x", f"{folder}/x"


@contextmanager
def started(*command: str | Path, cpu: int | None = None, **more: str) -> Iterator[
    tuple[subprocess.Popen[str], str]
]:  # fmt: skip
    """Run a server while the block runs; give it and the first line it prints."""
    server = subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, **more},
        preexec_fn=None if cpu is None else pin(cpu),
    )  # fmt: skip
    try:
        assert server.stdout is not None
        yield server, server.stdout.readline().strip()
    finally:
        server.terminate()
        server.wait()


def compare(kind: str, cpus: tuple[int, int], folder: Path, client: Path, echo: Path) -> None:
    """Print what one kind of link costs with the server and the client on these processors."""
    arguments, transport, place = places(kind, folder)
    board = folder / "board.toml"
    board.write_text(BOARD.format(transport=transport))
    # The server knows how many processors there are, and keeps to one.
    command = (sys.executable, "-m", "vbus", "run", "--json", "--cpu", str(cpus[0]), board)
    with (
        started(echo, *arguments, cpu=cpus[0]) as (_, bare),
        started(*command, VBUS_RUNTIME=str(folder)) as (server, status),
    ):
        json.loads(status)
        served = {"C echo": bare, "vbus": place}
        singles: dict[str, list[float]] = {who: [] for who in served}
        batches: dict[str, list[float]] = {who: [] for who in served}
        cpu = 0.0
        for _ in range(ROUNDS):
            for who, where in served.items():
                before = cpu_seconds(server.pid)
                singles[who].append(measure(client, cpus[1], where, MESSAGES, 1))
                if who == "vbus":
                    cpu += cpu_seconds(server.pid) - before
                batches[who].append(measure(client, cpus[1], where, MESSAGES // 20, BATCH))
    pairs = zip(singles["vbus"], singles["C echo"], strict=True)
    ratio = statistics.median(ours / theirs for ours, theirs in pairs)
    each = {who: statistics.median(batches[who]) / BATCH for who in served}
    across = cpus[0] != cpus[1]
    print(
        f"{kind:5}{'two CPUs' if across else 'one CPU':9}"
        f"{statistics.median(singles['C echo']):8.1f}{statistics.median(singles['vbus']):8.1f}"
        f"{ratio:8.2f}  <= {GOALS[kind][across]:<6}{cpu / ROUNDS / MESSAGES / 1.1 * 1e6:9.1f}"
        f"{each['C echo']:12.2f}{each['vbus']:8.2f}",
        flush=True,
    )


def main() -> None:
    first, *others = sorted(os.sched_getaffinity(0))
    print(f"Status read, round trip of a C client, us, medians of {ROUNDS} interleaved rounds")
    print(
        f"{'link':5}{'':9}{'C echo':>8}{'vbus':>8}{'ratio':>8}  {'goal':9}{'CPU each':>9}"
        f"{'C, ' + str(BATCH) + ' in 1':>12}{'vbus':>8}"
    )
    with tempfile.TemporaryDirectory() as name:
        client, echo = (build(source, Path(name)) for source in ("pty_client", "pty_echo"))
        for kind in GOALS:
            for second in (first, *others[:1]):
                with tempfile.TemporaryDirectory() as folder:
                    compare(kind, (first, second), Path(folder), client, echo)


if __name__ == "__main__":
    main()
