"""One connected host: bytes from its link, through its protocol, back to its link."""

import asyncio
import logging
from collections.abc import Callable
from errno import ECONNRESET
from functools import partial
from typing import Final, NamedTuple

from mypy_extensions import mypyc_attr

from vbus.core.kernel import NEVER
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.serve.detached_waits import DetachedWaits, DisconnectPoller, by_claim, report_half
from vbus.serve.fast_path import LATE_NS, SpinPolicy, SpinTurn
from vbus.serve.time.pacer import TimeSource
from vbus.serve.time.statistics import Histogram
from vbus.transports import states
from vbus.transports.base import Link, LinkFilter
from vbus.transports.states import SESSION

READ_SIZE: Final = 448
"""Bytes read at a time, which is a turn: a host that sends without end leaves the others theirs.
Python has memory for so many at hand; for more than 479 it asks the C library, which takes longer
than many a bus cycle."""
BURST: Final = 8
"""Messages served in a row before other sessions have their turn; not measured."""
MOST_EVENTS: Final = 1 << 20
"""Unsent bytes beyond which a host that asked for events and does not read them is hung up on.
A bound of memory."""
MOST_PENDING: Final = 65536
"""Unsent bytes beyond which a host that does not read is not read from either. A bound of
memory."""

log = logging.getLogger("vbus")


class Services(NamedTuple):
    """What serves the sessions of one host entry.

    Attributes:
        loop: the event loop; a :class:`~vbus.serve.loop.HostLoop` calls its sessions itself.
        pacer: moves the board's time.
        turns: of all sessions of the server.
        round_trips: takes how long each message took, from its arrival to its answer (ns).
        disconnects: notices hosts that go while nothing is read from them.
        detached: says what is carried out of hosts that have gone, and when.
        on_end: called once when a session has ended.
        settle: called before an answer leaves; False if it must not. None: any answer may leave.
    """

    loop: asyncio.AbstractEventLoop
    pacer: TimeSource
    turns: SpinTurn
    round_trips: Histogram
    disconnects: DisconnectPoller
    detached: DetachedWaits
    on_end: Callable[["Session"], None]
    settle: Callable[[], bool] | None = None


@mypyc_attr(allow_interpreted_subclasses=True)
class Session:
    """Serves one link in a single callback: read, carry out, write.

    No task, queue or future stands between a byte and its answer. What it does besides, it does by
    :data:`~vbus.transports.states.SESSION`: an event leads to the next state.

    Sessions whose links differ override how bytes come and go (:meth:`take`, :meth:`send`,
    :meth:`push`, :meth:`all_sent`), and how hosts go (:meth:`stays`, :meth:`host_left`,
    :meth:`depart`, :meth:`carried_out`).

    Args:
        services: what serves it.
        link: where the bytes come from and go.
        port: the host's hold on the board.
        protocol: the wire format, on that port.

    Attributes:
        state: where it stands.
        open: whether it has its link.
        pending: what the host has not taken yet.
        deaf: whether the host hears no more, and nothing is sent.
    """

    def __init__(self, services: Services, link: Link, port: HostPort, protocol: Protocol) -> None:
        self.link: Link = link
        self.port: HostPort = port
        self.protocol: Protocol = protocol
        self.received: int = 0
        self.sent: int = 0
        self._fd: int = link.fd
        self._loop: asyncio.AbstractEventLoop = services.loop
        self._add_reader: Callable[[int, Callable[[], None]], object] = getattr(
            services.loop, "add_direct_reader", services.loop.add_reader
        )
        self._pacer: TimeSource = services.pacer
        self._turns: SpinTurn = services.turns
        self._give_way: Callable[[], object] = services.turns.give_way
        self._on_end: Callable[[Session], None] = services.on_end
        self._settle: Callable[[], bool] | None = services.settle
        self._clock: Callable[[], int] = services.pacer.clock
        self._round_trips: Histogram = services.round_trips
        self._read: Callable[[int, int], bytes] = link.read
        self._write_some: Callable[[int, bytearray], int] = link.write
        self.pending: bytearray = bytearray()
        self.state: str = states.NEW
        self.open: bool = True
        self._reading: bool = False
        self._waiting: int = 0
        self._disconnects: DisconnectPoller = services.disconnects
        self._detached: DetachedWaits = services.detached
        self._flush_scheduled: bool = False
        self._patience: SpinPolicy = SpinPolicy()
        self._began: int = 0
        self._ended: int = 0
        self.deaf: bool = False
        self._filters: list[LinkFilter] = []
        self._stopped_reading: int = 0

    def begin(self) -> None:
        """Serve the link from now on."""
        self.link.on_data = self.take
        self.link.on_end = self._host_gone
        self.port.on_resume = self.resume_soon
        self.move(states.BEGIN)

    # -- states -------------------------------------------------------------------------------

    def move(self, event: str) -> None:
        """Go on to the state after an event."""
        before = self.state
        state = self.state = SESSION.after(before, event, self.link.peer)
        if state != before:
            self._reading = state == states.READING
            self.deaf = state in (states.LEAVING, states.DEPARTED)
            self.open = state not in (states.DEPARTED, states.CLOSED)
            self._attend(before == states.READING, state in states.UNREAD)

    def _attend(self, read: bool, watch: bool) -> None:
        """Read the link, or watch for its end, as the state has it; without a descriptor it tells.

        While nothing is read, a host that goes is noticed: others may wait for its claim. The bytes
        it has sent stay where they are. A half-closed link is no end: the host may still read its
        answers.

        Args:
            read: whether it was read until now.
            watch: whether its end is watched for.
        """
        if self._fd < 0:
            return
        if read:
            self._loop.remove_reader(self._fd)
        if watch:
            self._disconnects.watch(self._fd, self.hung_up)
        else:
            self._disconnects.forget(self._fd)
        if self._reading:
            self._add_reader(self._fd, self._readable)

    @property
    def _blocked(self) -> bool:
        """Whether nothing is to be read, though no request waits."""
        return self._stopped_reading > 0 or len(self.pending) > MOST_PENDING

    def _block(self) -> None:
        """Read nothing if that is to be so, and no request waits."""
        if self._reading and self._blocked:
            self.move(states.FULL)

    def _unblock(self) -> None:
        """Read again if that may be."""
        if self.state == states.PAUSED and not self._blocked:
            self.move(states.ROOM)

    # -- reading ------------------------------------------------------------------------------

    def _readable(self) -> None:
        """Serve what has come; then look a little longer, because a driver that polls asks again.

        Looking costs less than sleeping and being woken. The host has its turn first: with nothing
        there a look is dear. It is given up for a while when nothing came or another session was
        served meanwhile; after a few messages in a row, or as many bytes as are read at a time, the
        others have their turn.
        """
        served = looks = 0
        turns = self._turns
        most = turns.looks if self._patience.left and turns.last is self else 0
        turns.last = self
        while True:
            try:
                data = self._read(self._fd, READ_SIZE)
            except BlockingIOError:
                if served and looks < most:
                    looks += 1
                    self._give_way()
                    continue
                break
            except OSError:
                self._host_gone(True)
                return
            if not data:
                if self._reading:
                    self._finish()
                return
            self.received += len(data)
            ended = self._ended
            self.serve(data)
            # The time between the two messages went to other processes, in sched_yield.
            if served and self._began - ended > LATE_NS:
                self._patience.lose()
                return
            served += 1
            looks = 0
            if not most or len(data) == READ_SIZE or not self._reading:
                break
            self._give_way()
            if served == BURST:
                break
        self._patience.served(served)

    def _finish(self) -> None:
        """The host will send no more, but may still read what it asked for."""
        self.move(states.FINISH)
        if not self.stays():
            self.host_left()

    def stays(self) -> bool:
        """Whether a host that sends no more has not taken all its answers."""
        return bool(self.pending)

    def take(self, data: bytes) -> None:
        """Take what the transport has read."""
        self.received += len(data)
        self.serve(data)

    def serve(self, data: bytes) -> None:
        """Carry out what ``data`` asks for; without data, go on after a wait."""
        protocol = self.protocol
        began = self._began = self._clock()
        try:
            self._pacer.catch_up()
            if data:
                protocol.receive(data)
            else:
                protocol.resume()
        except Exception:
            self._broken()
            return
        # A durable journal holds what was done before the host learns of it.
        if protocol.out and (self._settle is None or self.settled()):
            self.send()
        if self.port.held:
            self._wait()
            if self._pacer.halted:
                self.tell_pause(True)
        self._pacer.served()
        self._ended = self._clock()
        if data:
            self._round_trips.note(self._ended - began)

    def _broken(self) -> None:
        log.exception(
            "internal error while serving %s; its session ends, the board goes on", self.link.peer
        )
        self.port.held = False
        self.end("internal error")

    # -- waiting ------------------------------------------------------------------------------

    def _wait(self) -> None:
        """The port is held: read no more until what it waits for has come."""
        if self.state in (states.LEAVING, states.CLOSED):
            return  # the rest of what the host had sent is read first
        if self.state != states.DRAINING:  # nothing is read
            self.move(states.HOLD)
        self._wake_in_time()

    def _wake_in_time(self) -> None:
        """Have the session resumed when the instant that is waited for has come."""
        until = self.port.hold_until
        if self.state == states.DEPARTED:
            until = self._detached.look_at(until)
        if until != NEVER and self._waiting != until:
            self._waiting = until
            self._pacer.wake_at(until, self.resume)
            if self.open and not self._pacer.real:
                self._disconnects.look()  # the next host waits for the end of this wait

    def hung_up(self) -> None:
        """The host has gone: what it had sent is carried out, and the session ends."""
        self._host_gone(True)

    def leaves(self) -> bool:
        """Whether the host has gone and the session goes on to carry out what it had sent.

        Of a link that does not tell, every host may have.
        """
        if not self.open or self.state == states.DRAINING or self._stopped_reading or self._fd < 0:
            return False
        if by_claim(self.port):
            return False
        if self.link.tells_end:
            return self._disconnects.gone(self._fd)
        if self.port.held:
            return self.port.hold_until != NEVER
        return self._reading and self._disconnects.waits(self._fd)

    def resume(self) -> None:
        """What the session waited for may have come."""
        if self.state == states.CLOSED:
            return
        # This wake-up has come: the next wait needs one of its own.
        self._waiting = 0
        self._pacer.catch_up()
        if self._pacer.halted:
            self.hold()
        elif self.port.go_on():
            self.serve(b"")
            if self.state == states.HELD and not self.port.held:
                self.move(states.GO_ON)
                self._block()
            elif self.state == states.DEPARTED and not self.port.held:
                self.carried_out()
        elif self.state == states.DEPARTED and self._detached.gives_up(self.port):
            self.give_up("another host waits to be let in")
        else:
            self._wait()

    def hold(self) -> None:
        """Time stands still: what the host asks for from here on is held until it runs again."""
        port = self.port
        if not port.held:
            port.held = True
            port.hold_until = max(self._pacer.now, 1)
        if self._reading and not self.received:
            self._wake_in_time()  # its HELLO may ask for reports of pauses
        else:
            self._wait()

    def tell_pause(self, paused: bool) -> None:
        """Tell a host that wants it of a pause or its end, when what is done now is done."""
        self._loop.call_soon(self._say, partial(self.protocol.tell_pause, paused))

    def resume_soon(self) -> None:
        """Another session has given back its claim."""
        self._loop.call_soon(self.resume)

    def events_soon(self) -> None:
        """A watched line has moved: send the report once the board is done with this instant."""
        if not self._flush_scheduled:
            self._flush_scheduled = True
            self._loop.call_soon(self._send_events)

    def _send_events(self) -> None:
        self._flush_scheduled = False
        self._say(self.protocol.report_events)

    def _say(self, what: Callable[[], None]) -> None:
        if self.open:
            try:
                what()
            except Exception:
                self._broken()
                return
            if self.protocol.out and self.settled():
                self.push()

    def push(self) -> None:
        """Send bytes that answer no request."""
        self.send()
        if len(self.pending) > MOST_EVENTS:
            log.warning(
                "%s: %d bytes of events wait for a host that does not read them; its session ends",
                self.link.peer, len(self.pending),
            )  # fmt: skip
            self.end("does not read its events", True)

    # -- writing ------------------------------------------------------------------------------

    def settled(self) -> bool:
        """Whether what is about to be answered may be; else the session ends."""
        if self._settle is None or self.deaf or self._settle():
            return True
        self.end("the journal takes no more, and what it does not hold is not answered", True)
        return False

    def send(self) -> None:
        """Send what the protocol has for the host."""
        out = self.protocol.out
        if self.deaf:
            out.clear()
            return
        # A copy: a fault of one answer takes itself out while it passes.
        for one in tuple(self._filters):
            one(out)
            if not out:
                return
        if not self.pending:
            sent = self._write(out)
            if sent == len(out):
                out.clear()
                return
            del out[:sent]
            self._loop.add_writer(self._fd, self._writable)
        self.pending += out
        out.clear()
        self._block()

    def _write(self, data: bytearray) -> int:
        """Return how many bytes were sent; all, if the host has gone: it may have sent more."""
        try:
            sent = self._write_some(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError:
            if not self.deaf:
                self.move(states.GONE)
                self._loop.call_soon(self.hung_up)
            # As if all were sent: nothing is stored for a host that has gone.
            return len(data)
        self.sent += sent
        return sent

    def _writable(self) -> None:
        sent = self._write(self.pending)
        del self.pending[:sent]
        if not self.pending:
            self._loop.remove_writer(self._fd)
            self.all_sent()
        self._unblock()

    def all_sent(self) -> None:
        """The host has taken all there is."""
        if self.state == states.DRAINING:
            self.host_left()

    # -- what may be wrong with the link ------------------------------------------------------

    def add_filter(self, link_filter: LinkFilter) -> None:
        """Let ``link_filter`` change what is sent from now on, after those that are there."""
        self._filters.append(link_filter)

    def remove_filter(self, link_filter: LinkFilter, held_back: bytes = b"") -> None:
        """Take a filter out again; what it has ``held_back`` is sent now, before anything else."""
        self._filters.remove(link_filter)
        if held_back and self.open:
            self.protocol.out[:0] = held_back
            self.send()

    def stop_reading(self) -> None:
        """Read nothing any more; a host that goes is noticed all the same."""
        self._stopped_reading += 1
        self._block()

    def read_again(self) -> None:
        """Read again, if :meth:`stop_reading` has been taken back as often as it was called."""
        self._stopped_reading -= 1
        self._unblock()

    # -- ending -------------------------------------------------------------------------------

    def _host_gone(self, carry_out: bool) -> None:
        """The link says that the host has gone; maybe what it sent before is to be carried out."""
        if not self.open:
            return
        if self.state != states.LEAVING:
            self.move(states.GONE)
        reset = False
        while carry_out and self.state == states.LEAVING:
            try:
                data = self._read(self._fd, READ_SIZE)
            except OSError as error:
                if reset or error.errno != ECONNRESET:
                    break
                reset = True  # what the host had sent before may stand behind that
                continue
            if not data:
                break
            self.take(data)
        if self.open and self._pacer.halted:
            log.warning(
                "%s: a host has gone while the board was paused; if it gave up waiting, the pause"
                " is the cause", self.link.peer,
            )  # fmt: skip
        self.host_left()

    def hang_up_soon(self, reason: str) -> None:
        """End session and link when what is done now is done; the host notices it."""
        self._loop.call_soon(self.end, reason, True)

    def end(self, reason: str, hang_up: bool = False) -> None:
        """End the session: the port lets go of everything, what waits and half a request are lost.

        Args:
            reason: why, for people.
            hang_up: whether the host is to notice that the link has ended.
        """
        if self.state == states.DEPARTED:
            self._close(states.DONE)
        elif self.open:
            event = states.DONE if self.state == states.LEAVING else states.END
            self._part(reason, partial(self._close, event), hang_up)

    def host_left(self) -> None:
        """The host has gone, and what it had sent is read; what waits is carried out later."""
        if self.open:
            if self.state != states.LEAVING:
                self.move(states.GONE)
            self._part("closed by the host", self.depart)

    def _part(self, reason: str, end: Callable[[], None], hang_up: bool = False) -> None:
        """End the link, after what is done with what the host has asked for."""
        log.debug("%s: %s", self.link.peer, reason)
        self._pacer.forget(self.resume)
        self._waiting = 0
        if self.pending:
            self._loop.remove_writer(self._fd)
        link = self.link
        link.reason = link.reason or reason
        for step in (end, link.hang_up if hang_up else link.close, partial(self._on_end, self)):
            try:
                step()
            except Exception:  # the next host shall find nothing of this one
                log.exception("internal error while the session of %s ended", link.peer)

    def depart(self) -> None:
        """Carry out what the host waits for, if that is to be; see :class:`DetachedWaits`."""
        why = self._detached.take(self)
        if why is None:
            self._close(states.DONE)
            return
        self.move(states.HOLD)
        if why:
            self.give_up(why)
        elif self.port.held:
            self._wake_in_time()
        else:
            self.carried_out()

    def more(self) -> bool:
        """Whether the protocol has not been given all that the host had sent."""
        return False

    def carried_out(self) -> None:
        """What a host that has gone had sent is carried out: the session is over."""
        report_half(self.link.peer, self.protocol)
        self._close(states.DONE)

    def give_up(self, why: str) -> None:
        """Carry out no more of what a host that has gone waits for."""
        log.warning(
            "%s: the host has gone, and what it had sent still waits for %s; %s, so the rest is"
            " discarded", self.link.peer, self._waits_for(), why,
        )  # fmt: skip
        self._close(states.GIVE_UP)

    def _waits_for(self) -> str:
        if by_claim(self.port):
            return "another host's claim"
        return "chip time" if self.port.held else "its turn"

    def _close(self, event: str) -> None:
        """Let go of everything."""
        departed = self.state == states.DEPARTED
        self.move(event)
        self._pacer.forget(self.resume)
        for step in (self.protocol.reset, self.port.close):
            try:
                step()
            except Exception:  # the next host shall find nothing of this one
                log.exception("internal error while the session of %s ended", self.link.peer)
        if departed:
            self._detached.done(self)
