"""Descriptors that are served ahead of the event loop."""

import select
from collections.abc import Callable
from selectors import SelectorKey
from typing import Final

_MOST_EVENTS: Final = 64
_OUT: Final = select.EPOLLOUT


class FastReaders:
    """Calls the callbacks of *direct* descriptors as soon as they are readable.

    A host's message then costs one ``epoll_wait`` and one call. The event loop's own bookkeeping,
    which takes longer than a bus cycle, is left out.

    Attributes:
        callbacks: what to call, by descriptor.
        wanted: set when something is scheduled: the event loop must look at it.
        failed: takes what a callback raised.
    """

    def __init__(self, failed: Callable[[Exception], object]) -> None:
        self.callbacks: dict[int, Callable[[], None]] = {}
        self.wanted: bool = False
        self.failed: Callable[[Exception], object] = failed

    def serve(
        self,
        poll: Callable[[float, int], list[tuple[int, int]]],
        wait: float,
        find: Callable[[int], SelectorKey | None],
    ) -> list[tuple[SelectorKey, int]]:
        """Serve direct descriptors until the event loop has something to do.

        Args:
            poll: ``epoll_wait``: seconds to wait, and how many events at most.
            wait: seconds to wait for an event, once: the event loop has something due then, and
                looks at the clock itself. -1: for ever, again and again.
            find: what the event loop knows a descriptor by.

        Returns:
            What is ready of the other descriptors, as it was known then, each with its events.
        """
        callbacks = self.callbacks
        self.wanted = False
        others: list[tuple[SelectorKey, int]] = []
        while True:
            found = poll(wait, _MOST_EVENTS)
            for fd, event in found:
                callback = callbacks.get(fd)
                if callback is None or event & _OUT:
                    key = find(fd)
                    if key is not None:
                        others.append((key, event))
                else:
                    try:
                        callback()
                    except Exception as error:
                        self.failed(error)
            if others or self.wanted or wait >= 0.0 or not found:
                return others
