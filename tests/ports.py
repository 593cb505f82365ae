"""Where somebody is to listen, when a test has to say so beforehand."""

import itertools
import os
import socket
from typing import Final

_FIRST: Final = 23_000  # above all that pages of the documentation use
_COUNT: Final = 9_728  # below the ports that the system gives to whoever connects
_WORKERS: Final = 16
_tries = itertools.count(os.getpid() * 7)


def free_endpoint(protocol: str = "tcp") -> str:
    """Return an endpoint that no other test is given, on a port that is free now."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % _WORKERS
    for number in _tries:
        port = _FIRST + (number * _WORKERS + worker) % _COUNT
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return f"{protocol}/127.0.0.1:{port}"
    raise AssertionError
