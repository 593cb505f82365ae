# Made by vbus.cli.generate.
"""The client of the MCP-1200."""

from vbus.chips.mcp1200 import access, host
from vbus.client.blocking import export

export(access, globals())
export(host, globals())
