"""Boards by their names: who owns one, and whether it answers."""

import json
import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from vbus.core.errors import NameInUseError, TransportError
from vbus.core.runtime import lock_state
from vbus.serve import registry
from vbus.serve.registry import answers, ask, name_path, own_board, socket_path
from vbus.transports.runtime import NameLock


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path))


def test_a_name_is_owned_until_the_outermost_owner_leaves_it() -> None:
    path = name_path("bench")
    with own_board("bench"):
        with own_board("bench"):
            assert lock_state(path)[0]
        assert lock_state(path)[0]
    other = NameLock(path)
    other.take("bench")
    with pytest.raises(NameInUseError, match=r'^a board called "bench" runs already \('):
        own_board("bench").__enter__()
    other.give_back()


@pytest.mark.parametrize(("here", "ready"), [([], False), (["a"], False), (["a", "b"], True)])
def test_a_machine_answers_when_each_of_its_nodes_does(
    monkeypatch: pytest.MonkeyPatch, here: list[str], ready: bool
) -> None:
    nodes = {name: {"others": ["a", "b"]} for name in here}
    monkeypatch.setattr(registry, "nodes_of", lambda machine: nodes)
    assert answers("machine") is ready


STATUS = json.dumps({"done": {"board": "bench"}}).encode()
ANSWER = len(STATUS).to_bytes(4, "little") + STATUS


@contextmanager
def board_that(serves: Callable[[socket.socket], object], times: int = 1) -> Iterator[Path]:
    """Give the socket of a board "bench", which serves so many links, one after the other."""
    path = socket_path("bench")

    def serve() -> None:
        for _ in range(times):
            link, _ = listener.accept()
            with link:
                serves(link)

    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        path.chmod(0o600)
        listener.listen()
        board = threading.Thread(target=serve)
        board.start()
        yield path
        board.join()


def test_a_board_answers_with_what_it_tells_of_itself() -> None:
    path = socket_path("bench")
    assert not answers("bench")
    path.write_text("")
    with pytest.raises(TransportError, match=r"does not answer \(it is no socket, or one that oth"):
        ask(path)
    path.unlink()

    def serves(link: socket.socket) -> None:
        assert json.loads(link.makefile().readline()) == {"do": "status"}
        link.sendall(ANSWER)

    with board_that(serves, times=2):
        assert ask(path) == {"board": "bench"}
        assert answers("bench")


def test_a_board_that_answers_byte_by_byte_is_given_up_in_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(registry, "ANSWER_SECONDS", 0.2)
    over = threading.Event()

    def serves(link: socket.socket) -> None:
        with suppress(OSError):
            link.sendall((1000).to_bytes(4, "little"))
            for _ in range(200):
                link.sendall(b" ")
                if over.wait(0.05):
                    return

    with board_that(serves) as path:
        with pytest.raises(TransportError, match=r"does not answer \(timed out\)"):
            ask(path)
        over.set()


def test_a_board_that_has_no_turn_has_longer_to_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []
    turn = threading.Event()

    class NoTurn:
        def __init__(self, pids: Callable[[], list[int]]) -> None:
            looks.extend(pids())

        def lacking(self, waited: float, longest: float) -> bool:
            looks.append(0)
            if len(looks) == 4:
                turn.set()
            return True

    monkeypatch.setattr(registry, "ANSWER_SECONDS", 0.05)
    monkeypatch.setattr(registry, "TURN_SECONDS", 0.01)
    monkeypatch.setattr(registry, "Turns", NoTurn)

    def serves(link: socket.socket) -> None:
        assert turn.wait(60)
        link.sendall(ANSWER)

    with board_that(serves) as path:
        assert ask(path) == {"board": "bench"}
    assert looks[0] == os.getpid()


def test_an_answer_that_comes_while_it_is_looked_for_a_turn_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    turn, answered = threading.Event(), threading.Event()

    class Turn:
        def __init__(self, pids: Callable[[], list[int]]) -> None:
            pass

        def lacking(self, waited: float, longest: float) -> bool:
            turn.set()
            return not answered.wait(60)

    monkeypatch.setattr(registry, "ANSWER_SECONDS", 0.01)
    monkeypatch.setattr(registry, "Turns", Turn)

    def serves(link: socket.socket) -> None:
        assert turn.wait(60)
        link.sendall(ANSWER)
        answered.set()

    with board_that(serves) as path:
        assert ask(path) == {"board": "bench"}
