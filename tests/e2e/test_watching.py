"""Who watches a board is told what was left out, and nothing grows for whoever does not read."""

import json
import socket
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import toy_board
from tests.e2e.test_sessions import UNIX, connect
from vbus.server.registry import watch_path
from vbus.server.watching import MOST_WAVE, _BufferedText


def watch() -> socket.socket:
    link = socket.socket(socket.AF_UNIX)
    link.settimeout(60)
    link.connect(str(watch_path("bench")))
    return link


def test_lines_beyond_the_limit_are_counted_as_lost(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.server.watching.MOST_LINES", 5)
    with served(toy_board(), UNIX), watch() as link, link.makefile() as lines:
        assert json.loads(lines.readline())["board"] == "bench"
        assert json.loads(lines.readline())[0] == "t", "it watches"
        with connect(runtime / "x") as host:
            host.sendall(b"\x31\x01\x00" * 1000 + b"\x02\x01")  # one message: no line goes between
            assert host.recv(2) == b"E\x01"
        kinds = []
        while kinds[-1:] != ["lost"]:
            *_, last = line = json.loads(lines.readline())
            kinds.append(line[0])
    assert kinds.count("c") <= 10
    assert last + kinds.count("c") == 1000


def test_whoever_does_not_read_is_kept_no_more_than_that(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.server.watching.MOST_PENDING", 1000)
    monkeypatch.setattr("vbus.server.watching.MOST_LINES", 100)
    monkeypatch.setattr("vbus.server.watching.EVERY_SECONDS", 0.001)
    with served(toy_board(), UNIX) as server, watch(), connect(runtime / "x") as host:
        longest = 0
        for number in range(500):
            host.sendall(b"\x31\x01\x00" * 50 + bytes((0x02, number & 0xFF)))
            assert host.recv(2) == bytes((ord("E"), number & 0xFF))
            for connection in server.local_sockets[1].connections:
                longest = max(longest, len(connection.pending))
    assert longest < 1000 + 100 * 100, "one sending of 100 lines at most beyond the limit"


def test_a_waveform_that_nobody_reads_ends() -> None:
    buffer = bytearray(MOST_WAVE)
    text = _BufferedText(buffer)
    assert text.write("#1\n") == 3
    with pytest.raises(OSError, match="the other end does not read"):
        text.write("#2\n")
    assert len(buffer) == MOST_WAVE + 3
