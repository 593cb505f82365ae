"""One host on the network, as the board sees it: messages in, replies and events out."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from vbus.network import envelope, keys
from vbus.network.exchange import Exchange
from vbus.transports.base import MessageLink

if TYPE_CHECKING:
    import zenoh

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
        ended: Callable[[ZenohLink], None],
    ) -> None:
        super().__init__(f"zenoh:{bus_key} host {session}", chips)
        self.token: str = keys.host(bus_key, session)
        self.session: str = session
        self.exchange: Exchange = Exchange(self._carry_out)
        self.token_seen: bool = False
        self.gone_since: float = -1.0
        self._network: zenoh.Session = network
        self._ended: Callable[[ZenohLink], None] = ended
        self._open: bool = True

    def _carry_out(self, data: bytes) -> None:
        self.on_data(data)

    def take(self, query: zenoh.Query, cover: envelope.Envelope, data: bytes) -> None:
        """Take a message."""

        def answer(reply: bytes) -> None:
            send_reply(query, reply)

        def refuse(code: str, reason: str) -> None:
            send_refusal(query, code, reason)

        self.exchange.take(cover.number, cover.acknowledged, data, answer, refuse)

    def answer(self, data: bytes) -> None:
        """Send the reply of the message being carried out."""
        self.exchange.done(data)

    def push(self, data: bytes) -> None:
        """Publish events where the host listens for them."""
        import zenoh

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


def send_reply(query: zenoh.Query, data: bytes, key: str = "") -> None:
    """Answer a query; a host that has gone meanwhile is nobody's loss.

    Args:
        query: the query.
        data: the answer.
        key: the key it belongs to, where the query may have asked for several.
    """
    import zenoh

    try:
        query.reply(key or query.key_expr, data)
    except zenoh.ZError:
        pass
    finally:
        _let_go(query)


def send_refusal(query: zenoh.Query, code: str, reason: str) -> None:
    """Refuse a query, with a reason for people behind a code for programs."""
    import zenoh

    try:
        query.reply_err(f"{code} {reason}", encoding=PLAIN)
    except zenoh.ZError:
        pass
    finally:
        _let_go(query)


def _let_go(query: zenoh.Query) -> None:
    """Tell the host that there is no more to come."""
    drop: Callable[[], None] = query.drop
    drop()
