"""How the conformance kit says what a part does wrong."""

import msgpack


class Nonconformance(AssertionError):
    """A chip, plant, protocol or transport breaks the contract of its base class."""


def demand(holds: bool, sentence: str) -> None:
    """Raise :class:`Nonconformance` with ``sentence`` unless it ``holds``."""
    if not holds:
        raise Nonconformance(sentence)


def packed(part: str, state: object) -> bytes:
    """Return a saved state as bytes.

    Raises:
        Nonconformance: it cannot be written to a snapshot.
    """
    try:
        data: bytes = msgpack.packb(state)
    except (TypeError, ValueError, OverflowError) as error:
        raise Nonconformance(
            f"{part}: its state has what a snapshot cannot hold ({error}); the kinds a field of"
            " STATE can have are those of vbus.core.state"
        ) from error
    return data


def unpacked(data: bytes) -> object:
    """Return a state as it comes back from a snapshot."""
    state: object = msgpack.unpackb(data, use_list=False, strict_map_key=False)
    return state
