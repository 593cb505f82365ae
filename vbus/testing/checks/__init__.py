"""What the conformance kit asks of a plug-in's part, and how it says what the part does wrong."""

import msgpack

from vbus.core.state import load, save


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


def hand_over(name: str, part: object, other: object, when: str = "") -> None:
    """Load what a snapshot has of a part into another one of its kind: that is in its state then.

    Args:
        name: what the part is called.
        part: has the state.
        other: gets it.
        when: ends the sentence that says when it was saved.
    """
    state = packed(name, save(part))
    load(other, msgpack.unpackb(state, use_list=False, strict_map_key=False))
    demand(
        packed(name, save(other)) == state, f"{name}: the state loaded{when} is not the one saved"
    )
