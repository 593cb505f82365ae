"""What the blocks of the chip set ask of the whole."""

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.signals import Pin, Rule


class ChipSet(Chip):
    """What each of the blocks knows of the chip set it belongs to."""

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
