"""The host's end for asyncio: the same calls as in :mod:`vbus.client`, to be awaited."""

from vbus.client.aio.bus import Bus, Chip, connect
from vbus.client.message import Event, Later, Message, Ready, Sample, Sync

__all__ = ["Bus", "Chip", "Event", "Later", "Message", "Ready", "Sample", "Sync", "connect"]
