"""``zenoh:``: the buses of a board's chips on the network."""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vbus.errors import NameInUseError, TransportError
from vbus.network import envelope, keys, places
from vbus.network.access import answer_access
from vbus.network.session import Network, close_session, free_endpoint, open_network
from vbus.transports.base import Link, Served, Transport
from vbus.transports.zenoh_host import ZenohLink, send_refusal, send_reply
from vbus.transports.zenoh_inbox import Handle, Inbox
from vbus.transports.zenoh_publications import Publications

if TYPE_CHECKING:
    import zenoh

SETTLE_SECONDS: Final = 0.5
"""How long a board that joins other routers waits until it knows what they have."""
ASK_SECONDS: Final = 2.0
"""How long an answer of the network is waited for at the start."""
TOKEN_SECONDS: Final = 3.0
"""How long a host's session lives without its liveliness token having been seen."""
MOST_HOSTS: Final = 256
"""Sessions that may be open on one board."""
REMEMBERED: Final = 4096
"""Ended sessions whose late messages are known as such."""


class ZenohTransport(Transport):
    """``zenoh:``: each chip's bus at ``vbus/BOARD/CHIP/bus``, all of them at ``vbus/BOARD/bus``.

    Where on the network that is, the board file's ``[zenoh]`` says. Each host has a session of its
    own, known by a name it has chosen and alive as long as its liveliness token.
    """

    SCHEME = "zenoh"

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._served: Served | None = None
        self._network: Network = Network()
        self._session: zenoh.Session | None = None
        self._inbox: Inbox | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._on_link: Callable[[Link], None] | None = None
        self._links: dict[str, ZenohLink] = {}
        self._over: OrderedDict[str, None] = OrderedDict()
        self._tokens: set[str] = set()
        self._buses: dict[str, tuple[str, ...]] = {}
        self._kept: list[Any] = []
        self._place: Path | None = None
        self._publications: Publications | None = None

    def serves(self, served: Served) -> None:
        """Learn which board it is."""
        self._served = served
        self._network = served.network or Network()
        board = served.board.name
        self._buses = {keys.bus(board): ()}
        self._buses.update({keys.bus(board, chip): (chip,) for chip in served.chips})
        self.url = f"zenoh:{board}"

    # -- opening ------------------------------------------------------------------------------

    def open(self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None]) -> None:
        """Join the network, take the board's keys and wait for hosts."""
        if self.path or self.options:
            raise TransportError(
                f'"zenoh:{self.path}": write "zenoh:" and nothing behind it; where on the network'
                " the board is, and who may use it, are keys of [zenoh]"
            )
        assert self._served is not None
        self._loop = loop
        self._on_link = on_link
        self._inbox = Inbox(loop)
        try:
            self._session = self._join()
            self._own(self._served.board.name)
            self._declare(self._session, self._served.board.name)
        except BaseException:
            self.close()
            raise

    def _join(self) -> zenoh.Session:
        network = self._network
        if network.listen or network.connect:
            session = open_network(network)
            endpoints = network.listen or network.connect
        else:
            session, endpoints = self._join_loopback()
        assert self._served is not None
        place = places.board_place(self._served.board.name)
        self._place = places.register(place, endpoints)
        self.url = f"zenoh:{self._served.board.name}?connect={','.join(endpoints)}"
        return session

    def _join_loopback(self) -> tuple[zenoh.Session, tuple[str, ...]]:
        """Listen on some free port of this computer."""
        from dataclasses import replace

        protocol = "tls" if self._network.security is not None else "tcp"
        for last in (False, False, False, True):
            endpoints = (free_endpoint(protocol),)
            try:
                return open_network(replace(self._network, listen=endpoints)), endpoints
            except TransportError as error:
                if last or "in use" not in str(error):
                    raise
        raise AssertionError

    def _own(self, board: str) -> None:
        """Take the keys of the board.

        Raises:
            NameInUseError: another process has them.
        """
        assert self._session is not None
        session = self._session
        mine = keys.owner(board, str(session.zid()))
        if self._network.listen and self._network.connect:
            time.sleep(SETTLE_SECONDS)
        self._refuse(board, self._rivals(board))
        self._kept.append(session.liveliness().declare_token(mine))
        # Of two that start at the same moment one stays.
        self._refuse(board, {other for other in self._rivals(board) if other < mine})

    def _rivals(self, board: str) -> set[str]:
        """Return the tokens of other processes that serve a board of this name."""
        assert self._session is not None
        replies = self._session.liveliness().get(keys.owner(board, "*"), timeout=ASK_SECONDS)
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        return {token for token in found if self._is_rival(token)}

    def _is_rival(self, token: str) -> bool:
        assert self._session is not None
        return token.rpartition("/")[2] != str(self._session.zid())

    def _refuse(self, board: str, rivals: set[str]) -> None:
        if rivals:
            endpoints = ", ".join((*self._network.connect, *self._network.listen))
            raise NameInUseError(
                f'a board called "{board}" is on the network of {endpoints} already (liveliness'
                f" token {min(rivals)}); stop it, or give this one another name"
            )

    def _declare(self, session: zenoh.Session, board: str) -> None:
        import zenoh

        assert self._inbox is not None
        assert self._loop is not None
        assert self._served is not None
        entry = self._inbox.entry
        callback = zenoh.handlers.Callback

        def queryable(key: str, handle: Handle) -> None:
            self._kept.append(
                session.declare_queryable(
                    key, callback(entry(handle), indirect=False), complete=True
                )
            )

        for key in self._buses:
            queryable(key, self._message)
        for pattern in (keys.host(keys.bus(board), "*"), keys.host(keys.bus(board, "*"), "*")):
            self._kept.append(
                session.liveliness().declare_subscriber(
                    pattern, callback(entry(self._token), indirect=False), history=True
                )
            )
        self._kept.append(
            session.liveliness().declare_subscriber(
                keys.owner(board, "*"),
                callback(entry(self._owner), indirect=False),
                history=True,
            )
        )
        self._publications = Publications(session, self._inbox, self._served, self._loop)
        self._publications.open()
        if self._network.security is not None:
            self._kept.append(answer_access(session, self._network.security))

    # -- hosts --------------------------------------------------------------------------------

    def _message(self, query: zenoh.Query) -> None:
        """A host asks for bus cycles."""
        payload, attachment = query.payload, query.attachment
        if payload is not None and len(payload) > envelope.LARGEST:
            send_refusal(
                query,
                envelope.TOO_LARGE,
                f"the message has {len(payload)} bytes; at most {envelope.LARGEST} are carried"
                " out, so send several",
            )
            return
        try:
            cover = envelope.unpack(attachment.to_bytes() if attachment is not None else b"")
        except envelope.EnvelopeError as error:
            send_refusal(query, envelope.MALFORMED, str(error))
            return
        session = cover.session.hex()
        link = self._links.get(session)
        if link is None:
            link = self._welcome(query, cover, session)
            if link is None:
                return
        if cover.kind == envelope.END:
            link.host_ended("closed by the host")
            send_reply(query, b"")
            return
        link.take(query, cover, payload.to_bytes() if payload is not None else b"")

    def _welcome(
        self, query: zenoh.Query, cover: envelope.Envelope, session: str
    ) -> ZenohLink | None:
        """Begin the session of a host, or refuse it."""
        assert self._session is not None
        assert self._loop is not None
        assert self._on_link is not None
        bus_key = str(query.key_expr)
        if session in self._over or cover.number or cover.kind != envelope.REQUESTS:
            send_refusal(
                query,
                envelope.GONE,
                "the board does not know the session (any more): the host was away for longer"
                f" than {self._network.grace_seconds:g} s, or the board was started anew;"
                " connect again",
            )
            return None
        if bus_key not in self._buses:
            send_refusal(query, envelope.MALFORMED, f"{bus_key} names no single bus")
            return None
        if len(self._links) >= MOST_HOSTS:
            send_refusal(
                query, envelope.GONE, f"{MOST_HOSTS} hosts are connected; no more are served"
            )
            return None
        link = ZenohLink(self._session, bus_key, session, self._buses[bus_key], self._forget)
        link.token_seen = link.token in self._tokens
        self._links[session] = link
        self.state = "connected"
        self._on_link(link)
        if not link.token_seen:
            self._loop.call_later(TOKEN_SECONDS, self._check_token, link)
        return link

    def _check_token(self, link: ZenohLink) -> None:
        if not link.token_seen:
            link.host_ended(
                f"its liveliness token {link.token} was not seen within {TOKEN_SECONDS:g} s;"
                " declare it before the first message"
            )

    def _forget(self, link: ZenohLink) -> None:
        self._links.pop(link.session, None)
        self._over[link.session] = None
        while len(self._over) > REMEMBERED:
            self._over.popitem(last=False)
        if not self._links:
            self.state = "waiting"

    def _token(self, sample: zenoh.Sample) -> None:
        """A host has come, or has gone."""
        import zenoh

        token = str(sample.key_expr)
        link = self._links.get(token.rpartition("/")[2])
        if sample.kind == zenoh.SampleKind.PUT:
            self._tokens.add(token)
            if link is not None and link.token == token:
                link.token_seen = True
                link.gone_since = -1.0
            return
        self._tokens.discard(token)
        if link is not None and link.token == token:
            assert self._loop is not None
            since = link.gone_since = self._loop.time()
            self._loop.call_later(self._network.grace_seconds, self._give_up, link, since)

    def _give_up(self, link: ZenohLink, since: float) -> None:
        if link.gone_since == since:
            link.host_ended(f"the host was away for longer than {self._network.grace_seconds:g} s")

    # -- the board itself ---------------------------------------------------------------------

    def _owner(self, sample: zenoh.Sample) -> None:
        """Somebody owns the keys of this board's name: it should be us alone."""
        import zenoh

        token = str(sample.key_expr)
        if sample.kind == zenoh.SampleKind.PUT and self._is_rival(token):
            self.report(
                f"{self.url}: another board of this name has appeared on the network ({token});"
                " each host reaches the nearer one; give one of them another name"
            )

    def close(self) -> None:
        """Leave the network; may be called again."""
        for link in list(self._links.values()):
            link.host_ended("the board has stopped")
        if self._place is not None:
            places.unregister(self._place)
            self._place = None
        if self._publications is not None:
            self._publications.close()
            self._publications = None
        session, self._session = self._session, None
        if session is not None:
            close_session(session)
        self._kept.clear()
        if self._inbox is not None:
            self._inbox.close()
            self._inbox = None
