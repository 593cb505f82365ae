"""What a transport is: it waits for hosts and gives each a link that carries bytes."""

import asyncio
import errno
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from vbus.boardfile.sections import NO_HOST, HostSection
from vbus.core.errors import TransportError
from vbus.network.session import Network
from vbus.transports.runtime import mark_pause
from vbus.transports.traffic import Traffic

if TYPE_CHECKING:
    from vbus.board.board import Board


REST_SECONDS: Final = 0.2
"""How long nothing is tried after the system has run out of descriptors or memory (s): the socket
stays readable, so an attempt at once would spin."""


def ignore(*_: object) -> None:
    """Stands for a callback that is not set."""


class Link:
    """One connected host: a non-blocking descriptor to read from and write to.

    Args:
        fd: the descriptor.
        peer: who is at the other end, for people.
    """

    def __init__(self, fd: int, peer: str) -> None:
        self.fd: int = fd
        self.peer: str = peer
        self.on_data: Callable[[bytes], None] = ignore
        """Set by the session: takes bytes the transport has read or sorted."""
        self.on_end: Callable[[bool], None] = ignore
        """Set by the session; called by the transport when the host has gone (where reading does
        not tell). True: what can still be read is that host's and is carried out."""
        self.read: Callable[[int, int], bytes] = os.read
        """Reads the descriptor: at most so many bytes of it."""
        self.write: Callable[[int, bytearray], int] = os.write
        """Writes to the descriptor; returns how many bytes it took."""
        self.tells_end: bool = True
        """Whether it is known here when the host has gone; a serial line does not tell."""
        self.reason: str = ""
        """Why the session has ended, if the transport did not end it; set by the session."""

    def close(self) -> None:
        """End the link from this side."""
        os.close(self.fd)

    def hang_up(self) -> None:
        """End the link, and let the host notice it."""
        self.close()


LinkFilter = Callable[[bytearray], None]
"""Changes in place what is about to be sent, while something is wrong with a link; nothing is sent
if nothing is left."""


class MessageLink(Link):
    """One connected host whose requests come as messages, each answered by exactly one.

    There is no descriptor: :attr:`on_data` gets the bytes of the next message when the one before
    was answered.

    Args:
        peer: who is at the other end, for people.
        chips: the chips this host reaches, of those its entry has; empty for all.
    """

    def __init__(self, peer: str, chips: tuple[str, ...] = ()) -> None:
        super().__init__(-1, peer)
        self.chips: tuple[str, ...] = chips

    def answer(self, data: bytes) -> None:
        """Send what the message gave; the next one may come before this returns."""
        raise NotImplementedError

    def left(self) -> list[bytes]:
        """Take the messages that have come and wait for the one before: the host has gone."""
        return []

    def push(self, data: bytes) -> None:
        """Send bytes that answer no request: events."""
        raise NotImplementedError


class Served(NamedTuple):
    """What stands behind a transport, for those that tell of it.

    Attributes:
        board: the board.
        chips: names of the chips its sessions may select.
        statistics: makes what ``vbus ls --json`` shows.
        settle: brings the board up to the present.
        network: the board file's place on the network, if it has one.
    """

    board: "Board"
    chips: tuple[str, ...]
    statistics: Callable[[], dict[str, Any]]
    settle: Callable[[], object]
    network: Network | None = None


class Transport:
    """Waits for hosts at one address.

    Attributes:
        url: the address as it can be given to a client, with everything filled in.
        state: ``"waiting"``, ``"connected"`` or a sentence about what is wrong. The server shows it
            while there is no session; with one it says ``"connected"`` of any transport.

    Args:
        path: what stands after the colon in the board file.
        options: what stands after the question mark.
    """

    SCHEME: str = ""
    PROTOCOL: str = "byte"
    """The protocol a host entry gets that names none."""
    OPTIONS: tuple[str, ...] = ()
    """What may stand after the question mark."""

    loop: asyncio.AbstractEventLoop
    """The event loop, from :meth:`open` on."""
    on_link: Callable[[Link], None]
    """Takes each new link, from :meth:`open` on."""

    def __init__(self, path: str, options: dict[str, str]) -> None:
        for name in options:
            if name not in self.OPTIONS:
                known = ", ".join(self.OPTIONS) or "none"
                raise TransportError(
                    f"{self.SCHEME}:{path}: unknown option {name!r}; known: {known}"
                )
        self.path: str = path
        self.options: dict[str, str] = options
        self.url: str = f"{self.SCHEME}:{path}"
        self.state: str = "waiting"
        self.board: str = ""
        """Name of the board it leads to; set before :meth:`open`, and written beside names."""
        self.remote: bool = False
        """Other computers may be let in; set by the server, and asked by those that listen."""
        self.line: HostSection = NO_HOST
        """The host entry, for links that carry modem lines; set by the server."""
        self.no_room: bytes = b""
        """The bytes for a host for which there is no room; set by the server."""
        self.closing: bool = False
        """The server is about to close this transport: what ends now is meant to."""
        self.report: Callable[[str], None] = ignore
        """Takes a sentence when something worth knowing happens (unplugged, plugged in)."""
        self.traffic: Traffic | None = None
        """Its messages, where it carries messages and no stream of bytes."""
        self.opened: ExitStack = ExitStack()
        """Undoes what :meth:`open` has done."""

    def serves(self, served: Served) -> None:
        """Learn what it stands for; called once, before :meth:`open`."""

    def open(self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None]) -> None:
        """Start waiting; ``on_link`` gets each new link.

        Raises:
            TransportError: the address cannot be used; says why and what to do.
        """
        self.loop, self.on_link = loop, on_link
        self.begin()

    def begin(self) -> None:
        """Start waiting: what a transport does in :meth:`open`."""
        raise NotImplementedError

    def tell_pause(self, paused: bool) -> None:
        """Let clients know that what they ask is answered later, or at once again."""
        mark_pause(self.url, paused)

    def waiting(self) -> bool:
        """Tell whether a host has come, or has sent something, that no session knows of yet."""
        return False

    def close(self) -> None:
        """Stop waiting and remove every name made; may be called again."""
        self.opened.close()

    @contextmanager
    def opening(self, place: object) -> Iterator[ExitStack]:
        """Give :attr:`opened` to a block; what it did is undone at once if the block fails.

        An error of the system becomes a :class:`TransportError` that begins with ``place``.
        """
        try:
            yield self.opened
        except BaseException as error:
            self.opened.close()
            if isinstance(error, OSError) and not isinstance(error, TransportError):
                advice = _ADVICE.get(error.errno or 0, "")
                raise TransportError(f"{place}: {error.strerror or error}{advice}") from error
            raise


_ADVICE: Final = {
    errno.EADDRINUSE: "; stop the program that has it, or choose another port (0 is any free one)",
    errno.EADDRNOTAVAIL: "; it is no address of this computer: choose one that is",
    errno.EACCES: "; choose a place, or a port from 1024 up, that you may use",
}
"""What to do about errors of the system."""


def split_url(url: str) -> tuple[str, str, dict[str, str]]:
    """Split ``"scheme:path?key=value"`` and expand ``$NAME`` in the path.

    Raises:
        TransportError: there is no scheme, or an environment variable is not set.
    """
    from urllib.parse import parse_qsl

    from vbus.core.runtime import expanded

    scheme, colon, rest = url.partition(":")
    if not colon or not scheme or "/" in scheme:
        raise TransportError(
            f'"{url}" is no link: write SCHEME:ADDRESS, e.g. "pty:$VBUS_RUNTIME/x"'
        )
    path, _, query = rest.partition("?")
    path = expanded(path)
    if "$" in path:
        raise TransportError(f'"{url}": an environment variable in it is not set: {path}')
    return scheme, path, dict(parse_qsl(query))
