"""A scope started beside a board: a process of its own."""

import asyncio
import subprocess
import sys
from typing import IO, TYPE_CHECKING, Final

import click

from vbus.errors import VbusError

if TYPE_CHECKING:
    from vbus.board.sections import ScopeSection

JOIN_SECONDS: Final = 30.0
"""How long a scope may take to join a board of the process that has started it."""
STAY_SECONDS: Final = 600.0
"""How long a scope that a run has started stays when the run has ended and no page is open."""


async def show_board(board: str, scope: "ScopeSection", control: bool = False) -> None:
    """Start a scope for a board of this process, and return when it has said where, or has failed.

    It has joined by then: what the board does next is on the page.

    Args:
        board: its name, or that of the machine whose nodes are here.
        scope: where the page is to be.
        control: whether pages may do something to it.

    Raises:
        VbusError: it has not come.
    """
    process = start_scope(board, scope, control, subprocess.PIPE)
    said = asyncio.StreamReader()
    pipe, _ = await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(said), process.stdout
    )
    try:
        async with asyncio.timeout(JOIN_SECONDS):
            line = await said.readline()
    except TimeoutError:
        process.kill()
        raise VbusError(
            f"the scope has not joined within {JOIN_SECONDS:g} s; the machine may be too busy"
        ) from None
    finally:
        pipe.close()
    click.echo(line, nl=False, err=True)


def start_scope(
    board: str, scope: "ScopeSection", control: bool = False, stdout: IO[str] | int | None = None
) -> subprocess.Popen[bytes]:
    """Show a board of this process in a process of its own, which outlives it for a while.

    Args:
        board: its name.
        scope: where the page is to be.
        control: whether pages may do something to it.
        stdout: takes the line that says where the page is; standard error if there is none.
    """
    more = ["--remote"] if scope.remote else []
    more += ["--always"] if scope.always else []
    if scope.certificate:
        more += ["--certificate", scope.certificate, "--key", scope.key]
    return subprocess.Popen(
        [
            sys.executable, "-m", "vbus", "scope", board, "--listen", scope.listen,
            "--stay", f"{STAY_SECONDS:g}", *more,
            *(["--control"] if control else []),
        ],
        stdin=subprocess.DEVNULL, stdout=stdout or sys.stderr, start_new_session=True,
    )  # fmt: skip
