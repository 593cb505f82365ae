"""What ``vbus exec --cpu`` tells the program that runs an image."""

from msgspec import Struct

from vbus.boardfile.sections import CpuSection


class CpuSettings(Struct):
    """All of it.

    Attributes:
        processor: which one.
        cpu: its section of the board file, with the usual values where that says nothing.
        cycles: clock cycles after which the run ends; 0: none.
        until: what the firmware sends at the end.
        stats: whether the speed is printed at the end.
    """

    processor: str
    cpu: CpuSection
    cycles: int = 0
    until: str = ""
    stats: bool = False
