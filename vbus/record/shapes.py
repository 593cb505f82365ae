"""What each entry of a journal may hold; a file that says anything else is refused."""

from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta

from vbus.core.kernel import END

_Count = Annotated[int, Meta(ge=0)]
_Byte = Annotated[int, Meta(ge=0, le=0xFF)]
_Address = Annotated[int, Meta(ge=0, le=0xFFFF)]
_Mask = Annotated[int, Meta(ge=0, le=0xFFFF_FFFF)]
_Instant = Annotated[int, Meta(ge=0, le=END)]
# -1 stands for a call that was finished.
_Limit = Annotated[int, Meta(ge=-1, le=END)]
_Number = Annotated[int, Meta(ge=0, le=1 << 32)]
# -1 is a wire that nothing drives.
_Level = Annotated[int, Meta(ge=-1, le=0xFF)]
# Read, write, or a pin.
_Kind = Annotated[int, Meta(ge=0, le=2)]
_Value = int | float | str | bool
_Nothing: Final = type(None)


def _call(asked: Any, reply: Any) -> Any:
    """Return what a call is: what was asked, and what was answered, None if it was refused."""
    return tuple[asked, reply | None, _Number, _Limit]


SHAPES: Final[dict[str, Any]] = {
    "read": _call(tuple[_Address], _Byte),
    "write": _call(tuple[_Address, _Byte], _Nothing),
    "open": _call(tuple[str, list[str], _Instant], _Nothing),
    "close": _call(tuple[()], _Nothing),
    "select": _call(tuple[_Mask], _Nothing),
    "claim": _call(tuple[()], bool),
    "unclaim": _call(tuple[()], _Nothing),
    "wait": _call(tuple[_Count], tuple[bool, _Instant]),
    "lines": _call(tuple[_Mask, int], _Nothing),
    "drive": _call(tuple[_Byte], _Nothing),
    "release": _call(tuple[()], _Nothing),
    "sample": _call(tuple[()], tuple[int, int]),
    "pin": _call(tuple[_Byte, _Byte], _Nothing),
    "getpin": _call(tuple[_Byte], int),
    "delay": _call(tuple[_Count], bool),
    "at": _call(tuple[_Count], _Nothing),
    "now": _call(tuple[()], int),
    "sync": _call(tuple[()], tuple[int, int]),
    "events": _call(tuple[_Mask], _Nothing),
    "edges": _call(tuple[()], list[tuple[int, int]]),
    "violation": tuple[_Instant, str, str, str, str, int, int, str],
    "end": tuple[_Number, str, str, _Number],
    "cycle": _call(tuple[str, bool, _Address, _Byte], _Nothing),
    "fault": tuple[_Instant, str, str, str, str],
    "arm": tuple[str, str, str, str, dict[str, _Value]],
    "clear": tuple[int | str],
    "jump": tuple[_Count, _Instant, _Instant],
    "arrive": tuple[list[tuple[_Instant, _Count, _Count, _Count, _Level, bool]]],
    "orders": tuple[str, bool],
    "order": tuple[str, _Instant, list[str], _Kind, _Address, _Byte, str],
    "made": tuple[_Instant, str, str, bool, _Address, _Byte],
}
"""What an entry's value is, by operation. Operations are numbered in this order, which is part of
the format."""


def checked(op: str, value: Any) -> Any:
    """Return an entry's value as it is meant: sequences as tuples.

    Raises:
        ValueError: it is no such value.
    """
    return msgspec.convert(value, SHAPES[op])
