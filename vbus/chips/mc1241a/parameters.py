"""The double-buffered registers, and SET_ and GET_ commands served from the table."""

from typing import ClassVar

from vbus.bits import sign_extend, wrap
from vbus.chips.mc1241a.datasheet import PARAMETERS
from vbus.chips.tables import Command
from vbus.state import Names


class Registers:
    """One set of the double-buffered registers of an axis (PMD-UPD-1).

    An axis has two: the host loads the buffer, the profile generator uses the active set. The
    three action flags stand in the buffer only.
    """

    STATE: ClassVar[Names] = (
        "position", "velocity", "acceleration", "max_acceleration", "jerk", "ratio",
        "motor_command", "stop", "smooth_stop", "synch",
    )  # fmt: skip

    def __init__(self) -> None:
        self.position: int = 0
        """Destination (usteps)."""
        self.velocity: int = 0
        """Largest speed (1/65536 usteps/cycle)."""
        self.acceleration: int = 0
        """Trapezoidal: magnitude; velocity contouring: signed (1/65536 usteps/cycle^2)."""
        self.max_acceleration: int = 0
        """S-curve (1/65536 usteps/cycle^2)."""
        self.jerk: int = 0
        """S-curve (2^-32 usteps/cycle^3)."""
        self.ratio: int = 0
        """Gear (1/65536 usteps per encoder count)."""
        self.motor_command: int = 0
        """Amplitude of the microstep waveforms, -32767 to 32767."""
        self.stop: int = 0
        self.smooth_stop: int = 0
        self.synch: int = 0

    def copy(self, other: "Registers") -> None:
        """Take the values of another set."""
        self.position, self.velocity = other.position, other.velocity
        self.acceleration, self.jerk = other.acceleration, other.jerk
        self.max_acceleration, self.ratio = other.max_acceleration, other.ratio
        self.motor_command, self.synch = other.motor_command, other.synch
        self.stop, self.smooth_stop = other.stop, other.smooth_stop


def fit(name: str, value: int) -> int:
    """Cut data to the width of parameter ``name`` (PMD-CMD-82)."""
    width = PARAMETERS[name]
    if width.signed:
        return wrap(value, width.bits)
    return value & ((1 << width.bits) - 1)


def in_range(row: Command, fitted: int, value: int) -> bool:
    """Tell whether cutting ``value`` to ``fitted`` has lost nothing."""
    bits = 16 * row.write
    return fitted == (sign_extend(value, bits) if row.signed else value)
