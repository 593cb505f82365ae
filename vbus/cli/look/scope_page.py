"""Where the page of a scope is, what a command line says of it, and the process that serves it."""

import asyncio
import os
import subprocess
import sys
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from pathlib import Path
from threading import Thread
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple

import click

from vbus.core.errors import OptionError, TransportError, VbusError, value_errors

if TYPE_CHECKING:
    import ssl

    from vbus.boardfile.sections import ScopeSection
    from vbus.cli.look.foxglove_lanes import FoxgloveServer
    from vbus.cli.look.scope_bookmarks import Bookmarks
    from vbus.cli.look.scope_control import Order
    from vbus.cli.look.scope_server import ScopeServer
    from vbus.views.scope.stream import Stream

# Python has to start and import aiohttp first, on a machine that may be busy.
JOIN_SECONDS: Final = 30.0
"""How long a scope may take to join a board of the process that has started it."""
# A browser that starts from a cold disk; then the run goes on, recorded for a later page.
PAGE_SECONDS: Final = 60.0
"""How long a board waits for the page it was to begin with."""
END_SECONDS: Final = 10.0
"""How long a scope that did not begin may take to end before it is killed."""
# Long enough to look at a run that ended while its page was closed, short of staying for ever.
STAY_SECONDS: Final = 600.0
"""How long a scope that a run has started stays when the run has ended and no page is open."""


SCOPE_ADDRESS: Final = "127.0.0.1:0"
"""Where the scope's page is served by default: any free port, for this computer alone."""

scope_option = click.option(
    "--scope", is_flag=False, flag_value=SCOPE_ADDRESS, metavar="[HOST:PORT]",
    help="Show the board in a browser; prints a link.",
)  # fmt: skip


def scope_options(verb: Callable[..., int]) -> Callable[..., int]:
    """Give a verb that has a board of its own the options for its scope; it gets a ``page``."""

    @wraps(verb)
    def with_page(scope: str | None, scope_control: bool, open_page: bool, **given: Any) -> int:
        return verb(page=PageRequest(scope, scope_control, open_page), **given)

    with_page = click.option(
        "--scope-control", is_flag=True,
        help="As --scope, and pages may pause and step the board, break it, use bus and pins.",
    )(with_page)  # fmt: skip
    with_page = click.option(
        "--open", "open_page", is_flag=True,
        help="As --scope, opened in a browser here; the board begins when the page is there.",
    )(with_page)  # fmt: skip
    return scope_option(with_page)


def refuse_detached(asked: bool, detach: bool) -> None:
    """Refuse a scope beside a run in the background.

    Raises:
        click.UsageError: both are asked for.
    """
    if asked and detach:
        raise click.UsageError("--scope is not for --detach; see: vbus scope NAME")


class PageRequest(NamedTuple):
    """What a command line says of the page of a board of its own.

    Attributes:
        listen: ``HOST:PORT``; None: as the board file has it.
        control: whether pages may do something to the board.
        open_page: whether a browser is started, and the board begins when it has come.
    """

    listen: str | None = None
    control: bool = False
    open_page: bool = False

    @property
    def asked(self) -> bool:
        """Whether a page is asked for here, whatever the board file says."""
        return self.listen is not None or self.control or self.open_page

    def of(self, section: "ScopeSection") -> "ScopeSection":
        """Return where the page is to be; an empty ``listen`` is nowhere.

        Args:
            section: where the board file wants it.

        Raises:
            OptionError: it is no address.
            VbusError: there is no such certificate.
        """
        from msgspec.structs import replace

        listen = self.listen or section.listen or (SCOPE_ADDRESS if self.asked else "")
        shown = replace(section, listen=listen)
        if listen:
            certificate, key = (
                Path(file) if file else None for file in (shown.certificate, shown.key)
            )
            PagePlace(listen, shown.remote, certificate, key, "--scope")
        return shown

    async def show(self, board: str, section: "ScopeSection") -> None:
        """Show a board of this process, if it is wanted, and return when its scope has joined.

        What the board does next is on the page; with ``open_page`` the page itself has come.

        Args:
            board: its name, or that of the machine whose nodes are here.
            section: where the page is to be, as :meth:`of` gave it.

        Raises:
            TransportError: the scope has not begun, and has said why.
            VbusError: it has not come.
        """
        if not section.listen:
            return
        process = start_scope(board, section, self.control, subprocess.PIPE)
        said = asyncio.StreamReader()
        pipe, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(said), process.stdout
        )
        try:
            await _begun(said, self.open_page)
        except BaseException:
            process.terminate()
            # While it ends it still has its port; a later try would find that in use.
            try:
                process.wait(END_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            raise
        finally:
            pipe.close()


def said_as(what: str, more: str = "") -> Callable[[str], None]:
    """Return what says where something is served."""

    def say(address: str) -> None:
        # The process that started this may have gone; the page goes on.
        with suppress(OSError):
            click.echo(f"{what}: {address}{more}")

    return say


class PagePlace:
    """Where a page is served.

    Args:
        listen: ``HOST:PORT``.
        remote: whether other computers may be let in.
        certificate: for TLS, without which they are not.
        key: its key.
        option: what the address was given with.
        plain: there is no TLS here, so it is not asked for.

    Raises:
        OptionError: it is no address, or lets other computers in where that is not meant.
        VbusError: there is no such certificate.
    """

    def __init__(
        self,
        listen: str,
        remote: bool = False,
        certificate: Path | None = None,
        key: Path | None = None,
        option: str = "--listen",
        plain: bool = False,
    ) -> None:
        from vbus.board.check.network_checks import metrics_address
        from vbus.core.addresses import loopback_like, stays_here

        with value_errors(OptionError, f"{option}: "):
            self.host, self.port = metrics_address(listen, remote=True)
        self.tls: ssl.SSLContext | None = None
        self._files: tuple[Path, Path] | None = None
        if (certificate is None) != (key is None):
            raise OptionError("--certificate and --key belong together")
        if certificate is not None and key is not None:
            self.tls = _tls(certificate, key)
            self._files = certificate, key
        if not stays_here(self.host) and not (remote and (plain or self.tls)):
            meant = "--remote" if plain else "--remote with --certificate and --key"
            raise OptionError(
                f'{option}: "{listen}" lets other computers in; write'
                f' "{loopback_like(self.host)}:{self.port}", or say {meant} if that is meant'
            )

    def server(
        self,
        stream: "Stream",
        bookmarks: "Bookmarks",
        stay: float | None = None,
        order: "Order | None" = None,
    ) -> "ScopeServer":
        """Return what serves a stream there and prints links; one that stays says who it is."""
        from vbus.cli.look.scope_server import ScopeServer

        show = said_as("scope", "" if stay is None else f"  (process {os.getpid()})")
        return ScopeServer(stream, self.host, self.port, show, self.tls, bookmarks, order)

    def foxglove_server(self, description: dict[str, Any]) -> "FoxgloveServer":
        """Return what serves a board there for Foxglove, and prints where."""
        from vbus.cli.look.foxglove_lanes import FoxgloveServer

        files = self._files and (self._files[0].read_bytes(), self._files[1].read_bytes())
        show = said_as("foxglove")
        return FoxgloveServer(description, self.host, self.port, show, files)


def _tls(certificate: Path, key: Path) -> "ssl.SSLContext":
    import ssl

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    # Older versions are refused by every browser of today.
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise VbusError(f"{certificate}: no certificate with this key: {error}") from None
    return context


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
    # Without a display webbrowser falls back to programs in the terminal.
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
    from vbus.core.addresses import stays_here

    # remote = true is leave, not an order: an address of this computer alone needs none.
    far = scope.remote and not stays_here(scope.listen.rpartition(":")[0])
    more = ["--remote"] if far else []
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
