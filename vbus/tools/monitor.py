"""``vbus monitor``: the buses of a running board in the manual's words, as it happens."""

import io
import json
import socket
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, suppress
from typing import Any, Final

import click

from vbus.errors import TransportError
from vbus.signals import Violation
from vbus.tools.journal_lines import instant
from vbus.trace.decode import BoardPackets
from vbus.trace.latest_lines import LatestLines
from vbus.trace.packets import STATUS, Packet

SHOWN: Final = 16
"""Packets on the screen."""


class Feed:
    """What a running board tells whoever watches it.

    Args:
        board: name of the board.

    Raises:
        TransportError: no board of that name can be watched.
    """

    def __init__(self, board: str) -> None:
        from vbus.server.registry import watch_path
        from vbus.transports.runtime import socket_address

        self._socket: socket.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            with socket_address(watch_path(board)) as address:
                self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            raise TransportError(
                f'no board called "{board}" can be watched ({error.strerror or error});'
                ' "vbus ls" shows which run'
            ) from error
        self._lines: io.BufferedReader = self._socket.makefile("rb")
        self.hello: dict[str, Any] = json.loads(next(self._lines, b"{}"))
        """What ``vbus ls --json`` tells of the board."""

    def __iter__(self) -> Iterator[list[Any]]:
        for line in self._lines:
            if line.endswith(b"\n"):
                yield json.loads(line)

    def raw(self) -> Iterator[bytes]:
        """Give what follows as it comes."""
        while data := self._lines.read1(1 << 16):
            yield data

    def send(self, data: bytes) -> None:
        """Ask for something else."""
        self._socket.sendall(data)

    def close(self) -> None:
        """Watch no more."""
        self._socket.close()


@click.command("monitor")
@click.argument("board")
@click.option("--plain", is_flag=True, help="Print lines, also on a terminal.")
@click.option("--status", is_flag=True, help="Show status reads too; else they are only counted.")
@click.option("--count", type=click.IntRange(1), help="End after this many packets.")
def command(board: str, plain: bool, status: bool, count: int | None) -> None:
    """Watch a running board: packets with their values, violations, and where the axes are.

    BOARD is the name "vbus ls" shows. Ends with Ctrl-C, or with the board.
    """
    from rich.console import Console

    with closing(Feed(board)) as feed, suppress(KeyboardInterrupt):
        console = Console()
        if plain or not console.is_terminal:
            _print(feed, status, count)
        else:
            _live(feed, console, status, count)


class View(BoardPackets):
    """The latest packets as lines; equal neighbours are counted.

    Args:
        hello: what the board said of itself.
        status: whether status reads are shown.
    """

    def __init__(self, hello: dict[str, Any], status: bool) -> None:
        chips = hello["chips"]
        super().__init__(
            {chip["name"]: chip["family"] for chip in chips},
            self._packet,
            {chip["name"]: chip["bus_settings"] for chip in chips},
        )
        self.lines: LatestLines = LatestLines(maxlen=SHOWN)
        self.new: list[str] = []
        """Lines since the caller looked last."""
        self.packets: int = 0
        self.polls: int = 0
        self.cycles: int = 0
        self.lost: int = 0
        self.rules: Counter[str] = Counter()
        self.values: dict[str, dict[str, Any]] = {}
        self.now: int = 0
        self._status: bool = status

    def take(self, item: list[Any]) -> None:
        """Take one line of a feed."""
        kind, *rest = item
        if kind == "c":
            self.cycles += 1
            self.bus_cycle(*rest)
        elif kind == "v":
            violation = Violation(*rest)
            self.violation(violation)
            self.rules[violation.rule] += 1
            self._line(violation.when, f"{violation.chip} ! {violation.rule}: {violation.detail}")
        elif kind == "t":
            self.now, self.values = rest
        elif kind == "lost":
            self.lost += rest[0]

    def _packet(self, chip: str, packet: Packet) -> None:
        if packet.kind == STATUS and not self._status:
            self.polls += 1
            return
        self.packets += 1
        clause = f"  [{packet.clause}]" if packet.clause else ""
        self._line(packet.end, f"{chip} {packet.text}{clause}")

    def _line(self, when: int, text: str) -> None:
        self.new.append(f"{instant(when)} {text}")
        self.lines.add(when, text)


def _print(feed: Feed, status: bool, count: int | None) -> None:
    view = View(feed.hello, status)
    click.echo(f"watching {feed.hello['board']}")
    for item in feed:
        lost = view.lost
        view.take(item)
        if view.lost > lost:
            view.new.append(f"({view.lost - lost} cycles were too fast to be shown)")
        for line in view.new:
            click.echo(line)
        view.new.clear()
        if count is not None and view.packets >= count:
            return


def _live(feed: Feed, console: Any, status: bool, count: int | None) -> None:
    from rich.live import Live

    view = View(feed.hello, status)
    with Live(screen(feed.hello, view), console=console, auto_refresh=False) as live:
        for item in feed:
            view.take(item)
            view.new.clear()
            if item[0] == "t":
                live.update(screen(feed.hello, view), refresh=True)
            if count is not None and view.packets >= count:
                return


def screen(hello: dict[str, Any], view: View) -> Any:
    """Return the whole screen for rich."""
    from rich.console import Group
    from rich.panel import Panel
    from rich.table import Table
    from rich.text import Text

    traffic = Table.grid(padding=(0, 2))
    traffic.add_column(justify="right", style="dim")
    traffic.add_column()
    for line in view.lines:
        style = "bold red" if " ! " in line.text else ""
        traffic.add_row(instant(line.when), Text(line.counted("  "), style=style))
    axes = Table.grid(padding=(0, 2))
    for chip, values in view.values.items():
        shown = "  ".join(f"{name} {value}" for name, value in values.items())
        axes.add_row(Text(chip, style="bold"), shown)
    broken = "  ".join(f"{rule} x{times}" for rule, times in view.rules.most_common())
    summary = (
        f"{instant(view.now)}   {view.cycles} bus cycles, {view.packets} packets,"
        f" {view.polls} polls not shown"
    )
    if view.lost:
        summary += f", {view.lost} cycles too fast to be shown"
    parts = [Panel(traffic, title=f"{hello['board']}: bus", height=SHOWN + 2), Panel(axes)]
    if broken:
        parts.append(Panel(Text(broken, style="red"), title="violations"))
    return Group(*parts, Text(summary, style="dim"))
