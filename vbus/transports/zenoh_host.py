"""One host on the network, as the board sees it: messages in, replies and events out."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Final

import zenoh

from vbus.network import envelope, keys
from vbus.network.exchange import Exchange
from vbus.transports.base import MessageLink

PLAIN: Final = "text/plain"


class ZenohLink(MessageLink):
    """The session of one host.

    Args:
        network: the board's own Zenoh session.
        bus_key: the key at which the host asks.
        session: the name the host has given its session.
        chips: the chips it reaches; empty for all of the entry.
        ended: called once when the session is over, with the link.

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
        ended: Callable[["ZenohLink"], None],
    ) -> None:
        super().__init__(f"zenoh:{bus_key} host {session}", chips)
        self.token: str = keys.host(bus_key, session)
        self.session: str = session
        self.exchange: Exchange = Exchange(lambda data: self.on_data(data))
        self.token_seen: bool = False
        self.gone_since: float = -1.0
        self._network: zenoh.Session = network
        self._ended: Callable[[ZenohLink], None] = ended
        self._open: bool = True

    def take(self, query: zenoh.Query, header: envelope.Envelope, data: bytes) -> None:
        """Take a message."""
        answer, refuse = partial(send_reply, query), partial(send_refusal, query)
        self.exchange.take(header.number, header.acknowledged, data, answer, refuse)

    def answer(self, data: bytes) -> None:
        """Send the reply of the message being carried out."""
        self.exchange.done(data)

    def push(self, data: bytes) -> None:
        """Publish events where the host listens for them."""
        self._network.put(
            self.token,
            data,
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )

    def host_ended(self, reason: str) -> None:
        """The host has said good-bye, or has vanished."""
        self.reason = reason
        self.on_end(False)

    def close(self) -> None:
        """Refuse whatever the host asks from now on; again is harmless."""
        if self._open:
            self._open = False
            self.exchange.end(envelope.GONE, f"the session is over: {self.reason}")
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


def send_reply(query: zenoh.Query, data: bytes, key: str = "") -> None:
    """Answer a query; a host that has gone meanwhile is nobody's loss.

    Args:
        query: the query.
        data: the answer.
        key: the key it belongs to, where the query may have asked for several.
    """
    with _answering(query):
        query.reply(key or query.key_expr, data)


def send_refusal(query: zenoh.Query, code: str, reason: str) -> None:
    """Refuse a query, with a reason for people behind a code for programs."""
    with _answering(query):
        query.reply_err(f"{code} {reason}", encoding=PLAIN)
