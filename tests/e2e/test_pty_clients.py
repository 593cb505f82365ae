"""Who has a terminal open: several at a time, one right after the other, gone in the middle."""

import errno
import os
import select
import subprocess
import sys
import termios
import threading
import tty
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import PTY, open_raw, read_exactly, toy_board, wait_for_sessions
from tests.waiting import until
from vbus.serve.registry import ask, socket_path
from vbus.serve.server import Server
from vbus.transports.open_watch import OpenWatch
from vbus.transports.pty import PtyTransport, _Terminal

ECHO = b"\x02"


def wait_until_served(server: Server, count: int) -> None:
    """Wait until ``count`` sessions have begun in all."""
    links = lambda: ask(socket_path(server.board.name))["links"]  # noqa: E731
    until(lambda: links()[0]["served"] >= count, f"{count} sessions in all", every=0)


def test_a_client_with_two_descriptors_may_close_one_of_them(runtime: Path) -> None:
    # The system reports two opens in a row as one: counting reports would end the session here.
    with served(toy_board(), PTY) as server:
        one, two = open_raw(runtime / "x"), open_raw(runtime / "x")
        os.write(one, b"\x31\x01")
        wait_until_served(server, 1)
        os.close(one)

        os.write(two, b"\x42\x11")
        assert read_exactly(two, 2) == b"D\x42", "the request goes on where it was"
        os.close(two)
        wait_for_sessions(server, 0)


def test_clients_that_follow_each_other_without_a_pause_are_each_answered(runtime: Path) -> None:
    with served(toy_board(), PTY):
        for number in range(200):
            fd = open_raw(runtime / "x")
            os.write(fd, ECHO + bytes((number,)))
            assert read_exactly(fd, 2) == b"E" + bytes((number,))
            os.close(fd)


def test_half_a_request_is_forgotten_though_the_next_client_comes_at_once(runtime: Path) -> None:
    with served(toy_board(), PTY):
        for number in range(50):
            fd = open_raw(runtime / "x")
            os.write(fd, ECHO + b"\x01\x31\x01")
            assert read_exactly(fd, 2) == b"E\x01"
            os.close(fd)

            fd = open_raw(runtime / "x")
            os.write(fd, ECHO + bytes((number,)))
            assert read_exactly(fd, 2) == b"E" + bytes((number,))
            os.close(fd)


def test_a_client_that_comes_while_the_last_one_is_seen_to_have_gone_is_answered(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    look = _Terminal.look
    came: list[int] = []
    gone: list[int] = []
    here = threading.Event()

    def slow_look(terminal: _Terminal) -> int:
        state = look(terminal)
        if gone and not came:
            assert state & select.POLLHUP
            came.append(open_raw(runtime / "x"))
            os.write(came[0], ECHO + b"\x02")
        return state

    def leave() -> None:
        gone.append(fd)
        os.close(fd)
        transport._notice(transport._terminals[0])
        here.set()

    monkeypatch.setattr(_Terminal, "look", slow_look)
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, ECHO + b"\x01\x31")
        assert read_exactly(fd, 2) == b"E\x01"
        transport = server.hosts[0].transport
        assert isinstance(transport, PtyTransport)
        assert server._loop is not None
        server._loop.call_soon_threadsafe(leave)
        assert here.wait(60)
        assert read_exactly(came[0], 2) == b"E\x02"
        os.close(came[0])


def test_replies_still_on_their_way_when_a_client_closed_reach_nobody(runtime: Path) -> None:
    with served(toy_board(), PTY) as server:
        for number in range(100):
            fd = open_raw(runtime / "x")
            os.write(fd, (ECHO + b"\x55") * 20)
            os.close(fd)
            wait_until_served(server, number + 1)
            wait_for_sessions(server, 0)
        fd = open_raw(runtime / "x")
        os.write(fd, ECHO + b"\x77")
        assert read_exactly(fd, 2) == b"E\x77"
        os.close(fd)


def test_what_a_client_left_while_it_was_held_is_not_carried_out_for_the_next(
    runtime: Path,
) -> None:
    hour = (3600 * 10**12).to_bytes(8, "big")
    with served(toy_board(policy="realtime"), PTY) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, ECHO + b"\x01\x50" + hour)
        assert read_exactly(fd, 2) == b"E\x01"
        os.write(fd, b"\x21\x66")
        os.close(fd)
        wait_for_sessions(server, 0)

        fd = open_raw(runtime / "x")
        os.write(fd, b"\x11")
        assert read_exactly(fd, 2) == b"D\x00"
        os.close(fd)


def test_a_terminal_left_cooked_is_raw_for_the_next_client(runtime: Path) -> None:
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        cooked = termios.tcgetattr(fd)
        cooked[tty.OFLAG] |= termios.OPOST | termios.ONLCR
        cooked[tty.LFLAG] |= termios.ICANON | termios.ECHO
        termios.tcsetattr(fd, termios.TCSANOW, cooked)
        wait_until_served(server, 1)
        os.close(fd)
        wait_for_sessions(server, 0)

        fd = open_raw(runtime / "x")
        assert not termios.tcgetattr(fd)[tty.LFLAG] & (termios.ICANON | termios.ECHO)
        os.write(fd, ECHO + b"\n")
        assert read_exactly(fd, 2) == b"E\n"
        os.close(fd)


UNPRIVILEGED = """
import ctypes, fcntl, os, termios
from pathlib import Path

# Root may open a terminal in exclusive use; without CAP_SYS_ADMIN it may not.
header, sets = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
libc = ctypes.CDLL(None)
assert libc.capget(header, sets) == 0
sets[0] &= ~(1 << 21)
assert libc.capset(header, sets) == 0

from tests.e2e.serving import served
from tests.e2e.test_pty import PTY, open_raw, read_exactly, toy_board, wait_for_sessions

name = Path(os.environ["VBUS_RUNTIME"]) / "x"
with served(toy_board(), PTY) as server:
    fd = open_raw(name)
    fcntl.ioctl(fd, termios.TIOCEXCL)
    os.write(fd, b"\\x02\\x01")
    assert read_exactly(fd, 2) == b"E\\x01"
    os.close(fd)
    wait_for_sessions(server, 0)
    fd = open_raw(name)
    os.write(fd, b"\\x02\\x02")
    assert read_exactly(fd, 2) == b"E\\x02"
    os.close(fd)
"""


def test_exclusive_use_left_behind_does_not_lock_out_the_next_unprivileged_client() -> None:
    root = Path(__file__).parents[2]
    subprocess.run([sys.executable, "-c", UNPRIVILEGED], cwd=root, check=True, timeout=60)


def test_an_idle_terminal_does_not_wake_the_server(runtime: Path) -> None:
    # While nobody has the terminal open its master reports a hang-up, which is not to be waited on.
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, ECHO + b"\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        os.close(fd)
        wait_for_sessions(server, 0)

        loop = server._loop
        assert loop is not None
        selector = loop._selector  # type: ignore[attr-defined]

        def rests() -> bool:
            # The connection that has just asked for the sessions may be one of them, until it ends.
            watched = [key.fd for key in list(selector.get_map().values())]
            return select.select(watched, [], [], 0)[0] == []

        until(rests, "nothing wakes the server")


def test_without_a_watch_clients_come_and_go_all_the_same(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*arguments: object) -> OpenWatch:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr("vbus.transports.pty.OpenWatch", refused)
    with served(toy_board(), PTY) as server:
        for number in (1, 2):
            fd = open_raw(runtime / "x")
            os.write(fd, ECHO + bytes((number,)))
            assert read_exactly(fd, 2) == b"E" + bytes((number,))
            os.close(fd)
            wait_for_sessions(server, 0)
