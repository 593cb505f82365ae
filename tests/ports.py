"""Where somebody is to listen, when a test has to say so beforehand."""

import itertools
import os
import socket
from typing import Final

_FIRST: Final = 23_000  # above all that pages of the documentation use
_COUNT: Final = 9_728  # below the ports that the system gives to whoever connects
_tries = itertools.count(os.getpid() * 7)
_taken: Final[list[socket.socket]] = []
"""Marks of the ports that this process was given."""


def free_endpoint(protocol: str = "tcp") -> str:
    """Return an endpoint that no other test is given, of any run, on a port that is free now."""
    for number in _tries:
        port = _FIRST + number % _COUNT
        mark = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            try:
                mark.bind(f"\0vbus tests: port {port}")  # the system forgets it with this process
                probe.bind(("127.0.0.1", port))
            except OSError:
                mark.close()
                continue
        _taken.append(mark)
        return f"{protocol}/127.0.0.1:{port}"
    raise AssertionError
