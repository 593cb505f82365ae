"""What the kernel tells of processes and their threads, in files below ``/proc``."""

import os
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple

from vbus.cli.hosted.symbols import places
from vbus.serve.time.watchdog_process import fields, tasks

RUNS: Final = "is running"
_STATES: Final = {
    "R": RUNS, "S": "sleeps in the kernel", "D": "waits for a device", "T": "is stopped",
    "t": "is stopped by a debugger",
}  # fmt: skip
_GONE: Final = ("", "Z", "X")
_CALLS: Final = {
    "x86_64": {
        0: "read", 1: "write", 7: "poll", 19: "readv", 20: "writev", 23: "select", 34: "pause",
        35: "nanosleep", 45: "recvfrom", 47: "recvmsg", 61: "wait4", 73: "flock",
        128: "rt_sigtimedwait", 130: "rt_sigsuspend", 202: "futex", 230: "clock_nanosleep",
        232: "epoll_wait", 247: "waitid", 270: "pselect6", 271: "ppoll", 281: "epoll_pwait",
    },
    "i386": {
        3: "read", 4: "write", 7: "waitpid", 29: "pause", 72: "sigsuspend", 114: "wait4",
        142: "select", 143: "flock", 145: "readv", 146: "writev", 162: "nanosleep", 168: "poll",
        177: "rt_sigtimedwait", 179: "rt_sigsuspend", 240: "futex", 256: "epoll_wait",
        267: "clock_nanosleep", 284: "waitid", 308: "pselect6", 309: "ppoll", 371: "recvfrom",
        407: "clock_nanosleep", 413: "pselect6", 414: "ppoll", 421: "rt_sigtimedwait",
        422: "futex",
    },
    "aarch64": {
        63: "read", 64: "write", 65: "readv", 66: "writev", 72: "pselect6", 73: "ppoll",
        95: "waitid", 98: "futex", 101: "nanosleep", 115: "clock_nanosleep",
        133: "rt_sigsuspend", 137: "rt_sigtimedwait", 260: "wait4",
    },
}  # fmt: skip
"""Numbers of the system calls that wait, by machine (the kernel's own tables)."""
_MACHINES: Final = {3: "i386", 62: "x86_64", 183: "aarch64"}
"""By the number in a program's ELF header."""


class SystemCall(NamedTuple):
    """A system call that a thread is in.

    Attributes:
        name: the kernel's, or its number as text where it is none that waits.
        arguments: its six arguments.
        stack: where the thread's stack ends.
        wide: whether addresses have 64 bits.
    """

    name: str
    arguments: tuple[int, ...]
    stack: int
    wide: bool


def read(path: str) -> str:
    """Return a file's text; "" if it cannot be read."""
    try:
        return Path(path).read_text(errors="replace")
    except OSError:
        return ""


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    texts = [read(f"/proc/{pid}/task/{task}/children") for task in tasks(pid)]
    return [int(child) for text in texts for child in text.split()]


def offspring(roots: Iterable[int]) -> list[int]:
    """Return the processes that run of these and of those that come from them, youngest last."""
    found = list(roots)
    for one in found:
        # The list grows while it is gone through: children of children come by themselves.
        found += children(one)
    return [pid for pid in found if state(pid) not in _GONE]


@contextmanager
def handle_of(pid: int) -> Iterator[int]:
    """Open a descriptor of a process, which can be read once that has ended.

    Raises:
        ProcessLookupError: it has ended, and its parent has taken notice.
    """
    handle = os.pidfd_open(pid)
    try:
        yield handle
    finally:
        os.close(handle)


def name_of(pid: int) -> str:
    """Return what a process calls itself."""
    return read(f"/proc/{pid}/comm").strip()


def state(pid: int, task: int = 0) -> str:
    """Return the letter that the kernel has for what a process, or a thread, does; "" for none."""
    return next(iter(fields(pid, task)), "")


def status(pid: int, task: int) -> dict[str, str]:
    """Return what the kernel tells of a thread, by name."""
    lines = (line.partition(":") for line in read(f"/proc/{pid}/task/{task}/status").splitlines())
    return {name: value.strip() for name, _, value in lines}


def memory(pid: int, address: int, size: int) -> bytes:
    """Return what stands at an address of a process; less or nothing where it cannot be read."""
    with suppress(OSError, OverflowError, ValueError), open(f"/proc/{pid}/mem", "rb", 0) as file:
        file.seek(address)
        return file.read(size)
    return b""


def call_of(pid: int, task: int) -> SystemCall | None:
    """Return the system call that a thread waits in; None if it is in none, or it is hidden."""
    return _call(pid, _syscall(pid, task))


def _syscall(pid: int, task: int) -> str:
    """Return what the kernel says of a thread's system call; "" if that is hidden."""
    return read(f"/proc/{pid}/task/{task}/syscall")


def _call(pid: int, text: str) -> SystemCall | None:
    # Number, six arguments, stack pointer, program counter; or "running" (proc_pid_syscall(5)).
    number, *numbers = (text or "running").split()
    if len(numbers) != 8:
        return None
    head = b""
    with suppress(OSError), open(f"/proc/{pid}/exe", "rb") as file:
        # The machine stands at byte 18: a program of 32 bits has other numbers on the same kernel.
        head = file.read(20)
    if len(head) < 20 or head[:4] != b"\x7fELF":
        return None
    names = _CALLS.get(_MACHINES.get(struct.unpack_from("<H", head, 18)[0], ""), {})
    values = tuple(int(value, 16) for value in numbers)
    return SystemCall(names.get(int(number), number), values[:6], values[6], head[4] == 2)


def does(pid: int, task: int) -> str:
    """Return what a thread does, for people: where it waits, and who called."""
    # Letters are those of proc_pid_stat(5); S and D are the two that sleep.
    letter = state(pid, task)
    text = _STATES.get(letter, f"is in state {letter}")
    if letter not in ("S", "D"):
        return text
    kernel = _syscall(pid, task)
    call = _call(pid, kernel)
    # 16 KiB of stack reach from the C library's wait to the program's own function.
    stack = b"" if call is None else memory(pid, call.stack, 1 << 14)
    if _syscall(pid, task) != kernel or kernel.startswith("running"):
        return RUNS  # it has been woken meanwhile: its stack is not of one instant
    if call is None:
        where = read(f"/proc/{pid}/task/{task}/wchan").strip("0")
        return text + (f" in {where}" if where else "")
    found = places(pid, stack, call.wide)
    name = f"system call {call.name}" if call.name.isdecimal() else call.name
    inner = name if found.inner in ("", call.name) else f"{found.inner} ({name})"
    return f"waits in {inner}" + (f", called by {found.outer}" if found.outer else "")


def what_hangs(pids: Iterable[int]) -> list[str]:
    """Return a sentence for each thread of these processes."""
    return [
        f"{read(f'/proc/{pid}/task/{task}/comm').strip()} (process {pid}, thread {task})"
        f" {does(pid, task)}"
        for pid in pids
        for task in tasks(pid)
        if state(pid, task) not in _GONE
    ]
