"""Time that a host has asked for passes, although the host has gone."""

import logging
from collections.abc import Callable
from typing import Final

from vbus.kernel import NEVER, SECOND
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.server.pace import Pace, nothing
from vbus.transports.base import Link

LONGEST: Final = 60 * SECOND
"""A wait is carried out to its end if it is no longer than this (ps)."""

log = logging.getLogger("vbus")


class Departures:
    """What hosts that were killed while they waited have left under way.

    When a host was killed, and when that was noticed, the wall clock decides. So that the next
    host begins at the same instant in every run, a wait (DELAY, WAIT, a time stamp ahead) is
    carried out to its end, and with it what the host had sent; nobody is let in before. A wait
    longer than :data:`LONGEST` is given up at the next instant that is a multiple of that before
    its end. On boards in real time the wall clock moves time in any case: nothing is left.

    Args:
        pacer: moves the board's time.

    Attributes:
        under_way: what is still to be carried out.
    """

    def __init__(self, pacer: Pace) -> None:
        self._pacer: Pace = pacer
        self.under_way: list[Departure] = []
        self._arrivals: list[_Arrival] = []
        self._closed: bool = False
        self.look_for_hosts: Callable[[], None] = nothing
        """Ends the sessions of hosts that have gone, when what they had sent is carried out."""

    def take(self, port: HostPort, protocol: Protocol) -> bool:
        """Carry out what a host that has gone waits for; False if there is nothing to do."""
        if self._pacer.real or self._closed or not port.held or port.hold_until == NEVER:
            return False
        departure = Departure(self._pacer, port, protocol, self._done)
        self.under_way.append(departure)
        departure.wait()
        return True

    def admit(self, link: Link, begin: Callable[[Link], None]) -> None:
        """Let a host begin: at once, or when nothing is under way any more."""
        if not self._pacer.real:
            self.look_for_hosts()
        if self.under_way:
            self._arrivals.append(_Arrival(link, begin, self._arrivals.remove))
        else:
            begin(link)

    def close(self) -> None:
        """The board stops: nothing more is carried out, and nobody let in."""
        self._closed = True
        arrivals, self._arrivals = self._arrivals, []
        for arrival in arrivals:
            arrival.link.close()
        for departure in list(self.under_way):
            departure.end()

    def _done(self, departure: "Departure") -> None:
        self.under_way.remove(departure)
        while self._arrivals and not self.under_way:
            self._arrivals.pop(0).begin()


class Departure:
    """The port and the protocol of one host that has gone.

    Args:
        pacer: moves the board's time.
        port: the host's hold on the board, which it lets go of at the end.
        protocol: the wire format, on that port.
        done: called at the end.
    """

    def __init__(
        self,
        pacer: Pace,
        port: HostPort,
        protocol: Protocol,
        done: Callable[["Departure"], None],
    ) -> None:
        self._pacer: Pace = pacer
        self.port: HostPort = port
        self._protocol: Protocol = protocol
        self._done: Callable[[Departure], None] = done

    def wait(self) -> None:
        """Go on when time has come to the end of the wait, or to where it is given up."""
        until, now = self.port.hold_until, self._pacer.now
        given_up = (until - now) // LONGEST * LONGEST
        self._pacer.wake_at(until - given_up, self.end if given_up else self._go_on)

    def _go_on(self) -> None:
        port = self.port
        try:
            self._pacer.catch_up()
            if port.go_on():
                self._protocol.resume()
                self._protocol.out.clear()
            if port.held and port.hold_until != NEVER:
                self.wait()
                return
        except Exception:
            log.exception("internal error while the wait of a host that has gone was carried out")
        self.end()

    def end(self) -> None:
        """Let go of everything."""
        self._pacer.forget(self.end)
        self._pacer.forget(self._go_on)
        for step in (self._protocol.reset, self.port.close):
            try:
                step()
            except Exception:  # the next host shall find nothing of this one
                log.exception("internal error while what a host has left was ended")
        self._done(self)


class _Arrival:
    """A host that has come meanwhile: what its transport reads is kept for its session."""

    def __init__(
        self,
        link: Link,
        begin: Callable[[Link], None],
        forget: Callable[["_Arrival"], None],
    ) -> None:
        self.link: Link = link
        self._begin: Callable[[Link], None] = begin
        self._forget: Callable[[_Arrival], None] = forget
        self._messages: list[bytes] = []
        self._gone: bool = False
        link.on_data = self._messages.append
        link.on_end = self._ended

    def begin(self) -> None:
        """Let the host begin, and serve what it has sent; it may have gone since."""
        link = self.link
        self._begin(link)
        for data in self._messages:
            link.on_data(data)
        if self._gone:
            link.on_end(True)

    def _ended(self, carry_out: bool) -> None:
        if carry_out:
            self._gone = True
        else:
            self._forget(self)
            self.link.close()
