"""Plain names for nets, for formats that know letters, digits and single bits alone."""

import re
from typing import Final

_RANGE: Final = re.compile(r"(.*?)(\d+)-\D*(\d+)")


def bit_names(name: str, width: int) -> list[str]:
    """Return plain names for the wires of a net, least significant first.

    ``"x.D0-D7"`` becomes ``x_D0`` to ``x_D7``, ``"x./CS"`` becomes ``x_CS``.
    """
    match = _RANGE.fullmatch(name) if width > 1 else None
    if match is not None:
        first, last = int(match[2]), int(match[3])
        if last - first + 1 == width:
            return [plain(f"{match[1]}{number}") for number in range(first, last + 1)]
    if width == 1:
        return [plain(name)]
    return [f"{plain(name)}_{number}" for number in range(width)]


def plain(name: str) -> str:
    """Return a name of ASCII letters, digits and underscores."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name.replace("/", "").replace("~", "")).strip("_")
