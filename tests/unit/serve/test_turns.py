"""Processes that have no turn, and those that only wait."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from tests.waiting import until
from vbus.serve import local_socket
from vbus.serve.local_socket import Connection, Control
from vbus.serve.time.watchdog_process import STARVED, Turns

COMPUTES = "print(flush=True)\nwhile True: pass"
WAITS = "print(flush=True); input()"


@contextmanager
def begun(program: str) -> Iterator[subprocess.Popen[bytes]]:
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process
        finally:
            process.kill()


def test_a_process_lacks_turns_that_wants_to_run_where_others_do() -> None:
    cpu = min(os.sched_getaffinity(0))
    with begun(COMPUTES) as one, begun(COMPUTES) as other:
        for process in (one, other):
            os.sched_setaffinity(process.pid, {cpu})
        os.setpriority(os.PRIO_PROCESS, one.pid, 19)
        turns = Turns(lambda: [one.pid])
        until(lambda: turns.lacking(60.0, 60.0), "the other one has the processor")
        assert not turns.lacking(60.0 + STARVED, 60.0)


def test_a_process_that_has_had_its_turns_lacks_none() -> None:
    with begun(COMPUTES) as one:
        turns = Turns(lambda: [one.pid])
        until(lambda: not turns.lacking(0.1, 0.1), "it has had the processor for 0.1 s")


def test_a_process_that_waits_is_stopped_or_asks_lacks_none() -> None:
    with begun(WAITS) as one:
        turns = Turns(lambda: [one.pid])
        until(lambda: not turns.lacking(60.0, 60.0), "it waits")
        one.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, one.pid, os.WSTOPPED | os.WNOWAIT)
        assert not turns.lacking(60.0, 60.0)
    assert not turns.lacking(60.0, 60.0)
    assert not Turns(lambda: [os.getpid()]).lacking(60.0, 60.0)


@pytest.mark.parametrize("turns", [[], [True] * 3, [False]], ids=["none", "late", "just now"])
def test_a_watcher_without_a_turn_has_longer_to_take_the_last_words(
    monkeypatch: pytest.MonkeyPatch, turns: list[bool]
) -> None:
    near, far = socket.socketpair()
    left = [*turns]

    class NoTurn:
        def __init__(self, pids: Callable[[], list[int]]) -> None:
            assert pids() == [os.getpid()]

        def lacking(self, waited: float, longest: float) -> bool:
            if not left:
                return False
            lacks = left.pop()
            if not left:
                taken.append(far.recv(1 << 24))
            return lacks

    monkeypatch.setattr(local_socket, "LAST_SECONDS", 0.01)
    monkeypatch.setattr(local_socket, "LAST_TURNS", 60.0)
    monkeypatch.setattr(local_socket, "Turns", NoTurn)
    taken: list[bytes] = []
    with near, far:
        near.setblocking(False)
        link: Any = SimpleNamespace(fd=near.fileno())
        loop = asyncio.new_event_loop()
        connection = Connection(loop, link, lambda _: None, Control(lambda: None))
        near.send(bytes(1 << 24))  # as much as there is room for
        connection.pending += b"last words"
        connection.send_last()
        loop.close()
        assert connection.pending == (b"" if turns else b"last words")
