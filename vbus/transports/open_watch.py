"""Who opens, writes to and closes terminals: one inotify descriptor for all of an event loop."""

import asyncio
from collections.abc import Callable
from typing import Final
from weakref import WeakKeyDictionary

from vbus.transports.linux import Inotify


class OpenWatch:
    """Tells when one file is opened, written to and closed: how a PTY learns of its clients.

    The system gives a user few inotify descriptors, 128 unless it is set up for more, so all
    watches of an event loop share one.

    Args:
        loop: calls ``notice``.
        path: the file.
        notice: called soon after something has happened, if it has not been read by then.

    Raises:
        OSError: the system gives no more descriptors or watches.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, path: str, notice: Callable[[], None]
    ) -> None:
        shared = _SHARED.get(loop)
        if shared is None:
            shared = _SharedInotify(loop)
        self._shared: _SharedInotify = shared
        self.notice: Callable[[], None] = notice
        self._events: list[int] = []
        try:
            self._number: int = shared.inotify.add(path)
        except OSError:
            shared.end_if_idle()
            raise
        shared.watches[self._number] = self

    def read(self) -> list[int]:
        """Return what happened since the last call, in order: IN_OPEN, IN_MODIFY, IN_CLOSE."""
        self._shared.sort()
        events, self._events = self._events, []
        return events

    def note(self, event: int) -> None:
        """Keep what happened until it is read, and see to it that it is."""
        if not self._events:
            self._shared.loop.call_soon(self._look)
        self._events.append(event)

    def _look(self) -> None:
        if self._events:
            self.notice()

    def close(self) -> None:
        """Watch no more."""
        self._events.clear()
        del self._shared.watches[self._number]
        self._shared.inotify.remove(self._number)
        self._shared.end_if_idle()


class _SharedInotify:
    """The watches of one event loop, and their descriptor while there are any."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop: asyncio.AbstractEventLoop = loop
        self.inotify: Inotify = Inotify()
        self.watches: dict[int, OpenWatch] = {}
        loop.add_reader(self.inotify.fd, self.sort)
        _SHARED[loop] = self

    def sort(self) -> None:
        """Give each watch what has happened to its file."""
        for number, event in self.inotify.read():
            if number < 0:  # reports are lost: all look at their files
                for watch in self.watches.values():
                    self.loop.call_soon(watch.notice)
            elif number in self.watches:
                self.watches[number].note(event)

    def end_if_idle(self) -> None:
        """Free the descriptor if no file is watched any more."""
        if not self.watches:
            self.loop.remove_reader(self.inotify.fd)
            self.inotify.close()
            del _SHARED[self.loop]


_SHARED: Final[WeakKeyDictionary[asyncio.AbstractEventLoop, _SharedInotify]] = WeakKeyDictionary()
