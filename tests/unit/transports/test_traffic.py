"""Messages on their way: which a fault concerns, how often they arrive, and in which order."""

from collections.abc import Callable
from typing import Any

import pytest

from vbus.transports.traffic import EVENT, MOST_KEPT, REPLY, REQUEST, MessageFault, Traffic


class Road:
    """Messages that are numbers, and what became of them: each number once for each arrival."""

    def __init__(self) -> None:
        self.traffic: Traffic = Traffic()
        self.came: list[int] = []
        self.lost: list[int] = []

    def fault(self, name: str, once: bool = False, **values: Any) -> MessageFault:
        fault = MessageFault(name, values, once)
        self.traffic.add(fault)
        return fault

    def arrival(self, number: int) -> Callable[[int], None]:
        def arrive(times: int) -> None:
            self.came.extend([number] * times)
            if not times:
                self.lost.append(number)

        return arrive

    def send(self, *numbers: int, way: str = REQUEST, host: str = "a") -> list[int]:
        self.came.clear()
        for number in numbers:
            self.traffic.pass_on(way, host, self.arrival(number))
        return self.came


def test_without_a_fault_all_come_as_they_are() -> None:
    assert Road().send(1, 2, 3) == [1, 2, 3]


@pytest.mark.parametrize(
    ("name", "came"),
    [
        ("message_lost", []),
        ("message_doubled", [1, 1, 2, 2, 3, 3]),
        ("messages_reordered", [2, 1]),
        ("messages_late", []),
        ("link_cut", []),
    ],
)
def test_a_fault_concerns_its_way_alone(name: str, came: list[int]) -> None:
    for way, other in ((REQUEST, REPLY), (REPLY, REQUEST)):
        road = Road()
        road.fault(name, way=way)
        assert road.send(1, 2, 3, way=way) == came
        assert road.send(1, 2, 3, way=other) == ([] if name == "link_cut" else [1, 2, 3])
    road = Road()
    road.fault(name)
    assert road.send(1, 2, 3, way=REQUEST) == came
    assert road.send(1, 2, 3, way=REPLY) == came
    assert road.send(1, 2, 3, way=EVENT) == ([] if name == "link_cut" else [1, 2, 3])


@pytest.mark.parametrize(
    ("name", "way", "came"),
    [
        ("answers_late", REPLY, []),
        ("answer_lost", REPLY, []),
        ("link_dead", REPLY, []),
        ("answers_late", REQUEST, [1]),
        ("answer_lost", REQUEST, [1]),
        ("link_dead", REQUEST, []),
        ("link_dead", EVENT, []),
    ],
)
def test_faults_of_any_link_are_some_of_these(name: str, way: str, came: list[int]) -> None:
    road = Road()
    road.fault(name)
    assert road.send(1, way=way) == came


def test_one_of_each_so_many_is_concerned_on_each_way() -> None:
    road = Road()
    road.fault("message_lost", every=3)
    for way in (REQUEST, REPLY):
        came = road.send(*range(300), way=way)
        lost = [number for number in range(300) if number not in came]
        assert [number // 3 for number in lost] == list(range(100))
        assert {number % 3 for number in lost} == {0, 1, 2}
    again = Road()
    again.fault("message_lost", every=3)
    assert again.send(*range(300)) == came


def test_one_that_is_for_one_message_is_over_then() -> None:
    road = Road()
    road.fault("message_doubled", once=True, way=REPLY)
    assert road.send(1) == [1]
    assert road.send(1, 2, way=REPLY) == [1, 1, 2]
    assert road.traffic.faults == []
    road.fault("message_lost", once=True, every=4)
    assert len(road.send(*range(8))) == 7


@pytest.mark.parametrize(
    ("name", "came"),
    [
        ("message_doubled", [1, 1, 2, 2, 3, 3, 4]),
        ("message_lost", [4]),
        ("messages_reordered", [2, 1, 4, 3]),
    ],
)
def test_each_of_several_that_are_for_one_message_finds_its_own(name: str, came: list[int]) -> None:
    road = Road()
    for _ in range(2 if name == "messages_reordered" else 3):
        road.fault(name, once=True)
    assert road.send(1, 2, 3, 4) == came
    assert road.traffic.faults == []


@pytest.mark.parametrize("once", [False, True])
def test_messages_of_one_host_change_places(once: bool) -> None:
    road = Road()
    fault = road.fault("messages_reordered", once)
    assert road.send(1) == []
    assert road.send(2, host="b") == ([2] if once else [])
    assert road.send(3) == [3, 1]
    assert road.send(4, host="b") == ([4] if once else [4, 2])
    road.send(5)
    road.traffic.remove(fault)
    assert road.came == [5]


def test_what_was_kept_comes_in_its_order_through_what_acts_behind() -> None:
    road = Road()
    first = road.fault("messages_late", way=REQUEST)
    second = road.fault("message_doubled", way=REQUEST)
    assert road.send(1, 2) == []
    road.traffic.remove(first)
    assert road.came == [1, 1, 2, 2]
    road.traffic.remove(second)
    road.traffic.remove(second)
    assert road.send(3) == [3]


def test_no_more_than_so_many_are_kept() -> None:
    road = Road()
    fault = road.fault("messages_late")
    road.send(*range(MOST_KEPT + 2))
    assert road.lost == [MOST_KEPT, MOST_KEPT + 1]
    road.traffic.remove(fault)
    assert road.came == list(range(MOST_KEPT))


def test_what_was_kept_of_a_host_that_has_gone_does_not_come() -> None:
    road = Road()
    fault = road.fault("messages_late")
    road.send(1)
    road.send(2, host="b")
    road.traffic.forget("a")
    assert road.lost == [1]
    road.traffic.remove(fault)
    assert road.came == [2]
    road.fault("messages_late")
    road.send(3)
    road.traffic.close()
    assert road.lost == [1, 3]
    assert road.send(4) == [4]


def test_a_link_is_mended_when_the_last_of_its_cuts_is_over() -> None:
    road = Road()
    told: list[bool] = []
    road.traffic.cut = told.append
    cuts = [road.fault("link_cut"), road.fault("link_dead"), road.fault("link_cut")]
    for cut in cuts:
        road.traffic.remove(cut)
    assert told == [True, False]
