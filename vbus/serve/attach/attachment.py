"""A board elsewhere as links on this computer: opened, served, taken away while it is gone."""

import asyncio
import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from vbus.core.errors import NameInUseError, TransportError
from vbus.core.wall_clock import monotonic
from vbus.serve.attach.far_board import FarBoard, look_at
from vbus.serve.attach.far_port import FarPort
from vbus.serve.attach.meter import ByteMeter, Meter, Trips
from vbus.serve.attach.relay import Passage, RelayPort, RelaySession
from vbus.serve.attach.upstream import LEAVING_SECONDS, Upstream, aside
from vbus.serve.detached_waits import DetachedWaits, DisconnectPoller
from vbus.serve.fast_path import SpinTurn
from vbus.serve.host_entry import HostEntry, LinkSpec
from vbus.serve.local_socket import Control, LocalSocket
from vbus.serve.registry import socket_path
from vbus.serve.session import Services
from vbus.serve.time.pacer import TimeSource
from vbus.serve.time.statistics import ROUND_TRIP_NS, Histogram
from vbus.transports.base import Link, ignore

LOOK_SECONDS: Final = 1.0
"""How often is looked for a board that is gone; a person starts it again. Not measured."""
PAUSE_SECONDS: Final = 0.5
"""How often to look whether the board is paused (s): a person does that. Not measured."""
READY: Final = "ready"


def _answers(lost: int) -> str:
    return f"; answers lost: {lost}" if lost else ""


@dataclass(frozen=True, slots=True)
class AttachRequest:
    """What is to be attached, and how.

    Attributes:
        where: the board's link, as clients take it.
        name: what the attachment is called here.
        links: addresses of the links here.
        protocol: what they speak.
        patience: seconds the board may be gone before the attachment ends; None: any.
    """

    where: str
    name: str
    links: tuple[str, ...]
    protocol: str = "byte"
    patience: float | None = None


class Attachment:
    """The links of a remote board on this computer, and their hosts.

    Args:
        wanted: what is to be attached.
        board: what the remote board's HELLO says.
        report: takes sentences about what happens.

    Raises:
        PluginError: the protocol is broken.
        TransportError: a link's address is none.
    """

    def __init__(
        self, wanted: AttachRequest, board: FarBoard, report: Callable[[str], None]
    ) -> None:
        self.wanted: AttachRequest = wanted
        self.board: FarBoard = board
        self.trips: Trips = Trips()
        self.state: str = READY
        self.reconnections: int = 0
        self.served: bool = False
        """Whether its links have been open."""
        self._report: Callable[[str], None] = report
        self._hosts: list[HostEntry] = [
            HostEntry(LinkSpec(link, wanted.protocol), f"host{n}")
            for n, link in enumerate(wanted.links)
        ]
        self._last: dict[HostEntry, Upstream] = {}
        self._upstreams: set[Upstream] = set()
        self._turns: SpinTurn = SpinTurn()
        self._looking: asyncio.Task[None] | None = None
        self._failure: TransportError | None = None
        self._stop: asyncio.Event = asyncio.Event()
        self._opened: ExitStack = ExitStack()

    # -- running --------------------------------------------------------------------------------

    async def serve(self, stop: asyncio.Event, ready: Callable[[], None]) -> None:
        """Serve until ``stop`` is set.

        Raises:
            TransportError: a link cannot be opened, the name is taken, or the board was gone for
                longer than patience lasts.
        """
        self._stop = stop
        loop = asyncio.get_running_loop()
        with ExitStack() as closing:
            self._open_local_socket(loop, closing)
            self._disconnects: DisconnectPoller = DisconnectPoller(loop)
            self._disconnects.open()
            closing.callback(self._disconnects.close)
            closing.callback(self._close_links)
            self._open_links(loop)
            self.served = True
            ready()
            pauses = asyncio.ensure_future(self._tell_pauses())
            closing.callback(self._mark_pause, False)
            await stop.wait()
            tasks = [task for task in (pauses, self._looking) if task is not None]
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
            self._close_links()
            await self._leave()
        if self._failure is not None:
            raise self._failure

    def _open_local_socket(self, loop: asyncio.AbstractEventLoop, closing: ExitStack) -> None:
        name = self.wanted.name
        control = Control(
            ignore,
            f"this is an attachment to {self.wanted.where}, which takes no orders; give them on the"
            " computer where that board runs",
        )
        control.orders["status"] = lambda request: self.statistics()
        local = LocalSocket(control)
        closing.callback(local.close)
        try:
            local.open(loop, socket_path(name))
        except NameInUseError as error:
            raise NameInUseError(
                f'a board or attachment called "{name}" runs already ({error}); stop it, or give'
                " the first link of this one another name (--pty NAME)"
            ) from error

    def _open_links(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open every link here.

        Raises:
            TransportError: one cannot be opened; none is open then.
        """
        with ExitStack() as opened:
            for host in self._hosts:
                opened.callback(host.close, "the attachment ends")
                services = Services(
                    loop, TimeSource(), self._turns, Histogram(ROUND_TRIP_NS), self._disconnects,
                    DetachedWaits(TimeSource()), host.ended,
                )  # fmt: skip
                host.open(
                    loop, self.board.name, self._report, partial(self._connect, host, services)
                )
            self._opened = opened.pop_all()

    def _close_links(self) -> None:
        """Take every link here away, as those of a board that stops; again is harmless."""
        self._opened.close()

    async def _leave(self) -> None:
        """Let the board know that the hosts have gone."""
        waits = [asyncio.ensure_future(one.over.wait()) for one in self._upstreams]
        if waits:
            await asyncio.wait(waits, timeout=LEAVING_SECONDS + 1)

    # -- hosts ----------------------------------------------------------------------------------

    def _connect(self, host: HostEntry, services: Services, link: Link) -> None:
        """Begin the session of a host that has connected."""
        host.served += 1
        # A terminal's hosts come one after the other, on a socket side by side.
        before = self._last.get(host) if host.transport.SCHEME == "pty" else None
        upstream = Upstream(services.loop, self.wanted.where, self._meter(), before)
        self._upstreams = {one for one in self._upstreams if not one.over.is_set()} | {upstream}
        self._last[host] = upstream
        session = self._session(host, services, link, upstream)
        upstream.on_over = partial(self._over, host, session, upstream)
        host.sessions.append(session)
        session.begin()
        if session.port.held:
            session.hold()

    def _session(
        self, host: HostEntry, services: Services, link: Link, upstream: Upstream
    ) -> RelaySession:
        """Return what serves a host: byte for byte, or another wire format than the board's."""
        if host.protocol == self.board.protocol:
            port = RelayPort(upstream)
            return RelaySession(services, link, port, Passage(port))
        far = FarPort(upstream)
        session = RelaySession(services, link, far, host.wire(far))
        upstream.on_data = far.take
        far.on_answer, far.on_edges = session.resume, session.events_soon
        return session

    def _meter(self) -> Meter:
        return ByteMeter(self.trips) if self.board.protocol == "byte" else Meter(self.trips)

    def _over(
        self,
        host: HostEntry,
        session: RelaySession,
        upstream: Upstream,
        lost: TransportError | None,
    ) -> None:
        """A session with the board is over."""
        if lost is None:
            session.board_done()
            return
        missing = _answers(upstream.meter.lose())
        if session.open:
            self._report(f"{lost}; the host at {host.transport.url} is hung up on{missing}")
            session.end(f"lost: {lost}", True)
        elif missing:
            self._report(f"{lost}{missing}")
        else:
            return  # its host has gone before
        if self._looking is None and not self._stop.is_set():
            self._looking = asyncio.ensure_future(self._look())
            self._looking.add_done_callback(self._looked)

    async def _tell_pauses(self) -> None:
        """Mark the board as paused here while it is, where its link reports that."""
        marked = False
        while True:
            paused = any(one.paused for one in self._upstreams)
            if paused != marked:
                marked = paused
                self._mark_pause(paused)
            await asyncio.sleep(PAUSE_SECONDS)

    def _mark_pause(self, paused: bool) -> None:
        for host in self._hosts:
            host.transport.tell_pause(paused)

    # -- a board that is gone -------------------------------------------------------------------

    async def _look(self) -> None:
        """Look whether the board is still there; while it is not, its links here are not either."""
        loop = asyncio.get_running_loop()
        since = monotonic()
        while True:
            try:
                found = await aside(partial(look_at, self.wanted.where, self.wanted.protocol))
                self.board.check(found, self.wanted.where)
                if self.state != READY:
                    self._open_links(loop)
                break
            except TransportError as error:
                lost = f"lost: {error}"
                if self.state == READY:
                    missing = _answers(sum(one.meter.lose() for one in self._upstreams))
                    self._report(f"{error}; its links here are away until it is back{missing}")
                    self._close_links()
                elif self.state != lost:
                    self._report(str(error))
                self.state = lost
                if self.wanted.patience is not None and (
                    monotonic() - since >= self.wanted.patience
                ):
                    self._failure = error
                    self._stop.set()
                    return
            await asyncio.sleep(LOOK_SECONDS)
        self.reconnections += 1
        if self.state != READY:
            self.state = READY
            self._report(f"{self.wanted.where}: the board {self.board.name} is back")

    def _looked(self, task: asyncio.Task[None]) -> None:
        self._looking = None
        if not task.cancelled() and (error := task.exception()) is not None:
            self._failure = TransportError(str(error))
            self._stop.set()

    # -- telling about itself -------------------------------------------------------------------

    def statistics(self) -> dict[str, Any]:
        """Return what ``vbus ls --json`` shows of it."""
        chips = [chip["name"] for chip in self.board.chips]
        return {
            "board": self.wanted.name,
            "pid": os.getpid(),
            "policy": self.board.policy,
            "attached": {
                "to": self.wanted.where,
                "board": self.board.name,
                "policy": self.board.policy,
                "state": self.state,
                "reconnections": self.reconnections,
                **self.trips.summary(),
            },
            "chips": list(self.board.chips),
            "links": [host.status(chips) for host in self._hosts],
            "sessions": sum(len(host.sessions) for host in self._hosts),
        }
