# Made by vbus.tools.generate.
"""The client of the MCP-1200."""

from vbus.chips.mcp1200.generated.host import *  # noqa: F403
