# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/trace/bus_watch.py; change that, or the generator.
"""Edges of a host bus to bus cycles: for captures, which have pins and nothing else.

The sigrok decoders use copies of this file, so it may need nothing but the standard library.
"""

from .packets import Cycle


class BusWatch:
    """Base: follows the control lines and the data bus of one chip.

    A write latches what stood on the bus before its trailing edge; a read gives what stands there
    at the edge: what a chip does of itself at an instant comes before what its host does.
    """

    PINS: tuple[str, ...] = ()
    """Control lines by the manual's names, in the order of the levels fed."""
    DATA: str = "D0-D7"
    """The data bus."""

    def __init__(self) -> None:
        self._before: tuple[int, ...] = ()
        self._data: int = 0

    def change(self, when: int, levels: tuple[int, ...], data: int) -> list[Cycle]:
        """Take the levels from ``when`` on; return the bus cycles that ended.

        Args:
            when: instant, in whatever unit the capture has.
            levels: control lines, in the order of :attr:`PINS`.
            data: the data bus as a number.
        """
        cycles: list[Cycle] = []
        if self._before and levels != self._before:
            cycles = self.edges(when, self._before, levels, self._data, data)
        self._before = levels
        self._data = data
        return cycles

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return the cycles that end when lines move from ``before`` to ``after``.

        ``old`` stood on the bus until then, ``data`` stands there at the edge.
        """
        raise NotImplementedError

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether the chip, not the host, drives the data bus."""
        raise NotImplementedError

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether no cycle is under way."""
        raise NotImplementedError

    def save(self) -> tuple[int, ...]:
        """Return what is remembered of earlier edges, beside the last levels."""
        return ()

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""


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


class Mcp1200Watch(BusWatch):
    """MCP-1200: the address is latched by /ALE or /CS, a write ends with /CS, a read with /OE.

    What is accessed before the first address has been seen is passed over.
    """

    PINS = ("/ALE", "/CS", "/OE", "R/W")
    DATA = "DB0-DB7"

    def __init__(self) -> None:
        super().__init__()
        self._address: int = -1
        self._closed: bool = True
        self._read: int = -1

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Follow the address latch (MCP-BUS-2), /CS (MCP-BUS-4) and /OE (MCP-BUS-7)."""
        ale, cs, oe, write_not = before
        cycles = []
        if not oe and after[2] and self._read >= 0:
            cycles.append(Cycle(when, False, self._read, data))
            self._read = -1
        if ale and not after[0]:
            self._closed = False
        if not self._closed and ((not ale and after[0]) or (cs and not after[1])):
            self._address = old & 0x7F
            self._closed = True
        if not cs and after[1] and self._address >= 0:
            if write_not:
                self._read = self._address
            else:
                cycles.append(Cycle(when, True, self._address, old))
        return cycles

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether /OE is low, and no write is under way (MCP-BUS-7)."""
        return not levels[2] and bool(levels[1] or levels[3])

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether /ALE, /CS and /OE are high."""
        return bool(levels[0] and levels[1] and levels[2])

    def save(self) -> tuple[int, ...]:
        """Return the latched address, whether the latch is closed, and the read under way."""
        return (self._address, int(self._closed), self._read)

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""
        self._address, closed, self._read = state
        self._closed = bool(closed)


WATCHES: dict[str, type[BusWatch]] = {
    "lm628": Lm628Watch,
    "mc1241a": Mc1241aWatch,
    "mcp1200": Mcp1200Watch,
}
"""What follows the bus of each chip family."""
