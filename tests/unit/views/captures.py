"""Captures for tests: hosts of all three chips, recorded in the sigrok profile, and faults."""

import csv
import io
from collections.abc import Callable, Iterable

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, NS, US
from vbus.views.silicon.capture import UNKNOWN, Sample
from vbus.views.silicon.capture_vcd import read_vcd
from vbus.views.silicon.channel_map import Wiring, wiring_of
from vbus.views.silicon.conform import CaptureTolerance, Conform, Verdict
from vbus.views.silicon.start import find_start, watch_of
from vbus.views.wave.wave import Wave

BOARDS = {
    "lm628": 'part = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n',
    "mc1241a": 'part = "MC1241A"\nclock = "25 MHz"\nplants = ["none"]\n',
    "mcp1200": 'part = "MCP-1200"\nclock = "8 MHz"\nplant = "none"\n',
}


def board_of(family: str, more: str = "") -> Board:
    """Return a board with one chip, called x."""
    head = '[board]\nname = "bench"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\n'
    return load_board_text(head + BOARDS[family] + more)


def lm628(port: HostBus) -> None:
    """Reset, load, move, interrupt, read positions."""

    def ready() -> None:
        while port.read(0) & 1:
            port.delay(130 * NS)

    def command(code: int, *words: int) -> None:
        ready()
        port.write(0, code)
        for word in words:
            ready()
            port.write(1, word >> 8)
            port.write(1, word & 0xFF)

    command(0x00)
    port.delay(2 * MS)
    command(0x1D, 0x0000)
    command(0x1C, 0x0004)
    command(0x1E, 0x020A, 300, 2000)
    command(0x04)
    command(0x1F, 0x002A, 0, 400, 1, 0, 0, 2)
    command(0x01)
    for _ in range(3):
        port.delay(5 * MS)
        command(0x08)
        for _ in range(2):
            ready()
            port.read(1)
            port.read(1)
    command(0x1D, 0x0000)
    ready()


def mc1241a(port: HostBus) -> None:
    """Packets one way and the other, with checksums, by time instead of HostRdy."""

    def command(code: int, reads: int, *words: int) -> None:
        port.write(1, code)
        port.delay(80 * US)
        for word in words:
            port.write(0, word >> 8)
            port.write(0, word & 0xFF)
            port.delay(80 * US)
        for _ in range(reads + 1):  # the checksum too
            port.read(0)
            port.read(0)
            port.delay(80 * US)

    command(0x01, 1)
    command(0x11, 0, 6, 0xD1EC)
    command(0x4B, 2)
    command(0x80, 0)
    command(0x49, 0)
    command(0x1A, 0)
    command(0x6C, 1)


def mcp1200(port: HostBus) -> None:
    """Registers, one after the other."""
    for address, data in ((0x05, 0), (0x05, 3), (0x0C, 0), (0x0D, 1), (0x0E, 0x7F)):
        port.write(address, data)
        port.delay(MS)
    for address in (0x07, 0x14, 0x13, 0x12, 0x0C, 0x0D, 0x0E):
        port.read(address)
        port.delay(10 * US)


HOSTS: dict[str, Callable[[HostBus], None]] = {
    "lm628": lm628, "mc1241a": mc1241a, "mcp1200": mcp1200,
}  # fmt: skip


def vcd(family: str, host: Callable[[HostBus], None] | None = None, more: str = "") -> str:
    """Return a capture by this project's own sigrok profile."""
    board = board_of(family, more)
    file = io.StringIO()
    wave = Wave(board, file, "sigrok")
    wave.start()
    port = board.open_port("h")
    (host or HOSTS[family])(port)
    port.delay(MS)
    wave.stop()
    assert wave.error == ""
    return file.getvalue()


class Shot:
    """A capture in memory, to be spoiled."""

    def __init__(self, family: str, text: str = "") -> None:
        self.family = family
        capture = read_vcd(io.BytesIO((text or vcd(family)).encode()), "run.vcd")
        self.channels = capture.channels
        self.samples: list[Sample] = list(capture.samples)
        chip = board_of(family).chips[0]
        self.wiring: Wiring = wiring_of(self.channels, "x", chip.pin_rows, watch_of(chip), {})

    def bit(self, pin: str) -> int:
        return self.wiring.bits[pin]

    def change(
        self, first: int, last: int, *, ones: int = 0, zeros: int = 0, flip: int = 0
    ) -> None:
        """Spoil channels from instant ``first`` up to and including ``last``."""
        if all(when != last for when, _ in self.samples):
            raise AssertionError("spoil whole samples")
        self.samples = [
            (when, ((levels | ones) & ~zeros) ^ flip if first <= when <= last else levels)
            for when, levels in self.samples
        ]

    def pulses(self, pin: str) -> list[tuple[int, int]]:
        """Return begin and end of every low pulse of a pin."""
        bit = self.bit(pin)
        found: list[tuple[int, int]] = []
        fell = -1
        for when, levels in self.samples:
            if not levels >> bit & 1 and fell < 0:
                fell = when
            elif levels >> bit & 1 and fell >= 0:
                found.append((fell, when))
                fell = -1
        return found

    def compare(
        self, *, wish: str | int = "auto", slack: int = 200_000, names: Iterable[str] = (),
        masks: dict[int, int] | None = None, judged: bool = False, more: str = "",
    ) -> Verdict:  # fmt: skip
        board = board_of(self.family, more)
        start = find_start(self.samples, self.wiring, board.chips[0], wish)
        tolerance = CaptureTolerance(slack, frozenset(names), masks or {})
        run = Conform(board, board.chips[0], self.wiring, tolerance, judged)
        return run.run(self.samples, start)

    def text(self) -> str:
        """Return the capture as a VCD file."""
        head = "".join(
            f"$var wire 1 {chr(33 + n)} {name} $end\n" for n, name in enumerate(self.channels)
        )
        lines = [f"$timescale 100 ps $end\n{head}$enddefinitions $end"]
        for when, levels in self.samples:
            lines.append(f"#{when // 100}")
            for n in range(len(self.channels)):
                level = "x" if levels >> UNKNOWN + n & 1 else levels >> n & 1
                lines.append(f"{level}{chr(33 + n)}")
        return "\n".join(lines) + "\n"

    def table(self) -> str:
        """Return the capture as Saleae's software exports it: seconds, then the channels."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["Time [s]", *self.channels])
        for when, levels in self.samples:
            time = f"{when // 10**12}.{when % 10**12:012d}"
            bits = [
                "X" if levels >> UNKNOWN + bit & 1 else levels >> bit & 1
                for bit in range(len(self.channels))
            ]
            writer.writerow([time, *bits])
        return out.getvalue()
