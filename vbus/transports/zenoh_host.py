"""One host on the network, as the board sees it: messages in, replies and events out."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, Final

import zenoh

from vbus.network import envelope, keys
from vbus.network.exchange import Exchange
from vbus.transports.base import MessageLink
from vbus.transports.traffic import EVENT, REPLY, Traffic

log = logging.getLogger("vbus")

PLAIN: Final = "text/plain"
MOST_EVENTS: Final = 1 << 20
"""Bytes of events that are stored for a host until it asks for them: a bound of memory."""
DIRECT: Final = 1 << 16
"""Bytes of replies that a host has not acknowledged, up to which the next one is sent at once: the
system takes as many for a host that reads nothing. More are sent by a thread of that host's own:
the reply to a query blocks where the host has asked for that, and Zenoh does not tell whether it
has."""
GIVES_UP_SECONDS: Final = 6.0
"""How long a board that closes waits for replies that block (s): Zenoh gives one up, and the host's
link with it, after a lease of 1 s, and after 5 s where the board is a client of a router. A session
closed before that took 10 s for it, in which no other session of the process could send."""


class ZenohLink(MessageLink):
    """The session of one host.

    Args:
        network: the board's own Zenoh session.
        bus_key: the key at which the host asks.
        session: the public name of its session.
        chips: the chips it reaches; empty for all of the entry.
        traffic: its messages go through here.
        ended: called once when the session is over, with the link.
        posts: whether it may send messages as samples, which all can hear.

    Attributes:
        exchange: puts its messages in order.
        token_seen: whether its liveliness token has been seen.
    """

    def __init__(
        self,
        network: zenoh.Session,
        bus_key: str,
        session: str,
        chips: tuple[str, ...],
        traffic: Traffic,
        ended: Callable[["ZenohLink"], None],
        posts: bool,
    ) -> None:
        super().__init__(f"zenoh:{bus_key} host {session}", chips)
        self.token: str = keys.host(bus_key, session)
        self.session: str = session
        self.exchange: Exchange = Exchange(lambda data: self.on_data(data))
        self.token_seen: bool = False
        self.gone_since: float = -1.0
        self._network: zenoh.Session = network
        self._traffic: Traffic = traffic
        self._ended: Callable[[ZenohLink], None] = ended
        self._replies: Any = None
        self._posts: bytes | None = envelope.POSTS if posts else None
        self._events: zenoh.Query | None = None
        self._unheard: list[bytes] = []
        """Events from before the host has asked for them."""
        self._pushed: int = 0
        """Messages of events so far."""
        self.lost: int = 0
        """How many of those have not reached the host, as it says."""
        self._open: bool = True
        self._later: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._sender: Thread | None = None

    def take(self, query: zenoh.Query, header: envelope.Envelope, data: bytes) -> None:
        """Take a message."""
        answer, refuse = partial(self._answer, query), partial(self.refuse, query)
        self.exchange.take(header.number, header.acknowledged, data, answer, refuse)

    def _answer(self, query: zenoh.Query, data: bytes) -> None:
        send = partial(send_reply, query, data, attachment=self._posts)
        self._traffic.pass_on(
            REPLY, self.session, lambda times: self._send(partial(send, times=times))
        )

    def _send(self, send: Callable[[], None]) -> None:
        """Send a reply; a host that does not read its replies must not hold others up."""
        if self.exchange.unacknowledged <= DIRECT:
            send()
            return
        if self._sender is None:
            self._sender = Thread(target=self._send_all, daemon=True)
            self._sender.start()
        self._later.put(send)

    def _send_all(self) -> None:
        """Send replies until the session is over; in a thread of the host."""
        while (send := self._later.get()) is not None:
            send()

    def settle(self) -> None:
        """Wait, after :meth:`close`, until no reply blocks any more."""
        if self._sender is not None:
            self._sender.join(GIVES_UP_SECONDS)

    def refuse(self, query: zenoh.Query, code: str, reason: str) -> None:
        """Refuse a message, with a reason for people behind a code for programs."""
        send = partial(send_refusal, query, code, reason)
        self._traffic.pass_on(
            REPLY, self.session, lambda times: self._send(partial(send, times=times))
        )

    def take_posted(self, header: envelope.Envelope, data: bytes) -> None:
        """Take a message that came as a sample."""
        number = header.number
        answer, refuse = partial(self._post, number, ""), partial(self._refuse, number)
        self.exchange.take(number, header.acknowledged, data, answer, refuse)

    def _refuse(self, number: int, code: str, reason: str) -> None:
        self._post(number, code, reason.encode())

    def _post(self, number: int, code: str, data: bytes) -> None:
        """Publish the reply of a posted message."""
        self._traffic.pass_on(
            REPLY, self.session, lambda times: self._publish(number, code, data, times)
        )

    def _publish(self, number: int, code: str, data: bytes, times: int) -> None:
        """Publish it as often as it is to arrive; a host that has gone is no error.

        One that does not read loses it: it is stored until the host acknowledges it, and sent again
        when the host repeats its message.
        """
        if not times:
            return
        with suppress(zenoh.ZError):
            if self._replies is None:
                self._replies = self._network.declare_publisher(
                    keys.replies(self.token),
                    congestion_control=zenoh.CongestionControl.DROP,
                    reliability=zenoh.Reliability.RELIABLE,
                    express=True,
                )
            for _ in range(times):
                self._replies.put(data, attachment=envelope.reply_to(number, code))

    def answer(self, data: bytes) -> None:
        """Send the reply of the message being carried out."""
        self.exchange.done(data)

    def left(self) -> list[bytes]:
        """Take the messages that wait for the one that is being carried out."""
        return self.exchange.leave()

    def push(self, data: bytes) -> None:
        """Send events to the host, and to no other; when it has asked for them."""
        if self._events is None:
            self._unheard.append(data)
            if sum(map(len, self._unheard)) > MOST_EVENTS:
                log.warning("%s: it does not ask for its events; its session ends", self.peer)
                self._unheard.clear()
                self.host_ended("does not ask for its events")
            return
        number = self._pushed
        self._pushed += 1
        self._traffic.pass_on(EVENT, self.session, lambda times: self._event(number, data, times))

    def _event(self, number: int, data: bytes, times: int) -> None:
        query = self._events
        if query is not None:
            with suppress(zenoh.ZError):
                for _ in range(times):
                    query.reply(query.key_expr, data, attachment=envelope.reply_to(number, ""))

    def hear(self, query: zenoh.Query, lost: int) -> None:
        """Send events as replies to this query from now on; the one before ends.

        Args:
            query: the query.
            lost: messages of events that have not reached the host so far, as it says.
        """
        if lost > self.lost:
            if not self.lost:
                log.warning(
                    "%s: %d messages of events were lost on the way: the host did not read them, or"
                    " the network dropped them", self.peer, lost,
                )  # fmt: skip
            self.lost = lost
        self._hear_no_more()
        self._events = query
        # In one message: of four at once Zenoh has dropped two, on a busy machine.
        unheard, self._unheard = b"".join(self._unheard), []
        if unheard:
            self.push(unheard)

    def _hear_no_more(self) -> None:
        query, self._events = self._events, None
        if query is not None:
            drop: Callable[[], None] = query.drop
            drop()

    def host_ended(self, reason: str) -> None:
        """The host has said good-bye, or has vanished; again is harmless."""
        if self._open:
            self.reason = reason
            self.on_end(False)

    def close(self) -> None:
        """Refuse whatever the host asks from now on; again is harmless."""
        if self._open:
            self._open = False
            with suppress(Empty):  # a deaf host's replies would each block in their turn
                while True:
                    self._later.get_nowait()
            self.exchange.end(envelope.GONE, f"the session is over: {self.reason}")
            self._hear_no_more()
            if self.lost:
                log.warning("%s: it has lost %d messages of events in all", self.peer, self.lost)
            self._later.put(None)
            if self._replies is not None:
                with suppress(zenoh.ZError):
                    self._replies.undeclare()
            self._ended(self)


@contextmanager
def _answering(query: zenoh.Query) -> Iterator[None]:
    """Tell the host at the end that there is no more to come; one that has gone is no loss."""
    drop: Callable[[], None] = query.drop
    try:
        with suppress(zenoh.ZError):
            yield
    finally:
        drop()


def send_reply(
    query: zenoh.Query, data: bytes, key: str = "", attachment: bytes | None = None, times: int = 1
) -> None:
    """Answer a query; a host that has gone meanwhile is no error.

    Args:
        query: the query.
        data: the answer.
        key: the key it belongs to, where the query may have asked for several.
        attachment: goes with it.
        times: how often the answer arrives; 0: the query ends without one.
    """
    with _answering(query):
        for _ in range(times):
            query.reply(key or query.key_expr, data, attachment=attachment)


def send_pieces(query: zenoh.Query, data: bytes, most: int) -> None:
    """Answer a query in several replies, each with the size of the whole attached; may wait.

    Args:
        query: the query; it asks for all replies, one after the other.
        data: the answer.
        most: bytes of a reply.
    """
    size = str(len(data))
    with _answering(query):
        for begin in range(0, len(data), most):
            query.reply(query.key_expr, data[begin : begin + most], attachment=size)


def send_refusal(query: zenoh.Query, code: str, reason: str, times: int = 1) -> None:
    """Refuse a query, with a reason for people behind a code for programs."""
    with _answering(query):
        for _ in range(times):
            query.reply_err(f"{code} {reason}", encoding=PLAIN)
