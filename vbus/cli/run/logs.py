"""``vbus logs``: what a board that was started in the background has said."""

import time
from typing import Final

import click

from vbus.core.errors import TransportError

PAUSE: Final = 0.1
"""Seconds between two looks at a log that is followed."""


@click.command("logs")
@click.argument("board")
@click.option("-f", "--follow", is_flag=True, help="Go on until the board ends.")
def command(board: str, follow: bool) -> None:
    """Show what a board has said that was started with "--detach": by vbus run, or by vbus up.

    The log is kept until a board of this name is started again.
    """
    from vbus.serve.registry import answers, log_path

    try:
        file = log_path(board).open(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        raise TransportError(
            f'no board called "{board}" was started with --detach; "vbus ls" shows which run, and'
            " others tell the terminal they were started on"
        ) from None
    with file:
        while True:
            alive = follow and answers(board)
            click.echo(file.read(), nl=False)
            if not alive:
                return
            time.sleep(PAUSE)
