"""A board on the network as a terminal here: drivers that know nothing of Zenoh use it."""

import os
import select
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.e2e.attaching import attached
from tests.e2e.command import vbus
from tests.e2e.serving import served
from tests.e2e.test_leases import in_process, outcome, servo
from tests.e2e.test_pty import open_raw, read_exactly
from tests.unit.native.conftest import compile_c
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import Processes, connected_to
from tests.zenoh.test_bus import board
from vbus.client import connect
from vbus.protocols.requests import REQUESTS
from vbus.serve.registry import ask, order, socket_path
from vbus.serve.server import LinkSpec

POLLING_HOST = Path(__file__).parents[1] / "e2e" / "polling_host.c"
PTY = "pty:$VBUS_RUNTIME/near"
UNIX = "unix:$VBUS_RUNTIME/near.sock"
ECHO = REQUESTS["ECHO"]


@contextmanager
def host_at(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX) as host:
        host.settimeout(60)
        host.connect(str(path))
        host.sendall(ECHO.pack(1))
        assert host.recv(2) == b"E\x01"
        yield host


@pytest.fixture(scope="module")
def polling_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("polling") / "polling_host"
    compile_c(["gcc", "-std=c99"], POLLING_HOST, program)
    return program


@pytest.mark.parametrize("options", [(), ("leases", "posting")])
def test_a_driver_in_c_polls_as_often_as_beside_the_board(
    polling_host: Path, options: tuple[str, ...], runtime: Path
) -> None:
    made = servo()
    with served(made, LinkSpec("zenoh:")), attached("zenoh:board", PTY) as here:
        done = subprocess.run(
            [polling_host, f"{runtime}/near", *options],
            capture_output=True, text=True, timeout=120, check=True,
        )  # fmt: skip
        assert here.round_trips >= (3 if options else 1000)
    assert outcome(made, [int(line) for line in done.stdout.split()]) == in_process()


def test_one_chip_claims_and_edges_on_a_terminal(runtime: Path) -> None:
    with served(board(), LinkSpec("zenoh:")) as server:
        with attached("zenoh:bench/y", PTY, UNIX), connect(PTY) as bus, connect(UNIX) as other:
            assert [chip.name for chip in bus.info.chips] == ["y"]
            bus.events("HI")
            bus.pin("/RST", 0)
            bus.delay("1ms")
            bus.pin("/RST", 1)
            bus.delay("2ms")
            bus.echo()
            with bus.claim(), socket.socket(socket.AF_UNIX) as waiting:
                waiting.connect(str(runtime / "near.sock"))
                waiting.sendall(REQUESTS["CLAIM"].pack())
                assert select.select([waiting], [], [], 0.3)[0] == []
            assert other.echo(4) == 4
            assert server.statistics()["sessions"] >= 2
        until(lambda: server.statistics()["sessions"] == 0, "sessions are left")


def test_a_client_here_waits_as_long_as_somebody_has_paused_the_board(runtime: Path) -> None:
    told: list[int] = []
    with served(board(), LinkSpec("zenoh:")) as server, attached("zenoh:bench/x", PTY):
        with connect(PTY) as bus:
            order("bench", "pause")
            until(bus.link.paused, "word of the pause")
            bus.timeout = 1.0
            host = threading.Thread(target=lambda: told.append(bus.read(0)))
            host.start()
            host.join(2.5)
            assert (host.is_alive(), told) == (True, [])
            bus.timeout = PATIENCE
            order("bench", "go")
            host.join(60)
            assert len(told) == 1
            until(lambda: not bus.link.paused(), "word that it goes on")
        assert server.board.reads == 1


def test_what_is_sent_and_left_to_itself_is_carried_out(runtime: Path) -> None:
    with served(board(), LinkSpec("zenoh:")) as server, attached("zenoh:bench/x", PTY):
        fd = open_raw(runtime / "near")
        os.write(fd, b"\x20\x1f" + REQUESTS["DELAY"].pack(10**9) + b"\x21\x00" * 2)
        os.close(fd)
        fd = open_raw(runtime / "near")
        os.write(fd, b"\x10")
        assert read_exactly(fd, 1) == b"D"
        os.close(fd)
        until(lambda: server.statistics()["sessions"] == 0, "sessions are left")
        assert [chip["writes"] for chip in server.statistics()["chips"]] == [3, 0]


def test_a_board_that_is_late_is_asked_again_and_answers_once(
    processes: Processes, runtime: Path
) -> None:
    running = processes.board()
    with attached("zenoh:bench/x?patience=60", PTY) as here:
        fd = open_raw(runtime / "near")
        os.write(fd, ECHO.pack(0))
        assert read_exactly(fd, 2) == b"E\x00"
        for number in range(2):
            running.send(signal.SIGSTOP)
            os.write(fd, b"\x10" * 40 + ECHO.pack(number))
            assert select.select([fd], [], [], 1.2)[0] == []  # long enough to be asked again
            running.send(signal.SIGCONT)
            answers = read_exactly(fd, 82)
            assert answers[0:80:2] == b"D" * 40
            assert answers[80:] == bytes((ord("E"), number))
        os.close(fd)
        assert (here.lost, here.reconnections) == (0, 0)
    assert [chip["reads"] for chip in ask(socket_path("bench"))["chips"]] == [80, 0]


def test_a_board_that_is_killed_is_said_so_and_found_again(
    processes: Processes, runtime: Path
) -> None:
    _, endpoint = processes.router()
    running = processes.board("bench", connected_to(endpoint))
    with attached(f"zenoh:bench?connect={endpoint}&patience=0.5", UNIX) as here:
        with host_at(runtime / "near.sock") as host, host_at(runtime / "near.sock") as other:
            running.stop(signal.SIGKILL)
            host.sendall(b"\x10")
            assert (host.recv(2), other.recv(2)) == (b"", b"")
        until(lambda: not (runtime / "near.sock").exists(), lambda: here.said)
        reason = 'zenoh:bench: no board called "bench" is on the network of'
        assert here.said[0].startswith(reason)
        assert "the host at unix:" in here.said[0]
        assert sum("; answers lost: 1" in sentence for sentence in here.said) == 1
        listed = vbus("ls", "near").stdout
        assert f"attached to zenoh:bench?connect={endpoint}" in listed
        assert "lost: zenoh:bench: no board called" in listed
        again = processes.board("bench", connected_to(endpoint))
        until((runtime / "near.sock").exists, lambda: here.said)
        with connect(UNIX) as bus:
            assert bus.info.board == "bench"
        assert (here.lost, here.reconnections) == (1, 1)

        with host_at(runtime / "near.sock") as idle:  # asks nothing, and is told all the same
            again.stop()
            assert idle.recv(2) == b""
        assert here.lost == 1
