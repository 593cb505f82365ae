"""A board whose process has no descriptor left: nobody is stranded, and new hosts are told."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.e2e.test_pty import open_raw, read_exactly
from tests.waiting import until
from vbus import client
from vbus.core.errors import ProtocolError, TransportError
from vbus.serve.registry import ask, socket_path

ROOT = Path(__file__).parents[2]
LIMIT = 64
SERVED = f"""
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, ({LIMIT}, {LIMIT}))
from tests.e2e.test_pty import toy_board
from vbus.serve.server import LinkSpec, run

links = [
    LinkSpec("unix:$VBUS_RUNTIME/x", "byte"), LinkSpec("pty:$VBUS_RUNTIME/y", "byte"),
    LinkSpec("unix:$VBUS_RUNTIME/z", "text"), LinkSpec("rfc2217:0", "byte"),
]
run(toy_board(), links, on_ready=lambda server: print(server.urls[3], flush=True))
"""


@pytest.fixture
def server(runtime: Path, tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A board that may have 64 descriptors; what it says goes to the file ``said``."""
    with (
        (tmp_path / "said").open("wb") as said,
        subprocess.Popen(
            [sys.executable, "-c", SERVED], stdout=subprocess.PIPE, stderr=said, cwd=ROOT
        ) as process,
    ):
        yield process
        process.kill()


class Connected:
    """A host on a Unix socket."""

    def __init__(self, path: Path) -> None:
        self.link: socket.socket = socket.socket(socket.AF_UNIX)
        self.link.settimeout(60)
        self.link.connect(str(path))

    def ask(self, request: bytes, count: int) -> bytes:
        """Return so many bytes of the answer; fewer if the board hangs up."""
        if request:
            self.link.sendall(request)
        data = b""
        while len(data) < count and (more := self.link.recv(count - len(data))):
            data += more
        return data


def test_with_64_descriptors_50_hosts_are_served_or_told(
    server: subprocess.Popen[bytes], runtime: Path, tmp_path: Path
) -> None:
    assert server.stdout is not None
    url = server.stdout.readline().decode().strip()
    with ExitStack() as closing:
        served: list[Connected] = []
        told = 0
        for number in range(50):
            host = Connected(runtime / "x")
            closing.callback(host.link.close)
            answer = host.ask(bytes((0x02, number)), 2)
            if answer == bytes((ord("E"), number)):
                served.append(host)
            else:
                assert answer + host.ask(b"", 2) == b"X\x07\0\0", "the board can take no more"
                told += 1
        assert len(served) > 20
        assert told > 0

        # Whatever wants a descriptor is told so; nobody waits for one.
        with pytest.raises(ProtocolError, match=r"HELLO .* refused: the board can take no more ho"):
            client.connect(f"unix:{runtime}/x")
        text = Connected(runtime / "z")
        closing.callback(text.link.close)
        assert text.ask(b"now\n", 99) == b"error: the board can take no more hosts\n"
        with pytest.raises(TransportError, match="the board has no descriptor left for this"):
            ask(socket_path("bench"))
        host_name, port = url.removeprefix("rfc2217:").split(":")
        with socket.create_connection((host_name, int(port)), 60) as remote:
            remote.sendall(b"\x02\x01")
            assert remote.recv(100) in (b"X\x07\0\0", b"")

        # All that are there are answered, also while one of them has the bus and the others wait.
        assert served[0].ask(b"\x04", 2) == b"C\x01"
        for host in served[1:]:
            host.link.sendall(b"\x04")
        for _ in range(3):
            assert served[0].ask(b"\x02\x09", 2) == b"E\x09"
        for host in served[:-1]:
            host.link.close()
        assert served[-1].ask(b"", 2) == b"C\x01"
        served[-1].link.close()

        # What was given back is used again, and the terminal has outlived it all.
        for _ in range(2):
            fd = open_raw(runtime / "y")
            os.write(fd, b"\x02\x05")
            assert read_exactly(fd, 2) == b"E\x05"
            os.close(fd)
        again = Connected(runtime / "x")
        closing.callback(again.link.close)
        assert again.ask(b"\x02\x07", 2) == b"E\x07"
        until(lambda: ask(socket_path("bench"))["sessions"] == 1, "the others have gone")
    said = (tmp_path / "said").read_text()
    assert "Traceback" not in said
    assert f"unix:{runtime}/x: hosts are turned away: Too many open files" in said
