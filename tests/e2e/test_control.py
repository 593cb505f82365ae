"""Orders to a running board: a line of JSON in, a message out, and nothing said there harms it."""

import asyncio
import ctypes
import json
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.waiting import PATIENCE
from vbus.board.build import load_board_text
from vbus.core.errors import TransportError, VbusError
from vbus.serve.registry import order, running, socket_path
from vbus.serve.server import ServedRun, Server

BOARD = """\
[board]
name = "bench"
time = "lockstep"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""


@contextmanager
def served(**orders: Any) -> Iterator[Server]:
    """A board served in a thread, with orders of the test's own."""
    server = Server(load_board_text(BOARD), [])
    server.control.orders |= orders
    ready = threading.Event()
    ends: list[Any] = []

    async def main() -> None:
        stop = asyncio.Event()
        ends.append((asyncio.get_running_loop(), stop))
        await ServedRun([server]).serve(stop, ready.set)

    thread = threading.Thread(target=lambda: asyncio.run(main()))
    thread.start()
    try:
        assert ready.wait(60)
        yield server
    finally:
        loop, stop = ends[0]
        loop.call_soon_threadsafe(stop.set)
        thread.join(PATIENCE)


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))


def answer_of(link: socket.socket) -> bytes:
    with link.makefile("rb") as answers:
        return answers.read(int.from_bytes(answers.read(4), "little"))


def add(request: dict[str, Any]) -> int:
    return int(request["a"] + request["b"])


def refuse(request: dict[str, Any]) -> None:
    raise ValueError("not today")


def broken(request: dict[str, Any]) -> None:
    raise RuntimeError("inside")


def test_an_order_is_carried_out_and_its_result_comes_back() -> None:
    with served(add=add):
        assert order("bench", "add", a=2, b=3) == 5
        assert order("bench", "add", a=-1, b=1) == 0


@pytest.mark.parametrize(
    ("do", "says"),
    [
        ("refuse", "bench: not today"),
        ("add", "bench: 'a' is missing"),
        ("jump", 'there is no order "jump"; there is .*add, refuse'),
        ("broken", "internal error"),
    ],
)
def test_what_is_refused_says_why_and_the_board_goes_on(
    do: str, says: str, caplog: pytest.LogCaptureFixture
) -> None:
    with served(add=add, refuse=refuse, broken=broken):
        with pytest.raises(VbusError, match=says):
            order("bench", do)
        assert order("bench", "add", a=1, b=1) == 2


@pytest.mark.parametrize("line", [b"garbage\n", b"[]\n", b'{"do": 3}\n', b"\xff\n"])
def test_garbage_is_answered_with_an_error(line: bytes) -> None:
    with served(add=add):
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(60)
            link.connect(str(socket_path("bench")))
            link.sendall(line)
            assert "error" in json.loads(answer_of(link))
        assert order("bench", "add", a=1, b=1) == 2


def test_who_hangs_up_in_the_middle_leaves_nothing_behind() -> None:
    with served(add=add) as server:
        with socket.socket(socket.AF_UNIX) as link:
            link.connect(str(socket_path("bench")))
            link.sendall(b'{"do": "ad')
        assert order("bench", "add", a=1, b=1) == 2
        assert order("bench", "add", a=1, b=1) == 2
    assert not server.local_socket.connections
    assert not socket_path("bench").exists()


SET_USERS = {"x86_64": (117, 122), "aarch64": (147, 151)}
"""Linux's numbers of setresuid and setfsuid, which are of one thread when called by number."""


def answer_to_a_stranger() -> bytes:
    """Return what user 65534 is answered at the socket."""
    answers = []

    def ask() -> None:
        system = ctypes.CDLL(None).syscall
        users, files = SET_USERS[os.uname().machine]
        assert system(users, -1, 65534, -1) == 0
        system(files, 0)  # the way to the socket is open: what counts is who connects
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(60)
            link.connect(str(socket_path("bench")))
            link.sendall(b'{"do": "add", "a": 1, "b": 1}\n')
            answers.append(answer_of(link))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join(60)
    return answers[0]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be somebody else")
def test_orders_of_another_user_are_refused_in_a_sentence() -> None:
    with served(add=add):
        assert json.loads(answer_to_a_stranger()) == {
            "error": "this board takes orders from root, who runs it; you are user 65534"
        }
        assert order("bench", "add", a=1, b=1) == 2


def test_the_user_who_runs_a_board_and_root_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with served(add=add):
        monkeypatch.setattr("vbus.serve.local_socket.user_behind", lambda fd: 1001)
        monkeypatch.setattr("vbus.serve.local_socket.os.geteuid", lambda: 1000)
        with pytest.raises(VbusError, match="from user 1000, who runs it, and from root; you are"):
            order("bench", "add", a=1, b=1)


def test_a_board_that_does_not_run_is_named() -> None:
    with pytest.raises(TransportError, match='no board called "other" takes orders'):
        order("other", "add")


def test_who_asks_for_the_status_and_does_not_read_it_stops_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    status = {"board": "bench", "padding": "x" * 5_000_000}
    monkeypatch.setattr(Server, "statistics", lambda self: status)
    with served(add=add), socket.socket(socket.AF_UNIX) as link:
        link.settimeout(60)
        link.connect(str(socket_path("bench")))
        link.sendall(b'{"do": "status"}\n')
        assert order("bench", "add", a=1, b=1) == 2
        assert json.loads(answer_of(link)) == {"done": status}


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"[" * 200_000, "nested too deeply"),
        (b"[1]", "none of a board"),
        (b'{"done": {"name": "x"}}', "names no board"),
        (b"x" * 5000, "more than 4096 bytes"),
        (None, "timed out"),
    ],
    ids=["deep", "list", "nameless", "endless", "slow"],
)
def test_a_socket_of_a_stranger_is_told_of_and_harms_nobody(
    answer: bytes | None, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if answer is None:
        monkeypatch.setattr("vbus.serve.registry.ANSWER_SECONDS", 0.1)
    if message.startswith("more than"):
        monkeypatch.setattr("vbus.serve.registry.LONGEST_ANSWER", 4096)
    ended = threading.Event()

    def talk() -> None:
        link, _ = stranger.accept()
        with link, suppress(OSError):
            link.recv(64)
            link.sendall((4096 if answer is None else len(answer)).to_bytes(4, "little"))
            if answer is not None:
                link.sendall(answer)
            while answer is None and not ended.wait(0.01):
                link.sendall(b" ")

    with socket.socket(socket.AF_UNIX) as stranger:
        stranger.bind(str(socket_path("strange")))
        stranger.listen()
        thread = threading.Thread(target=talk)
        thread.start()
        found = list(running())
        ended.set()
        thread.join(60)
    assert [board["board"] for board in found] == ["strange"]
    assert message in found[0]["error"]
