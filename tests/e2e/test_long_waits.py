"""A host that lets much time pass stops nobody else, and not the server."""

import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import open_raw, read_exactly, toy_board, wait_for_sessions
from tests.unit.board.toy import Toy
from tests.unit.faults.bench import DC, LM, build
from tests.waiting import until
from vbus.board.board import Board
from vbus.core.kernel import END, MS, SECOND
from vbus.core.signals import Observer
from vbus.serve.registry import ask, socket_path
from vbus.serve.server import LinkSpec

ONE = LinkSpec("pty:$VBUS_RUNTIME/one", "byte")
WEEK = 7 * 24 * 3600 * 10**12


def u64(number: int) -> bytes:
    return number.to_bytes(8, "big")


class Restless(Toy):
    """Moves for ever: each millisecond of it takes a while to compute."""

    done = 0

    def advance(self) -> None:
        super().advance()
        while self.done < self.kernel.now:
            self.done += MS
            sum(range(2000))

    def resting(self) -> bool:
        return False


RESTLESS = """
import sys
from tests.e2e.test_long_waits import Restless
from vbus.board.board import Board
from vbus.serve.server import LinkSpec, run

board = Board("bench", sys.argv[1])
board.add_chip(Restless, "t", "TOY", 8_000_000)
links = [LinkSpec(f"pty:$VBUS_RUNTIME/{name}", "byte") for name in ("one", "two")]
run(board, links, on_ready=lambda server: print("ready", flush=True))
"""


@pytest.mark.parametrize(
    ("policy", "wait"),
    [
        ("lockstep", b"\x50" + u64(WEEK)),
        ("lockstep", b"\x50" + u64(END)),
        ("slaved", b"\x51" + u64(WEEK) + b"\x10"),
        ("slaved", b"\x51" + u64(WEEK) + b"\x53"),
        ("lockstep", b"\x56" + u64(WEEK)),
        ("slaved", b"\x56" + u64(1 << 63)),
    ],
    ids=["delay", "longest delay", "read", "sync", "pass", "longest pass"],
)
def test_others_are_answered_and_ctrl_c_ends_it_while_one_host_waits_for_a_week(
    runtime: Path, policy: str, wait: bytes
) -> None:
    server = subprocess.Popen(
        [sys.executable, "-c", RESTLESS, policy],
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    )
    try:
        assert server.stdout is not None
        assert server.stdout.readline() == b"ready\n"
        one, two = open_raw(runtime / "one"), open_raw(runtime / "two")
        os.write(one, b"\x02\x01" + wait + b"\x02\x02")
        assert read_exactly(one, 2) == b"E\x01"

        for number in range(10):
            os.write(two, bytes((0x02, number)))
            assert read_exactly(two, 2) == bytes((ord("E"), number))

        server.send_signal(signal.SIGINT)
        assert server.wait(60) == 0
        os.close(one)
        os.close(two)
        assert not os.path.lexists(runtime / "one")
    finally:
        server.kill()
        server.wait()
        if server.stdout is not None:
            server.stdout.close()


def test_a_delay_whose_host_has_gone_stands_still(runtime: Path) -> None:
    board = Board("bench", "lockstep")
    board.add_chip(Restless, "t", "TOY", 8_000_000)
    with served(board, ONE) as server:
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x50" + u64(WEEK))
        until(lambda: server.pacer.board.now > 20 * MS, "time passes")
        os.close(fd)
        wait_for_sessions(server, 0)
        fd = open_raw(runtime / "one")
        instants = []
        for _ in range(5):
            ask(socket_path("bench"))
            os.write(fd, b"\x52")
            instants.append(read_exactly(fd, 9)[1:])
        os.close(fd)
    assert len(set(instants)) == 1
    assert int.from_bytes(instants[0], "big") < WEEK


def block(begun: threading.Event, until_then: threading.Event) -> None:
    """Keep the server from looking at anything."""
    begun.set()
    until_then.wait(60)


@pytest.mark.parametrize("link", [ONE, LinkSpec("unix:$VBUS_RUNTIME/one", "byte")])
def test_a_long_wait_of_a_host_that_has_gone_ends_at_a_whole_minute(
    runtime: Path, link: LinkSpec
) -> None:
    """The next begins at one of few instants, however fast the machine is."""

    def opened() -> int:
        if link is ONE:
            return open_raw(runtime / "one")
        host = socket.socket(socket.AF_UNIX)
        host.connect(str(runtime / "one"))
        return host.detach()

    def left_when_the_next_has_come() -> int:
        with served(toy_board(), link) as server:
            fd = opened()
            os.write(fd, b"\x50" + u64(15 * WEEK))
            os.close(fd)
            until(lambda: server.pacer.board.now > 0, "time passes")
            fd = opened()
            os.write(fd, b"\x52")
            now = int.from_bytes(read_exactly(fd, 9)[1:], "big")
            os.close(fd)
        return 15 * WEEK - now

    # The weeks pass in some tenths of a second, in which a busy machine may let nobody come.
    left = next(filter(None, (left_when_the_next_has_come() for _ in range(50))))
    assert left > 0
    assert left % (60 * SECOND) == 0


def test_a_long_delay_ends_at_the_picosecond_and_what_follows_is_done_there(runtime: Path) -> None:
    with served(toy_board(), ONE) as server:
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x50" + u64(WEEK + 1) + b"\x52\x21\x77\x52")
        assert read_exactly(fd, 9) == b"T" + u64(WEEK + 1)
        assert read_exactly(fd, 9) == b"T" + u64(WEEK + 1 + 10**6)
        os.close(fd)
        wait_for_sessions(server, 0)


class Cycles(Observer):
    def __init__(self) -> None:
        self.seen: list[tuple[int, int]] = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.seen.append((when, data))


def test_a_time_stamp_far_ahead_is_met_at_the_picosecond(runtime: Path) -> None:
    board = toy_board(policy="slaved")
    cycles = Cycles()
    board.observe(cycles)
    with served(board, ONE):
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x51" + u64(WEEK) + b"\x21\x07\x51" + u64(WEEK + 5) + b"\x11")
        assert read_exactly(fd, 2) == b"D\x07"
        os.close(fd)
    assert cycles.seen == [(WEEK, 7), (WEEK + 5, 7)]


def test_a_board_without_a_limit_of_rate_answers_its_hosts(runtime: Path) -> None:
    board = Board("bench", "realtime", rate=float("inf"))
    with served(board, ONE):
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x50" + u64(10 * 10**12) + b"\x02\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        os.close(fd)


def test_time_has_an_end_and_the_board_says_so(runtime: Path) -> None:
    refused = b"X\x03"
    with served(toy_board(), ONE) as server:
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x50" + u64(END + 1) + b"\x52")
        assert read_exactly(fd, 13) == refused + b"\x00\x00T" + u64(0), "no time has passed"

        os.write(fd, b"\x50" + u64(END) + b"\x11\x21\x01\x52")
        assert read_exactly(fd, 17) == (refused + b"\x00\x03" + refused + b"\x00\x04T" + u64(END))
        os.close(fd)
        wait_for_sessions(server, 0)


def test_a_host_that_leaves_near_the_end_of_time_leaves_its_terminal_to_the_next(
    runtime: Path,
) -> None:
    board = build(LM, DC)
    with served(board, ONE) as server:
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x50" + u64(END - MS) + b"\x44\x00\x00\x50" + u64(MS) + b"\x02\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        assert board.now == END
        assert board.chip("x").pins["/RST"].value == 0
        os.close(fd)
        wait_for_sessions(server, 0)
        fd = open_raw(runtime / "one")
        os.write(fd, b"\x02\x02")
        assert read_exactly(fd, 2) == b"E\x02"
        os.close(fd)
