"""From the rows of a register map to the methods they name."""

from collections.abc import Callable
from typing import Any

from vbus.chips.tables import RegisterMap


def hooks(
    rows: RegisterMap, owner: type, role: str, plain: str = "", read_only: str = ""
) -> dict[int, Callable[..., Any]]:
    """Return the methods of ``owner`` that rows name, by the addresses of their bytes.

    Args:
        rows: the map.
        owner: class of the methods.
        role: which name of a row: ``"on_read"`` or ``"on_write"``.
        plain: method of rows that name none; "": none.
        read_only: the same for rows that cannot be written.

    Raises:
        TypeError: a row names what is no method of ``owner``.
    """
    found: dict[int, Callable[..., Any]] = {}
    for row in rows:
        name = getattr(row, role) or (plain if row.access != "r" else read_only)
        method = getattr(owner, name, None) if name else None
        if name and not callable(method):
            raise TypeError(f"{row.name}: {role} names {name}, no method of {owner.__name__}")
        if method is not None:
            found.update(dict.fromkeys(row.addresses, method))
    return found
