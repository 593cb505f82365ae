# Made from aio/bus.py by contrib.generate; change that.
"""A bus over any link, blocking."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Self

from vbus.client.blocking import Blocking
from vbus.client.link import BoardLink
from vbus.client.message import Event, Message, Ready, Sample, Sync
from vbus.protocols.info import PortInfo

TIMEOUT: Final = 5.0
MOST_KEPT: Final = 4096

class ChipCycles(Blocking):
    """What can be done to one chip, or to whatever is selected."""

    def read(self, address: int) -> int:
        """Run one read cycle at ``address`` (0 to 255); return the byte."""

    def write(self, address: int, data: int) -> None:
        """Run one write cycle at ``address`` (0 to 255) with ``data`` (0 to 255)."""

    def reads(self, address: int, count: int) -> bytes:
        """Run ``count`` (1 to 255) read cycles at one address; return the bytes."""

    def writes(self, address: int, data: bytes) -> None:
        """Run a write cycle at one address for each byte of ``data`` (1 to 255 of them)."""

    def wait(self, longest: int | str) -> Ready:
        """Let time pass until the chip takes the next cycle, at most ``longest``.

        ``longest`` is in picoseconds, or text such as ``"100us"``.
        """

    def batch(self) -> Batch:
        """Collect requests and send them as one message when the block is left.

        Inside the block, calls go to the message it gives; each call that has a reply returns a
        :class:`~vbus.client.message.Later`, whose ``value`` can be had after the block. Several
        cycles in one message cost little more than one.
        """

class Batch(Blocking):
    """A block whose requests travel as one message; made by :meth:`ChipCycles.batch`."""

    def __init__(self, cycles: ChipCycles) -> None: ...
    def __enter__(self) -> Message: ...
    def __exit__(self, kind: type[BaseException] | None, *why: object) -> None: ...

class Claim(Blocking):
    """A block that no other session disturbs; made by :meth:`Bus.claim`."""

    def __init__(self, bus: Bus) -> None: ...
    def __enter__(self) -> None: ...
    def __exit__(self, *why: object) -> None: ...

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

    link: BoardLink
    timeout: float

    def __init__(self, link: BoardLink, timeout: float = TIMEOUT) -> None: ...
    def __enter__(self) -> Self: ...
    def __exit__(self, kind: type[BaseException] | None, *why: object) -> None: ...
    def close(self) -> None:
        """Close the link, sending first what is held back; again is harmless.

        Raises:
            TransportError: the link can tell that what was sent last has not arrived (Zenoh); it
                is closed all the same.
        """

    @property
    def info(self) -> PortInfo:
        """What HELLO said: board, chips, lines, outputs, pins."""

    def chip(self, *names: str) -> Chip:
        """Return the chip called so; with several names, chips written in one strobe.

        Raises:
            ValueError: no such chip; says which there are.
        """

    def hello(self) -> PortInfo:
        """Ask what is attached; stored as :attr:`info`."""

    def echo(self, number: int = 0) -> int:
        """Return ``number`` (0 to 255) when everything before it is done."""

    def select(self, mask: int) -> None:
        """Let the following cycles of the bus go to these chips; bit n is ``info.chips[n]``."""

    def claim(self) -> Claim:
        """Hold the selected chips' bus for the length of the block; waits its turn."""

    def lines(self, levels: Mapping[int | str, int]) -> None:
        """Put control lines, by number or name, to levels 0 or 1, all at one instant."""

    def drive(self, data: int) -> None:
        """Drive D0-D7 with ``data`` (0 to 255)."""

    def release(self) -> None:
        """Let D0-D7 float."""

    def sample(self) -> Sample:
        """Return D0-D7 as they stand, and the output lines."""

    def pin(self, pin: int | str, level: int | None) -> None:
        """Drive a side pin, by number or name, to 0 or 1; None lets it go."""

    def getpin(self, pin: int | str) -> int:
        """Return the level of a side pin, by number or name."""

    def delay(self, duration: int | str) -> None:
        """Let time pass for this host: picoseconds, or text such as ``"10ms"``.

        Returns at once; what is asked afterwards is answered after that time.
        """

    def at(self, instant: int | str) -> None:
        """Set the host's own clock (slaved boards): the next cycle happens at ``instant``."""

    def leases(self, on: bool = True) -> None:
        """Answer polls from leases, or ask the board each time (as at the start).

        On lockstep and slaved boards a read without side effects tells how long its byte will
        stay; until then it is given again without asking. The board gets the number of such polls,
        so that time, counts and traces are those of a host that asks.
        """

    def posting(self, on: bool = True) -> None:
        """Keep requests without a reply back, to travel with the next one that has a reply.

        ``False`` sends what is held back, and keeps nothing back any more (as at the start).
        """

    def now(self) -> int:
        """Return chip time (ps)."""

    def sync(self) -> Sync:
        """Bring the chips up to the host's time; return output lines and the next edge's bound."""

    def events(self, *outputs: int | str) -> None:
        """Have each edge of these output lines reported from now on; of none: stop."""

    def take_events(self) -> list[Event]:
        """Return and forget the events that are here; every call lets some arrive."""

    def next_event(self, timeout: float | None = None) -> Event | None:
        """Return the oldest event; None if none comes within ``timeout`` seconds.

        Other calls wait meanwhile.
        """

    def exchange(self, message: Message, mask: int | None) -> None:
        """Send ``message`` with these chips selected (None: as it is) and take its replies."""

class Chip(ChipCycles):
    """One chip of a session, or several written together; made by :meth:`Bus.chip`.

    Every call selects the chip first if another one was selected.

    Args:
        bus: the session.
        mask: bit n stands for ``info.chips[n]``.
    """

    bus: Bus
    mask: int

    def __init__(self, bus: Bus, mask: int) -> None: ...

def connect(where: str, timeout: float = TIMEOUT, wait: str | None = None) -> Bus:
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
