"""The double-buffered registers, and SET_ and GET_ commands served from the table."""

from vbus.bits import sign_extend, wrap
from vbus.chips.mc1241a.datasheet import PARAMETERS
from vbus.chips.tables import Command


class Registers:
    """One set of the double-buffered registers of an axis (PMD-UPD-1).

    An axis has two: the host loads the buffer, the profile generator uses the active set. The
    three action flags stand in the buffer only.
    """

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

    def save(self) -> tuple[int, ...]:
        """Return the whole state."""
        return (
            self.position, self.velocity, self.acceleration, self.max_acceleration, self.jerk,
            self.ratio, self.motor_command, self.stop, self.smooth_stop, self.synch,
        )  # fmt: skip

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""
        (
            self.position, self.velocity, self.acceleration, self.max_acceleration, self.jerk,
            self.ratio, self.motor_command, self.stop, self.smooth_stop, self.synch,
        ) = state  # fmt: skip


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
