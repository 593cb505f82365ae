"""Names in the file system: whose they are, and what is left of those who died."""

import asyncio
import contextlib
import errno
import fcntl
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import PTY, start, toy_board
from tests.waiting import PATIENCE
from vbus import client
from vbus.core.errors import NameInUseError, TransportError
from vbus.core.runtime import lock_of, lock_state
from vbus.serve.registry import boards_directory, running, socket_path
from vbus.serve.server import LinkSpec, Server
from vbus.transports.runtime import PATIENCE_SECONDS, NameLock, sweep
from vbus.transports.sockets import UnixTransport

UNIX = LinkSpec("unix:$VBUS_RUNTIME/x", "byte")


@pytest.fixture
def listener() -> socket.socket:
    return socket.socket(socket.AF_UNIX)


def test_a_socket_left_behind_is_replaced(runtime: Path, listener: socket.socket) -> None:
    runtime.mkdir()
    listener.bind(str(runtime / "x"))
    listener.close()
    with served(toy_board(), UNIX), socket.socket(socket.AF_UNIX) as link:
        link.settimeout(PATIENCE)
        link.connect(str(runtime / "x"))
        link.sendall(b"\x02\x01")
        assert link.recv(2) == b"E\x01"


def test_a_socket_of_another_program_is_left_alone(runtime: Path, listener: socket.socket) -> None:
    runtime.mkdir()
    with listener:
        listener.bind(str(runtime / "x"))
        listener.listen()
        with pytest.raises(
            NameInUseError, match=rf"^{runtime}/x is in use by another program; stop it or choose"
        ):
            start(Server(toy_board(), [UNIX]))
        assert (runtime / "x").is_socket()


def test_a_link_to_something_else_than_a_terminal_is_left_alone(runtime: Path) -> None:
    runtime.mkdir()
    (runtime / "x").symlink_to("precious")
    with pytest.raises(
        TransportError, match=rf"^{runtime}/x exists and is not a link of ours; remove it or choose"
    ):
        start(Server(toy_board(), [PTY]))
    assert os.readlink(runtime / "x") == "precious"


def test_a_board_that_died_is_forgotten(listener: socket.socket) -> None:
    listener.bind(str(socket_path("dead")))
    listener.close()
    (boards_directory() / ".dead.sock.lock").write_text("12345\n")

    assert list(running()) == []
    assert list(boards_directory().iterdir()) == []


def test_a_board_that_is_just_starting_is_not_forgotten(listener: socket.socket) -> None:
    lock = NameLock(socket_path("young"))
    lock.take()
    listener.bind(str(socket_path("young")))
    listener.close()

    assert list(running()) == []
    assert socket_path("young").is_socket()
    lock.give_back()


class Exhausted:
    """A listening socket on a computer that has run out of descriptors."""

    def fileno(self) -> int:
        return self.far.fileno()

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair()
        self.near.send(b"somebody waits")
        self.asked = 0

    def accept(self) -> None:
        self.asked += 1
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    def close(self) -> None:
        self.near.close()
        self.far.close()


def test_a_computer_without_free_descriptors_is_reported_and_not_asked_all_the_time(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.transports.sockets.REST_SECONDS", 3600)
    transport = UnixTransport(str(runtime / "x"), {})
    reports: list[str] = []
    transport.report = reports.append
    full = Exhausted()

    async def main() -> None:
        transport.loop = asyncio.get_running_loop()
        transport._listener = full
        transport.loop.add_reader(full.fileno(), transport._accept)
        for _ in range(100):
            await asyncio.sleep(0)

    asyncio.run(main())
    full.close()
    assert full.asked == 1
    assert reports == [f"unix:{runtime}/x: a host waits outside: Too many open files"]


def test_a_hundred_hosts_may_wait_to_be_accepted(runtime: Path) -> None:
    loop = asyncio.new_event_loop()
    transport = UnixTransport(str(runtime / "x"), {})
    transport.open(loop, lambda link: None)
    with contextlib.ExitStack() as closing:
        closing.callback(loop.close)
        closing.callback(transport.close)
        for _ in range(100):
            link = closing.enter_context(socket.socket(socket.AF_UNIX))
            link.setblocking(False)
            link.connect(str(runtime / "x"))


SERVED = """
import sys
from tests.e2e.test_pty import toy_board
from vbus.serve.server import LinkSpec, run

links = [LinkSpec("pty:$VBUS_RUNTIME/old", "byte"), LinkSpec("unix:$VBUS_RUNTIME/s", "byte")]
run(toy_board("old"), links, on_ready=lambda server: print("ready", flush=True))
"""


@pytest.fixture
def killed(runtime: Path) -> None:
    """A board that was killed; its names are still there."""
    root = Path(__file__).parents[2]
    with subprocess.Popen([sys.executable, "-c", SERVED], stdout=subprocess.PIPE, cwd=root) as old:
        assert old.stdout is not None
        assert old.stdout.readline() == b"ready\n"
        old.kill()
    assert (runtime / "old").is_symlink()


def test_the_name_of_a_killed_board_leads_no_client_to_anybody(runtime: Path, killed: None) -> None:
    (runtime / "alias").symlink_to("old")
    for name in ("old", "alias"):
        where = f"pty:{runtime}/{name}"
        with pytest.raises(
            TransportError,
            match=rf"^{where} cannot be opened: the board it led to was killed; start it again",
        ):
            client.connect(where)


def test_the_next_board_removes_what_a_killed_one_has_left(runtime: Path, killed: None) -> None:
    with served(toy_board(), PTY), client.connect(f"pty:{runtime}/x") as bus:
        assert bus.info.board == "bench"
        assert sorted(path.name for path in runtime.iterdir()) == [".x.lock", "boards", "x"]
        assert not [path for path in boards_directory().iterdir() if "old" in path.name]


def test_a_name_that_leads_to_another_board_is_noticed(runtime: Path) -> None:
    with served(toy_board(), PTY):
        lock = NameLock(runtime / "y")
        lock.take("other")
        (runtime / "y").symlink_to(os.readlink(runtime / "x"))
        with pytest.raises(
            TransportError, match=rf"^pty:{runtime}/y leads to the board bench, not to other: is"
        ):
            client.connect(f"pty:{runtime}/y")
        lock.give_back()


def test_a_name_is_waited_for_while_somebody_only_looks_at_it(tmp_path: Path) -> None:
    looking = os.open(lock_of(tmp_path / "x"), os.O_RDONLY | os.O_CREAT, 0o600)
    fcntl.flock(looking, fcntl.LOCK_SH)
    threading.Timer(3 * PATIENCE_SECONDS, os.close, [looking]).start()
    lock = NameLock(tmp_path / "x")
    lock.take()
    lock.give_back()


def test_who_sweeps_keeps_no_owner_out_and_takes_nothing_from_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two processes sweep, and one of them stands still with a name of the dead in its hand."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path))
    lock_of(tmp_path / "x").touch(0o600)
    script = (
        "import os, signal, sys; from pathlib import Path; from vbus.transports import runtime\n"
        "def stop(path, fd, there=runtime._is_there):\n"
        "    print('looks', flush=True); os.kill(os.getpid(), signal.SIGSTOP)\n"
        "    return there(path, fd)\n"
        "runtime._is_there = stop; runtime.sweep(Path(sys.argv[1]))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, tmp_path], stdout=subprocess.PIPE
    ) as stopped:
        assert stopped.stdout is not None
        assert stopped.stdout.readline() == b"looks\n"
        sweep(tmp_path)
        lock = NameLock(tmp_path / "x")
        timer = threading.Timer(3 * PATIENCE_SECONDS, stopped.send_signal, [signal.SIGCONT])
        timer.start()
        lock.take()
        (tmp_path / "x").touch()
    assert (tmp_path / "x").exists()
    assert lock_state(tmp_path / "x")[0]
    lock.give_back()
