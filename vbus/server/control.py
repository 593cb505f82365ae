"""Orders to a running board: a socket that takes one line of JSON and gives one back.

Beside a board's status socket stands one whose name ends in ``.control``. A request is
``{"do": NAME, ...}`` with what the order needs; the reply is ``{"done": RESULT}`` or
``{"error": SENTENCE}``. Bytes travel in base64. The socket is as private as the runtime directory.
"""

import asyncio
import json
import logging
import os
from collections.abc import Callable
from typing import Any, Final

from vbus.errors import VbusError
from vbus.server.registry import control_path
from vbus.transports.base import Link
from vbus.transports.sockets import UnixTransport

MOST_ASKED: Final = 1 << 24
"""Bytes of a request."""
READ: Final = 1 << 16

Order = Callable[[dict[str, Any]], Any]
"""Is given a request; returns what JSON can hold, or raises ValueError or VbusError."""

log = logging.getLogger("vbus")


class _Caller:
    """One connection, while its request comes and its reply goes."""

    def __init__(self, loop: asyncio.AbstractEventLoop, link: Link, control: "Control") -> None:
        self._loop: asyncio.AbstractEventLoop = loop
        self._link: Link = link
        self._control: Control = control
        self._asked: bytearray = bytearray()
        self._reply: bytearray = bytearray()
        loop.add_reader(link.fd, self._readable)

    def _readable(self) -> None:
        try:
            data = os.read(self._link.fd, READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self._asked += data
        if self._asked.endswith(b"\n"):
            answer = self._control.carry_out(bytes(self._asked))
        elif len(self._asked) > MOST_ASKED:
            answer = {"error": f"a request has at most {MOST_ASKED} bytes"}
        elif data:
            return
        else:
            self.end()
            return
        self._loop.remove_reader(self._link.fd)
        self._reply += json.dumps(answer).encode() + b"\n"
        self._loop.add_writer(self._link.fd, self._writable)

    def _writable(self) -> None:
        try:
            del self._reply[: os.write(self._link.fd, self._reply)]
        except BlockingIOError:
            return
        except OSError:
            self._reply.clear()
        if not self._reply:
            self.end()

    def end(self) -> None:
        """Hang up; may be called again."""
        if self in self._control.callers:
            self._control.callers.remove(self)
            self._loop.remove_reader(self._link.fd)
            self._loop.remove_writer(self._link.fd)
            self._link.close()


class Control:
    """The socket at which a board takes orders.

    Args:
        board: name of the board.
        before: is called before each order: brings the board's time up to now.

    Attributes:
        orders: what can be ordered, by name.
        callers: connections that are open.
    """

    def __init__(self, board: str, before: Callable[[], object]) -> None:
        self._before: Callable[[], object] = before
        self.orders: dict[str, Order] = {}
        self.callers: list[_Caller] = []
        self._board: str = board
        self._transport: UnixTransport | None = None

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Wait for orders.

        Raises:
            TransportError: the socket cannot be made.
        """
        transport = UnixTransport(str(control_path(self._board)), {})
        transport.open(loop, lambda link: self.callers.append(_Caller(loop, link, self)))
        self._transport = transport

    def carry_out(self, line: bytes) -> dict[str, Any]:
        """Carry out one request; whatever is wrong with it stands in the reply."""
        try:
            request = json.loads(line)
            if not isinstance(request, dict) or not isinstance(request.get("do"), str):
                raise ValueError('a request is a JSON object with a text "do"')
            name = request.pop("do")
            order = self.orders.get(name)
            if order is None:
                known = ", ".join(self.orders) or "nothing"
                raise ValueError(f'there is no order "{name}"; there is {known}')
            self._before()
            return {"done": order(request)}
        except (ValueError, KeyError, TypeError, VbusError) as error:
            reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
            return {"error": reason}
        except Exception:
            log.exception("internal error while carrying out an order; the board goes on")
            return {"error": "internal error; the board's own messages say more"}

    def close(self) -> None:
        """Hang up on everybody; may be called again."""
        for caller in list(self.callers):
            caller.end()
        if self._transport is not None:
            self._transport.close()
            self._transport = None
