"""Hosts on a network that loses, delays, repeats and reorders messages."""

import re
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import zenoh

from tests.simulation.hosts import Host
from tests.simulation.system import System
from tests.simulation.transcript import Transcript
from vbus.network import envelope, keys

REPEAT_NS = 30_000_000
MOST_UNDER_WAY = 4


class Network:
    """Stands for the board's Zenoh session: carries messages late, twice, or not at all.

    Attributes:
        sessions: transcripts of hosts by the name of their session.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._random = system.random
        self._loss = system.random.choice((0.0, 0.05, 0.3))
        self._queryables: dict[str, Callable[[Any], None]] = {}
        self._subscribers: list[tuple[re.Pattern[str], Callable[[Any], None]]] = []
        self.sessions: dict[str, Transcript] = {}
        self.replies: dict[str, Callable[[int, bytes | None], None]] = {}
        self.open = True
        self._tokens_until = 0

    # -- what the board asks of its session -------------------------------------------------------

    def zid(self) -> str:
        return "1"

    def liveliness(self) -> "Network":
        return self

    def declare_token(self, key: str) -> object:
        return SimpleNamespace(undeclare=lambda: None)

    def get(self, key: str, timeout: float) -> list[Any]:
        return []

    def declare_queryable(self, key: str, entry: Callable[[Any], None], complete: bool) -> object:
        self._queryables[key] = entry
        return key

    def declare_subscriber(
        self, pattern: str, entry: Callable[[Any], None], history: bool = False
    ) -> object:
        self._subscribers.append((re.compile(pattern.replace("*", "[^/]+")), entry))
        return pattern

    def put(self, key: str, data: bytes, **how: Any) -> None:
        """Events may be lost, and nobody counts them here."""

    def declare_publisher(self, key: str, **how: Any) -> "Replies":
        return Replies(self, key)

    def close(self) -> None:
        self.open = False

    # -- what hosts ask of the network ------------------------------------------------------------

    def _later(self, act: Callable[..., None], *args: Any) -> None:
        delay = self._random.choice((0, 1_000, 300_000, 5_000_000))
        self._system.after(delay + self._random.randrange(1000), lambda: self.open and act(*args))

    def tell_token(self, token: str, here: bool) -> None:
        """A host's token has come or gone: nothing of that is lost or overtaken."""
        kind = zenoh.SampleKind.PUT if here else zenoh.SampleKind.DELETE
        sample = SimpleNamespace(key_expr=token, kind=kind)
        self._tokens_until = max(self._tokens_until, self._system.ns) + self._random.randrange(
            10**6
        )
        for pattern, entry in self._subscribers:
            if pattern.fullmatch(token):
                self._system.at(self._tokens_until, partial(entry, sample))

    def query(
        self, key: str, data: bytes, header: envelope.Envelope, answer: Callable[[Any], None]
    ) -> None:
        """Carry a message, and what it is answered."""
        asked = SimpleNamespace(
            key_expr=key, payload=_Bytes(data), attachment=_Bytes(header.pack()),
            reply=lambda where, reply, attachment=None: self.carry(answer, reply),
            reply_err=lambda why, encoding: self.carry(answer, None), drop=lambda: None,
        )  # fmt: skip
        for _ in range(self._random.choice((1, 1, 1, 2))):
            if self._random.random() >= self._loss:
                self._later(self._queryables[key], asked)

    def post(self, token: str, data: bytes, header: envelope.Envelope) -> None:
        """Carry a message that is a sample."""
        key = keys.requests(token)
        sample = SimpleNamespace(
            key_expr=key, payload=_Bytes(data), attachment=_Bytes(header.pack())
        )
        for pattern, entry in self._subscribers:
            if pattern.fullmatch(key):
                for _ in range(self._random.choice((1, 1, 1, 2))):
                    self.carry(entry, sample)

    def carry(self, take: Callable[[Any], None], what: object) -> None:
        """Bring something, later; or lose it."""
        if self._random.random() >= self._loss:
            self._later(take, what)


class Replies:
    """Where the board publishes the replies to what one host posts."""

    def __init__(self, network: Network, key: str) -> None:
        self._network = network
        self._key = key

    def put(self, data: bytes, attachment: bytes) -> None:
        number, code = envelope.replied_to(attachment)
        take = self._network.replies.get(self._key)
        if take is not None:
            self._network.carry(partial(take, number), None if code else data)

    def undeclare(self) -> None:
        pass


class _Bytes(bytes):
    def to_bytes(self) -> bytes:  # type: ignore[override]
        return bytes(self)


class NetworkHost(Host):
    """A host whose requests go in numbered messages, repeated until they are answered."""

    network: Network
    board: str
    _session = b""
    _under_way: dict[int, tuple[bytes, int]]
    _replies: dict[int, bytes]
    _number = 0
    _heard = 0
    _here = False

    @property
    def connected(self) -> bool:
        return self._here

    @property
    def _bus(self) -> str:
        return keys.bus(self.board)

    @property
    def _token(self) -> str:
        return keys.host(self._bus, envelope.public(self._session))

    def connect(self) -> None:
        self._session = self._random.randbytes(16)
        self._under_way, self._replies, self._number, self._heard = {}, {}, 0, 0
        self._here = True
        self.transcripts.append(Transcript(f"{self._name}.{len(self.transcripts)}"))
        self.transcript.events = False
        self.network.sessions[envelope.public(self._session)] = self.transcript
        session = self._session

        def posted(number: int, reply: bytes | None) -> None:
            if session == self._session and self._here:
                self._answered(number, reply)

        self.network.replies[keys.replies(self._token)] = posted
        self.network.tell_token(self._token, True)

    def act(self) -> None:
        if not self._here:
            self.connect()
        elif self._random.random() < self._manners["leave"]:
            self.leave()
        else:
            self.talk()

    def send(self, most: int) -> None:
        data = self.transcript.unsent()
        if data and self._here and len(self._under_way) < MOST_UNDER_WAY:
            self.transcript.sent += len(data)
            number, self._number = self._number, self._number + 1
            self._under_way[number] = data, self._number
            self._post(self._session, number)

    def _post(self, session: bytes, number: int) -> None:
        """Send a message; again as long as it is not answered."""
        if session != self._session or number not in self._under_way or not self._here:
            return
        header = envelope.Envelope(envelope.REQUESTS, session, number, self._heard)

        def answered(reply: bytes | None) -> None:
            if session == self._session and self._here:
                self._answered(number, reply)

        # A board that has answered takes samples; what is repeated may be either, too.
        if self._heard and self._random.random() < 0.5:
            self.network.post(self._token, self._under_way[number][0], header)
        else:
            self.network.query(self._bus, self._under_way[number][0], header, answered)
        self._system.after(REPEAT_NS, lambda: self._post(session, number))

    def _answered(self, number: int, reply: bytes | None) -> None:
        if reply is None:  # the board has refused it: the session is over
            self.leave()
        elif self._under_way.pop(number, None) is not None:
            self._replies[number] = reply
            while self._heard in self._replies:
                self._heard += 1
                self.transcript.take(self._replies.pop(self._heard - 1))

    def listen(self) -> bool:
        return False

    def ask_last(self) -> None:
        if self._here:
            self.transcript.ask("UNCLAIM")
            self.transcript.barrier()

    def go_on_to_the_end(self) -> bool:
        self.send(0)
        if self._here and self.transcript.settled:
            self.transcript.polite_end = True
            self.leave()
        return not self._here

    def leave(self) -> None:
        """Say good-bye, which may be lost; or vanish."""
        if self._here:
            self._here = False
            if self._random.random() < 0.5:
                header = envelope.Envelope(envelope.END, self._session, self._number, self._heard)
                self.network.query(self._bus, b"", header, lambda reply: None)
            self.network.tell_token(self._token, False)
