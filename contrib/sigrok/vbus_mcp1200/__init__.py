# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from its own template; change that, or the generator.
"""
The host bus of the MCP-1200 motion controller.

Shows bus cycles, packets with their values in the manual's words, and status reads.
"""

from .pd import Decoder
