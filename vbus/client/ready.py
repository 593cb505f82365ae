"""Waiting for a descriptor, blocking."""

import select
import threading
import time
from collections.abc import Awaitable, Callable, Generator
from typing import Final, TypeVar

from vbus.client.aio.waits import Waits
from vbus.core.wall_clock import monotonic

T = TypeVar("T")


def until_ready(fd: int, write: bool, deadline: float) -> bool:
    """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
    poll = select.poll()
    poll.register(fd, select.POLLIN | select.POLLOUT if write else select.POLLIN)
    return bool(poll.poll(max(0.0, deadline - monotonic()) * 1000))


class _Done:
    """Awaits nothing: entering and leaving by coroutines would be a tenth of a round trip."""

    def __await__(self) -> Generator[None, None, None]:
        return _ENDED


_DONE: Final = _Done()
_ENDED: Final[Generator[None, None, None]] = iter(())  # type: ignore[assignment]


class BlockingWaits(Waits):
    """Waiting that blocks the thread: whatever is awaited has happened when ``await`` is reached.

    Within ``async with`` no other thread has the session.
    """

    def __init__(self) -> None:
        self._taken = threading.Lock()
        self._poll = select.poll()
        self._polled: tuple[int, bool] = (-1, False)

    def __aenter__(self) -> Awaitable[None]:
        self._taken.acquire()
        return _DONE

    def __aexit__(self, *why: object) -> Awaitable[None]:
        self._taken.release()
        return _DONE

    async def until_ready(self, fd: int, write: bool, deadline: float) -> bool:
        """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
        if self._polled != (fd, write):
            self._poll.register(fd, select.POLLIN | select.POLLOUT if write else select.POLLIN)
            self._polled = fd, write
        return bool(self._poll.poll(max(0.0, deadline - monotonic()) * 1000))

    async def pause(self, seconds: float) -> None:
        """Wait for a while."""
        time.sleep(seconds)

    async def opened(self, open_link: Callable[[str], T], where: str) -> T:
        """Open a link."""
        return open_link(where)
