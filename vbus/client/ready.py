"""Waiting for a descriptor, blocking."""

import select
import threading
import time
from collections.abc import Callable
from typing import TypeVar

from vbus.wall_clock import monotonic

T = TypeVar("T")

Lock = threading.Lock


def until_ready(fd: int, write: bool, deadline: float) -> bool:
    """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
    poll = select.poll()
    poll.register(fd, select.POLLIN | select.POLLOUT if write else select.POLLIN)
    return bool(poll.poll(max(0.0, deadline - monotonic()) * 1000))


def pause(seconds: float) -> None:
    """Wait for a while."""
    time.sleep(seconds)


def opened(open_link: Callable[[str], T], where: str) -> T:
    """Open a link."""
    return open_link(where)
