# Made by contrib.generate.
"""The client of the MC1241A and MC1141A."""

from vbus.chips.mc1241a.host import *  # noqa: F403
