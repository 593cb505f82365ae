"""Frames for lines that lose bytes: length, CRC-16, and a number that tells repeats from news.

A frame is ``A5``, a sequence byte, a length n (u8), n bytes, and the CRC (big-endian, polynomial
1021H, start value FFFFH) of everything between the ``A5`` and itself.
"""

from binascii import crc_hqx
from typing import ClassVar, Final

from vbus.core.state import Names

MARK: Final = 0xA5
LONGEST: Final = 255
"""Most bytes a frame carries."""
EVENT: Final = 0x80
"""Set in the sequence byte of frames the board sends unasked."""
OVERHEAD: Final = 5
"""Bytes of a frame that carry nothing."""


def frame(sequence: int, payload: bytes) -> bytes:
    """Return ``payload`` (0 to 255 bytes) as a frame.

    Raises:
        ValueError: the payload is longer than a frame can carry.
    """
    if len(payload) > LONGEST:
        raise ValueError(f"{len(payload)} bytes; a frame carries at most {LONGEST}")
    body = bytes((sequence & 0xFF, len(payload))) + payload
    return bytes((MARK,)) + body + crc_hqx(body, 0xFFFF).to_bytes(2, "big")


def frames(sequence: int, payload: bytes) -> bytes:
    """Return ``payload`` of any length as one or more frames of the same sequence byte."""
    pieces = range(0, max(len(payload), 1), LONGEST)
    return b"".join(frame(sequence, payload[start : start + LONGEST]) for start in pieces)


class FrameReader:
    """Finds frames in a stream of bytes that may hold garbage.

    Bytes before a mark are skipped. A frame whose CRC is wrong is given up by its mark only: the
    search goes on at the next byte, so a good frame behind a false mark is found. At most one
    frame's worth of bytes is waited for, whatever a false length says.
    """

    STATE: ClassVar[Names] = ("_bytes: bytearray[...]",)

    def __init__(self) -> None:
        self._bytes: bytearray = bytearray()

    def __len__(self) -> int:
        """How many bytes wait."""
        return len(self._bytes)

    def feed(self, data: bytes) -> None:
        """Take bytes as they came."""
        self._bytes += data

    def clear(self) -> None:
        """Forget half a frame."""
        self._bytes.clear()

    def next(self) -> tuple[int, bytes] | None:
        """Return the next good frame as ``(sequence, payload)``, or None until more bytes come."""
        data = self._bytes
        start = 0
        found: tuple[int, bytes] | None = None
        while found is None:
            start = data.find(MARK, start)
            if start < 0:
                start = len(data)
                break
            if len(data) - start < 3:
                break
            end = start + OVERHEAD + data[start + 2]
            if len(data) < end:
                break
            body = bytes(data[start + 1 : end - 2])
            if crc_hqx(body, 0xFFFF) == data[end - 2] << 8 | data[end - 1]:
                found = (body[0], body[2:])
                start = end
            else:
                start += 1
        del data[:start]
        return found
