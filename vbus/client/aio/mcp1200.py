# Made by contrib.generate.
"""The client of the MCP-1200."""

from vbus.chips.mcp1200.host import *  # noqa: F403
