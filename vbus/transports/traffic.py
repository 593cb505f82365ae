"""What goes wrong with answers and messages on their way while faults act; where messages are."""

from collections.abc import Callable, Mapping
from typing import Final

from msgspec import Struct

from vbus.core.options import Value

REQUEST: Final = "request"
"""From a host to the board."""
REPLY: Final = "reply"
"""From the board to a host."""
EVENT: Final = "event"
"""From the board to a host that has not asked just now: only a link that is cut loses it."""

MOST_KEPT: Final = 1024
"""Messages that one fault holds back; more are lost. A bound of memory."""

Arrive = Callable[[int], None]
"""Lets a message arrive, so many times; called once, with 0 if it does not come."""

_AS: Final = {
    "answers_late": ("messages_late", REPLY),
    "answer_lost": ("message_lost", REPLY),
    "link_dead": ("link_cut", ""),
}
"""What faults of any link are on one of messages."""


class AnswerFault:
    """One fault of a link that carries a stream of bytes: what becomes of the answers.

    Args:
        name: of the fault.
        once: whether it is over with one answer, if it loses them.

    Attributes:
        held_back: what is to be sent when the fault ends.
    """

    def __init__(self, name: str, once: bool) -> None:
        self.name: str = name
        self.held_back: bytearray = bytearray()
        self._once: bool = once
        self._silent: bool = False

    def bend(self, out: bytearray) -> bool:
        """Keep an answer for later, cut it short, or lose it; tell whether the fault is over."""
        if self.name == "half_answer" and not self._silent:
            self._silent = True
            # A byte at least: a host that gets nothing cannot tell half an answer from a lost one.
            del out[max(1, len(out) // 2) :]
            return False
        if self.name == "answers_late":
            self.held_back += out
        out.clear()
        return self._once and self.name == "answer_lost"


class _Count:
    """Takes one of each so many messages, at another place each time.

    A host repeats all that it has under way: at the same place it might always be the same one.
    """

    def __init__(self, every: int) -> None:
        self._every: int = every
        self._left: int = 0
        self._draws: int = 0

    def hits(self) -> bool:
        """Count a message; return whether it is the one."""
        if not self._left:
            self._left = self._every
            self._draws = (self._draws * 1664525 + 1013904223) & 0xFFFFFFFF
        self._left -= 1
        return self._left == self._every * self._draws >> 32


class TravellingMessage(Struct):
    """A message on its way.

    Attributes:
        way: :data:`REQUEST`, :data:`REPLY` or :data:`EVENT`.
        host: whose it is.
        arrive: lets it arrive.
        times: how often it will.
        bent: a fault has concerned it: one that is for one message waits for another.
    """

    way: str
    host: str
    arrive: Arrive
    times: int = 1
    bent: bool = False


class MessageFault:
    """One fault on the messages of a host entry. What it counts is messages, never time.

    Args:
        name: the fault, as the table has it.
        values: its parameters.
        once: it concerns one message, or two that change places, and is over.

    Attributes:
        over: it has done what it was to do.
    """

    def __init__(self, name: str, values: Mapping[str, Value], once: bool = False) -> None:
        self.name, way = _AS.get(name, (name, str(values.get("way", "both"))))
        self.ways: tuple[str, ...] = (way,) if way in (REQUEST, REPLY) else (REQUEST, REPLY)
        if self.cuts:
            self.ways = (REQUEST, REPLY, EVENT)
        self.tells_hosts_gone: bool = name == "link_cut"
        self.over: bool = False
        self._every: int = int(values.get("every", 1))
        self._once: bool = once
        self._counts: dict[str, _Count] = {way: _Count(self._every) for way in self.ways}
        self._kept: list[TravellingMessage] = []

    @property
    def cuts(self) -> bool:
        """Whether nothing comes at all."""
        return self.name == "link_cut"

    def bend(self, message: TravellingMessage) -> list[TravellingMessage]:
        """Return what goes on because ``message`` has come here."""
        if self.over or message.way not in self.ways or (self._once and message.bent):
            return [message]
        if self.name == "messages_late":
            return self._keep(message)
        if self.name == "messages_reordered":
            return self._reorder(message)
        if self._counts[message.way].hits():
            message.times = 2 * message.times if self.name == "message_doubled" else 0
            message.bent = True
            self.over = self._once
        return [message]

    def _keep(self, message: TravellingMessage) -> list[TravellingMessage]:
        if len(self._kept) < MOST_KEPT:
            self._kept.append(message)
            return []
        message.times = 0
        return [message]

    def _reorder(self, message: TravellingMessage) -> list[TravellingMessage]:
        for place, first in enumerate(self._kept):
            if (first.way, first.host) == (message.way, message.host):
                del self._kept[place]
                self.over = self._once
                message.bent = first.bent = True
                return [message, first]
        return [message] if self._once and self._kept else self._keep(message)

    def release(self) -> list[TravellingMessage]:
        """Give back what was held: it comes now, in its order."""
        held, self._kept = self._kept, []
        return held

    def forget(self, host: str) -> list[TravellingMessage]:
        """A host has gone: give back its messages that were held."""
        gone = [message for message in self._kept if message.host == host]
        self._kept = [message for message in self._kept if message.host != host]
        return gone


class Traffic:
    """The messages between the hosts of one entry and the board.

    Attributes:
        faults: those that act, the first one nearest to where a message comes from.
        cut: called when hosts seem to have gone because a link is cut, and when it is mended.
    """

    def __init__(self) -> None:
        self.cut: Callable[[bool], None] = lambda gone: None
        self.faults: list[MessageFault] = []

    def pass_on(self, way: str, host: str, arrive: Arrive) -> None:
        """Let a message go its way.

        Args:
            way: :data:`REQUEST`, :data:`REPLY` or :data:`EVENT`.
            host: whose it is.
            arrive: lets it arrive, now or later, or lets go of it.
        """
        if self.faults:
            self._send([TravellingMessage(way, host, arrive)], 0)
        else:
            arrive(1)

    def add(self, fault: MessageFault) -> None:
        """Let a fault act from now on, behind those that act already."""
        first = fault.tells_hosts_gone and not self.hosts_gone
        self.faults.append(fault)
        if first:
            self.cut(True)

    def remove(self, fault: MessageFault) -> None:
        """End a fault; messages it has held back come now. A second call does nothing."""
        if fault not in self.faults:
            return
        place = self.faults.index(fault)
        was = self.hosts_gone
        self.faults.remove(fault)
        if was and not self.hosts_gone:
            self.cut(False)
        self._send(fault.release(), place)

    @property
    def hosts_gone(self) -> bool:
        """Whether a link is cut, so that hosts seem to have gone."""
        return any(fault.tells_hosts_gone for fault in self.faults)

    def forget(self, host: str) -> None:
        """A host has gone: release those of its messages that are held."""
        for fault in self.faults:
            for message in fault.forget(host):
                message.arrive(0)

    def close(self) -> None:
        """Release all messages that are held; no message comes any more."""
        faults, self.faults = self.faults, []
        for fault in faults:
            for message in fault.release():
                message.arrive(0)

    def _send(self, messages: list[TravellingMessage], place: int) -> None:
        """Let messages go on from the fault at ``place``."""
        for fault in self.faults[place:]:
            messages = [
                later
                for message in messages
                for later in (fault.bend(message) if message.times else [message])
            ]
        self.faults = [fault for fault in self.faults if not fault.over]
        for message in messages:
            message.arrive(message.times)
