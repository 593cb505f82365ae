"""Which servers the process beside them kills."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from vbus.serve.time import watchdog_process
from vbus.serve.time.watchdog_process import BUSY, STARVED, Turns


class Poll:
    """Of descriptors of which nothing is heard; no look at them takes time."""

    def register(self, *_: object) -> None:
        """Look at one more."""

    unregister = modify = register

    def poll(self, _: float) -> list[tuple[int, int]]:
        """Hear nothing."""
        return []


def see_it_end(program: str) -> int:
    """Look at a program that has had a signal, and says nothing; return how it has ended."""
    heard, tell = os.pipe()
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE) as server:
        pidfd = os.pidfd_open(server.pid)
        try:
            watchdog_process._see_it_end(server.pid, "SIGTERM", heard, pidfd)
        finally:
            for fd in (heard, tell, pidfd):
                os.close(fd)
    return server.returncode


def test_a_server_that_ends_in_time_is_not_killed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(watchdog_process, "LOOK", 0.001)
    monkeypatch.setattr(watchdog_process, "PATIENCE", 1e9)
    assert see_it_end("import time; time.sleep(0.01)") == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("state", "used", "waited"),
    [
        ("R", BUSY, 1),
        ("R", BUSY - 0.01, 1 + STARVED),
        ("D", BUSY, 1 + STARVED),
        ("S", 0.0, 1),
    ],
    ids=["stuck", "starved of the processor", "of the disk", "stuck in a wait"],
)
def test_a_server_that_has_had_its_turns_is_stuck_and_another_is_starved_for_a_while(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    state: str,
    used: float,
    waited: int,
) -> None:
    seconds: Iterator[float] = iter([0.0, *[used] * 100])
    monkeypatch.setattr(watchdog_process, "states", lambda pid: {state})
    monkeypatch.setattr(watchdog_process, "seconds_computed", lambda pid: next(seconds))
    monkeypatch.setattr(watchdog_process, "LOOK", 1.0)
    monkeypatch.setattr(watchdog_process, "PATIENCE", 1.0)
    monkeypatch.setattr(watchdog_process, "select", SimpleNamespace(poll=Poll, POLLIN=1))
    assert see_it_end("input()") < 0
    assert f" within {waited:.1f} s; it is killed" in capsys.readouterr().err


def test_a_server_without_a_turn_is_given_longer_to_write_down_where_it_hangs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done: list[object] = []
    letters = iter(["S", *["R"] * 4, "S"])

    def lacking(turns: Turns, waited: float, longest: float) -> bool:
        done.append("look")
        return next(letters) == "R"

    monkeypatch.setattr(watchdog_process, "states", lambda pid: set())
    monkeypatch.setattr(Turns, "lacking", lacking)
    monkeypatch.setattr(watchdog_process, "LOOK", 1.0)
    monkeypatch.setattr(watchdog_process, "select", SimpleNamespace(poll=Poll, POLLIN=1))
    monkeypatch.setattr(
        watchdog_process.signal, "pidfd_send_signal", lambda fd, number: done.append(number)
    )
    watchdog_process._see_it_end(os.getpid(), "SIGTERM", 0, 1)
    assert done == ["look", signal.SIGABRT, *["look"] * 5, signal.SIGKILL]
