"""Calls of a host as bytes of the byte protocol, and the results they wait for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final, Generic, NamedTuple, TypeVar

from vbus.core.errors import ProtocolError, VbusError
from vbus.protocols.quantities import picoseconds
from vbus.protocols.requests import (
    LONGEST,
    NO_EDGE,
    REQUESTS,
    VERSION,
    Request,
)  # fmt: skip

if TYPE_CHECKING:
    from vbus.protocols.info import PortInfo

T = TypeVar("T")
Values = tuple[int | bytes, ...]
Decode = Callable[[Values], T]


class Ready(NamedTuple):
    """What WAIT found.

    Attributes:
        ready: whether the chip takes the next cycle now.
        instant: chip time (ps).
    """

    ready: bool
    instant: int


class Sample(NamedTuple):
    """What SAMPLE saw: D0-D7, and the output lines (bit n is ``info.outputs[n]``)."""

    data: int
    outputs: int


class Sync(NamedTuple):
    """The answer to SYNC.

    Attributes:
        outputs: output lines; bit n is ``info.outputs[n]``.
        no_edge_before: no output line moves before this instant (ps); None: none is in sight.
    """

    outputs: int
    no_edge_before: int | None


class Event(NamedTuple):
    """An edge on a watched line: all output lines after it, and its instant (ps)."""

    outputs: int
    instant: int


_READ4: Final = REQUESTS["READ4"]
_READS4: Final = tuple(_READ4.pack(address) for address in range(16))
"""READ4 of each address: most of what drivers ask for."""


class Later(Generic[T]):
    """A reply that has been asked for and may not be here yet.

    Attributes:
        name: the request, for messages.
        reply: tag of what it is answered by.
        number: its number in the session, once it has been sent.
        done: whether :attr:`value` can be had.
    """

    __slots__ = ("_decode", "_error", "_value", "done", "name", "number", "reply")

    def __init__(self, row: Request, decode: Decode[T]) -> None:
        self.name: str = row.name
        self.reply: str = row.reply
        self.number: int = -1
        self.done: bool = False
        self._decode: Decode[T] = decode
        self._value: T | None = None
        self._error: VbusError | None = None

    @property
    def value(self) -> T:
        """The reply.

        Raises:
            ProtocolError: the request was refused; says why.
            ValueError: the message has not been sent, or its reply is not here.
        """
        if self._error is not None:
            raise self._error
        if not self.done:
            raise ValueError(f"the reply to {self.name} is not here yet; leave the batch first")
        return self._value  # type: ignore[return-value]

    def settle(self, values: Values) -> None:
        """Take the reply's values; for :class:`~vbus.client.wire.SessionWire` only."""
        try:
            self._value = self._decode(values)
        # A reply of another version: the call fails, the session goes on.
        except ValueError as error:
            self._error = ProtocolError(str(error))
        self.done = True

    def fail(self, error: VbusError) -> None:
        """Take an error in the reply's place; for :class:`~vbus.client.wire.SessionWire` only."""
        self._error = error
        self.done = True


def _number(values: Values) -> int:
    return int(values[0])


def _data(values: Values) -> bytes:
    return bytes(values[0])


def _nothing(values: Values) -> None:
    return None


def _ready(values: Values) -> Ready:
    return Ready(bool(values[0]), int(values[1]))


def _sample(values: Values) -> Sample:
    return Sample(int(values[0]), int(values[1]))


def _sync(values: Values) -> Sync:
    edge = int(values[1])
    return Sync(int(values[0]), None if edge == NO_EDGE else edge)


def _hello(values: Values) -> PortInfo:
    from vbus.protocols.info import decode_hello

    version, info = decode_hello(_data(values))
    if version != VERSION:
        raise ValueError(f"the board speaks version {version}; this client speaks {VERSION}")
    return info


class Message:
    """Requests that travel together, in the order of the calls.

    Calls that have a reply return a :class:`Later`. Addresses are 0 to 255. Instants and
    durations are picoseconds, or text such as ``"100us"``. Lines and pins are numbers, or names
    as HELLO tells them (``"x./RST"``; ``"/RST"`` where only one chip has it).

    Raises:
        ValueError: (every call) an argument that does not fit, or a name that is not there.
    """

    def __init__(self, info: PortInfo | None = None) -> None:
        self.info: PortInfo | None = info
        self.data: bytearray = bytearray()
        self.requests: list[tuple[str, Later[Values] | None]] = []
        self.last: Later[Values] | None = None
        """The last reply asked for: replies come in order, so it is the last to come."""
        self.duration: int = 0
        """How much chip time the requests may take besides their bus cycles (ps)."""
        self.polls: int = -1
        """The address, if all this asks for is one read cycle."""
        self.stamp: int = -1
        """The time stamp it ends with (ps)."""
        self.touches: bool = False
        """Whether it does more than let time pass."""
        self.mask: int | None = None
        """The selection these requests end with; None: as it was."""

    @property
    def only_stamp(self) -> bool:
        """Whether it is nothing but a time stamp."""
        # Such a message lets a run of polls go on.
        return self.stamp >= 0 and len(self.requests) == 1

    @property
    def done(self) -> bool:
        """Whether every reply is here."""
        return self.last is None or self.last.done

    def _post(self, row: Request, *values: int | bytes) -> None:
        self.data += row.pack(*values)
        self.requests.append((row.name, None))
        self.polls = -1
        # Time may pass without ending a lease: its byte is known until an instant.
        if row.name not in ("AT", "DELAY"):
            self.touches = True

    def _ask(self, row: Request, decode: Decode[T], *values: int | bytes) -> Later[T]:
        return self._asked(row, decode, row.pack(*values))

    def _asked(self, row: Request, decode: Decode[T], data: bytes) -> Later[T]:
        later = Later(row, decode)
        self.data += data
        self.last = later  # type: ignore[assignment]
        self.requests.append((row.name, self.last))
        self.polls = -1
        self.touches = True
        return later

    def hello(self) -> Later[PortInfo]:
        """Ask what is attached."""
        return self._ask(REQUESTS["HELLO"], _hello, VERSION)

    def echo(self, number: int = 0) -> Later[int]:
        """Ask for ``number`` (0 to 255) back: everything before it is done then."""
        return self._ask(REQUESTS["ECHO"], _number, number)

    def select(self, mask: int) -> None:
        """Let the following cycles go to these chips; bit n is ``info.chips[n]``."""
        self._post(REQUESTS["SELECT"], mask)
        self.mask = mask

    def claim(self) -> Later[None]:
        """Hold the selected chips' bus; the reply comes when it is ours."""
        return self._ask(REQUESTS["CLAIM"], _nothing)

    def unclaim(self) -> None:
        """Let the bus go."""
        self._post(REQUESTS["UNCLAIM"])

    def read(self, address: int) -> Later[int]:
        """Run one read cycle."""
        # Half the bytes for the addresses that chips of one or two ports have.
        if 0 <= address < 16:
            later = self._asked(_READ4, _number, _READS4[address])
        else:
            later = self._ask(REQUESTS["READ"], _number, address)
        # One read alone is a poll, which a lease may answer.
        if len(self.requests) == 1:
            self.polls = address
        return later

    def write(self, address: int, data: int) -> None:
        """Run one write cycle with ``data`` (0 to 255)."""
        if 0 <= address < 16:
            self._post(REQUESTS["WRITE4"], address, data)
        else:
            self._post(REQUESTS["WRITE"], address, data)

    def reads(self, address: int, count: int) -> Later[bytes]:
        """Run ``count`` (1 to 255) read cycles at one address."""
        if not 1 <= count <= LONGEST:
            raise ValueError(f"count = {count}: allowed are 1 to {LONGEST}")
        return self._ask(REQUESTS["READS"], _data, address, count)

    def writes(self, address: int, data: bytes) -> None:
        """Run a write cycle at one address for each byte of ``data`` (1 to 255 of them)."""
        if not 1 <= len(data) <= LONGEST:
            raise ValueError(f"{len(data)} bytes: allowed are 1 to {LONGEST}")
        self._post(REQUESTS["WRITES"], address, bytes(data))

    def wait(self, longest: int | str) -> Later[Ready]:
        """Let time pass until the selected chips take the next cycle, at most ``longest``."""
        return self._ask(REQUESTS["WAIT"], _ready, self._pass(longest))

    def lines(self, levels: Mapping[int | str, int]) -> None:
        """Put control lines to levels (0 or 1), all at one instant."""
        mask = bits = 0
        for line, level in levels.items():
            number = self._line(line, "lines")
            if level not in (0, 1):
                raise ValueError(f"line {line!r} = {level}: allowed are 0 and 1")
            mask |= 1 << number
            bits |= level << number
        self._post(REQUESTS["LINES"], mask, bits)

    def drive(self, data: int) -> None:
        """Drive D0-D7 with ``data``."""
        self._post(REQUESTS["DRIVE"], data)

    def release(self) -> None:
        """Let D0-D7 float."""
        self._post(REQUESTS["RELEASE"])

    def sample(self) -> Later[Sample]:
        """Look at D0-D7 and the output lines."""
        return self._ask(REQUESTS["SAMPLE"], _sample)

    def pin(self, pin: int | str, level: int | None) -> None:
        """Drive a side pin to 0 or 1; None lets it go."""
        if level not in (0, 1, None):
            raise ValueError(f"pin {pin!r} = {level}: allowed are 0, 1 and None to let go")
        self._post(REQUESTS["PIN"], self._line(pin, "pins"), 2 if level is None else level)

    def getpin(self, pin: int | str) -> Later[int]:
        """Look at a side pin."""
        return self._ask(REQUESTS["GETPIN"], _number, self._line(pin, "pins"))

    def delay(self, duration: int | str) -> None:
        """Let this much time pass for this host."""
        self._post(REQUESTS["DELAY"], self._pass(duration))

    def at(self, instant: int | str) -> None:
        """Set the host's own clock (slaved boards): the next cycle happens then."""
        self.stamp = picoseconds(instant)
        self._post(REQUESTS["AT"], self.stamp)

    def leases(self, on: bool, ahead: bool = False) -> None:
        """Have reads without side effects answered by leases, or no more; ``ahead``: by two."""
        self._post(REQUESTS["LEASES"], int(on) << int(ahead))

    def now(self) -> Later[int]:
        """Ask for chip time (ps)."""
        return self._ask(REQUESTS["NOW"], _number)

    def sync(self) -> Later[Sync]:
        """Bring the chips up to the host's time."""
        return self._ask(REQUESTS["SYNC"], _sync)

    def events(self, *outputs: int | str) -> None:
        """Report each edge of these output lines from now on; of none: stop."""
        mask = 0
        for output in outputs:
            mask |= 1 << self._line(output, "outputs")
        self._post(REQUESTS["EVENTS"], mask)

    def _pass(self, duration: int | str) -> int:
        ps = picoseconds(duration)
        self.duration += ps
        return ps

    def _line(self, line: int | str, group: str) -> int:
        """Return the number of a line by number or name."""
        if isinstance(line, int):
            return line
        # Names come with HELLO.
        if self.info is None:
            raise ValueError(f"{line!r}: names are known after hello; until then use numbers")
        names: list[str] = getattr(self.info, group)
        if line in names:
            return names.index(line)
        # The name without its chip is enough where one chip alone has it.
        fitting = [n for n, name in enumerate(names) if name.partition(".")[2] == line]
        if len(fitting) == 1:
            return fitting[0]
        many = "stands for several of" if fitting else "is none of"
        raise ValueError(f"{line!r} {many} the {group} {', '.join(names) or '(there are none)'}")
