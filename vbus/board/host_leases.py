"""What a host may know of the bytes of polls to come, without asking the board."""

from typing import ClassVar, Final

from vbus.board.host_selection import Selection
from vbus.chips.base import OUTPUT, POLL
from vbus.circuit.circuit import Circuit
from vbus.circuit.host_pins import HostPins
from vbus.core.kernel import END, US
from vbus.core.state import Names

LONGEST_LEASE: Final = 100_000 * US
"""How far ahead a lease reaches at most: a host that polls for ever is heard of now and then."""


class HostLeases:
    """The leases of one session; see :meth:`~vbus.protocols.port.HostPort.lease`.

    Args:
        board: the board.
        selection: the session's chips.
        pins: the session's pins.

    Attributes:
        until: instant until which the last lease holds (ps); 0 if there is none.
    """

    WIRING: ClassVar[Names] = ("_board", "_pins", "_selection")
    DERIVED: ClassVar[Names] = ("until",)

    def __init__(self, board: Circuit, selection: Selection, pins: HostPins) -> None:
        self._board: Circuit = board
        self._selection: Selection = selection
        self._pins: HostPins = pins
        self.until: int = 0

    def give(self, address: int) -> tuple[int, int, int] | None:
        """Tell how long the byte just read will be read again.

        Nothing is promised in real time, on nodes, and while something is broken.
        """
        board, found = self._board, self._selection.steady(address)
        if found is None:
            return None
        if board.policy == "realtime" or board.granted or board.disturbed:
            return None
        outputs = self._pins.output_word()
        chip, _ = found
        until = min(board.kernel.next_due, END)
        if chip is not None:
            until = min(until, chip.due(POLL))
        for neighbour in self._selection.chips:
            until = min(until, neighbour.due(OUTPUT))
        now: int = board.kernel.now
        if until <= now + self._selection.cycle:
            return None
        self.until = min(until, now + LONGEST_LEASE)
        return outputs, now, self.until

    def foresee(self, address: int) -> tuple[int, int] | None:
        """Tell what comes after the lease just given."""
        found, when, kernel = self._selection.steady(address), self.until, self._board.kernel
        chip, place = found if found is not None else (None, 0)
        following = chip.foresee(place, when) if chip is not None else None
        if following is None:
            return None
        data, until = following
        until = min(min(until, kernel.next_due), min(kernel.now + LONGEST_LEASE, END))
        for neighbour in self._selection.chips:
            if neighbour is not chip:
                until = min(until, neighbour.due(OUTPUT))
        if until <= when + self._selection.cycle:
            return None
        self.until = until
        return data, until

    def end(self) -> None:
        """Before anything else acts on the board: carry out the cycles that were promised."""
        until, self.until = self.until, 0
        if until > self._board.kernel.now:
            self._board.pass_until(until)
