"""Bus cycles over Zenoh against a raw Zenoh echo, both in the same run; ratios are what counts.

Two echoes, each as plain as Zenoh's own examples: one whose queryable answers in the callback, and
one that does what any server with an event loop must, handing the query over to it. Rounds are
interleaved, because the machine is never twice the same.

    python benchmarks/zenoh_bus.py
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from vbus.client import connect
from vbus.network.session import close_session, free_endpoint, open_session

BOARD = """
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "ideal"
[zenoh]
listen = ["{}"]
[[hosts]]
transport = "zenoh:"
"""

ECHO = """
import sys
from vbus.network.session import open_session
session = open_session(listen=[sys.argv[1]], mode="router")
queryable = session.declare_queryable(
    "echo", lambda query: query.reply("echo", query.payload), complete=True
)
print("ready", flush=True)
sys.stdin.read()
session.close()
"""

ROUNDS = 10
EACH = 150


def started(arguments: list[str]) -> subprocess.Popen[str]:
    process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while not process.stdout.readline().startswith("ready"):
        assert process.poll() is None, "it has ended"
    return process


def timed(call: Callable[[], object]) -> list[float]:
    times = []
    for _ in range(EACH):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return times


def rate(call: Callable[[], int], seconds: float) -> float:
    began = time.perf_counter()
    done = 0
    while time.perf_counter() - began < seconds:
        done += call()
    return done / (time.perf_counter() - began)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "board.toml")
        echo_at, board_at = free_endpoint(), free_endpoint()
        file.write_text(BOARD.format(board_at))
        echo = started([sys.executable, "-c", ECHO, echo_at])
        board = started([sys.executable, "-m", "vbus", "run", str(file)])
        try:
            measure(echo_at, board_at)
        finally:
            for process in (echo, board):
                process.terminate()
                process.wait()


def measure(echo_at: str, board_at: str) -> None:
    session = open_session(connect=[echo_at], mode="client")
    with connect(f"zenoh:bench/x?connect={board_at}") as bus:

        def raw() -> None:
            [reply] = session.get("echo", payload=b"\x10")
            assert reply.ok is not None

        def cycle() -> None:
            bus.read(0)

        echoes: list[float] = []
        cycles: list[float] = []
        ratios = []
        for _ in range(ROUNDS):
            first, second = timed(raw), timed(cycle)
            ratios.append(statistics.median(second) / statistics.median(first))
            echoes += first
            cycles += second
        show("raw Zenoh echo", echoes)
        show("one bus cycle", cycles)
        print(f"bus cycle / echo: {statistics.median(ratios):.2f}   (goal: at most 1.20)")

        for size in (16, 64, 256, 1024):

            def batch(size: int = size) -> int:
                with bus.batch() as message:
                    for _ in range(size):
                        message.read(0)
                return size

            print(f"{size:5} reads in a message: {rate(batch, 0.7):9,.0f} bus cycles/s")

        def block() -> int:
            with bus.batch() as message:
                for _ in range(16):
                    message.reads(0, 250)
            return 4000

        print(f" 4000 in blocks of 250:   {rate(block, 0.7):9,.0f} bus cycles/s   (goal: 100,000)")

        def post() -> int:
            for _ in range(200):
                bus.write(1, 0)
            bus.echo()
            return 200

        print(f"single posted writes:     {rate(post, 0.7):9,.0f} bus cycles/s")
    close_session(session)


def show(name: str, times: list[float]) -> None:
    times.sort()
    microseconds = [times[int(len(times) * part)] * 1e6 for part in (0.5, 0.99)]
    print(f"{name:16} p50 {microseconds[0]:6.0f} us   p99 {microseconds[1]:6.0f} us")


if __name__ == "__main__":
    main()
