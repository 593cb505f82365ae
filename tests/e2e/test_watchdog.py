"""A server that is stuck inside one step of C ends at SIGINT and SIGTERM all the same."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.e2e.test_pty import open_raw, read_exactly
from tests.unit.board.toy import Toy
from tests.waiting import until


class Stuck(Toy):
    """Never returns from a write: a call into C that runs no step of the interpreter."""

    def write(self, address: int, data: int) -> None:
        if data:
            sum(iter(int, 1))
        super().write(address, data)


STUCK = """
from tests.e2e.test_watchdog import Stuck
from vbus.board.board import Board
from vbus.serve.server import LinkSpec, run

board = Board("bench", "lockstep")
board.add_chip(Stuck, "t", "TOY", 8_000_000)
run(board, [LinkSpec("pty:$VBUS_RUNTIME/one", "byte")], on_ready=lambda server: print("ready"))
"""


@contextmanager
def started(program: str = STUCK) -> Iterator[subprocess.Popen[bytes]]:
    server = subprocess.Popen(
        [sys.executable, "-u", "-c", program],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    )
    try:
        assert server.stdout is not None
        assert server.stdout.readline() == b"ready\n"
        yield server
    finally:
        server.kill()
        server.communicate()


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def used(pid: int) -> int:
    """Return the processor time of a process, in ticks."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_server_inside_a_step_that_never_returns_dies_and_says_where(
    runtime: Path, number: signal.Signals
) -> None:
    with started() as server:
        (watchdog,) = children(server.pid)
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x21\x01")
        begun = used(server.pid)
        until(lambda: used(server.pid) > begun + 10, "it computes")
        server.send_signal(number)
        assert server.wait(60) == -signal.SIGABRT
        os.close(fd)
        assert server.stderr is not None
        told = server.stderr.read().decode()
        assert told.startswith(f"vbus: {number.name} has not ended process {server.pid} within ")
        assert "it is killed, and this is where it stood" in told.splitlines()[0]
        assert 'test_watchdog.py", line' in told
        assert "in write" in told
        until(lambda: not os.path.exists(f"/proc/{watchdog}"), "the watchdog ends")


def test_a_stuck_server_dies_also_where_nobody_reads_what_it_says(runtime: Path) -> None:
    with started() as server:
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x21\x01")
        begun = used(server.pid)
        until(lambda: used(server.pid) > begun + 10, "it computes")
        assert server.stderr is not None
        server.stderr.close()
        server.send_signal(signal.SIGTERM)
        assert server.wait(60) == -signal.SIGABRT
        os.close(fd)
        server.stderr = None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_server_that_hears_ends_in_order_and_nothing_is_said(
    runtime: Path, number: signal.Signals
) -> None:
    with started() as server:
        (watchdog,) = children(server.pid)
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x02\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        os.kill(watchdog, number)  # as Ctrl-C does to all processes of a terminal
        server.send_signal(number)
        assert server.wait(60) == 0
        os.close(fd)
        assert server.stderr is not None
        assert server.stderr.read() == b""
        assert not os.path.exists(f"/proc/{watchdog}")


ASLEEP = """
import asyncio, signal, threading
from vbus.serve.loop import run_until_signal

threading.Thread(target=threading.Event().wait, daemon=True).start()
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])

async def serve(stop):
    print("ready")
    await stop.wait()
    print("ended in order")

run_until_signal(serve)
"""


def test_a_server_that_sleeps_through_a_signal_is_woken() -> None:
    # The other thread takes the signal, as when it comes just before the loop begins to wait: no
    # call is interrupted.
    with started(ASLEEP) as server:
        server.terminate()
        assert server.communicate(timeout=60) == (b"ended in order\n", b"")
        assert server.returncode == 0


def test_the_watchdog_does_not_outlive_a_server_that_is_killed(runtime: Path) -> None:
    with started() as server:
        (watchdog,) = children(server.pid)
        server.kill()
        server.wait()
        until(lambda: not os.path.exists(f"/proc/{watchdog}"), "the watchdog ends")
