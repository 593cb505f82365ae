"""The key space: what stands where on the network."""

from typing import Final

ROOT: Final = "vbus"
"""First chunk of every key."""

ACCESS: Final = f"{ROOT}/@access"
"""Asked by a host that got no reply: what may the holder of my certificate use?"""
OWNERS: Final = f"{ROOT}/*/owner/*"
"""Liveliness: every board, with the sessions that own its keys."""


def owner(board: str, session: str) -> str:
    """Return the liveliness token of the process that serves ``board``."""
    return f"{ROOT}/{board}/owner/{session}"


def bus(board: str, chip: str = "") -> str:
    """Return the key at which hosts ask for bus cycles of a chip; or of all, if none is given."""
    return f"{ROOT}/{board}/{chip}/bus" if chip else f"{ROOT}/{board}/bus"


def host(bus_key: str, session: str) -> str:
    """Return the liveliness token of a host, by the public name of its session."""
    return f"{bus_key}/hosts/{session}"


def requests(token: str) -> str:
    """Return the key at which a host posts messages, below its liveliness token."""
    return f"{token}/requests"


def replies(token: str) -> str:
    """Return the key at which the replies to what a host has posted come."""
    return f"{token}/replies"


def paused(bus_key: str) -> str:
    """Return the liveliness token that is there as long as the board is paused."""
    return f"{bus_key}/paused"


def status(board: str) -> str:
    """Return the key of what a board tells about itself (JSON)."""
    return f"{ROOT}/{board}/status"


def telemetry(board: str, chip: str) -> str:
    """Return the key of a chip's positions and the like."""
    return f"{ROOT}/{board}/{chip}/telemetry"


def cycles(board: str, chip: str) -> str:
    """Return the key of the stream of a chip's bus cycles."""
    return f"{ROOT}/{board}/{chip}/cycles"


def pin(board: str, chip: str, name: str) -> str:
    """Return the key of a pin; a slash in its name is written ``~``."""
    return f"{ROOT}/{board}/{chip}/pins/{name.replace('/', '~')}"
