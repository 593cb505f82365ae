"""A recorded run that can be walked through in both directions."""

from bisect import bisect_right
from collections.abc import Callable, Sequence

from vbus.board import snapshot as snapshots
from vbus.board.board import Board
from vbus.board.snapshot import Snapshot
from vbus.record.format import Entry
from vbus.record.player import Player

Condition = Callable[[Board], bool]
"""Looks at a board that is up to date; changes nothing."""


class History:
    """A run from its journal, at any entry of it.

    Going forward makes the recorded calls again. Going back loads the nearest snapshot taken on
    the way and goes forward from there, so every state is exact. Snapshots thin out as the run
    grows: there are never more than ``keep``.

    Args:
        make: builds the board of the journal, at instant 0 and with no ports open.
        entries: the journal's entries, in order.
        every: entries between two snapshots at first.
        keep: snapshots kept at most (at least 2).

    Attributes:
        position: entries that have been played: 0 is power-on.
    """

    def __init__(
        self, make: Callable[[], Board], entries: Sequence[Entry], every: int = 256, keep: int = 64
    ) -> None:
        self.entries: Sequence[Entry] = entries
        self.position: int = 0
        self._make: Callable[[], Board] = make
        self._every: int = max(1, every)
        # With one, thinning out would drop it at once.
        self._keep: int = max(2, keep)
        self._player: Player = Player(make())
        self._snapshots: dict[int, tuple[Snapshot, list[int]]] = {}
        """Snapshots by position, with the journal's numbers of the sessions in them."""

    @property
    def board(self) -> Board:
        """The board as it stood after :attr:`position` entries; going back makes a new one."""
        return self._player.board

    def to(self, position: int) -> Board:
        """Go to where ``position`` entries have been played (0 up); return the board.

        Raises:
            ValueError: the run has no such position.
        """
        if not 0 <= position <= len(self.entries):
            raise ValueError(f"position {position}: the run has 0 to {len(self.entries)}")
        if position < self.position:
            self._go_back(position)
        while self.position < position:
            self._forward()
        return self.board

    def step(self, count: int = 1) -> Board:
        """Go ``count`` entries on, at most to the end; negative ones go back, to the start."""
        return self.to(min(max(0, self.position + count), len(self.entries)))

    def to_instant(self, when: int) -> Board:
        """Go to instant ``when`` (ps): every call that had returned by then has been made.

        Inside a call, which runs time itself, the board stands where the call was made.
        """
        place = bisect_right(self.entries, when, key=lambda entry: entry.after)
        # Also where it stands: time may have passed there since the last call.
        if place <= self.position:
            self._go_back(place)
        self.to(place)
        # The next call runs time itself: the board must not stand beyond where that began.
        if place < len(self.entries):
            when = min(when, self.entries[place].when)
        if when > self.board.now:
            self.board.pass_until(when)
        return self.board

    def first(self, condition: Condition) -> Entry | None:
        """Find the first entry after which ``condition`` holds, and go there; None if none is."""
        self._go_back(0)
        if self._holds(condition):
            return None
        while self.position < len(self.entries):
            self._forward()
            if self._holds(condition):
                return self.entries[self.position - 1]
        return None

    # -- inside -------------------------------------------------------------------------------

    def _holds(self, condition: Condition) -> bool:
        self.board.catch_up()
        return condition(self.board)

    def _forward(self) -> None:
        self._player.play(self.entries[self.position])
        self.position += 1
        if self.position % self._every == 0 and self.position not in self._snapshots:
            taken = snapshots.take(self.board), self._player.open_sessions()
            self._snapshots[self.position] = taken
            if len(self._snapshots) > self._keep:
                # Every second one goes: those that stay are as far apart everywhere.
                self._every *= 2
                for place in [p for p in self._snapshots if p % self._every]:
                    del self._snapshots[place]

    def _go_back(self, position: int) -> None:
        """Load the nearest snapshot at or before ``position`` and play on to it."""
        place = max((p for p in self._snapshots if p <= position), default=0)
        self._player = Player(self._make())
        if place:
            self._player.resume(*self._snapshots[place])
        self.position = place
        while self.position < position:
            self._forward()
