"""The command position: what every profile generator moves."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.bits import wrap_word
from vbus.state import Names


class Command:
    """Where the axis is told to be, and how fast; every generator moves this.

    Attributes:
        position: 24-bit command position (MCP-POS-2).
        fraction: 1/256 counts beyond it, 0..255.
        velocity: 1/256 count per sample in the last sample.
        moving: a profile or interpolation runs: the in-motion flag F2.
        phase: what R06 shows.
        left: what R19 shows.
        accel_delta: what R31-R33 show.
        decel_position: what R39-R3B show.
    """

    STATE: ClassVar[Names] = (
        "position", "fraction", "velocity", "moving: bool", "phase", "left", "accel_delta",
        "decel_position",
    )  # fmt: skip

    def __init__(self) -> None:
        self.position: i64 = 0
        self.fraction: i64 = 0
        self.velocity: i64 = 0
        self.moving: bool = False
        self.phase: i64 = 0
        self.left: i64 = 0
        self.accel_delta: i64 = 0
        self.decel_position: i64 = 0

    def move(self, velocity: i64) -> None:
        """Go on by ``velocity``."""
        total = self.fraction + velocity
        self.position = wrap_word(self.position + (total >> 8), 0x800000)
        self.fraction = total & 0xFF
        self.velocity = velocity

    def rest(self) -> None:
        """Stand where the command is; the fraction is dropped."""
        self.fraction = 0
        self.velocity = 0
        self.moving = False
        self.phase = 0
        self.left = 0

    def clear(self) -> None:
        """Forget everything: a hard reset."""
        self.rest()
        self.position = 0
        self.accel_delta = 0
        self.decel_position = 0
