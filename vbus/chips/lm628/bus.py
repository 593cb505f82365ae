"""LM628/LM629: edges of the host bus to bus cycles."""

from vbus.trace.bus_watch import BusWatch
from vbus.trace.packets import Cycle


class Lm628Watch(BusWatch):
    """LM628/LM629: a cycle ends when its strobe or /CS rises (LM-BUS-1 to LM-BUS-3)."""

    PINS = ("/CS", "/PS", "/RD", "/WR")

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return a write, a read, or both."""
        cs, ps, rd, wr = before
        if cs:
            return []
        cycles = []
        if not wr and (after[3] or after[0]):
            cycles.append(Cycle(when, True, ps, old))
        if not rd and (after[2] or after[0]):
            cycles.append(Cycle(when, False, ps, data))
        return cycles

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether /CS and /RD are low."""
        return not levels[0] and not levels[2]

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether /CS, or both strobes, are high."""
        return bool(levels[0] or (levels[2] and levels[3]))
