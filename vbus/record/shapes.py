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

_CALLS: Final[dict[str, tuple[Any, Any]]] = {
    "read": (tuple[_Address], _Byte),
    "write": (tuple[_Address, _Byte], _Nothing),
    "open": (tuple[str, list[str], _Instant], _Nothing),
    "close": (tuple[()], _Nothing),
    "select": (tuple[_Mask], _Nothing),
    "claim": (tuple[()], bool),
    "unclaim": (tuple[()], _Nothing),
    "wait": (tuple[_Count], tuple[bool, _Instant]),
    "lines": (tuple[_Mask, int], _Nothing),
    "drive": (tuple[_Byte], _Nothing),
    "release": (tuple[()], _Nothing),
    "sample": (tuple[()], tuple[int, int]),
    "pin": (tuple[_Byte, _Byte], _Nothing),
    "getpin": (tuple[_Byte], int),
    "delay": (tuple[_Count], bool),
    "at": (tuple[_Count], _Nothing),
    "now": (tuple[()], int),
    "sync": (tuple[()], tuple[int, int]),
    "events": (tuple[_Mask], _Nothing),
    "edges": (tuple[()], list[tuple[int, int]]),
    "cycle": (tuple[str, bool, _Address, _Byte], _Nothing),
}  # fmt: skip
"""What a call was asked, and what it answered; None also stands for a call that was refused."""

SHAPES: Final[dict[str, Any]] = {
    **{
        op: tuple[asked, reply | None, _Number, _Limit]  # type: ignore[valid-type]
        for op, (asked, reply) in _CALLS.items()
    },
    "violation": tuple[_Instant, str, str, str, str, int, int, str],
    "end": tuple[_Number, str, str, _Number],
    "fault": tuple[_Instant, str, str, str, str],
    "arm": tuple[str, str, str, str, dict[str, _Value]],
    "clear": tuple[int | str],
    "arrive": tuple[list[tuple[_Instant, _Count, _Count, _Count, _Level, bool]]],
    "orders": tuple[str, bool],
    "order": tuple[str, _Instant, list[str], _Kind, _Address, _Byte, str],
    "made": tuple[_Instant, str, str, bool, _Address, _Byte],
    "jump": tuple[_Count, _Instant, _Instant],
}  # fmt: skip
"""What an entry's value is, by operation."""


def checked(op: str, value: Any) -> Any:
    """Return an entry's value as it is meant: sequences as tuples.

    Raises:
        ValueError: it is no such value.
    """
    return msgspec.convert(value, SHAPES[op])
