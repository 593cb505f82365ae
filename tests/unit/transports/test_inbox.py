"""What comes from Zenoh's threads is handled in the event loop."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from vbus.transports.zenoh_inbox import Inbox


def test_what_cannot_be_handled_is_refused_and_what_comes_next_is_handled(
    caplog: pytest.LogCaptureFixture,
) -> None:
    refused: list[str] = []
    handled: list[object] = []
    query = SimpleNamespace(
        reply_err=lambda text, encoding: refused.append(text), drop=lambda: None
    )
    sample, last = SimpleNamespace(), SimpleNamespace()

    def handle(item: Any) -> None:
        if item is not last:
            raise RuntimeError("a mistake")
        handled.append(item)

    inbox = Inbox()
    loop = asyncio.new_event_loop()
    inbox.open(loop)
    for item in (sample, query, last):
        inbox._put((handle, item))
    inbox._drain()
    inbox.close()
    inbox.close()
    loop.close()
    assert len(refused) == 1
    assert "internal error of the board" in refused[0]
    assert handled == [last]
    assert caplog.text.count("the board goes on") == 2
