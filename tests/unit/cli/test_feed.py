"""What is asked of a board that is watched, and does not read."""

import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.waiting import until
from vbus.cli.sources import MOST_WAITING, Feed
from vbus.serve.registry import socket_path

REQUEST = b'{"registers": true}' + b" " * 980 + b"\n"


@pytest.fixture
def watched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Feed, socket.socket]]:
    """A feed, and the other end, which reads when a test does."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(socket_path("bench")))
        listener.listen(1)
        made: list[Feed] = []
        begun = threading.Thread(target=lambda: made.append(Feed("bench")))
        begun.start()
        board, _ = listener.accept()
        with board:
            assert board.recv(64) == b'{"do": "status"}\n'
            hello = json.dumps({"done": {"board": "bench"}}).encode()
            board.sendall(len(hello).to_bytes(4, "little") + hello)
            begun.join()
            yield made[0], board
            made[0].close()


def test_a_board_that_does_not_read_holds_nobody_up_and_gets_all_when_it_reads(
    watched: tuple[Feed, socket.socket],
) -> None:
    feed, board = watched
    count = 900  # 0.9 MB: more than the system keeps for a Unix socket
    done: list[bool] = []
    asking = threading.Thread(
        target=lambda: done.extend(feed.send(REQUEST) is None for _ in range(count)), daemon=True
    )
    asking.start()
    until(lambda: len(done) == count, "requests to a board that does not read")
    with board.makefile("rb") as lines:
        assert all(next(lines) == REQUEST for _ in range(count))
    feed.send(b"x\n")
    assert board.recv(64) == b"x\n"


def test_requests_that_wait_for_long_are_refused(watched: tuple[Feed, socket.socket]) -> None:
    feed, _ = watched

    def ask() -> None:
        for _ in range(3 * MOST_WAITING):
            feed.send(REQUEST)

    with pytest.raises(BlockingIOError, match="the board does not read: 1024 requests wait"):
        ask()


def test_a_board_that_has_gone_is_an_error(watched: tuple[Feed, socket.socket]) -> None:
    feed, board = watched
    board.close()
    with pytest.raises(BrokenPipeError):
        feed.send(REQUEST)


def test_a_board_that_ends_with_a_request_unread_has_ended(
    watched: tuple[Feed, socket.socket],
) -> None:
    feed, board = watched
    feed.send(REQUEST)
    board.sendall(b"\x02\0\0\0{}" + b"\x09\0\0\0cut")
    board.close()
    assert list(feed.messages()) == [b"{}"]
