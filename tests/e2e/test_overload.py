"""A board on which more moves than the machine can follow says so, everywhere, with how much."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from tests.waiting import PATIENCE, until
from vbus.serve.registry import running

AXIS = """
[chips.x{0}]
part = "LM629N-8"
clock = "8 MHz"
plant = "m{0}"

[plants.m{0}]
model = "dc_motor"
"""
BOARD = """
[board]
name = "hurried"
rate = 200
power_on = "done"
stall = "STALL"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/hurried"
""" + "".join(AXIS.format(number) for number in range(4))
WAIT = b"\x34" + (5 * 10**9).to_bytes(8, "big")


def turn() -> bytes:
    """Return what makes every axis turn for ever, and an ECHO behind it."""
    out = b"\x03\xff\xff"
    for code, *words in ((0x1E, 0x000A, 300, 2000), (4,), (0x1F, 0x1828, 0, 1000, 1, 0), (1,)):
        out += WAIT + bytes((0x20, code))
        for word in words:
            out += WAIT + bytes((0x21, word >> 8, 0x21, word & 0xFF))
    return out + b"\x02\x77"


@pytest.mark.core("interpreted")
@pytest.mark.parametrize("stall", ["catch_up", "slip"])
def test_an_overload_is_told_on_stderr_once_by_ls_and_by_metrics(
    stall: str, tmp_path: Path, runtime: Path
) -> None:
    file = tmp_path / "hurried.toml"
    file.write_text(BOARD.replace("STALL", stall))
    errors = tmp_path / "errors"
    command = [sys.executable, "-m", "vbus", "run", "--metrics", "127.0.0.1:0", "--json", str(file)]
    with errors.open("w") as stderr:
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True)
    try:
        assert server.stdout is not None
        url = json.loads(server.stdout.readline())["metrics"]
        (resting,) = running()
        assert (resting["overload"], resting["worst_overload"]) == (0.0, 0.0)
        with socket.socket(socket.AF_UNIX) as host:
            host.settimeout(60)
            host.connect(os.fspath(runtime / "hurried"))
            host.sendall(turn())
            answer = b""
            while not answer.endswith(b"E\x77"):
                more = host.recv(4096)
                assert more, "the server has gone"
                answer += more
            until(lambda: next(running())["overload"] > 1, "an overload told by the board")
            until(lambda: "more moves than this machine" in errors.read_text(), "a line on stderr")
            until(lambda: "  overloaded: chip time runs at" in listed(), "a line of vbus ls")
            until(lambda: told(url) > 1, "a metric")
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(60)
        assert server.stdout is not None
        server.stdout.close()
    lines = [line for line in errors.read_text().splitlines() if "more moves" in line]
    assert len(lines) == 1
    assert re.match(
        r"vbus: board hurried: more moves than this machine can follow: chip time runs at \d+ % of"
        r" its rate at best, [\d.]+ times this machine would be enough; let less move, ",
        lines[0],
    )


def listed() -> str:
    command = [sys.executable, "-m", "vbus", "ls"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def told(url: str) -> float:
    """Return the metric."""
    with urllib.request.urlopen(url, timeout=PATIENCE) as answer:
        (value,) = re.findall(r'^vbus_overload_ratio\{board="hurried"\} (\S+)$',
                              answer.read().decode(), re.MULTILINE)  # fmt: skip
    return float(value)
