"""The way from Zenoh's threads into the event loop."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import Any, Final

import zenoh

from vbus.network import envelope
from vbus.transports.zenoh_host import send_refusal

MOST_WAITING: Final = 65536
"""Messages that may wait for the event loop; more are dropped and asked again by their hosts.
A bound of memory."""

log = logging.getLogger("vbus")

Handle = Callable[[Any], None]


class Inbox:
    """The one place where Zenoh's threads enter the event loop."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._items: deque[tuple[Handle, Any]] = deque()
        self._lock: threading.Lock = threading.Lock()
        self._handles: dict[int, Handle] = {}
        self._endings: dict[int, Callable[[], None]] = {}
        self._numbers: count[int] = count()
        self._fd: int = -1
        self.dropped: int = 0

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Handle from now on what comes, in this event loop."""
        self._fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._loop = loop
        add = getattr(loop, "add_direct_reader", loop.add_reader)
        add(self._fd, self._drain)

    def entry(
        self, handle: Handle, ended: Callable[[], None] | None = None
    ) -> zenoh.handlers.Callback[Any]:
        """Return a callback for Zenoh's threads: what it gets is handled in the event loop.

        Args:
            handle: takes what comes.
            ended: is called in the event loop, too, when no more is to come; never left out.
        """
        number = next(self._numbers)
        self._handles[number] = handle
        # Python's collector does not see what a callback of Zenoh refers to: this inbox, which lets
        # go of everything when it is closed.
        enter = partial(self._enter, number)
        if ended is None:
            return zenoh.handlers.Callback(enter, indirect=False)
        self._endings[number] = ended
        end = partial(self._put, (self._end, number))  # the event of the end
        return zenoh.handlers.Callback(enter, end, indirect=False)

    def _enter(self, number: int, item: Any) -> None:
        if len(self._items) >= MOST_WAITING:
            self.dropped += 1
        elif (taker := self._handles.get(number)) is not None:
            self._put((taker, item))

    def _put(self, item: tuple[Handle, Any]) -> None:
        with self._lock:
            if self._fd >= 0:
                self._items.append(item)
                os.eventfd_write(self._fd, 1)

    def _end(self, number: int) -> None:
        del self._handles[number]
        self._endings.pop(number)()

    def _drain(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._fd)
        items = self._items
        if self.dropped:
            log.warning(
                "%d messages of the network came faster than they were served", self.dropped
            )
            self.dropped = 0
        for _ in range(len(items)):
            handle, item = items.popleft()
            try:
                handle(item)
            except Exception:
                log.exception("internal error while serving the network; the board goes on")
                if hasattr(item, "reply_err"):
                    send_refusal(item, envelope.BROKEN, "internal error of the board; see its log")

    def close(self) -> None:
        """Take nothing more; may be called again."""
        with self._lock:
            fd, self._fd = self._fd, -1
        loop, self._loop = self._loop, None
        if loop is not None and fd >= 0:
            loop.remove_reader(fd)
            os.close(fd)
        self._items.clear()
        self._handles.clear()
        self._endings.clear()
