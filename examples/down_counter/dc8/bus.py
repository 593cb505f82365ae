"""DC-8: edges of the host bus to bus cycles."""

from vbus.chips.bus_watch import StrobedBus


class Dc8Watch(StrobedBus):
    """A cycle ends when its strobe or /CS rises."""

    PINS = ("/CS", "A0", "/RD", "/WR")
