"""The byte protocol inside frames."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.fake_port import FakePort
from tests.unit.protocols.grammar import cuts, pieces, requests
from vbus.core.kernel import US
from vbus.protocols.framed import FramedProtocol
from vbus.protocols.frames import MARK, FrameReader, frame, frames


@pytest.fixture
def wire(port: FakePort) -> FramedProtocol:
    return FramedProtocol(port)


def say(wire: FramedProtocol, data: bytes) -> list[tuple[int, str]]:
    """Send bytes; return the frames that come back."""
    wire.receive(data)
    return unpack(wire.take())


def unpack(data: bytes) -> list[tuple[int, str]]:
    reader = FrameReader()
    reader.feed(data)
    found = []
    while (one := reader.next()) is not None:
        found.append((one[0], one[1].hex()))
    return found


def test_a_frame_has_the_bytes_the_protocol_says() -> None:
    # CRC-16 with polynomial 1021H and start value FFFFH of "123456789" is 29B1H.
    assert frame(0x31, b"")[:3] == b"\xa5\x31\x00"
    payload = b"456789:;<" * 6
    body = bytes((0x32, len(payload))) + payload
    crc = 0xFFFF
    for byte in body:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    assert frame(0x32, payload) == b"\xa5" + body + crc.to_bytes(2, "big")


def test_a_payload_too_long_for_a_frame_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^256 bytes; a frame carries at most 255$"):
        frame(0, b"\0" * 256)


def test_every_frame_is_answered_with_its_own_number(wire: FramedProtocol) -> None:
    assert say(wire, frame(5, b"\x10\x02\x07")) == [(5, "44014507")]


def test_a_frame_of_writes_is_answered_by_an_empty_one(wire: FramedProtocol) -> None:
    assert say(wire, frame(5, b"\x20\xaa")) == [(5, "")]


def test_a_long_answer_runs_on_over_several_frames(wire: FramedProtocol) -> None:
    answer = say(wire, frame(5, b"\x32\x00\xff"))
    assert [(number, len(text) // 2) for number, text in answer] == [(5, 255), (5, 2)]


def test_a_repeated_frame_is_answered_again_but_not_carried_out_again(
    wire: FramedProtocol, port: FakePort
) -> None:
    request = frame(5, b"\x20\xaa\x10")
    assert say(wire, request) == say(wire, request) == [(5, "4401")]
    assert port.calls == [("write", 0, 0xAA), ("read", 0)]
    assert say(wire, frame(6, b"\x10")) == [(6, "4402")]


def test_a_damaged_frame_is_not_answered_and_the_next_one_is(
    wire: FramedProtocol, port: FakePort
) -> None:
    damaged = bytearray(frame(5, b"\x20\xaa"))
    damaged[4] ^= 1
    assert say(wire, bytes(damaged)) == []
    assert port.calls == []
    assert say(wire, frame(5, b"\x20\xaa")) == [(5, "")]


def test_a_good_frame_is_found_inside_what_a_false_mark_seems_to_span(
    wire: FramedProtocol,
) -> None:
    good = frame(5, b"\x02\x07")
    assert say(wire, bytes((MARK, 0, len(good) - 2)) + good + b"\0" * 10) == [(5, "4507")]


def test_260_zeros_end_any_frame_that_lost_its_end(wire: FramedProtocol) -> None:
    assert say(wire, bytes((MARK, 5, 255))) == []
    assert say(wire, b"\0" * 260 + frame(5, b"\x10")) == [(5, "4401")]


def test_an_empty_frame_starts_a_new_session(wire: FramedProtocol, port: FakePort) -> None:
    assert say(wire, frame(0, b"\x30\xee")) == [(0, "58020000")]
    assert say(wire, frame(0, b"")) == [(0, "")]
    assert port.calls == [("events", 0), ("unclaim",), ("select", 1)]
    assert say(wire, frame(0, b"\x20\x00\x30\xee")) == [(0, "58020001")]


@pytest.mark.parametrize(
    ("payload", "answer"),
    [
        (b"\xff\x10", "5801000058010000"),
        (b"\x02", "58040000"),
        (b"\x02\x07\x33\x00\x05\x01", "450758040001"),
        (b"\x32\x00\x00", "58040000"),
    ],
)
def test_a_refusal_ends_with_its_frame(wire: FramedProtocol, payload: bytes, answer: str) -> None:
    assert say(wire, frame(1, payload) + frame(2, b"\x02\x07")) == [(1, answer), (2, "4507")]


def test_a_frame_that_has_to_wait_is_answered_when_it_may_go_on(
    wire: FramedProtocol, port: FakePort
) -> None:
    port.limit = 0
    waiting = b"\x50" + US.to_bytes(8, "big") + b"\x10"
    assert say(wire, frame(1, waiting) + frame(2, b"\x02\x07")) == []
    assert say(wire, frame(3, b"\x02\x08")) == []
    port.limit = US
    assert port.go_on()
    wire.resume()
    assert unpack(wire.take()) == [(1, "4401"), (2, "4507"), (3, "4508")]


def test_events_between_requests_come_in_frames_of_their_own(
    wire: FramedProtocol, port: FakePort
) -> None:
    say(wire, frame(7, b"\x60\0\0\0\x03"))
    port.edge(2)
    wire.report_events()
    assert unpack(wire.take()) == [(0x87, "49000000020000000000000000")]
    assert say(wire, frame(0x85, b"\x10")) == []


def test_a_session_that_begins_anew_forgets_half_a_frame_and_the_last_answer(
    wire: FramedProtocol, port: FakePort
) -> None:
    say(wire, frame(5, b"\x10") + bytes((MARK, 5)))
    wire.reset()
    assert say(wire, frame(5, b"\x10")) == [(5, "4402")]


garbage = st.binary(max_size=20).map(lambda data: data.replace(b"\xa5", b""))
messages = st.lists(requests, min_size=1, max_size=4).map(b"".join).filter(lambda m: len(m) < 256)


@given(st.lists(st.tuples(garbage, messages), max_size=5), cuts)
def test_answers_depend_neither_on_cuts_nor_on_garbage_between_frames(
    parts: list[tuple[bytes, bytes]], sizes: list[int]
) -> None:
    noisy = b"".join(
        noise + frame(number, message) for number, (noise, message) in enumerate(parts)
    )
    clean = b"".join(frame(number, message) for number, (_, message) in enumerate(parts))
    answers = []
    for stream in (pieces(noisy, sizes), [clean]):
        wire = FramedProtocol(FakePort())
        for piece in stream:
            wire.receive(piece)
        answers.append(wire.take())
    assert answers[0] == answers[1]


@given(st.binary(max_size=400), cuts)
def test_a_good_frame_is_found_behind_any_garbage(noise: bytes, sizes: list[int]) -> None:
    wire = FramedProtocol(FakePort())
    for piece in pieces(noise, sizes):
        wire.receive(piece)
    wire.receive(b"\0" * 260)
    wire.take()
    wire.receive(frame(0x7F, b"\x02\x07"))
    assert wire.take().endswith(frames(0x7F, b"E\x07"))
