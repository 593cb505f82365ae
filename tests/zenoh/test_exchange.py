"""Messages in any order, repeated at will, are carried out in order and once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.network import envelope
from vbus.network.exchange import MOST_STORED, Exchange

MOST = 12


@given(
    arrivals=st.lists(st.tuples(st.integers(0, MOST - 1), st.booleans()), max_size=60),
    finish_later=st.sets(st.integers(0, MOST - 1)),
)
def test_whatever_comes_each_message_is_carried_out_once_and_in_order(
    arrivals: list[tuple[int, bool]], finish_later: set[int]
) -> None:
    done: list[int] = []
    held: list[int] = []
    replies: list[tuple[int, bytes]] = []

    def carry_out(data: bytes) -> None:
        number = data[0]
        done.append(number)
        if number in finish_later:
            held.append(number)
        else:
            exchange.done(bytes([number, number]))

    def release() -> None:
        if held:
            number = held.pop()
            exchange.done(bytes([number, number]))

    exchange = Exchange(carry_out)
    for number, finish in arrivals:

        def answer(data: bytes, number: int = number) -> None:
            replies.append((number, data))

        exchange.take(number, 0, bytes([number]), answer, lambda *_: None)
        if finish:
            release()
    while held:
        release()

    came = {number for number, _ in arrivals}
    expected = [n for n in range(MOST) if all(before in came for before in range(n + 1))]
    assert done == expected
    assert {number for number, _ in replies} == set(expected)
    assert all(data == bytes([number, number]) for number, data in replies)


@given(
    st.one_of(
        st.binary(max_size=40),
        st.tuples(st.integers(0, 2), st.integers(0, 3), st.binary(min_size=32, max_size=32)).map(
            lambda parts: bytes(parts[:2]) + parts[2]
        ),
    )
)
def test_any_bytes_are_an_envelope_or_say_why_not(data: bytes) -> None:
    known = len(data) == 34 and data[0] == 1 and data[1] < 3
    if known:
        assert envelope.unpack(data).pack() == data
    else:
        with pytest.raises(envelope.EnvelopeError, match=r"envelope|kind"):
            envelope.unpack(data)


def test_what_waits_when_a_session_ends_is_refused() -> None:
    refused: list[tuple[str, str]] = []
    exchange = Exchange(lambda data: None)
    for number in (0, 2):
        exchange.take(number, 0, b"", lambda data: None, lambda *why: refused.append(why))
    exchange.end("gone", "the board has stopped")
    exchange.take(3, 0, b"", lambda data: None, lambda *why: refused.append(why))
    assert refused == [("gone", "the board has stopped")] * 3


def test_a_host_that_leaves_is_told_that_the_board_has_what_waits_for_its_turn() -> None:
    answered: list[tuple[int, bytes]] = []
    exchange = Exchange(lambda data: None)
    for number in (0, 1, 2, 4):
        exchange.take(
            number,
            0,
            bytes([number]),
            lambda data, n=number: answered.append((n, data)),
            lambda *_: None,
        )
    assert exchange.missing(5) == "message 3 has"
    assert exchange.missing(8) == "4 messages from 3 to 7 have"
    assert exchange.leave() == [b"\1", b"\2"]
    assert answered == [(0, b""), (1, b""), (2, b"")]
    assert exchange.following == 3


def test_the_oldest_replies_are_forgotten_when_they_are_too_many_bytes() -> None:
    exchange = Exchange(lambda data: exchange.done(bytes(MOST_STORED // 2)))
    replies: list[bytes] = []
    refused: list[str] = []
    for number in (0, 1, 2, 0, 2):
        exchange.take(number, 0, b"", replies.append, lambda _, why: refused.append(why))
    assert len(replies) == 4
    assert refused == ["message 0 has been carried out; its reply is no longer stored"]
    assert exchange.unacknowledged == MOST_STORED
    exchange.take(3, 3, b"", replies.append, lambda *_: None)
    assert exchange.unacknowledged == MOST_STORED // 2
