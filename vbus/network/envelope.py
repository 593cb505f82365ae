"""What goes with each message of a host: who it is, and which message this is.

The payload of a message holds requests of the byte protocol, as they would go over any other link,
and that of its reply what they gave. Beside it, as Zenoh's attachment, stands the envelope::

    version:u8  kind:u8  session:16 bytes  number:u64  acknowledged:u64       (big-endian)

``kind`` is 0 for requests, 1 for the end of the session, and 2 for the wish to hear events: that
query stays open, and each of its replies is events, with their number, from 0, attached (u64). Its
own ``number`` is how many of those were lost so far. ``session`` is a secret the host has chosen at
random. It stands only in queries, which Zenoh gives to the board alone. Keys and messages show its
public name (:func:`public`), from which it cannot be computed. So another host with
the same right can neither send into a session nor end it, and hears none of its answers.

Messages are numbered from 0; the board carries them out in order, each one once, keeps the replies
until they are acknowledged, and gives the stored reply to a message that is repeated.
``acknowledged`` says how many replies, from the first, the host has got.

The first message of a session, and every one that is repeated, is a query. A board without
certificates, whose reply to it has the attachment :data:`POSTS`, takes the others as samples too,
at a key of that session, which costs less and can be heard by all; their replies are samples as
well, with the attachment::

    number:u64  code:ASCII        (code: empty, or why the message was refused)
"""

import os
import struct
from hashlib import sha256
from typing import Final, NamedTuple

VERSION: Final = 1
REQUESTS: Final = 0
END: Final = 1
EVENTS: Final = 2

LARGEST: Final = 1 << 16
"""Bytes of requests in one message: a bound of memory."""
WINDOW: Final = 256
"""Messages of one host that may be under way; not measured."""

_LAYOUT: Final = struct.Struct(">BB16sQQ")

POSTS: Final = b"posts"
"""Goes with replies of a board that takes messages as samples, too."""
_NUMBER: Final = struct.Struct(">Q")

# Why a message was refused: the first word of the error reply; a sentence follows.
MALFORMED: Final = "malformed"
TOO_LARGE: Final = "too-large"
GONE: Final = "gone"
BROKEN: Final = "broken"
EARLY: Final = "early"
"""The end of a session has overtaken messages: repeat those, then the end."""


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
    if kind not in (REQUESTS, END, EVENTS):
        raise EnvelopeError(f"kind {kind} is unknown; there are 0, requests, 1, end, and 2, events")
    return Envelope(kind, session, number, acknowledged)


def reply_to(number: int, code: str = "") -> bytes:
    """Return what goes with the reply to a message that was posted."""
    return _NUMBER.pack(number) + code.encode()


def replied_to(attachment: bytes) -> tuple[int, str]:
    """Return which message a posted reply belongs to, and why it was refused, if it was.

    Raises:
        EnvelopeError: this does not go with a reply.
    """
    if len(attachment) < _NUMBER.size:
        raise EnvelopeError(f"the attachment has {len(attachment)} bytes; a number has 8")
    (number,) = _NUMBER.unpack_from(attachment)
    return number, attachment[_NUMBER.size :].decode("ascii", "replace")


def new_session() -> bytes:
    """Return the secret of a new session."""
    return os.urandom(16)


def public(session: bytes) -> str:
    """Return the name of a session that everybody may know."""
    return sha256(session).hexdigest()[:32]
