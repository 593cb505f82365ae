"""Stream sockets: Unix and TCP."""

import errno
import os
import select
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from vbus.core.addresses import refused_link
from vbus.core.errors import NameInUseError, TransportError
from vbus.transports.base import REST_SECONDS, Link, Transport, ignore
from vbus.transports.runtime import NameLock, socket_address, sweep

FIRST: Final = 3
"""The first descriptor that is handed over."""
_CREDENTIALS: Final = struct.Struct("3i")


def process_behind(link: socket.socket) -> tuple[int, int]:
    """Return the other process of a Unix socket, and its user, as the system knows them."""
    found = link.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    process, user, _ = _CREDENTIALS.unpack(found)
    return process, user


def handed_over(family: int, address: object) -> socket.socket | None:
    """Return the listening socket at an address that this process was given, if there is one.

    Args:
        family: such as ``socket.AF_UNIX``.
        address: as ``getsockname()`` has it; of TCP the host and the port.
    """
    if os.environ.get("LISTEN_PID") != str(os.getpid()):
        return None
    count = os.environ.get("LISTEN_FDS", "")
    for descriptor in range(FIRST, FIRST + int(count if count.isdecimal() else 0)):
        with suppress(OSError):  # it is no socket
            found = socket.socket(fileno=os.dup(descriptor))
            name = found.getsockname()
            place = name[:2] if isinstance(name, tuple) else name
            listens = found.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
            if found.family == family and place == address and listens:
                return found
            found.close()
    return None


KEEP_ALIVE: Final = ((socket.TCP_KEEPIDLE, 10), (socket.TCP_KEEPINTVL, 5), (socket.TCP_KEEPCNT, 3))
"""A silent TCP host is probed after 10 s, and given up 15 s later; the system's own values are two
hours. It trades the claims of a dead host for a pulled cable that comes back."""
BACKLOG: Final = 1024
"""Hosts that may wait to be accepted; all are taken in one turn of the event loop. A
process may usually have as many descriptors."""
_ASKED: Final = 1 << 16
"""Bytes of a host's first requests at most: a bound of memory."""
_EXHAUSTED: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class SocketLink(Link):
    """One accepted connection."""

    def __init__(self, connection: socket.socket, peer: str) -> None:
        super().__init__(connection.fileno(), peer)
        self.connection: socket.socket = connection

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()


class _SocketTransport(Transport):
    """What both kinds share: a listening socket that accepts without waiting.

    One descriptor is held in reserve. When there are no more, it serves to accept a host and to
    refuse it with the reason; the host would wait in the queue of the socket otherwise.
    """

    _reserve: int = -1
    _told: bool = False
    _listener: socket.socket

    def _keep_reserve(self) -> None:
        if self._reserve < 0:
            with suppress(OSError):
                self._reserve = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)

    def _use_reserve(self) -> None:
        reserve, self._reserve = self._reserve, -1
        if reserve >= 0:
            os.close(reserve)

    def _listen(self, listener: socket.socket) -> None:
        self._listener = listener
        listener.listen(BACKLOG)
        listener.setblocking(False)
        self._listening: select.poll = select.poll()
        self._listening.register(listener.fileno(), select.POLLIN)
        self._keep_reserve()
        self._leaving: dict[int, Callable[[], None]] = {}
        """Closes a connection that is turned away, by its descriptor."""
        self.opened.callback(self._use_reserve)
        self.opened.callback(self.loop.remove_reader, listener.fileno())
        self.opened.callback(self._end_leaving)
        self.loop.add_reader(listener.fileno(), self._accept)

    def waiting(self) -> bool:
        """Tell whether a host waits to be accepted."""
        return any(state & select.POLLIN for _, state in self._listening.poll(0))

    def _accept(self) -> None:
        """Accept all hosts that wait: beside 200 busy hosts a turn takes a tenth of a second."""
        for _ in range(BACKLOG):
            try:
                connection, address = self._listener.accept()
            except ConnectionError:  # this one gave up in the meantime
                continue
            except OSError as error:
                if error.errno in _EXHAUSTED:
                    self._exhausted(error)
                return  # otherwise the queue is empty
            self._admit(connection, address)

    def _admit(self, connection: socket.socket, address: object) -> None:
        connection.setblocking(False)
        try:
            self._tune(connection)
            self.on_link(self.link(connection, self._peer(address)))
        except OSError as error:
            if error.errno in _EXHAUSTED:
                self._turn_away(connection, error)
            else:  # it has gone in the meantime
                connection.close()
            return
        self._told = False

    def _exhausted(self, error: OSError) -> None:
        """The system gives no more descriptors: tell the host, then rest a while."""
        fd = self._listener.fileno()

        def go_on() -> None:
            if self._listener.fileno() == fd:
                self._keep_reserve()
                self.loop.add_reader(fd, self._accept)

        self.loop.remove_reader(fd)  # else it would wake the loop again and again
        try:
            if self._reserve < 0:
                raise error
            self._use_reserve()
            connection, _ = self._listener.accept()
        except OSError:
            self.report(f"{self.url}: a host waits outside: {error.strerror}")
            self.loop.call_later(REST_SECONDS, go_on)
        else:
            self._turn_away(connection, error, go_on)

    def _end_leaving(self) -> None:
        for close in list(self._leaving.values()):
            close()

    def _turn_away(
        self, connection: socket.socket, error: OSError, then: Callable[[], None] = ignore
    ) -> None:
        """Tell a host that there is no room, and close when it has heard, or has had its time."""
        if not self._told:
            self._told = True
            self.report(f"{self.url}: hosts are turned away: {error.strerror}")
        connection.setblocking(False)
        fd = connection.fileno()

        def close() -> None:
            if connection.fileno() == fd:
                del self._leaving[fd]
                late.cancel()
                self.loop.remove_reader(fd)
                with suppress(OSError):  # what is unread would reset the connection
                    connection.recv(_ASKED)
                connection.close()
                then()

        self._leaving[fd] = close
        late = self.loop.call_later(REST_SECONDS, close)
        self.loop.add_reader(fd, close)
        with suppress(OSError):
            connection.send(self.no_room)
            connection.shutdown(socket.SHUT_WR)

    def _tune(self, connection: socket.socket) -> None:
        pass

    def link(self, connection: socket.socket, peer: str) -> Link:
        """Return the link of a host that has connected."""
        return SocketLink(connection, peer)

    def _peer(self, address: object) -> str:
        return self.url


def _answers(path: Path) -> bool:
    """Whether a process listens at a Unix socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link, socket_address(path) as address:
        link.setblocking(False)
        return link.connect_ex(address) in (0, errno.EAGAIN)


class UnixTransport(_SocketTransport):
    """``unix:PATH``: a Unix stream socket that only its owner may open (0600)."""

    SCHEME = "unix"

    def begin(self) -> None:
        """Make the socket; one left behind by a server that was killed is replaced."""
        if not self.path:
            raise TransportError('"unix:" needs a path, e.g. "unix:$VBUS_RUNTIME/x.sock"')
        path = Path(self.path)
        with self.opening(path) as opened:
            given = handed_over(socket.AF_UNIX, str(path.absolute()))
            if given is not None:
                self._listen(opened.enter_context(given))
                return
            lock = NameLock(path)
            lock.take()
            opened.callback(lock.give_back)
            sweep(path.parent)
            if path.exists() and not path.is_socket():
                raise TransportError(
                    f"{path} exists and is not a socket; remove it or choose another name"
                )
            if path.exists() and _answers(path):
                raise NameInUseError(
                    f"{path} is in use by another program; stop it or choose another name"
                )
            # It takes its name when it listens: who sees the name is not refused.
            unnamed = path.with_name(f".{path.name}.new")
            unnamed.unlink(missing_ok=True)
            listener = opened.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            # Private from its first moment: a chmod after the bind would come too late.
            mask = os.umask(0o177)
            try:
                with socket_address(unnamed) as address:
                    listener.bind(address)
            finally:
                os.umask(mask)
            opened.callback(unnamed.unlink, missing_ok=True)
            self._listen(listener)
            unnamed.replace(path)
            opened.callback(path.unlink, missing_ok=True)


class TcpTransport(_SocketTransport):
    """``tcp:[HOST]:PORT``: TCP, on loopback unless a host is given; port 0 takes a free one.

    There is no password: who reaches another address may use the board, so it has to be said that
    this is meant (:attr:`~vbus.transports.base.Transport.remote`).
    """

    SCHEME = "tcp"

    def begin(self) -> None:
        """Listen."""
        host, _, port = self.path.rpartition(":")
        host = host.strip("[]") or "127.0.0.1"
        if refused := refused_link(self.SCHEME, self.path, self.remote):
            raise TransportError(refused)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with self.opening(f"tcp:{self.path}") as opened:
            given = handed_over(family, (host, int(port)))
            listener = opened.enter_context(given or socket.socket(family, socket.SOCK_STREAM))
            if given is None:
                # A server that is started again has its port back, though closed links linger.
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                listener.bind((host, int(port)))
            self._listen(listener)
            bound = listener.getsockname()[1]
        self.url = f"tcp:[{host}]:{bound}" if family == socket.AF_INET6 else f"tcp:{host}:{bound}"

    def _tune(self, connection: socket.socket) -> None:
        # Answers are a few bytes, and each is waited for: none is held back for company.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # A host whose machine has vanished must not keep its claims for ever.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in KEEP_ALIVE:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)

    def _peer(self, address: object) -> str:
        return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else self.url
