"""Boards in the background: start, wait, logs, stop; and hosts that come before their board."""

import asyncio
import json
import os
import resource
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.command import running, start, vbus
from tests.left_out import require
from tests.ports import free_endpoint
from tests.waiting import PATIENCE, until
from vbus import connect
from vbus.client import aio
from vbus.client.link import starting
from vbus.core import exit_codes
from vbus.core.errors import TransportError
from vbus.transports.runtime import NameLock
from vbus.transports.sockets import handed_over

Done = subprocess.CompletedProcess[str]

LM629 = """
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"

[[hosts]]
transport = "pty:$VBUS_RUNTIME/x"
"""


@pytest.fixture
def board(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(LM629)
    return path


@pytest.fixture
def detached(board: Path) -> Iterator[Done]:
    done = vbus("run", str(board), "--detach")
    assert done.returncode == 0, done.stderr
    yield done
    vbus("stop", "bench")


def test_a_board_is_ready_when_detach_returns(detached: Done, runtime: Path) -> None:
    lines = detached.stdout.splitlines()

    assert lines[0].startswith("bench: realtime, process ")
    assert lines[-1] == 'ready; "vbus stop bench" stops it'
    with connect(f"pty:{runtime}/x") as bus:
        assert bus.read(0) in (0x00, 0x84, 0xC4)
    assert vbus("wait", "bench", "--timeout", "0").returncode == 0
    assert vbus("logs", "bench").stdout.endswith("ready; Ctrl-C stops it\n")


def _short_of_space(size: int, *words: str) -> Done:
    """Start vbus where no file may be longer than ``size`` bytes."""
    return subprocess.run(
        [sys.executable, "-B", "-m", "vbus", *words], capture_output=True, text=True, timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )  # fmt: skip


def test_stop_tells_what_a_board_in_the_background_could_not_write(
    board: Path, tmp_path: Path
) -> None:
    report = tmp_path / "c.html"
    begun = _short_of_space(4096, "run", str(board), "--detach", "--coverage", str(report))
    assert begun.returncode == 0, begun.stderr
    done = vbus("stop", "bench")
    assert (
        done.stderr == f"vbus: bench: not all is recorded: {report}: cannot be written: File"
        " too large\n"
    )
    assert done.returncode == 1
    # What an earlier run could not write says nothing of the next one.
    with running(board):
        assert vbus("stop", "bench").returncode == 0


def test_a_board_whose_log_takes_nothing_is_no_silence(board: Path) -> None:
    done = _short_of_space(0, "run", str(board), "--detach")
    assert done.returncode == exit_codes.NO_LINK  # the reason's own, though nobody could read it
    assert done.stderr.startswith("vbus: the board ended with exit code 4, and ")
    assert done.stderr.endswith(" could not take why; start it without --detach\n")


def test_a_router_in_the_background_is_listed_and_stopped_like_a_board(runtime: Path) -> None:
    endpoint = free_endpoint()
    done = vbus("router", "--listen", endpoint, "--detach")
    try:
        assert done.stdout == f'router: {endpoint}\nready; "vbus stop router" stops it\n'
        assert vbus("wait", "router", "--timeout", "0").returncode == 0
        [listed] = json.loads(vbus("ls", "--json").stdout)
        assert listed["router"] == {"listen": [endpoint], "connect": []}
        assert vbus("ls").stdout == f"router: process {listed['pid']}, {endpoint}\n"
        again = vbus("router", "--listen", endpoint, "--detach")
        assert (again.returncode, again.stderr) == (
            4, 'vbus: a "router" runs already in the background; "vbus stop router" stops it\n',
        )  # fmt: skip
        joined = vbus("exec", "--join", "router", "--", "true")
        assert "router has no link a program could join by" in joined.stderr
        assert vbus("logs", "router").stdout.startswith(f"router: {endpoint}\n")
    finally:
        stopped = vbus("stop", "router")
    assert stopped.returncode == 0, stopped.stderr
    assert vbus("ls").stdout == "no board is running\n"


def test_a_router_whose_endpoint_is_taken_says_so_and_is_not_left_behind(runtime: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        done = vbus("router", "--listen", endpoint, "--detach")
    assert done.returncode == 4
    assert f"{endpoint}" in done.stderr
    assert "in use" in done.stderr
    assert vbus("ls").stdout == "no board is running\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("verb", ["run", "router", "attach", "up", "scope"])
def test_what_serves_until_ctrl_c_ends_with_0(
    verb: str, number: signal.Signals, board: Path, runtime: Path, tmp_path: Path
) -> None:
    journal = tmp_path / "run.vbj"
    machine = tmp_path / "machine.toml"
    machine.write_text(LM629.replace("[chips.x]", '[nodes.a]\n\n[chips.x]\nnode = "a"'))
    words = {
        "run": ["run", str(board), "--journal", str(journal)],
        "router": ["router", "--listen", free_endpoint()],
        "attach": ["attach", f"unix:{runtime}/bench.sock", "--pty", "here"],
        "up": ["up", str(machine)],
        "scope": ["scope", "bench", "--listen", "127.0.0.1:0"],
    }[verb]
    if verb in ("attach", "scope"):
        board.write_text(LM629.replace("pty:$VBUS_RUNTIME/x", "unix:$VBUS_RUNTIME/bench.sock"))
        assert vbus("run", str(board), "--detach").returncode == 0
    process = start(*words)
    assert process.stdout is not None
    try:
        begun = next(line for line in process.stdout if line.startswith(("ready", "scope: http")))
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        if verb in ("attach", "scope"):
            vbus("stop", "bench")
    assert process.returncode == 0, begun + out + err
    assert "Traceback" not in err
    if verb == "run":
        assert vbus("replay", str(journal)).returncode == 0  # whole: it was closed


@pytest.mark.parametrize("by", ["SIGINT", "vbus stop"])
def test_a_board_in_the_background_ends_in_order(by: str, board: Path, tmp_path: Path) -> None:
    journal = tmp_path / "run.vbj"
    done = vbus("run", str(board), "--detach", "--journal", str(journal))
    process = int(done.stdout.splitlines()[0].split()[-1])
    if by == "SIGINT":
        ended = os.pidfd_open(process)
        os.kill(process, signal.SIGINT)
        until(lambda: select.select([ended], [], [], 0)[0], "the end of the board")
        os.close(ended)
    else:
        stopped = vbus("stop", "bench")
        assert (stopped.returncode, stopped.stderr) == (0, "")
    assert vbus("ls").stdout == "no board is running\n"
    assert vbus("replay", str(journal)).returncode == 0  # whole: it was closed


def test_it_has_left_terminal_session_and_input(detached: Done) -> None:
    process = int(detached.stdout.splitlines()[0].split()[-1])

    assert os.getsid(process) == process
    assert os.readlink(f"/proc/{process}/fd/0") == os.devnull


def test_stop_ends_a_board_that_stands_still_and_does_not_answer(detached: Done) -> None:
    process = int(detached.stdout.splitlines()[0].split()[-1])
    os.kill(process, signal.SIGSTOP)

    listed = vbus("ls", "bench", "--json")
    seen = vbus("ls").stdout
    stopped = vbus("stop", "bench")

    assert seen == f"bench: does not answer (timed out); it is process {process}\n"
    (board,) = json.loads(listed.stdout)
    assert (listed.returncode, listed.stderr) == (4, "")
    error = "bench: does not answer (timed out)"
    assert board == {"board": "bench", "pid": process, "error": error}
    assert stopped.returncode == 0, stopped.stderr
    assert vbus("ls").stdout == "no board is running\n"


def test_a_log_is_followed_while_the_board_cannot_answer_and_to_its_last_word(
    board: Path, tmp_path: Path
) -> None:
    report = tmp_path / "c.html"
    begun = _short_of_space(4096, "run", str(board), "--detach", "--coverage", str(report))
    process = int(begun.stdout.splitlines()[0].split()[-1])
    os.kill(process, signal.SIGSTOP)
    follows = start("logs", "bench", "--follow")
    assert follows.stdout is not None
    seen = ""
    while "ready; " not in seen:
        seen += follows.stdout.readline()
    assert vbus("ls", "bench").returncode == 4  # it has had its time to answer
    assert vbus("stop", "bench").returncode == 1
    out, err = follows.communicate(timeout=60)
    assert (out.endswith(f"{report}: cannot be written: File too large\n"), err) == (True, "")


def test_stop_returns_when_the_board_has_ended(board: Path, tmp_path: Path, runtime: Path) -> None:
    journal = tmp_path / "run.vbj"
    done = vbus("run", str(board), "--detach", "--journal", str(journal))
    process = int(done.stdout.splitlines()[0].split()[-1])

    assert vbus("stop", "bench").returncode == 0

    with suppress(FileNotFoundError, ProcessLookupError):
        assert Path(f"/proc/{process}/stat").read_text().split()[2] == "Z"
    assert not (runtime / "x").is_symlink()
    assert vbus("replay", str(journal)).returncode == 0
    assert vbus("logs", "bench").stdout.startswith("bench: ")


def test_a_board_that_cannot_start_says_why_with_its_own_code(detached: Done, board: Path) -> None:
    again = vbus("run", str(board), "--detach")

    assert again.returncode == 4
    assert 'a board called "bench" runs already' in again.stderr
    assert vbus("logs", "bench").stdout.endswith("ready; Ctrl-C stops it\n"), "the other's"
    board.write_text(LM629.replace("LM629N-8", "LM630"))
    wrong = vbus("run", str(board), "--detach")
    assert wrong.returncode == 3
    assert "unknown part" in wrong.stderr


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["stop", "bench"], 'no board called "bench" runs; "vbus ls" shows which run'),
        (["wait", "bench", "--timeout", "0"], 'no board called "bench" is ready within 0 s'),
        (["logs", "bench"], 'no board called "bench" was started with --detach'),
    ],
)
def test_a_board_that_does_not_run_is_one_exit_code(command: list[str], message: str) -> None:
    done = vbus(*command)

    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr.startswith(f"vbus: {message}")


def test_nodes_are_stopped_one_by_one_or_all(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text(
        '[board]\ntime = "lockstep"\n[nodes.a]\n[nodes.b]\n'
        + "".join(
            f'[chips.{name}]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\nnode = "{node}"\n'
            for name, node in (("x", "a"), ("y", "b"))
        )
        + '[[hosts]]\ntransport = "pty:$VBUS_RUNTIME/x"\nchips = ["x"]\n'
    )

    done = vbus("run", str(path), "--detach")

    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith('ready; "vbus stop two" stops it\n')
    assert vbus("stop", "two").returncode == 0
    assert vbus("ls").stdout == "no board is running\n"


def test_systemd_is_told_once_that_the_board_is_ready(board: Path, tmp_path: Path) -> None:
    place = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as told:
        told.bind(str(place))
        told.settimeout(PATIENCE)
        with subprocess.Popen(
            [sys.executable, "-m", "vbus", "run", str(board)],
            env={**os.environ, "NOTIFY_SOCKET": str(place)}, stdout=subprocess.DEVNULL,
        ) as process:  # fmt: skip
            assert told.recv(100).decode() == f"READY=1\nMAINPID={process.pid}\n"
            process.terminate()
        told.setblocking(False)
        with pytest.raises(BlockingIOError):
            told.recv(100)


# -- hosts that come first ------------------------------------------------------------------------


def test_a_host_may_come_before_its_board(board: Path, runtime: Path) -> None:
    found = []
    host = threading.Thread(
        target=lambda: found.append(connect(f"pty:{runtime}/x", wait="60 s").read(0))
    )
    host.start()
    vbus("run", str(board), "--detach")
    host.join()
    vbus("stop", "bench")

    assert found[0] in (0x00, 0x84, 0xC4)


def test_a_host_gives_up_in_time(runtime: Path) -> None:
    with pytest.raises(TransportError, match="no such name; is the board running"):
        connect(f"pty:{runtime}/x", wait="50 ms")
    with pytest.raises(TransportError, match="no such name; is the board running"):
        asyncio.run(aio.connect(f"unix:{runtime}/x", wait="50 ms"))
    with pytest.raises(ValueError, match="no duration"):
        connect(f"pty:{runtime}/x", wait="soon")


def test_a_board_that_has_begun_to_start_is_waited_for(runtime: Path) -> None:
    name = runtime / "x"
    assert not starting(f"pty:{name}")
    lock = NameLock(name)
    lock.take()

    assert starting(f"pty:{name}")
    assert starting(str(name))
    assert not starting("tcp:127.0.0.1:5000")
    name.touch()
    assert not starting(f"pty:{name}"), "it is there"
    name.unlink()
    lock.give_back()
    assert not starting(f"pty:{name}")


def test_a_runtime_directory_that_is_not_set_is_the_same_for_board_and_host(
    board: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("VBUS_RUNTIME")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    vbus("run", str(board), "--detach")

    with connect("pty:$VBUS_RUNTIME/x") as bus:
        assert bus.link.where == f"pty:{tmp_path}/vbus/x"
    assert vbus("stop", "bench").returncode == 0


HOST_IN_C = r"""
#define _POSIX_C_SOURCE 200809L
#include "vbus.h"
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

int poll(struct pollfd *wanted, nfds_t count, int wait_ms) /* what vbus.c calls between attempts */
{
    static int told;
    struct timespec pause = {0, 10000000};

    (void)wanted, (void)count, (void)wait_ms;
    if (!told++)
        puts("waiting");
    fflush(stdout);
    return nanosleep(&pause, NULL);
}

int main(int count, char **arguments)
{
    struct vbus bus;
    int error = count > 2 ? vbus_open_wait(&bus, arguments[1], atoi(arguments[2]))
                          : vbus_open(&bus, arguments[1]);

    puts(error < 0 ? vbus_strerror(error) : "open");
    fflush(stdout);
    vbus_close(&bus);
    return 0;
}
"""


@pytest.fixture(scope="module")
def host_in_c(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A host in C that says when it begins to wait, and what came of it."""
    require("cc")
    folder = tmp_path_factory.mktemp("host")
    (folder / "host.c").write_text(HOST_IN_C)
    flags = vbus("cflags").stdout.split()
    subprocess.run(
        ["cc", "-Wall", "-Werror", "-o", folder / "host", folder / "host.c", *flags], check=True
    )
    return str(folder / "host")


def test_a_host_in_c_may_come_before_its_board(board: Path, runtime: Path, host_in_c: str) -> None:
    late = subprocess.run([host_in_c, f"pty:{runtime}/x", "20"], capture_output=True, text=True)
    with subprocess.Popen(
        [host_in_c, f"pty:{runtime}/x", "60000"], stdout=subprocess.PIPE, text=True
    ) as host:
        vbus("run", str(board), "--detach")
        assert host.communicate()[0].endswith("open\n")
    vbus("stop", "bench")

    assert late.stdout.startswith("waiting\na system call failed")


@pytest.mark.parametrize("kind", ["unix:", "pty:", ""])
def test_a_host_in_c_waits_for_a_board_that_has_begun_to_start(
    kind: str, runtime: Path, host_in_c: str
) -> None:
    name = runtime / "x"
    nobody = subprocess.run([host_in_c, f"{kind}{name}"], capture_output=True, text=True)
    lock = NameLock(name)
    lock.take()
    once = subprocess.run([host_in_c, f"{kind}{name}", "0"], capture_output=True, text=True)
    with (
        socket.socket(socket.AF_UNIX) as board,
        subprocess.Popen([host_in_c, f"{kind}{name}"], stdout=subprocess.PIPE, text=True) as host,
    ):
        assert host.stdout is not None
        assert host.stdout.readline() == "waiting\n"
        if kind == "unix:":
            board.bind(str(name))
            board.listen()
        else:
            terminal = os.openpty()
            name.symlink_to(os.ttyname(terminal[1]))
        assert host.stdout.readline() == "open\n"
        if kind != "unix:":
            os.close(terminal[0])
            os.close(terminal[1])
    lock.give_back()

    assert nobody.stdout.startswith("a system call failed"), "nobody has the name"
    assert once.stdout.startswith("a system call failed"), "a time of 0 is one attempt"


def test_a_host_in_c_gives_up_when_the_board_that_was_starting_has_died(
    runtime: Path, host_in_c: str
) -> None:
    lock = NameLock(runtime / "x")
    lock.take()
    with subprocess.Popen(
        [host_in_c, f"pty:{runtime}/x"], stdout=subprocess.PIPE, text=True
    ) as host:
        assert host.stdout is not None
        assert host.stdout.readline() == "waiting\n"
        lock.give_back()
        assert host.stdout.readline().startswith("a system call failed")


# -- systemd's sockets ----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["unix", "tcp"])
def test_a_host_may_connect_to_a_socket_that_systemd_has_opened(
    kind: str, board: Path, tmp_path: Path
) -> None:
    family = socket.AF_UNIX if kind == "unix" else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as opened:
        opened.bind(str(tmp_path / "x.sock") if kind == "unix" else ("127.0.0.1", 0))
        opened.listen()
        name = opened.getsockname()
        link = f"unix:{name}" if kind == "unix" else f"tcp:127.0.0.1:{name[1]}"
        board.write_text(LM629.replace("pty:$VBUS_RUNTIME/x", link))
        with socket.socket(family, socket.SOCK_STREAM) as host:
            host.settimeout(60)
            host.connect(name)
            host.sendall(b"\x02\x07")  # ECHO, before there is a board
            script = f'exec 3<&{opened.fileno()}; LISTEN_FDS=1 LISTEN_PID=$$ exec "$@"'
            with subprocess.Popen(
                ["bash", "-c", script, "bash", sys.executable, "-m", "vbus", "run", str(board)],
                pass_fds=[opened.fileno()], stdout=subprocess.DEVNULL,
            ) as process:  # fmt: skip
                assert host.recv(2) == b"E\x07"
                process.terminate()
        if kind == "unix":
            assert Path(name).exists(), "the name is systemd's"


def test_what_was_handed_to_another_process_is_left_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("LISTEN_FDS", "1")
    monkeypatch.setenv("LISTEN_PID", str(os.getpid() + 1))
    assert handed_over(socket.AF_UNIX, str(tmp_path / "x")) is None
    monkeypatch.setenv("LISTEN_PID", str(os.getpid()))
    assert handed_over(socket.AF_UNIX, str(tmp_path / "x")) is None
    monkeypatch.setenv("LISTEN_FDS", "many")
    assert handed_over(socket.AF_UNIX, str(tmp_path / "x")) is None
