"""``zenoh:``: the buses of a board's chips on the network."""

import time
from collections import OrderedDict
from typing import Any, Final
from weakref import WeakSet

import zenoh
from msgspec.structs import replace

from vbus.core.errors import NameInUseError, TransportError
from vbus.network import envelope, keys, places
from vbus.network.access import answer_access
from vbus.network.session import Network, close_session, free_endpoint, open_network
from vbus.transports.base import Served, Transport
from vbus.transports.traffic import REPLY, REQUEST, Traffic
from vbus.transports.zenoh_host import ZenohLink, send_refusal, send_reply
from vbus.transports.zenoh_inbox import Inbox
from vbus.transports.zenoh_publications import Publications

SETTLE_SECONDS: Final = 0.5
"""How long a board that joins other routers waits until it knows what they have (s): routers take
some tenths of a second to exchange that."""
ASK_SECONDS: Final = 2.0
"""How long an answer of the network is waited for at the start (s); not measured."""
TOKEN_SECONDS: Final = 3.0
"""How long a host's session lives without its liveliness token having been seen (s): the token may
come after the first message."""
MOST_HOSTS: Final = 256
"""Sessions that may be open on one board: a bound of memory."""
REMEMBERED: Final = 4096
"""Ended sessions whose late messages are known as such: 16 for each that may be open."""


class ZenohTransport(Transport):
    """``zenoh:``: each chip's bus at ``vbus/BOARD/CHIP/bus``, all of them at ``vbus/BOARD/bus``.

    Where on the network that is, the board file's ``[zenoh]`` says. Each host has a session of its
    own, known by a secret it has chosen and alive as long as its liveliness token.
    """

    SCHEME = "zenoh"

    # Set by serves() and open().
    _board: str
    _inbox: Inbox
    _network: Network
    _served: Served
    _session: zenoh.Session

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._traffic: Traffic = Traffic()
        self._traffic.cut = self._cut
        self.traffic = self._traffic
        self._links: dict[str, ZenohLink] = {}
        self._sending: WeakSet[ZenohLink] = WeakSet()
        """Also those that have ended, while a thread still sends their replies."""
        self._ended: OrderedDict[str, str] = OrderedDict()
        self._tokens: set[str] = set()
        self._buses: dict[str, tuple[str, ...]] = {}
        self._declared: list[Any] = []
        self._marks: list[Any] = []

    def serves(self, served: Served) -> None:
        """Learn which board it is."""
        self._served = served
        self._network = served.network or Network()
        board = self._board = served.board.name
        self._buses = {keys.bus(board): ()}
        self._buses.update({keys.bus(board, chip): (chip,) for chip in served.chips})
        self.url = f"zenoh:{board}"

    # -- opening ------------------------------------------------------------------------------

    def begin(self) -> None:
        """Join the network, take the board's keys and wait for hosts."""
        if self.path:
            raise TransportError(
                f'"zenoh:{self.path}": write "zenoh:" and nothing behind it; where on the network'
                " the board is, and who may use it, are keys of [zenoh]"
            )
        self._inbox = Inbox()
        with self.opening(self.url) as opened:
            self._inbox.open(self.loop)
            opened.callback(self._inbox.close)
            opened.callback(self._declared.clear)
            endpoints = self._join()
            opened.callback(close_session, self._session)
            place = places.board_place(self._board)
            places.register(place, endpoints)
            opened.callback(places.unregister, place)
            self.url = f"zenoh:{self._board}?connect={','.join(endpoints)}"
            mine = self._own()
            publications = Publications(self._session, self._inbox, self._served, self.loop)
            opened.callback(publications.close)
            self._declare()
            publications.open()
            # Of two that start at the same moment one stays. And who answers has all that was
            # declared before: no host that comes from now on finds nobody.
            self._refuse({other for other in self._rivals() if other < mine})
            opened.callback(self._end_hosts)
            opened.callback(self._traffic.close)

    def _join(self) -> tuple[str, ...]:
        """Open the session; return the endpoints at which the board is reached."""
        network = self._network
        if network.listen or network.connect:
            self._session = open_network(network)
            return network.listen or network.connect
        # Some free port of this computer.
        protocol = "tls" if network.security is not None else "tcp"
        for last in (False, False, False, True):
            endpoints = (free_endpoint(protocol),)
            try:
                self._session = open_network(replace(network, listen=endpoints))
                break
            except TransportError as error:
                if last or "in use" not in str(error):
                    raise
        return endpoints

    def _own(self) -> str:
        """Take the keys of the board; return its token.

        Raises:
            NameInUseError: another process has them.
        """
        mine = keys.owner(self._board, str(self._session.zid()))
        if self._network.listen and self._network.connect:
            time.sleep(SETTLE_SECONDS)
        self._refuse(self._rivals())
        self._declared.append(self._session.liveliness().declare_token(mine))
        return mine

    def _rivals(self) -> set[str]:
        """Return the tokens of other processes that serve a board of this name."""
        replies = self._session.liveliness().get(keys.owner(self._board, "*"), timeout=ASK_SECONDS)
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        return {token for token in found if self._is_rival(token)}

    def _is_rival(self, token: str) -> bool:
        return token.rpartition("/")[2] != str(self._session.zid())

    def _refuse(self, rivals: set[str]) -> None:
        if rivals:
            endpoints = ", ".join((*self._network.connect, *self._network.listen))
            raise NameInUseError(
                f'a board called "{self._board}" is on the network of {endpoints} already'
                f" (liveliness token {min(rivals)}); stop it, or give this one another name"
            )

    def _declare(self) -> None:
        session, enter, declared = self._session, self._inbox.entry, self._declared
        for key in self._buses:
            declared.append(session.declare_queryable(key, enter(self._message), complete=True))
            if self._network.security is None:  # else others with the same right could listen
                posts = keys.requests(keys.host(key, "*"))
                declared.append(session.declare_subscriber(posts, enter(self._posted)))
        board = self._board
        for pattern, handle in (
            (keys.host(keys.bus(board), "*"), self._token),
            (keys.host(keys.bus(board, "*"), "*"), self._token),
            (keys.owner(board, "*"), self._owner),
        ):
            declared.append(
                session.liveliness().declare_subscriber(pattern, enter(handle), history=True)
            )
        if self._network.security is not None:
            declared.append(answer_access(session, self._network.security))

    def tell_pause(self, paused: bool) -> None:
        """Leave word at each bus as long as the board is paused."""
        marks, self._marks = self._marks, []
        for mark in marks:
            mark.undeclare()
        if paused:
            declare = self._session.liveliness().declare_token
            self._marks = [declare(keys.paused(key)) for key in self._buses]

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
            header = envelope.unpack(attachment.to_bytes() if attachment is not None else b"")
        except envelope.EnvelopeError as error:
            send_refusal(query, envelope.MALFORMED, str(error))
            return
        data = payload.to_bytes() if payload is not None else b""
        if header.kind == envelope.EVENTS:
            self._hear(query, header)
            return
        self._traffic.pass_on(
            REQUEST, envelope.public(header.session),
            lambda times: self._deliver(query, header, data, times),
        )  # fmt: skip

    def _hear(self, query: zenoh.Query, header: envelope.Envelope) -> None:
        """A host wants to hear its events."""
        link = self._links.get(envelope.public(header.session))
        if link is None:
            send_refusal(query, envelope.GONE, "the board does not know the session (any more)")
        else:
            link.hear(query, header.number)

    def _deliver(
        self, query: zenoh.Query, header: envelope.Envelope, data: bytes, times: int
    ) -> None:
        """A message that was asked has arrived, so many times."""
        if not times:  # the query ends without a reply, so its host asks again
            send_reply(query, b"", times=0)
        for _ in range(times):
            self._take(query, header, data)

    def _take(self, query: zenoh.Query, header: envelope.Envelope, data: bytes) -> None:
        session = envelope.public(header.session)
        link = self._links.get(session)
        if link is None:
            link = self._welcome(query, header, session)
            if link is None:
                return
        if header.kind == envelope.REQUESTS:
            link.take(query, header, data)
        elif missing := link.exchange.missing(header.number):
            link.refuse(query, envelope.EARLY, f"{missing} not come yet")
        else:
            link.host_ended("closed by the host")
            self._traffic.pass_on(REPLY, session, lambda times: send_reply(query, b"", times=times))

    def _posted(self, sample: zenoh.Sample) -> None:
        """A host has posted a message; what is not for a session here, it will ask about."""
        session = str(sample.key_expr).split("/")[-2]
        if sample.attachment is None or len(sample.payload) > envelope.LARGEST:
            return
        try:
            header = envelope.unpack(sample.attachment.to_bytes())
        except envelope.EnvelopeError:
            return
        # Anyone may publish at this key; the envelope's secret says whose message it is.
        if session in self._links and envelope.public(header.session) == session:
            data = sample.payload.to_bytes()
            self._traffic.pass_on(
                REQUEST, session, lambda times: self._deliver_posted(session, header, data, times)
            )

    def _deliver_posted(
        self, session: str, header: envelope.Envelope, data: bytes, times: int
    ) -> None:
        """A message that was posted has arrived, so many times."""
        for _ in range(times):
            link = self._links.get(session)
            if link is not None and header.kind == envelope.REQUESTS:
                link.take_posted(header, data)

    def _welcome(
        self, query: zenoh.Query, header: envelope.Envelope, session: str
    ) -> ZenohLink | None:
        """Begin the session of a host, or refuse it."""
        bus_key = str(query.key_expr)
        if session in self._ended or header.number or header.kind != envelope.REQUESTS:
            why = self._ended.get(session) or (
                f"the host was away for longer than {self._network.grace_seconds:g} s, or the"
                " board was started anew"
            )
            self._refuse_host(
                query, session,
                f"the board does not know the session (any more): {why}; connect again",
            )  # fmt: skip
            return None
        if bus_key not in self._buses:
            send_refusal(query, envelope.MALFORMED, f"{bus_key} names no single bus")
            return None
        if len(self._links) >= MOST_HOSTS:
            self._refuse_host(
                query, session, f"{MOST_HOSTS} hosts are connected; no more are served"
            )
            return None
        link = ZenohLink(
            self._session, bus_key, session, self._buses[bus_key], self._traffic, self._forget,
            posts=self._network.security is None,
        )  # fmt: skip
        link.token_seen = link.token in self._tokens
        self._links[session] = link
        self._sending.add(link)
        self.on_link(link)
        if not link.token_seen:
            self.loop.call_later(TOKEN_SECONDS, self._check_token, link)
        return link

    def _refuse_host(self, query: zenoh.Query, session: str, reason: str) -> None:
        self._traffic.pass_on(
            REPLY, session, lambda times: send_refusal(query, envelope.GONE, reason, times)
        )

    def _check_token(self, link: ZenohLink) -> None:
        if not link.token_seen:
            link.host_ended(
                f"its liveliness token {link.token} was not seen within {TOKEN_SECONDS:g} s;"
                " declare it before the first message"
            )

    def _forget(self, link: ZenohLink) -> None:
        self._links.pop(link.session, None)
        self._traffic.forget(link.session)
        self._ended[link.session] = link.reason
        while len(self._ended) > REMEMBERED:
            self._ended.popitem(last=False)

    def _token(self, sample: zenoh.Sample) -> None:
        """A host has come, or has gone."""
        token = str(sample.key_expr)
        link = self._links.get(token.rpartition("/")[2])
        if sample.kind == zenoh.SampleKind.PUT:
            self._tokens.add(token)
            if link is not None and link.token == token:
                link.token_seen = True
                if not self._traffic.hosts_gone:
                    link.gone_since = -1.0
            return
        self._tokens.discard(token)
        if link is not None and link.token == token:
            self._gone(link)

    def _cut(self, cut: bool) -> None:
        """A fault has cut the links of all hosts, or they are mended: tokens go, or are back."""
        for link in self._links.values():
            if cut:
                self._gone(link)
            elif link.token in self._tokens:
                link.gone_since = -1.0

    def _gone(self, link: ZenohLink) -> None:
        if link.gone_since < 0:
            since = link.gone_since = self.loop.time()
            self.loop.call_later(self._network.grace_seconds, self._give_up, link, since)

    def _give_up(self, link: ZenohLink, since: float) -> None:
        # Else it has been back meanwhile; if it went again, another call is on its way.
        if link.gone_since == since:
            link.host_ended(f"the host was away for longer than {self._network.grace_seconds:g} s")

    # -- the board itself ---------------------------------------------------------------------

    def _owner(self, sample: zenoh.Sample) -> None:
        """A token of this board's name has come or gone: more than our own is a rival."""
        token = str(sample.key_expr)
        if sample.kind == zenoh.SampleKind.PUT and self._is_rival(token):
            self.report(
                f"{self.url}: another board of this name has appeared on the network ({token});"
                " each host reaches the nearer one; give one of them another name"
            )

    def _end_hosts(self) -> None:
        for link in list(self._links.values()):
            link.host_ended("the board has stopped")
        # The Zenoh session closes next: see GIVES_UP_SECONDS.
        for link in list(self._sending):
            link.settle()
