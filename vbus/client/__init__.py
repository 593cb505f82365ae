"""The host's end: a bus over any link, and each chip's commands over that bus.

>>> from vbus.client import connect
>>> with connect("pty:/run/vbus/bench-x") as bus:      # doctest: +SKIP
...     print(f"{bus.read(0):02X}h")
84h

:mod:`vbus.client.aio` has the same calls for asyncio.
"""

from vbus.client.bus import Bus, Chip, connect
from vbus.client.message import Event, Later, Message, Ready, Sample, Sync
from vbus.client.units import Units

__all__ = [
    "Bus", "Chip", "Event", "Later", "Message", "Ready", "Sample", "Sync", "Units", "connect",
]  # fmt: skip
