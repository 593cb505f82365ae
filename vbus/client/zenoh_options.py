"""What a link over Zenoh says of itself: how long it bears silence, and where it connects to."""

import os
from typing import Final

from vbus.errors import TransportError
from vbus.network import places

LONGEST_PATIENCE: Final = 86400.0


def seconds(where: str, text: str) -> float:
    """Return the patience that a link asks for.

    Raises:
        ValueError: it is no time.
    """
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds <= LONGEST_PATIENCE:
        raise ValueError(
            f"'{where}': patience={text} is no time; write seconds from 0 to {LONGEST_PATIENCE:g},"
            " such as patience=30"
        )
    return seconds


def endpoints_of(board: str, given: str) -> tuple[str, ...]:
    """Return where to connect to: as given, as the environment says, or found on this computer.

    Raises:
        TransportError: nothing is known of the board here.
    """
    text = given or os.environ.get(places.VARIABLE, "")
    if text:
        return tuple(text.split(","))
    found = places.endpoints_at(places.board_place(board)) or places.endpoints_at(
        places.router_place()
    )
    if not found:
        raise TransportError(
            f'zenoh:{board} cannot be opened: no board called "{board}" and no router runs on this'
            f" computer; write zenoh:{board}?connect=tcp/HOST:PORT, or set {places.VARIABLE} to the"
            " endpoint of a router"
        )
    return found
