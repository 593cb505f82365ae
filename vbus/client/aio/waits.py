"""How a session waits in an event loop, whose first wait imports asyncio, and for a chip."""

from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from vbus.core.errors import NotReadyError
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
        if await bus.now() >= end:
            raise NotReadyError(lacking.format(number, longest))
        await bus.delay(every)
    return number


class Waits:
    """All that differs between a session of an event loop and one that blocks its thread.

    Within ``async with`` no other task has the session.
    """

    def __init__(self) -> None:
        import asyncio

        self._lock = asyncio.Lock()

    def __aenter__(self) -> Awaitable[None]:
        return self._lock.__aenter__()

    def __aexit__(self, *why: Any) -> Awaitable[None]:
        return self._lock.__aexit__(*why)

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
            return False
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
