"""A link over Zenoh: bytes of the byte protocol travel as numbered messages, each carried out once.

Zenoh does not report failures: a query without an answer simply ends. Here it is repeated, under
its old number, until an answer comes or the time limit is over; then the reason is looked for.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from time import sleep
from typing import Any, Final
from urllib.parse import parse_qsl
from weakref import WeakSet

import zenoh

from vbus.client.link import BoardLink
from vbus.client.zenoh_silence import reason_for_silence
from vbus.core.errors import TransportError
from vbus.core.wall_clock import monotonic
from vbus.network import envelope, keys, places
from vbus.network.security import Security
from vbus.network.session import FORKED, close_session, open_session

LONGEST_PATIENCE: Final = 86400.0


def seconds(where: str, text: str) -> float:
    """Return the patience that a link asks for.

    Raises:
        ValueError: it is no time.
    """
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds <= LONGEST_PATIENCE:
        raise ValueError(
            f"'{where}': patience={text} is no time; write seconds from 0 to {LONGEST_PATIENCE:g},"
            " such as patience=30"
        )
    return seconds


def endpoints_of(board: str, given: str) -> tuple[str, ...]:
    """Return where to connect to: as given, as the environment says, or found on this computer.

    Raises:
        TransportError: nothing is known of the board here.
    """
    # Named, then the environment, then what runs here: the nearest to the user's words first.
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


FORM: Final = "zenoh:BOARD/CHIP?connect=tcp/HOST:PORT"
FIRST_SECONDS: Final = 0.5
"""How long a board may take to answer at all (s). It trades slow networks for the time until a
wrong name is reported; a link may name a patience of its own."""
RECOVERY_SECONDS: Final = 3.0
"""How long a board that has answered before may be out of reach (s), by the same trade."""
AGAIN_SECONDS: Final = 0.1
"""How often a message is repeated meanwhile (s)."""
REPEAT_SECONDS: Final = 0.5
"""After which time without an answer a message is repeated: the answer may have been lost (s).
It trades repeated messages to busy boards for the pause that a lost one makes."""
ASK_SECONDS: Final = 1.0
"""How long the answer to the end of the session is waited for."""
TICK_SECONDS: Final = 0.1
"""How often to look for messages without an answer (s): a fifth of :data:`REPEAT_SECONDS`."""
LONGEST_SECONDS: Final = 86400.0
"""How long the board may take over a message: as long as its delays say."""
_OPTIONS: Final = ("connect", "certificate", "key", "authority", "patience")


@dataclass(slots=True)
class Sent:
    """A message under way: takes what Zenoh's threads bring.

    Attributes:
        link: its link.
        number: its number.
        data: its bytes.
        sent: when it was sent the last time.
        sendings: how often it was sent.
        over: the last sending that has ended without an answer; 0: none.
        silent_since: when it was first found that no board answers; 0 if one may.
    """

    link: ZenohBoardLink
    number: int
    data: bytes
    sent: float = 0.0
    sendings: int = 0
    over: int = 0
    silent_since: float = 0.0

    def take(self, reply: zenoh.Reply) -> None:
        """Take the reply; called in a thread of Zenoh's."""
        ok = reply.ok
        if ok is not None:
            # The first answer says whether the board takes messages that are posted.
            if self.number == 0:
                said = ok.attachment
                self.link.posting = said is not None and said.to_bytes() == envelope.POSTS
            self.link.arrived(self.number, ok.payload.to_bytes())
            return
        err = reply.err
        text = err.payload.to_bytes().decode("utf-8", "replace") if err is not None else ""
        code, _, reason = text.partition(" ")
        if code in (envelope.GONE, envelope.MALFORMED, envelope.TOO_LARGE, envelope.BROKEN):
            self.link.failed(f"refused by the board: {reason}", self.number)

    def ended(self, sending: int) -> None:
        """All that could answer have done so; called in a thread of Zenoh's.

        A board that works on a message lets go of it when it is repeated, and holds the repetition.
        """
        # Of an earlier sending nothing more is expected: a later one is on its way.
        if sending == self.sendings:
            self.over = sending
            self.silent_since = self.silent_since or monotonic()

    @property
    def held(self) -> bool:
        """Whether an answer to what was sent last may yet come."""
        return self.over != self.sendings


_open: WeakSet[ZenohBoardLink] = WeakSet()


def _close_all() -> None:
    """Close what the program has left open: Zenoh's threads must not outlive the interpreter."""
    for link in list(_open):
        link.close()


def _forked() -> None:
    """A process has been forked: Zenoh's threads are not in it, so its copies of links are dead."""
    for link in list(_open):
        link.disown()
    # The child must not close what its parent works with.
    _open.clear()


atexit.register(_close_all)
os.register_at_fork(after_in_child=_forked)


class ZenohBoardLink(BoardLink):
    """An open link to the bus of a chip, or to all of a board.

    Its descriptor becomes readable when replies or events are here.

    Args:
        where: how it was asked for, for messages.
        bus_key: the key at which the board answers.
        session: an open Zenoh session, which belongs to the link from now on.
        endpoints: where it is connected to, for messages.
        security: its certificates, if any.
        patience: seconds that a board which has answered before may be out of reach; None: 3.
    """

    by_descriptor = False

    def __init__(
        self,
        where: str,
        bus_key: str,
        session: zenoh.Session,
        endpoints: tuple[str, ...],
        security: Security | None = None,
        patience: float | None = None,
    ) -> None:
        super().__init__(where, os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC))
        self._bus_key: str = bus_key
        self._endpoints: tuple[str, ...] = endpoints
        self._security: Security | None = security
        if patience is not None:
            self.patience = patience
        self._recovery: float = RECOVERY_SECONDS if patience is None else patience
        self._network: zenoh.Session = session
        self._name: bytes = envelope.new_session()
        self._number: int = 0
        self._given: int = 0
        self._early: dict[int, bytes] = {}
        self._inbox: deque[tuple[int, bytes | TransportError]] = deque()
        self._lock: threading.Lock = threading.Lock()
        self._under_way: dict[int, Sent] = {}
        self._searching: bool = False
        self._closed: bool = False
        self._finished: bool = False
        self._paused: bool = False
        self._posts: Any = None
        self.posting: bool = False
        """Whether the board takes messages as samples: its first answer says so."""
        self._post_answered: bool = False
        self._hearing: bool = False
        """Whether a query for events is open."""
        self._heard: float = 0.0
        """When it was asked last."""
        self._event_number: int = 0
        """Number of the message of events that comes next."""
        self.lost_events: int = 0
        """Messages of events that have not come: the board learns of them, and warns."""
        self._lost_told: int = 0
        self._error: TransportError | None = None
        self._kept: list[Any] = []

    def open(self) -> None:
        """Tell the board that this host is there."""
        token = keys.host(self._bus_key, envelope.public(self._name))
        self._kept.append(self._network.liveliness().declare_token(token))
        replies = zenoh.handlers.Callback(self._reply, indirect=False)
        self._kept.append(self._network.declare_subscriber(keys.replies(token), replies))
        # Before the first message: until its reply comes, who listens there is known.
        self._posts = self._network.declare_publisher(
            keys.requests(token),
            congestion_control=zenoh.CongestionControl.BLOCK,
            reliability=zenoh.Reliability.RELIABLE,
            express=True,
        )
        self._kept.append(self._posts)
        pauses = zenoh.handlers.Callback(self._pause, indirect=False)
        mark = keys.paused(self._bus_key)
        liveliness = self._network.liveliness()
        self._kept.append(liveliness.declare_subscriber(mark, pauses, history=True))
        _open.add(self)

    # -- what a bus calls -----------------------------------------------------------------------

    def write(self, data: memoryview) -> int:
        """Send a message of as much of ``data`` as fits one; 0 while too many are under way.

        The first one goes alone: a board that is shown a later one first knows no such session.
        """
        if self._error is not None:
            raise self._error
        if self._number - self._given >= (envelope.WINDOW if self._given else 1):
            return 0
        part = bytes(data[: envelope.LARGEST])
        query = self._under_way[self._number] = Sent(self, self._number, part)
        self._number += 1
        # Notice of the end of a query costs as much as its reply: the first is worth it.
        self._send(query, watched=query.number == 0, posted=self.posting)
        return len(part)

    def read(self) -> bytes:
        """Return what has come; nothing if nothing has."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self.fd)
        data = b""
        while self._inbox:
            number, item = self._inbox.popleft()
            if isinstance(item, TransportError):
                # A copy that comes late is refused, although its message has been answered.
                if self._error is None and (number < 0 or number in self._under_way):
                    self._error = item
            # Events have no number of their own: they come between replies.
            elif number < 0:
                data += item
            # A reply that comes twice, for a message sent twice, counts once.
            elif self._under_way.pop(number, None) is not None:
                self._early[number] = item
                while self._given in self._early:
                    data += self._early.pop(self._given)
                    self._given += 1
        hears = self._hearing and self._lost_told == self.lost_events
        if self._given and not hears and self._error is None:
            self._hear()
        if not data:
            if self._error is not None:
                raise self._error
            self._look_after()
        return data

    def until(self, deadline: float) -> float:
        """Return when to look after messages without an answer."""
        return min(deadline, monotonic() + TICK_SECONDS)

    def _look_after(self) -> None:
        """Repeat a message that has no answer; when patience is over, look for the reason."""
        query = self._under_way.get(self._given)
        now = monotonic()
        if query is None or self._searching:
            return
        patience = self._recovery if self._given else FIRST_SECONDS
        silent = query.silent_since and not query.held and now - query.silent_since > patience
        # Who had no turn looks late, and has not asked again yet.
        if silent and query.sendings > 1:
            self._searching = True
            # Asking around takes up to two seconds: calls wait with their own time limit meanwhile.
            threading.Thread(target=self._search, daemon=True).start()
        elif now - query.sent > (REPEAT_SECONDS if query.held else AGAIN_SECONDS):
            if query.held:
                query.silent_since = 0.0
            # Whatever keeps posted messages from arriving, queries go the way the first one went.
            self.posting = self.posting and self._post_answered
            self._repeat()

    def _repeat(self) -> None:
        """Send every message again that has no reply."""
        for number in sorted(self._under_way):
            self._send(self._under_way[number], watched=True)

    @property
    def unanswered(self) -> bool:
        """Whether a message has no answer yet."""
        return self._given < self._number

    def disown(self) -> None:
        """Leave the link to the process that has opened it: this one was forked from that."""
        self._lock = threading.Lock()  # a thread that the fork left behind may hold the old one
        self._closed = True
        self._error = TransportError(f"{self.where}: {FORKED}")

    def look_for_board(self) -> None:
        """Send a message without requests, unless one waits for its answer anyway."""
        if not self.unanswered:
            self.write(memoryview(b""))

    def end_sending(self) -> None:
        """Nothing: :meth:`close` says it."""

    def paused(self) -> bool:
        """Whether the board is paused: a token on the network says so."""
        return self._paused

    def check(self) -> None:
        """The session is open."""

    def close(self) -> None:
        """Say good-bye and leave the network; again is harmless."""
        # Zenoh's threads write to the descriptor: none may do so once it is closed.
        with self._lock:
            if self._closed:
                return
            self._closed = True
        if self._error is None and self._number and not self._finished:
            with contextlib.suppress(zenoh.ZError):
                self._say_goodbye()
        close_session(self._network)
        with self._lock:
            os.close(self.fd)
            self.fd = -1

    def finish(self) -> None:
        """End the session when the board has got every message; what is lost is repeated.

        Raises:
            TransportError: the last ones have no reply within the link's patience; says why.
        """
        if self._closed or self._finished or self._error is not None or not self._given:
            return
        self._finished = True
        last = monotonic() + self._recovery
        # The board refuses the end as long as a message is missing.
        while not self._say_goodbye():
            if monotonic() > last:
                lacking = self._number - self._given
                raise TransportError(
                    f"{self.where}: closed, and whether the last messages ({lacking} without a"
                    f" reply) have reached the board is not known: {self._why()}"
                )
            sleep(AGAIN_SECONDS)
            self._repeat()

    def _say_goodbye(self) -> bool:
        """End the session; return whether there is no more to do for what was sent."""
        header = envelope.Envelope(envelope.END, self._name, self._number, self._given)
        replies = list(
            self._network.get(self._bus_key, timeout=ASK_SECONDS, attachment=header.pack())
        )
        early = envelope.EARLY.encode()
        for reply in replies:
            if reply.err is not None and reply.err.payload.to_bytes().startswith(early):
                return False
        self.read()
        return bool(replies) or not self.unanswered

    # -- messages -------------------------------------------------------------------------------

    def _sending(self, query: Sent) -> bytes:
        """Note that a message is sent now; return what goes with it."""
        query.sent = monotonic()
        query.sendings += 1
        return envelope.Envelope(envelope.REQUESTS, self._name, query.number, self._given).pack()

    def _ask(
        self, taken: Callable[[zenoh.Reply], None], ended: Callable[[], None] | None, header: bytes,
        **more: Any,
    ) -> None:  # fmt: skip
        """Ask the board: replies are taken as they come, however long that takes."""
        self._network.get(
            self._bus_key,
            zenoh.handlers.Callback(taken, ended, indirect=False),
            target=zenoh.QueryTarget.BEST_MATCHING,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=LONGEST_SECONDS,
            attachment=header,
            express=True,
            **more,
        )

    def _send(self, query: Sent, watched: bool, posted: bool = False) -> None:
        """Send a message: as a query, or posted as a sample, whose reply will be one, too."""
        header = self._sending(query)
        sending = query.sendings
        ended = (lambda: query.ended(sending)) if watched else None
        try:
            if posted:
                self._posts.put(query.data, attachment=header)
            else:
                self._ask(query.take, ended, header, payload=query.data)
        except zenoh.ZError as error:
            raise TransportError(f"{self.where}: {error}") from error

    def _reply(self, sample: zenoh.Sample) -> None:
        """Take the reply to a message that was posted; called in a thread of Zenoh's."""
        if sample.attachment is None:
            return
        number, code = envelope.replied_to(sample.attachment.to_bytes())
        self._post_answered = True
        data = sample.payload.to_bytes()
        if code:
            self.failed(f"refused by the board: {data.decode('utf-8', 'replace')}", number)
        else:
            self.arrived(number, data)

    def _hear(self) -> None:
        """Ask for events: they are replies to a query, so that no other host hears them."""
        now = monotonic()
        # A board that has gone ends the query at once: not in a loop without a pause.
        if self._closed or now - self._heard < AGAIN_SECONDS:
            return
        self._hearing, self._heard, self._lost_told = True, now, self.lost_events
        header = envelope.Envelope(envelope.EVENTS, self._name, self._lost_told, 0)
        with contextlib.suppress(zenoh.ZError):
            self._ask(
                self._event, lambda: self._hears_no_more(now), header.pack(),
                congestion_control=zenoh.CongestionControl.DROP,
            )  # fmt: skip

    def _event(self, reply: zenoh.Reply) -> None:
        """Take events; for Zenoh's threads."""
        if reply.ok is None or reply.ok.attachment is None:
            return
        number, _ = envelope.replied_to(reply.ok.attachment.to_bytes())
        # Numbers have a gap where messages were dropped.
        self.lost_events += max(number - self._event_number, 0)
        self._event_number = max(self._event_number, number + 1)
        self.arrived(-1, reply.ok.payload.to_bytes())

    def _hears_no_more(self, asked: float) -> None:
        """A query for events has ended: it is asked again at the next look, if it was the last."""
        if asked == self._heard:
            self._hearing = False

    def _pause(self, sample: zenoh.Sample) -> None:
        self._paused = sample.kind == zenoh.SampleKind.PUT

    def failed(self, reason: str, number: int = -1) -> None:
        """The session is over, if message ``number`` was refused and has no reply; for threads."""
        self.arrived(number, TransportError(f"{self.where}: {reason}"))

    def arrived(self, number: int, item: bytes | TransportError) -> None:
        """Take a reply, events (number -1), or what ends the session; for Zenoh's threads."""
        with self._lock:
            if not self._closed:
                self._inbox.append((number, item))
                os.eventfd_write(self.fd, 1)

    def _search(self) -> None:
        """Find out why no board answers; in a thread of its own, because it asks around."""
        try:
            self.failed(self._why())
        except Exception as error:
            self.failed(str(error))

    def _why(self) -> str:
        # A copy: Zenoh's threads take messages out meanwhile.
        tried = max((query.sendings for query in self._under_way.copy().values()), default=1)
        return reason_for_silence(
            self._network, self._bus_key, self._endpoints, self._security, tried
        )


def open_zenoh(rest: str) -> ZenohBoardLink:
    """Open ``BOARD/CHIP?connect=ENDPOINT``, what stands behind ``zenoh:``.

    Raises:
        TransportError: no session with the network; says why and what to do.
        ValueError: this is no such link.
    """
    path, _, query = rest.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    chunks = path.split("/")
    if len(chunks) > 2 or not all(chunks) or set("*$#?") & set(path):
        raise ValueError(f"'zenoh:{rest}' is no link; allowed is {FORM}, or zenoh:BOARD for all")
    unknown = [name for name in options if name not in _OPTIONS]
    if unknown:
        raise ValueError(
            f"'zenoh:{rest}': unknown option {unknown[0]}; allowed are {', '.join(_OPTIONS)}"
        )
    where = f"zenoh:{path}"
    patience = seconds(where, options["patience"]) if "patience" in options else None
    endpoints = endpoints_of(chunks[0], options.get("connect", ""))
    security = places.security_of(options, where)
    session = open_session(connect=endpoints, mode="client", security=security)
    try:
        link = ZenohBoardLink(where, keys.bus(*chunks), session, endpoints, security, patience)
        link.open()
        return link
    except BaseException:
        close_session(session)
        raise
