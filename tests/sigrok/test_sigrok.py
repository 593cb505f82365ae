"""The sigrok decoders, run by sigrok-cli: what they print is what the journal says."""

import io
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.left_out import require
from tests.unit.views.captures import mc1241a
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.chips.packets import STATUS, Packet
from vbus.circuit.stream import PacketTaker
from vbus.core.kernel import MS, US
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.view import play
from vbus.views.silicon.start import watch_of
from vbus.views.wave.signals import plain
from vbus.views.wave.wave import Wave

ROOT = Path(__file__).parents[2]
BOARD = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "{part}"
clock = "{clock}"
{plant}
"""
CHANNELS = {
    "lm628": ("cs", "ps", "rd", "wr"),
    "mc1241a": ("slct", "cmd", "read", "write"),
    "mcp1200": ("ale", "cs", "oe", "rw"),
}


@pytest.fixture
def sigrok() -> str:
    return require("sigrok-cli")


def lm628(port: HostBus) -> None:
    def ready() -> None:
        while port.read(0) & 1:
            pass

    def command(code: int, *words: int) -> None:
        ready()
        port.write(0, code)
        for word in words:
            ready()
            port.write(1, word >> 8)
            port.write(1, word & 0xFF)

    command(0x1D, 0x003B)
    command(0x1E, 0x020A, 300, 2000)
    command(0x04)
    command(0x1F, 0x002A, 0, 400, 1, 0, 0, 500)
    command(0x01)
    for _ in range(3):
        port.delay(5 * MS)
        command(0x0A)
        for _ in range(2):
            ready()
            port.read(1)
            port.read(1)
    command(0x3F)
    command(0x1F, 0x0008)
    command(0x00)
    port.delay(3 * MS)
    ready()


def mcp1200(port: HostBus) -> None:
    for address, data in ((0x05, 3), (0x0C, 0), (0x0D, 1), (0x0E, 0xFF), (0x01, 0x18)):
        port.write(address, data)
        port.delay(MS)
    for address in (0x07, 0x14, 0x13, 0x12, 0x0E, 0x1E):
        port.read(address)
        port.delay(10 * US)


@pytest.mark.parametrize(
    ("family", "part", "clock", "plant", "host"),
    [
        ("lm628", "LM629N-8", "8 MHz", 'plant = "none"', lm628),
        ("mc1241a", "MC1241A", "25 MHz", 'plants = ["none"]', mc1241a),
        ("mcp1200", "MCP-1200", "8 MHz", 'plant = "none"', mcp1200),
    ],
)
def test_sigrok_prints_what_the_journal_says(
    sigrok: str, sigrok_decoders: Path, tmp_path: Path,
    family: str, part: str, clock: str, plant: str,
    host: Callable[[HostBus], None],
) -> None:  # fmt: skip
    text = BOARD.format(part=part, clock=clock, plant=plant)
    board = load_board_text(text)
    recorded = io.BytesIO()
    journal = Journal(board, recorded, text)
    capture = tmp_path / "run.vcd"
    with capture.open("w") as file:
        watch = watch_of(board.chips[0])
        control, data = watch.PINS, watch.table.data
        wave = Wave(board, file, "sigrok", signals=[f"x.{pin}" for pin in (*control, data)])
        wave.start()
        port = board.open_port("h")
        host(port)
        port.delay(MS)
        wave.stop()
    journal.close()
    # No cycle was lost: the decoder cannot know what a chip did not take.
    assert all(violation.severity != "error" for violation in board.violations)
    expected: dict[bool, list[str]] = {True: [], False: []}

    def take(chip: str, packet: Packet) -> None:
        expected[packet.kind == STATUS].append(packet.text)

    recorded.seek(0)
    reader = JournalReader(recorded)
    play(reader.header, reader, PacketTaker(take))
    assert len(expected[False]) > 4

    prefix = "DB" if family == "mcp1200" else "D"
    wiring = [f"{key}={plain(f'x.{pin}')}"
              for key, pin in zip(CHANNELS[family], control, strict=True)]  # fmt: skip
    wiring += [f"d{bit}=x_{prefix}{bit}" for bit in range(8)]
    name = f"vbus_{family}"
    for row, status in (("packets", False), ("statuses", True)):
        done = subprocess.run(
            [sigrok, "-I", "vcd:compress=1000", "-i", capture, "-P", ":".join([name, *wiring]),
             "-A", f"{name}={row}"],
            env={**os.environ, "SIGROKDECODE_DIR": str(sigrok_decoders)},
            capture_output=True, text=True, timeout=120,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        printed = [line.partition(": ")[2] for line in done.stdout.splitlines()]
        assert printed == expected[status]


def test_the_decoders_have_their_licence_beside_them(sigrok_decoders: Path) -> None:
    assert (
        "GNU GENERAL PUBLIC LICENSE\n                       Version 3"
        in (ROOT / "contrib" / "sigrok" / "COPYING").read_text()
    )
    made = sorted(sigrok_decoders.glob("*/*.py"))
    assert {path.parent.name for path in made} >= {f"vbus_{family}" for family in CHANNELS}
    for path in made:
        text = path.read_text()
        assert text.startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n")
        assert not re.search(r"^(from|import) vbus", text, re.MULTILINE), "they run without vbus"
