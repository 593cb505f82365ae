"""Waiting for a descriptor, in an asyncio event loop."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

from vbus.wall_clock import monotonic

T = TypeVar("T")

Lock = asyncio.Lock


async def until_ready(fd: int, write: bool, deadline: float) -> bool:
    """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
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


async def pause(seconds: float) -> None:
    """Let others go on for a while."""
    await asyncio.sleep(seconds)


async def opened(open_link: Callable[[str], T], where: str) -> T:
    """Open a link."""
    if where.startswith("zenoh:"):  # which waits for the network
        return await asyncio.to_thread(open_link, where)
    return open_link(where)
