"""The live screen of ``vbus demo``."""

from typing import Final

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from vbus import plugins
from vbus.board.board import Board
from vbus.circuit.stream import LatestLines
from vbus.cli.look.monitor import lamps
from vbus.cli.telemetry_text import words_and_numbers
from vbus.client.demo import Demo

# Odd, so that zero has a character of its own.
BAR: Final = 31
"""Characters of a bar; the middle one is zero."""
LINES: Final = 4
"""Packets shown, and lines of the host: the whole fits a terminal of 80 by 24."""


def bar(value: float, full: float) -> Text:
    """Return a bar that grows from the middle to either side."""
    half = BAR // 2
    # A value beyond a full bar stays in the frame.
    length = min(half, round(abs(value) / full * half))
    left = "─" * (half - length) + "━" * length if value < 0 else "─" * half
    right = "━" * length + "─" * (half - length) if value > 0 else "─" * half
    return Text.assemble((left, "cyan"), ("┃", "bold"), (right, "cyan"))


def screen(
    demo: Demo, board: Board, packets: LatestLines, link: str, steps: list[str]
) -> RenderableType:
    """Return the whole screen as things stand now."""
    chip = board.chip(demo.chip)
    seen = chip.telemetry()
    shown = {key: seen[key] for key in demo.shown}
    family = plugins.family(chip.FAMILY)
    numbers, words = words_and_numbers(family, None, shown)
    gauges = Table.grid(padding=(0, 2))
    gauges.add_column(no_wrap=True)
    gauges.add_column(justify="right", min_width=9)
    gauges.add_column()
    for one in numbers:
        value, full = seen[one.name], demo.shown[one.name]
        drawn = bar(value, full) if full and not isinstance(value, str) else ""
        row = family.values.named(one.name)
        _, space, axis = one.name.partition(" ")
        title = f"{row.name if row else one.name}{space}{axis}"
        gauges.add_row(f"{title} ({one.unit})" if one.unit else title, one.text, drawn)
    return Group(
        Panel(
            Group(gauges, lamps(words)),
            title=f"{demo.title}, chip time {board.now * 1e-12:.2f} s",
            title_align="left",
        ),
        Panel(
            _last([line.counted("  ") for line in packets]),
            title=f"bus, {board.reads + board.writes} cycles over {link}",
            title_align="left",
        ),
        Panel(_last(steps), title="host, a process of its own", title_align="left"),
    )


def _last(lines: list[str]) -> Text:
    shown = lines[-LINES:]
    text = Text("\n".join(shown + [""] * (LINES - len(shown))))
    text.no_wrap = True
    return text
