"""How a session ends: the host closes one way only, a protocol is broken, a link is overrun."""

import logging
import os
import socket
import threading
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import open_raw, read_exactly, toy_board, wait_for_sessions
from tests.unit.board.toy import Toy
from tests.waiting import PATIENCE, until
from vbus import client
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.core.signals import Observer
from vbus.protocols.byte import ByteProtocol
from vbus.serve.registry import ask, socket_path
from vbus.serve.server import LinkSpec

UNIX = LinkSpec("unix:$VBUS_RUNTIME/x", "byte")
PTY = LinkSpec("pty:$VBUS_RUNTIME/y", "byte")
INTERPRETED = pytest.mark.core("interpreted")


def connect(path: Path) -> socket.socket:
    link = socket.socket(socket.AF_UNIX)
    link.settimeout(PATIENCE)
    link.connect(str(path))
    return link


def test_a_host_that_closes_its_sending_side_still_gets_every_reply(runtime: Path) -> None:
    reads = 900
    quick = LinkSpec("unix:$VBUS_RUNTIME/x", "byte", cycle_ps=1000)
    with served(toy_board(), quick) as server, connect(runtime / "x") as link:
        link.sendall(b"\x32\x01\xff" * reads)
        link.shutdown(socket.SHUT_WR)
        until(
            lambda: ask(socket_path("bench"))["links"][0]["received"] == 3 * reads,
            "all requests, before an answer is read",
        )

        answer = b""
        while data := link.recv(65536):
            answer += data
        assert len(answer) == 257 * reads, "a little more than the socket holds"
        wait_for_sessions(server, 0)


@pytest.mark.parametrize("behind", [b"", b"\x02\x01", b"\x10" * 5000])
def test_a_host_that_dies_during_a_long_delay_is_noticed_at_once(
    runtime: Path, behind: bytes
) -> None:
    """An hour of real time is asked for with the bus held; another host gets the bus now."""
    board = Board("bench", "realtime")
    board.add_chip(Toy, "t0", "TOY", 8_000_000)
    board.power_on()
    hour = (3600 * 10**12).to_bytes(8, "big")
    with served(board, UNIX) as server, connect(runtime / "x") as second:
        with connect(runtime / "x") as first:
            first.sendall(b"\x04")
            assert first.recv(2) == b"C\x01"
            first.sendall(b"\x50" + hour + behind)
            second.sendall(b"\x04")  # waits for the first one's bus
            with connect(runtime / "x") as third:
                third.sendall(b"\x04")  # and so does this one, which gives up
                wait_for_sessions(server, 3)
            wait_for_sessions(server, 2)
        assert second.recv(2) == b"C\x01"
        wait_for_sessions(server, 1)


@pytest.mark.parametrize(
    ("method", "policy", "request_"),
    [
        # Compiled sessions call these without a look at what a test has put there.
        pytest.param("receive", "lockstep", b"\x11", marks=INTERPRETED),
        pytest.param(
            "resume", "lockstep", b"\x50" + (10**13).to_bytes(8, "big"), marks=INTERPRETED
        ),
        ("report_events", "realtime", b"\x20\xc8"),
    ],
)
def test_a_bug_in_a_protocol_ends_that_session_and_says_so(
    runtime: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    method: str,
    policy: str,
    request_: bytes,
) -> None:
    caplog.set_level(logging.ERROR, "vbus")
    with served(toy_board(policy=policy), UNIX, PTY) as server:
        other = open_raw(runtime / "y")
        os.write(other, b"\x02\x01")
        assert read_exactly(other, 2) == b"E\x01"
        with connect(runtime / "x") as link:
            link.sendall(b"\x02\x02")
            assert link.recv(9) == b"E\x02"
            with monkeypatch.context() as broken:
                if method == "report_events":  # which the request itself calls too
                    link.sendall(b"\x60\x00\x00\x00\x01\x02\x03")
                    assert link.recv(9) == b"E\x03"
                broken.setattr(ByteProtocol, method, broken_method)
                link.sendall(request_)
                while link.recv(100):
                    pass
        wait_for_sessions(server, 1)
        os.write(other, b"\x02\x03")
        assert read_exactly(other, 2) == b"E\x03"
        os.close(other)
    [record] = [record for record in caplog.records if record.name == "vbus"]
    assert record.getMessage() == (
        f"internal error while serving unix:{runtime}/x; its session ends, the board goes on"
    )
    assert record.exc_info is not None
    assert str(record.exc_info[1]) == "a bug"


def broken_method(self: ByteProtocol, data: bytes = b"") -> None:
    raise RuntimeError("a bug")


def test_a_host_that_asks_for_events_and_does_not_read_them_is_hung_up_on(
    runtime: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("vbus.serve.session.MOST_EVENTS", 2000)
    edges = (b"\x20\x00\x50" + (2_000_000).to_bytes(8, "big")) * 100
    with served(toy_board(), UNIX) as server, connect(runtime / "x") as deaf:
        deaf.sendall(b"\x60\x00\x00\x00\x01\x02\x01")
        assert deaf.recv(2) == b"E\x01"
        with connect(runtime / "x") as busy:
            wait_for_sessions(server, 2)
            for _ in range(1000):
                busy.sendall(edges + b"\x02\x05")
                assert busy.recv(2) == b"E\x05"
                if len(server.hosts[0].sessions) == 1:
                    break
            wait_for_sessions(server, 1)
            busy.sendall(b"\x02\x06")
            assert busy.recv(2) == b"E\x06", "the others are served on"
        while deaf.recv(65536):
            pass
    [record] = [record for record in caplog.records if record.name == "vbus"]
    assert "bytes of events wait for a host that does not read them; its session ends" in (
        record.getMessage()
    )


def test_a_host_that_waits_costs_one_descriptor(runtime: Path) -> None:
    with served(toy_board(), UNIX) as server, ExitStack() as closing:
        links = [closing.enter_context(connect(runtime / "x")) for _ in range(20)]
        wait_for_sessions(server, 20)
        links[0].sendall(b"\x04")
        assert links[0].recv(2) == b"C\x01"
        before = len(os.listdir("/proc/self/fd"))
        for link in links[1:]:
            link.sendall(b"\x04")
        sessions = server.hosts[0].sessions
        until(lambda: sum(session.port.held for session in sessions) == 19, "all others wait")
        assert len(os.listdir("/proc/self/fd")) == before


class Stumbling(Observer):
    """Looks at a net, and breaks when it moves."""

    armed = False

    def edge(self, when: int, net: str, level: int) -> None:
        if self.armed:
            raise RuntimeError("stumbled")


def test_whatever_a_board_does_when_a_host_goes_its_link_and_its_claim_are_free(
    runtime: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.ERROR, "vbus")
    board = load_board_text(
        '[board]\nname = "bench"\ntime = "lockstep"\n'
        '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
    )
    observer = Stumbling()
    board.chip("x").pins["/RST"].net.observe(observer)
    with (
        served(board, UNIX, PTY) as server,
        client.connect(f"unix:{runtime}/x") as second,
        client.connect(f"pty:{runtime}/y") as first,
    ):
        message = client.Message(first.info)
        message.claim()
        message.pin("/RST", 0)
        first.exchange(message, None)
        claiming = client.Message(second.info)
        claiming.claim()
        waiting = threading.Thread(target=second.exchange, args=(claiming, None))
        waiting.start()
        until(lambda: server.hosts[0].sessions[0].port.held, "the claim is waited for")
        observer.armed = True
        first.link.close()
        waiting.join(PATIENCE)
        assert not waiting.is_alive()
        observer.armed = False
        with client.connect(f"pty:{runtime}/y") as third:
            assert third.echo(7) == 7
        wait_for_sessions(server, 1)
        assert len(board.ports) == 1
    [record] = [record for record in caplog.records if record.name == "vbus"]
    assert record.message.startswith(f"internal error while the session of {runtime / 'y'} ended")
