"""What the blocks of the chip set ask of the whole."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.strobes import AcLimits
from vbus.core.signals import Pin, Rule
from vbus.core.state import Names


class ChipSet(Chip):
    """What each of the blocks knows of the chip set it belongs to."""

    ac: AcLimits
    instant: i64 = 0
    """Instant of what the chip set is doing now (ps)."""
    held: bool = False
    """~Reset holds the chip set."""
    busy_stretch: int = 0
    """Fault: this much is added to every busy time (ps)."""

    def find(self, rule: Rule, detail: str) -> None:
        """File a finding about the host at the instant of what the chip is doing."""
        self.report(rule, detail=detail, when=self.instant)

    def put(self, pin: Pin, level: int) -> None:
        """Drive an output at the instant of what the chip is doing, be it found out later."""
        if pin.level != level:
            pin.drive(level)
            if pin.net.changed_at == self.kernel.now:
                pin.net.changed_at = self.instant

    def follow_encoders(self) -> None:
        """Bring the position counters up to the present instant."""
        raise NotImplementedError

    def reset_command(self) -> None:
        """RESET: like ~Reset, counted from when the command was written (PMD-CMD-75)."""
        raise NotImplementedError

    def hold_reset(self, when: int) -> None:
        """~Reset is low; if it still is at ``when``, everything stops."""
        raise NotImplementedError

    def release_reset(self, lost: bool) -> None:
        """~Reset rises: the reset runs, unless the pulse was too short and is ``lost``."""
        raise NotImplementedError


class ProfileRegisters:
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
        self.motor_command: i64 = 0
        """Amplitude of the microstep waveforms, -32767 to 32767."""
        self.stop: int = 0
        self.smooth_stop: int = 0
        self.synch: int = 0

    def copy(self, other: "ProfileRegisters", kept: tuple[str, ...] = ()) -> None:
        """Take the values of another set, but for those ``kept``."""
        for name in self.STATE:
            if name not in kept:
                setattr(self, name, getattr(other, name))

    def differs(self, active: "ProfileRegisters") -> bool:
        """Whether a number that every update copies is another there (PMD-UPD-1)."""
        names = self.STATE[: self.STATE.index("motor_command")]
        return any(getattr(self, name) != getattr(active, name) for name in names)


class SharedParameters:
    """What the axes have in common."""

    STATE: ClassVar[Names] = ("time", "output_mode", "limit_sense", "sensing: bool")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Take the values of the manual's reset table (PMD-RST-2)."""
        self.time: int = 0
        """Cycles since reset, 32 bits."""
        self.output_mode: int = ds.OUTPUT_PWM
        self.limit_sense: int = 0
        self.sensing: bool = True
