"""What can be ordered of a running board, and what who watches it is sent."""

import asyncio
import json
from types import SimpleNamespace
from typing import Any

import pytest

from tests.unit.faults.bench import LM, MCP, build
from vbus.serve.host_entry import HostEntry, LinkSpec
from vbus.serve.manual_host import ManualHost
from vbus.serve.orders.fault_orders import FaultOrders
from vbus.serve.orders.watching import EventsView, Watched
from vbus.transports.base import ignore


def test_a_fault_is_armed_with_its_parameters() -> None:
    arm = FaultOrders(build(), []).orders()["fault.arm"]
    for given, level in (({"level": 0}, 0), ({}, 1), (None, 1)):
        armed = arm({"name": "a_stuck", "target": "x.1", "parameters": given})
        assert armed["parameters"] == {"level": level}
    with pytest.raises(ValueError, match="parameters are a JSON object"):
        arm({"name": "a_stuck", "target": "x.1", "parameters": [0]})


def test_a_chip_has_as_many_addresses_as_its_address_pins_tell_apart() -> None:
    steps: Any = SimpleNamespace(own=None)
    for chip, addresses in ((LM, 2), (MCP, 128)):
        described = ManualHost(build(chip), steps).described()
        assert described["chips"] == [{"name": "x", "addresses": addresses}]


class Reader:
    """A connection that takes what it is sent, and that a test may say is full."""

    def __init__(self) -> None:
        self.pending: bytes = b""
        self.came: list[Any] = []

    def message(self, data: bytes) -> None:
        self.came.append(json.loads(data))

    def taken(self) -> list[Any]:
        came, self.came = self.came, []
        return [event for event in came if event[0] != "t"]


def test_a_monitor_without_room_is_told_once_how_many_cycles_it_has_missed() -> None:
    board, reader, nobody = build(), Reader(), SimpleNamespace()
    connection: Any = reader
    rest: Any = nobody
    view = EventsView(connection, Watched(board, rest, rest, rest, rest), {})
    view.begin()
    port = board.open_port("host0")
    port.read(0)
    view.take_news()
    assert [event[0] for event in reader.taken()] == ["c"]
    reader.pending = bytes(view.most)
    view.take_news()
    for _ in range(3):
        port.read(0)
    view.take_news()
    assert reader.taken() == []
    reader.pending = b""
    view.take_news()
    assert reader.taken() == [["lost", 3]]
    port.read(0)
    view.take_news()
    assert [event[0] for event in reader.taken()] == ["c"]
    view.end()


def test_a_link_that_was_closed_opens_again() -> None:
    loop = asyncio.new_event_loop()
    entry = HostEntry(LinkSpec("tcp:0"), "host0")
    for _ in range(2):
        entry.open(loop, "bench", ignore, ignore)
        assert not entry.transport.closing
        entry.close("the board stops")
        assert entry.transport.closing
    loop.close()
