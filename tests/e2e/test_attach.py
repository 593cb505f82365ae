"""A board elsewhere as a PTY or a Unix socket here: the same bytes, told the same of its end."""

import os
import select
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from tests.e2e.attaching import attached
from tests.e2e.command import start, vbus
from tests.e2e.serving import served
from tests.e2e.test_leases import Outcome, in_process, outcome, servo
from tests.e2e.test_pty import open_raw, read_exactly, toy_board
from tests.waiting import until
from vbus.client import connect
from vbus.core.errors import NameInUseError, TransportError
from vbus.core.runtime import lock_state
from vbus.protocols.requests import REQUESTS
from vbus.serve.registry import ask, socket_path
from vbus.serve.server import LinkSpec, Server

FAR = {"tcp": LinkSpec("tcp:127.0.0.1:0"), "unix": LinkSpec("unix:$VBUS_RUNTIME/far.sock")}
PTY = "pty:$VBUS_RUNTIME/near"
UNIX = "unix:$VBUS_RUNTIME/near.sock"
ECHO = REQUESTS["ECHO"]
CLAIM = REQUESTS["CLAIM"].pack()
DELAY_1_MS = REQUESTS["DELAY"].pack(10**9)
WRITE, READ = b"\x21", b"\x11"
"""Of the toy's byte; reading it adds one to it."""


def link_of(server: Server, place: int = 0) -> str:
    return str(server.statistics()["links"][place]["url"])


@contextmanager
def socket_to(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as host:
        host.connect(str(path))
        host.settimeout(60)
        yield host


def received(host: socket.socket) -> bytes:
    """Return everything up to the end of a stream."""
    data = b""
    while part := host.recv(65536):
        data += part
    return data


@pytest.mark.parametrize("kind", FAR)
@pytest.mark.parametrize("link", [PTY, UNIX])
def test_a_board_elsewhere_is_a_link_here(kind: str, link: str, runtime: Path) -> None:
    with served(toy_board(), FAR[kind]) as server, attached(link_of(server), link) as here:
        with connect(link) as bus:  # which compares the name's board with that of HELLO
            assert bus.info.board == "bench"
            bus.write(1, 0x41)
            assert [bus.read(1) for _ in range(3)] == [0x41, 0x42, 0x43]
        assert here.round_trips == 4  # HELLO and three reads
        told = ask(socket_path("near"))
        assert told["attached"]["to"] == link_of(server)
        assert told["attached"]["board"] == "bench"
        assert told["links"][0]["received"] == 2 + 2 + 3
    assert not list(runtime.glob("*near*"))
    assert not list(runtime.glob("boards/near*"))


def test_a_terminals_name_is_locked_for_the_board_it_leads_to(runtime: Path) -> None:
    with served(toy_board(), FAR["tcp"]) as server, attached(link_of(server), PTY):
        assert lock_state(runtime / "near") == (True, f"{os.getpid()}\nbench")


@pytest.mark.parametrize("options", [(), ("leases", "posting")])
def test_a_driver_in_c_polls_as_often_as_one_in_process(
    polling_host: Path, options: tuple[str, ...], runtime: Path
) -> None:
    board = servo()
    with served(board, FAR["tcp"]) as server, attached(link_of(server), PTY):
        done = subprocess.run(
            [polling_host, f"{runtime}/near", *options],
            capture_output=True, text=True, timeout=60, check=True,
        )  # fmt: skip
    polls = [int(line) for line in done.stdout.split()]
    found: Outcome = outcome(board, polls)
    assert found == in_process()


def test_hosts_of_a_socket_have_a_session_each_and_claims_hold_between_them(runtime: Path) -> None:
    with served(toy_board(), FAR["unix"]) as server, ExitStack() as opened:
        opened.enter_context(attached(link_of(server), UNIX))
        hosts = [opened.enter_context(socket_to(runtime / "near.sock")) for _ in range(3)]
        for number, host in enumerate(hosts):
            host.sendall(ECHO.pack(number))
            assert host.recv(9) == bytes((ord("E"), number))
        assert server.statistics()["sessions"] == 3
        hosts[0].sendall(CLAIM)
        assert hosts[0].recv(9) == b"C\x01"
        for host in hosts[1:]:
            host.sendall(CLAIM + WRITE + b"\x07" + READ)
        assert select.select(hosts[1:], [], [], 0.2)[0] == []
        hosts[0].close()  # lets the claim go
        (first,), _, _ = select.select(hosts[1:], [], [], 60)
        assert first.recv(4, socket.MSG_WAITALL) == b"C\x01D\x07"


def test_a_host_that_sends_no_more_gets_all_its_answers(runtime: Path) -> None:
    count = 200_000  # more than all the buffers on the way hold
    with served(toy_board(), FAR["tcp"]) as server, ExitStack() as opened:
        opened.enter_context(attached(link_of(server), UNIX))
        host = opened.enter_context(socket_to(runtime / "near.sock"))

        def send() -> None:
            host.sendall(ECHO.pack(5) * count)
            host.shutdown(socket.SHUT_WR)

        sending = threading.Thread(target=send)
        sending.start()
        assert received(host) == b"E\x05" * count
        sending.join()


def test_what_a_host_has_sent_before_it_goes_is_done_before_the_next_one_begins(
    runtime: Path,
) -> None:
    with served(toy_board(), FAR["tcp"]) as server, attached(link_of(server), PTY):
        for value in (n * 37 & 255 for n in range(20)):
            fd = open_raw(runtime / "near")
            os.write(fd, WRITE + b"\x00" + DELAY_1_MS * 3 + WRITE + bytes((value,)))
            os.close(fd)
            fd = open_raw(runtime / "near")
            os.write(fd, READ)
            assert read_exactly(fd, 2) == bytes((ord("D"), value))
            os.close(fd)
        assert server.board.now >= 60 * 10**9


def test_a_host_is_told_that_the_board_has_gone_and_its_links_come_back_with_it(
    runtime: Path,
) -> None:
    with ExitStack() as opened:
        with served(toy_board(), FAR["unix"]) as server:
            here = opened.enter_context(attached(link_of(server), PTY, UNIX))
            holder = opened.enter_context(socket_to(runtime / "far.sock"))
            holder.sendall(CLAIM)  # and it holds it until the board has gone
            assert holder.recv(2) == b"C\x01"
            host = opened.enter_context(socket_to(runtime / "near.sock"))
            host.sendall(ECHO.pack(1) + CLAIM)
            assert host.recv(2) == b"E\x01"
            fd = open_raw(runtime / "near")
            os.write(fd, ECHO.pack(2))
            assert read_exactly(fd, 2) == b"E\x02"
        assert host.recv(9) == b""  # as from a board that stops
        assert select.select([fd], [], [], 60)[0]
        with pytest.raises(OSError, match="Input/output error"):
            os.write(fd, b"\x10")
        os.close(fd)
        until(lambda: not (runtime / "near").is_symlink(), lambda: here.said)
        assert not (runtime / "near.sock").exists()
        assert ask(socket_path("near"))["attached"]["state"].startswith("lost: unix:")
        assert here.lost == 1  # the claim's
        told = [sentence for sentence in here.said if "answers lost" in sentence]
        assert len(told) == 1
        assert told[0].startswith(f"unix:{runtime}/far.sock: closed by the other end; the host at")

        with served(toy_board(), FAR["unix"]):
            until((runtime / "near.sock").exists, lambda: here.said)
            with connect(PTY) as bus:
                assert bus.echo(3) == 3
            assert here.reconnections == 1
            assert here.said[-1].endswith("the board bench is back")


def test_a_board_that_ends_one_session_alone_is_not_gone(runtime: Path) -> None:
    with served(toy_board(), FAR["unix"]) as server, attached(link_of(server), UNIX) as here:
        with socket_to(runtime / "near.sock") as one, socket_to(runtime / "near.sock") as other:
            for host in (one, other):
                host.sendall(ECHO.pack(1))
                assert host.recv(2) == b"E\x01"
            session = server.hosts[0].sessions[0]
            server._loop.call_soon_threadsafe(session.hang_up_soon, "a fault")  # type: ignore[union-attr]
            # Which of them came to the board first is chance.
            (ended,), _, _ = select.select((one, other), (), (), 60)
            assert ended.recv(9) == b""
            still = other if ended is one else one
            still.sendall(ECHO.pack(2))
            assert still.recv(2) == b"E\x02"
        until(lambda: here.reconnections == 1, lambda: here.said)
        assert (runtime / "near.sock").exists()


def test_without_patience_it_ends_when_the_board_is_gone(runtime: Path) -> None:
    with served(toy_board(), FAR["unix"]) as server, ExitStack() as opened:
        here = opened.enter_context(attached(link_of(server), UNIX, patience=0))
        host = opened.enter_context(socket_to(runtime / "near.sock"))
        host.sendall(ECHO.pack(1))
        assert host.recv(2) == b"E\x01"
        server._loop.call_soon_threadsafe(server.stop)  # type: ignore[union-attr]
        assert host.recv(2) == b""
        until(here.ended.is_set, lambda: here.said)
        assert isinstance(here.failure, TransportError)
        # Its name goes a moment after its sessions.
        said = ("no such name; is the board running?", "closed by the other end")
        assert any(words in str(here.failure) for words in said)


def test_a_name_that_is_taken_is_refused_and_nothing_is_left(runtime: Path) -> None:
    with served(toy_board(), FAR["tcp"], LinkSpec(PTY)) as server:
        taken = pytest.raises(NameInUseError, match=r"near is in use by process \d+; stop it or")
        with taken, attached(link_of(server), UNIX, PTY):
            pass
        assert not (runtime / "near.sock").exists()
        runs = pytest.raises(NameInUseError, match=r'a board or attachment called "near" runs')
        with (
            attached(link_of(server), UNIX),
            runs,
            attached(link_of(server), "pty:$VBUS_RUNTIME/z"),
        ):
            pass


LINES = (
    "chips", "r 1", "w 1 41 42", "r 1 3", "r 9", "step 10ms", "now", "wait 5us", "pin TRIG 1",
    "pin TRIG", "pin NONE", "select all", "select z", "sample", "claim", "unclaim", "lines /CS=0",
    "drive 55", "release", "clock_step 1000", "names", "nonsense",
)  # fmt: skip


def transcript(path: Path) -> list[str]:
    with socket_to(path) as host:
        answers = []
        for line in LINES:
            host.sendall(f"{line}\n".encode())
            answer = b""
            while not answer.endswith(b"\n"):
                answer += host.recv(4096)
            answers.append(f"{line}: {answer.decode()}")
        return answers


def test_a_byte_link_elsewhere_speaks_text_here(runtime: Path) -> None:
    local = LinkSpec("unix:$VBUS_RUNTIME/text.sock", "text")
    with served(toy_board(), local):
        wanted = transcript(runtime / "text.sock")
    with (
        served(toy_board(), FAR["tcp"]) as server,
        attached(link_of(server), UNIX, protocol="text"),
    ):
        found = transcript(runtime / "near.sock")
    mistakes = ("pin NONE", "select z")  # whose sentences differ
    assert [one for one in found if not one.startswith(mistakes)] == [
        one for one in wanted if not one.startswith(mistakes)
    ]


def test_a_text_link_elsewhere_is_text_here_and_nothing_else(runtime: Path) -> None:
    text = LinkSpec("unix:$VBUS_RUNTIME/text.sock", "text")
    with served(toy_board(), text) as server:
        with attached(link_of(server), UNIX, protocol="text"):
            assert transcript(runtime / "near.sock")[1] == "r 1: 00\n"
        refused = pytest.raises(TransportError, match="speaks the text protocol, of which byte")
        with refused, attached(link_of(server), UNIX):
            pass


# -- the command ------------------------------------------------------------------------------


def test_the_command_is_listed_tells_how_far_the_board_is_and_is_stopped(runtime: Path) -> None:
    with served(toy_board("far"), FAR["tcp"]) as server:
        process = start("attach", link_of(server), "--pty", "axis", "--every", "0.1")
        assert process.stdout is not None
        lines = [process.stdout.readline().rstrip() for _ in range(4)]
        assert lines == [
            f"axis: process {process.pid}, attached to {link_of(server)} (board far, lockstep)",
            "  chip t: TOY",
            f"  link pty:{runtime}/axis: byte protocol, to t",
            "ready; Ctrl-C stops it",
        ]
        with connect(f"pty:{runtime}/axis") as bus:
            for _ in range(50):
                bus.read(0)
        listed = vbus("ls", "axis").stdout.splitlines()
        assert listed[0] == lines[0]
        assert listed[3].startswith("  51 answers, 51 round trips: p50 "), listed
        assert listed[3].endswith("; 0 answers lost, 0 reconnections")
        assert vbus("wait", "axis", "--timeout", "0").returncode == 0
        done = vbus("fault", "list", "axis")
        assert f"this is an attachment to {link_of(server)}, which takes no orders" in done.stderr
        assert vbus("stop", "axis").returncode == 0
        told, errors = process.communicate(timeout=60)
        assert (process.returncode, errors) == (0, "")
        assert told.splitlines()[-1] == listed[3].strip()
        assert any("round trips" in line for line in told.splitlines()[:-1])


def test_the_command_goes_on_where_nobody_reads_what_it_says(runtime: Path) -> None:
    with served(toy_board("far"), FAR["unix"]) as server:
        process = start("attach", link_of(server), "--pty", "axis")
        assert process.stdout is not None
        assert process.stderr is not None
        assert any(line.startswith("ready") for line in process.stdout)
        process.stderr.close()
        process.stderr = None
        fd = open_raw(runtime / "axis")
        os.write(fd, ECHO.pack(1))
        assert read_exactly(fd, 2) == b"E\x01"
    # Its board has gone: it says so, and hangs up.
    with suppress(OSError):  # so a terminal may say it
        assert os.read(fd, 1) == b""
    os.close(fd)
    until(lambda: not (runtime / "axis").exists(), "its link goes")
    with served(toy_board("far"), FAR["unix"]):
        until((runtime / "axis").exists, "its link is back")
        with connect(f"pty:{runtime}/axis") as bus:
            assert bus.info.board == "far"
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        assert process.returncode == 0


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["foo:bar"], 2, '"foo:bar" is no link of a board elsewhere; there are zenoh:BOARD/CHIP'),
        (["pty:/dev/pts/0"], 2, "is no link of a board elsewhere"),
        (["tcp:nowhere"], 2, "'tcp:nowhere' is no link; allowed is tcp:HOST:PORT"),
        (["unix:/nowhere"], 4, "unix:/nowhere cannot be opened: no such name; is the board"),
        (["unix:/nowhere", "--pty", ""], 2, '"" is no name for a link'),
    ],
)  # fmt: skip
def test_what_cannot_be_attached_is_one_sentence(
    arguments: list[str], code: int, told: str
) -> None:
    done = vbus("attach", *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert told in done.stderr
