"""A bus over any link, for asyncio."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any, ClassVar, Concatenate, Final, ParamSpec, Self, TypeVar

from vbus.client.aio.waits import Core, Waits
from vbus.client.link import PAUSE_SECONDS, START_SECONDS, BoardLink, starting
from vbus.client.links import open_link
from vbus.client.message import Event, Later, Message, Ready, Sample, Sync
from vbus.client.wire import SessionWire
from vbus.core.errors import TransportError, VbusError
from vbus.core.instants import SECOND
from vbus.core.wall_clock import monotonic
from vbus.protocols.quantities import parse_duration
from vbus.protocols.requests import FORESEEING

if TYPE_CHECKING:
    from vbus.protocols.info import PortInfo

P = ParamSpec("P")
T = TypeVar("T")

TIMEOUT: Final = 5.0
"""Seconds a reply may take, on top of the time its requests let pass. It trades machines that stall
for the time until a dead board is reported."""

MOST_KEPT: Final = 4096
"""Bytes that are held back at most while posting. 64 requests in a message take 0.92 us each
(docs/performance.md): more gain little and come later."""

_LONGEST_WAIT: Final = 86400.0


class ChipCycles(Core):
    """What can be done to one chip, or to whatever is selected."""

    def _names(self) -> PortInfo | None:
        """What is known of the names of chips, lines and pins."""
        raise NotImplementedError

    def _exchange(self, message: Message) -> Coroutine[Any, Any, None]:
        """Send a message and take its replies."""
        raise NotImplementedError

    async def _ask(
        self, make: Callable[Concatenate[Message, P], Later[T]], *args: P.args, **kwargs: P.kwargs
    ) -> T:
        message = Message(self._names())
        later = make(message, *args, **kwargs)
        await self._exchange(message)
        return later.value

    async def _post(
        self, make: Callable[Concatenate[Message, P], None], *args: P.args, **kwargs: P.kwargs
    ) -> None:
        message = Message(self._names())
        make(message, *args, **kwargs)
        await self._exchange(message)

    async def read(self, address: int) -> int:
        """Run one read cycle at ``address`` (0 to 255); return the byte."""
        return await self._ask(Message.read, address)

    async def write(self, address: int, data: int) -> None:
        """Run one write cycle at ``address`` (0 to 255) with ``data`` (0 to 255)."""
        await self._post(Message.write, address, data)

    async def reads(self, address: int, count: int) -> bytes:
        """Run ``count`` (1 to 255) read cycles at one address; return the bytes."""
        return await self._ask(Message.reads, address, count)

    async def writes(self, address: int, data: bytes) -> None:
        """Run a write cycle at one address for each byte of ``data`` (1 to 255 of them)."""
        await self._post(Message.writes, address, data)

    async def wait(self, longest: int | str) -> Ready:
        """Let time pass until the chip takes the next cycle, at most ``longest``.

        ``longest`` is in picoseconds, or text such as ``"100us"``.
        """
        return await self._ask(Message.wait, longest)

    def batch(self) -> Batch:
        """Collect requests and send them as one message when the block is left.

        Inside the block, calls go to the message it gives; each call that has a reply returns a
        :class:`~vbus.client.message.Later`, whose ``value`` can be had after the block. Several
        cycles in one message cost little more than one.
        """
        return Batch(self)


class Batch(Core):
    """A block whose requests travel as one message; made by :meth:`ChipCycles.batch`."""

    def __init__(self, cycles: ChipCycles) -> None:
        self._cycles: ChipCycles = cycles
        self._message: Message = Message(cycles._names())

    async def __aenter__(self) -> Message:
        return self._message

    async def __aexit__(self, kind: type[BaseException] | None, *why: object) -> None:
        if kind is None:
            await self._cycles._exchange(self._message)


class Claim(Core):
    """A block that no other session disturbs; made by :meth:`Bus.claim`."""

    def __init__(self, bus: Bus) -> None:
        self._bus: Bus = bus

    async def __aenter__(self) -> None:
        await self._bus._ask(Message.claim)

    async def __aexit__(self, *why: object) -> None:
        await self._bus._post(Message.unclaim)


class Bus(ChipCycles):
    """One session with a board, over one link.

    Calls run strictly in order. Calls without a result return when their bytes are sent; if the
    board refuses one of them, the next call that waits for a reply raises. Several threads or
    tasks may share a bus: each call, and each batch, goes through whole.

    Raises:
        TransportError: (every call) the link is lost, or no reply came in time.
        ProtocolError: (every call) the board refused a request; says which and why.
        ValueError: (every call) an argument that does not fit.

    Args:
        link: an open link; closed with the bus.
        timeout: seconds a reply may take, on top of the time the requests let pass.
    """

    _WAITS: ClassVar[type[Waits]] = Waits

    def __init__(self, link: BoardLink, timeout: float = TIMEOUT) -> None:
        self.link: BoardLink = link
        self.timeout: float = timeout
        self._wire: SessionWire = SessionWire()
        self._waits: Waits = self._WAITS()
        self._info: PortInfo | None = None
        self._passing: int = 0
        self._posting: bool = False
        self._kept: bytearray = bytearray()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, *why: object) -> None:
        with suppress(TransportError) if kind is not None else nullcontext():
            await self.close()

    async def close(self) -> None:
        """Close the link, sending first what is held back; again is harmless.

        Raises:
            TransportError: the link can tell that what was sent last has not arrived (Zenoh); it
                is closed all the same.
        """
        # A link that is lost already has said so to the call that found it.
        with suppress(VbusError):
            await self.posting(False)
        # Before the link goes: calls of other threads fail with a reason.
        self._wire.end(TransportError(f"{self.link.where}: this end has closed it"))
        try:
            self.link.finish()
        finally:
            self.link.close()

    @property
    def info(self) -> PortInfo:
        """What HELLO said: board, chips, lines, outputs, pins."""
        if self._info is None:
            raise ValueError("nothing is known of the session yet; call hello first")
        return self._info

    def chip(self, *names: str) -> Chip:
        """Return the chip called so; with several names, chips written in one strobe.

        Raises:
            ValueError: no such chip; says which there are.
        """
        known = [chip.name for chip in self.info.chips]
        for name in names:
            if name not in known:
                raise ValueError(f"no chip {name!r}; this session has {', '.join(known)}")
        # A set: a name given twice is one chip.
        return Chip(self, sum(1 << known.index(name) for name in set(names)))

    @classmethod
    async def _connect(cls, where: str, timeout: float, wait: str | None) -> Self:
        """Open a session as :func:`connect` does."""
        end = monotonic() + (START_SECONDS if wait is None else parse_duration(wait) / SECOND)
        while True:
            try:
                return await cls._try(where, timeout)
            except TransportError:
                # A link that cannot be opened yet may belong to a board that is being built: waited
                # for where that is asked, or known.
                if monotonic() >= end or (wait is None and not starting(where)):
                    raise
            await cls._WAITS().pause(PAUSE_SECONDS)

    @classmethod
    async def _try(cls, where: str, timeout: float) -> Self:
        waits = cls._WAITS()
        link = await waits.opened(open_link, where)
        bus = cls(link, timeout)
        try:
            if not await waits.until_ready(link.fd, True, monotonic() + timeout):
                raise TransportError(f"{link.where} cannot be opened within {timeout:g} s")
            link.check()
            link.check_board((await bus.hello()).board)
        # Cancelled, too: no descriptor stays open.
        except BaseException:
            await bus.close()
            raise
        return bus

    # -- one call for each request ----------------------------------------------------------------

    async def hello(self) -> PortInfo:
        """Ask what is attached; stored as :attr:`info`."""
        message = Message()
        later = message.hello()
        await self._exchange(message)
        self._info = later.value
        return later.value

    async def echo(self, number: int = 0) -> int:
        """Return ``number`` (0 to 255) when everything before it is done."""
        return await self._ask(Message.echo, number)

    async def select(self, mask: int) -> None:
        """Let the following cycles of the bus go to these chips; bit n is ``info.chips[n]``."""
        await self._post(Message.select, mask)

    def claim(self) -> Claim:
        """Hold the selected chips' bus for the length of the block; waits its turn."""
        return Claim(self)

    async def lines(self, levels: Mapping[int | str, int]) -> None:
        """Put control lines, by number or name, to levels 0 or 1, all at one instant."""
        await self._post(Message.lines, levels)

    async def drive(self, data: int) -> None:
        """Drive D0-D7 with ``data`` (0 to 255)."""
        await self._post(Message.drive, data)

    async def release(self) -> None:
        """Let D0-D7 float."""
        await self._post(Message.release)

    async def sample(self) -> Sample:
        """Return D0-D7 as they stand, and the output lines."""
        return await self._ask(Message.sample)

    async def pin(self, pin: int | str, level: int | None) -> None:
        """Drive a side pin, by number or name, to 0 or 1; None lets it go."""
        await self._post(Message.pin, pin, level)

    async def getpin(self, pin: int | str) -> int:
        """Return the level of a side pin, by number or name."""
        return await self._ask(Message.getpin, pin)

    async def delay(self, duration: int | str) -> None:
        """Let time pass for this host: picoseconds, or text such as ``"10ms"``.

        Returns at once; what is asked afterwards is answered after that time.
        """
        await self._post(Message.delay, duration)

    async def at(self, instant: int | str) -> None:
        """Set the host's own clock (slaved boards): the next cycle happens at ``instant``."""
        await self._post(Message.at, instant)

    async def leases(self, on: bool = True) -> None:
        """Answer polls from leases, or ask the board each time (as at the start).

        On lockstep and slaved boards a read without side effects tells how long its byte will
        stay; until then it is given again without asking. The board gets the number of such polls,
        so that time, counts and traces are those of a host that asks.
        """
        self._wire.stamped_polls = "polled_at" in self.info.features
        # What a poll costs is counted by this end, so it must know the shortest cycle of each chip.
        self._wire.cycles = [chip.cycle_ps for chip in self.info.chips] if on else []
        await self._post(Message.leases, on, FORESEEING in self.info.features)

    async def posting(self, on: bool = True) -> None:
        """Keep requests without a reply back, to travel with the next one that has a reply.

        ``False`` sends what is held back, and keeps nothing back any more (as at the start).
        """
        self._posting = on
        # An empty message: all that is held back goes with it.
        if not on:
            await self._exchange(Message())

    async def now(self) -> int:
        """Return chip time (ps)."""
        return await self._ask(Message.now)

    async def sync(self) -> Sync:
        """Bring the chips up to the host's time; return output lines and the next edge's bound."""
        return await self._ask(Message.sync)

    async def events(self, *outputs: int | str) -> None:
        """Have each edge of these output lines reported from now on; of none: stop."""
        await self._post(Message.events, *outputs)

    def take_events(self) -> list[Event]:
        """Return and forget the events that are here; every call lets some arrive."""
        events = list(self._wire.events)
        self._wire.events.clear()
        return events

    async def next_event(self, timeout: float | None = None) -> Event | None:
        """Return the oldest event; None if none comes within ``timeout`` seconds.

        Other calls wait meanwhile.
        """
        deadline = monotonic() + (self.timeout if timeout is None else timeout)
        async with self._waits:
            while not self._wire.events:
                until = self.link.until(deadline)
                if (
                    not await self._waits.until_ready(self.link.fd, False, until)
                    and until == deadline
                ):
                    return None
                self._receive()
        return self._wire.events.popleft()

    # -- the link ---------------------------------------------------------------------------------

    def _names(self) -> PortInfo | None:
        return self._info

    def _exchange(self, message: Message) -> Coroutine[Any, Any, None]:
        return self.exchange(message, None)

    async def exchange(self, message: Message, mask: int | None) -> None:
        """Send ``message`` with these chips selected (None: as it is) and take its replies."""
        async with self._waits:
            polls = self._wire.known(message, mask)
            # Answered by a lease: nothing is sent, unless the board must learn of polls.
            if polls is not None:
                self._kept += polls
                return
            sent = self._wire.send(message, mask)
            self._passing += message.duration
            if self._kept or self._posting:
                self._kept += sent
                # Held back while nothing is asked, up to a size at which more gain little.
                if self._posting and len(self._kept) < MOST_KEPT and message.done:
                    return
                sent = bytes(self._kept)
                self._kept.clear()
            paused = self._wire.paused
            rest = memoryview(sent)
            try:
                rest = self._send(rest)
                # A link inside the process has the answer here: no wait, and no system call.
                if self.link.at_once:
                    self._receive()
                waiting = bool(rest) or not message.done
                deadline = monotonic() + self._patience() if waiting else 0.0
                while rest or not message.done:
                    # Waiting for room as well would return at once, and burn time, when there is
                    # room.
                    writing = bool(rest) and self.link.by_descriptor
                    until = self.link.until(deadline)
                    if self.link.silent or (
                        not await self._waits.until_ready(self.link.fd, writing, until)
                        and until == deadline
                    ):
                        before, paused = paused, self._wire.paused or self.link.paused()
                        if not (paused or before):  # who goes on has time to answer, too
                            raise self._late(message)
                        deadline = monotonic() + self._patience()
                    was = self._wire.paused
                    self._receive()
                    # Paused or gone on: what was waited for until now does not count.
                    if self._wire.paused != was:
                        deadline = monotonic() + self._patience()
                    rest = self._send(rest)
            finally:
                # A part of a request is with the board: what comes next would be read as its end.
                if rest:
                    self._wire.end(
                        TransportError(f"{self.link.where}: a message was cut off half-way")
                    )
            if message.last is not None:
                self._passing = 0
            self._wire.raise_refusal()
            if message.requests:
                self.link.replied()

    def _send(self, data: memoryview) -> memoryview:
        """Send what the link takes now; return the rest."""
        if not data:
            return data
        try:
            return data[self.link.write(data) :]
        except TransportError as error:
            self._wire.end(error)
            raise

    def _receive(self) -> None:
        try:
            self._wire.feed(self.link.read())
        except TransportError as error:
            self._wire.end(error)
            raise

    def _patience(self) -> float:
        """Return how many seconds the replies may take."""
        passing = self._passing * 1e-12
        # Chip time that the requests let pass takes as much wall time by the board's rate.
        if self._info is not None and self._info.rate > 0:
            passing /= self._info.rate
        return min(self.timeout + passing + self.link.patience, _LONGEST_WAIT)

    def _late(self, message: Message) -> TransportError:
        for name, later in message.requests:
            if later is not None and not later.done:
                return TransportError(
                    f"{self.link.where}: no reply to {name} within {self._patience():g} s;"
                    " is the board still running? (vbus ls)"
                )
        return TransportError(f"{self.link.where}: the other end takes no more bytes")


class Chip(ChipCycles):
    """One chip of a session, or several written together; made by :meth:`Bus.chip`.

    Every call selects the chip first if another one was selected.

    Args:
        bus: the session.
        mask: bit n stands for ``info.chips[n]``.
    """

    def __init__(self, bus: Bus, mask: int) -> None:
        self.bus: Bus = bus
        self.mask: int = mask

    def _names(self) -> PortInfo | None:
        return self.bus.info

    def _exchange(self, message: Message) -> Coroutine[Any, Any, None]:
        return self.bus.exchange(message, self.mask)


async def connect(where: str, timeout: float = TIMEOUT, wait: str | None = None) -> Bus:
    """Open a session with a board and ask what is attached.

    Args:
        where: ``"pty:PATH"``, ``"unix:PATH"``, ``"tcp:HOST:PORT"``,
            ``"serial:PATH?baud=115200"``, ``"zenoh:BOARD/CHIP?connect=ENDPOINT"``, or the path of
            a PTY. ``$NAME`` stands for an environment variable.
        timeout: seconds a reply may take.
        wait: how long the board may take to come, such as ``"5 s"``. Without it a board is waited
            for that has begun to start.

    Raises:
        TransportError: the link cannot be opened, or no board answers; says what to do.
        ProtocolError: the other side speaks no byte protocol, or another version.
        ValueError: ``where`` is no link.
    """
    return await Bus._connect(where, timeout, wait)
