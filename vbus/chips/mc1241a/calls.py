"""Calls for the MC1241A and MC1141A, one for each command, for asyncio."""

from vbus.chips.mc1241a import datasheet
from vbus.chips.mc1241a.access import Mc1241aPackets
from vbus.client.aio.access import calls_of

Mc1241aCalls = calls_of("Mc1241aCalls", Mc1241aPackets, datasheet)
