"""What goes with each message of a host: who it is, and which message this is.

The payload of a message holds requests of the byte protocol, as they would go over any other link,
and that of its reply what they gave. Beside it, as Zenoh's attachment, stands the envelope::

    version:u8  kind:u8  session:8 bytes  number:u64  acknowledged:u64        (big-endian)

``kind`` is 0 for requests and 1 for the end of the session. ``session`` is a random name the host
has chosen. Messages are numbered from 0; the board carries them out in order, each one once, keeps
the replies until they are acknowledged, and gives the stored reply to a message that is repeated.
``acknowledged`` says how many replies, from the first, the host has got.
"""

import os
import struct
from typing import Final, NamedTuple

VERSION: Final = 1
REQUESTS: Final = 0
END: Final = 1

LARGEST: Final = 1 << 16
"""Bytes of requests in one message."""
WINDOW: Final = 256
"""Messages of one host that may be under way."""

_LAYOUT: Final = struct.Struct(">BB8sQQ")

# Why a message was refused: the first word of the error reply; a sentence follows.
MALFORMED: Final = "malformed"
TOO_LARGE: Final = "too-large"
GONE: Final = "gone"
BROKEN: Final = "broken"


class Envelope(NamedTuple):
    """Who sends, and which message this is."""

    kind: int
    session: bytes
    number: int
    acknowledged: int

    def pack(self) -> bytes:
        """Return it as bytes."""
        return _LAYOUT.pack(VERSION, *self)


class EnvelopeError(ValueError):
    """Bytes that are no envelope; says why."""


def unpack(data: bytes) -> Envelope:
    """Return the envelope that ``data`` is.

    Raises:
        EnvelopeError: it is none.
    """
    if len(data) != _LAYOUT.size:
        raise EnvelopeError(
            f"the attachment has {len(data)} bytes, an envelope {_LAYOUT.size}: version, kind,"
            " session, number, acknowledged"
        )
    version, kind, session, number, acknowledged = _LAYOUT.unpack(data)
    if version != VERSION:
        raise EnvelopeError(f"the envelope is of version {version}; spoken here is {VERSION}")
    if kind not in (REQUESTS, END):
        raise EnvelopeError(f"kind {kind} is unknown; there are 0, requests, and 1, end")
    return Envelope(kind, session, number, acknowledged)


def new_session() -> bytes:
    """Return a name for a session that nobody else has."""
    return os.urandom(8)
