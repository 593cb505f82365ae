"""Messages after the first one are samples, where the board takes them; and each counts once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.e2e.serving import served
from tests.ports import free_endpoint
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import session_at
from tests.zenoh.test_bus import Cycles, board
from tests.zenoh.test_faults import BUS, Raw, endpoint_of
from tests.zenoh.test_security import files
from vbus.client.zenoh_link import Sent, ZenohBoardLink, open_zenoh
from vbus.core.errors import TransportError
from vbus.network import envelope, keys
from vbus.network.exchange import Exchange
from vbus.network.session import close_session, open_session
from vbus.serve.server import LinkSpec

__all__ = ["files"]
REPEAT = "vbus.client.zenoh_link.REPEAT_SECONDS"
ROOT = Path(__file__).parents[2]
POSTED = keys.requests(keys.host(BUS, "*"))


@pytest.fixture(autouse=True)
def _no_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have messages repeated when a test says so, and not because a busy machine is late."""
    monkeypatch.setattr(REPEAT, PATIENCE)


class FakeBoard:
    """Answers with what it is sent, turned round; loses what a test says.

    Args:
        attachment: goes with its replies to queries.
        deaf: it does not hear what is posted.
        mute: replies to posted messages are lost.
    """

    def __init__(self, attachment: bytes | None, deaf: bool = False, mute: bool = False) -> None:
        self.endpoint = free_endpoint()
        self.session = open_session(listen=[self.endpoint], mode="router")
        self.asked: list[int] = []
        self.posted: list[int] = []
        self.carried_out: list[bytes] = []
        self.deaf, self.mute, self.attachment = deaf, mute, attachment
        self.exchange = Exchange(self.carry_out)
        self.session.declare_queryable(BUS, self.ask, complete=True)
        self.session.declare_subscriber(POSTED, self.post)

    def carry_out(self, data: bytes) -> None:
        self.carried_out.append(data)
        self.exchange.done(data[::-1])

    def ask(self, query: zenoh.Query) -> None:
        assert query.attachment is not None
        assert query.payload is not None
        header = envelope.unpack(query.attachment.to_bytes())
        if header.kind == envelope.END:
            query.reply(BUS, b"")
            return
        self.asked.append(header.number)
        self.take(
            header,
            query.payload.to_bytes(),
            lambda data: query.reply(BUS, data, attachment=self.attachment),
        )
        query.drop()

    def post(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        header = envelope.unpack(sample.attachment.to_bytes())
        self.posted.append(header.number)
        if not self.deaf:
            token = str(sample.key_expr).removesuffix("/requests")
            number = envelope.reply_to(header.number)
            self.take(
                header,
                sample.payload.to_bytes(),
                lambda data: (
                    self.session.put(keys.replies(token), data, attachment=number)
                    if not self.mute
                    else None
                ),
            )

    def take(self, header: Any, data: bytes, answer: Callable[[bytes], None]) -> None:
        self.exchange.take(header.number, header.acknowledged, data, answer, lambda *_: None)


@contextmanager
def fake(*how: Any, **more: Any) -> Iterator[tuple[FakeBoard, ZenohBoardLink]]:
    there = FakeBoard(*how, **more)
    host = open_zenoh(f"bench/x?connect={there.endpoint}")
    try:
        yield there, host
    finally:
        host.close()
        close_session(there.session)


def trip(host: ZenohBoardLink, data: bytes, repeated: Callable[[], object] | None = None) -> bytes:
    """Send a message and return its reply, which is as long; it is repeated once, when ``repeated``
    says that it has come to nothing."""
    assert host.write(memoryview(data)) == len(data)
    if repeated is not None:
        until(repeated, "the message")
        with pytest.MonkeyPatch.context() as late:
            late.setattr(REPEAT, 0.0)
            assert host.read() == b""
    got = bytearray()

    def whole() -> bool:
        got.extend(host.read())
        return len(got) >= len(data)

    until(whole, "a reply")
    return bytes(got)


def test_only_the_first_message_of_a_session_is_a_query() -> None:
    made, cycles = board(), Cycles()
    made.observe(cycles)
    with served(made, LinkSpec("zenoh:")) as server:
        endpoint = endpoint_of(server.urls[0])
        listener = session_at(endpoint)
        posted: list[str] = []
        listener.declare_subscriber(POSTED, lambda sample: posted.append(str(sample.key_expr)))
        host = open_zenoh(f"bench/x?connect={endpoint}")
        assert trip(host, b"\x02\x01") == b"E\x01"
        assert posted == []
        assert trip(host, b"\x21\x55\x10\x10")[:1] == b"D"
        assert trip(host, b"\x02\x02") == b"E\x02"
        until(lambda: len(posted) == 2, "what was posted")
        host.close()
        close_session(listener)

    assert [cycle[2:4] for cycle in cycles.seen] == [(True, 1), (False, 0), (False, 0)]


def test_a_board_that_does_not_say_so_is_sent_queries_only() -> None:
    with fake(None) as (there, host):
        for text in (b"abc", b"def", b"ghi"):
            assert trip(host, text) == text[::-1]

    assert (there.asked, there.posted) == ([0, 1, 2], [])


def test_where_what_is_posted_does_not_arrive_queries_go_on() -> None:
    with fake(envelope.POSTS, deaf=True) as (there, host):
        assert trip(host, b"abc") == b"cba"
        assert trip(host, b"def", lambda: there.posted) == b"fed"
        for text in (b"ghi", b"jkl"):
            assert trip(host, text) == text[::-1]

    assert there.carried_out == [b"abc", b"def", b"ghi", b"jkl"]
    assert (there.asked, there.posted) == ([0, 1, 2, 3], [1])


def test_a_posted_message_whose_reply_is_lost_is_repeated_and_carried_out_once() -> None:
    with fake(envelope.POSTS) as (there, host):
        assert trip(host, b"abc") == b"cba"
        assert trip(host, b"def") == b"fed"
        there.mute = True
        assert trip(host, b"ghi", lambda: len(there.carried_out) == 3) == b"ihg"
        there.mute = False
        # One that was lost is no reason to ask again each time.
        assert trip(host, b"jkl") == b"lkj"

    assert there.carried_out == [b"abc", b"def", b"ghi", b"jkl"]
    assert (there.asked, there.posted) == ([0, 2], [1, 2, 3])


def test_a_host_that_looks_late_asks_again_before_it_gives_a_board_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with fake(None) as (there, host):
        monkeypatch.setattr(there, "take", lambda *_: None)
        host.write(memoryview(b"abc"))
        until(lambda: host._under_way[0].silent_since, "the end of the first sending")
        host._under_way[0].silent_since -= 3600
        assert host.read() == b""
        assert not host._searching
        until(lambda: host.read() == b"" and len(there.asked) > 1, "the second")


def test_only_the_end_of_the_last_sending_tells_that_nobody_answers() -> None:
    with fake(None) as (_, host):
        query = Sent(host, 5, b"abc")
        for sending in (1, 2):
            header = envelope.unpack(host._sending(query))
            assert (header.session, header.number) == (host._name, 5)
            query.ended(sending - 1)
            assert query.held
        query.ended(2)
        assert not query.held


def test_a_message_the_board_refuses_ends_the_link_with_its_reason() -> None:
    with served(board(), LinkSpec("zenoh:")) as server:
        endpoint = endpoint_of(server.urls[0])
        host = open_zenoh(f"bench/x?connect={endpoint}")
        trip(host, b"\x02\x01")
        trip(host, b"\x02\x02")
        host._number += 2 * envelope.WINDOW  # as a host that has lost count
        host._given = host._number
        host.write(memoryview(b"\x02\x03"))
        with pytest.raises(TransportError, match=r"refused by the board: message .*too far ahead"):
            until(lambda: host.read() and False, "a refusal")
        host.close()


@pytest.mark.parametrize(
    ("attachment", "payload"),
    [
        (None, b"\x21\x55"),
        (b"", b"\x21\x55"),
        (b"\x01" * 33, b"\x21\x55"),
        (envelope.Envelope(envelope.REQUESTS, bytes(16), 1, 0).pack(), b"\x21\x55"),
        ("own", b"\x21\x55" * envelope.LARGEST),
        ("end", b"\x21\x55"),
    ],
)
def test_what_is_no_message_of_the_session_is_not_carried_out(
    attachment: bytes | str | None, payload: bytes
) -> None:
    made, cycles = board(), Cycles()
    made.observe(cycles)
    with served(made, LinkSpec("zenoh:")) as server:
        host = Raw(endpoint_of(server.urls[0]))
        assert host.ask(b"\x02\x01", 0) == [b"E\x01"]
        kinds = {"own": envelope.REQUESTS, "end": envelope.END}
        if isinstance(attachment, str):
            attachment = envelope.Envelope(kinds[attachment], host.name, 1, 1).pack()
        where = keys.requests(keys.host(BUS, envelope.public(host.name)))
        host.session.put(where, payload, attachment=attachment)
        host.session.put(keys.requests(keys.host(BUS, "0" * 32)), payload, attachment=attachment)
        assert host.ask(b"\x02\x02", 1) == [b"E\x02"]
        host.close()

    assert cycles.seen == []
