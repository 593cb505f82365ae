"""Processes that begin and end together: what is shown, who is named, and that all end."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.waiting import PATIENCE, until
from vbus.cli import processes
from vbus.cli.processes import Child, ProcessDiedError, Processes

FOREVER = "exec sleep 1000"
DEAF = f'trap "" TERM; echo ready; {FOREVER}'


def shell(text: str) -> list[str]:
    return ["/bin/sh", "-c", text]


def takes_ready(child: Child, line: str) -> bool:
    child.ready = child.ready or line == "ready"
    return line == "ready"


def all_ready(made: Processes) -> Callable[[], bool]:
    return lambda: all(child.ready for child in made.children)


def lives(process: int) -> bool:
    return Path(f"/proc/{process}").exists()


def test_lines_come_with_names_in_front_and_what_is_taken_is_not_shown() -> None:
    shown: list[str] = []
    with Processes(shown.append, PATIENCE, width=5) as made:
        a = made.start("a", "node a", shell("echo ready; printf 'one\\ntwo'"), takes_ready)
        long = made.start("a+b", "nodes", shell("echo three >&2"))
        made.until(lambda: a.ended and long.ended, lambda child: True)
    assert [line for line in shown if line.startswith("a  ")] == ["a     | one", "a     | two"]
    assert "a+b   | three" in shown
    assert a.ready
    assert made.killed == []


def failure(
    made: Processes, may_end: Callable[[Child], bool] = lambda child: False
) -> ProcessDiedError:
    """Wait until a process has died; return what is told of it."""
    with pytest.raises(ProcessDiedError) as raised:
        made.until(lambda: False, may_end)
    return raised.value


def test_one_that_dies_is_named_with_its_last_lines_and_ends_the_others() -> None:
    with Processes(lambda line: None, PATIENCE) as made:
        other = made.start("b", "node b", shell(f"echo ready; {FOREVER}"), takes_ready)
        made.until(all_ready(made))
        dies = made.start("a", "node a", shell("seq 1 30; kill -9 $$"))
        told = failure(made)
    first, *lines = str(told).splitlines()
    assert first == (
        f"node a (process {dies.pid}) died of SIGKILL, and the machine with it; its last lines:"
    )
    assert lines == [f"  {number}" for number in range(21, 31)]
    assert told.code == -signal.SIGKILL
    assert not lives(other.pid)


def test_an_exit_code_is_told_and_a_good_end_is_one_only_where_it_may_be() -> None:
    with Processes(lambda line: None, PATIENCE) as made:
        fails = made.start("a", "node a", shell("exit 4"))
        told = failure(made, lambda child: True)
        assert told.code == 4
        assert str(told) == (
            f"node a (process {fails.pid}) ended with exit code 4, and the machine with it;"
            " nothing was said"
        )
        ends = made.start("b", "node b", shell("exit 0"))
        told = failure(made)
        assert told.code == 0
        assert str(told) == f"node b (process {ends.pid}) ended, and the machine with it"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_all(number: signal.Signals) -> None:
    with Processes(lambda line: None, PATIENCE) as made:
        children = [
            made.start(name, name, shell(f"echo ready; {FOREVER}"), takes_ready) for name in "ab"
        ]
        assert made.until(all_ready(made))
        os.kill(os.getpid(), number)
        assert not made.until(lambda: False)
    assert made.killed == []
    assert not any(lives(child.pid) for child in children)


def test_one_that_was_stopped_ends_like_the_others() -> None:
    with Processes(lambda line: None, PATIENCE) as made:
        child = made.start("a", "node a", shell(f"echo ready; {FOREVER}"), takes_ready)
        made.until(all_ready(made))
        os.kill(child.pid, signal.SIGSTOP)
    assert made.killed == []
    assert child.popen.returncode == -signal.SIGTERM


def test_one_that_hangs_is_killed_and_named() -> None:
    with Processes(lambda line: None, 0.1) as made:
        child = made.start("a", "node a", shell(DEAF), takes_ready)
        made.until(all_ready(made))
    assert child.popen.returncode == -signal.SIGKILL
    [said] = made.killed
    first, *hangs = said.splitlines()
    assert first == f"node a (process {child.pid}) did not end within 0.1 s; it is killed"
    assert "sleep (process" in hangs[0]


def test_one_that_has_no_turn_has_longer_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []

    class NoTurn:
        def __init__(self, pids: Callable[[], list[int]]) -> None:
            [self._pid] = pids()

        def lacking(self, waited: float, longest: float) -> bool:
            looks.append(self._pid)
            if len(looks) == 3:
                os.kill(self._pid, signal.SIGKILL)  # it ends now
            return True

    monkeypatch.setattr(processes, "Turns", NoTurn)
    with Processes(lambda line: None, 0.0) as made:
        child = made.start("a", "node a", shell(DEAF), takes_ready)
        made.until(all_ready(made))
    assert made.killed == []
    assert looks[:3] == [child.pid] * 3


def test_who_asks_twice_does_not_wait() -> None:
    with Processes(lambda line: None, 1000.0) as made:
        made.start("a", "node a", shell(DEAF), takes_ready)
        made.until(all_ready(made))
        os.kill(os.getpid(), signal.SIGINT)
        assert not made.until(lambda: False)
        os.kill(os.getpid(), signal.SIGINT)
    assert "when it was asked again" in made.killed[0]


def test_they_end_with_who_started_them() -> None:
    reading, writing = os.pipe()
    parent = os.fork()
    if not parent:
        try:
            with Processes(lambda line: None, PATIENCE) as made:
                child = made.start("a", "node a", shell(f"echo ready; {FOREVER}"), takes_ready)
                made.until(all_ready(made))
                os.write(writing, str(child.pid).encode())
                os.kill(os.getpid(), signal.SIGKILL)
        finally:
            os._exit(1)
    os.close(writing)
    try:
        child_process = int(os.read(reading, 20))
    finally:
        os.close(reading)
        os.waitpid(parent, 0)
    until(lambda: not lives(child_process), "the child ends")


def test_signals_do_afterwards_what_they_did_before() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with Processes(lambda line: None, PATIENCE):
        pass
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
