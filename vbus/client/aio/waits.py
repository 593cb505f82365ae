"""How a session waits in an event loop, whose first wait imports asyncio, and for a chip.

A value may be read until two reads say the same: one broken bus cycle is not believed.
"""

import select
from collections.abc import Awaitable, Callable
from typing import Any, Final, TypeVar

from vbus.core.errors import NotReadyError, ReadBackError
from vbus.core.wall_clock import monotonic
from vbus.protocols.quantities import parse_duration

T = TypeVar("T")


class Core:
    """What has a blocking counterpart: that stands before it, in a session that blocks."""

    front: Callable[[], Any] | None = None


async def read_until(
    bus: Any, read: Callable[[], Awaitable[int]], good: Callable[[int], bool], longest: str,
    every: str, lacking: str,
) -> int:  # fmt: skip
    """Read a number until it is as wanted; return it.

    Between the reads ``every`` of chip time passes, so this works in real time and in lockstep.

    Args:
        bus: the session.
        read: reads the number.
        good: tells whether it is as wanted.
        longest: chip time after which the wait is given up.
        every: chip time between two reads.
        lacking: the error, in which ``{0}`` is the number and ``{1}`` the time.

    Raises:
        NotReadyError: it is not, after ``longest``.
    """
    end = await bus.now() + parse_duration(longest)
    while not good(number := await read()):
        # Asked after the read: what is as wanted at the last moment counts.
        if await bus.now() >= end:
            raise NotReadyError(lacking.format(number, longest))
        await bus.delay(every)
    return number


READS: Final = 4
"""Reads after the first one, before a value is given up."""
NEAR: Final = 20
"""Counts that an axis may move between two reads of where it is, at rest."""


async def twice(read: Callable[[], Awaitable[int]], near: int = NEAR) -> int:
    """Read a value until two reads in a row are within ``near``; return the last.

    Raises:
        ReadBackError: five reads all differ.
    """
    before = await read()
    for _ in range(READS):
        value = await read()
        if abs(value - before) <= near:
            return value
        before = value
    raise ReadBackError(f"{READS + 1} reads of one value all differ; the last is {before}")


def ready_within(fd: int, write: bool, seconds: float) -> bool:
    """Whether ``fd`` can be read (or written, if asked) in so many seconds; the thread waits."""
    poll = select.poll()
    poll.register(fd, select.POLLIN | select.POLLOUT if write else select.POLLIN)
    return bool(poll.poll(seconds * 1000))


class Waits:
    """All that differs between a session of an event loop and one that blocks its thread.

    Within ``async with`` no other task has the session.
    """

    def __init__(self) -> None:
        # Here and not above: it takes about as long to import as all of the client.
        import asyncio

        self._lock = asyncio.Lock()

    async def __aenter__(self) -> None:
        await self._lock.acquire()

    async def __aexit__(self, *why: object) -> None:
        self._lock.release()

    async def until_ready(self, fd: int, write: bool, deadline: float) -> bool:
        """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
        import asyncio

        loop = asyncio.get_running_loop()
        ready: asyncio.Future[None] = loop.create_future()

        def wake() -> None:
            if not ready.done():
                ready.set_result(None)

        loop.add_reader(fd, wake)
        if write:
            loop.add_writer(fd, wake)
        try:
            await asyncio.wait_for(ready, max(0.0, deadline - monotonic()))
        except TimeoutError:
            # What came while this process had no turn is there, and came in time.
            return ready_within(fd, write, 0.0)
        finally:
            loop.remove_reader(fd)
            if write:
                loop.remove_writer(fd)
        return True

    async def pause(self, seconds: float) -> None:
        """Let others go on for a while."""
        import asyncio

        await asyncio.sleep(seconds)

    async def opened(self, open_link: Callable[[str], T], where: str) -> T:
        """Open a link."""
        if where.startswith("zenoh:"):  # which waits for the network
            import asyncio

            return await asyncio.to_thread(open_link, where)
        return open_link(where)
