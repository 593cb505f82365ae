"""The host's end of the byte protocol, without I/O: it meets the board's end byte for byte."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.fake_port import FakePort
from tests.unit.protocols.grammar import cuts, pieces
from vbus.client.lease import Lease
from vbus.client.message import Event, Message, Ready, Sample, Sync
from vbus.client.wire import SessionWire
from vbus.core.errors import ProtocolError
from vbus.core.kernel import US
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.info import encode_hello
from vbus.protocols.port import PortInfo

INFO = PortInfo("b", "lockstep", 0.0, lines=["/RD"], outputs=[], pins=["x./RST", "y./RST", "x.HI"])


class Pair:
    """Both ends with nothing but bytes between them."""

    def __init__(self) -> None:
        self.port = FakePort()
        self.board = ByteProtocol(self.port)
        self.wire = SessionWire()

    def exchange(self, message: Message, mask: int | None = None) -> None:
        self.board.receive(self.wire.send(message, mask))
        self.wire.feed(self.board.take())


@pytest.fixture
def pair() -> Pair:
    return Pair()


def test_every_call_has_its_result(pair: Pair) -> None:
    message = Message(pair.port.info())
    hello = message.hello()
    echo = message.echo(7)
    message.write(0, 0x1E)
    message.write(0x80, 0x55)
    wait = message.wait("100us")
    read = message.read(1)
    far = message.read(0x80)
    reads = message.reads(1, 3)
    sample = message.sample()
    pin = message.getpin("x.HI")
    now = message.now()
    sync = message.sync()
    claim = message.claim()
    assert not message.done
    pair.exchange(message)
    assert message.done
    assert hello.value == pair.port.info()
    assert echo.value == 7
    assert wait.value == Ready(True, 17 * US)
    assert read.value == 0x12
    assert far.value == 0x82
    assert reads.value == b"\x14\x15\x16"
    assert sample.value == Sample(0x84, 1)
    assert pin.value == 1
    assert now.value == 22 * US
    assert sync.value == Sync(1, None)
    assert claim.value is None


def test_calls_without_a_result_arrive_as_they_were_meant(pair: Pair) -> None:
    message = Message(pair.port.info())
    message.select(2)
    message.writes(1, b"\x01\x02")
    message.lines({"/RD": 0, "x./CS": 0, 3: 1})
    message.drive(0x55)
    message.release()
    message.pin("x./RST", 0)
    message.pin(2, None)
    message.delay("1.5us")
    message.at(100 * US)
    message.events("y.HI", 0)
    message.events()
    message.unclaim()
    pair.exchange(message)
    assert pair.port.calls == [
        ("select", 2), ("write", 1, 1), ("write", 1, 2), ("lines", 0b1101, 0b1000),
        ("drive", 0x55), ("release",), ("pin", 0, 0), ("pin", 2, 2), ("delay", 1_500_000),
        ("at", 100 * US), ("events", 3), ("events", 0), ("unclaim",),
    ]  # fmt: skip


def test_sync_tells_until_when_nothing_moves(pair: Pair) -> None:
    message = Message()
    sync = message.sync()
    pair.exchange(message)
    assert sync.value == Sync(0, 5 * US)


def test_the_chips_a_message_needs_are_selected_in_front_of_it(pair: Pair) -> None:
    for mask in (1, 2, 2, 3):
        message = Message()
        message.write(1, 0xAA)
        pair.exchange(message, mask)
    select = [call for call in pair.port.calls if call[0] == "select"]
    assert select == [("select", 2), ("select", 3)]


def test_after_a_refused_select_the_chips_are_selected_again(pair: Pair) -> None:
    message = Message()
    message.select(8)
    pair.exchange(message)
    assert pair.wire.selected is None
    with pytest.raises(ProtocolError, match=r"^SELECT \(request 0\) was refused: no such line"):
        pair.wire.raise_refusal()
    pair.exchange(Message(), 1)
    assert pair.port.calls == [("select", 1)]


def test_a_refused_read_raises_where_its_value_is_asked_for(pair: Pair) -> None:
    message = Message()
    message.write(1, 0)
    refused = message.read(0xEE)
    fine = message.read(0)
    pair.exchange(message)
    assert fine.value == 1
    with pytest.raises(
        ProtocolError,
        match=r"^READ \(request 1\) was refused: no such line, pin, chip or address$",
    ):
        _ = refused.value


def test_a_refused_write_is_named(pair: Pair) -> None:
    message = Message()
    message.write(0xEE, 0)
    fine = message.read(0)
    pair.exchange(message)
    assert fine.value == 1
    with pytest.raises(ProtocolError, match=r"^WRITE \(request 0\) was refused: no such line"):
        pair.wire.raise_refusal()
    pair.wire.raise_refusal()


def test_after_a_fatal_refusal_nothing_is_sent_any_more(pair: Pair) -> None:
    pair.board.receive(b"\xff")
    message = Message()
    read = message.read(0)
    pair.exchange(message)
    for ask in (lambda: read.value, lambda: pair.wire.send(Message())):
        with pytest.raises(ProtocolError, match=r"\(request 0\) was refused: unknown request$"):
            ask()


def test_bytes_that_are_no_reply_end_the_session(pair: Pair) -> None:
    message = Message()
    read = message.read(0)
    pair.wire.send(message)
    pair.wire.feed(b"error: unknown request")
    with pytest.raises(
        ProtocolError,
        match=r"^byte 65 is no reply of the byte protocol; is it the board file's protocol",
    ):
        _ = read.value


@pytest.mark.parametrize("surprise", [b"T" + bytes(8), b"E\x01"])
def test_a_reply_to_something_else_ends_the_session(pair: Pair, surprise: bytes) -> None:
    message = Message()
    read = message.read(0)
    pair.wire.send(message)
    pair.wire.feed(surprise)
    with pytest.raises(ProtocolError, match=rf"^the board replied '{chr(surprise[0])}' to READ4$"):
        _ = read.value


def test_a_reply_to_nothing_ends_the_session(pair: Pair) -> None:
    pair.wire.feed(b"E\x01")
    with pytest.raises(ProtocolError, match=r"^the board replied 'E' to nothing$"):
        pair.wire.send(Message())


def test_a_board_of_version_1_is_spoken_to_as_ever(pair: Pair) -> None:
    message = Message()
    hello = message.hello()
    pair.wire.send(message)
    body = encode_hello(1, INFO)
    pair.wire.feed(b"V" + len(body).to_bytes(2, "big") + body)
    assert hello.value == INFO


def test_word_of_a_pause_may_stand_between_any_two_replies(pair: Pair) -> None:
    message = Message(pair.port.info())
    echoes = [message.echo(number) for number in range(3)]
    pair.wire.send(message)
    pair.wire.feed(b"E\x00H\x01E\x01H")
    assert pair.wire.paused
    pair.wire.feed(b"\x00E\x02")
    assert not pair.wire.paused
    assert [echo.value for echo in echoes] == [0, 1, 2]


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (encode_hello(3, INFO), "the board speaks version 3; this client speaks 1"),
        (b"\x81\xa7version\x01", "HELLO's answer cannot be read: "),
    ],
)
def test_a_hello_that_cannot_be_used_is_refused(pair: Pair, body: bytes, reason: str) -> None:
    message = Message()
    hello = message.hello()
    pair.wire.send(message)
    reply = b"V" + len(body).to_bytes(2, "big") + body
    pair.wire.feed(reply[:-1])
    assert not hello.done
    pair.wire.feed(reply[-1:])
    with pytest.raises(ProtocolError, match=f"^{reason}"):
        _ = hello.value


def test_a_value_that_is_not_here_yet_says_so(pair: Pair) -> None:
    read = Message().read(0)
    with pytest.raises(ValueError, match=r"^the reply to READ4 is not here yet; leave the batch"):
        _ = read.value


def test_events_are_kept_in_order_between_replies(pair: Pair) -> None:
    message = Message(pair.port.info())
    message.events("x.HI")
    message.write(0, 1)
    first = message.read(0)
    message.write(0, 1)
    pair.exchange(message)
    assert first.value == 1
    assert list(pair.wire.events) == [Event(1, US), Event(0, 3 * US)]


@pytest.mark.parametrize(("pin", "number"), [("x./RST", 0), ("HI", 2), (7, 7)])
def test_a_pin_goes_by_number_full_name_or_short_name(pin: int | str, number: int) -> None:
    message = Message(INFO)
    message.pin(pin, 1)
    assert message.data == bytes((0x44, number, 1))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.pin("/RST", 0), "'/RST' stands for several of the pins x./RST, y./RST, x.HI"),
        (lambda m: m.pin("/CS", 0), "'/CS' is none of the pins x./RST, y./RST, x.HI"),
        (lambda m: m.events("HI"), "'HI' is none of the outputs (there are none)"),
        (lambda m: m.pin(0, 3), "pin 0 = 3: allowed are 0, 1 and None to let go"),
        (lambda m: m.lines({"/RD": 2}), "line '/RD' = 2: allowed are 0 and 1"),
        (lambda m: m.reads(0, 0), "count = 0: allowed are 1 to 255"),
        (lambda m: m.reads(0, 256), "count = 256: allowed are 1 to 255"),
        (lambda m: m.writes(0, b""), "0 bytes: allowed are 1 to 255"),
        (lambda m: m.read(-1), "a = -1: allowed are 0 to 255"),
        (lambda m: m.write(256, 0), "a = 256: allowed are 0 to 255"),
        (lambda m: m.write(0, 256), "d = 256: allowed are 0 to 255"),
        (
            lambda m: m.delay("soon"),
            "'soon' is no duration; write a number with ps, ns, us, ms or s",
        ),
    ],
)
def test_an_argument_that_does_not_fit_is_named_with_what_is_allowed(
    call: object, message: str
) -> None:
    built = Message(INFO)
    with pytest.raises(ValueError, match=r".") as caught:
        call(built)  # type: ignore[operator]
    assert str(caught.value) == message
    assert built.data == b""
    assert built.requests == []


def test_names_need_a_hello() -> None:
    with pytest.raises(ValueError, match=r"^'/RST': names are known after hello; until then use"):
        Message().pin("/RST", 0)


@given(cuts, st.integers(1, 20))
def test_replies_may_come_in_any_pieces(sizes: list[int], count: int) -> None:
    pair = Pair()
    message = Message()
    reads = [message.reads(1, 1 + turn) for turn in range(count)]
    now = message.now()
    pair.board.receive(pair.wire.send(message))
    for piece in pieces(pair.board.take(), sizes):
        pair.wire.feed(piece)
    assert [len(read.value) for read in reads] == list(range(1, count + 1))
    assert now.value == sum(range(1, count + 1)) * US


def test_the_next_poll_is_answered_from_the_lease_that_came_with_a_read(pair: Pair) -> None:
    pair.wire.cycles = [US]
    message = Message(pair.port.info())
    message.leases(True)
    pair.exchange(message)
    asked, known = Message(), Message()
    read, poll = asked.read(0), known.read(0)
    pair.exchange(asked)
    assert pair.wire.known(known, None) == b""
    assert poll.value == read.value


def test_stamped_polls_are_one_run_as_long_as_no_stamp_goes_back() -> None:
    lease = Lease(0, 0x80, now=0, until=100 * US, cycle=US)
    lease.stamps = True
    for stamp in (2 * US, 5 * US):
        assert lease.takes(stamp)
        lease.at(stamp)
        assert lease.poll(0)
        assert lease.stamp == -1
    assert lease.run == [2 * US, 5 * US]
    assert not lease.takes(4 * US)


def test_a_message_with_a_request_behind_a_stamp_is_not_only_a_stamp() -> None:
    message = Message()
    message.at(US)
    assert message.only_stamp
    message.write(0, 1)
    assert not message.only_stamp
