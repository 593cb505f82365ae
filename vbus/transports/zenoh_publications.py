"""What a board publishes of itself on the network.

Nothing is computed, observed or sent without a subscriber; and then not more often
than :data:`EVERY_SECONDS` for each key, in one message with everything that happened meanwhile.
"""

import asyncio
import json
from typing import Any, Final

import msgpack
import zenoh

from vbus.chips.base import Chip
from vbus.core.signals import Net, Observer
from vbus.network import keys
from vbus.transports.base import Served
from vbus.transports.zenoh_host import send_reply
from vbus.transports.zenoh_inbox import Inbox

EVERY_SECONDS: Final = 0.05
"""How often a key is published at most (s): a person sees no more."""
STATUS_EVERY: Final = 20
"""Every how many of these times the status is: once a second."""
MOST_ROWS: Final = 20_000
"""Bus cycles, or edges of a pin, that one message carries; the rest is counted as lost.
It bounds a message at 400,000 rows a second."""


class Topic:
    """What is published under one key while it has subscribers.

    Args:
        key: the key.
        served: the board.
    """

    answers: bool = True
    """Whether it can also be asked for."""

    def __init__(self, key: str, served: Served) -> None:
        self.key: str = key
        self.served: Served = served

    def begin(self) -> None:
        """The first subscriber has come."""

    def end(self) -> None:
        """The last subscriber has gone."""

    def answer(self) -> bytes:
        """Return the answer to a query of this key."""
        raise NotImplementedError

    def message(self) -> bytes | None:
        """Return what is new; None if nothing is."""
        return self.answer()


class _Status(Topic):
    _rounds: int = 0

    def begin(self) -> None:
        self._rounds = 0

    def answer(self) -> bytes:
        return json.dumps(self.served.statistics()).encode()

    def message(self) -> bytes | None:
        self._rounds += 1
        return self.answer() if self._rounds % STATUS_EVERY == 1 else None


class _Telemetry(Topic):
    def __init__(self, served: Served, chip: Chip) -> None:
        super().__init__(keys.telemetry(served.board.name, chip.name), served)
        self._chip: Chip = chip

    def answer(self) -> bytes:
        self.served.settle()
        return _packed([self.served.board.now, dict(self._chip.telemetry())])


class _RowsTopic(Topic, Observer):
    """Rows that wait for the next message."""

    def __init__(self, key: str, served: Served) -> None:
        super().__init__(key, served)
        self._rows: list[list[int | str]] = []
        self._lost: int = 0

    def add(self, row: list[int | str]) -> None:
        """Take a row."""
        if len(self._rows) < MOST_ROWS:
            self._rows.append(row)
        else:
            self._lost += 1

    def message(self) -> bytes | None:
        rows, self._rows = self._rows, []
        lost, self._lost = self._lost, 0
        return _packed([lost, rows]) if rows else None


class _Cycles(_RowsTopic):
    """The bus cycles of one chip."""

    answers = False

    def __init__(self, served: Served, chip: Chip) -> None:
        super().__init__(keys.cycles(served.board.name, chip.name), served)
        self._chip: str = chip.name

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        if chip == self._chip:
            self.add([when, host, int(write), address, data])

    def begin(self) -> None:
        self.served.board.observe(self)

    def end(self) -> None:
        self.served.board.unobserve(self)


class _PinEdges(_RowsTopic):
    """The edges of one pin."""

    def __init__(self, served: Served, chip: Chip, pin: str) -> None:
        super().__init__(keys.pin(served.board.name, chip.name, pin), served)
        self._net: Net = chip.pins[pin].net

    def edge(self, when: int, net: str, level: int) -> None:
        self.add([when, level])

    def _state(self) -> list[int | str]:
        """Bring every output up to the present; return the instant and the level."""
        board = self.served.board
        self.served.settle()
        for chip in board.chips:
            chip.advance()
        board.kernel.settle()
        return [board.now, self._net.value]

    def answer(self) -> bytes:
        return _packed(self._state())

    def begin(self) -> None:
        state = self._state()
        self._net.observe(self)
        self.add(state)

    def end(self) -> None:
        self._net.unobserve(self)


def _packed(values: list[Any]) -> bytes:
    data: bytes = msgpack.packb(values)
    return data


class Publications:
    """Publishes status, telemetry, bus cycles and pins of one board.

    Args:
        session: the board's Zenoh session.
        inbox: where Zenoh's threads enter the event loop.
        served: the board.
        loop: the event loop.
    """

    def __init__(
        self, session: zenoh.Session, inbox: Inbox, served: Served, loop: asyncio.AbstractEventLoop
    ) -> None:
        self._session: zenoh.Session = session
        self._inbox: Inbox = inbox
        self._served: Served = served
        self._loop: asyncio.AbstractEventLoop = loop
        self._kept: list[Any] = []
        self._watched: dict[Topic, zenoh.Publisher] = {}
        self._timer: asyncio.TimerHandle | None = None

    def open(self) -> None:
        """Declare what can be asked and watched."""
        served = self._served
        self._declare(_Status(keys.status(served.board.name), served))
        for name in served.chips:
            chip = served.board.chip(name)
            self._declare(_Telemetry(served, chip))
            self._declare(_Cycles(served, chip))
            for row in chip.pin_rows:
                self._declare(_PinEdges(served, chip, row.name))

    def close(self) -> None:
        """Publish nothing more; may be called again."""
        for topic in list(self._watched):
            self._stop(topic)
        if self._timer is not None:
            self._timer.cancel()
        self._kept.clear()

    def _declare(self, topic: Topic) -> None:
        publisher = self._session.declare_publisher(
            topic.key, congestion_control=zenoh.CongestionControl.DROP
        )

        def asked(query: zenoh.Query) -> None:
            send_reply(query, topic.answer(), topic.key)

        def matched(status: zenoh.MatchingStatus) -> None:
            if not status.matching:
                self._stop(topic)
            elif topic not in self._watched:
                topic.begin()
                self._watched[topic] = publisher
                self._publish_later()

        enter = self._inbox.entry
        self._kept += [publisher, publisher.declare_matching_listener(enter(matched))]
        if topic.answers:
            self._kept.append(self._session.declare_queryable(topic.key, enter(asked)))

    def _publish_later(self) -> None:
        if self._timer is None and self._watched:
            self._timer = self._loop.call_later(EVERY_SECONDS, self._publish)

    def _publish(self) -> None:
        self._timer = None
        if self._watched:
            self._served.settle()
        for topic, publisher in self._watched.items():
            data = topic.message()
            if data is not None:
                publisher.put(data)
        self._publish_later()

    def _stop(self, topic: Topic) -> None:
        if self._watched.pop(topic, None) is not None:
            topic.end()
