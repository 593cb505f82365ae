"""MC1241A/MC1141A: edges of the host bus to bus cycles."""

from vbus.trace.bus_watch import BusWatch
from vbus.trace.packets import Cycle


class Mc1241aWatch(BusWatch):
    """MC1241A: a cycle ends when its strobe or ~HostSlct rises (PMD-BUS-2, PMD-BUS-3)."""

    PINS = ("~HostSlct", "HostCmd", "~HostRead", "~HostWrite")

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return a write or a read; nothing is on the bus in a read with HostCmd high."""
        select, command, read, write = before
        if select:
            return []
        cycles = []
        if not write and (after[3] or after[0]):
            cycles.append(Cycle(when, True, command, old))
        if not read and not command and (after[2] or after[0]):
            cycles.append(Cycle(when, False, 0, data))
        return cycles

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether ~HostSlct and ~HostRead are low, and HostCmd too (PMD-BUS-4)."""
        return not levels[0] and not levels[1] and not levels[2] and bool(levels[3])

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether ~HostSlct, or both strobes, are high."""
        return bool(levels[0] or (levels[2] and levels[3]))
