"""MCP-1200 Series, General Purpose Motion Control ASIC."""
