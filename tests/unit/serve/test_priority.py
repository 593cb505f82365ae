"""Real time on request: what is asked of the system, and what is said when it refuses."""

import os
import resource

import pytest

from vbus.core.errors import VbusError
from vbus.serve.time import priority
from vbus.serve.time.priority import Priority


@pytest.mark.parametrize(
    ("text", "cpu", "wanted", "told"),
    [
        (None, None, Priority(0, -1), ""),
        ("fifo", None, Priority(10, -1), "SCHED_FIFO 10, memory locked"),
        ("fifo:1", 0, Priority(1, 0), "SCHED_FIFO 1, memory locked, processor 0"),
        ("fifo:99", 3, Priority(99, 3), "SCHED_FIFO 99, memory locked, processor 3"),
        (None, 2, Priority(0, 2), "processor 2"),
    ],
)
def test_what_a_command_line_asks_for(
    text: str | None, cpu: int | None, wanted: Priority, told: str
) -> None:
    assert Priority.of(text, cpu) == wanted
    assert str(wanted) == told


@pytest.mark.parametrize("text", ["", "rr", "fifo:", "fifo:0", "fifo:100", "fifo:-1", "FIFO:5"])
def test_what_is_no_priority_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="write fifo, or fifo:1 to fifo:99"):
        Priority.of(text, None)


def test_a_processor_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {1, 3})
    with pytest.raises(VbusError) as refused:
        Priority(0, 2).take()
    assert str(refused.value) == "--cpu 2: this process may run on processors 1, 3 only"


def refuse(*words: object) -> None:
    raise PermissionError(1, "Operation not permitted")


def test_a_class_that_is_not_permitted_is_refused_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(VbusError) as refused:
        Priority(7).take()
    assert str(refused.value) == (
        '--priority fifo:7: Operation not permitted; write "USER - rtprio 99" in'
        " /etc/security/limits.conf and log in again, or give the container or service the"
        " capability CAP_SYS_NICE"
    )


def test_what_was_taken_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[object] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda pid, how, what: done.append(how))
    monkeypatch.setattr(priority, "unlock_memory", lambda: done.append("unlocked"))
    Priority(0, 3).give_back()
    assert done == []
    Priority(7).give_back()
    assert done == [os.SCHED_OTHER, "unlocked"]


def test_memory_that_cannot_be_locked_leaves_the_usual_class(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    classes: list[tuple[int, int]] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, how, what: classes.append((how, what.sched_priority))
    )
    monkeypatch.setattr(priority, "lock_memory", refuse)
    monkeypatch.setattr(resource, "getrlimit", lambda limit: (8 << 20, 8 << 20))
    with pytest.raises(
        VbusError, match=r"memory cannot be locked.* 8192 KiB are allowed; .*CAP_IPC"
    ):
        Priority(7).take()
    assert classes == [(os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 7), (os.SCHED_OTHER, 0)]


def test_a_process_is_bound_to_the_processor_it_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    bound: list[tuple[int, set[int]]] = []
    monkeypatch.setattr(os, "sched_setaffinity", lambda pid, cpus: bound.append((pid, cpus)))
    for cpu in (-1, 0, 3):
        Priority(0, cpu).pin()
    assert bound == [(0, {0}), (0, {3})]
