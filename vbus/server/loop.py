"""An event loop that serves hosts without a detour."""

import asyncio
import select
import selectors
from collections.abc import Callable
from contextvars import Context
from typing import Any, Final, TypeVarTuple

_Arguments = TypeVarTuple("_Arguments")
_MOST_EVENTS: Final = 64


class DirectSelector(selectors.EpollSelector):
    """Calls the callbacks of *direct* descriptors itself, as soon as they are readable.

    A host's message then costs one ``epoll_wait`` and one call. The event loop's own bookkeeping,
    which takes longer than a bus cycle, is left out. Everything else goes through the event loop
    as ever, which gets its turn whenever it has something to do.
    """

    def __init__(self) -> None:
        super().__init__()
        self.direct: dict[int, Callable[[], None]] = {}
        self.wanted: bool = False
        """Set when something is scheduled: the event loop must look at it."""
        self.failed: Callable[[Exception], None] = _ignore
        """Takes what a callback raised."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Serve direct descriptors; return the indirect that are ready."""
        poll = self._selector.poll  # type: ignore[attr-defined]
        wait = -1 if timeout is None else max(timeout, 0)
        direct = self.direct
        self.wanted = False
        indirect: list[tuple[selectors.SelectorKey, int]] = []
        while True:
            found = poll(wait, _MOST_EVENTS)
            for fd, event in found:
                callback = direct.get(fd)
                if callback is None or event & select.EPOLLOUT:
                    key = self.get_map().get(fd)
                    if key is not None:
                        indirect.append((key, _mask(event) & key.events))
                else:
                    try:
                        callback()
                    except Exception as error:
                        self.failed(error)
            # With a time-out something is due soon: the event loop looks at the clock itself.
            if indirect or self.wanted or not found or timeout is not None:
                return indirect


def _ignore(error: Exception) -> None:
    pass


def _mask(event: int) -> int:
    mask = selectors.EVENT_WRITE if event & ~select.EPOLLIN else 0
    return mask | (selectors.EVENT_READ if event & ~select.EPOLLOUT else 0)


class HostLoop(asyncio.SelectorEventLoop):
    """An asyncio event loop that knows direct readers; see :class:`DirectSelector`."""

    def __init__(self) -> None:
        self._direct: DirectSelector = DirectSelector()
        self._direct.failed = self._failed
        super().__init__(self._direct)

    def _failed(self, error: Exception) -> None:
        self.call_exception_handler({"message": "Exception in a direct reader", "exception": error})

    def add_direct_reader(self, fd: int, callback: Callable[[], None]) -> None:
        """Call ``callback`` whenever ``fd`` is readable, ahead of everything else."""
        self.add_reader(fd, callback)
        self._direct.direct[fd] = callback

    def remove_reader(self, fd: Any) -> bool:
        """Stop watching ``fd``, direct or not."""
        self._direct.direct.pop(fd, None)
        return super().remove_reader(fd)

    def call_soon(
        self,
        callback: Callable[[*_Arguments], object],
        *args: *_Arguments,
        context: Context | None = None,
    ) -> asyncio.Handle:
        """Schedule a callback, and see that its turn comes."""
        self._direct.wanted = True
        return super().call_soon(callback, *args, context=context)

    def call_at(
        self,
        when: float,
        callback: Callable[[*_Arguments], object],
        *args: *_Arguments,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:
        """Schedule a callback for later, and see that its time is noticed."""
        self._direct.wanted = True
        return super().call_at(when, callback, *args, context=context)
