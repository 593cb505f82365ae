# Made by contrib.generate.
"""The client of the LM628 and LM629."""

from vbus.chips.lm628.host import *  # noqa: F403
