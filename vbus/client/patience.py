"""Waiting for a board that is still to come."""

from pathlib import Path
from typing import Final

from vbus.kernel.kernel import SECOND
from vbus.protocols.quantities import parse_duration
from vbus.runtime import expanded, lock_state
from vbus.wall_clock import monotonic

PAUSE_SECONDS: Final = 0.02
"""Between two attempts."""
START_SECONDS: Final = 5.0
"""How long a board that has begun to start may take."""


class RetryPolicy:
    """How long to go on trying to open a link.

    Args:
        where: the link.
        wait: how long, such as ``"5 s"``; None to wait for a board that has begun to start.

    Raises:
        ValueError: ``wait`` is no duration.
    """

    def __init__(self, where: str, wait: str | None) -> None:
        self._where: str = where
        self._asked: bool = wait is not None
        seconds = START_SECONDS if wait is None else parse_duration(wait) / SECOND
        self._end: float = monotonic() + seconds

    def left(self) -> bool:
        """Tell whether to try again."""
        return monotonic() < self._end and (self._asked or starting(self._where))


def starting(where: str) -> bool:
    """Tell whether a process has taken the name of a link that is not there yet."""
    kind, _, path = where.rpartition(":")
    name = Path(expanded(path))
    if kind not in ("", "pty", "unix") or name.exists():
        return False
    try:
        held, _ = lock_state(name)
    except OSError:
        return False
    return held
