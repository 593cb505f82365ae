"""The journal of a move."""

from tests.unit.views.conftest import moved

__all__ = ["moved"]
