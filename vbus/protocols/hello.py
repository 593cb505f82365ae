"""What a session and its host tell each other at the start: HELLO's msgpack."""

import msgspec

from vbus.protocols.port import PortInfo


def encode_hello(version: int, info: PortInfo) -> bytes:
    """Return HELLO's answer: a map of the agreed version and every field of ``info``."""
    return msgspec.msgpack.encode({"version": version, **msgspec.to_builtins(info)})


def decode_hello(data: bytes) -> tuple[int, PortInfo]:
    """Return the agreed version and the session's description.

    Fields this version does not know are skipped, so that a newer board can say more.

    Raises:
        ValueError: the bytes are no such map; says what is wrong.
    """
    try:
        fields: dict[str, object] = msgspec.msgpack.decode(data, type=dict[str, object])
        version = msgspec.convert(fields.pop("version", None), int)
        return version, msgspec.convert(fields, PortInfo)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"HELLO's answer cannot be read: {error}") from error
