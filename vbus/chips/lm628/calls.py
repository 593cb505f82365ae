"""Calls for the LM628 and LM629, one for each command, for asyncio."""

from vbus.chips.lm628 import datasheet
from vbus.chips.lm628.access import Lm628Packets
from vbus.client.aio.access import calls_of

Lm628Calls = calls_of("Lm628Calls", Lm628Packets, datasheet)
