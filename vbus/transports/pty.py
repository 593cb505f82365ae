"""A pseudo terminal with a name that stays the same."""

import asyncio
import os
import select
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from vbus.core.errors import TransportError
from vbus.transports import states
from vbus.transports.base import REST_SECONDS, Link, Transport
from vbus.transports.linux import IN_CLOSE, IN_MODIFY, IN_OPEN
from vbus.transports.open_watch import OpenWatch
from vbus.transports.runtime import NameLock, leads_to_terminal, sweep
from vbus.transports.states import TERMINAL

_READ_SIZE: Final = 1 << 16
_MOST_READ: Final = 1 << 18
"""Bytes read of a host's first ones at most: it may write as fast as they are read."""
LOOK_SECONDS: Final = 0.05
"""How often to look for clients where the system gives no watch (s): a new client waits as long,
and the machine wakes as often."""


class PtyLink(Link):
    """The master side while a client has the terminal open."""

    def __init__(self, transport: "PtyTransport", terminal: "_Terminal") -> None:
        super().__init__(terminal.master, transport.path)
        self.terminal: _Terminal = terminal
        self.read = self._read
        self.last_words: bytes | None = None
        """All that is still to be read of clients that have gone, where others have followed."""
        self._transport: PtyTransport = transport

    def _read(self, fd: int, size: int) -> bytes:
        """Read; with the first byte the name is made to lead to another terminal."""
        if self.last_words is not None:
            data, self.last_words = self.last_words, b""
            return data
        if not self.terminal.named:
            return os.read(fd, size)
        data = self._transport.take_over(self.terminal)
        if self.terminal.link is not self:  # it was the last this client had sent
            self._transport.pass_on(self.terminal, data)
            return b""
        return data or os.read(fd, size)

    def close(self) -> None:
        """The session has ended; the terminal goes with it."""
        self._transport.ended(self)

    def hang_up(self) -> None:
        """Take the terminal from the client that has it open; the name leads to another."""
        self._transport.take_away(self)


class _Terminal:
    """A terminal in raw mode: one generation of clients.

    Attributes:
        master: the server's side.
        name: path of the clients' side.
        state: where it stands in :data:`~vbus.transports.states.TERMINAL`.
        link: the session of the clients that have it open.
        watch: tells of opens, writes and closes while the name leads to it.
        hangups: tells that no client has it open any more.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, notice: Callable[["_Terminal"], None]
    ) -> None:
        self.state: str = states.FRESH
        self.named: bool = True
        """Whether the name leads to it; asked at each read."""
        self.link: PtyLink | None = None
        self._clients: int = 0
        self._wrote: bool = False
        self.followed: bool = False
        """Whether a client has come after all before it had gone, one of which had written."""
        self.mixed: bool = False
        """Whether that one has written, too."""
        with ExitStack() as made:
            self.master, slave = os.openpty()
            made.callback(os.close, self.master)
            try:
                # A terminal left cooked would echo and eat 29 byte values.
                with _system_errors():
                    tty.setraw(slave)
                self.name: str = os.ttyname(slave)
            finally:
                # Held open here, it would keep the master from reporting that no client is left.
                os.close(slave)
            os.set_blocking(self.master, False)
            self._poll: select.poll = select.poll()
            self._poll.register(self.master, select.POLLIN)
            self.hangups: select.epoll = made.enter_context(select.epoll())
            self.watch: OpenWatch | None = None
            """None where the system gives no more of them: what clients do is not known."""
            wakes = select.EPOLLHUP | select.EPOLLET
            try:
                self.watch = OpenWatch(loop, self.name, lambda: notice(self))
            except OSError:  # the system gives no user more than some of them
                wakes |= select.EPOLLIN
            made.callback(self.unwatch)
            self.hangups.register(self.master, wakes)
            self.hangups.poll(0)
            loop.add_reader(self.hangups.fileno(), notice, self)
            made.callback(loop.remove_reader, self.hangups.fileno())
            self._made: ExitStack = made.pop_all()

    def move(self, event: str) -> None:
        """Go on to the state after an event."""
        self.state = TERMINAL.after(self.state, event, self.name)
        self.named = self.state in (states.FRESH, states.SHARED)

    def close(self) -> None:
        """Free all descriptors; again is harmless.

        Linux frees a descriptor even where ``close`` reports an error; nothing more can be done.
        """
        with suppress(OSError):
            self._made.close()

    def look(self) -> int:
        """Return what ``poll`` says of the master: POLLHUP while no client has it open."""
        return sum(state for _, state in self._poll.poll(0))

    def learn(self) -> bool:
        """Take what clients did since the last call; tell whether they did anything.

        The system reports two like events in a row as one, so that the number of clients is an
        estimate, good enough to tell one client from the next.
        """
        hung_up = bool(self.hangups.poll(0))
        events = self.watch.read() if self.watch is not None else []
        for event in events:
            if event & IN_OPEN:
                self.followed = self.followed or (self._wrote and not self._clients)
                self._clients += 1
            elif event & IN_CLOSE:
                self._clients = max(0, self._clients - 1)
            elif event & IN_MODIFY:
                self.mixed = self.followed
                self._wrote = True
        return bool(events) or (hung_up and self.watch is None)

    def read(self) -> bytes:
        """Return what there is to read, within a bound."""
        data = b""
        with suppress(OSError):
            while len(data) < _MOST_READ and (more := os.read(self.master, _READ_SIZE)):
                data += more
        return data

    def unwatch(self) -> None:
        """Stop watching: no new client can open this terminal."""
        if self.watch is not None:
            self.watch.close()
        self.watch = None


@contextmanager
def _system_errors() -> Iterator[None]:
    """Give what went wrong with a terminal as any other error of the system."""
    try:
        yield
    except termios.error as error:
        raise OSError(*error.args) from error


class PtyTransport(Transport):
    """``pty:PATH``: a symbolic link at PATH leads to a terminal in raw mode.

    Clients may open, close, die and come again. Each generation of clients has a terminal of its
    own: when the first byte of one comes, and before it is read, the name is made to lead to a
    new terminal, so that no later client finds replies, settings or half a request of an earlier
    one, and nothing that is done at the end of a session reaches the next. Descriptors opened
    before that byte share a session, which ends when the last of them is closed. A name left
    behind by a server that was killed is repaired at the next start.

    What cannot be known: clients that have opened the terminal, written and closed before the
    server has looked once share it with one that opened it in the same moment. As long as that
    one has written nothing, what is there is the others', and is carried out as theirs; once it
    has written, the bytes look alike, and all are taken as its own.

    Whether a client has the terminal open is known from the master: it reports a hang-up while
    none has. An edge-triggered epoll makes an event of that state, an inotify watch tells of
    opens, writes and closes.
    """

    SCHEME = "pty"

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._link_path: Path = Path(path)
        self._terminals: list[_Terminal] = []
        """Oldest first; the name leads to the last, if to any."""

    def begin(self) -> None:
        """Make the terminal and its name."""
        if not self.path:
            raise TransportError('"pty:" needs a path, e.g. "pty:$VBUS_RUNTIME/x"')
        with self.opening(self._link_path) as opened:
            lock = NameLock(self._link_path)
            lock.take(self.board)
            opened.callback(lock.give_back)
            sweep(self._link_path.parent)
            if os.path.lexists(self._link_path) and not leads_to_terminal(self._link_path):
                raise TransportError(
                    f"{self._link_path} exists and is not a link of ours; remove it or choose"
                    " another name"
                )
            opened.callback(self._unmake)
            self._make()

    def waiting(self) -> bool:
        """Tell whether a client has sent something before its session has begun."""
        return any(
            terminal.named and terminal.link is None and terminal.look() & select.POLLIN
            for terminal in self._terminals
        )

    # -- terminals ------------------------------------------------------------------------------

    def _make(self) -> None:
        """Make a terminal and let the name lead to it."""
        terminal = _Terminal(self.loop, self._notice)
        with ExitStack() as made:
            made.callback(terminal.close)
            temporary = self._link_path.with_name(f".{self._link_path.name}.{os.getpid()}")
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(terminal.name)
            made.callback(temporary.unlink)
            # In one step: a program that opens the name finds the old terminal or the new one.
            temporary.replace(self._link_path)
            made.pop_all()
        self._terminals.append(terminal)
        if terminal.watch is None:
            self._look_at_times(terminal)

    def _look_at_times(self, terminal: _Terminal) -> None:
        """Do without a watch: a client that opens the terminal is noticed a little later."""
        if terminal.named:
            self._notice(terminal)
            self.loop.call_later(LOOK_SECONDS, self._look_at_times, terminal)

    def _unmake(self) -> None:
        terminals, self._terminals = self._terminals, []
        with ExitStack() as unmade:  # each, whatever the others say
            for terminal in terminals:
                unmade.callback(terminal.close)
                if terminal.named:
                    unmade.callback(self._remove_name, terminal)
                terminal.move(states.STOP)

    def _remove_name(self, terminal: _Terminal) -> None:
        """Remove the name, if it is not another's by now."""
        if leads_to_terminal(self._link_path):
            if os.readlink(self._link_path) == terminal.name:
                self._link_path.unlink()

    def _renew(self, terminal: _Terminal, event: str) -> None:
        """Let the name lead from one terminal to a new one."""
        self._name_new(terminal)
        self._move(terminal, event)
        terminal.learn()  # of clients that came before the name led elsewhere

    def _retire(self, terminal: _Terminal) -> None:
        """Let the name lead to a new terminal; clients that have this one open keep it."""
        self._renew(terminal, states.LEFT)
        terminal.unwatch()

    def _move(self, terminal: _Terminal, event: str) -> None:
        """Go on with a terminal; one without a session is closed, if no client is opening it."""
        terminal.move(event)
        if terminal.state == states.UNUSED:
            self.loop.call_later(REST_SECONDS, self._free_unused, terminal)

    def _name_new(self, terminal: _Terminal) -> None:
        """Let the name lead to a new terminal; to none for now if there is none to be had."""
        try:
            self._make()
        except OSError as error:
            self._remove_name(terminal)
            lost = f"lost: {error.strerror or error}"
            if self.state != lost:
                self.report(f"{self._link_path}: {lost}; it is tried again")
            self.state = lost
            self.loop.call_later(REST_SECONDS, self._try_again, terminal)
        else:
            self.state = "waiting"

    def _try_again(self, terminal: _Terminal) -> None:
        """Make a terminal, now that there may be what was missing."""
        if not self.closing and not any(one.named for one in self._terminals):
            self._name_new(terminal)

    def _free(self, terminal: _Terminal) -> None:
        """Close a terminal; clients that have it open find it hung up."""
        terminal.move(states.FREE)
        self._terminals.remove(terminal)
        terminal.close()

    # -- clients come and go --------------------------------------------------------------------

    def _notice(self, terminal: _Terminal) -> None:
        """Begin and end the session of a terminal as clients open and close it."""
        if terminal.state == states.CLOSED:
            return
        came = terminal.learn()
        state, fresh = terminal.look(), terminal.named
        if fresh and state & select.POLLIN:
            self.pass_on(terminal, self.take_over(terminal))
        elif terminal.link is None:
            if not state & select.POLLHUP:
                self._begin(terminal)
            elif came and fresh:  # a client came and went, and may have set something
                self._retire(terminal)
                if not terminal.look() & select.POLLHUP:
                    self._begin(terminal)
        self._end_if_gone(terminal)

    def _end_if_gone(self, terminal: _Terminal) -> None:
        """End the session of clients that have gone.

        The next one may come at any instant, so each look is a new one. While the name leads to the
        terminal those that have gone have sent nothing: the session is the next one's, if one has
        opened the terminal before the name led elsewhere.
        """
        link = terminal.link
        if link is None or not terminal.look() & select.POLLHUP:
            return
        if terminal.named:
            self._retire(terminal)
        # What was sent before the hang-up is seen by a look after it; of nothing, nothing is read.
        state = terminal.look()
        if state & select.POLLHUP and terminal.link is link:
            link.on_end(bool(state & select.POLLIN))

    def take_over(self, terminal: _Terminal) -> bytes:
        """A client has sent something: from now on the name is for others.

        Returns:
            What those have sent who have it open. What others have sent that have gone has been
            carried out, or waits for its turn, and their session has ended.
        """
        data = terminal.read()
        terminal.learn()
        mixed = terminal.mixed
        self._renew(terminal, states.WROTE)
        if mixed or not terminal.followed:
            terminal.unwatch()
            return data
        more = terminal.read()
        terminal.learn()
        terminal.unwatch()
        if not terminal.mixed:
            data, more = data + more, b""
        link = terminal.link or self._begin(terminal)
        link.last_words = data
        link.on_end(True)
        return more

    def pass_on(self, terminal: _Terminal, data: bytes) -> None:
        """Give what has been read to the session of those who have the terminal open."""
        if terminal.state == states.CLOSED:  # its clients have been disconnected
            return
        link = terminal.link
        if link is None and (data or not terminal.look() & select.POLLHUP):
            link = self._begin(terminal)
        if link is not None and data:
            link.on_data(data)

    def _begin(self, terminal: _Terminal) -> PtyLink:
        """Begin a session, after those of clients that have gone by now have ended."""
        for other in tuple(self._terminals):
            if other is not terminal:
                self._end_if_gone(other)
        terminal.move(states.OPENED)
        link = terminal.link = PtyLink(self, terminal)
        self.on_link(link)
        return link

    def ended(self, link: PtyLink) -> None:
        """A session has ended: its terminal goes, unless a client has it open."""
        terminal = link.terminal
        if terminal.link is not link:
            return
        terminal.link = None
        if self.closing or terminal.state == states.CLOSED:
            return
        if terminal.named:
            self._retire(terminal)
        self._move(terminal, states.OVER)
        self.loop.call_soon(self._notice, terminal)

    def _free_unused(self, terminal: _Terminal) -> None:
        """Close a terminal that has had its clients, but for one that is opening it just now."""
        if terminal.state == states.UNUSED:
            if terminal.look() & select.POLLHUP:
                self._free(terminal)
            else:
                self._begin(terminal)

    def take_away(self, link: PtyLink) -> None:
        """End a session with its terminal."""
        terminal = link.terminal
        if terminal.link is not link:
            return
        if terminal.named and not self.closing:
            self._renew(terminal, states.LEFT)
        terminal.link = None
        if not self.closing:
            self._move(terminal, states.OVER)
            self._free(terminal)
