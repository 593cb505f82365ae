# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from vbus/chips/bus_watch.py; change that, or the generator.
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
    STATE: tuple[str, ...] = ()
    """What a subclass remembers of earlier edges, beside the last levels; see ``vbus.state``."""
    DERIVED: tuple[str, ...] = ("_before", "_data")

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

        ``old`` stood on the bus until then, ``data`` stands there at the edge. Which cycles end,
        and where, must follow from ``before`` and ``after`` alone, unless :attr:`STATE` names what
        else decides: boards ask once for what is always the same.
        """
        raise NotImplementedError

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether the chip, not the host, drives the data bus."""
        raise NotImplementedError

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether no cycle is under way."""
        raise NotImplementedError

    def busy(self, levels: tuple[int, ...]) -> bool:
        """Tell whether lines may move from these levels so that :meth:`edges` has work to do."""
        return True


class StrobedBus(BusWatch):
    """A bus with a select, one address line and a strobe each way, all but the address active low.

    :attr:`PINS` are select, address, read and write. A cycle ends when its strobe or the select
    rises.
    """

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return a write, a read, or both."""
        select, address, read, write = before
        if select:
            return []
        cycles = []
        if not write and (after[3] or after[0]):
            cycles.append(Cycle(when, True, address, old))
        if not read and (after[2] or after[0]):
            cycles.append(Cycle(when, False, address, data))
        return cycles

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether the select and the read strobe are low."""
        return not levels[0] and not levels[2]

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether the select, or both strobes, are high."""
        return bool(levels[0] or (levels[2] and levels[3]))

    def busy(self, levels: tuple[int, ...]) -> bool:
        """Tell whether a cycle is under way: without one none can end."""
        return not self.idle(levels)
