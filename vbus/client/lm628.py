# Made by contrib.generate.
"""The client of the LM628 and LM629."""

from vbus.chips.lm628 import host
from vbus.client.blocking import export

export(host, globals())
