"""Waiting until a condition holds on a board, packets in the manual's words included."""

from collections.abc import Callable

from vbus.chips.packets import Packet
from vbus.circuit.circuit import Circuit
from vbus.errors import VbusError
from vbus.events.condition import COMMAND
from vbus.events.decode import BoardPackets, settings_for_decoders
from vbus.events.watch import Watch
from vbus.protocols.quantities import format_instant
from vbus.signals import Violation


class PacketWatch(Watch):
    """A watch to which a command has come at the end of its packet."""

    def __init__(
        self,
        text: str,
        board: Circuit,
        what: str = "condition",
        met: Callable[[], None] | None = None,
    ) -> None:
        super().__init__(text, board, what, met)
        families = {chip.name: chip.FAMILY for chip in board.chips}
        settings = settings_for_decoders(board.chips)
        self._packets = BoardPackets(families, self._packet, settings)

    def _packet(self, chip: str, packet: Packet) -> None:
        self.happen(COMMAND, chip, packet.text)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Follow the packets."""
        if self.condition.commands:
            self._packets.bus_cycle(when, host, chip, write, address, data)
        super().bus_cycle(when, host, chip, write, address, data)

    def violation(self, violation: Violation) -> None:
        """Take down a violation; the packets know which cycles are lost for it."""
        self._packets.violation(violation)
        super().violation(violation)


class Holds:
    """Tells, look by look, whether a condition holds; a board not looked at before begins anew.

    Args:
        text: the condition.
        board: a board for its names, or one like it.

    Attributes:
        stays: whether it holds for ever once it does.

    Raises:
        ConditionError: it is none, or names what the board does not have.
    """

    def __init__(self, text: str, board: Circuit) -> None:
        self._text = text
        self._watch: PacketWatch | None = None
        self.stays: bool = PacketWatch(text, board).condition.stays

    def __call__(self, board: Circuit) -> bool:
        """Tell whether it holds on a board that is up to date."""
        if self._watch is None or self._watch.board is not board:
            self._watch = PacketWatch(self._text, board)
            self._watch.begin()
        return self._watch.look()


def wait_until(board: Circuit, condition: str, within: int) -> int:
    """Let time pass until a condition holds, or not at all if it does; return that instant (ps).

    Args:
        board: a board whose time is nobody else's.
        condition: the condition.
        within: chip time in which it must come to hold (ps).

    Raises:
        VbusError: it makes no sense on this board, or has not come to hold in time.
    """
    watch = PacketWatch(condition, board)
    watch.begin()
    begun = board.now
    try:
        while not watch.look():
            if board.now >= begun + within:
                raise VbusError(not_met(watch, begun, within))
            due = max(board.next_due(), board.now + 1)
            board.pass_until(min(due, watch.next_look(), begun + within))
    finally:
        watch.end()
        board.catch_up()
    return board.now


def not_met(watch: Watch, begun: int, within: int) -> str:
    """Return a sentence about a condition that has not come to hold."""
    found = watch.found()
    return (
        f'"{watch.condition.text}" has not come to hold within {format_instant(within)} of chip'
        f" time, since {format_instant(begun)}{'; ' if found else ''}{found}"
    )
