"""Hosts at a serial line, on a served board: bytes take their time, modem lines are nets."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial

from tests.e2e.command import running, vbus
from tests.e2e.serving import served
from tests.waiting import until
from vbus import connect
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.client.bus import Bus
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.protocols.serial_line import frame_ps
from vbus.serve.server import Server
from vbus.serve.serving import links_of

# pyserial starts its thread in a way that Python will drop.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")

BOARD = """
board.name = "bench"
board.time = "{time}"
board.power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[[hosts]]
transport = "{link}"
{keys}
"""
FRAME = frame_ps(9600, "8N1")


class Edges(Observer):
    """Notes the edges of a net."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((when, level))


@contextmanager
def bench(link: str, keys: str, watch: str = "", edges: Edges | None = None) -> Iterator[Server]:
    file, source = read_board_text(BOARD.format(link=link, keys=keys, time="lockstep"))
    board = build(file, source)
    if edges is not None:
        board.watch(watch, edges)
    with served(board, *links_of(file)) as server:
        yield server


@contextmanager
def port(server: Server) -> Iterator[serial.Serial]:
    place = server.urls[0].removeprefix("rfc2217:")
    with serial.serial_for_url(f"rfc2217://{place}?timeout=60", 9600, timeout=60) as opened:
        yield opened


def polls(bus: Bus, count: int) -> int:
    """Return the chip time that so many round trips take (ps)."""
    begun = bus.now()
    for _ in range(count):
        bus.read(0)
    return bus.now() - begun


# -- bytes take their time -------------------------------------------------------------------------


@pytest.mark.parametrize("link", ["unix:{}/x.sock", "tcp:0", "pty:{}/x", "rfc2217:0"])
def test_round_trips_take_the_chip_time_of_their_bytes(link: str, tmp_path: Path) -> None:
    trips = 2000 if link.startswith("unix") else 50
    with bench(link.format(tmp_path), "baud = 9600") as server:
        if link.startswith("rfc2217"):
            with port(server) as host:
                host.write(b"\x52" + b"\x10" * trips + b"\x52")
                told = host.read(9 + 2 * trips + 9)
            took = int.from_bytes(told[-8:], "big") - int.from_bytes(told[1:9], "big")
        else:
            with connect(server.urls[0]) as bus:
                took = polls(bus, trips)

    # READ4 is a byte and has two back, NOW a byte and nine; a cycle in lockstep lasts 1 us.
    assert took == trips * (3 * FRAME + US) + 10 * FRAME
    if trips == 2000:
        assert took == 6_252_000_002_000 + 10_416_666_670


@pytest.mark.parametrize(("frame", "bits"), [("8N1", 10), ("8E1", 11), ("8E2", 12)])
def test_a_frame_has_the_bits_it_is_said_to_have(frame: str, bits: int, tmp_path: Path) -> None:
    keys = f'baud = 1_000_000\nframe = "{frame}"'
    with bench(f"unix:{tmp_path}/x", keys) as server, connect(server.urls[0]) as bus:
        assert polls(bus, 7) == 7 * (3 * bits * US + US) + 10 * bits * US


def test_leases_are_off_where_asking_takes_time(tmp_path: Path) -> None:
    with bench(f"unix:{tmp_path}/x", "baud = 9600") as server, connect(server.urls[0]) as bus:
        assert not {"leases", "leases_ahead"} & set(bus.info.features)
        bus.leases()
        assert polls(bus, 30) == 30 * (3 * FRAME + US) + 10 * FRAME


def test_a_delay_and_the_bytes_around_it_add_up(tmp_path: Path) -> None:
    with bench(f"unix:{tmp_path}/x", "baud = 9600") as server, connect(server.urls[0]) as bus:
        begun = bus.now()
        bus.delay(300 * MS)  # nine bytes
        assert bus.now() - begun == 300 * MS + 19 * FRAME


def test_in_real_time_too_bytes_take_their_time(tmp_path: Path) -> None:
    file, source = read_board_text(
        BOARD.format(link=f"unix:{tmp_path}/x", keys="baud = 115200", time="realtime")
    )
    with served(build(file, source), *links_of(file)) as server, connect(server.urls[0]) as bus:
        assert polls(bus, 10) >= 40 * frame_ps(115_200, "8N1")


def test_a_program_on_a_board_of_its_own_has_the_line_of_the_host_it_stands_for(
    tmp_path: Path,
) -> None:
    board, program = tmp_path / "bench.toml", tmp_path / "program.py"
    program.write_text(
        "import os\nfrom vbus import connect\n"
        "with connect(os.environ['VBUS_LINK']) as bus:\n"
        "    begun = bus.now()\n    bus.read(0)\n    print(bus.now() - begun)\n"
    )
    board.write_text(BOARD.format(link=f"pty:{tmp_path}/x", keys="baud = 9600", time="lockstep"))
    done = vbus("exec", "--board", board, "--", sys.executable, program)
    with bench(f"unix:{tmp_path}/x", "baud = 9600") as server, connect(server.urls[0]) as bus:
        assert int(done.stdout) == polls(bus, 1) >= 4 * FRAME

    card = '\n[cards.slot]\nbase = 0x300\ndecode = "direct"\nchips = ["x"]\n'
    board.write_text(board.read_text() + f'card = "slot"{card}')
    done = vbus("exec", "--board", board, "--", sys.executable, program)
    assert "baud = 9600: a program makes the accesses of a card or a pin map itself" in done.stderr
    assert done.returncode == 1


def test_a_journal_of_a_serial_line_plays_again(tmp_path: Path) -> None:
    board = tmp_path / "bench.toml"
    board.write_text(BOARD.format(link=f"unix:{tmp_path}/x", keys="baud = 9600", time="lockstep"))
    journal = tmp_path / "run.vbj"
    with (
        running(board, "--journal", journal) as (process, _),
        connect(f"unix:{tmp_path}/x", wait="60 s") as bus,
    ):
        polls(bus, 20)
        bus.close()
        process.send_signal(signal.SIGINT)
        process.wait()

    done = vbus("replay", journal)
    assert (done.returncode, done.stderr) == (0, "")
    assert "20 bus cycles" in done.stdout


# -- the lines of a modem --------------------------------------------------------------------------


def test_opening_the_port_resets_the_chip_as_on_an_arduino() -> None:
    edges = Edges()
    with (
        bench("rfc2217:0", 'baud = 9600\nreset = ["x./RST"]', "x./RST", edges) as server,
        port(server) as host,
    ):
        host.write(b"\x52")
        told = host.read(9)

    assert edges.seen == [(0, 0), (MS, 1)]
    assert told == b"T" + (MS + FRAME).to_bytes(8, "big")


def test_each_change_of_dtr_resets_it_again() -> None:
    edges = Edges()
    keys = 'reset = ["x./RST"]\nchange_time = "2 ms"'
    with bench("rfc2217:0", keys, "x./RST", edges) as server, port(server) as host:
        host.dtr = False
        host.dtr = True
        host.write(b"\x52")
        assert host.read(9) == b"T" + (6 * MS).to_bytes(8, "big")

    assert edges.seen == [(0, 0), (2 * MS, 1), (4 * MS, 0), (6 * MS, 1)]


@pytest.mark.parametrize("key", ["dtr", "rts", "breaks"])
def test_a_pin_is_low_while_its_line_is_on(key: str) -> None:
    edges = Edges()
    with (
        bench("rfc2217:0", f'baud = 9600\n{key} = ["x./IN"]', "x./IN", edges) as server,
        port(server) as host,
    ):
        line = "break_condition" if key == "breaks" else key
        for on in (False, True, False):
            setattr(host, line, on)
        host.write(b"\x52")
        told = host.read(9)

    # DTR and RTS go on when the port is opened; /IN rests high.
    levels = [0, 1] if key == "breaks" else [0, 1, 0, 1]
    assert edges.seen[: len(levels)] == [(n * MS, level) for n, level in enumerate(levels)]
    assert told == b"T" + (len(levels) * MS + FRAME).to_bytes(8, "big")


def test_a_break_stands_among_the_bytes_where_it_was_sent() -> None:
    edges = Edges()
    with (
        bench("rfc2217:0", 'baud = 9600\nbreaks = ["x./IN"]', "x./IN", edges) as server,
        port(server) as host,
    ):
        host.write(b"\x02\xff\x02")
        host.break_condition = True
        host.break_condition = False
        host.write(b"\xff")
        assert host.read(4) == b"E\xffE\xff"

    # ECHO FF and its answer, the next ECHO; then the break.
    begun = 5 * FRAME
    assert edges.seen[:2] == [(begun, 0), (begun + MS, 1)]


def test_cts_and_dsr_follow_their_nets() -> None:
    keys = 'cts = "x.HI"\ndsr = "x./RST"'
    with bench("rfc2217:0", keys) as server, port(server) as host:
        until(lambda: not host.cts and not host.dsr, "both off: HI and /RST are high")
        host.write(b"\x44\x00\x00\x02\x07")  # side pin 0: /RST low
        assert host.read(2) == b"E\x07"
        until(lambda: host.dsr, "DSR on")
        host.write(b"\x44\x00\x02")
        until(lambda: not host.dsr, "DSR off")


def test_without_nets_the_lines_rest_on() -> None:
    with bench("rfc2217:0", "baud = 9600") as server, port(server) as host:
        host.dtr = False
        host.write(b"\x02\xff")
        assert host.read(2) == b"E\xff"
        assert host.cts
        assert host.dsr
