"""Fixtures of the client tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.client.served import Served
from vbus.client import Bus, connect


@pytest.fixture(params=["pty", "unix", "tcp"])
def served(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Served]:
    with Served(request.param, tmp_path) as board:
        yield board


@pytest.fixture
def pty_served(tmp_path: Path) -> Iterator[Served]:
    with Served("pty", tmp_path) as board:
        yield board


@pytest.fixture
def bus(pty_served: Served) -> Iterator[Bus]:
    with connect(pty_served.where) as bus:
        yield bus
