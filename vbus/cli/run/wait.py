"""``vbus wait``: until a board is ready."""

import time
from typing import Final

import click

from vbus.cli import exit_codes
from vbus.core.errors import TransportError

PAUSE: Final = 0.02
"""Seconds between two looks."""


@click.command("wait")
@click.argument("names", metavar="NAME...", nargs=-1, required=True)
@click.option(
    "--timeout", type=click.FloatRange(0, 86_400), default=10.0, metavar="SECONDS",
    help="How long to wait for all of them; 10 s if not given.",
)  # fmt: skip
def command(names: tuple[str, ...], timeout: float) -> int:
    """Wait until boards are ready: every link of each is open.

    NAME is that of a board, of a node (BOARD.NODE), or of a board with nodes: all of them.
    """
    from vbus.serve.registry import answers

    deadline = time.monotonic() + timeout
    for name in names:
        while not answers(name):
            if time.monotonic() >= deadline:
                raise TransportError(
                    f'no board called "{name}" is ready within {timeout:g} s; "vbus ls" shows which'
                    ' run, "vbus logs" what one in the background has said'
                )
            time.sleep(PAUSE)
    return exit_codes.OK
