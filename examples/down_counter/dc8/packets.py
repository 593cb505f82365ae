"""DC-8: bus cycles in the datasheet's words."""

from dc8 import datasheet as ds
from vbus.chips.packets import RegisterPackets


class Dc8Packets(RegisterPackets):
    """Reads and writes of registers."""

    FAMILY = "dc8"
    ROWS = ds.REGISTERS
