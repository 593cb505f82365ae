"""A client's bus on a board in this process: the same bytes as over a link, and no waiting."""

import os
from typing import Final

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.client.bus import Bus
from vbus.client.link import BoardLink
from vbus.core.errors import TransportError
from vbus.core.kernel import NEVER
from vbus.core.options import Value
from vbus.faults.row import LinkActs, misfit
from vbus.faults.table import faults
from vbus.protocols.byte import ByteProtocol
from vbus.serve.host_limits import HostWatch
from vbus.transports.traffic import AnswerFault

_ASKED: Final = 100
"""Requests in turn without an answer, after which a host is said to hang: no chip time passes.
Not measured."""


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

    A host that waits for an answer which a fault has taken (:class:`InProcessFaults`) has waited
    in vain at once.

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
        readers = board.stream.readers if board.stream is not None else ()
        self._watches: Final = [one for one in readers if isinstance(one, HostWatch)]
        self._port = board.open_port(label, chips or None)
        self._port.promises = False
        self._protocol = ByteProtocol(self._port)
        self.acting: Final[dict[int, AnswerFault]] = {}
        """Faults that act on it, by number."""
        self._late: bytes = b""
        """Answers that come later."""
        self._asked: int = 0
        """Requests since nothing has passed any more."""

    def write(self, data: memoryview) -> int:
        """Carry out what the bytes ask for."""
        port, protocol = self._port, self._protocol
        if self.silent or self.acting:
            self.replied()  # a host that asks again has passed its bounds without an answer
            if self._dead():
                return len(data)
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
        replies = bytearray(self._protocol.take())
        if not self.acting:
            late, self._late = self._late, b""
            return late + replies
        for number, fault in tuple(self.acting.items()) if replies else ():
            if fault.name != "link_closed":
                self.silent = True
                if fault.bend(replies):
                    del self.acting[number]
        return bytes(replies)

    def _dead(self) -> bool:
        """Tell whether a fault keeps all from the board.

        Raises:
            TransportError: the link is closed.
            HostStuck: the host goes on all the same, and no chip time can pass.
        """
        names = {fault.name for fault in self.acting.values()}
        self._asked += 1
        if "link_closed" in names:
            raise TransportError(f"{self.where}: closed by the other end")
        for watch in self._watches if self._asked > _ASKED else ():
            watch.pass_bound("it asks again and again, and the link is broken")
            watch.check()
        return "link_dead" in names

    def broken(self, number: int, name: str, once: bool) -> None:
        """Have a fault from now on: with ``once`` it is over with one answer."""
        self.acting[number], self._asked = AnswerFault(name, once), 0
        self.silent = self.silent or name == "link_dead"

    def mended(self, number: int) -> None:
        """Have a fault no more: what it held back comes when none acts."""
        fault = self.acting.pop(number, None)
        self._late += fault.held_back if fault is not None else b""

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


class InProcessFaults(LinkActs):
    """Does faults of links to one in this process.

    Args:
        link: the link, ``host0``.
    """

    def __init__(self, link: InProcessLink) -> None:
        self._link: Final = link

    def check(self, name: str, target: str) -> None:
        """Refuse a fault that the link can never have.

        Raises:
            ValueError: it is of messages, or there is no such link.
        """
        said = misfit(faults()[name], target, self._link.where, messages=False)
        if said or target != "host0":
            raise ValueError(said or f"{target}: a function has one link, host0")

    def begin(
        self, number: int, name: str, target: str, once: bool, values: dict[str, Value]
    ) -> str:
        """Let a fault act."""
        self.check(name, target)
        self._link.broken(number, name, once)
        return "1 session"

    def end(self, number: int) -> None:
        """Let it act no more."""
        self._link.mended(number)


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
