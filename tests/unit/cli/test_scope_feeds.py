"""What a page of the scope hears of several boards, or nodes of one."""

from types import SimpleNamespace
from typing import Any

import pytest

from vbus.cli.look import scope_feeds
from vbus.cli.look.scope_feeds import Feeds


def test_a_node_is_waited_for_no_longer_when_the_page_is_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []

    def feed(board: str) -> Any:
        asked.append(board)
        return SimpleNamespace(hello={"node": board}, close=lambda: None)

    monkeypatch.setattr(scope_feeds, "LOOK_SECONDS", 0)
    monkeypatch.setattr(scope_feeds, "Feed", feed)
    monkeypatch.setattr(scope_feeds, "_begun", lambda *_: {})
    monkeypatch.setattr(scope_feeds, "Merged", lambda _: SimpleNamespace(description={}))
    feeds = Feeds(["left", "right"])
    feeds.close()
    assert feeds._back(0, pytest.fail) is None
    assert asked == ["left", "right"]
