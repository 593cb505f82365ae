"""``vbus run``: a board at the disposal of its hosts until Ctrl-C."""

import json
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from vbus.server.server import Server


def _rate(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Return the rate as a number."""
    if value is None or value == "max":
        return None if value is None else float("inf")
    try:
        rate = float(value)
    except ValueError:
        rate = 0.0
    if not 0.001 <= rate < float("inf"):
        raise click.BadParameter(f'"{value}" is no rate; write a number from 0.001 up, or "max"')
    return rate


@click.command("run")
@click.argument("board")
@click.option("--rate", callback=_rate, help='Chip seconds per second of wall time, or "max".')
@click.option("--journal", metavar="FILE", help="Write every call of every host to FILE.")
@click.option("--report", metavar="FILE", help="Write violations: .txt, .json, .xml or .sarif.")
@click.option("--suppress", metavar="FILE", help="TOML file of accepted violations.")
@click.option("--wave", metavar="FILE", help="Write a waveform of everything to FILE (VCD).")
@click.option("--json", "as_json", is_flag=True, help="Print one line of JSON when ready.")
def command(
    board: str,
    rate: float | None,
    journal: str | None,
    report: str | None,
    suppress: str | None,
    wave: str | None,
    as_json: bool,
) -> None:
    """Run a board and serve its links until Ctrl-C.

    BOARD is a board file. Prints what is attached where, once every link is open.
    """
    from vbus.server.serving import serve

    def ready(server: "Server") -> None:
        status = server.statistics()
        click.echo(json.dumps(status) if as_json else "\n".join(_lines(status)))

    def say(sentence: str) -> None:
        click.echo(f"vbus: {sentence}", err=True)

    wishes = {"journal": journal, "report": report, "suppress": suppress, "wave": wave}
    record = {key: value for key, value in wishes.items() if value is not None}
    serve(board, rate, ready, say, record)


def _lines(status: dict[str, Any]) -> list[str]:
    from vbus.board.units import show

    time = status["policy"]
    if time == "realtime" and status["rate"] != 1:
        time += f", rate {status['rate']}"
    lines = [f"{status['board']}: {time}, process {status['pid']}"]
    for chip in status["chips"]:
        lines.append(f"  chip {chip['name']}: {chip['part']} at {show(chip['clock_hz'], 'Hz')}")
    for link in status["links"]:
        chips = ", ".join(link["chips"])
        lines.append(f"  link {link['url']}: {link['protocol']} protocol, to {chips}")
    lines.append("ready; Ctrl-C stops it")
    return lines
