"""One session with the remote board: bytes to it and from it, over any link of the clients."""

import asyncio
import os
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar

from vbus.client.blocking import until_ready
from vbus.client.link import BoardLink
from vbus.client.links import open_link
from vbus.core.errors import TransportError, VbusError
from vbus.core.wall_clock import monotonic, monotonic_ns
from vbus.serve.attach.meter import Meter
from vbus.transports.base import ignore
from vbus.transports.sockets import KEEP_ALIVE

T = TypeVar("T")


async def aside(work: Callable[[], T], unwanted: Callable[[T], object] | None = None) -> T:
    """Do ``work`` in a thread of its own; what it raises is raised here.

    The thread keeps no process from ending, other than those of an executor.

    Args:
        work: what blocks.
        unwanted: takes the result if the caller waits for it no longer.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[T] = loop.create_future()

    def settle(result: T | None, error: BaseException | None) -> None:
        if done.cancelled():
            if error is None and unwanted is not None:
                unwanted(result)  # type: ignore[arg-type]
        elif error is not None:
            done.set_exception(error)
        else:
            done.set_result(result)  # type: ignore[arg-type]

    def run() -> None:
        result: T | None = None
        failure: BaseException | None = None
        try:
            result = work()
        except BaseException as error:
            failure = error
        with suppress(RuntimeError):  # the loop has ended meanwhile
            loop.call_soon_threadsafe(settle, result, failure)

    # A daemon: Ctrl-C does not wait until a computer that is off has not answered.
    threading.Thread(target=run, daemon=True).start()
    return await done


MOST_PENDING: Final = 65536
"""Bytes the board has not taken beyond which its host is read from no more: as many as a board
lets wait for a host. A bound of memory."""
OPEN_SECONDS: Final = 5.0
"""How long opening a link may take; not measured."""
BEAT_SECONDS: Final = 1.0
"""How often to ask an idle board whether it is there, on links that do not report its end (s);
not measured."""
LEAVING_SECONDS: Final = 2.0
"""How long a host that has gone waits for what it has asked for; not measured."""
VANISHED_MS: Final = 25_000
"""How long bytes may be on their way before the other computer counts as vanished: as long as a
silent host is waited for (``KEEP_ALIVE`` of the sockets)."""
TICK_SECONDS: Final = 0.1
"""How often a link is looked after that has to mend itself; not measured."""


def opened(where: str) -> BoardLink:
    """Open a link and wait until it is open.

    Raises:
        TransportError: it cannot be opened; says why and what to do.
        ValueError: it is no link.
    """
    link = open_link(where)
    try:
        if not until_ready(link.fd, True, monotonic() + OPEN_SECONDS):
            raise TransportError(f"{link.where} cannot be opened within {OPEN_SECONDS:g} s")
        link.check()
        if link.where.startswith("tcp:"):
            _keep_alive(link)
    except BaseException:
        link.close()
        raise
    return link


def _keep_alive(link: BoardLink) -> None:
    """Have the system find out that the other computer has vanished, as a board does of a host."""
    with socket.socket(fileno=os.dup(link.fd)) as connected:
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in (*KEEP_ALIVE, (socket.TCP_USER_TIMEOUT, VANISHED_MS)):
            connected.setsockopt(socket.IPPROTO_TCP, option, value)


class Upstream:
    """A session with the board that outlives its host by what the host has left to be done.

    Bytes given to :meth:`send` before the link is open wait for it.

    Args:
        loop: the event loop.
        where: the link.
        meter: sees all that passes.
        before: the session that must be over before this one begins: that of the last host of a
            terminal, whose claims and writes come first.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        where: str,
        meter: Meter,
        before: "Upstream | None" = None,
    ) -> None:
        self.on_data: Callable[[bytes], object] = ignore
        """Takes what has come."""
        self.on_room: Callable[[], object] = ignore
        """Called when the board takes bytes again."""
        self.on_over: Callable[[TransportError | None], object] = ignore
        """Called at the end with the reason if the session was lost, and None if it was ended."""
        self.over: asyncio.Event = asyncio.Event()
        """Set when the link is closed."""
        self.meter: Meter = meter
        self._loop: asyncio.AbstractEventLoop = loop
        self._where: str = where
        self._before: Upstream | None = before
        self._link: BoardLink | None = None
        self._pending: bytearray = bytearray()
        self._finishing: bool = False
        self._leaving: bool = False
        self._half_closed: bool = False
        self._ended: bool = False
        self._reading: bool = False
        self._writing: bool = False
        self._late: asyncio.TimerHandle | None = None
        self._tick: asyncio.TimerHandle | None = None
        self._beat: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[None] = loop.create_task(self._open())

    @property
    def full(self) -> bool:
        """Whether the host is to wait until the board has taken what it was sent."""
        return len(self._pending) > MOST_PENDING

    @property
    def paused(self) -> bool:
        """Whether the board is paused, as far as the link reports that."""
        return self._link is not None and not self._ended and self._link.paused()

    # -- opening --------------------------------------------------------------------------------

    async def _open(self) -> None:
        before, self._before = self._before, None
        if before is not None:
            await before.over.wait()
        if self._finishing and not self._pending:
            self._end(None)
            return
        try:
            link = await aside(lambda: opened(self._where), BoardLink.close)
        except (VbusError, OSError, ValueError) as error:
            self._end(error if isinstance(error, TransportError) else TransportError(str(error)))
            return
        if self._ended:
            link.close()
            return
        self._link = link
        self.read_on()
        self._flush()
        self._end_in_time()
        if not link.by_descriptor and not self._ended:
            self._beat = self._loop.call_later(BEAT_SECONDS, self._look_for_board, link)

    # -- from the board -------------------------------------------------------------------------

    def read_on(self) -> None:
        """Take what comes from the board."""
        if self._link is not None and not self._ended and not self._reading:
            self._reading = True
            add = getattr(self._loop, "add_direct_reader", self._loop.add_reader)
            add(self._link.fd, self._readable)

    def read_off(self) -> None:
        """Leave what comes from the board where it is."""
        if self._link is not None and self._reading:
            self._reading = False
            self._loop.remove_reader(self._link.fd)

    def _readable(self) -> None:
        link = self._link
        if link is None or self._ended:
            return
        try:
            while data := link.read():
                self.meter.came(data, monotonic_ns())
                self.on_data(data)
                if link.by_descriptor or self._ended:
                    return
        except TransportError as error:
            self._end(None if self._half_closed and link.by_descriptor else error)
            return
        if not link.by_descriptor:
            self._flush()

    def _look_after(self) -> None:
        """A link without a descriptor of its own repeats what was lost when it is read."""
        link = self._link
        if link is None or not link.unanswered:
            if self._tick is not None:
                self._tick.cancel()
                self._tick = None
        elif self._tick is None:
            self._tick = self._loop.call_later(TICK_SECONDS, self._ticked)

    def _ticked(self) -> None:
        self._tick = None
        if self._reading:
            self._readable()
        else:
            self._look_after()

    def _look_for_board(self, link: BoardLink) -> None:
        """A host that asks nothing is to know all the same that its board has gone."""
        self._beat = self._loop.call_later(BEAT_SECONDS, self._look_for_board, link)
        try:
            link.look_for_board()
        except TransportError as error:
            self._end(error)
        else:
            self._look_after()

    # -- to the board ---------------------------------------------------------------------------

    def send(self, data: bytes) -> None:
        """Send bytes; those the link does not take now go when it does."""
        if self._ended:
            return
        self._pending += data
        if self._link is not None:
            self._flush()

    def _flush(self) -> None:
        link = self._link
        if link is None or self._ended:
            return
        was_full = self.full
        try:
            while self._pending:
                now = monotonic_ns()
                with memoryview(self._pending) as rest:
                    sent = link.write(rest)
                if not sent:
                    break
                self.meter.sent(bytes(self._pending[:sent]), now)
                del self._pending[:sent]
        except TransportError as error:
            self._end(error)
            return
        if link.by_descriptor:
            self._watch_room(bool(self._pending))
        else:
            self._look_after()
        if was_full and not self.full:
            self.on_room()
        if self._finishing and not self._pending:
            self._last_sent(link)

    def _watch_room(self, wanted: bool) -> None:
        if self._link is not None and wanted != self._writing:
            self._writing = wanted
            if wanted:
                self._loop.add_writer(self._link.fd, self._flush)
            else:
                self._loop.remove_writer(self._link.fd)

    # -- ending ---------------------------------------------------------------------------------

    def finish(self, waits: bool) -> None:
        """No more is sent: end the session when all is done that was asked for.

        Args:
            waits: whether the host is still there for its answers; else the wait is short.
        """
        if self._ended:
            return
        if not waits:
            self.on_data = ignore
            self.leave()
        self._finishing = True
        if self._link is not None:
            self.read_on()
            self._flush()

    def leave(self) -> None:
        """The host has gone: the session ends soon, also if not all is done."""
        self._leaving = True
        self._end_in_time()

    def _end_in_time(self) -> None:
        # What the host has sent waits for the link, and has its time from then on.
        if self._leaving and self._link is not None and self._late is None and not self._ended:
            self._late = self._loop.call_later(LEAVING_SECONDS, self._end, None)

    def _last_sent(self, link: BoardLink) -> None:
        if not self._half_closed:
            self._half_closed = True
            link.end_sending()
        if not link.by_descriptor and not link.unanswered:
            self._end(None)

    def _end(self, lost: TransportError | None) -> None:
        """The session is over; again is harmless."""
        if self._ended:
            return
        self._watch_room(False)
        self.read_off()
        self._ended = True
        for timer in (self._late, self._tick, self._beat):
            if timer is not None:
                timer.cancel()
        self._task = self._loop.create_task(self._close())
        self.on_over(lost)

    async def _close(self) -> None:
        link, self._link = self._link, None
        try:
            if link is not None and link.by_descriptor:
                link.close()
            elif link is not None:
                with suppress(TransportError):
                    await aside(link.close)
        finally:
            self.over.set()
