"""Rows of lanes as bytes: what goes to a page, over its socket or in its file; and read again.

A frame is a head, ``kind, columns, lane, rows, first tick``, and its columns, each ``type, bytes``
and as many bytes, filled up with zeros to a multiple of eight. All of it is little-endian.
"""

import json
import struct
from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, Final

from msgspec import Struct

SAMPLES: Final = 1
PACKETS: Final = 2
LABELS: Final = 3
MARKS: Final = 4
NOW: Final = 5
CHIPS: Final = 6
WORDS: Final = 7
CLAUSES: Final = 8

LASTING: Final = (LABELS, CHIPS, WORDS, CLAUSES)
"""Kinds that what comes later counts on."""

ALL: Final = 0xFFFF
"""The lane of a frame that is about none of them."""

DOUBLES: Final = 0
INTEGERS: Final = 1
DIFFERENCES: Final = 2
BYTES: Final = 3
TEXT: Final = 4

HEAD: Final = struct.Struct("<BBHIQ")
_COLUMN: Final = struct.Struct("<B3xI")
_EXACT: Final = 1 << 53
"""Integers below this are the same as doubles."""

Column = tuple[int, bytes]


class _Varints(dict[int, bytes]):
    """Zig-zag LEB128 by number; the same differences come again and again."""

    def __missing__(self, number: int) -> bytes:
        # Zig-zag: small numbers of either sign become small ones, of one byte below 64.
        left = number << 1 if number >= 0 else ~(number << 1)
        made = bytearray()
        while left > 0x7F:
            made.append(left & 0x7F | 0x80)
            left >>= 7
        made.append(left)
        self[number] = found = bytes(made)
        return found


def differences(values: Sequence[int]) -> Column:
    """Return integers as their differences, the first against 0: small in a file."""
    known = _Varints()
    before = [0, *values]
    return DIFFERENCES, b"".join(
        [known[after - was] for was, after in zip(before, values, strict=False)]
    )


def numbers(values: Sequence[float]) -> Column:
    """Return numbers as they are: nothing to work out for a live page."""
    count = len(values)
    with suppress(struct.error):  # not a whole number; beyond 32 bits
        return INTEGERS, struct.pack(f"={count}i", *values)
    return DOUBLES, struct.pack(f"={count}d", *values)


def small(values: Sequence[float]) -> Column:
    """Return numbers for a file: integers as differences, others as they are."""
    # bool is an int, too: a level that is True would be read back as 1 of another type.
    if all(type(value) is int and -_EXACT < value < _EXACT for value in values):
        return differences(values)  # type: ignore[arg-type]
    return numbers(values)


def kinds(values: Sequence[int]) -> Column:
    """Return numbers from 0 to 255."""
    return BYTES, bytes(values)


def texts(values: Sequence[Any]) -> Column:
    """Return strings, or what else JSON has."""
    return TEXT, json.dumps(values, ensure_ascii=False, separators=(",", ":")).encode()


def frame(kind: int, lane: int, rows: int, first: int, *columns: Column) -> bytes:
    """Return a frame.

    Args:
        kind: :data:`SAMPLES`, ...
        lane: number of the lane.
        rows: how many entries each column has.
        first: tick from which the ticks of its rows are counted.
        columns: what the functions of this module made.
    """
    parts = [HEAD.pack(kind, len(columns), lane, rows, first)]
    for type_, payload in columns:
        # Filled to eight bytes, so that a page can lay a Float64Array over it.
        parts += [_COLUMN.pack(type_, len(payload)), payload, bytes(-len(payload) % 8)]
    return b"".join(parts)


class Frame(Struct, frozen=True):
    """A frame that was read.

    Attributes:
        kind: :data:`SAMPLES`, ...
        lane: number of the lane.
        first: tick from which the ticks of its rows are counted.
        columns: as many values in each as it has rows.
    """

    kind: int
    lane: int
    first: int
    columns: list[list[Any]]


def read(data: bytes) -> Iterator[Frame]:
    """Give the frames that stand one after the other."""
    place = 0
    while place < len(data):
        kind, count, lane, _, first = HEAD.unpack_from(data, place)
        place += HEAD.size
        columns, place = columns_at(data, place, count)
        yield Frame(kind, lane, first, [values_of(*column) for column in columns])


def columns_at(data: bytes, place: int, count: int) -> tuple[list[Column], int]:
    """Return the columns of a frame whose head ends at ``place``, and where they end."""
    columns = []
    for _ in range(count):
        type_, size = _COLUMN.unpack_from(data, place)
        place += _COLUMN.size
        columns.append((type_, data[place : place + size]))
        place += size + -size % 8
    return columns, place


def values_of(type_: int, payload: bytes) -> list[Any]:
    """Return what a column holds."""
    if type_ == DIFFERENCES:
        return _summed(payload)
    if type_ == TEXT:
        values: list[Any] = json.loads(payload)
        return values
    if type_ == BYTES:
        return list(payload)
    return array("i" if type_ == INTEGERS else "d", payload).tolist()


def _summed(payload: bytes) -> list[int]:
    values = []
    value = number = place = 0
    for byte in payload:
        number |= (byte & 0x7F) << place
        place += 7
        if byte < 0x80:
            # Undoes the zig-zag, then the difference.
            value += number >> 1 ^ -(number & 1)
            values.append(value)
            number = place = 0
    return values
