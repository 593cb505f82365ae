"""Hosts over Zenoh that read no reply: they hold up no other host, nor a board that closes."""

import os
import select
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.e2e.serving import served
from tests.waiting import PATIENCE, Starved, until
from tests.zenoh.test_bus import board
from tests.zenoh.test_faults import endpoint_of
from vbus import connect
from vbus.network import envelope
from vbus.network.session import Network
from vbus.serve.server import LinkSpec, Server
from vbus.transports import zenoh_host
from vbus.transports.traffic import Traffic
from vbus.transports.zenoh_host import ZenohLink as BoardLink
from vbus.transports.zenoh_host import send_reply

ROOT = Path(__file__).parents[2]


@pytest.fixture
def lease() -> None:
    """Have a host that does not read given up as soon as by any board."""


MESSAGES = 90
"""Their replies are 13 MB: more than the system and Zenoh take for a host that does not read."""


@contextmanager
def deaf_host(endpoint: str, how: str) -> Iterator[subprocess.Popen[str]]:
    """A host that has sent its messages, and hears none of their replies."""
    program = Path(__file__).with_name("deaf_host.py")
    with subprocess.Popen(
        [sys.executable, program, endpoint, how, str(MESSAGES)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            if not select.select([process.stdout], [], [], PATIENCE)[0]:
                raise Starved("the host has not sent its messages")
            assert process.stdout.readline() == "sent\n"
            yield process
        finally:
            process.kill()


def entry() -> LinkSpec:
    """Serve hosts that Zenoh has cut off for a while: a busy machine does so to a deaf one."""
    return LinkSpec("zenoh:", network=Network(grace_seconds=2 * PATIENCE))


def test_a_host_that_reads_no_posted_reply_holds_no_host_up_and_loses_no_reply() -> None:
    with (
        served(board(), entry()) as server,
        deaf_host(endpoint_of(server.urls[0]), "posts") as deaf,
    ):
        until(lambda: following(server) > MESSAGES, "the end of all messages")
        with connect(server.urls[0], timeout=PATIENCE) as bus:
            assert [bus.echo(byte) for byte in range(100)] == list(range(100))
        out, _ = deaf.communicate("hear\n", timeout=PATIENCE)
        assert out == f"{16384 * 9}\n"


def test_replies_to_queries_of_a_host_that_reads_none_are_sent_by_a_thread_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A query may ask for replies that block: until the host's link is given up, after a lease."""
    senders: dict[int, int] = {}

    def noted(query: zenoh.Query, data: bytes, *given: Any, **named: Any) -> None:
        thread = threading.get_ident()
        senders[thread] = max(senders.get(thread, 0), len(data))
        send_reply(query, data, *given, **named)

    monkeypatch.setattr(zenoh_host, "send_reply", noted)
    with (
        served(board(), entry()) as server,
        deaf_host(endpoint_of(server.urls[0]), "queries"),
    ):
        until(lambda: following(server) > MESSAGES, "the end of all messages")
        with connect(server.urls[0], timeout=PATIENCE) as bus:
            assert [bus.echo(byte) for byte in range(100)] == list(range(100))
    assert len(senders) == 2
    assert min(senders.values()) <= zenoh_host.DIRECT < max(senders.values())


def following(server: Server) -> int:
    """Return how many messages the first host's session has carried out."""
    link = next(server.sessions()).link
    assert isinstance(link, BoardLink)
    return link.exchange.following


class DeafQuery:
    """A query whose host takes no reply until a test lets it."""

    def __init__(self, hears: threading.Event, log: list[tuple[str, int]]) -> None:
        self.key_expr: str = "x"
        self._hears: threading.Event = hears
        self._log: list[tuple[str, int]] = log

    def reply(self, key: str, data: bytes, attachment: bytes | None) -> None:
        self._log.append(("reply", threading.get_ident()))
        self._hears.wait(PATIENCE)

    def reply_err(self, text: str, encoding: str) -> None:
        self._log.append((text.partition(" ")[0], threading.get_ident()))

    def drop(self) -> None:
        pass


def test_a_link_that_closes_drops_replies_that_wait_and_settles_when_none_blocks() -> None:
    hears, log = threading.Event(), list[tuple[str, int]]()
    link = BoardLink(Any, "b", "s", (), Traffic(), lambda link: None, posts=False)  # type: ignore[arg-type]
    link.on_data = lambda data: link.answer(bytes(2 * zenoh_host.DIRECT))
    for number in (0, 1, 2, 1000):
        header = envelope.Envelope(envelope.REQUESTS, bytes(16), number, 0)
        link.take(DeafQuery(hears, log), header, b"")  # type: ignore[arg-type]
    until(lambda: log, "the first reply")
    link.close()
    settling = threading.Thread(target=link.settle)
    settling.start()
    assert settling.is_alive()
    hears.set()
    settling.join(PATIENCE)
    assert not settling.is_alive()
    assert [name for name, _ in log] == ["reply"]
    assert threading.get_ident() not in [thread for _, thread in log]


def test_events_that_have_waited_are_one_message() -> None:
    """Of four at once Zenoh has dropped two, on a machine that let its threads wait."""
    heard = threading.Event()
    heard.set()
    log: list[tuple[str, int]] = []
    link = BoardLink(Any, "b", "s", (), Traffic(), lambda link: None, posts=False)  # type: ignore[arg-type]
    for number in range(4):
        link.push(bytes([number]))
    link.hear(DeafQuery(heard, log), 0)  # type: ignore[arg-type]
    assert [name for name, _ in log] == ["reply"]
