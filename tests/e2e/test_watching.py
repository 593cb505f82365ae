"""Who watches a board is told what was left out, and nothing grows for whoever does not read."""

import json
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import toy_board
from tests.e2e.test_sessions import UNIX, connect
from tests.waiting import until
from vbus.cli.sources import Feed
from vbus.core.errors import VbusError
from vbus.serve.local_socket import Connection, WatchView
from vbus.serve.orders.watching import MOST_WAVE, WaveView
from vbus.serve.registry import socket_path
from vbus.serve.server import Server


def watch(**asked: Any) -> socket.socket:
    link = socket.socket(socket.AF_UNIX)
    link.settimeout(60)
    link.connect(str(socket_path("bench")))
    if asked:
        link.sendall(json.dumps({"do": "watch", **asked}).encode() + b"\n")
    return link


def watchers(server: Server) -> list[Connection]:
    return server.local_socket.connections


def messages(link: socket.socket) -> Iterator[Any]:
    with link.makefile("rb") as file:
        while head := file.read(4):
            yield json.loads(file.read(int.from_bytes(head, "little")))


def test_events_beyond_the_limit_are_counted_as_lost(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.serve.orders.watching.MOST_EVENTS", 5)
    with served(toy_board(), UNIX), watch(events={}) as link:
        told = messages(link)
        assert next(told) == {"done": {}}
        with connect(runtime / "x") as host:
            host.sendall(b"\x31\x01\x00" * 1000 + b"\x02\x01")  # one message: nothing goes between
            assert host.recv(2) == b"E\x01"
        kinds = []
        while kinds[-1:] != ["lost"]:
            *_, last = item = next(told)
            kinds.append(item[0])
    assert kinds.count("c") <= 10
    assert last + kinds.count("c") == 1000


@pytest.mark.parametrize(
    "asked", [{"events": {}}, {"scope": {}}, {"scope": {"samples": False}}, {"pins": {}}]
)
def test_a_board_is_not_looked_at_for_who_does_not_read(
    runtime: Path, monkeypatch: pytest.MonkeyPatch, asked: dict[str, Any]
) -> None:
    """What is stored has an end, and behind it hosts are served as if nobody watched."""
    monkeypatch.setattr("vbus.serve.orders.watching.MOST_PENDING", 1000)
    monkeypatch.setattr(WatchView, "most", 1000)
    monkeypatch.setattr("vbus.serve.orders.watching.MOST_EVENTS", 100)
    for pause in ("EVERY_SECONDS", "UNSEEN_SECONDS"):
        monkeypatch.setattr(f"vbus.serve.orders.watching.{pause}", 0.001)
    monkeypatch.setattr(WatchView, "pause", 0.001)
    board = toy_board()
    with served(board, UNIX) as server, watch(**asked) as link, connect(runtime / "x") as host:
        number = 0

        def drive() -> int:
            nonlocal number
            number += 1
            host.sendall(b"\x31\x01\x00" * 50 + bytes((0x02, number & 0xFF)))
            answer = b""
            while not answer.endswith(bytes((ord("E"), number & 0xFF))):
                answer += host.recv(4096)
            return max((len(one.pending) for one in watchers(server)), default=0)

        def observed() -> bool:
            return bool(board.observers or board.kernel.observed)

        until(observed, "the watcher")
        longest = 0
        while observed():
            longest = max(longest, drive())
        assert longest < 1000 + 100 * 1000, "one sending at most beyond the limit"
        stored = drive()
        assert all(drive() == stored for _ in range(20))
        link.settimeout(0.1)

        def told_again() -> bool:
            with suppress(TimeoutError):
                link.recv(1 << 20)
            return observed()

        until(told_again, "that who reads is told again")


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        ({"wave": {"signals": ["nothing"]}}, "nothing"),
        ({"pins": {"chip": "nothing"}}, 'no chip is called "nothing"'),
        ({"events": {"until": "x.nothing > 1"}}, "nothing"),
        ({"events": {"till": 1}}, "till"),
        ({"scope": {"after": -2}}, "after"),
        ({"everything": {}}, "one of these can be asked for: events, wave, scope, pins"),
        ({"scope": {}, "pins": {}}, "one of these can be asked for"),
        ({}, "one of these can be asked for"),
    ],
)
def test_what_makes_no_sense_is_refused_and_something_else_can_be_asked_for(
    runtime: Path, asked: Any, reason: str
) -> None:
    with served(toy_board(), UNIX), watch() as link:
        told = messages(link)
        link.sendall(json.dumps({"do": "watch", **asked}).encode() + b"\n")
        assert reason in next(told)["error"]
        link.sendall(b'{"do": "watch", "events": {}}\n')
        assert next(told) == {"done": {}}


def test_a_board_that_stops_before_it_answers_is_an_error(runtime: Path) -> None:
    with served(toy_board(), UNIX):
        feed = Feed("bench")
    with pytest.raises(VbusError, match='board "bench" has stopped'):
        feed.watch()
    feed.close()


def test_who_closes_half_and_does_not_read_is_not_waited_for(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        Connection, "send_last", lambda self: pytest.fail("the server waits for who watches")
    )
    with served(toy_board(), UNIX) as server, watch(scope={}) as link:
        until(lambda: [one.view for one in watchers(server) if one.view], "the watcher")
        link.shutdown(socket.SHUT_WR)
        until(lambda: not watchers(server), "its end")


def test_a_waveform_that_nobody_reads_ends() -> None:
    view = WaveView.__new__(WaveView)
    view._text = bytearray(MOST_WAVE)
    view.connection = Connection.__new__(Connection)
    view.connection.pending = bytearray()
    assert view.write("#1\n") == 3
    with pytest.raises(OSError, match="the other end does not read"):
        view.write("#2\n")
    assert len(view._text) == MOST_WAVE + 3
