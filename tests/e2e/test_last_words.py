"""What a host sends last, and waits for no answer to: it is carried out, on every transport."""

import fcntl
import hashlib
import io
import os
import socket
import subprocess
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
import serial

from tests.e2e.command import vbus
from tests.e2e.serving import served
from tests.e2e.test_pty import open_raw
from tests.left_out import require
from tests.waiting import until
from vbus import connect
from vbus.board.build import load_board_text
from vbus.board.config import read_board_text
from vbus.client.bus import Bus
from vbus.core.kernel import MS
from vbus.native import include_dir
from vbus.protocols.frames import frame
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.serve.in_process import InProcessLink
from vbus.serve.server import LinkSpec, Server
from vbus.testing.limits import Limits
from vbus.testing.programs import run_program
from vbus.testing.serving import ServedBoard

# pyserial starts its thread in a way that Python will drop.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")

RUNS = 10
BOARD = """
board.name = "bench"
board.time = "lockstep"
board.power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
"""
MOVE = (
    (0x1E, "0008 012C"), (0x04, ""),  # LFIL with kp, UDF
    (0x1F, "1828 0000 0028 0010 0000"), (0x01, ""),  # LTRJ: velocity mode, STT
)  # fmt: skip
"""Commands and their data: a velocity, for as long as time passes."""
LASTS = 300 * MS
GAP = 150 * 10**6
"""Longer than the chip is busy (ps)."""


def requests() -> list[tuple[bool, int]]:
    """Writes (address, byte), each with a pause behind it; then a long pause, and more."""
    found: list[tuple[bool, int]] = []
    for command, data in MOVE:
        found.append((False, command))
        found += [(True, byte) for byte in bytes.fromhex(data)]
    return found


def as_bytes() -> bytes:
    def delay(duration: int) -> bytes:
        return b"\x50" + duration.to_bytes(8, "big")

    moved = b"".join(bytes((0x20 + at, byte)) + delay(GAP) for at, byte in requests())
    return moved + delay(LASTS) + b"\x20\x01" + b"\x10" * 200 + delay(LASTS)


def as_text() -> bytes:
    moved = "".join(f"w {at:d} {byte:02x}\nstep {GAP}ps\n" for at, byte in requests())
    return (moved + f"step {LASTS}ps\nw 0 01\n" + "r 0\n" * 200 + f"step {LASTS}ps\n").encode()


def as_frames() -> bytes:
    data = as_bytes()
    pieces, start = [b""], 0
    while start < len(data):  # whole requests
        size = {0x50: 9, 0x10: 1}.get(data[start], 2)
        if len(pieces[-1]) + size > 60:
            pieces.append(b"")
        pieces[-1] += data[start : start + size]
        start += size
    return frame(0, b"") + b"".join(
        frame(number % 100 + 1, piece) for number, piece in enumerate(pieces)
    )


WIRES = {"byte": as_bytes, "text": as_text, "framed": as_frames}


def as_calls(bus: Bus) -> None:
    """Make the same calls, and wait for no answer."""
    for at, byte in requests():
        bus.write(at, byte)
        bus.delay(GAP)
    bus.delay(LASTS)
    bus.write(0, 1)
    bus.delay(LASTS)


def _send(fd: int, data: bytes) -> None:
    while data:
        data = data[os.write(fd, data) :]


def over_pty(url: str, data: bytes) -> None:
    fd = open_raw(Path(url.removeprefix("pty:")))
    _send(fd, data)
    os.close(fd)


def over_unix(url: str, data: bytes) -> None:
    with socket.socket(socket.AF_UNIX) as host:
        host.connect(url.removeprefix("unix:"))
        host.sendall(data)


def over_tcp(url: str, data: bytes) -> None:
    name, _, port = url.removeprefix("tcp:").rpartition(":")
    with socket.create_connection((name, int(port))) as host:
        host.sendall(data)


def over_rfc2217(url: str, data: bytes) -> None:
    with serial.serial_for_url(f"rfc2217://{url.removeprefix('rfc2217:')}?timeout=60") as host:
        host.write(data)


@contextmanager
def serial_line() -> Iterator[tuple[int, int]]:
    """Give the two ends of a cable: what a host writes to, and a serial device."""
    host, device = os.openpty()
    try:
        tty.setraw(device)
        yield host, device
    finally:
        os.close(host)
        os.close(device)


def come(server: Server, device: int, count: int) -> bool:
    """Tell whether so many bytes have come over a serial line."""
    (session,) = server.sessions()
    had = session.received
    waiting = fcntl.ioctl(device, termios.FIONREAD, bytes(4))
    return had + int.from_bytes(waiting, sys.byteorder) >= count


def over_zenoh(url: str, data: bytes) -> None:
    with connect(url) as bus:
        as_calls(bus)


def hash_of(link: str, protocol: str, talk: Callable[[str, bytes], None]) -> tuple[str, int, int]:
    """Serve a board to one host that leaves; return journal's hash, time and position."""
    board = load_board_text(BOARD, "bench")
    file = io.BytesIO()
    journal = Journal(board, file)
    with ServedBoard(board, [LinkSpec(link, protocol)]) as at_work:
        talk(at_work.server.urls[0], WIRES[protocol]())
        at_work.run(at_work.server.finish(lambda: False))
    return *ended(journal, file), int(board.chips[0].telemetry()["real"])


def course(journal: bytes) -> list[tuple[object, ...]]:
    """Return what a journal says, but how far time might run just then: messages were cut so."""
    return [
        (one.number, one.when, one.after, one.port, one.op, one.args, one.reply, one.error)
        for one in JournalReader(io.BytesIO(journal))
    ]


def ended(journal: Journal, file: io.BytesIO) -> tuple[str, int]:
    """End a journal; return the hash of what it holds, and when that ends."""
    journal.close()
    entries = course(file.getvalue())
    return hashlib.sha256(repr(entries).encode()).hexdigest(), journal.board.now


@pytest.mark.parametrize(
    ("link", "talk", "protocol"),
    [
        *(
            (link, talk, protocol)
            for link, talk in (
                ("pty:$VBUS_RUNTIME/x", over_pty),
                ("unix:$VBUS_RUNTIME/x", over_unix),
                ("tcp:0", over_tcp),
                ("rfc2217:0", over_rfc2217),
            )
            for protocol in ("byte", "text", "framed")
        ),
        ("zenoh:", over_zenoh, "byte"),
    ],
)
def test_ten_runs_have_one_journal(
    runtime: Path, link: str, talk: Callable[[str, bytes], None], protocol: str
) -> None:
    outcomes = {hash_of(link, protocol, talk) for _ in range(RUNS)}
    assert len(outcomes) == 1
    _, now, position = outcomes.pop()
    assert now > 2 * LASTS
    assert position > 100


def test_in_process_ten_runs_have_one_journal() -> None:
    """What such a host asks for has happened when its call returns."""
    outcomes = set()
    for _ in range(RUNS):
        board, file = load_board_text(BOARD, "bench"), io.BytesIO()
        journal = Journal(board, file)
        with Bus(InProcessLink(board)) as bus:
            bus.hello()
            as_calls(bus)
        outcomes.add(ended(journal, file))
    assert len(outcomes) == 1
    assert outcomes.pop()[1] > 2 * LASTS


PROGRAM = """
#include "vbus.h"
#include <stdlib.h>
int main(int argc, char **argv)
{
    static const unsigned char data[] = {%s};
    struct vbus bus;
    if (vbus_open(&bus, getenv("VBUS_LINK")) < 0)
        return 1;
    for (unsigned place = 0; place < sizeof data; place += 2) {
        vbus_write(&bus, data[place], data[place + 1]);
        vbus_delay(&bus, 150 * VBUS_US);
    }
    vbus_delay(&bus, 300 * VBUS_MS);
    vbus_write(&bus, 0, 0x01);
    vbus_delay(&bus, 300 * VBUS_MS);
    if (argc > 1)
        exit(0);
    vbus_close(&bus);
    return 0;
}
"""


@pytest.mark.parametrize("leaves", [[], ["without a close"]])
def test_under_exec_ten_runs_have_one_journal(tmp_path: Path, leaves: list[str]) -> None:
    """The summary is taken after what the program has sent last, too."""
    gcc = require("gcc")
    data = ",".join(str(int(byte)) for request in requests() for byte in request)
    source, program, board = (tmp_path / name for name in ("p.c", "p", "board.toml"))
    source.write_text(PROGRAM % data)
    board.write_text(BOARD)
    native = Path(include_dir())
    subprocess.run([gcc, f"-I{native}", "-o", program, source, native / "vbus.c"], check=True)
    said, entries = set(), set()
    for _ in range(3 if leaves else RUNS):
        journal = tmp_path / "run.vbj"
        done = vbus("exec", "--board", board, "--journal", journal, "--", program, *leaves)
        assert done.returncode == 0, done.stderr
        said.add(done.stderr)
        entries.add(repr(course(journal.read_bytes())))
        journal.unlink()
    assert len(said) == len(entries) == 1, said


def test_a_board_that_is_stopped_at_once_has_carried_it_out(runtime: Path) -> None:
    board = load_board_text(BOARD, "bench")
    with served(board, LinkSpec("unix:$VBUS_RUNTIME/x", "byte")) as server:
        over_unix(server.urls[0], as_bytes())
    assert board.now > 2 * LASTS


@pytest.mark.parametrize("protocol", WIRES)
def test_what_has_come_over_a_serial_line_is_carried_out_before_the_board_stops(
    protocol: str,
) -> None:
    """A line has no close: the host may have gone, and nobody can know."""
    outcomes = set()
    data = WIRES[protocol]()
    for _ in range(RUNS):
        board, file = load_board_text(BOARD, "bench"), io.BytesIO()
        journal = Journal(board, file)
        with (
            serial_line() as (host, device),
            served(board, LinkSpec(f"serial:{os.ttyname(device)}", protocol)) as server,
        ):
            _send(host, data)
            until(partial(come, server, device, len(data)), "all bytes")
        outcomes.add((*ended(journal, file), int(board.chips[0].telemetry()["real"])))
    assert len(outcomes) == 1
    _, now, position = outcomes.pop()
    assert now > 2 * LASTS
    assert position > 100


def test_a_board_that_stops_waits_for_no_serial_host_without_a_request() -> None:
    board = load_board_text(BOARD, "bench")
    with serial_line() as (host, device):
        data = as_bytes()[:-3]  # half a DELAY at the end
        with served(board, LinkSpec(f"serial:{os.ttyname(device)}", "byte")) as server:
            _send(host, data)
            until(partial(come, server, device, len(data)), "all bytes")
    assert LASTS < board.now < 2 * LASTS


def test_a_fixture_that_runs_a_program_counts_what_that_sent_last() -> None:
    script = (
        "import os, socket\n"
        "with socket.socket(socket.AF_UNIX) as host:\n"
        "    host.connect(os.environ['VBUS_LINK'].removeprefix('unix:'))\n"
        f"    host.sendall({as_bytes()!r})\n"
    )
    file, source = read_board_text(BOARD)
    seen = [run_program(file, source, ["python", "-c", script]) for _ in range(3)]
    assert {(one.now > 2 * LASTS, one.cycles, one.ok) for one in seen} == {
        (True, len(requests()) + 201, True)
    }
    assert len({one.now for one in seen}) == 1
    short = run_program(file, source, ["python", "-c", script], Limits(chip_time=LASTS))
    assert short.stuck == "it was not done after 0.3 s of chip time"
