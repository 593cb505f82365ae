"""Durations and instants as people type and read them."""

import re
from collections.abc import Mapping
from typing import Final

from vbus.core.instants import END, MS, NS, SECOND, US

_UNITS: Final = {"ps": 1, "ns": NS, "us": US, "ms": MS, "s": SECOND}
WALL_UNITS: Final = {**_UNITS, "m": 60 * SECOND, "min": 60 * SECOND, "h": 3600 * SECOND}
"""What one of each unit is of a time of the wall clock, in which people wait for minutes (ps)."""
_DURATION: Final = re.compile(r"(\d{1,18})(?:\.(\d{1,12}))?\s*(ps|ns|us|ms|s|m|min|h)")


def parse_duration(text: str, units: Mapping[str, int] = _UNITS) -> int:
    """Return the picoseconds of ``"100us"``, ``"1.5 ms"`` and the like, exactly.

    Args:
        text: the number and its unit.
        units: what may be written, and its picoseconds.

    Raises:
        ValueError: no duration, finer than a picosecond, or longer than time can hold.
    """
    match = _DURATION.fullmatch(text)
    if match is None or match[3] not in units:
        *names, last = units
        allowed = f"{', '.join(names)} or {last}"
        raise ValueError(f"{text!r} is no duration; write a number with {allowed}")
    digits: str = match[2] or ""
    scaled = int(match[1] + digits) * units[match[3]]
    scale: int = 10 ** len(digits)
    duration, rest = divmod(scaled, scale)
    if rest:
        raise ValueError(f"{text!r} is finer than a picosecond; that is as fine as time gets")
    if duration > END:
        raise ValueError(f"{text!r} is too long; at most {END // SECOND} s are possible")
    return duration


def picoseconds(quantity: int | str) -> int:
    """Return a duration or an instant that is given in picoseconds, or with its unit.

    Raises:
        TypeError: it is neither; a float says no unit, and would not be exact.
        ValueError: the text is no duration.
    """
    if isinstance(quantity, str):
        return parse_duration(quantity)
    if isinstance(quantity, bool) or not isinstance(quantity, int):
        raise TypeError(
            f"{quantity!r} is no time: give picoseconds as an int, or a number with its unit, such"
            ' as "0.1 s" or "500us"'
        )
    return quantity


def format_instant(ps: int) -> str:
    """Return an instant in microseconds, exactly: ``"341.333333us"``."""
    whole, fraction = divmod(ps, US)
    return f"{whole}us" if fraction == 0 else f"{whole}.{fraction:06d}".rstrip("0") + "us"
