"""A message of a host over Zenoh that is under way."""

from __future__ import annotations

from dataclasses import dataclass
from time import monotonic
from typing import TYPE_CHECKING

import zenoh

from vbus.network import envelope

if TYPE_CHECKING:
    from vbus.client.zenoh_link import ZenohLink


@dataclass(slots=True)
class Sent:
    """A message under way: takes what Zenoh's threads bring.

    Attributes:
        link: its link.
        number: its number.
        data: its bytes.
        sent: when it was sent the last time.
        sendings: how often it was sent.
        over: the last sending that has ended without an answer; 0: none.
        silent_since: when it was first found that nobody answers; 0 if somebody may.
    """

    link: ZenohLink
    number: int
    data: bytes
    sent: float = 0.0
    sendings: int = 0
    over: int = 0
    silent_since: float = 0.0

    def take(self, reply: zenoh.Reply) -> None:
        """Take the reply; called in a thread of Zenoh's."""
        ok = reply.ok
        if ok is not None:
            if self.number == 0:
                said = ok.attachment
                self.link.may_post(said is not None and said.to_bytes() == envelope.POSTS)
            self.link.arrived(self.number, ok.payload.to_bytes())
            return
        err = reply.err
        text = err.payload.to_bytes().decode("utf-8", "replace") if err is not None else ""
        code, _, reason = text.partition(" ")
        if code in (envelope.GONE, envelope.MALFORMED, envelope.TOO_LARGE, envelope.BROKEN):
            self.link.failed(f"refused by the board: {reason}", self.number)

    def ended(self, sending: int) -> None:
        """Whoever could answer has done so; called in a thread of Zenoh's.

        A board that works on a message lets go of it when it is repeated, and holds the repetition.
        """
        if sending == self.sendings:
            self.over = sending
            self.silent_since = self.silent_since or monotonic()

    @property
    def held(self) -> bool:
        """Whether somebody may yet answer what was sent last."""
        return self.over != self.sendings
