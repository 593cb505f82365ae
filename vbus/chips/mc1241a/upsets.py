"""MC1241A/MC1141A: what can be upset inside the chip set."""

from typing import Final

from vbus.chips.mc1241a.chip import MC1241A
from vbus.core.kernel import NEVER
from vbus.core.options import Option, Value
from vbus.core.signals import HIGH
from vbus.faults.row import CHIP, COUNTED, LASTS, Fault
from vbus.faults.upsets import ChipFaults

STUCK: Final = 10**15
"""Longer than any host waits (ps)."""


class Mc1241aUpsets(ChipFaults):
    """The plants of its axes, HostRdy and its clock."""

    FAULTS = (
        Fault("busy_longest", "chip", "Busy lasts as long as it may.", CHIP, COUNTED,
              (Option("extra", "s", 500_000_000, "added to each busy time (MC1241A)", low=0,
                      high=10**15),)),
        Fault("ready_stuck", "chip", "HostRdy stays low.", CHIP, LASTS),
    )  # fmt: skip
    LIMIT_CLOSED = HIGH

    chip: MC1241A

    def invalidate(self) -> None:
        """Tell the chip set that something behind it is different now."""
        for each in self.chip.axes:
            each.encoder.limit_moved()
        super().invalidate()

    def filter_ps(self, axis: int) -> int:
        """Return how long the inputs' filter dwells (ps)."""
        return self.chip.axes[axis].encoder.filter_dwell

    # -- faults of the chip -------------------------------------------------------------------

    def start(self, name: str, values: dict[str, Value]) -> str:
        """Change what a fault changes; say what that is."""
        chip, now = self.chip, self.chip.kernel.now
        if name == "busy_longest":
            chip.busy_stretch += int(values["extra"])
            return f"each busy time is {values['extra']} ps longer"
        if name == "ready_stuck":
            chip.busy_stretch += STUCK
            if chip.port.busy_until <= now:
                chip.port.busy_since = now
            chip.port.busy_until = now + STUCK
            chip.port.show_ready(False)
            return "HostRdy is low"
        return super().start(name, values)

    def stop(self, name: str, values: dict[str, Value]) -> None:
        """Change it back."""
        chip, now = self.chip, self.chip.kernel.now
        if name == "busy_longest":
            chip.busy_stretch -= int(values["extra"])
        elif name == "ready_stuck":
            chip.busy_stretch -= STUCK
            if chip.port.busy_until > now:
                chip.port.busy_until = now
                if chip.port.due() == NEVER:
                    chip.port.show_ready(True)
