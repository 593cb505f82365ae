"""Hosts over Zenoh that read no reply: ``pytest tests/zenoh/deaf_hosts.py``, by hand.

Not among what pytest collects: after other tests of one process, on a busy machine, Zenoh at times
answers the host's first query of these no more, and the test waits in vain; by itself it passes.
"""

import os
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
from tests.waiting import until
from tests.zenoh.test_bus import board
from tests.zenoh.test_faults import endpoint_of
from vbus import connect
from vbus.network import session
from vbus.serve.server import LinkSpec, Server
from vbus.transports import zenoh_host
from vbus.transports.zenoh_host import ZenohLink as BoardLink
from vbus.transports.zenoh_host import send_reply

ROOT = Path(__file__).parents[2]


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
            assert process.stdout.readline() == "sent\n"
            yield process
        finally:
            process.kill()


def test_a_host_that_reads_no_posted_reply_holds_nobody_up_and_loses_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What blocks does so for two minutes here, which is longer than any wait of this test."""
    settings = session._settings

    def patient(*given: Any) -> dict[str, Any]:
        block = "transport/link/tx/queue/congestion_control/block/wait_before_close"
        return {**settings(*given), block: 130_000_000}

    monkeypatch.setattr(session, "_settings", patient)
    with (
        served(board(), LinkSpec("zenoh:")) as server,
        deaf_host(endpoint_of(server.urls[0]), "posts") as deaf,
    ):
        until(lambda: following(server) > MESSAGES, "the end of all messages")
        with connect(server.urls[0]) as bus:
            assert [bus.echo(byte) for byte in range(100)] == list(range(100))
        out, _ = deaf.communicate("hear\n", timeout=60)
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
        served(board(), LinkSpec("zenoh:")) as server,
        deaf_host(endpoint_of(server.urls[0]), "queries"),
    ):
        until(lambda: following(server) > MESSAGES, "the end of all messages")
        with connect(server.urls[0]) as bus:
            assert [bus.echo(byte) for byte in range(100)] == list(range(100))
    assert len(senders) == 2
    assert min(senders.values()) <= zenoh_host.DIRECT < max(senders.values())


def following(server: Server) -> int:
    """Return how many messages the first host's session has carried out."""
    link = next(server.sessions()).link
    assert isinstance(link, BoardLink)
    return link.exchange.following
