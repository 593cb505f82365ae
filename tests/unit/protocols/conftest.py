"""Fixtures of the protocol tests."""

import pytest

from tests.unit.fake_port import FakePort


@pytest.fixture
def port() -> FakePort:
    return FakePort()
