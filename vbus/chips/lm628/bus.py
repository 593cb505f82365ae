"""LM628/LM629: edges of the host bus to bus cycles."""

from vbus.chips.bus_watch import StrobedBus


class Lm628Watch(StrobedBus):
    """A cycle ends when its strobe or /CS rises (LM-BUS-1 to LM-BUS-3)."""

    PINS = ("/CS", "/PS", "/RD", "/WR")
