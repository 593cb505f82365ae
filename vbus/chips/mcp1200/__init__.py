"""MCP-1200 Series, General Purpose Motion Control ASIC."""

from vbus.chips.mcp1200.chip import MCP1200

__all__ = ["MCP1200"]
