"""A scope started beside a board: a process of its own."""

import asyncio
import os
import subprocess
import sys
import webbrowser
from contextlib import suppress
from threading import Thread
from typing import IO, TYPE_CHECKING, Final

import click

from vbus.core.errors import TransportError, VbusError

if TYPE_CHECKING:
    from vbus.boardfile.sections import ScopeSection

JOIN_SECONDS: Final = 30.0
"""How long a scope may take to join a board of the process that has started it."""
PAGE_SECONDS: Final = 60.0
"""How long a board waits for the page it was to begin with."""
STAY_SECONDS: Final = 600.0
"""How long a scope that a run has started stays when the run has ended and no page is open."""


async def show_board(
    board: str, scope: "ScopeSection", control: bool = False, open_page: bool = False
) -> None:
    """Start a scope for a board of this process, and return when it has said where.

    It has joined by then: what the board does next is on the page.

    Args:
        board: its name, or that of the machine whose nodes are here.
        scope: where the page is to be.
        control: whether pages may do something to it.
        open_page: open the page in a browser, if there is one, and wait until it is there.

    Raises:
        TransportError: it has not begun, and has said why.
        VbusError: it has not come.
    """
    process = start_scope(board, scope, control, subprocess.PIPE)
    said = asyncio.StreamReader()
    pipe, _ = await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(said), process.stdout
    )
    try:
        await _begun(said, open_page)
    except BaseException:
        process.terminate()
        raise
    finally:
        pipe.close()


async def _begun(said: asyncio.StreamReader, open_page: bool) -> None:
    """Wait for what a scope says first; with ``open_page`` for the page too."""
    try:
        async with asyncio.timeout(JOIN_SECONDS):
            line = (await said.readline()).decode()
    except TimeoutError:
        raise VbusError(
            f"the scope has not joined within {JOIN_SECONDS:g} s; the machine may be too busy"
        ) from None
    if not line:
        raise TransportError("the scope has ended at once; what it said stands above")
    click.echo(line, nl=False, err=True)
    if not open_page:
        return
    link = line.split()[1]
    opened = _open(link)
    click.echo(
        f"scope: {'opening it in a browser' if opened else 'no browser here; open that link'};"
        f" waiting up to {PAGE_SECONDS:g} s for the page (Ctrl-C ends this)",
        err=True,
    )
    try:
        async with asyncio.timeout(PAGE_SECONDS):
            line = (await said.readline()).decode()  # the next link: this one was used
    except TimeoutError:
        click.echo(
            f"scope: no page within {PAGE_SECONDS:g} s; going on, and recording for it", err=True
        )
        return
    click.echo(line, nl=False, err=True)


def _open(link: str) -> bool:
    """Open a link in a browser that has a window; return whether there is one."""
    if not any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")):
        return False  # those of a terminal would take it away from the board
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False

    def run() -> None:  # some return when the browser has ended
        with suppress(OSError):
            browser.open(link)

    Thread(target=run, daemon=True).start()
    return True


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
    more += ["--sparse"] if scope.sparse else []
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
