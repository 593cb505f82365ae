"""Bus cycles over Zenoh against a raw Zenoh echo, both in the same run; ratios are what counts.

Three echoes, each as plain as Zenoh's own examples: one whose queryable answers in the callback,
one that does what any server with an event loop must, handing the query over to it, and one of
samples that go the same way, as those of vbus do: the rest is what a bus cycle and its order cost.
Rounds are interleaved, because the machine is never twice the same.

    python benchmarks/zenoh_bus.py
"""

import os
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import zenoh

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
import asyncio, os, sys
from collections import deque
from zenoh import CongestionControl
from zenoh.handlers import Callback
from vbus.network.session import open_session
session = open_session(listen=[sys.argv[1]], mode="router")
queryable = session.declare_queryable(
    "echo", lambda query: query.reply("echo", query.payload), complete=True
)
queries, fd = deque(), os.eventfd(0, os.EFD_NONBLOCK)
def enter(query):
    queries.append(query)
    os.eventfd_write(fd, 1)
def drain():
    os.eventfd_read(fd)
    while queries:
        query = queries.popleft()
        query.reply("loop", query.payload)
        query.drop()
handed = session.declare_queryable("loop", enter, complete=True)
answers = session.declare_publisher(
    "pair/answer", congestion_control=CongestionControl.BLOCK, express=True
)
samples, pair = deque(), os.eventfd(0, os.EFD_NONBLOCK)
def came(sample):
    samples.append(sample)
    os.eventfd_write(pair, 1)
def answer():
    os.eventfd_read(pair)
    while samples:
        answers.put(samples.popleft().payload)
posted = session.declare_subscriber("pair/question", Callback(came, indirect=False))
loop = asyncio.new_event_loop()
loop.add_reader(fd, drain)
loop.add_reader(pair, answer)
print("ready", flush=True)
loop.run_forever()
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
    here = os.eventfd(0, os.EFD_NONBLOCK)
    waits = select.poll()
    waits.register(here, select.POLLIN)
    question = session.declare_publisher(
        "pair/question", congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    answered = session.declare_subscriber(
        "pair/answer", zenoh.handlers.Callback(lambda _: os.eventfd_write(here, 1), indirect=False)
    )
    time.sleep(0.3)
    with connect(f"zenoh:bench/x?connect={board_at}") as bus:

        def raw(key: str = "echo") -> None:
            [reply] = session.get(key, payload=b"\x10")
            assert reply.ok is not None

        def handed() -> None:
            raw("loop")

        def pair() -> None:
            question.put(b"\x10")
            assert waits.poll(2000)
            os.eventfd_read(here)

        def cycle() -> None:
            bus.read(0)

        calls = {
            "raw Zenoh echo": raw, "echo by a loop": handed, "samples by a loop": pair,
            "one bus cycle": cycle,
        }  # fmt: skip
        times: dict[str, list[float]] = {name: [] for name in calls}
        medians: dict[str, list[float]] = {name: [] for name in calls}
        for _ in range(ROUNDS):
            for name, call in calls.items():
                found = timed(call)
                times[name] += found
                medians[name].append(statistics.median(found))
        for name in calls:
            show(name, times[name])
        for name in ("raw Zenoh echo", "echo by a loop", "samples by a loop"):
            pairs = zip(medians["one bus cycle"], medians[name], strict=True)
            ratio = statistics.median(cycle / echo for cycle, echo in pairs)
            print(f"bus cycle / {name}: {ratio:.2f}")

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
    answered.undeclare()
    close_session(session)


def show(name: str, times: list[float]) -> None:
    times.sort()
    microseconds = [times[int(len(times) * part)] * 1e6 for part in (0.5, 0.99)]
    print(f"{name:17} p50 {microseconds[0]:6.0f} us   p99 {microseconds[1]:6.0f} us")


if __name__ == "__main__":
    main()
