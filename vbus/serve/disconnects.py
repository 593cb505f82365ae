"""Hosts that go while nothing is read from them are noticed all the same."""

import asyncio
import select
from collections.abc import Callable, Iterable


class DisconnectPoller:
    """One descriptor for all sessions that wait.

    Args:
        loop: the event loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop: asyncio.AbstractEventLoop = loop
        self._poll: select.epoll = select.epoll()
        self._callbacks: dict[int, Callable[[], None]] = {}

    def open(self) -> None:
        """Notice from now on."""
        self._loop.add_reader(self._poll.fileno(), self.look)

    def close(self) -> None:
        """Notice nothing more."""
        self._loop.remove_reader(self._poll.fileno())
        self._poll.close()

    def watch(self, fd: int, callback: Callable[[], None]) -> None:
        """Call back when the host behind ``fd`` has gone, until :meth:`forget`."""
        if fd not in self._callbacks:
            self._callbacks[fd] = callback
            self._poll.register(fd, 0)  # errors and hang-ups are always told

    def forget(self, fd: int) -> None:
        """Look no more; again is harmless."""
        if self._callbacks.pop(fd, None) is not None:
            self._poll.unregister(fd)

    def gone(self, fd: int) -> bool:
        """Tell whether a host sends no more, though that may not have been noticed yet."""
        return bool(_states([fd], select.POLLRDHUP))

    def waits(self, fd: int) -> bool:
        """Tell whether something has come that nobody has read."""
        return any(state & select.POLLIN for _, state in _states([fd], select.POLLIN))

    def gone_of(self, fds: Iterable[int]) -> set[int]:
        """Return those whose hosts have gone altogether, and hear no more either."""
        return {fd for fd, _ in _states(fds, 0)}

    def look(self) -> None:
        """Call back for whoever has gone."""
        for fd, _ in self._poll.poll(0):
            callback = self._callbacks.get(fd)
            if callback is not None:
                callback()


def _states(fds: Iterable[int], asked: int) -> list[tuple[int, int]]:
    """Return the descriptors of which there is something to tell now, each with what it is."""
    poll = select.poll()
    for fd in fds:
        poll.register(fd, asked)
    return poll.poll(0)
