"""Hosts that go: how a hang-up is noticed, and how what the host has asked for is carried out."""

import asyncio
import logging
import select
import typing
from collections.abc import Callable, Iterable
from typing import Final

from vbus.core.kernel import NEVER, SECOND
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.serve.time.pacer import TimeSource
from vbus.transports.base import Link, ignore

LONGEST: Final = 60 * SECOND
"""A wait longer than this (ps) is given up where another host has come meanwhile.
It is about as long as a person waits for a terminal; not measured."""

log = logging.getLogger("vbus")


class Departed(typing.Protocol):
    """A session whose host has gone."""

    link: Link
    port: HostPort
    protocol: Protocol

    def more(self) -> bool:
        """Whether the protocol has not been given all that the host had sent."""

    def give_up(self, why: str) -> None:
        """Carry out no more of what it waits for."""


class DetachedWaits:
    """Carries out what hosts had asked for before they went.

    A host's end is orderly: the complete requests it had sent are carried out, in their order,
    whatever they wait for. A wait (DELAY, WAIT, a time stamp ahead) is carried out to its end, a
    CLAIM when the claim of another host ends, and then what stands behind. Half a request at the
    end is discarded, with a warning. A host that has closed its link and one that was killed look
    the same here.

    Where hosts are masters of time, no host is let in while time is still to pass for one that has
    gone: the next host begins at the same instant in every run. With another host there a wait
    longer than :data:`LONGEST` is given up, at an instant that is a multiple of that before its
    end, with a warning. In real time no host waits for those that have gone; a wait ends with its
    host if nothing stands behind it, or, with a warning, if it is longer than that.

    Args:
        pacer: moves the board's time.

    Attributes:
        under_way: sessions of which something is still to be carried out.
        closed: whether the board stops, and nothing more is carried out.
    """

    def __init__(self, pacer: TimeSource) -> None:
        self._pacer: TimeSource = pacer
        self.under_way: list[Departed] = []
        self._arrivals: list[_Arrival] = []
        self.closed: bool = False
        self.look_for_hosts: Callable[[], None] = ignore
        """Ends the sessions of hosts that have gone, when what they had sent is carried out."""

    def take(self, session: Departed) -> str | None:
        """Return whether what a host that has gone waits for is carried out.

        Returns:
            None: there is nothing to do. A reason why it is given up at once; "" if it is not.
        """
        port, protocol, real = session.port, session.protocol, self._pacer.real
        if self.closed:
            return None
        if not (port.held or session.more()):
            report_half(session.link.peer, protocol)
            return None
        # Nothing stands behind the wait: in real time it would only let time pass, and a claim
        # would end with its host.
        if not (session.more() or protocol.awaited()) and (real or by_claim(port)):
            return None
        self.under_way.append(session)
        waits = real and port.held and not by_claim(port)
        long = waits and port.hold_until - self._pacer.now > LONGEST
        return "others go on in real time" if long else ""

    def look_at(self, until: int) -> int:
        """Return the next instant at which a wait until then may be over, or given up (ps)."""
        if self._pacer.real or until == NEVER:
            return until
        # Counted back from the end of the wait: the instants do not depend on when a host comes.
        return until - max(until - self._pacer.now - 1, 0) // LONGEST * LONGEST

    def gives_up(self, port: HostPort) -> bool:
        """Tell whether a wait is given up now: it is long, and another host waits to be let in."""
        long = not by_claim(port) and port.hold_until - self._pacer.now >= LONGEST
        return bool(self._arrivals) and long and not self._pacer.real

    @property
    def passing(self) -> bool:
        """Whether time has still to pass for a host that has gone."""
        return any(not by_claim(session.port) for session in self.under_way)

    def admit(self, link: Link, begin: Callable[[Link], None]) -> None:
        """Let a host begin: at once, or when time has passed for those that have gone."""
        if not self._pacer.real:
            self.look_for_hosts()
        if self.passing and not self._pacer.real:
            self._arrivals.append(_Arrival(link, begin, self._arrivals.remove))
        else:
            begin(link)

    def close(self) -> None:
        """The board stops: nothing more is carried out, and no host let in."""
        self.closed = True
        arrivals, self._arrivals = self._arrivals, []
        for arrival in arrivals:
            arrival.link.close()
        for session in list(self.under_way):
            session.give_up("the board stops")

    def done(self, session: Departed) -> None:
        """Forget one that has ended; let in who waited for it."""
        self.under_way.remove(session)
        # Each that is let in may go at once, and leave a wait of its own.
        while self._arrivals and not self.passing:
            self._arrivals.pop(0).begin()


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
    """A host that has come meanwhile: what its transport reads is buffered for its session."""

    def __init__(
        self, link: Link, begin: Callable[[Link], None], forget: Callable[["_Arrival"], None]
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


class DisconnectPoller:
    """One descriptor for all sessions that wait.

    Args:
        loop: the event loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop: asyncio.AbstractEventLoop = loop
        self._poll: select.epoll = select.epoll()
        self._callbacks: dict[int, Callable[[], None]] = {}

    def open(self) -> None:
        """Notice from now on."""
        self._loop.add_reader(self._poll.fileno(), self.look)

    def close(self) -> None:
        """Notice nothing more."""
        self._loop.remove_reader(self._poll.fileno())
        self._poll.close()

    def watch(self, fd: int, callback: Callable[[], None]) -> None:
        """Call back when the host behind ``fd`` has gone, until :meth:`forget`."""
        if fd not in self._callbacks:
            self._callbacks[fd] = callback
            self._poll.register(fd, 0)  # errors and hang-ups are always reported

    def forget(self, fd: int) -> None:
        """Look no more; again is harmless."""
        if self._callbacks.pop(fd, None) is not None:
            self._poll.unregister(fd)

    def gone(self, fd: int) -> bool:
        """Tell whether a host sends no more, though that may not have been noticed yet."""
        return bool(_states([fd], select.POLLRDHUP))

    def waits(self, fd: int) -> bool:
        """Whether bytes have come that are not read yet."""
        return any(state & select.POLLIN for _, state in _states([fd], select.POLLIN))

    def gone_of(self, fds: Iterable[int]) -> set[int]:
        """Return those whose hosts have gone altogether, and hear no more either."""
        return {fd for fd, _ in _states(fds, 0)}

    def look(self) -> None:
        """Call back for hosts that have gone."""
        for fd, _ in self._poll.poll(0):
            callback = self._callbacks.get(fd)
            if callback is not None:
                callback()


def _states(fds: Iterable[int], asked: int) -> list[tuple[int, int]]:
    """Return the descriptors of which there is something to tell now, each with what it is."""
    poll = select.poll()
    for fd in fds:
        poll.register(fd, asked)
    return poll.poll(0)
