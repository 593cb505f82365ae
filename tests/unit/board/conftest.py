"""Fixtures of the board-file tests."""

from collections.abc import Iterator

import pytest

from tests.unit.board import parts
from vbus import plugins


@pytest.fixture
def acme(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make the invented parts the only ones that are registered."""
    monkeypatch.setattr(plugins, "entry_points", parts.entry_points)
    plugins._entries.cache_clear()
    yield
    plugins._entries.cache_clear()
