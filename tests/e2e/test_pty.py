"""The PTY transport with real terminals: every trap a terminal has in store."""

import ctypes
import errno
import fcntl
import os
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Final

import pytest
import serial

from tests.e2e.serving import served
from tests.unit.board.toy import Toy
from tests.waiting import PATIENCE, until
from vbus import connect
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.client.lm628 import Lm628
from vbus.core.errors import TransportError
from vbus.serve.server import LinkSpec, Server
from vbus.serve.session import MOST_PENDING, READ_SIZE
from vbus.transports import linux

TERMINAL: Final = 1 << 18
"""More bytes than a system keeps of one direction of a terminal (Linux 12 KiB, gVisor 132 KiB)."""
PTY = LinkSpec("pty:$VBUS_RUNTIME/x", "byte")


def toy_board(name: str = "bench", policy: str = "lockstep") -> Board:
    board = Board(name, policy)
    board.add_chip(Toy, "t", "TOY", 8_000_000)
    return board


def open_raw(path: Path) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY)


def read_exactly(fd: int, count: int) -> bytes:
    data = b""
    while len(data) < count:
        ready, _, _ = select.select([fd], [], [], 60)
        assert ready, f"no answer after {data!r}"
        data += os.read(fd, count - len(data))
    return data


def test_every_byte_value_passes_unchanged_to_a_plain_client(runtime: Path) -> None:
    with served(toy_board(), PTY):
        fd = open_raw(runtime / "x")
        for value in range(256):
            os.write(fd, bytes((0x21, value, 0x11)))
            assert read_exactly(fd, 2) == bytes((ord("D"), value))
        os.close(fd)


@pytest.mark.parametrize("which", ["inotify_init1", "inotify_add_watch"])
def test_without_a_watch_clients_are_noticed_a_little_later(
    runtime: Path, monkeypatch: pytest.MonkeyPatch, which: str
) -> None:
    def refused(*args: object) -> int:
        ctypes.set_errno(errno.ENOSPC)
        return -1

    libc = linux._libc
    without = SimpleNamespace(
        inotify_init1=libc.inotify_init1, inotify_add_watch=libc.inotify_add_watch
    )
    setattr(without, which, refused)
    before = len(os.listdir("/proc/self/fd"))
    with monkeypatch.context() as patched:
        patched.setattr(linux, "_libc", without)
        with served(toy_board(), PTY) as server:
            for number in (1, 2):
                fd = open_raw(runtime / "x")
                os.write(fd, bytes((0x02, number)))
                assert read_exactly(fd, 2) == bytes((ord("E"), number))
                assert len(server.hosts[0].sessions) == 1
                os.close(fd)
                wait_for_sessions(server, 0)
    assert len(os.listdir("/proc/self/fd")) == before


def test_all_terminals_of_a_server_share_one_watch(runtime: Path) -> None:
    """A user may have 128 inotify descriptors where nobody has asked for more."""
    names = [f"x{number}" for number in range(150)]
    links = [LinkSpec(f"pty:$VBUS_RUNTIME/{name}", "byte") for name in names]

    def watches() -> int:
        here = Path("/proc/self/fd")
        return sum("inotify" in os.readlink(fd) for fd in here.iterdir() if fd.is_symlink())

    before = watches()
    with served(toy_board(), *links) as server:
        assert watches() == before + 1
        fds = [open_raw(runtime / name) for name in names]
        for number, fd in enumerate(fds):
            os.write(fd, bytes((0x02, number)))
        for number, fd in enumerate(fds):
            assert read_exactly(fd, 2) == bytes((ord("E"), number))
        for fd in fds:
            os.close(fd)
        wait_for_sessions(server, 0)
    assert watches() == before


def test_pyserial_talks_to_the_board(runtime: Path) -> None:
    with (
        served(toy_board(), PTY),
        serial.Serial(str(runtime / "x"), 115200, timeout=PATIENCE) as port,
    ):
        port.write(b"\x21\x0d\x11")
        assert port.read(2) == b"D\x0d"


def test_a_reply_left_unread_is_not_read_by_the_next_client(runtime: Path) -> None:
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x21\x55\x11\x02\x01")
        # The echo's reply is in the terminal once its five bytes are: leave all of it there.
        select.select([fd], [], [], 60)
        os.close(fd)
        wait_for_sessions(server, 0)

        fd = open_raw(runtime / "x")
        os.write(fd, b"\x02\x77")
        assert read_exactly(fd, 2) == b"E\x77"
        os.close(fd)


def test_half_a_request_of_one_client_is_forgotten_before_the_next(runtime: Path) -> None:
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x31\x01")
        os.close(fd)
        wait_for_sessions(server, 0)

        fd = open_raw(runtime / "x")
        os.write(fd, b"\x11")
        assert read_exactly(fd, 2) == b"D\x00"
        os.close(fd)


def test_what_a_client_wrote_before_it_closed_is_still_carried_out(runtime: Path) -> None:
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x21\x66")
        os.close(fd)
        wait_for_sessions(server, 0)

        fd = open_raw(runtime / "x")
        os.write(fd, b"\x11")
        assert read_exactly(fd, 2) == b"D\x66"
        os.close(fd)


def test_a_client_that_is_killed_ends_its_session_and_gives_back_its_claim(runtime: Path) -> None:
    script = (
        "import os, sys, time\n"
        f"fd = os.open({str(runtime / 'x')!r}, os.O_RDWR | os.O_NOCTTY)\n"
        "os.write(fd, b'\\x04'); print(os.read(fd, 2), flush=True); time.sleep(600)\n"
    )
    other = LinkSpec("unix:$VBUS_RUNTIME/y", "byte")
    with served(toy_board(), PTY, other) as server:
        client = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
        assert client.stdout is not None
        assert client.stdout.readline() == b"b'C\\x01'\n"
        client.send_signal(signal.SIGKILL)
        client.wait()
        client.stdout.close()

        wait_for_sessions(server, 0)
        assert not server.board.hosts.claims


@pytest.mark.parametrize("asleep", [0.0, 0.05, 0.2])
def test_when_a_client_is_killed_in_its_delay_does_not_decide_when_the_next_begins(
    runtime: Path, asleep: float
) -> None:
    """The axis moves, so that half a minute takes a while."""
    seconds = b"".join(b"\x50" + (n * 10**12).to_bytes(8, "big") for n in (20, 10))
    script = (
        "import os, sys, time\n"
        f"fd = os.open({str(runtime / 'x')!r}, os.O_RDWR | os.O_NOCTTY)\n"
        f"os.write(fd, {seconds!r}); print(flush=True); time.sleep(600)\n"
    )
    board = load_board_text(
        '[board]\nname = "bench"\ntime = "lockstep"\npower_on = "done"\n'
        '[chips]\nx = { part = "LM629N-8", clock = "8 MHz", plant = "m" }\n'
        '[plants.m]\nmodel = "dc_motor"\n'
    )
    with served(board, PTY) as server:
        with connect("pty:$VBUS_RUNTIME/x") as bus:
            axis = Lm628(bus)
            axis.load_filter(kp=300, kd=2000)
            axis.load_trajectory(acc=40, vel=1 << 16, velocity_mode=True, start=True)
        wait_for_sessions(server, 0)
        began = server.board.now
        client = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
        assert client.stdout is not None
        assert client.stdout.readline() == b"\n"
        time.sleep(asleep)
        client.send_signal(signal.SIGKILL)
        client.wait()
        client.stdout.close()
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x10")
        assert read_exactly(fd, 2)[:1] == b"D"
        assert server.board.now == began + 30 * 10**12 + 10**6
        os.close(fd)


def test_exclusive_use_ends_with_the_session(runtime: Path) -> None:
    with served(toy_board(), PTY) as server:
        fd = open_raw(runtime / "x")
        fcntl.ioctl(fd, termios.TIOCEXCL)
        os.close(fd)
        wait_for_sessions(server, 0)

        os.close(open_raw(runtime / "x"))


def test_a_client_that_does_not_read_does_not_stall_another_one(runtime: Path) -> None:
    other = LinkSpec("unix:$VBUS_RUNTIME/y", "byte")
    with served(toy_board(), PTY, other):
        deaf = open_raw(runtime / "x")
        os.write(deaf, b"\x02\x09")
        assert read_exactly(deaf, 2) == b"E\x09"
        os.set_blocking(deaf, False)
        # Each byte asks for two: what the server keeps unsent, and what lies in the terminal.
        carried_out = (MOST_PENDING + 2 * READ_SIZE + TERMINAL) // 2
        most = carried_out + TERMINAL
        wrote = 0
        while wrote <= most and select.select([], [deaf], [], 1)[1]:
            wrote += os.write(deaf, b"\x10" * 4000)
        assert wrote <= most, "the server stops reading from who does not read"

        import socket

        with socket.socket(socket.AF_UNIX) as link:
            link.connect(str(runtime / "y"))
            link.settimeout(PATIENCE)
            link.sendall(b"\x02\x09")
            assert link.recv(2) == b"E\x09"

        answers = 0
        # Silence of a busy machine is not the end, but more than there should be comes at once.
        while select.select([deaf], [], [], 60 if answers < 2 * wrote else 0.2)[0]:
            answers += len(os.read(deaf, 65536))
        assert answers == 2 * wrote, "nothing is lost once it reads again"
        os.close(deaf)


def test_garbage_ends_in_a_refusal_for_that_session_only(runtime: Path) -> None:
    other = LinkSpec("unix:$VBUS_RUNTIME/y", "byte")
    with served(toy_board(), PTY, other) as server:
        fd = open_raw(runtime / "x")
        os.write(fd, b"\xff\xfe")
        assert read_exactly(fd, 4) == b"X\x01\x00\x00"
        os.close(fd)
        wait_for_sessions(server, 0)

        fd = open_raw(runtime / "x")
        os.write(fd, b"\x02\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        os.close(fd)


def test_the_name_goes_with_the_server_and_leads_to_the_terminal_while_it_runs(
    runtime: Path,
) -> None:
    with served(toy_board(), PTY):
        assert os.readlink(runtime / "x").startswith("/dev/pts/")

    assert not os.path.lexists(runtime / "x")
    assert [path.name for path in runtime.iterdir()] == ["boards"]
    assert list((runtime / "boards").iterdir()) == []


def test_a_name_in_use_is_refused_with_the_process_that_has_it(runtime: Path) -> None:
    with served(toy_board(), PTY):
        second = Server(toy_board("other"), [PTY])
        with pytest.raises(
            TransportError,
            match=rf"^{runtime}/x is in use by process {os.getpid()}; stop it or choose another",
        ):
            start(second)


def test_a_second_board_of_the_same_name_is_refused(runtime: Path) -> None:
    with served(toy_board(), PTY):
        second = Server(toy_board(), [LinkSpec("pty:$VBUS_RUNTIME/y", "byte")])
        with pytest.raises(TransportError, match=r'^a board called "bench" runs already'):
            start(second)
        assert not os.path.lexists(runtime / "y")


def test_a_file_that_is_not_ours_is_not_replaced(runtime: Path) -> None:
    runtime.mkdir()
    (runtime / "x").write_text("precious")

    with pytest.raises(TransportError, match=r"exists and is not a link of ours"):
        start(Server(toy_board(), [PTY]))
    assert (runtime / "x").read_text() == "precious"


def test_names_left_by_a_killed_server_are_repaired_by_the_next_start(runtime: Path) -> None:
    script = (
        "import asyncio, os, signal\n"
        "from tests.e2e.test_pty import toy_board, PTY\n"
        "from vbus.serve.server import LinkSpec, Server\n"
        "links = [PTY, LinkSpec('unix:$VBUS_RUNTIME/y', 'byte')]\n"
        "async def main():\n"
        "    Server(toy_board(), links).start(asyncio.get_running_loop())\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "asyncio.run(main())\n"
    )
    killed = subprocess.run([sys.executable, "-c", script], cwd=Path(__file__).parents[2])
    assert killed.returncode == -signal.SIGKILL
    assert os.path.lexists(runtime / "x")

    with served(toy_board(), PTY, LinkSpec("unix:$VBUS_RUNTIME/y", "byte")):
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x02\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        os.close(fd)


def start(server: Server) -> None:
    import asyncio

    loop = asyncio.new_event_loop()
    try:
        server.start(loop)
    finally:
        server.stop()
        loop.close()


def wait_for_sessions(server: Server, count: int) -> None:
    """Ask the running server until it has ``count`` sessions; it answers in its own thread."""
    from vbus.serve.registry import ask, socket_path

    def sessions() -> list[int]:
        return [link["sessions"] for link in ask(socket_path(server.board.name))["links"]]

    until(lambda: sum(sessions()) == count, lambda: f"{count} sessions, not {sessions()}", every=0)
