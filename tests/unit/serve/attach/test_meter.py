"""What round trips are, and what is lost, as a meter sees it."""

from random import Random

import pytest

from tests.unit.fake_port import FakePort
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.requests import REQUESTS
from vbus.serve.attach.meter import ByteMeter, Meter, Trips


def request(name: str, *values: int | bytes) -> bytes:
    return REQUESTS[name].pack(*values)


class Talk:
    """A session whose bytes a meter sees; a millisecond passes there, and one back."""

    def __init__(self) -> None:
        self.trips = Trips()
        self.meter = ByteMeter(self.trips)
        self.board = ByteProtocol(FakePort())
        self.now = 0

    def send(self, data: bytes, cut: int = 1000) -> None:
        for start in range(0, len(data), cut):
            self.meter.sent(data[start : start + cut], self.now)
        self.now += 1_000_000
        self.board.receive(data)

    def answer(self, cut: int = 1000) -> None:
        data = self.board.take()
        self.now += 1_000_000
        for start in range(0, len(data), cut):
            self.meter.came(data[start : start + cut], self.now)


EVERYTHING = (
    request("HELLO", 1) + request("EVENTS", 1) + b"\x10\x20\x01\x11" + request("READS", 1, 9)
    + request("WRITES", 1, b"abc") + request("LEASES", 2) + b"\x10" + request("GETPIN", 2)
    + request("PIN", 200, 1) + request("SAMPLE") + request("NOW") + request("READ", 0xEE)
    + request("ECHO", 9)
)  # fmt: skip


@pytest.mark.parametrize("cut", [1, 3, 1000])
def test_every_reply_is_counted_and_the_first_of_a_message_is_a_round_trip(cut: int) -> None:
    talk = Talk()
    talk.send(EVERYTHING, cut)
    assert talk.meter.open == 10
    talk.answer(cut)
    assert talk.meter.open == 0
    assert (talk.trips.answers, talk.trips.lost) == (10, 0)
    assert (talk.trips.all.count, talk.trips.all.most) == (1, 2_000_000)
    talk.send(request("HELLO", 2), cut)
    talk.answer(cut)
    for _ in range(3):
        talk.send(b"\x10", cut)
        for paused in (True, False):  # what nobody asked for is no answer
            talk.board.tell_pause(paused)
        talk.answer(cut)
    assert (talk.trips.answers, talk.trips.all.count) == (14, 5)


def test_what_lets_time_pass_is_no_measure_of_the_way() -> None:
    talk = Talk()
    for message in (request("DELAY", 10**6) + b"\x10", request("WAIT", 10**6), request("CLAIM")):
        talk.send(message)
        talk.answer()
    assert (talk.trips.all.count, talk.trips.answers) == (0, 3)
    talk.send(request("DELAY", 10**6))
    talk.answer()
    talk.send(b"\x10")
    talk.answer()
    assert (talk.trips.all.count, talk.trips.answers) == (0, 4)
    talk.send(b"\x10")
    talk.answer()
    assert (talk.trips.all.count, talk.trips.answers) == (1, 5)


def test_an_answer_from_before_a_wait_does_not_end_it() -> None:
    talk = Talk()
    talk.send(b"\x10" + request("DELAY", 10**6))
    talk.answer()
    talk.send(b"\x10")
    talk.answer()
    assert (talk.trips.all.count, talk.trips.answers) == (1, 2)


def test_answers_that_do_not_come_are_lost_and_those_of_a_host_that_went_are_not() -> None:
    talk = Talk()
    talk.send(b"\x10\x20\x01\x11\x11")
    assert talk.meter.lose() == 3
    assert talk.meter.lose() == 0
    assert talk.trips.lost == 3


def test_after_a_request_nobody_knows_nothing_is_measured() -> None:
    talk = Talk()
    talk.send(b"\x10\xff\x10\x10")
    talk.answer()
    talk.send(b"\x10\x10")
    talk.answer()
    assert (talk.trips.all.count, talk.meter.lose()) == (1, 0)


def test_no_bytes_upset_it() -> None:
    random = Random(19)
    for _ in range(300):
        meter = ByteMeter(Trips())
        for _ in range(10):
            meter.sent(random.randbytes(random.randrange(40)), 1)
            meter.came(random.randbytes(random.randrange(40)), 2)
        assert meter.open >= 0


def test_what_was_measured_since_the_last_look() -> None:
    trips = Trips()
    trips.note(5_000)
    assert trips.take_recent().count == 1
    assert trips.take_recent().count == 0
    assert trips.all.count == 1


def test_other_wire_formats_are_measured_in_turns() -> None:
    meter = Meter(Trips())
    meter.sent(b"r 0", 10)
    meter.sent(b"\n", 20)
    meter.came(b"84\n", 5_010)
    meter.came(b"more\n", 9_000)
    assert (meter.trips.all.count, meter.trips.all.most, meter.trips.answers) == (1, 5_000, 1)
    meter.sent(b"r 0\n", 10_000)
    assert meter.lose() == 1
