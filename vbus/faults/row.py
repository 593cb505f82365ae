"""What the tables of faults are made of, and which links a fault of messages fits."""

from collections.abc import Mapping
from typing import Final

from msgspec import Struct

from vbus.core.options import Option, Value

AXIS: Final = "axis"
"""Targets a chip's axis and its plant: ``"x"``, or ``"x.2"`` for the second axis."""
CHIP: Final = "chip"
"""Targets a chip: ``"x"``."""
LINK: Final = "link"
"""Targets a host's link: ``"host0"``, in the order of the board file."""
WIRE: Final = "wire"
"""Targets a wire between nodes at the end where it is armed: ``"BRAKE"``."""

NET: Final = "net"
"""Targets a wire of the board, by its name or that of a pin on it: ``"IRQ"``, ``"x./CS"``."""
PART: Final = "part"
"""Targets a part of glue: ``"u1"``."""

ONCE: Final = "once"
"""Begins and is over at once: a jump, a reset."""
LASTS: Final = "lasts"
"""Holds until its duration is over or it is cleared."""
COUNTED: Final = "counted"
"""Acts on one bus cycle, answer or message at a time, or on all of them while it lasts."""


class Fault(Struct, frozen=True):
    """One thing that can break.

    Attributes:
        name: what it is armed by.
        family: ``"mechanics"``, ``"encoder"``, ``"switches"``, ``"chip"``, ``"bus"``, ``"glue"``,
            ``"wire"``, ``"transport"`` or ``"network"``.
        title: one line saying what it does.
        target: :data:`AXIS`, :data:`CHIP`, :data:`LINK`, :data:`WIRE`, :data:`NET` or
            :data:`PART`.
        acts: :data:`ONCE`, :data:`LASTS` or :data:`COUNTED`.
        parameters: its settings.
        families: chip families it exists for; all if empty.
        shaft: it needs a plant that computes a shaft: ``dc_motor`` or ``stepper``.
    """

    name: str
    family: str
    title: str
    target: str
    acts: str
    parameters: tuple[Option, ...] = ()
    families: tuple[str, ...] = ()
    shaft: bool = False

    @property
    def of_chip(self) -> bool:
        """Whether it is about a chip or an axis of one."""
        return self.target in (AXIS, CHIP)

    @property
    def of_cycles(self) -> bool:
        """Whether it may be about one bus cycle alone."""
        return self.target == CHIP and self.acts == COUNTED

    def exists_for(self, family: str) -> bool:
        """Whether chips of ``family`` can have it."""
        return not self.families or family in self.families


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


class LinkActs:
    """What does the faults of links: the server. By itself, links of a recorded run, in which
    their faults changed nothing on the board.
    """

    def check(self, name: str, target: str) -> None:
        """Raise ValueError if the link ``target`` can never have the fault; says why."""

    def begin(
        self, number: int, name: str, target: str, once: bool, values: dict[str, Value]
    ) -> str:
        """Let a fault act; return what it changes. Raises ValueError if it cannot."""
        return ""

    def end(self, number: int) -> None:
        """Let it act no more."""
