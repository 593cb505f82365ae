"""What the blocks of the chip set ask of the whole."""

from collections.abc import Callable

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.kernel import Clock, Kernel
from vbus.options import Settings
from vbus.signals import Pin, Policy, Rule, Violation


class ChipSet(Chip):
    """What each of the blocks knows of the chip set it belongs to.

    Attributes:
        instant: instant of what the chip set is doing now (ps).
    """

    def __init__(
        self,
        name: str,
        part: str,
        kernel: Kernel,
        clock: Clock,
        settings: Settings | None,
        policy: Policy | None,
        file: Callable[[Violation], None] | None,
    ) -> None:
        super().__init__(name, part, kernel, clock, settings, policy, file)
        self.instant: i64 = 0

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

    def begin_slot(self, clk: int) -> None:
        """A microstep look-up begins at clock ``clk``: outputs follow."""
        raise NotImplementedError

    def look_for_interrupt(self) -> None:
        """Latch an axis whose event its mask lets through (PMD-INT-1)."""
        raise NotImplementedError

    def release_interrupt(self) -> None:
        """RST_INTRPT: the line goes high for a clock at least (PMD-INT-3)."""
        raise NotImplementedError

    def reset_command(self) -> None:
        """RESET: like ~Reset, counted from when the command was written (PMD-CMD-75)."""
        raise NotImplementedError

    def busy_end(self) -> int:
        """Return when a busy time that begins now will end (PMD-BUS-7)."""
        raise NotImplementedError

    def show_ready(self, ready: bool, when: int) -> None:
        """Put HostRdy to its level at ``when``."""
        raise NotImplementedError

    def stopped(self) -> bool:
        """Whether ~Reset holds the chip set."""
        raise NotImplementedError

    def hold_reset(self, when: int) -> None:
        """~Reset is low; if it still is at ``when``, everything stops."""
        raise NotImplementedError

    def release_reset(self, lost: bool) -> None:
        """~Reset rises: the reset runs, unless the pulse was too short and is ``lost``."""
        raise NotImplementedError
