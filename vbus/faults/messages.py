"""Faults of messages on a network: which links can have them, and what they say of themselves."""

from collections.abc import Mapping
from typing import Final

from vbus.core.options import Value
from vbus.faults.row import Fault

MESSAGES: Final = "network"
"""The family of faults that need a link of messages."""
OF_BYTES: Final = "half_answer"
"""What only a stream of bytes can have."""


def misfit(fault: Fault, target: str, link: str, messages: bool) -> str:
    """Return why a link can never have a fault of links; nothing if it can.

    Args:
        fault: the fault.
        target: the link, ``"host0"``.
        link: its address, for people.
        messages: it carries messages, and no stream of bytes.
    """
    if fault.family == MESSAGES and not messages:
        return (
            f"{fault.name}: {target} ({link}) is a stream of bytes, in which nothing is lost or"
            " doubled by itself and nothing overtakes; it is for links of messages"
            ' (transport = "zenoh:"), and a stream has answer_lost, answers_late and link_dead'
        )
    if fault.name == OF_BYTES and messages:
        return (
            f"{fault.name}: {target} ({link}) carries messages, which come whole or not at all;"
            " message_lost loses one"
        )
    return ""


def concerned(values: Mapping[str, Value]) -> str:
    """Return what a fault of messages changes while it acts."""
    ways = {"request": "requests", "reply": "replies"}
    what = ways.get(str(values.get("way", "both")), "requests and replies")
    every = int(values.get("every", 1))
    return what if every == 1 else f"one of {every} {what}"
