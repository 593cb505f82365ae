"""An event loop that serves hosts without a detour."""

import asyncio
import contextlib
import os
import select
import selectors
import signal
import socket
from collections.abc import Callable, Collection, Coroutine, Iterable
from contextlib import suppress
from contextvars import Context
from typing import Any, TypeVarTuple

from vbus.core.wall_clock import monotonic
from vbus.serve.fast_path import FastReaders
from vbus.serve.time.watchdog import Watchdog

_Arguments = TypeVarTuple("_Arguments")


class DirectSelector(selectors.EpollSelector):
    """Serves direct descriptors while it waits; see :class:`~vbus.serve.fast_path.FastReaders`.

    Everything else goes through the event loop as ever, which gets its turn whenever it has
    something to do.
    """

    def __init__(self, readers: FastReaders) -> None:
        super().__init__()
        self._readers: FastReaders = readers

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Serve direct descriptors; return the indirect that are ready."""
        poll = self._selector.poll  # type: ignore[attr-defined]
        known = self.get_map()
        wait = -1.0 if timeout is None else max(timeout, 0.0)
        ready = self._readers.serve(poll, wait, known.get)
        # Not what a callback has unregistered meanwhile: its descriptor may be in use again, and
        # the event loop would take the new reader for the old one and remove it.
        return [
            (key, _mask(event) & key.events) for key, event in ready if known.get(key.fd) is key
        ]


def _mask(event: int) -> int:
    # As in the standard library: an error or a hang-up is an event for reader and writer.
    mask = selectors.EVENT_WRITE if event & ~select.EPOLLIN else 0
    return mask | (selectors.EVENT_READ if event & ~select.EPOLLOUT else 0)


class HostLoop(asyncio.SelectorEventLoop):
    """An asyncio event loop that knows direct readers; see :class:`DirectSelector`."""

    def __init__(self) -> None:
        self._readers: FastReaders = FastReaders(self._failed)
        super().__init__(DirectSelector(self._readers))

    def time(self) -> float:
        """Return seconds of a clock that no test stops."""
        return monotonic()

    def _failed(self, error: Exception) -> None:
        self.call_exception_handler({"message": "Exception in a direct reader", "exception": error})

    def add_direct_reader(self, fd: int, callback: Callable[[], None]) -> None:
        """Call ``callback`` whenever ``fd`` is readable, ahead of everything else."""
        self.add_reader(fd, callback)
        self._readers.callbacks[fd] = callback

    def remove_reader(self, fd: Any) -> bool:
        """Stop watching ``fd``, direct or not."""
        self._readers.callbacks.pop(fd, None)
        return super().remove_reader(fd)

    def call_soon(
        self,
        callback: Callable[[*_Arguments], object],
        *args: *_Arguments,
        context: Context | None = None,
    ) -> asyncio.Handle:
        """Schedule a callback, and see that its turn comes."""
        self._readers.wanted = True
        return super().call_soon(callback, *args, context=context)

    def call_at(
        self,
        when: float,
        callback: Callable[[*_Arguments], object],
        *args: *_Arguments,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:
        """Schedule a callback for later, and see that its time is noticed."""
        self._readers.wanted = True
        return super().call_at(when, callback, *args, context=context)


async def first_of(events: Iterable[asyncio.Event]) -> None:
    """Wait until one of some events is set."""
    waits = [asyncio.ensure_future(event.wait()) for event in events]
    try:
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    finally:
        await _cancelled(waits)


async def _cancelled(tasks: Collection[asyncio.Future[Any]]) -> None:
    """Cancel tasks and wait for their ends, which no loop that is closed next would bring."""
    for task in tasks:
        task.cancel()
    await asyncio.wait(tasks)


async def done_before(ends: Iterable[asyncio.Event], work: Coroutine[Any, Any, None]) -> bool:
    """Do some work; return whether it was done before one of ``ends`` was set, which cancels it."""
    doing, over = asyncio.ensure_future(work), asyncio.ensure_future(first_of(ends))
    await asyncio.wait((doing, over), return_when=asyncio.FIRST_COMPLETED)
    done = doing.done()
    await _cancelled((doing, over))
    with suppress(asyncio.CancelledError):
        doing.result()
    return done


def run_until_signal(serve: Callable[[asyncio.Event], Coroutine[Any, Any, None]]) -> None:
    """Run a coroutine in a loop of its own; SIGINT and SIGTERM set the event it is given.

    One that is stuck and cannot is killed within a second; see :mod:`vbus.serve.time.watchdog`.
    """

    async def main(watchdog: Watchdog) -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()

        def end(number: int, frame: object) -> None:
            watchdog.heard()
            loop.call_soon_threadsafe(stop.set)

        def woken() -> None:  # Python calls end() at this moment, or has just done so
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


def tell_ready() -> None:
    """Say once that every link is open, where ``$NOTIFY_SOCKET`` asks for it."""
    place = os.environ.pop("NOTIFY_SOCKET", "")
    if not place:
        return
    address = f"\0{place[1:]}" if place.startswith("@") else place
    with (
        contextlib.suppress(OSError),  # who wanted to know has gone
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link,
    ):
        link.sendto(f"READY=1\nMAINPID={os.getpid()}\n".encode(), address)
