"""Files of one kind whose content has a checksum: a mark, SHA-256 of the body, the body."""

import hashlib

from vbus.errors import SnapshotError
from vbus.file_kinds import HEAD, is_none


def seal(magic: bytes, body: bytes) -> bytes:
    """Return a body as the content of a file."""
    return magic + hashlib.sha256(body).digest() + body


def unseal(magic: bytes, data: bytes, name: str, kind: str) -> bytes:
    """Return the body in a file's content.

    Args:
        magic: what the file begins with.
        data: the bytes.
        name: what to call it in an error.
        kind: what it should be.

    Raises:
        SnapshotError: it is none, or was cut short or damaged.
    """
    if not data.startswith(magic):
        made = '"vbus snap save" takes one of a running board'
        raise SnapshotError(is_none(name, data[:HEAD], kind, made))
    start = len(magic) + 32
    body = data[start:]
    if hashlib.sha256(body).digest() != data[len(magic) : start]:
        raise SnapshotError(f"{name}: cut short or damaged: its checksum does not fit")
    return body
