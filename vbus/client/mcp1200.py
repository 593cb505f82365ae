# Made by contrib.generate.
"""The client of the MCP-1200."""

from vbus.chips.mcp1200 import host
from vbus.client.blocking import export

export(host, globals())
