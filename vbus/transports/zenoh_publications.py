"""What a board publishes of itself on the network, for whoever watches.

Nothing is computed, observed or sent unless somebody has subscribed to it; and then not more often
than :data:`EVERY_SECONDS` for each key, in one message with everything that happened meanwhile.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

import msgpack

from vbus.network import keys
from vbus.signals import Net, Observer
from vbus.transports.base import Served
from vbus.transports.zenoh_host import send_reply
from vbus.transports.zenoh_inbox import Handle, Inbox

if TYPE_CHECKING:
    import asyncio

    import zenoh

EVERY_SECONDS: Final = 0.05
"""How often a key is published at most."""
MOST_ROWS: Final = 20_000
"""Bus cycles, or edges of a pin, that one message carries; the rest is counted as lost."""


class _Rows:
    """Rows that wait for the next message."""

    def __init__(self) -> None:
        self.rows: list[list[int | str]] = []
        self.lost: int = 0

    def add(self, row: list[int | str]) -> None:
        if len(self.rows) < MOST_ROWS:
            self.rows.append(row)
        else:
            self.lost += 1

    def take(self) -> bytes:
        rows, self.rows = self.rows, []
        lost, self.lost = self.lost, 0
        data: bytes = msgpack.packb([lost, rows])
        return data


class _Cycles(Observer):
    """Takes down the bus cycles of all chips that are watched."""

    def __init__(self) -> None:
        self.chips: dict[str, _Rows] = {}

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        rows = self.chips.get(chip)
        if rows is not None:
            rows.add([when, host, int(write), address, data])


class _PinWatch(Observer):
    """Takes down the edges of one pin."""

    def __init__(self, net: Net) -> None:
        self.net: Net = net
        self.rows: _Rows = _Rows()

    def edge(self, when: int, net: str, level: int) -> None:
        self.rows.add([when, level])


class Publications:
    """Publishes status, telemetry, bus cycles and pins of one board.

    Args:
        session: the board's Zenoh session.
        inbox: where Zenoh's threads enter the event loop.
        served: the board.
        loop: the event loop.
        part: name of the node that this process serves; empty for the whole board.
    """

    def __init__(
        self,
        session: zenoh.Session,
        inbox: Inbox,
        served: Served,
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self._session: zenoh.Session = session
        self._inbox: Inbox = inbox
        self._served: Served = served
        self._loop: asyncio.AbstractEventLoop = loop
        self._kept: list[Any] = []
        self._watched: dict[str, Callable[[], bytes | None]] = {}
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._cycles: _Cycles = _Cycles()
        self._pins: dict[str, _PinWatch] = {}
        self._timer: asyncio.TimerHandle | None = None

    def open(self) -> None:
        """Declare what can be asked and watched."""
        board = self._served.board
        self._queryable(keys.status(board.name), self._tell_status)
        self._watchable(keys.status(board.name), self._begin_status)
        for chip in self._served.chips:
            telemetry = keys.telemetry(board.name, chip)
            self._queryable(telemetry, self._telling(chip))
            self._watchable(telemetry, self._beginning_telemetry(chip))
            self._watchable(keys.cycles(board.name, chip), self._beginning_cycles(chip))
            for row in board.chip(chip).pin_rows:
                key = keys.pin(board.name, chip, row.name)
                net = board.chip(chip).pins[row.name].net
                self._queryable(key, self._telling_pin(key, net))
                self._watchable(key, self._beginning_pin(key, net))

    def close(self) -> None:
        """Publish nothing more; may be called again."""
        for key in list(self._watched):
            self._stop(key)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._kept.clear()

    # -- declaring ------------------------------------------------------------------------------

    def _queryable(self, key: str, handle: Handle) -> None:
        import zenoh

        callback = zenoh.handlers.Callback(self._inbox.entry(handle), indirect=False)
        self._kept.append(self._session.declare_queryable(key, callback))

    def _watchable(self, key: str, begin: Callable[[], Callable[[], bytes | None]]) -> None:
        """Publish under ``key`` while somebody listens: ``begin`` returns what makes a message."""
        import zenoh

        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP
        )

        def matched(status: zenoh.MatchingStatus) -> None:
            if not status.matching:
                self._stop(key)
            elif key not in self._watched:
                self._watched[key] = begin()
                self._publishers[key] = publisher
                self._start()

        callback = zenoh.handlers.Callback(self._inbox.entry(matched), indirect=False)
        self._kept += [publisher, publisher.declare_matching_listener(callback)]

    # -- the round ------------------------------------------------------------------------------

    def _start(self) -> None:
        if self._timer is None:
            self._timer = self._loop.call_later(EVERY_SECONDS, self._publish)

    def _publish(self) -> None:
        self._timer = None
        if self._watched:
            self._served.settle()
            for key, make in self._watched.items():
                data = make()
                if data is not None:
                    self._publishers[key].put(data)
            self._start()

    def _stop(self, key: str) -> None:
        if self._watched.pop(key, None) is None:
            return
        board = self._served.board
        watch = self._pins.pop(key, None)
        if watch is not None:
            watch.net.unobserve(watch)
        chip = key.split("/")[2]
        if key == keys.cycles(board.name, chip) and self._cycles.chips.pop(chip, None) is not None:
            if not self._cycles.chips:
                board.unobserve(self._cycles)

    def _settle(self) -> None:
        """Bring every output up to the present."""
        board = self._served.board
        self._served.settle()
        for chip in board.chips:
            chip.advance()
        board.kernel.settle()

    # -- what there is --------------------------------------------------------------------------

    def _status(self) -> bytes:
        return json.dumps(self._served.statistics()).encode()

    def _tell_status(self, query: zenoh.Query) -> None:
        send_reply(query, self._status(), keys.status(self._served.board.name))

    def _begin_status(self) -> Callable[[], bytes | None]:
        waited = 0

        def make() -> bytes | None:
            nonlocal waited
            waited += 1
            return self._status() if waited % 20 == 1 else None

        return make

    def _telemetry(self, chip: str) -> bytes:
        board = self._served.board
        values: Mapping[str, int | float | str] = board.chip(chip).telemetry()
        data: bytes = msgpack.packb([board.now, dict(values)])
        return data

    def _telling(self, chip: str) -> Handle:
        def tell(query: zenoh.Query) -> None:
            self._served.settle()
            key = keys.telemetry(self._served.board.name, chip)
            send_reply(query, self._telemetry(chip), key)

        return tell

    def _beginning_telemetry(self, chip: str) -> Callable[[], Callable[[], bytes | None]]:
        return lambda: lambda: self._telemetry(chip)

    def _beginning_cycles(self, chip: str) -> Callable[[], Callable[[], bytes | None]]:
        def begin() -> Callable[[], bytes | None]:
            if not self._cycles.chips:
                self._served.board.observe(self._cycles)
            rows = self._cycles.chips[chip] = _Rows()
            return lambda: rows.take() if rows.rows else None

        return begin

    def _telling_pin(self, key: str, net: Net) -> Handle:
        def tell(query: zenoh.Query) -> None:
            self._settle()
            send_reply(query, msgpack.packb([self._served.board.now, net.value]), key)

        return tell

    def _beginning_pin(self, key: str, net: Net) -> Callable[[], Callable[[], bytes | None]]:
        def begin() -> Callable[[], bytes | None]:
            self._settle()
            watch = self._pins[key] = _PinWatch(net)
            net.observe(watch)
            watch.rows.add([self._served.board.now, net.value])
            return lambda: watch.rows.take() if watch.rows.rows else None

        return begin
