"""A port whose board is elsewhere: calls become requests of the byte protocol over its link.

So a link here may speak another wire format than the board's own. A call whose answer is not here
yet raises :class:`~vbus.protocols.port.NotYet`, and is made again when it is; see
:class:`~vbus.protocols.port.HostPort`.
"""

from collections.abc import Callable
from typing import Any

from vbus.client.message import Later, Message, Sync
from vbus.client.wire import SessionWire
from vbus.core.errors import VbusError
from vbus.core.kernel import NEVER
from vbus.protocols import codes
from vbus.protocols.base import Protocol
from vbus.protocols.port import CardAccess, NotYet, PortError, PortInfo
from vbus.protocols.requests import REFUSALS
from vbus.serve.attach.relay import SOME_TIME, RelayPort
from vbus.serve.attach.upstream import Upstream
from vbus.transports.base import ignore

Make = Callable[[Message], tuple[Later[Any] | None, ...]]
"""Puts requests into a message; returns what will hold their answers."""


class _FarWire(SessionWire):
    """A session as the host sees it, which keeps the number of the last refusal."""

    code: int = 0

    def refuse(self, code: int, number: int) -> None:
        """Take a refusal, and note its code for the host here."""
        self.code = code
        super().refuse(code, number)


class FarPort(RelayPort):
    """A host's hold on a board elsewhere, for wire formats that are carried out here.

    Args:
        upstream: the session with the board.
    """

    def __init__(self, upstream: Upstream) -> None:
        super().__init__(upstream)
        self.on_answer: Callable[[], object] = ignore
        """Called when the call that had to wait may be made again."""
        self.on_edges: Callable[[], object] = ignore
        """Called when edges have been reported between answers."""
        self._wire: _FarWire = _FarWire()
        self._info: PortInfo | None = None
        self._mask: int = 1
        self._asked: Message | None = None
        self._answers: tuple[Later[Any] | None, ...] = ()
        # What came with the last answer: each is taken once.
        self._synced: Sync | None = None
        self._now: int | None = None
        message = Message()
        self._hello: Later[PortInfo] = message.hello()
        upstream.send(self._wire.send(message))
        # No call is carried out before the board has said which chips this session has.
        self._hold()

    # -- between the protocol and the link ------------------------------------------------------

    def take(self, data: bytes) -> None:
        """Take bytes from the board."""
        self._wire.feed(data)
        if self._info is None and self._hello.done:
            self._info = self._hello.value
        if self.held and self._ready:
            self.on_answer()
        if self._wire.events and not self.held:
            self.on_edges()

    def go_on(self) -> bool:
        """Lift the hold if the answer is here."""
        self.held = not self._ready
        return not self.held

    def depart(self, protocol: Protocol) -> None:
        """The host has gone: requests it has sent are carried out one after the other."""

        def go_on() -> None:
            if self.go_on():
                protocol.resume()
                protocol.out.clear()
            if not self.held:
                protocol.reset()
                self.close()

        self.on_answer, self.on_edges = go_on, ignore
        self.upstream.leave()
        go_on()

    @property
    def _ready(self) -> bool:
        return self._info is not None and (self._asked is None or self._asked.done)

    def _hold(self) -> None:
        self.held = True
        self.hold_until = SOME_TIME

    def _ask(self, make: Make) -> tuple[Any, ...]:
        """Send what a call asks for, or return its answers.

        Raises:
            NotYet: they are not here.
            PortError: the board has refused it.
        """
        message = self._asked
        if message is None:
            message = self._asked = Message()
            self._synced = self._now = None
            self._answers = make(message)
            self._send(message)
        if not message.done:
            self._hold()
            raise NotYet
        self._asked = None
        try:
            self._wire.raise_refusal()
            return tuple(None if later is None else later.value for later in self._answers)
        except VbusError as error:
            raise self._refusal(error) from error

    def _send(self, message: Message) -> None:
        try:
            self.upstream.send(self._wire.send(message))
        except VbusError as error:  # the board refuses all there is
            self._asked = None
            raise self._refusal(error) from error

    def _refusal(self, error: VbusError) -> PortError:
        code = self._wire.code
        if code not in REFUSALS:
            return PortError(codes.CLOSED, str(error))
        return PortError(code, f"refused by the board: {REFUSALS[code][1]}")

    def _do(self, make: Callable[[Message], None]) -> None:
        """Ask for what has no answer; an echo tells when it is done or was refused."""
        self._ask(lambda message: (make(message), message.echo()))  # type: ignore[func-returns-value]

    def _pass(self, make: Callable[[Message], None]) -> None:
        """Let time pass, and learn what is asked for next: nothing then has to wait again."""
        _, self._synced, self._now = self._ask(
            lambda message: (make(message), message.sync(), message.now())  # type: ignore[func-returns-value]
        )

    def _post(self, make: Callable[[Message], None]) -> None:
        """Send what has no answer; should it be refused, the next call is."""
        message = Message()
        make(message)
        self._send(message)

    # -- what a protocol asks for ---------------------------------------------------------------

    def info(self) -> PortInfo:
        """Return the contents of the board's HELLO."""
        assert self._info is not None, "the session is held until then"
        return self._info

    def select(self, mask: int) -> None:
        """Choose the chips of following cycles."""
        chips = self.info().chips
        if mask >> len(chips):
            raise PortError(codes.NO_SUCH, f"select {mask:X}: this session has {len(chips)} chips")
        self._mask = mask
        self._post(lambda message: message.select(mask))

    def claim(self) -> bool:
        """Hold the selected chips' bus; False until it is ours."""
        try:
            self._ask(lambda message: (message.claim(),))
        except NotYet:
            return False
        return True

    def unclaim(self) -> None:
        """Let the bus go."""
        self._post(Message.unclaim)

    def read(self, address: int) -> int:
        """Run one read cycle."""
        (value,) = self._ask(lambda message: (message.read(address),))
        return int(value)

    def write(self, address: int, data: int) -> None:
        """Run one write cycle."""
        self._do(lambda message: message.write(address, data))

    def polled(self, address: int, count: int) -> bool:
        """Refuse: nothing was promised."""
        raise PortError(codes.NO_SUCH, "POLLED without a lease; leases are not given here")

    def polled_at(self, address: int, first: int, steps: tuple[int, ...]) -> bool:
        """Refuse: nothing was promised."""
        return self.polled(address, len(steps))

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips take a cycle; None until that is known."""
        try:
            (ready,) = self._ask(lambda message: (message.wait(longest),))
        except NotYet:
            return None
        return ready.ready, ready.instant

    def lines(self, mask: int, levels: int) -> None:
        """Put control lines to levels."""
        count = len(self.info().lines)
        if mask >> count:
            raise PortError(codes.NO_SUCH, f"lines {mask:X}: this session has {count}")
        wanted: dict[int | str, int] = {
            n: levels >> n & 1 for n in range(mask.bit_length()) if mask >> n & 1
        }
        self._do(lambda message: message.lines(wanted))

    def drive(self, data: int) -> None:
        """Drive D0-D7."""
        self._do(lambda message: message.drive(data))

    def release(self) -> None:
        """Let D0-D7 float."""
        self._do(Message.release)

    def sample(self) -> tuple[int, int]:
        """Return D0-D7 and the output lines."""
        (sample,) = self._ask(lambda message: (message.sample(),))
        return sample.data, sample.outputs

    def pin(self, number: int, level: int) -> None:
        """Drive a side pin; 2 lets go."""
        if level not in (0, 1, 2):
            raise PortError(codes.NO_SUCH, f"level {level}; allowed are 0, 1 and 2")
        self._do(lambda message: message.pin(number, None if level == 2 else level))

    def getpin(self, number: int) -> int:
        """Return the level of a side pin."""
        (level,) = self._ask(lambda message: (message.getpin(number),))
        return int(level)

    def delay(self, duration: int) -> bool:
        """Let time pass; False until it has."""
        try:
            self._pass(lambda message: message.delay(duration))
        except NotYet:
            return False
        return True

    def at(self, when: int) -> None:
        """Set the host's own clock."""
        self._pass(lambda message: message.at(when))

    def now(self) -> int:
        """Return chip time."""
        if self._now is None:
            (self._now,) = self._ask(lambda message: (message.now(),))
        now, self._now = self._now, None
        return now

    def sync(self) -> tuple[int, int]:
        """Return the output lines, and before when none of them moves."""
        if self._synced is None:
            self._synced, self._now = self._ask(lambda message: (message.sync(), message.now()))
        synced, self._synced = self._synced, None
        edge = synced.no_edge_before
        return synced.outputs, NEVER if edge is None else edge

    def events(self, mask: int) -> None:
        """Report each edge of these output lines from now on."""
        lines = [n for n in range(mask.bit_length()) if mask >> n & 1]
        if mask >> len(self.info().outputs):
            raise PortError(
                codes.NO_SUCH, f"events {mask:X}: there are {len(self.info().outputs)} outputs"
            )
        self._post(lambda message: message.events(*lines))

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges that have been reported."""
        events = [(event.outputs, event.instant) for event in self._wire.events]
        self._wire.events.clear()
        return events

    # -- by name --------------------------------------------------------------------------------

    def chip_number(self, name: str) -> int:
        """Return the bit number of the chip called ``name``."""
        names = [chip.name for chip in self.info().chips]
        if name not in names:
            raise PortError(codes.NO_SUCH, f"no chip {name!r}; this session has {', '.join(names)}")
        return names.index(name)

    def pin_number(self, name: str) -> int:
        """Return the number of a side pin."""
        return self._number("pin", self.info().pins, name)

    def line_number(self, name: str) -> int:
        """Return the number of a control line."""
        return self._number("line", self.info().lines, name)

    def _number(self, kind: str, known: list[str], name: str) -> int:
        """Return the place of a name among others; its chip may be left out where it is clear."""
        if name in known:
            return known.index(name)
        chips = [chip.name for n, chip in enumerate(self.info().chips) if self._mask >> n & 1]
        found = [n for n, one in enumerate(known) if one.partition(".")[2] == name]
        selected = [n for n in found if known[n].partition(".")[0] in chips]
        if len(selected or found) == 1:
            return (selected or found)[0]
        what = f"{name!r} is a {kind} of several chips" if found else f"no {kind} {name!r}"
        raise PortError(codes.NO_SUCH, f"{what}; there are {', '.join(known) or 'none'}")

    def card(self, address: int, write: bool = False) -> CardAccess | None:
        """Refuse: a card's addresses are decoded where the board is."""
        raise PortError(
            codes.NO_SUCH,
            "a card's addresses are decoded by the board's own links; use r and w here, or attach"
            ' to a link with protocol = "text"',
        )
