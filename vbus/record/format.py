"""The journal's file: a line that names it, then blocks that each stand for themselves.

A block is a length and a CRC-32 (four bytes each, big endian), then a zlib stream of one msgpack
value. The first block is the header. Every other holds the number of its first entry, words, and
the entries that are not in the words.

The words are of 16 bits, big endian. Below 8000h a word is a bus cycle: 512 times the address,
plus 256 for a write, plus the byte. It is of the same session as the cycle before, starts where the
entry before ended, and takes as long as the cycle before. 8000h plus a number is that cycle again,
so many times more. C000h is the next of the other entries, each of which is four values in a row:
key (32 times the session's number, plus the operation), value, start counted from the end of the
entry before, and what it took, both in ps. The first cycle of a block is among them. C001h plus a
number is one of the other entries that have been, counted from 0, once more; it is no bus cycle.

A jump is a block with one entry, and is none of those that are counted: the board went back. Of the
entries before it the first so many stay, and what follows begins there: its first number is theirs,
its first instant counts from the instant gone to. What was undone stays in the file; what is read
is the course that holds.
"""

import re
import zlib
from collections.abc import Callable, Iterator
from struct import error as StructError
from typing import Any, BinaryIO, Final

import msgpack
import msgspec
from msgspec import Struct, field

from vbus.core.errors import VbusError
from vbus.core.file_kinds import HEAD, is_none
from vbus.core.kernel import END, NEVER
from vbus.record.rows import FULL, PORTS, READ, WRITE, rows_of
from vbus.record.shapes import SHAPES, checked

FORMAT: Final = 1
MAGIC: Final = b"vbus journal 1\n"
# Far above any block of 4,096 entries that a recorder makes.
LARGEST: Final = 1 << 26
"""Bytes beyond which a block's length, packed or unpacked, is taken for damage."""

OPERATIONS: Final = tuple(SHAPES)
"""Operations by number. All up to ``edges`` are calls of a host;
``cycle`` is a bus cycle that its strobes made: chips, write, address, byte; ``fault`` is evidence:
instant, name, target, what, text; ``arm`` and ``clear`` are faults armed and cleared by hand.
Of nodes, ``arrive`` is edges of other nodes: instant sent, node, number, wire, level, weak;
``orders`` a source of orders: name, whether it is part of the state; ``order`` what: name,
instant, chips, kind, address, data, pin; ``made`` is the bus cycle that came of it: instant, name,
chips, write, address, byte. ``jump`` is a :class:`Jump`; only versions that know it
read a journal that has one."""
OUTSIDE: Final = ("arrive", "orders", "order")
"""What reaches a node beside its hosts' calls."""
NOT_YET: Final = 1 << 16
"""Stands for a refusal where a call at a node could not be made before time had run on."""
CODE: Final = {name: number for number, name in enumerate(OPERATIONS)}
JUMP: Final = CODE["jump"]
# Three numbers of at most nine bytes each, packed, with their head.
JUMP_BYTES: Final = 256
"""A jump's block is no longer, packed: longer ones need not be unpacked to find it."""


class JournalError(VbusError):
    """A file that is no journal, or is damaged elsewhere than at its end."""


class Header(Struct, frozen=True):
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
        settings: settings of chips that decide how their bus is read, by name of chip.
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
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)


class Entry(Struct, frozen=True):
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


class Jump(Struct, frozen=True):
    """The board went back to an earlier instant.

    Attributes:
        kept: entries before it that stay.
        to: the instant it went to (ps).
        left: the instant it went from (ps).
        undone: entries it has undone.
        begin: where its block begins in the file.
        end: where it ends.
    """

    kept: int
    to: int
    left: int
    undone: int
    begin: int
    end: int


def block(value: object) -> bytes:
    """Return ``value`` as one block."""
    body = zlib.compress(msgpack.packb(value), 1)
    return len(body).to_bytes(4, "big") + zlib.crc32(body).to_bytes(4, "big") + body


def header_block(header: Header) -> bytes:
    """Return the beginning of a journal."""
    return MAGIC + block(msgspec.structs.asdict(header))


def rows_block(first: int, words: bytes, others: list[Any]) -> bytes:
    """Return the block of some entries.

    Args:
        first: number of the first.
        words: what :meth:`~vbus.record.rows.JournalRows.take` gives.
        others: what it gives with them.
    """
    return block((first, words, others))


class JournalReader:
    """Reads a journal from its beginning, a block at a time: the course that holds after its jumps.

    Args:
        file: the journal; one that has jumps must be a file that can be read twice.

    Raises:
        JournalError: the file is no journal of a version known here.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file: BinaryIO = file
        self.damage: str = ""
        """What is wrong with the end of the file, once it has been reached; or ""."""
        self.position: int = len(MAGIC)
        """Bytes read so far."""
        self.moved: Callable[[], None] = lambda: None
        """Called after every block."""
        self.jumps: tuple[Jump, ...] = ()
        """The jumps of the file in their order, once anything has been read."""
        magic = file.read(len(MAGIC))
        if magic != MAGIC:
            head = magic + file.read(HEAD - len(magic))
            version = re.match(rb"vbus journal (\d+)\n", head)
            if version is not None:
                raise JournalError(
                    f"{self._name()} is a journal of version {version[1].decode()}, and this vbus"
                    f" reads version {FORMAT}: use the vbus that wrote it, or record the run again"
                )
            wanted = f"journal of version {FORMAT}"
            made = '"vbus run BOARD --journal FILE" writes one'
            raise JournalError(is_none(self._name(), head, wanted, made))
        values = self._block()
        if values is None:
            why = self.damage or "it is empty"
            raise JournalError(f"{self._name()} has no header: {why}; record the run again")
        try:
            # Also for keys that are not known here, which convert() passes over.
            Header(**values)
            self.header: Header = msgspec.convert(values, Header)
        except (TypeError, msgspec.ValidationError):
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
        # The length is checked before it is believed: damage must not ask for gigabytes.
        size = int.from_bytes(head[:4], "big")
        body = self._file.read(size) if len(head) == 8 and size <= LARGEST else b""
        if len(head) < 8 or len(body) < size:
            self.damage = f"cut in the block at byte {self.position}"
            return None
        if zlib.crc32(body) != int.from_bytes(head[4:], "big"):
            raise JournalError(
                f"{self._name()}: the block at byte {self.position} is damaged; record"
                f' the run again, or see with "vbus explain" what is before it'
            )
        try:
            unpacking = zlib.decompressobj()
            # Bounded: a few bytes of zlib can stand for gigabytes.
            content = unpacking.decompress(body, LARGEST)
            if unpacking.unconsumed_tail:
                raise ValueError(f"it holds more than {LARGEST} bytes")
            value = msgpack.unpackb(content)
        except (zlib.error, ValueError, TypeError, RecursionError) as error:
            raise JournalError(
                f"{self._name()}: the block at byte {self.position} makes no sense: {error}"
            ) from None
        self.position += 8 + size
        self.moved()
        return value

    def __iter__(self) -> Iterator[Entry]:
        """Give every entry that can be read.

        Raises:
            JournalError: a block is damaged, or entries are missing between two blocks.
        """
        for number, when, span, key, value, times in self.stretches():
            for turn in range(times):
                yield self.entry(number + turn, when + turn * span, span, key, value)

    def stretches(self) -> Iterator[tuple[int, int, int, int, Any, int]]:
        """Give the same as it is written, for those who go through millions of entries.

        Of each stretch of equal entries that follow each other: number and start of the first,
        what each takes (ps), key, value, and how many they are. :meth:`entry` makes entries of
        that; a value that is a number is a bus cycle, 256 times its address plus its byte.

        Raises:
            JournalError: a block is damaged, or entries are missing between two blocks.
        """
        # Jumps first: what a later one undoes is given to no reader.
        self.jumps = tuple(self._find_jumps())
        number = last = 0
        for turn, jump in enumerate(self.jumps):
            # A later jump may go back beyond this one, and undo what this one kept.
            kept = min(later.kept for later in self.jumps[turn:])
            yield from self._stretches(number, last, kept, jump.begin)
            self._file.seek(jump.end)
            self.position, number, last = jump.end, jump.kept, jump.to
        yield from self._stretches(number, last, NEVER, -1)

    def _stretches(
        self, number: int, last: int, kept: int, until: int
    ) -> Iterator[tuple[int, int, int, int, Any, int]]:
        """Give the entries between two jumps that no later one undoes.

        Args:
            number: of the first.
            last: the instant it counts from (ps).
            kept: entries of the course that stay.
            until: where the next jump is in the file.
        """
        while number < kept and self.position != until and (block := self._block()) is not None:
            begun = number
            try:
                first, *columns = block
                if first != number:
                    raise JournalError(
                        f"{self._name()}: entries {number} to {first - 1} are missing"
                    )
                for key, value, start, span, times in rows_of(*columns):
                    when = last + start
                    last = when + times * span
                    if not (isinstance(last, int) and 0 <= when <= last <= END):
                        raise ValueError(f"from {when} to {last} ps; time ends at {END} ps")
                    if key % PORTS >= len(OPERATIONS):
                        raise JournalError(
                            f"{self._name()}: entry {number} is of a kind this vbus does not know;"
                            f" vbus {self.header.vbus} wrote it"
                        )
                    if key % PORTS == JUMP:
                        raise ValueError("a jump, which can be read from a file alone")
                    # No writer makes more: a damaged count is not followed for hours.
                    if number + times - begun > FULL:
                        number = begun + FULL + 1
                        raise ValueError(f"more than {FULL} entries in one block")
                    if number + times >= kept:
                        yield number, when, span, key, value, kept - number
                        return
                    yield number, when, span, key, value, times
                    number += times
            except (TypeError, ValueError, StructError) as error:
                raise self._wrong(number, error) from None

    def _find_jumps(self) -> Iterator[Jump]:
        """Give the jumps of the file, and come back to where it stands."""
        if not self._file.seekable():
            return
        begun = self._file.tell()
        place = begun
        while len(head := self._file.read(8)) == 8:
            size = int.from_bytes(head[:4], "big")
            begin, place = place, place + 8 + size
            # Other blocks are stepped over unread: a journal of gigabytes is searched in a moment.
            body = self._file.read(size) if size <= JUMP_BYTES else b""
            if zlib.crc32(body) == int.from_bytes(head[4:], "big"):
                jump = self._jump(body, begin, place)
                if jump is not None:
                    yield jump
            self._file.seek(place)
        self._file.seek(begun)

    def _jump(self, body: bytes, begin: int, end: int) -> Jump | None:
        """Return the jump a block is, if it is one."""
        try:
            first, _, (key, value, _, _) = msgpack.unpackb(
                zlib.decompressobj().decompress(body, 4096)
            )
            if key != JUMP:
                return None
            kept, to, left = checked("jump", value)
        except (zlib.error, ValueError, TypeError, RecursionError):
            return None  # the reader of that block says what is wrong with it
        return Jump(kept, to, left, first - kept, begin, end) if kept <= first else None

    def entry(self, number: int, when: int, span: int, key: int, value: Any) -> Entry:
        """Return an entry as :meth:`stretches` gives it.

        Raises:
            JournalError: it makes no sense.
        """
        try:
            return _entry(number, when, when + span, key, value)
        except (TypeError, ValueError) as error:
            raise self._wrong(number, error) from None

    def _wrong(self, number: int, error: Exception) -> JournalError:
        return JournalError(f"{self._name()}: entry {number}: {error}")


def _entry(number: int, when: int, after: int, key: int, value: Any) -> Entry:
    port, code = divmod(key, PORTS)
    op = OPERATIONS[code]
    # Cycles as the words have them; a read that was refused has the long form below.
    if code == READ and isinstance(value, int):
        return Entry(number, when, after, port, op, (value >> 8,), value & 0xFF)
    if code == WRITE and isinstance(value, int):
        return Entry(number, when, after, port, op, (value >> 8, value & 0xFF))
    value = checked(op, value)
    if code == READ and value[1] is None and not value[2]:
        raise ValueError("a read that has neither data nor a refusal")
    if op in ("violation", "end", "fault", "arm", "clear", "made", *OUTSIDE):
        return Entry(number, when, after, -1, op, value)
    return Entry(number, when, after, port, op, *value)
