"""A client's bus on a board in this process: the same bytes as over a link, and no waiting."""

import os
from typing import Final

from vbus.board.board import Board
from vbus.board.cards import Card
from vbus.client.bus import Bus
from vbus.client.link import Link
from vbus.errors import TransportError
from vbus.kernel import NEVER
from vbus.protocols.byte import ByteProtocol
from vbus.testing.limits import Watch


class HostStuck(AssertionError):
    """A host under test has passed one of its :class:`~vbus.testing.limits.Limits`."""


class InProcessLink(Link):
    """Carries bytes to a port of ``board`` and back, in the caller's own thread.

    What a host has to wait for (WAIT, DELAY) has happened when its call returns: time is moved as
    far as the host asked.

    Args:
        board: the board.
        label: the host's name in traces.
        chips: names of the chips it reaches; all if empty.
        cycle_ps: what a whole bus cycle costs; 0 is the default of the time policy.
        card: address decoding of a plug-in card.
        watch: ends the host with :class:`HostStuck` when it passes a bound.
    """

    by_descriptor = False

    def __init__(
        self,
        board: Board,
        label: str = "host",
        chips: tuple[str, ...] = (),
        cycle_ps: int = 0,
        card: Card | None = None,
        watch: Watch | None = None,
    ) -> None:
        # Always readable: whatever a call waits for is here when it looks.
        super().__init__(f"board {board.name}", os.eventfd(1, os.EFD_NONBLOCK | os.EFD_CLOEXEC))
        self._board: Final = board
        self._port = board.open_port(label, chips or None, cycle_ps, card)
        self._protocol = ByteProtocol(self._port)
        self._watch: Watch | None = watch

    def write(self, data: memoryview) -> int:
        """Carry out what the bytes ask for."""
        port, protocol = self._port, self._protocol
        protocol.receive(bytes(data))
        while port.held:
            if port.hold_until == NEVER:
                raise TransportError(
                    f"{self.where}: this waits for another host of the same process to end its"
                    " claim, which cannot happen meanwhile"
                )
            self._board.run_until(max(port.hold_until, self._board.now))
            if port.go_on():
                protocol.resume()
        if self._watch is not None and self._watch.stuck:
            raise HostStuck(f"the host hangs: {self._watch.stuck}")
        return len(data)

    def read(self) -> bytes:
        """Return the replies that are here."""
        self._protocol.report_events()
        return self._protocol.take()

    def close(self) -> None:
        """End the session; again is harmless."""
        if self.fd >= 0:
            self._protocol.reset()
            self._port.close()
        super().close()


def connect_in_process(
    board: Board, label: str = "host", chips: tuple[str, ...] = (), watch: Watch | None = None
) -> Bus:
    """Return a client's bus on a board of this process, with HELLO done.

    It is what :func:`vbus.client.connect` returns, so a driver written on that runs unchanged.
    """
    bus = Bus(InProcessLink(board, label, chips, watch=watch))
    try:
        bus.hello()
    except BaseException:
        bus.close()
        raise
    return bus
