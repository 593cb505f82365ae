"""A client's bus on a board in this process: the same bytes as over a link, and no waiting."""

import os
from typing import Final

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.client.bus import Bus
from vbus.client.link import BoardLink
from vbus.core.errors import TransportError
from vbus.core.kernel import NEVER
from vbus.protocols.byte import ByteProtocol
from vbus.serve.host_limits import HostWatch


class HostTurn:
    """What has to be done around a host's calls: on one board, nothing but letting time pass.

    Args:
        board: the board.
    """

    def __init__(self, board: Board) -> None:
        self.board: Final = board

    def let_pass(self, port: HostBus) -> None:
        """Let time pass as far as a host that is held waits for."""
        self.board.pass_until(max(port.hold_until, self.board.now))

    def end(self, port: HostBus) -> None:
        """The host has done what it wanted to: bring all there that a test can look at."""
        self.board.catch_up()


class InProcessLink(BoardLink):
    """Carries bytes to a port of ``board`` and back, in the caller's own thread.

    What a host has to wait for (WAIT, DELAY) has happened when its call returns: time is moved as
    far as the host asked, and every chip and plant of the board is there. A host gets no leases,
    because the board would be behind a host that answers polls by itself.

    Args:
        board: the board.
        label: the host's name in traces.
        chips: names of the chips it reaches; all if empty.
        turn: what is done around its calls; None for a board that has no nodes beside it.
    """

    by_descriptor = False
    at_once = True

    def __init__(
        self, board: Board, label: str = "host", chips: tuple[str, ...] = (),
        turn: HostTurn | None = None,
    ) -> None:  # fmt: skip
        # Always readable: what else a call waits for, an event, is here when it looks.
        super().__init__(f"board {board.name}", os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC))
        self._turn: Final = turn or HostTurn(board)
        self._watches: Final = [one for one in board.observers if isinstance(one, HostWatch)]
        self._port = board.open_port(label, chips or None)
        self._port.promises = False
        self._protocol = ByteProtocol(self._port)

    def write(self, data: memoryview) -> int:
        """Carry out what the bytes ask for."""
        port, protocol = self._port, self._protocol
        try:
            protocol.receive(bytes(data))
            while port.held:
                if port.hold_until == NEVER:
                    raise TransportError(
                        f"{self.where}: this waits for another host of the same process to end its"
                        " claim, which cannot happen meanwhile"
                    )
                self._turn.let_pass(port)
                if port.go_on():
                    protocol.resume()
        finally:
            self._turn.end(port)
        return len(data)

    def read(self) -> bytes:
        """Return the replies that are here."""
        self._protocol.report_events()
        return self._protocol.take()

    def replied(self) -> None:
        """End a host that has passed a bound of a :class:`HostWatch`.

        Raises:
            HostStuck: the host must not go on.
        """
        __tracebackhide__ = True
        for watch in self._watches:
            watch.check()

    def close(self) -> None:
        """End the session; again is harmless."""
        if self.fd >= 0:
            self._protocol.reset()
            self._port.close()
            self._turn.end(self._port)
        super().close()


def connect_in_process(
    board: Board, label: str = "host", chips: tuple[str, ...] = (), turn: HostTurn | None = None
) -> Bus:
    """Return a client's bus on a board of this process, with HELLO done.

    It is what :func:`vbus.client.connect` returns, so a driver written on that runs unchanged.
    """
    bus = Bus(InProcessLink(board, label, chips, turn=turn))
    try:
        bus.hello()
    except BaseException:
        bus.close()
        raise
    return bus
