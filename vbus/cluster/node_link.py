"""What carries the messages of nodes between processes: Zenoh, entering the loop in one place."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

from vbus.errors import NameInUseError, TransportError
from vbus.network.access import answer_access, ask_access
from vbus.network.session import open_session

if TYPE_CHECKING:
    import zenoh

    from vbus.network.security import Security

TEST_DISTURB: Final = "VBUS_TEST_DISTURB"
"""For tests only: ``"SEED:MS"`` holds each message that comes for 0 to MS milliseconds, drawn from
a stream with that seed, so that messages arrive late and out of order."""

ASK_SECONDS: Final = 1.0
ATTEMPT_SECONDS: Final = 0.2
"""How long the first attempt to reach the middle of the star takes, and the pause after each."""
LONGEST_ATTEMPT: Final = 2.0
"""How long later attempts take: certificates are shown over slow links, too."""


class NodeLink:
    """The link of some nodes, which run in this process, to the nodes in others.

    A message goes to all nodes of the board. Keys: ``vbus/BOARD/@nodes/NODE`` carries what a node
    sends, ``vbus/BOARD/@nodes/NODE/alive`` is its liveliness token.

    Args:
        board: name of the board.
        names: all nodes.
        mine: ranks of the nodes in this process.
    """

    def __init__(self, board: str, names: Sequence[str], mine: Sequence[int]) -> None:
        self._root: str = f"vbus/{board}/@nodes"
        self._names: tuple[str, ...] = tuple(names)
        self._mine: tuple[int, ...] = tuple(mine)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._session: zenoh.Session | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}
        self._kept: list[object] = []
        self._entered: deque[tuple[str, int, bytes, Any]] = deque()
        self.on_message: Callable[[int, bytes], None] = _ignore
        """Takes the rank of a node and what it has sent."""
        self.on_presence: Callable[[int, bool], None] = _ignore
        """Takes the rank of a node, and whether it has come or gone."""
        self.on_order: Callable[[int, bytes], bytes] | None = None
        """Takes the rank of a node of this process and an order for it; returns the answer."""
        self._draw: random.Random | None = None
        self._longest: float = 0.0
        wish = os.environ.get(TEST_DISTURB)
        if wish:
            seed, _, milliseconds = wish.partition(":")
            self._draw = random.Random(f"{seed} {mine}")
            self._longest = float(milliseconds or 20) / 1000

    async def open(
        self,
        listen: Sequence[str],
        connect: Sequence[str],
        security: Security | None,
        waits: Callable[[str], None],
    ) -> None:
        """Join the network; where nobody listens yet, wait for it.

        Args:
            listen: endpoints; whoever listens is the middle of the star.
            connect: endpoints of who listens.
            security: certificates, if any.
            waits: takes a sentence, once, if it has to wait.

        Raises:
            TransportError: an endpoint is wrong or in use, or a certificate does not do.
            NameInUseError: a process runs one of the nodes already.
        """
        loop = asyncio.get_running_loop()
        self._loop = loop
        mode = "router" if listen else "client"

        def attempt(seconds: float) -> zenoh.Session:
            return open_session(listen, connect, mode, security, seconds)

        told = False
        seconds = ATTEMPT_SECONDS
        while self._session is None:
            try:
                self._session = await loop.run_in_executor(None, attempt, seconds)
            except TransportError as error:
                if listen or "nobody listens" not in str(error):
                    raise
                if not told:
                    waits(f"nobody listens at {', '.join(connect)} yet; waits for it")
                    told = True
                await asyncio.sleep(ATTEMPT_SECONDS)
                seconds = min(2 * seconds, LONGEST_ATTEMPT)
        await loop.run_in_executor(None, self._declare, self._session, bool(listen), security)

    def _declare(self, session: zenoh.Session, listens: bool, security: Security | None) -> None:
        import zenoh

        if security is not None and listens:
            self._kept.append(answer_access(session, security))
        elif security is not None:
            refused = ask_access(session, f"{self._root}/**")
            if refused:
                names = ", ".join(self._names[rank] for rank in self._mine)
                raise TransportError(f"node {names} is not let in: {refused}")
        for rank in self._mine:
            alive = f"{self._root}/{self._names[rank]}/alive"
            if any(reply.ok for reply in session.liveliness().get(alive, timeout=ASK_SECONDS)):
                raise NameInUseError(
                    f"node {self._names[rank]} runs already in another process; stop that one, or"
                    " start another node"
                )
        self._kept.append(session.declare_subscriber(f"{self._root}/*", self._message))
        for rank in self._mine:
            self._publishers[rank] = session.declare_publisher(
                f"{self._root}/{self._names[rank]}",
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
            )
        liveliness = session.liveliness()
        self._kept.append(
            liveliness.declare_subscriber(f"{self._root}/*/alive", self._presence, history=True)
        )
        for rank in self._mine if self.on_order is not None else ():
            key = f"{self._root}/{self._names[rank]}/orders"
            self._kept.append(session.declare_queryable(key, self._ordered, complete=True))
        for rank in self._mine:
            token = liveliness.declare_token(f"{self._root}/{self._names[rank]}/alive")
            self._kept.append(token)

    # -- from Zenoh's threads -------------------------------------------------------------------

    def _message(self, sample: Any) -> None:
        name = str(sample.key_expr).rpartition("/")[2]
        self._enter(name, 0, sample.payload.to_bytes(), False)

    def _presence(self, sample: Any) -> None:
        import zenoh

        name = str(sample.key_expr).rpartition("/")[0].rpartition("/")[2]
        self._enter(name, 1, b"", sample.kind == zenoh.SampleKind.PUT)

    def _ordered(self, query: Any) -> None:
        name = str(query.key_expr).rpartition("/")[0].rpartition("/")[2]
        data = query.payload.to_bytes() if query.payload is not None else b""
        self._enter(name, 2, data, query)

    def _enter(self, name: str, kind: int, data: bytes, more: Any) -> None:
        first = not self._entered
        self._entered.append((name, kind, data, more))
        if first and self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has been closed meanwhile
                self._loop.call_soon_threadsafe(self._take)

    # -- in the loop ----------------------------------------------------------------------------

    def _take(self) -> None:
        while self._entered:
            name, kind, data, more = self._entered.popleft()
            if name not in self._names:
                continue
            rank = self._names.index(name)
            if kind == 2 and self.on_order is not None:
                more.reply(more.key_expr, self.on_order(rank, data))
                more.drop()
            elif rank in self._mine:
                continue
            elif kind == 1:
                self.on_presence(rank, more)
            elif self._draw is not None and self._loop is not None:
                late = self._draw.uniform(0, self._longest)
                self._loop.call_later(late, self.on_message, rank, data)
            else:
                self.on_message(rank, data)

    def send(self, rank: int, data: bytes) -> None:
        """Send what node ``rank`` of this process has to say to all others."""
        publisher = self._publishers.get(rank)
        if publisher is not None:
            publisher.put(data)

    def close(self) -> None:
        """Leave the network."""
        self._publishers.clear()
        self._kept.clear()
        session, self._session = self._session, None
        if session is not None:
            session.close()  # type: ignore[no-untyped-call]


def _ignore(*_: object) -> None:
    pass
