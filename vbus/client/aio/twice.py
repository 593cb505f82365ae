"""A value that is read until two reads say the same: one broken bus cycle is not believed."""

from collections.abc import Awaitable, Callable
from typing import Final

from vbus.core.errors import ReadBackError

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
