"""Calls for the MCP-1200, two for each register, for asyncio."""

from vbus.chips.mcp1200 import datasheet
from vbus.chips.mcp1200.access import Mcp1200Access
from vbus.client.aio.access import calls_of

Mcp1200Calls = calls_of("Mcp1200Calls", Mcp1200Access, datasheet)
