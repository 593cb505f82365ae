"""What a host can ask of a board, whatever the wire it comes over."""

from collections.abc import Callable
from typing import Final, NamedTuple

from mypy_extensions import mypyc_attr

from vbus.protocols.info import ChipInfo as ChipInfo
from vbus.protocols.info import PortInfo as PortInfo

PIN_LEVELS: Final = {"0": 0, "1": 1, "z": 2}
"""What a side pin may be driven to, as people write it; z lets go."""


class PortError(Exception):
    """A request the board refuses; the session goes on.

    Args:
        code: number in the byte protocol's ``'X'`` reply (see :mod:`vbus.protocols.codes`).
        message: what was wrong and what is allowed.
    """

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code: int = code


class NotYet(Exception):
    """A request that cannot be carried out before time has run on.

    :attr:`HostPort.held` is true now: keep the request, and make the same call when the session
    is resumed. Only ports of boards with nodes raise it, where no cycle may run ahead of the grant.
    """


class CardAccess(NamedTuple):
    """What an access at a card address reaches.

    Attributes:
        chip: number of the chip in the session; -1 if none answers.
        address: address at that chip.
        floating: data bits that no chip drives in a read: they read as 1.
        pulsed: side pin that the card pulses low after it; -1: none.
    """

    chip: int
    address: int
    floating: int
    pulsed: int


@mypyc_attr(allow_interpreted_subclasses=True)
class HostPort:
    """One session's hold on a board. Protocols call it; the board implements it.

    Calls that may have to wait (:meth:`wait`, :meth:`delay`, :meth:`claim`) return None or False
    when they cannot finish now. :attr:`held` is then true: the protocol keeps the request, stops,
    and makes the same call again when the session is resumed. The same holds for any call made
    while :attr:`held` is true: check it *before* each request.

    Instants and durations are in picoseconds. Methods raise :class:`PortError` for a request
    that cannot be carried out.
    """

    held: bool = False
    hold_until: int = 0
    """Instant at which a held session may go on; NEVER while it waits for another's claim."""
    on_resume: Callable[[], None] | None = None
    """Called when a claim it has waited for has ended."""

    def go_on(self) -> bool:
        """Lift the hold if what it waited for has come; tell whether the session may go on."""
        raise NotImplementedError

    def close(self) -> None:
        """The session has ended: let go of lines, pins, claims and events."""
        raise NotImplementedError

    def info(self) -> PortInfo:
        """Return what HELLO tells."""
        raise NotImplementedError

    def select(self, mask: int) -> None:
        """Choose the chips that following cycles go to; bit n is ``info().chips[n]``."""
        raise NotImplementedError

    def claim(self) -> bool:
        """Hold the selected chips' bus for a packet; False while another session has it."""
        raise NotImplementedError

    def unclaim(self) -> None:
        """Let the bus go."""
        raise NotImplementedError

    def read(self, address: int) -> int:
        """Run one read cycle; return the byte (0..255)."""
        raise NotImplementedError

    def lease(self, address: int) -> tuple[int, int, int] | None:
        """Tell how long the byte just read at ``address`` will be read again.

        Returns:
            ``(output lines, now, until)``: before the instant ``until`` every read at ``address``
            would give the same byte and the output lines stay, as long as this host does nothing
            but poll and let time pass. None if there is nothing to promise.
        """
        return None

    def foresee(self, address: int) -> tuple[int, int] | None:
        """Tell what reads at ``address`` will give after the lease just given.

        Returns:
            ``(byte, until)``: the byte from the end of the lease to the instant ``until``; the
            output lines stay too, as long as this host does nothing but poll and let time pass.
            None if that is not known.
        """
        return None

    def polled(self, address: int, count: int) -> bool:
        """Run ``count`` read cycles whose bytes the host knows already from a lease.

        False if the session must be resumed later.
        """
        raise NotImplementedError

    def polled_at(self, address: int, first: int, steps: tuple[int, ...]) -> bool:
        """Run such read cycles at the host's own time stamps: ``first``, and after each step.

        False if the session must be resumed later.
        """
        raise NotImplementedError

    def write(self, address: int, data: int) -> None:
        """Run one write cycle."""
        raise NotImplementedError

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle, at most ``longest`` ps.

        Returns:
            ``(ready, instant)``, or None if the session must be resumed later.
        """
        raise NotImplementedError

    def lines(self, mask: int, levels: int) -> None:
        """Put the control lines in ``mask`` to ``levels``, all at this instant."""
        raise NotImplementedError

    def drive(self, data: int) -> None:
        """Drive D0-D7 of the selected chips' bus."""
        raise NotImplementedError

    def release(self) -> None:
        """Let D0-D7 float."""
        raise NotImplementedError

    def sample(self) -> tuple[int, int]:
        """Return the data bus as it stands, and all output lines of the session."""
        raise NotImplementedError

    def pin(self, number: int, level: int) -> None:
        """Drive side pin ``number`` to 0 or 1; 2 lets go."""
        raise NotImplementedError

    def getpin(self, number: int) -> int:
        """Return the level of side pin ``number``."""
        raise NotImplementedError

    def delay(self, duration: int) -> bool:
        """Let time pass for this host; False if the session must be resumed later."""
        raise NotImplementedError

    def at(self, when: int) -> None:
        """Set the host's own clock (slaved boards): the next cycle happens at ``when``."""
        raise NotImplementedError

    def now(self) -> int:
        """Return chip time."""
        raise NotImplementedError

    def sync(self) -> tuple[int, int]:
        """Bring the chips up to the host's time.

        Returns:
            All output lines, and an instant not later than the next edge on any of them
            (:data:`~vbus.core.kernel.NEVER` if there is none in sight).
        """
        raise NotImplementedError

    def events(self, mask: int) -> None:
        """From now on report each edge of these output lines; see :meth:`take_events`."""
        raise NotImplementedError

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges seen since the last call: ``(output lines, instant)``."""
        raise NotImplementedError

    # -- by name, for the text protocol ---------------------------------------------------------

    def chip_number(self, name: str) -> int:
        """Return the bit number of the chip called ``name``."""
        raise NotImplementedError

    def pin_number(self, name: str) -> int:
        """Return the number of the side pin called ``name`` (``"/RST"`` or ``"x./RST"``)."""
        raise NotImplementedError

    def line_number(self, name: str) -> int:
        """Return the number of the control line called ``name``."""
        raise NotImplementedError

    def card(self, address: int, write: bool = False) -> CardAccess | None:
        """Decode a card address; None if no chip answers there.

        A card's port may lead elsewhere in a write than in a read.
        """
        raise NotImplementedError
