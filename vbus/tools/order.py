"""``vbus order``: bus cycles on several nodes, for one coming instant."""

import sys
from pathlib import Path

import click

from vbus.tools.output import duration, show


def _period(ctx: click.Context, param: click.Parameter, value: str) -> int:
    period: int = duration(ctx, param, value)
    if period < 1:
        raise click.BadParameter(f'"{value}" is no period; write a time from 1ps up, such as 256us')
    return period


@click.command("order")
@click.argument("board")
@click.argument("scenario")
@click.option(
    "--ahead", default="100ms", callback=duration, help="How far ahead; 100ms if not given."
)
@click.option(
    "--align",
    default="1ps",
    callback=_period,
    help="Begin at a multiple of this, as 256us, and refuse if a clock is not known as well.",
)
@click.option("--connect", multiple=True, metavar="ENDPOINT", help="Where the nodes meet.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
def command(
    board: str,
    scenario: str,
    ahead: int,
    align: int,
    connect: tuple[str, ...],
    as_json: bool,
) -> None:
    """Order bus cycles on the nodes of a running board, at one coming instant of chip time.

    BOARD is the board file, in real time and with nodes. SCENARIO is a file ("-": standard input)
    with lines such as "0us x+y w 0 1"; their instants count from the one agreed on.
    """
    from vbus.board.config import read_board_file
    from vbus.cluster.ordering import order
    from vbus.errors import ConfigError, read_errors

    file, _ = read_board_file(board)
    if not file.nodes:
        raise ConfigError(f"{board}: this board has no nodes; its hosts write to its chips")
    with read_errors(scenario):
        text = sys.stdin.read() if scenario == "-" else Path(scenario).read_text(encoding="utf-8")
    at, answers = order(file, text, scenario, ahead, connect, align)
    nodes = [
        {"node": answer.node, "requests": answer.taken, "ahead_ps": at - answer.now}
        for answer in answers
    ]
    lines = [
        f"node {answer.node}: {answer.taken} requests, {(at - answer.now) / 1e9:.3f} ms ahead"
        for answer in answers
    ]
    lines.append(f"ordered for chip time {at / 1e9:.6f} ms")
    show(as_json, {"at_ps": at, "nodes": nodes}, lines)
