"""The way from Zenoh's threads into the event loop."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import threading
from collections import deque
from collections.abc import Callable
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
    """The one place where Zenoh's threads enter the event loop.

    Args:
        loop: the event loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop: asyncio.AbstractEventLoop = loop
        self._items: deque[tuple[Handle, Any]] = deque()
        self._lock: threading.Lock = threading.Lock()
        self._handles: dict[int, Handle] = {}
        self._numbers: count[int] = count()
        self._fd: int = -1
        self.dropped: int = 0

    def open(self) -> None:
        """Handle from now on what comes."""
        self._fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        add = getattr(self._loop, "add_direct_reader", self._loop.add_reader)
        add(self._fd, self._drain)

    def entry(
        self, handle: Handle, ended: Callable[[], None] | None = None
    ) -> zenoh.handlers.Callback[Any]:
        """Return a callback for Zenoh's threads: what it gets is handled in the event loop.

        Args:
            handle: takes what comes.
            ended: is called in the event loop, too, when no more is to come; never left out.
        """
        items, lock, handles = self._items, self._lock, self._handles
        number = next(self._numbers)
        handles[number] = handle

        def put(item: tuple[Handle, Any]) -> None:
            with lock:
                if self._fd >= 0:
                    items.append(item)
                    os.eventfd_write(self._fd, 1)

        # Python's collector does not see what a callback of Zenoh refers to: only this number.
        def enter(item: Any) -> None:
            if len(items) >= MOST_WAITING:
                self.dropped += 1
            elif (taker := handles.get(number)) is not None:
                put((taker, item))

        if ended is None:
            return zenoh.handlers.Callback(enter, indirect=False)
        over = ended  # the event of the end

        def end(_: Any) -> None:
            handles.pop(number, None)
            over()

        return zenoh.handlers.Callback(enter, lambda: put((end, None)), indirect=False)

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
        if fd >= 0:
            self._loop.remove_reader(fd)
            os.close(fd)
        self._items.clear()
        self._handles.clear()
