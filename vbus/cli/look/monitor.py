"""``vbus monitor``: the buses of a running board in the manual's words, as it happens."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from typing import Any, Final

import click

from vbus import plugins
from vbus.chips.packets import STATUS, Packet
from vbus.circuit.stream import LatestLines, PacketReader, PacketStream
from vbus.cli.journal_lines import instant
from vbus.cli.output import Line, complain, json_line
from vbus.cli.sources import Feed, MachineFeed, boards_of
from vbus.cli.telemetry_text import LIT, UNLIT, BitValue, TelemetryValue, words_and_numbers
from vbus.core import exit_codes
from vbus.core.signals import Violation
from vbus.core.wall_clock import monotonic

# Fewer where the panels of the chips need the room.
SHOWN: Final = 16
FEWEST: Final = 4
"""Packets on the screen, at most and at least."""


@click.command("monitor")
@click.argument("board")
@click.option("--plain", is_flag=True, help="Print lines, also on a terminal.")
@click.option("--status", is_flag=True, help="Show status reads too; else they are only counted.")
@click.option("--count", type=click.IntRange(1), help="End after this many packets.")
@click.option("--until", default="", metavar="CONDITION",
              help='End when this holds, such as "x.real > 400 and rising(x.HI)".')  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON, an object for each line.")
def command(
    board: str, plain: bool, status: bool, count: int | None, until: str, as_json: bool
) -> int:
    """Watch a running board: packets with their values, violations, and where the axes are.

    BOARD is the name "vbus ls" shows, or that of a machine, whose nodes on this computer are
    watched together. Ends with Ctrl-C, or with the board; with --until it exits with 1 then.
    """
    from rich.console import Console

    boards = boards_of([board])
    watched = Feed(boards[0]) if len(boards) == 1 else MachineFeed(boards)
    with closing(watched) as feed, suppress(KeyboardInterrupt):
        console = Console()
        view = View(feed.hello, status)
        feed.watch(until)
        text_of: Callable[[str], str] = json_line if as_json else str
        if plain or as_json or not console.is_terminal:
            _print(feed, view, count, text_of)
        else:
            _live(feed, console, view, count)
        if view.met is not None:
            met = f"{until}: at {instant(view.met)}"
            click.echo(text_of(Line(met, until=until, when_ps=view.met)))
            return exit_codes.OK
    if until:
        complain(f'the condition "{until}" has not come to hold')
        return exit_codes.FAILURE
    return exit_codes.OK


class View(PacketReader):
    """The latest packets as lines; equal neighbours are counted.

    Args:
        hello: what the board said of itself.
        status: whether status reads are shown.
    """

    def __init__(self, hello: dict[str, Any], status: bool) -> None:
        chips = hello["chips"]
        self._families: dict[str, str] = {chip["name"]: chip["family"] for chip in chips}
        settings = {chip["name"]: chip["bus_settings"] for chip in chips}
        self._stream: PacketStream = PacketStream(self._families, settings, (self,))
        self.lines: LatestLines = LatestLines(maxlen=SHOWN)
        self.new: list[Line] = []
        """Lines since the caller looked last."""
        self.packets: int = 0
        self.polls: int = 0
        self.cycles: int = 0
        self.lost: int = 0
        self.rules: Counter[str] = Counter()
        self.values: dict[str, dict[str, Any]] = {}
        self.now: int = 0
        self.met: int | None = None
        """When the condition has come to hold that was waited for (ps)."""
        self._status: bool = status

    def values_of(self, chip: str) -> tuple[list[TelemetryValue], list[BitValue]]:
        """Return the latest values of a chip."""
        family = plugins.family(self._families.get(chip, ""))
        return words_and_numbers(family, self._stream.decoders.get(chip), self.values[chip])

    def take(self, item: list[Any]) -> None:
        """Take one line of a feed."""
        kind, *rest = item
        if kind == "c":
            self.cycles += 1
            self._stream.bus_cycle(*rest)
        elif kind == "v":
            self._stream.violation(Violation(*rest))
        elif kind == "t":
            self.now, self.values = rest
        elif kind == "lost":
            self.lost += rest[0]
        elif kind == "until":
            self.met = rest[0]

    def over(self, count: int | None) -> bool:
        """Tell whether what was waited for has come: ``count`` packets, or a condition."""
        return self.met is not None or (count is not None and self.packets >= count)

    def violation(self, violation: Violation) -> None:
        """Show a breach."""
        self.rules[violation.rule] += 1
        self._line(
            violation.when, f"{violation.chip} ! {violation.rule}: {violation.detail}",
            chip=violation.chip, rule=violation.rule, text=violation.detail,
            clause=violation.clause,
        )  # fmt: skip

    def packet(self, chip: str, packet: Packet) -> None:
        """Show a packet."""
        if packet.kind == STATUS and not self._status:
            # A status that is polled would push every command off the screen.
            self.polls += 1
            return
        self.packets += 1
        self._line(
            packet.end, f"{chip} {packet.cited}",
            chip=chip, kind=packet.kind, text=packet.text, clause=packet.clause,
            bytes=[cycle.data for cycle in packet.cycles],
        )  # fmt: skip

    def _line(self, when: int, line: str, **value: Any) -> None:
        self.new.append(Line(f"{instant(when)} {line}", when_ps=when, **value))
        self.lines.add(when, line)


def _print(
    feed: Feed | MachineFeed, view: View, count: int | None, text_of: Callable[[str], str]
) -> None:
    board = feed.hello["board"]
    click.echo(text_of(Line(f"watching {board}", board=board)))
    for item in feed:
        lost = view.lost
        view.take(item)
        if view.lost > lost:
            missed = view.lost - lost
            view.new.append(Line(f"({missed} cycles were too fast to be shown)", lost=missed))
        for line in view.new:
            click.echo(text_of(line))
        view.new.clear()
        if view.over(count):
            return


def _live(feed: Feed | MachineFeed, console: Any, view: View, count: int | None) -> None:
    from rich.live import Live

    due = 0.0
    with Live(screen(feed.hello, view), console=console, auto_refresh=False) as live:
        for item in feed:
            view.take(item)
            view.new.clear()
            begun = monotonic()
            if item[0] == "t" and begun >= due:
                others = len(console.render_lines(_others(view)))
                room = max(FEWEST, min(SHOWN, console.height - others - 2))
                live.update(screen(feed.hello, view, room), refresh=True)
                # It is read for as long as it is drawn, else what is shown falls behind.
                due = 2 * monotonic() - begun
            if view.over(count):
                return


def screen(hello: dict[str, Any], view: View, room: int = SHOWN) -> Any:
    """Return the whole screen for rich.

    Args:
        hello: what the board said of itself.
        view: its values and events since.
        room: lines for packets.
    """
    from rich.console import Group
    from rich.panel import Panel
    from rich.table import Table
    from rich.text import Text

    traffic = Table.grid(padding=(0, 2))
    traffic.add_column(justify="right", style="dim")
    traffic.add_column(no_wrap=True)
    for line in list(view.lines)[-room:]:
        style = "bold red" if " ! " in line.text else ""
        traffic.add_row(instant(line.when), Text(line.counted("  "), style=style))
    return Group(Panel(traffic, title=f"{hello['board']}: bus", height=room + 2), _others(view))


def _others(view: View) -> Any:
    """Return what stands below the packets: axes, violations, numbers."""
    from rich.console import Group
    from rich.panel import Panel
    from rich.text import Text

    broken = "  ".join(f"{rule} x{times}" for rule, times in view.rules.most_common())
    summary = (
        f"{instant(view.now)}   {view.cycles} bus cycles, {view.packets} packets,"
        f" {view.polls} polls not shown"
    )
    if view.lost:
        summary += f", {view.lost} cycles too fast to be shown"
    parts: list[Any] = [Panel(_values(view, chip), title=chip) for chip in view.values]
    if broken:
        parts.append(Panel(Text(broken, style="red"), title="violations"))
    return Group(*parts, Text(summary, style="dim"))


def _values(view: View, chip: str) -> Any:
    """Return what a chip tells: numbers in two columns, and its bits as lamps."""
    from rich.console import Group
    from rich.table import Table

    numbers, words = view.values_of(chip)
    table = Table.grid(padding=(0, 1), expand=True)
    for _ in range(2):
        table.add_column(style="dim")
        table.add_column(justify="right", min_width=9)
        table.add_column(style="dim", ratio=1)
    cells = [cell for one in numbers for cell in (one.name, one.text, one.unit)]
    for place in range(0, len(cells), 6):
        table.add_row(*cells[place : place + 6])
    return Group(table, lamps(words))


def lamps(words: Sequence[BitValue]) -> Any:
    """Return words with their bits as lamps, for rich."""
    from rich.table import Table
    from rich.text import Text

    shown = Table.grid(padding=(0, 1))
    for word in words:
        bits = Text()
        for name, lit in word.bits:
            lamp = f"{LIT if lit else UNLIT}{name.replace(' ', '_')}"  # never broken in two
            bits.append(lamp, style="bold" if lit else "dim")
            bits.append("  ")
        shown.add_row(Text(word.name, style="dim"), word.text, bits)
    return shown
