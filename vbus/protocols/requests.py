"""The byte protocol as data: every request, every reply, and how their bytes are laid out.

One table serves the parser, the Python client, the documentation, and the test that compares it
with the constants of the C header. All integers are big-endian; instants and durations are in
picoseconds.
"""

import struct
from typing import Final, NamedTuple

from vbus.core.row_table import RowTable
from vbus.protocols import codes

VERSION: Final = 1
"""Version of the byte protocol this table describes."""

LONGEST: Final = 255
"""Most bytes one READS or WRITES can carry; a length of 0 is refused."""

NO_EDGE: Final = (1 << 64) - 1
"""The instant in SYNC's reply when no edge is in sight."""

_FORMATS: Final = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q"}
_WIDTHS: Final = {"u8": 1, "u16": 2, "u32": 4, "u64": 8}


class Field(NamedTuple):
    """One argument of a request, or one value of a reply.

    Attributes:
        name: what it is called in the documentation.
        kind: ``"u8"``, ``"u16"``, ``"u32"``, ``"u64"``; ``"bytes8"`` and ``"bytes16"`` are a
            length of 8 or 16 bits followed by that many bytes, and stand last.
    """

    name: str
    kind: str

    @property
    def counted(self) -> bool:
        """Whether it is a run of bytes behind a length."""
        return self.kind.startswith("bytes")

    @property
    def fixed(self) -> str:
        """Its part of known size: the number itself, or the length of a run of bytes."""
        return "u" + self.kind[5:] if self.counted else self.kind


class PayloadLayout:
    """The bytes behind an opcode or a tag: numbers of fixed size, then perhaps a run of bytes.

    Attributes:
        fields: the parts in order.
        size: bytes of the fixed part, the length of a run of bytes included.
        counted: whether a run of bytes follows.
    """

    __slots__ = ("_struct", "counted", "fields", "size")

    def __init__(self, *fields: Field) -> None:
        self.fields: tuple[Field, ...] = fields
        self._struct: struct.Struct = struct.Struct(
            ">" + "".join(_FORMATS[part.fixed] for part in fields)
        )
        self.size: int = self._struct.size
        self.counted: bool = bool(fields) and fields[-1].counted
        if any(part.counted for part in fields[:-1]):
            raise ValueError("a run of bytes must stand last")

    def limit(self, index: int) -> int:
        """Return the largest number field ``index`` can hold, or its longest run of bytes."""
        return (1 << 8 * _WIDTHS[self.fields[index].fixed]) - 1

    def pack(self, *values: int | bytes) -> bytes:
        """Return the bytes of ``values``, one for each field.

        Raises:
            ValueError: a value that does not fit; says which and what is allowed.
        """
        if not self.counted:
            try:
                return self._struct.pack(*values)
            except struct.error:
                pass  # what does not fit is said below
        if len(values) != len(self.fields):
            raise ValueError(f"{len(values)} values for {len(self.fields)} fields")
        numbers: list[int] = []
        tail = b""
        for index, (part, value) in enumerate(zip(self.fields, values, strict=True)):
            if isinstance(value, bytes):
                tail = value
            number = len(value) if isinstance(value, bytes) else value
            if not 0 <= number <= self.limit(index):
                raise ValueError(f"{part.name} = {number}: allowed are 0 to {self.limit(index)}")
            numbers.append(number)
        return self._struct.pack(*numbers) + tail

    def unpack_from(self, data: bytes | bytearray, offset: int) -> tuple[int, ...]:
        """Return the numbers of the fixed part that starts at ``offset``."""
        result: tuple[int, ...] = self._struct.unpack_from(data, offset)
        return result

    def end(self, data: bytes | bytearray, offset: int) -> int:
        """Return where what starts at ``offset`` ends; 0 if it is not whole."""
        end = offset + self.size
        if self.counted and end <= len(data):
            end += self.unpack_from(data, offset)[-1]
        return end if end <= len(data) else 0


class Reply(NamedTuple):
    """One kind of reply.

    Attributes:
        tag: its first byte, an ASCII letter.
        layout: what follows the tag.
        title: what it says.
    """

    tag: str
    layout: PayloadLayout
    title: str

    @property
    def code(self) -> int:
        """The tag as a number."""
        return ord(self.tag)


class Request(NamedTuple):
    """One row of the protocol.

    Attributes:
        name: its name in capitals.
        code: first byte; the lowest one where ``span`` is above 1.
        title: what it asks for.
        layout: the arguments.
        reply: tag of the answer; empty if there is none.
        span: how many opcodes it takes: 16 where the low four bits are the address.
    """

    name: str
    code: int
    title: str
    layout: PayloadLayout = PayloadLayout()
    reply: str = ""
    span: int = 1

    @property
    def codes(self) -> range:
        """Its opcodes."""
        return range(self.code, self.code + self.span)

    @property
    def size(self) -> int:
        """Bytes of the request up to a run of bytes, opcode included."""
        return 1 + self.layout.size

    def pack(self, *values: int | bytes) -> bytes:
        """Return the request as bytes. A short form takes the address as its first value."""
        if self.span == 1:
            return bytes((self.code,)) + self.layout.pack(*values)
        address = values[0]
        if not isinstance(address, int) or not 0 <= address < self.span:
            raise ValueError(f"address = {address!r}: allowed are 0 to {self.span - 1}")
        return bytes((self.code + address,)) + self.layout.pack(*values[1:])


def _layout(text: str) -> PayloadLayout:
    """Read ``"mask:u16 levels:u16"``."""
    parts = [part.split(":") for part in text.split()]
    return PayloadLayout(*(Field(name, kind) for name, kind in parts))


REPLIES: Final = {
    reply.tag: reply
    for reply in (
        Reply("V", _layout("hello:bytes16"), "agreed version and what is attached, in msgpack"),
        Reply("E", _layout("n:u8"), "the barrier's number"),
        Reply("C", _layout("held:u8"), "1: the bus is yours"),
        Reply("D", _layout("d:u8"), "a byte read, or a level"),
        Reply("L", _layout("d:u8 outputs:u32 instant:u64 until:u64"),
              "a byte read and the output lines, when that was, and before when neither changes"),
        Reply("M", _layout("d:u8 outputs:u32 instant:u64 until:u64 then:u8 end:u64"), "the same;"
              " from the instant until on the byte is then, up to the end; the lines stay"),
        Reply("B", _layout("data:bytes8"), "bytes read"),
        Reply("R", _layout("ready:u8 instant:u64"), "ready (1) or not (0), and when that was"),
        Reply("P", _layout("d:u8 outputs:u32"), "D0-D7 as they stand, and the output lines"),
        Reply("T", _layout("instant:u64"), "chip time"),
        Reply("S", _layout("outputs:u32 instant:u64"), "output lines; no edge before the instant"),
        Reply("W", _layout("outputs:u32 passed:u64"), "output lines; how much time has passed"),
        Reply("I", _layout("outputs:u32 instant:u64"), "event: output lines after an edge, when"),
        Reply("H", _layout("paused:u8"), "1: the board is paused; 0: it goes on"),
        Reply("X", _layout("code:u8 number:u16"), "refused: why, and which request"),
    )
}  # fmt: skip
"""The replies by tag."""

UNASKED: Final = "IH"
"""Tags of those that answer nothing: they may stand between any two replies."""

REQUESTS: Final = RowTable(
    Request("HELLO", 0x01, "agree on a version; tell what is attached", _layout("version:u8"), "V"),
    Request("ECHO", 0x02, "barrier: everything before it is done", _layout("n:u8"), "E"),
    Request("SELECT", 0x03, "the following cycles go to these chips; bit 0 is the first, which is"
            " selected at start", _layout("mask:u16")),
    Request("CLAIM", 0x04, "hold the selected chips' bus for a packet; waits its turn", reply="C"),
    Request("UNCLAIM", 0x05, "let the bus go; the end of the session does so too"),
    Request("READ4", 0x10, "one read cycle at address 0 to 15", reply="D", span=16),
    Request("WRITE4", 0x20, "one write cycle at address 0 to 15", _layout("d:u8"), span=16),
    Request("READ", 0x30, "one read cycle", _layout("a:u8"), "D"),
    Request("WRITE", 0x31, "one write cycle", _layout("a:u8 d:u8")),
    Request("READS", 0x32, "n read cycles at one address", _layout("a:u8 n:u8"), "B"),
    Request("WRITES", 0x33, "write cycles at one address", _layout("a:u8 data:bytes8")),
    Request("WAIT", 0x34, "let time pass until the chip can take the next cycle, at most this long",
            _layout("longest:u64"), "R"),
    Request("LINES", 0x40, "put the control lines of the mask to these levels, all at one instant",
            _layout("mask:u16 levels:u16")),
    Request("DRIVE", 0x41, "drive D0-D7", _layout("d:u8")),
    Request("RELEASE", 0x42, "let D0-D7 float"),
    Request("SAMPLE", 0x43, "look at D0-D7 and the output lines", reply="P"),
    Request("PIN", 0x44, "drive side pin p to 0 or 1; 2 lets it go", _layout("p:u8 level:u8")),
    Request("GETPIN", 0x45, "look at side pin p", _layout("p:u8"), "D"),
    Request("DELAY", 0x50, "let this much time pass for this host", _layout("duration:u64")),
    Request("AT", 0x51, "the host's own clock (slaved boards); never earlier than the AT before",
            _layout("instant:u64")),
    Request("NOW", 0x52, "tell chip time", reply="T"),
    Request("SYNC", 0x53, "bring the chips up to the host's time; tell output lines and the next"
            " possible edge", reply="S"),
    Request("POLLED", 0x54, "this host polled address a n times more, a cycle time apart, and knew"
            " the byte by a lease", _layout("a:u8 n:u16")),
    Request("POLLED_AT", 0x55, "as POLLED, on slaved boards: a poll at the first instant, one more"
            " each step (u32) later", _layout("a:u8 first:u64 steps:bytes8")),
    Request("PASS", 0x56, "let time pass until an edge of a line of EVENTS, at most this long",
            _layout("longest:u64"), "W"),
    Request("EVENTS", 0x60, "report each edge of these output lines from now on",
            _layout("mask:u32")),
    Request("LEASES", 0x61, "answer reads without side effects by 'L' where the board can tell;"
            " 2: or 'M'; 0: no more", _layout("on:u8")),
)  # fmt: skip
"""The requests."""

LEASED: Final = "L"
"""Tag of the reply that may stand in the place of ``'D'`` after LEASES 1 or 2."""

FORESEEN: Final = "M"
"""Tag of the one that may stand there after LEASES 2."""

FORESEEING: Final = "leases_ahead"
"""The feature that tells of LEASES 2."""


def features(promises: bool) -> list[str]:
    """Return what HELLO says a session can ask for; without ``promises`` no leases."""
    leases = ["leases", FORESEEING] if promises else []
    return ["claim", "events", *leases, "lines", "pass", "polled_at", "sync"]


REFUSALS: Final = {
    codes.UNKNOWN_REQUEST: ("UNKNOWN", "unknown request"),
    codes.NO_SUCH: ("NO_SUCH", "no such line, pin, chip or address"),
    codes.BAD_AT: (
        "BAD_AT",
        "AT before the last AT, on a board that is not slaved, or past the end of time",
    ),
    codes.BAD_LENGTH: ("BAD_LENGTH", "length 0 or over the limit"),
    codes.BAD_VERSION: ("BAD_VERSION", "version not spoken here"),
    codes.CLOSED: ("CLOSED", "closed by the board"),
    codes.NO_ROOM: ("NO_ROOM", "the board can take no more hosts"),
    codes.DEADLOCK: (
        "DEADLOCK",
        "SELECT of a chip claimed by a session that waits for what this one has claimed",
    ),
}
"""Reasons in the ``'X'`` reply: short name and sentence, by code."""

FATAL: Final = frozenset({codes.UNKNOWN_REQUEST, codes.BAD_LENGTH, codes.BAD_VERSION})
"""Reasons after which the parser cannot know where the next request starts."""
