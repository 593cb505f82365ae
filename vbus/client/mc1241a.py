# Made by contrib.generate.
"""The client of the MC1241A and MC1141A."""

from vbus.chips.mc1241a import host
from vbus.client.blocking import export

export(host, globals())
