"""The live screen of ``vbus demo``."""

from typing import Final

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from vbus.board.board import Board
from vbus.chips.packets import Packet
from vbus.chips.tables import Bit
from vbus.circuit.stream import LatestLines, PacketReader
from vbus.client.demo import Demo
from vbus.core.signals import Reading, Value

BAR: Final = 31
"""Characters of a bar; the middle one is zero."""
LINES: Final = 4
"""Packets shown, and lines of the host: the whole fits a terminal of 80 by 24."""


class LatestTraffic(PacketReader):
    """The latest packets; equal neighbours are counted, not repeated."""

    def __init__(self) -> None:
        self._lines: LatestLines = LatestLines(maxlen=LINES)
        self.cycles: int = 0

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Count a cycle."""
        self.cycles += 1

    def packet(self, chip: str, packet: Packet) -> None:
        """Take down a packet."""
        self._lines.add(packet.end, packet.text)

    def lines(self) -> list[str]:
        """Return what there is to show, oldest first."""
        return [line.counted("  ") for line in self._lines]


def bar(value: float, full: float) -> Text:
    """Return a bar that grows from the middle to either side."""
    half = BAR // 2
    length = min(half, round(abs(value) / full * half))
    left = "─" * (half - length) + "━" * length if value < 0 else "─" * half
    right = "━" * length + "─" * (half - length) if value > 0 else "─" * half
    return Text.assemble((left, "cyan"), ("┃", "bold"), (right, "cyan"))


def screen(
    demo: Demo, board: Board, traffic: LatestTraffic, link: str, steps: list[str]
) -> RenderableType:
    """Return the whole screen as things stand now."""
    chip = board.chip(demo.chip)
    seen, rows = chip.telemetry(), chip.VALUES.by_key(chip.axis_count)
    gauges = Table.grid(padding=(0, 2))
    gauges.add_column(no_wrap=True)
    gauges.add_column(justify="right", min_width=9)
    gauges.add_column()
    flags = []
    for key, full in demo.shown.items():
        row, axis = rows[key]
        if row.fields:
            flags.append(_flags(int(seen[key]), row.fields))
        else:
            gauges.add_row(_title(row, axis), *_gauge(seen[key], full))
    shown = traffic.lines()
    return Group(
        Panel(
            Group(gauges, *flags),
            title=f"{demo.title}, chip time {board.now * 1e-12:.2f} s",
            title_align="left",
        ),
        Panel(_last(shown), title=f"bus, {traffic.cycles} cycles over {link}", title_align="left"),
        Panel(_last(steps), title="host, a process of its own", title_align="left"),
    )


def _last(lines: list[str]) -> Text:
    shown = lines[-LINES:]
    text = Text("\n".join(shown + [""] * (LINES - len(shown))))
    text.no_wrap = True
    return text


def _title(row: Value, axis: int) -> str:
    """Return what a value is called, with its unit."""
    number = f" {axis + 1}" if "{}" in row.key else ""
    unit = row.plain_unit or ("of full scale" if row.step else "")
    return f"{row.name}{number}" + (f" ({unit})" if unit else "")


def _gauge(value: Reading, full: float) -> tuple[str, RenderableType]:
    if isinstance(value, str):
        return value, ""
    text = f"{value}" if isinstance(value, int) else f"{value:.3f}"
    return text, bar(value, full) if full else ""


def _flags(word: int, bits: tuple[Bit, ...]) -> Text:
    text = Text()
    for bit in bits:
        # Spaces that do not break: a name stays whole at the end of a line.
        name = f" {bit.name} ".replace(" ", "\N{NO-BREAK SPACE}")
        text.append(name, "bold reverse" if word & bit.mask else "dim")
        text.append(" ")
    return text
