"""A byte's way to its session without a detour: direct readers, and looks before a session sleeps.

The plain way is the event loop's own, whose bookkeeping and wake-up cost each message more than a
bus cycle takes. With this one a trip over a terminal takes 0.75 to 0.85 of that to a C echo that
sleeps.
"""

import os
import select
from collections.abc import Callable
from selectors import SelectorKey
from typing import Final

_MOST_EVENTS: Final = 64
"""Descriptors that one look takes; the others are found by the next look. Not measured."""
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


PATIENCE: Final = 8
"""Lone messages in a row after which a session sleeps at once. It trades the wake-ups of a host
that polls for 30 us of looks, as often, for one that does not."""
RETRY: Final = 64
"""Lone messages after which looking is tried again: 30 us spread over 64 trips."""
LATE_NS: Final = 1_000_000
"""A session that gave way for so long between two messages gave the processor to others: far
above a sched_yield on an idle processor, about 1 us."""
CROWDED: Final = 1024
"""Messages after which looking is tried again then; ``benchmarks/fair_links.py`` measures what it
gives to hosts beside each other."""


class SpinPolicy:
    """The patience of one session.

    It is lost for a while when nothing came, and for longer where others want the processor:
    a process that sleeps is let in sooner than one that gives way.

    Attributes:
        left: how many more lone messages it takes to lose it; 0: it is lost.
    """

    def __init__(self) -> None:
        self.left: int = PATIENCE
        self._skipped: int = 0

    def served(self, messages: int) -> None:
        """So many messages came one after the other."""
        if messages > 1:
            self.left = PATIENCE
        elif self.left:
            self.left -= 1
        else:
            self._skipped += 1
            if self._skipped == RETRY:
                self._skipped = 0
                self.left = 1

    def lose(self) -> None:
        """Others want the processor."""
        self.left, self._skipped = 0, RETRY - CROWDED


LOOKS: Final = 24 if len(os.sched_getaffinity(0)) > 1 else 0
"""How often to look for a next message before sleeping: some 30 us. Not on a single processor:
a process that gives way on a busy one comes back later than one that is woken. With it a trip over
a terminal takes 0.75 to 0.85 of that to a C echo that sleeps (docs/performance.md)."""


class SpinTurn:
    """Session served last. Only a sole session may spin.

    Attributes:
        last: the session served last.
        looks: how often a session looks for a next message before it sleeps.
        give_way: lets the host run between two looks.
    """

    def __init__(self) -> None:
        self.last: object = None
        self.looks: int = LOOKS
        self.give_way: Callable[[], object] = os.sched_yield
