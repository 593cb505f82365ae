"""HELLO: what it tells of a session, and its msgpack. Interpreted: msgspec reads annotations."""

import msgspec
from msgspec import Struct, field


class ChipInfo(Struct):
    """What HELLO tells of one chip.

    Attributes:
        name: name on the board.
        part: part number.
        family: name of the chip family, e.g. ``"lm628"``.
        address_bits: width of an address.
        cycle_ps: what a whole bus cycle costs this host (ps).
    """

    name: str
    part: str
    family: str
    address_bits: int
    cycle_ps: int


class PortInfo(Struct):
    """What HELLO tells of a session.

    Attributes:
        board: name of the board.
        policy: ``"realtime"``, ``"lockstep"`` or ``"slaved"``.
        rate: chip seconds per wall second (real time only; 0 otherwise).
        chips: in the order of SELECT's bits.
        lines: control lines by number, ``"chip.pin"``; bit n of LINES is ``lines[n]``.
        outputs: output lines by number; bit n of the ``s`` word of SAMPLE is ``outputs[n]``.
        pins: side pins by number, for PIN and GETPIN.
        features: optional requests this board understands.
        wiring: which port bits of a microcontroller reach which pins
            (docs/board-file/pinmaps.md), or "".
        card: which card address reaches which address of which chip, or "".
        program: how ``vbus exec`` attaches a program to the card, or "".
    """

    board: str
    policy: str
    rate: float
    chips: list[ChipInfo] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    pins: list[str] = field(default_factory=list)
    features: list[str] = field(default_factory=list)
    wiring: str = ""
    card: str = ""
    program: str = ""


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
