"""What carries the messages of nodes between processes: Zenoh, entering the loop in one place."""

import asyncio
import os
import random
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from typing import Final

import zenoh

from vbus.core.errors import NameInUseError, TransportError
from vbus.network.access import answer_access, ask_access
from vbus.network.security import Security
from vbus.network.session import LARGEST_MESSAGE, close_session, open_session
from vbus.transports.zenoh_host import send_pieces, send_reply
from vbus.transports.zenoh_inbox import Inbox

TEST_DISTURB: Final = "VBUS_TEST_DISTURB"
"""For tests only: ``"SEED:MS"`` holds each message that comes for 0 to MS milliseconds, drawn from
a stream with that seed, so that messages arrive late and out of order."""

ASK_SECONDS: Final = 10.0
"""How long a router that has no turn may take to tell whether a node runs already; not measured."""
ATTEMPT_SECONDS: Final = 0.2
"""How long the first attempt to reach the middle of the star takes, and the pause after each;
not measured."""
LONGEST_ATTEMPT: Final = 2.0
"""How long later attempts take: certificates are shown over slow links, too."""
MARGIN_MS: Final = 250
"""What a lease is longer than a deadline: nodes look for silence ten times a second."""
PIECE: Final = 1 << 18
"""Bytes of an answer that travel at a time; between them go the messages that time waits for.
Not measured."""
LARGEST_ANSWER: Final = LARGEST_MESSAGE
"""Bytes of an answer of a node."""


class Receiver:
    """Takes what comes from nodes of other processes, by rank."""

    def received(self, rank: int, data: bytes) -> None:
        """Take what a node has sent."""
        raise NotImplementedError

    def present(self, rank: int, there: bool) -> None:
        """A node has come or gone."""
        raise NotImplementedError

    def order(self, rank: int, data: bytes, answer: Callable[[bytes], None]) -> None:
        """Take an order for a node of this process.

        Args:
            rank: of the node.
            data: the order, as it has come.
            answer: takes the answer, once, now or later; of at most :data:`LARGEST_ANSWER` bytes.
        """
        raise NotImplementedError


class NodeLink:
    """The link of some nodes, which run in this process, to the nodes in others.

    A message goes to all nodes of the board. Keys: ``vbus/BOARD/@nodes/NODE`` carries what a node
    sends, ``vbus/BOARD/@nodes/NODE/alive`` is its liveliness token, and at
    ``vbus/BOARD/@nodes/NODE/orders`` it answers orders.

    Args:
        board: name of the board.
        names: all nodes.
        mine: ranks of the nodes in this process.
    """

    _receiver: Receiver
    _inbox: Inbox
    _loop: asyncio.AbstractEventLoop

    def __init__(self, board: str, names: Sequence[str], mine: Sequence[int]) -> None:
        self._root: str = f"vbus/{board}/@nodes"
        self._names: tuple[str, ...] = tuple(names)
        self._mine: tuple[int, ...] = tuple(mine)
        self._session: zenoh.Session | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}
        self._declared: list[object] = []
        self._opened: ExitStack = ExitStack()
        self._draw: random.Random | None = None
        self._longest: float = 0.0
        disturbance = os.environ.get(TEST_DISTURB)
        if disturbance:
            seed, _, milliseconds = disturbance.partition(":")
            self._draw = random.Random(f"{seed} {mine}")
            self._longest = float(milliseconds or 20) / 1000

    async def open(
        self,
        receiver: Receiver,
        listen: Sequence[str],
        connect: Sequence[str],
        security: Security | None,
        remote: bool,
        deadline: float,
        waits: Callable[[str], None],
    ) -> None:
        """Join the network; where no process listens yet, wait for one.

        Args:
            receiver: takes what comes.
            listen: endpoints; the process that listens is the middle of the star.
            connect: endpoints of who listens.
            security: certificates, if any.
            remote: other computers may be let in without.
            deadline: how long the nodes of this process may be silent (s).
            waits: takes a sentence, once, if it has to wait.

        Raises:
            TransportError: an endpoint is wrong or in use, or a certificate does not do.
            NameInUseError: a process runs one of the nodes already.
        """
        loop = asyncio.get_running_loop()
        self._loop = loop
        mode = "router" if listen else "client"
        # Who stands still is named by the others when the deadline is over, not given up before. A
        # session is closed at once only when the lease of a link that was cut is over, too.
        lease = int(1000 * deadline) + MARGIN_MS

        def attempt(seconds: float) -> zenoh.Session:
            return open_session(listen, connect, mode, security, seconds, remote, lease)

        self._receiver = receiver
        self._inbox = Inbox()
        self._inbox.open(loop)
        self._opened.callback(self._inbox.close)
        seconds = ATTEMPT_SECONDS
        while self._session is None:
            try:
                self._session = await loop.run_in_executor(None, attempt, seconds)
            except TransportError as error:
                if listen or "no process listens" not in str(error):
                    raise
                if seconds == ATTEMPT_SECONDS:
                    # It may listen, and have no turn on a busy machine to say so.
                    waits(f"no process answers at {', '.join(connect)} yet; waits for it")
                await asyncio.sleep(ATTEMPT_SECONDS)
                seconds = min(2 * seconds, LONGEST_ATTEMPT)
        self._opened.callback(close_session, self._session)
        await loop.run_in_executor(None, self._declare, self._session, bool(listen), security)

    def _declare(self, session: zenoh.Session, listens: bool, security: Security | None) -> None:
        root, declared, liveliness = self._root, self._declared, session.liveliness()
        mine = {rank: f"{root}/{self._names[rank]}" for rank in self._mine}
        if security is not None and listens:
            declared.append(answer_access(session, security))
        elif security is not None:
            refused = ask_access(session, f"{root}/**")
            if refused:
                names = ", ".join(self._names[rank] for rank in mine)
                raise TransportError(f"node {names} is not let in: {refused}")
        for rank, key in mine.items():
            if any(reply.ok for reply in liveliness.get(f"{key}/alive", timeout=ASK_SECONDS)):
                raise NameInUseError(
                    f"node {self._names[rank]} runs already in another process; stop that one, or"
                    " start another node"
                )
        enter = self._inbox.entry
        declared.append(session.declare_subscriber(f"{root}/*", enter(self._message)))
        for rank, key in mine.items():
            self._publishers[rank] = session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.BLOCK, express=True
            )
        declared.append(
            liveliness.declare_subscriber(f"{root}/*/alive", enter(self._presence), history=True)
        )
        for key in mine.values():
            order = enter(self._ordered)
            declared.append(session.declare_queryable(f"{key}/orders", order, complete=True))
        for key in mine.values():
            declared.append(liveliness.declare_token(f"{key}/alive"))

    # -- what comes -----------------------------------------------------------------------------

    def _rank(self, key: zenoh.KeyExpr) -> int:
        """Return the rank of the node a key names; -1 if there is no such node."""
        name = str(key).removeprefix(f"{self._root}/").partition("/")[0]
        return self._names.index(name) if name in self._names else -1

    def _message(self, sample: zenoh.Sample) -> None:
        rank = self._rank(sample.key_expr)
        if rank < 0 or rank in self._mine:
            return
        late = self._draw.uniform(0, self._longest) if self._draw is not None else 0.0
        data = sample.payload.to_bytes()
        if late:
            self._loop.call_later(late, self._receiver.received, rank, data)
        else:
            self._receiver.received(rank, data)

    def _presence(self, sample: zenoh.Sample) -> None:
        rank = self._rank(sample.key_expr)
        if rank >= 0 and rank not in self._mine:
            self._receiver.present(rank, sample.kind == zenoh.SampleKind.PUT)

    def _ordered(self, query: zenoh.Query) -> None:
        rank = self._rank(query.key_expr)
        if rank in self._mine:
            data = query.payload.to_bytes() if query.payload is not None else b""
            self._receiver.order(rank, data, partial(self._answer, query))

    def _answer(self, query: zenoh.Query, data: bytes) -> None:
        """Answer an order; what is long in a thread, because that waits for a slow link."""
        if len(data) <= PIECE:
            send_reply(query, data)
        else:
            self._loop.run_in_executor(None, send_pieces, query, data, PIECE)

    # -- what goes ------------------------------------------------------------------------------

    def ask(self, rank: int, data: bytes, seconds: float, take: Callable[[bytes], None]) -> None:
        """Give a node in another process an order; this waits for nothing.

        Args:
            rank: of the node.
            data: the order.
            seconds: how long the answer may take.
            take: is called once, in the event loop, with the answer; with nothing if none has come
                whole, if it has more than :data:`LARGEST_ANSWER` bytes, or before the link is open.
        """
        session = self._session
        if session is None:
            take(b"")
            return
        parts: list[bytes] = []
        whole: list[int] = []

        def take_piece(reply: zenoh.Reply) -> None:
            piece = reply.ok
            if piece is not None and sum(map(len, parts)) <= LARGEST_ANSWER:
                parts.append(piece.payload.to_bytes())
                size = piece.attachment.to_string() if piece.attachment is not None else ""
                whole.append(int(size) if size.isdecimal() else len(parts[-1]))

        def ended() -> None:
            answer = b"".join(parts)
            take(answer if {*whole} == {len(answer)} and len(answer) <= LARGEST_ANSWER else b"")

        # What nodes tell each other to go on goes before the pieces of a long answer.
        with suppress(zenoh.ZError):  # of a session that is closed: there is an end, too
            session.get(
                f"{self._root}/{self._names[rank]}/orders",
                self._inbox.entry(take_piece, ended),
                payload=data,
                timeout=seconds,
                consolidation=zenoh.ConsolidationMode.NONE,
                priority=zenoh.Priority.BACKGROUND,
            )

    def send(self, rank: int, data: bytes) -> None:
        """Send what node ``rank`` of this process has to say to all others."""
        publisher = self._publishers.get(rank)
        if publisher is not None:
            publisher.put(data)

    def close(self) -> None:
        """Leave the network."""
        self._publishers.clear()
        self._declared.clear()
        self._opened.close()
