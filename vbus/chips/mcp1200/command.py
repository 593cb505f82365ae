"""The command position, and the numbers a host gives the profile generators."""

from vbus.bits import sign_extend, wrap
from vbus.chips.mcp1200 import datasheet as ds


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

    __slots__ = (
        "accel_delta", "decel_position", "fraction", "left", "moving", "phase", "position",
        "velocity",
    )  # fmt: skip

    def __init__(self) -> None:
        self.position: int = 0
        self.fraction: int = 0
        self.velocity: int = 0
        self.moving: bool = False
        self.phase: int = 0
        self.left: int = 0
        self.accel_delta: int = 0
        self.decel_position: int = 0

    def move(self, velocity: int) -> None:
        """Go on by ``velocity``."""
        total = self.fraction + velocity
        self.position = wrap(self.position + (total >> 8), 24)
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
        """Forget everything: a reset."""
        self.rest()
        self.position = 0
        self.accel_delta = 0
        self.decel_position = 0

    def save(self) -> tuple[int, ...]:
        """Return the state."""
        return (
            self.position, self.fraction, self.velocity, int(self.moving), self.phase, self.left,
            self.accel_delta, self.decel_position,
        )  # fmt: skip

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""
        (
            self.position, self.fraction, self.velocity, moving, self.phase, self.left,
            self.accel_delta, self.decel_position,
        ) = state  # fmt: skip
        self.moving = bool(moving)


def final_position(image: bytes) -> int:
    """R2B, R2A, R29 as a signed number."""
    return sign_extend(
        image[ds.FINAL_MSB] << 16 | image[ds.FINAL_CSB] << 8 | image[ds.FINAL_LSB], 24
    )


def high_velocity(image: bytes) -> int:
    """R23, R24, R25: signed, 1/256 count per sample (MCP-REG-24)."""
    value = image[ds.VELOCITY_MSB] << 16 | image[ds.VELOCITY_CSB] << 8 | image[ds.VELOCITY_LSB]
    return sign_extend(value, 24)


def velocity_goal(image: bytes) -> int:
    """Velocity command of the integral velocity mode, 1/256 count per sample (MCP-VEL-1)."""
    if image[ds.FEATURE] & ds.HIGH_RESOLUTION:
        return high_velocity(image)
    return sign_extend(image[ds.VELOCITY_COMMAND], 8) << 8


def top_velocity(image: bytes) -> int:
    """Top velocity of a profile, 1/256 count per sample (MCP-TRP-1)."""
    if image[ds.FEATURE] & ds.HIGH_RESOLUTION:
        return abs(high_velocity(image))
    return (image[ds.PROFILE_VELOCITY] & 0x7F) << 8


def acceleration(image: bytes) -> int:
    """R27, R26: 1/256 count per sample squared (MCP-REG-25)."""
    return (image[ds.ACCEL_MSB] & 0x7F) << 8 | image[ds.ACCEL_LSB]


def jerk(image: bytes) -> int:
    """R55, R54: 1/65536 count per sample cubed."""
    return image[ds.JERK_MSB] << 8 | image[ds.JERK_LSB]
