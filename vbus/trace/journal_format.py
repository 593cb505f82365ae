"""The journal's file: a line that names it, then blocks that each stand for themselves.

A block is a length and a CRC-32 (four bytes each, big endian), then a zlib stream of one msgpack
value. The first block is the header. Every other holds the number of its first entry and four
columns: keys (32 times the port's number, plus the operation), values, instants before the call
counted from the end of the entry before, and what the call took, both in ps.
"""

import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any, BinaryIO, Final

import msgpack

from vbus.errors import VbusError

MAGIC: Final = b"vbus journal 1\n"
FORMAT: Final = 1
LARGEST: Final = 1 << 26
"""Bytes beyond which a block's length is taken for damage."""

OPERATIONS: Final = (
    "read", "write", "open", "close", "select", "claim", "unclaim", "wait", "lines", "drive",
    "release", "sample", "pin", "getpin", "delay", "at", "now", "sync", "events", "edges",
    "violation", "end", "cycle", "fault", "arm", "clear",
)  # fmt: skip
"""Operations by number. Their order is part of the format. All up to ``edges`` are calls of a host;
``cycle`` is a bus cycle that its strobes made: chips, write, address, byte; ``fault`` is evidence:
instant, name, target, what, text; ``arm`` and ``clear`` are faults armed and cleared by hand."""
READ: Final = 0
WRITE: Final = 1
CODE: Final = {name: number for number, name in enumerate(OPERATIONS)}
PORTS: Final = 32
"""Keys per port."""


class JournalError(VbusError):
    """A file that is no journal, or is damaged elsewhere than at its end."""


@dataclass(frozen=True, slots=True)
class Header:
    """What a journal says of the run it holds.

    Attributes:
        board: name of the board.
        file: name of the board file.
        text: the board file itself; empty for a board made in Python.
        digest: SHA-256 (hex) of the text.
        seed: the board's seed.
        policy: who was master of time.
        families: chip families by name of chip.
        vbus: version that wrote it.
        python: version that wrote it.
        format: version of the format.
    """

    board: str
    file: str
    text: str
    digest: str
    seed: int
    policy: str
    families: dict[str, str] = field(default_factory=dict)
    vbus: str = ""
    python: str = ""
    format: int = FORMAT


@dataclass(frozen=True, slots=True)
class Entry:
    """One call of a host on its port, or a finding.

    Attributes:
        number: place in the journal, from 0.
        when: instant at which the call was made (ps).
        after: instant at which it returned: of a bus cycle, its latching edge.
        port: number of the session, in the order of opening; -1 for findings.
        op: one of :data:`OPERATIONS`.
        args: what was asked.
        reply: what was answered; None if nothing, or if the call was not finished.
        error: number of the refusal, or 0.
        limit: of a call that was not finished: how far time was allowed to go (ps); else -1.
    """

    number: int
    when: int
    after: int
    port: int
    op: str
    args: tuple[Any, ...]
    reply: Any = None
    error: int = 0
    limit: int = -1


def block(value: object) -> bytes:
    """Return ``value`` as one block."""
    body = zlib.compress(msgpack.packb(value), 1)
    return len(body).to_bytes(4, "big") + zlib.crc32(body).to_bytes(4, "big") + body


def header_block(header: Header) -> bytes:
    """Return the beginning of a journal."""
    return MAGIC + block(asdict(header))


def rows_block(first: int, rows: list[Any], before: int) -> bytes:
    """Return the block of some entries.

    Args:
        first: number of the first.
        rows: instant, key, value, instant afterwards, and so on.
        before: instant afterwards of the entry before the first.
    """
    whens, afters = rows[0::4], rows[3::4]
    starts = [when - last for when, last in zip(whens, [before, *afters], strict=False)]
    took = [after - when for after, when in zip(afters, whens, strict=True)]
    return block((first, rows[1::4], rows[2::4], starts, took))


class JournalReader:
    """Reads a journal from its beginning, a block at a time.

    Args:
        file: the journal.

    Raises:
        JournalError: the file is no journal of a version known here.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file: BinaryIO = file
        self.damage: str = ""
        """What is wrong with the end of the file, once it has been reached; or ""."""
        self.position: int = len(MAGIC)
        """Bytes read so far."""
        if file.read(len(MAGIC)) != MAGIC:
            raise JournalError(f"{self._name()} is no journal of version {FORMAT}")
        values = self._block()
        if values is None:
            raise JournalError(f"{self._name()} has no header: {self.damage or 'it is empty'}")
        try:
            self.header: Header = Header(**values)
        except TypeError:
            raise JournalError(f"{self._name()} has the header of another version") from None
        if self.header.format != FORMAT:
            raise JournalError(
                f"{self._name()} is of format {self.header.format}, written by vbus"
                f" {self.header.vbus}; this vbus reads format {FORMAT}"
            )

    def _name(self) -> str:
        return str(getattr(self._file, "name", "this"))

    def _block(self) -> Any:
        """Return the next block's value, or None at the end."""
        head = self._file.read(8)
        if not head:
            return None
        size = int.from_bytes(head[:4], "big")
        body = self._file.read(size) if len(head) == 8 and size <= LARGEST else b""
        if len(head) < 8 or len(body) < size:
            self.damage = f"cut in the block at byte {self.position}"
            return None
        if zlib.crc32(body) != int.from_bytes(head[4:], "big"):
            raise JournalError(f"{self._name()}: the block at byte {self.position} is damaged")
        self.position += 8 + size
        return msgpack.unpackb(zlib.decompress(body), strict_map_key=False)

    def __iter__(self) -> Iterator[Entry]:
        """Give every entry that can be read.

        Raises:
            JournalError: a block is damaged, or entries are missing between two blocks.
        """
        number = 0
        last = 0
        while (rows := self._block()) is not None:
            first, keys, values, starts, took = rows
            if first != number:
                raise JournalError(f"{self._name()}: entries {number} to {first - 1} are missing")
            for key, value, start, span in zip(keys, values, starts, took, strict=True):
                when = last + start
                last = when + span
                if key % PORTS >= len(OPERATIONS):
                    raise JournalError(
                        f"{self._name()}: entry {number} is of a kind this vbus does not know;"
                        f" vbus {self.header.vbus} wrote it"
                    )
                yield _entry(number, when, last, key, value)
                number += 1


def _entry(number: int, when: int, after: int, key: int, value: Any) -> Entry:
    port, code = divmod(key, PORTS)
    op = OPERATIONS[code]
    if code == READ and isinstance(value, int):
        return Entry(number, when, after, port, op, (value >> 8,), value & 0xFF)
    if code == WRITE and isinstance(value, int):
        return Entry(number, when, after, port, op, (value >> 8, value & 0xFF))
    if op in ("violation", "end", "fault", "arm", "clear"):
        return Entry(number, when, after, -1, op, tuple(value))
    args, reply, error, limit = value
    reply = tuple(reply) if op in ("wait", "sample", "sync") and reply is not None else reply
    if op == "edges":
        reply = [tuple(edge) for edge in reply]
    return Entry(number, when, after, port, op, tuple(args), reply, error, limit)
