"""A link over Zenoh: bytes of the byte protocol travel as numbered messages, each carried out once.

Zenoh tells of failure by silence: a query nobody answered simply ends. Here it is repeated, under
its old number, until somebody answers or patience is over; then the reason is looked for.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections import deque
from time import monotonic
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import parse_qsl

from vbus.client.links import Link
from vbus.errors import TransportError
from vbus.network import envelope, keys, places
from vbus.network.security import Security
from vbus.network.session import close_session, open_session

if TYPE_CHECKING:
    import zenoh

FORM: Final = "zenoh:BOARD/CHIP?connect=tcp/HOST:PORT"
FIRST_SECONDS: Final = 0.5
"""How long a board may take to answer at all."""
RECOVERY_SECONDS: Final = 3.0
"""How long a board that has answered before may be out of reach."""
AGAIN_SECONDS: Final = 0.1
"""How often a message is repeated meanwhile."""
LONGEST_SECONDS: Final = 86400.0
"""How long the board may take over a message: as long as its delays say."""
_OPTIONS: Final = ("connect", "certificate", "key", "authority")


class _Query:
    """A message under way: takes what Zenoh's threads bring."""

    __slots__ = ("answered", "data", "link", "number", "since")

    def __init__(self, link: ZenohLink, number: int, data: bytes) -> None:
        self.link: ZenohLink = link
        self.number: int = number
        self.data: bytes = data
        self.answered: bool = False
        self.since: float = 0.0
        """When it was first found without an answer; 0 if it never was."""

    def take(self, reply: zenoh.Reply) -> None:
        """Take the reply; called in a thread of Zenoh's."""
        if self.answered:
            return
        ok = reply.ok
        if ok is not None:
            self.answered = True
            self.link.arrived(self.number, ok.payload.to_bytes())
            return
        err = reply.err
        text = err.payload.to_bytes().decode("utf-8", "replace") if err is not None else ""
        code, _, reason = text.partition(" ")
        if code in (envelope.GONE, envelope.MALFORMED, envelope.TOO_LARGE, envelope.BROKEN):
            self.answered = True
            self.link.failed(f"refused by the board: {reason}")

    def ended(self) -> None:
        """Whoever could answer has done so; called in a thread of Zenoh's."""
        if not self.answered:
            self.link.unanswered(self)


class ZenohLink(Link):
    """An open link to the bus of a chip, or to all of a board.

    Its descriptor becomes readable when replies or events are here.

    Args:
        where: how it was asked for, for messages.
        bus_key: the key at which the board answers.
        session: an open Zenoh session, which belongs to the link from now on.
        endpoints: where it is connected to, for messages.
        security: its certificates, if any.
    """

    by_descriptor = False

    def __init__(
        self,
        where: str,
        bus_key: str,
        session: zenoh.Session,
        endpoints: tuple[str, ...],
        security: Security | None = None,
    ) -> None:
        import zenoh

        super().__init__(where, os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC))
        self._bus_key: str = bus_key
        self._endpoints: tuple[str, ...] = endpoints
        self._security: Security | None = security
        self._network: zenoh.Session = session
        self._name: bytes = envelope.new_session()
        self._number: int = 0
        self._given: int = 0
        self._early: dict[int, bytes] = {}
        self._inbox: deque[tuple[int, bytes | TransportError]] = deque()
        self._lock: threading.Lock = threading.Lock()
        self._timers: set[threading.Timer] = set()
        self._closed: bool = False
        self._error: TransportError | None = None
        self._target: Any = zenoh.QueryTarget.BEST_MATCHING
        self._whole: Any = zenoh.ConsolidationMode.NONE
        self._callback: Any = zenoh.handlers.Callback
        token = keys.host(bus_key, self._name.hex())
        self._token: Any = session.liveliness().declare_token(token)
        self._events: Any = session.declare_subscriber(
            token, zenoh.handlers.Callback(self._event, indirect=False)
        )

    # -- what a bus calls -----------------------------------------------------------------------

    def write(self, data: memoryview) -> int:
        """Send a message of as much of ``data`` as fits one; 0 while too many are under way."""
        if self._error is not None:
            raise self._error
        if self._number - self._given >= envelope.WINDOW:
            return 0
        part = bytes(data[: envelope.LARGEST])
        query = _Query(self, self._number, part)
        self._number += 1
        self._send(query)
        return len(part)

    def read(self) -> bytes:
        """Return what has come; nothing if nothing has."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self.fd)
        data = b""
        while self._inbox:
            number, item = self._inbox.popleft()
            if isinstance(item, TransportError):
                if self._error is None:
                    self._error = item
            elif number < 0:
                data += item
            elif number == self._given:
                data += item
                self._given += 1
                while self._given in self._early:
                    data += self._early.pop(self._given)
                    self._given += 1
            elif number > self._given:
                self._early[number] = item
        if not data and self._error is not None:
            raise self._error
        return data

    def check(self) -> None:
        """The session is open."""

    def close(self) -> None:
        """Say good-bye and leave the network; again is harmless."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            timers = [*self._timers]
        for timer in timers:
            timer.cancel()
        if self._error is None and self._number:
            self._say_goodbye()
        close_session(self._network)
        with self._lock:
            os.close(self.fd)
            self.fd = -1

    def _say_goodbye(self) -> None:
        import zenoh

        cover = envelope.Envelope(envelope.END, self._name, self._number, self._given)
        with contextlib.suppress(zenoh.ZError):
            list(self._network.get(self._bus_key, timeout=1.0, attachment=cover.pack()))

    # -- messages -------------------------------------------------------------------------------

    def _send(self, query: _Query) -> None:
        import zenoh

        cover = envelope.Envelope(envelope.REQUESTS, self._name, query.number, self._given)
        try:
            self._network.get(
                self._bus_key,
                self._callback(query.take, query.ended, indirect=False),
                target=self._target,
                consolidation=self._whole,
                timeout=LONGEST_SECONDS,
                payload=query.data,
                attachment=cover.pack(),
                express=True,
            )
        except zenoh.ZError as error:
            raise TransportError(f"{self.where}: {error}") from error

    def _event(self, sample: zenoh.Sample) -> None:
        self.arrived(-1, sample.payload.to_bytes())

    def arrived(self, number: int, data: bytes) -> None:
        """Take a reply, or events (number -1); for Zenoh's threads."""
        self._put(number, data)

    def failed(self, reason: str) -> None:
        """The session is over; for Zenoh's threads."""
        self._put(-1, TransportError(f"{self.where}: {reason}"))

    def _put(self, number: int, item: bytes | TransportError) -> None:
        with self._lock:
            if not self._closed:
                self._inbox.append((number, item))
                os.eventfd_write(self.fd, 1)

    def unanswered(self, query: _Query) -> None:
        """Nobody has answered: try again in a moment; for Zenoh's threads."""
        query.since = query.since or monotonic()
        with self._lock:
            if self._closed:
                return
            timer = threading.Timer(AGAIN_SECONDS, self._again, (query,))
            timer.daemon = True
            self._timers = {other for other in self._timers if other.is_alive()} | {timer}
            timer.start()

    def _again(self, query: _Query) -> None:
        """Repeat a message, or give up; in a thread of its own."""
        patience = RECOVERY_SECONDS if self._given else FIRST_SECONDS
        try:
            if monotonic() - query.since < patience:
                self._send(query)
            else:
                self.failed(self._why())
        except Exception as error:
            self.failed(str(error))

    # -- why nobody answers -----------------------------------------------------------------------

    def _why(self) -> str:
        """Return what is wrong, where, and what to do."""
        at = ", ".join(self._endpoints)
        if not self._network.info.routers_zid():
            return f"the link to {at} is lost; is the router or the board still running? (vbus ls)"
        allowed = self._ask_access()
        if allowed is not None:
            return allowed
        chunks = self._bus_key.split("/")
        board = chunks[1]
        replies = self._network.liveliness().get(keys.owner(board, "*", "*"), timeout=1.0)
        if any(reply.ok is not None for reply in replies):
            if len(chunks) == 4:
                return (
                    f'the board "{board}" has no chip "{chunks[2]}" on the network of {at}: nobody'
                    f" answers at the key {self._bus_key}; its link must reach that chip (vbus ls)"
                )
            return f'the board "{board}" on the network of {at} answers no more'
        return (
            f'no board called "{board}" is on the network of {at}: nobody answers at the key'
            f" {self._bus_key}; is it running, and connected there? (vbus ls --zenoh"
            f" {self._endpoints[0]})"
        )

    def _ask_access(self) -> str | None:
        """Return why the own certificate does not do; None if that is not it."""
        if self._security is None:
            return None
        zid = str(self._network.info.zid())
        replies = self._network.get(keys.ACCESS, timeout=1.0, payload=f"{zid} {self._bus_key}")
        for reply in replies:
            if reply.ok is not None and len(reply.ok.payload):
                return f"forbidden: {reply.ok.payload.to_string()}"
        return None


def open_zenoh(rest: str) -> ZenohLink:
    """Open ``BOARD/CHIP?connect=ENDPOINT``, what stands behind ``zenoh:``.

    Raises:
        TransportError: no session with the network; says why and what to do.
        ValueError: this is no such link.
    """
    path, _, query = rest.partition("?")
    options = dict(parse_qsl(query))
    chunks = path.split("/")
    if len(chunks) > 2 or not all(chunks) or set("*$#?") & set(path):
        raise ValueError(f"'zenoh:{rest}' is no link; allowed is {FORM}, or zenoh:BOARD for all")
    unknown = [name for name in options if name not in _OPTIONS]
    if unknown:
        raise ValueError(
            f"'zenoh:{rest}': unknown option {unknown[0]}; allowed are {', '.join(_OPTIONS)}"
        )
    where = f"zenoh:{path}"
    endpoints = _endpoints(chunks[0], options.get("connect", ""))
    security = places.security_of(options, where)
    session = open_session(connect=endpoints, mode="client", security=security)
    try:
        return ZenohLink(where, keys.bus(*chunks), session, endpoints, security)
    except BaseException:
        close_session(session)
        raise


def _endpoints(board: str, given: str) -> tuple[str, ...]:
    """Return where to connect to."""
    text = given or os.environ.get(places.VARIABLE, "")
    if text:
        return tuple(text.split(","))
    found = places.endpoints_at(places.board_place(board)) or places.endpoints_at(
        places.router_place()
    )
    if not found:
        raise TransportError(
            f'zenoh:{board} cannot be opened: no board called "{board}" and no router runs on this'
            f" computer; write zenoh:{board}?connect=tcp/HOST:PORT, or set {places.VARIABLE} to the"
            " endpoint of a router"
        )
    return found
