"""What a host has asked for is carried out, although the host has gone."""

import logging
from collections.abc import Callable
from typing import Final

from vbus.kernel import NEVER, SECOND
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.server.pace import Pace, nothing
from vbus.transports.base import Link

LONGEST: Final = 60 * SECOND
"""A wait longer than this (ps) is given up where another host has come meanwhile."""

log = logging.getLogger("vbus")


class Departures:
    """What hosts have left under way that have gone.

    A host's end is orderly: the complete requests it had sent are carried out, in their order,
    whatever they wait for. A wait (DELAY, WAIT, a time stamp ahead) is carried out to its end, a
    CLAIM when the claim of another host ends, and then what stands behind. Half a request at the
    end is discarded, with a warning. Whether a host has closed its link or was killed cannot be
    told from here.

    Where hosts are masters of time nobody is let in while time is still to pass for one that has
    gone: the next host begins at the same instant in every run. With another host there a wait
    longer than :data:`LONGEST` is given up, at an instant that is a multiple of that before its
    end, with a warning. In real time nobody waits for those that have gone; a wait ends with its
    host if nothing stands behind it, or, with a warning, if it is longer than that.

    Args:
        pacer: moves the board's time.

    Attributes:
        under_way: what is still to be carried out.
        closed: whether the board stops, and nothing more is carried out.
    """

    def __init__(self, pacer: Pace) -> None:
        self._pacer: Pace = pacer
        self.under_way: list[Departure] = []
        self._arrivals: list[_Arrival] = []
        self.closed: bool = False
        self.look_for_hosts: Callable[[], None] = nothing
        """Ends the sessions of hosts that have gone, when what they had sent is carried out."""

    def take(self, port: HostPort, protocol: Protocol, peer: str) -> bool:
        """Carry out what a host that has gone waits for; False if there is nothing to do."""
        if self.closed:
            return False
        if not port.held:
            report_half(peer, protocol)
            return False
        if not protocol.awaited() and (self._pacer.real or by_claim(port)):
            return False
        departure = Departure(self._pacer, port, protocol, peer, self)
        self.under_way.append(departure)
        if self._pacer.real and port.hold_until - self._pacer.now > LONGEST and not by_claim(port):
            departure.give_up("others go on in real time")
        else:
            departure.wait()
        return True

    @property
    def passing(self) -> bool:
        """Whether time has still to pass for a host that has gone."""
        ports = [departure.port for departure in self.under_way]
        return any(not by_claim(port) for port in ports)

    @property
    def waited_for(self) -> bool:
        """Whether another host waits to be let in."""
        return bool(self._arrivals)

    def admit(self, link: Link, begin: Callable[[Link], None]) -> None:
        """Let a host begin: at once, or when time has passed for those that have gone."""
        if not self._pacer.real:
            self.look_for_hosts()
        if self.passing and not self._pacer.real:
            self._arrivals.append(_Arrival(link, begin, self._arrivals.remove))
        else:
            begin(link)

    def close(self) -> None:
        """The board stops: nothing more is carried out, and nobody let in."""
        self.closed = True
        arrivals, self._arrivals = self._arrivals, []
        for arrival in arrivals:
            arrival.link.close()
        for departure in list(self.under_way):
            departure.give_up("the board stops")

    def done(self, departure: "Departure") -> None:
        """Forget one that has ended; let in who waited for it."""
        self.under_way.remove(departure)
        while self._arrivals and not self.passing:
            self._arrivals.pop(0).begin()


class Departure:
    """The port and the protocol of one host that has gone.

    Args:
        pacer: moves the board's time.
        port: the host's hold on the board, which it lets go of at the end.
        protocol: the wire format, on that port.
        peer: the host, for people.
        departures: is told of the end.
    """

    def __init__(
        self,
        pacer: Pace,
        port: HostPort,
        protocol: Protocol,
        peer: str,
        departures: Departures,
    ) -> None:
        self._pacer: Pace = pacer
        self.port: HostPort = port
        self._protocol: Protocol = protocol
        self._peer: str = peer
        self._departures: Departures = departures
        port.on_resume = self.resume_soon

    def wait(self) -> None:
        """Go on when time has come to the end of the wait, or to where it may be given up."""
        if by_claim(self.port):
            return  # the end of the other host's claim calls resume_soon()
        until, now = self.port.hold_until, self._pacer.now
        left = 0 if self._pacer.real else max(until - now - 1, 0) // LONGEST * LONGEST
        self._pacer.wake_at(until - left, self._look_again if left else self._go_on)

    def resume_soon(self) -> None:
        """The claim that was waited for has ended."""
        self._pacer.forget(self._go_on)
        self._pacer.wake_at(self._pacer.now, self._go_on)

    def _look_again(self) -> None:
        if self._departures.waited_for:
            self.give_up("another host waits to be let in")
        else:
            self.wait()

    def _go_on(self) -> None:
        port = self.port
        try:
            self._pacer.catch_up()
            if port.go_on():
                self._protocol.resume()
                self._protocol.out.clear()
            if port.held:
                self.wait()
                return
            report_half(self._peer, self._protocol)
        except Exception:
            log.exception("internal error while the wait of a host that has gone was carried out")
        self._end()

    def give_up(self, why: str) -> None:
        """Carry out no more of it."""
        log.warning(
            "%s: the host has gone, and what it had sent still waits for %s; %s, so the rest is"
            " discarded", self._peer,
            "another host's claim" if by_claim(self.port) else "chip time", why,
        )  # fmt: skip
        self._end()

    def _end(self) -> None:
        """Let go of everything."""
        for callback in (self._look_again, self._go_on):
            self._pacer.forget(callback)
        for step in (self._protocol.reset, self.port.close):
            try:
                step()
            except Exception:  # the next host shall find nothing of this one
                log.exception("internal error while what a host has left was ended")
        self._departures.done(self)


def by_claim(port: HostPort) -> bool:
    """Tell whether a port is held until another host's claim ends."""
    return port.held and port.hold_until == NEVER


def report_half(peer: str, protocol: Protocol) -> None:
    """Say of a host that has gone that its last request is not whole, if that is so."""
    half = protocol.half()
    if half:
        log.warning(
            "%s: the host has gone in the midst of a request; the %d bytes of it that came are"
            " discarded", peer, half,
        )  # fmt: skip


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
