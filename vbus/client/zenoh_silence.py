"""Why no board answers on the network: Zenoh itself does not report failures."""

from collections.abc import Callable
from time import sleep
from typing import Any, Final

import zenoh

from vbus.network import keys
from vbus.network.access import ask_access
from vbus.network.security import Security

MATCH_SECONDS: Final = 0.5
"""How long the network may take to tell who is there, and who answers at a key: where a link was
lost for a moment, because a busy machine let its threads wait, that comes after it is back."""
PAUSE_SECONDS: Final = 0.02
"""Seconds between two looks at it; not measured."""


def reason_for_silence(
    network: zenoh.Session,
    bus_key: str,
    endpoints: tuple[str, ...],
    security: Security | None,
    tried: int,
) -> str:
    """Return what is wrong, where, and what to do; asks around, which takes up to three seconds.

    Args:
        network: the host's session.
        bus_key: the key at which no board has answered.
        endpoints: where the session is connected to.
        security: its certificates, if any.
        tried: how often a message was sent.
    """
    at = ", ".join(endpoints)
    # From near to far: the link, the rights, the board, the chip.
    if not _comes(lambda: bool(network.info.routers_zid())):
        return f"the link to {at} is lost; is the router or the board still running? (vbus ls)"
    refused = ask_access(network, bus_key) if security is not None else ""
    if refused:
        return f"forbidden: {refused}"
    chunks = bus_key.split("/")
    board = chunks[1]
    if _comes(lambda: _is_there(network, board)):
        if _somebody_answers(network, bus_key):
            times = "once" if tried == 1 else f"{tried} times"
            return (
                f'the board "{board}" is on the network of {at}, but messages to it, or its'
                f" replies, are lost: one was sent {times} without a reply; is a fault of its link"
                f" armed (vbus fault list {board}), or the network cut?"
            )
        if len(chunks) == 4:
            return (
                f'the board "{board}" has no chip "{chunks[2]}" on the network of {at}: no process'
                f" answers at the key {bus_key}; its link must reach that chip (vbus ls)"
            )
        return f'the board "{board}" on the network of {at} answers no more'
    return (
        f'no board called "{board}" is on the network of {at}: no process answers at the key'
        f" {bus_key}; is it running, and connected there? (vbus ls --zenoh {endpoints[0]})"
    )


def _comes(true: Callable[[], bool]) -> bool:
    """Whether something is so, or comes to be so in a moment."""
    # In steps: where this process has no turn, Zenoh's threads have none either.
    for _ in range(round(MATCH_SECONDS / PAUSE_SECONDS)):
        if true():
            return True
        sleep(PAUSE_SECONDS)
    return true()


def _is_there(network: zenoh.Session, board: str) -> bool:
    replies = network.liveliness().get(keys.owner(board, "*"), timeout=1.0)
    return any(reply.ok is not None for reply in replies)


def _somebody_answers(network: zenoh.Session, bus_key: str) -> bool:
    """Whether a board has taken the key, though not a message of ours."""
    querier: Any = network.declare_querier(bus_key)
    try:
        return _comes(lambda: querier.matching_status.matching)
    finally:
        querier.undeclare()
