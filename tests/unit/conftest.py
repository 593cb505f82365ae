"""The journal of a move."""

from tests.unit.trace.conftest import moved

__all__ = ["moved"]
