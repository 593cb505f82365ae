"""Orders to a running board: a socket that takes one line of JSON and gives one back.

Beside a board's status socket stands one whose name ends in ``.control``. A request is
``{"do": NAME, ...}`` with what the order needs; the reply is ``{"done": RESULT}`` or
``{"error": SENTENCE}``. Bytes travel in base64. The socket is as private as the runtime directory;
where another user gets there all the same, the system names the user: only the user who runs the
board and root may order.
"""

import asyncio
import json
import logging
import os
import socket
import struct
from collections.abc import Callable, Mapping
from typing import Any, Final, NoReturn

from vbus.core.errors import VbusError
from vbus.serve.local_socket import Connection, OnEnd
from vbus.transports.base import Link

Order = Callable[[dict[str, Any]], Any]
"""Is given a request; returns what JSON can hold, or raises ValueError or VbusError."""

Answered = Callable[[dict[str, Any], Callable[[dict[str, Any]], None]], None]
"""Is given a request and what takes the reply, once, soon or late; it does not raise."""

_CREDENTIALS: Final = struct.Struct("3i")

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

    Attributes:
        orders: what can be ordered, by name.
        answered: orders that are not carried out at once, or not here, by name.
    """

    def __init__(self, before: Callable[[], object]) -> None:
        self._before: Callable[[], object] = before
        self.orders: dict[str, Order] = {}
        self.answered: dict[str, Answered] = {}

    def take(
        self,
        line: bytes,
        reply: Callable[[dict[str, Any]], None],
        own: Mapping[str, Order] | None = None,
    ) -> None:
        """Carry out one request, now or soon; whatever is wrong with it stands in the reply.

        Args:
            line: the request.
            reply: takes the reply.
            own: what only who asks can order, beside :attr:`orders`.
        """
        request = self._request(line) if self.answered else {}
        answered = self.answered.get(str(request.get("do")))
        if answered is not None:
            answered(request, reply)
        else:
            reply(self.carry_out(line, own))

    @staticmethod
    def _request(line: bytes) -> dict[str, Any]:
        try:
            return decoded(line)
        except ValueError:
            return {}

    def carry_out(
        self, asked: bytes | dict[str, Any], own: Mapping[str, Order] | None = None
    ) -> dict[str, Any]:
        """Carry out one request now; return the reply; see :meth:`take`."""
        try:
            request = dict(asked) if isinstance(asked, dict) else decoded(asked)
            name = request.pop("do")
            orders = {**self.orders, **(own or {})}
            order = orders.get(name)
            if order is None:
                known = ", ".join(orders) or "nothing"
                raise ValueError(f'there is no order "{name}"; there is {known}')
            self._before()
            return {"done": order(request)}
        except OverflowError:
            return {"error": "a number is out of every range"}
        except (ValueError, KeyError, TypeError, VbusError) as error:
            reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
            return {"error": reason}
        except Exception:
            log.exception("internal error while carrying out an order; the board goes on")
            return {"error": "internal error; the board's own messages say more"}


def user_behind(fd: int) -> int:
    """Return the user whose process has connected to a Unix socket, as the system knows it."""
    with socket.socket(fileno=os.dup(fd)) as link:
        found = link.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    _, user, _ = _CREDENTIALS.unpack(found)
    return int(user)


def refusal_of(fd: int) -> str:
    """Return why who has connected to a Unix socket may give no orders; "" if they may."""
    user, mine = user_behind(fd), os.geteuid()
    if user in (mine, 0):
        return ""
    who = f"user {mine}, who runs it, and from root" if mine else "root, who runs it"
    return f"this board takes orders from {who}; you are user {user}"


class ControlConnection(Connection):
    """One connection: its request, and its reply.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
        control: carries the request out.
    """

    LONGEST_LINE = 1 << 24

    def __init__(
        self, loop: asyncio.AbstractEventLoop, link: Link, on_end: OnEnd, control: Control
    ) -> None:
        super().__init__(loop, link, on_end)
        self._control: Control = control

    def take(self, line: bytes) -> None:
        """Carry out the request and reply; orders of other users are refused."""
        refusal = refusal_of(self._link.fd)
        if refusal:
            self._reply({"error": refusal})
        else:
            self._control.take(line, self._reply)

    def too_long(self) -> None:
        """Refuse the request."""
        self._reply({"error": f"a request has at most {self.LONGEST_LINE} bytes"})

    def _reply(self, answer: dict[str, Any]) -> None:
        if self.open:  # who asked has waited
            self.finish(json.dumps(answer).encode() + b"\n")
