"""Sessions of a node whose time is granted by all nodes: they wait for the grant, not the clock."""

import asyncio
import heapq
from collections.abc import Callable

from vbus.board.board import Board
from vbus.server.pacer import Pacer


class GrantedPacer(Pacer):
    """Wakes sessions when a grant has reached what they wait for.

    Args:
        board: the node's board, in lockstep or slaved time.
        changed: called when a host has done something, so that time may run on.
    """

    def __init__(self, board: Board, changed: Callable[[], None]) -> None:
        super().__init__(board)
        self._changed: Callable[[], None] = changed

    def catch_up(self) -> bool:
        """Do nothing: time is where its nodes have brought it."""
        return True

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Serve sessions from here on."""
        self._loop = loop

    def wake_at(self, instant: int, callback: Callable[[], None]) -> None:
        """Call back when the grant includes ``instant`` (ps)."""
        self._wake_number += 1
        heapq.heappush(self._wakes, (instant, self._wake_number, callback))
        self._changed()

    def touched(self) -> None:
        """A host has been served: it may want time now."""
        self._changed()

    def granted(self) -> None:
        """Time may run further: go on with the sessions that waited for it."""
        if self.board.limit > self._near:
            self._nearing(self.board.limit)
        self._wake(self.board.limit)
