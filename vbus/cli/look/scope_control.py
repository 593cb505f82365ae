"""What a page may do to a board: its orders, on their way there and back."""

import asyncio
import json
from collections import deque
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vbus.core.values.settings import listed
from vbus.serve.local_socket import decoded

if TYPE_CHECKING:
    from vbus.cli.look.scope_feeds import Feeds

# A step to a condition may compute for long; a page that waits shows that it does.
SECONDS: Final = 60.0
"""How long a board may take to carry out an order."""
ORDERS: Final = (
    "pause", "go", "step", "rate", "cycle", "pin", "fault.arm", "fault.clear", "journal.save",
    "back",
)  # fmt: skip
"""What a page may ask of the board itself."""
REWIND: Final = "rewind"
"""What is done beside it."""
REGISTERS: Final = "registers"
"""What every page may ask for: the registers of the chips."""
BOOKMARKS: Final = ("bookmark", "forget")
"""What every page may do: add to what people have noted of a recording, and take away from it."""

LONGEST: Final = 100
"""Characters of an order that a message shows."""

Order = Callable[[dict[str, Any]], Awaitable[dict[str, Any]]]
"""Takes an order of a page; returns the answer."""


def answer_to(text: str, control: bool) -> dict[str, Any]:
    """Return what a page asks for, or under ``"error"`` why it is refused."""
    try:
        request = decoded(text)
    except ValueError:
        return {"error": 'write {"do": ...}'}
    what = request["do"]
    if not isinstance(request.get("to", ""), str):
        return {"error": '"to" is a text, such as "12.5 ms"'}
    if not isinstance(request.get("on", False), bool):
        return {"error": '"on" is true or false'}
    if what in (REGISTERS, *BOOKMARKS):
        return {"request": request}
    if not control:
        return {
            "error": f"{what[:LONGEST]!r} is refused: this page may look, not touch"
            " (--scope-control)"
        }
    if what not in (*ORDERS, REWIND):
        allowed = listed([*ORDERS, REWIND])
        return {"error": f"{what[:LONGEST]!r} is nothing a page may do; it may {allowed}"}
    return {"request": request}


class BoardOrders:
    """Orders of pages, in turn, over the connection at which a board is watched.

    Args:
        feeds: has that connection.
        fork: opens a page of a copy of the board, from a journal up to an instant; returns its
            link.
    """

    def __init__(self, feeds: "Feeds", fork: Callable[[Path, str], Awaitable[str]]) -> None:
        self._feeds: Feeds = feeds
        self._fork: Callable[[Path, str], Awaitable[str]] = fork
        self._waiting: deque[asyncio.Future[dict[str, Any]]] = deque()

    def answered(self, answer: dict[str, Any]) -> None:
        """Take the board's answer to the oldest order."""
        # A board answers in the order of the requests, so no number is needed.
        future = self._waiting.popleft()
        if not future.done():
            future.set_result(answer)

    async def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Give the board an order; return its answer."""
        future: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._waiting.append(future)
        try:
            self._feeds.send(json.dumps(request).encode() + b"\n")
            return await asyncio.wait_for(future, SECONDS)
        except (OSError, TimeoutError):
            return {"error": "the board does not answer: it has ended, or has no time"}

    async def order(self, request: dict[str, Any]) -> dict[str, Any]:
        """Carry out an order of a page; return the answer."""
        do = request["do"]
        if do == REWIND:
            return await self._rewind(request.get("to", ""))
        answer = await self.ask(request)
        if "error" in answer:
            return {"answer": answer["error"], "error": True}
        return {"answer": _sentence(do, answer["done"]), "done": answer["done"]}

    async def _rewind(self, to: str) -> dict[str, Any]:
        saved = await self.ask({"do": "journal.save"})
        if "error" in saved:
            return {"answer": f"no way back: {saved['error']}", "error": True}
        try:
            link = await self._fork(Path(saved["done"]["file"]), to)
        except (OSError, ValueError) as error:
            return {"answer": str(error), "error": True}
        return {"answer": f"a copy of the board stands at {to or 'the same instant'}", "link": link}


def _sentence(do: str, done: Any) -> str:
    """Return what has come of an order as a sentence."""
    if do == "cycle":
        return f"{done['data']:02X}H at {done['when_ps']} ps"
    if do == "pin":
        letting = "let go" if done["level"] == "z" else f"driven to {done['level']}"
        return f"{done['pin']} is {letting}"
    if do == "fault.arm":
        return str(done["text"])
    if do == "fault.clear":
        return "; ".join(one["text"] for one in done) or "nothing waited or acted"
    if do == "journal.save":
        return f"saved in {done['file']}"
    return str(done["text"])
