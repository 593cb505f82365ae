"""An event loop that serves hosts without a detour."""

import asyncio
import select
import selectors
import signal
from collections.abc import Callable, Coroutine
from contextvars import Context
from typing import Any, Final, TypeVarTuple

from vbus.server.watchdog import Watchdog

_Arguments = TypeVarTuple("_Arguments")
_MOST_EVENTS: Final = 64
_OUT: Final = select.EPOLLOUT


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
                if callback is None or event & _OUT:
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
                return self._current(indirect)

    def _current(
        self, indirect: list[tuple[selectors.SelectorKey, int]]
    ) -> list[tuple[selectors.SelectorKey, int]]:
        """Leave out what a callback has unregistered meanwhile.

        Its descriptor may be in use again, and the event loop would take the new reader for the
        old one and remove it.
        """
        known = self.get_map()
        return [(key, mask) for key, mask in indirect if known.get(key.fd) is key]


def _ignore(error: Exception) -> None:
    pass


def _mask(event: int) -> int:
    mask = selectors.EVENT_WRITE if event & ~select.EPOLLIN else 0
    return mask | (selectors.EVENT_READ if event & ~_OUT else 0)


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


def run_until_signal(serve: Callable[[asyncio.Event], Coroutine[Any, Any, None]]) -> None:
    """Run a coroutine in a loop of its own; SIGINT and SIGTERM set the event it is given.

    One that is stuck and cannot is killed within a second; see :mod:`vbus.server.watchdog`.
    """

    async def main(watchdog: Watchdog) -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()

        def end(number: int, frame: object) -> None:
            watchdog.heard()
            loop.call_soon_threadsafe(stop.set)

        def woken() -> None:  # and now, or just before, end() is called
            if not watchdog.woken():
                loop.remove_reader(watchdog.wake)

        # Not the loop's own handlers: the one descriptor C's handler writes to is the watchdog's.
        before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
        loop.add_reader(watchdog.wake, woken)
        try:
            await serve(stop)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    with Watchdog() as watchdog, asyncio.Runner(loop_factory=HostLoop) as runner:
        runner.run(main(watchdog))
