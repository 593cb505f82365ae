"""MC1241A/MC1141A: edges of the host bus to bus cycles."""

from vbus.chips.bus_watch import StrobedBus
from vbus.chips.packets import Cycle


class Mc1241aWatch(StrobedBus):
    """A cycle ends when its strobe or ~HostSlct rises (PMD-BUS-2, PMD-BUS-3)."""

    PINS = ("~HostSlct", "HostCmd", "~HostRead", "~HostWrite")

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return a write or a read; nothing is on the bus in a read with HostCmd high."""
        found = super().edges(when, before, after, old, data)
        return [cycle for cycle in found if cycle.write or not cycle.address]

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether ~HostSlct and ~HostRead are low, and HostCmd too (PMD-BUS-4)."""
        return super().reading(levels) and not levels[1] and bool(levels[3])
