"""The local socket of a running board: requests of the tools of this computer, and their answers.

A request is a line of JSON, ``{"do": NAME, ...}`` with what the order needs; bytes travel in
base64. An answer is a message with its length in front: four bytes, little-endian. It is a JSON
object, ``{"done": RESULT}`` or ``{"error": SENTENCE}``. After the order ``watch`` come messages
with what was asked for (:mod:`vbus.serve.orders.watching`).

The socket is as private as the runtime directory; where another user gets there all the same, the
system names the user: only the user who runs the board and root may order.
"""

import asyncio
import json
import logging
import os
import select
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NoReturn

from vbus.core.errors import VbusError
from vbus.serve.time.watchdog_process import Turns
from vbus.transports.base import Link
from vbus.transports.sockets import UnixTransport, process_behind

READ_SIZE: Final = 1 << 16
LONGEST_LINE: Final = 1 << 24
"""Bytes of a request at most: a bound of memory."""
EVERY_SECONDS: Final = 0.05
"""How often news are sent: a person sees no more."""
MOST_FRAMES: Final = 1 << 24
"""Bytes stored for a watcher that does not read: a bound of memory."""
MOST_ANSWERS: Final = 2 * MOST_FRAMES
"""The same with answers among them."""
LAST_SECONDS: Final = 1.0
"""How long a board that ends waits for a watcher that reads nothing (s); not measured."""
# Twice so long may pass, and who has ordered the end waits for it.
LAST_TURNS: Final = 4.0
"""The same for one that has no turn in which it could read."""

Order = Callable[[dict[str, Any]], Any]
"""Is given a request; returns what JSON can hold, or raises ValueError or VbusError."""

Answered = Callable[[dict[str, Any], Callable[[dict[str, Any]], None]], None]
"""Is given a request and what takes the reply, once, soon or late; it does not raise."""

PUBLIC: Final = ("status", "watch")
"""Orders that change nothing: every user who gets to the socket may give them."""

log = logging.getLogger("vbus")


def decoded(line: bytes | str) -> dict[str, Any]:
    """Return a request of a page or of a tool.

    Raises:
        ValueError: it is none; says why.
    """
    try:
        request = json.loads(line, parse_constant=_no_number)
        json.dumps(request, ensure_ascii=False).encode()
    except RecursionError:
        raise ValueError("a request that is nested too deeply") from None
    except UnicodeError:
        raise ValueError("a request is UTF-8 text, without halves of characters") from None
    if not isinstance(request, dict) or not isinstance(request.get("do"), str):
        raise ValueError('a request is a JSON object with a text "do"')
    return request


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


class Control:
    """What can be ordered of a board.

    Args:
        before: is called before each order: brings the board's time up to now.
        unknown: refuses an order that is not there, in place of a list of those that are.

    Attributes:
        orders: what can be ordered, by name.
        answered: orders that are not carried out at once, or not here, by name.
    """

    def __init__(self, before: Callable[[], object], unknown: str = "") -> None:
        self._before: Callable[[], object] = before
        self._unknown: str = unknown
        self.orders: dict[str, Order] = {}
        self.answered: dict[str, Answered] = {}

    def take(self, line: bytes, connection: "Connection") -> None:
        """Carry out one request, now or soon; whatever is wrong with it stands in the answer."""
        try:
            request = decoded(line)
            refusal = "" if request["do"] in PUBLIC else connection.refusal
            if refusal:
                raise ValueError(refusal)
        except ValueError as error:
            connection.answer({"error": str(error)})
            return
        answered = self.answered.get(request["do"])
        if answered is not None:
            answered(request, connection.answer)
        else:
            connection.answer(self.carry_out(request, connection.orders))

    def carry_out(
        self, request: dict[str, Any], own: dict[str, Order] | None = None
    ) -> dict[str, Any]:
        """Carry out one request now; return the answer.

        Args:
            request: the request.
            own: what only who asks can order, beside :attr:`orders`.
        """
        try:
            orders = self.orders | (own or {})
            name, given = request["do"], {key: request[key] for key in request if key != "do"}
            if name not in orders:
                known = ", ".join(orders) or "nothing"
                raise ValueError(self._unknown or f'there is no order "{name}"; there is {known}')
            self._before()
            return {"done": orders[name](given)}
        except OverflowError:
            return {"error": "a number is out of every range"}
        except (ValueError, KeyError, TypeError, RecursionError, VbusError) as error:
            reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
            return {"error": reason}
        except Exception:
            log.exception("internal error while carrying out an order; the board goes on")
            return {"error": "internal error; the board's own messages say more"}


def user_behind(fd: int) -> int:
    """Return the user whose process has connected to a Unix socket."""
    with socket.socket(fileno=os.dup(fd)) as link:
        return process_behind(link)[1]


class Connection:
    """One connection to the socket of a board.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
        control: carries requests out.

    Attributes:
        pending: what is still to be sent.
        view: what is watched here, once that was asked for.
        orders: what can be ordered here alone, by name.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        link: Link,
        on_end: Callable[["Connection"], None],
        control: Control,
    ) -> None:
        self.loop: asyncio.AbstractEventLoop = loop
        self.pending: bytearray = bytearray()
        self.open: bool = True
        self.view: WatchView | None = None
        self.orders: dict[str, Order] = {}
        self._link: Link = link
        self._on_end: Callable[[Connection], None] = on_end
        self._control: Control = control
        self._line: bytearray = bytearray()

    @property
    def refusal(self) -> str:
        """Why who has connected may give no orders; "" if they may."""
        user, mine = user_behind(self._link.fd), os.geteuid()
        if user in (mine, 0):
            return ""
        who = f"user {mine}, who runs it, and from root" if mine else "root, who runs it"
        return f"this board takes orders from {who}; you are user {user}"

    def readable(self) -> None:
        """Take the lines that have come."""
        try:
            data = os.read(self._link.fd, READ_SIZE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self._line += data
        if not data:
            self.end()
        elif b"\n" in data:
            # Several requests may come in one read, and one request in several.
            *lines, rest = bytes(self._line).split(b"\n")
            self._line = bytearray(rest)
            for line in lines:
                self._take(line)
        elif len(self._line) > LONGEST_LINE:
            self._line.clear()
            self.answer({"error": f"a request has at most {LONGEST_LINE} bytes"})
            self.end_with_board()

    def _take(self, line: bytes) -> None:
        view = self.view
        if view is not None:
            view.take(line)
        elif self.open:
            self._control.take(line, self)
            # What is watched comes behind the answer, which describes it.
            if self.view is not None:
                self.view.start()

    def message(self, data: bytes) -> None:
        """Have a message sent."""
        self.pending += len(data).to_bytes(4, "little") + data

    def answer(self, answer: dict[str, Any]) -> None:
        """Send an answer at once; who orders and does not read is hung up on."""
        if len(self.pending) > MOST_ANSWERS:
            self.end()
        elif self.open:  # who asked has waited
            self.message(json.dumps(answer).encode())
            self.flush()

    def flush(self) -> None:
        """Send what is pending; what the other end does not take now goes as soon as it does."""
        try:
            del self.pending[: os.write(self._link.fd, self.pending)]
        except BlockingIOError:
            pass
        except OSError:  # who asked has not waited for the answer
            self.end()
            return
        if self.pending:
            self.loop.add_writer(self._link.fd, self.flush)
        else:
            self.loop.remove_writer(self._link.fd)

    def send_last(self) -> None:
        """Send what is pending, and wait for it.

        Not for a watcher that has read nothing for a while, or orders and does not read.
        """
        if len(self.pending) > MOST_ANSWERS:
            return
        room = select.poll()
        room.register(self._link.fd, select.POLLOUT)
        with suppress(OSError):  # the other end has gone
            with socket.socket(fileno=os.dup(self._link.fd)) as link:
                watcher, _ = process_behind(link)
            turns, waited = Turns(lambda: [watcher]), 0.0
            while self.pending:
                if room.poll(LAST_SECONDS * 1000):
                    del self.pending[: os.write(self._link.fd, self.pending)]
                    continue
                waited += LAST_SECONDS
                given_up = waited >= LAST_TURNS or not turns.lacking(waited, LAST_SECONDS)
                if given_up and not room.poll(0):
                    break  # between the two looks it may have had its turn, and have read

    def end_with_board(self) -> None:
        """Send what is left, for a run that was short may end with most of it; then end."""
        view, self.view = self.view, None
        if view is not None:
            view.last_words()
        self.end()

    def end(self) -> None:
        """Hang up; may be called again."""
        view, self.view = self.view, None
        if view is not None:
            view.stop()
        if self.open:
            self.open = False
            self.loop.remove_reader(self._link.fd)
            self.loop.remove_writer(self._link.fd)
            self._link.close()
            self._on_end(self)


class WatchView:
    """What a connection has asked for, made from a board.

    Args:
        connection: who watches.

    Attributes:
        most: bytes stored for a watcher that does not read.
        pause: how long until the next news (s).
        over: whether there is no more to come.
    """

    most: int = MOST_FRAMES
    pause: float = EVERY_SECONDS
    over: bool = False

    def __init__(self, connection: Connection) -> None:
        self.connection: Connection = connection
        self._away: bool = False
        self._timer: asyncio.TimerHandle | None = None

    # -- what kinds of views differ in ----------------------------------------------------------

    def described(self) -> Any:
        """Return what it is; sent first."""
        return {}

    def begin(self) -> None:
        """Look at the board from now on."""

    def take(self, line: bytes) -> None:
        """Take a line of who watches."""

    def news(self) -> Iterator[bytes]:
        """Give what is new, as messages."""
        yield from ()

    def look_away(self) -> None:
        """There is no room for more: look at the board no longer."""

    def look_again(self) -> None:
        """There is room again."""

    def end(self) -> None:
        """Let go of the board; what is new by now can still be taken."""

    # -- sending --------------------------------------------------------------------------------

    def start(self) -> None:
        """Begin, and send what is new from now on."""
        self.begin()
        self.send()

    def take_news(self) -> None:
        """Take what is new; of a board that is not looked at, for want of room, nothing is."""
        connection = self.connection
        if len(connection.pending) >= self.most:
            if not self._away:
                self._away = True
                self.look_away()
            return
        if self._away:
            self._away = False
            self.look_again()
        for message in self.news():
            connection.message(message)

    def send(self) -> None:
        """Send what is new, now and in a while."""
        connection = self.connection
        if connection.view is not self:
            return
        if self._timer is not None:
            self._timer.cancel()
        self.take_news()
        if self.over and not connection.pending:
            connection.end()
        if connection.open:
            connection.flush()
        if connection.open:
            self._timer = connection.loop.call_later(self.pause, self.send)

    def stop(self) -> None:
        """Watch no more."""
        if self._timer is not None:
            self._timer.cancel()
        self.end()

    def last_words(self) -> None:
        """The board ends: send what is new, too."""
        if self._away:
            self.look_again()
        self.stop()
        self.connection.send_last()  # there is room for what is new then
        if len(self.connection.pending) < self.most:
            for message in self.news():
                self.connection.message(message)
        self.connection.send_last()


class LocalSocket:
    """Listens for tools of this computer, and keeps their connections.

    Args:
        control: carries out what is ordered there.
        watch: returns what a connection watches, by the rest of the order ``watch``; None where
            there is nothing to watch.

    Attributes:
        connections: those that are open.
    """

    def __init__(
        self,
        control: Control,
        watch: Callable[[Connection, dict[str, Any]], WatchView] | None = None,
    ) -> None:
        self._transport: UnixTransport | None = None
        self._control: Control = control
        self._watch: Callable[[Connection, dict[str, Any]], WatchView] | None = watch
        self.connections: list[Connection] = []

    def open(self, loop: asyncio.AbstractEventLoop, path: Path) -> None:
        """Wait for connections at a path.

        Raises:
            TransportError: the socket cannot be made.
        """

        def linked(link: Link) -> None:
            made = Connection(loop, link, self.connections.remove, self._control)
            if (view := self._watch) is not None:

                def watch(given: dict[str, Any]) -> Any:
                    made.view = view(made, given)
                    return made.view.described()

                made.orders["watch"] = watch
            self.connections.append(made)
            loop.add_reader(link.fd, made.readable)

        transport = self._transport = UnixTransport(str(path), {})
        no_room = b'{"error": "the board has no descriptor left for this"}'
        transport.no_room = len(no_room).to_bytes(4, "little") + no_room
        transport.open(loop, linked)

    def close(self) -> None:
        """Hang up on all and listen no more; may be called again."""
        for connection in list(self.connections):
            connection.end_with_board()
        if self._transport is not None:
            self._transport.close()
