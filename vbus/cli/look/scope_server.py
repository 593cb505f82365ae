"""What serves the scope's page: HTTP and a WebSocket for each page, with aiohttp."""

import asyncio
import hmac
import json
import logging
import re
import secrets
import socket
import ssl
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any, Final

from vbus.cli.look.scope_bookmarks import Bookmark, Bookmarks
from vbus.cli.look.scope_control import BOOKMARKS, REGISTERS, Order, answer_to
from vbus.core.errors import VbusError, import_errors, listen_errors
from vbus.views.scope.page_file import FIRST, page_file, policy
from vbus.views.scope.stream import MESSAGE, Stream

with import_errors("the scope needs aiohttp", "aiohttp"):
    from aiohttp import ClientError, WSMsgType, web
    from aiohttp.http_exceptions import HttpProcessingError

_HOST: Final = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^\[\]:]+)(?::([0-9]{1,5}))?")


def _named(request: web.Request) -> tuple[str, int]:
    """Return the name or address in a Host header, without brackets, and the port.

    "" if the header is none, port 0 if none is said.
    """
    host = _HOST.fullmatch(request.headers.get("Host", ""))
    return (host[1].strip("[]"), int(host[2] or 0)) if host else ("", 0)


async def _body(request: web.Request) -> str:
    """Return the text that a request has in its body.

    Raises:
        HTTPBadRequest: it cannot be read; says why.
        HTTPRequestEntityTooLarge: it is longer than any code.
    """
    try:
        return (await request.read()).decode()
    except (web.RequestPayloadError, ClientError, HttpProcessingError, OSError) as error:
        raise _refused(f"the body cannot be read: {error}") from None
    except UnicodeDecodeError:
        raise _refused("this is no UTF-8 text") from None


def _refused(sentence: str) -> web.HTTPBadRequest:
    refused = web.HTTPBadRequest(text=" ".join(sentence.split()) + "\n")
    refused.force_close()
    return refused


# More pictures a second than this no page draws (docs/performance.md).
RATE_SECONDS: Final = 1 / 30
"""How often a page is sent something at most."""
# A laptop that sleeps leaves its socket open: its page is given up after this.
HEARTBEAT_SECONDS: Final = 20.0
"""A page that answers nothing for so long is gone."""
# A code has 32 characters; a larger body is refused before it is read.
LONGEST_CODE: Final = 256
STOPPING_SECONDS: Final = 2.0
"""How long pages may take to go when the server ends."""
_TYPES: Final = {"html": "text/html", "js": "text/javascript", "css": "text/css"}
_HEADERS: Final = {
    "Content-Security-Policy": policy("'self'", "'self'", "'self'") + "; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}

log = logging.getLogger("vbus.views.scope")


def _is_ours(record: logging.LogRecord) -> bool:
    """Tell whether a record is more than a request that is none, which has had its answer."""
    return record.exc_info is None or not isinstance(
        record.exc_info[1], HttpProcessingError | web.RequestPayloadError
    )


log.addFilter(_is_ours)

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(eq=False)
class ScopeServer:
    """Serves pages that look at one stream.

    Who has a link's code may look, once; the browser keeps a cookie in its place.

    Attributes:
        stream: what they look at.
        host: address to listen on.
        port: 0 is any free one.
        report: takes a sentence with a link: the first, and another whenever one was used.
        tls: certificate and key, where other computers are let in.
        bookmarks: those of what they look at, which pages may add to.
        order: carries out what pages order; None where they may only look.
        url: where the page is, once the server has begun.
        on_registers: called with whether any page shows registers, whenever that changes.
        on_pages: called with whether any page is open, whenever that changes.
    """

    stream: Stream
    host: str
    port: int
    report: Callable[[str], None]
    tls: ssl.SSLContext | None = None
    bookmarks: Bookmarks | None = None
    order: Order | None = None
    url: str = ""
    on_registers: Callable[[bool], None] = lambda on: None
    on_pages: Callable[[bool], None] = lambda on: None

    def __post_init__(self) -> None:
        self._pages: set[web.WebSocketResponse] = set()
        self._state: str = ""
        """How the board is controlled, for pages."""
        # 192 random bits: no one guesses them in the life of a board.
        self._code: str = secrets.token_urlsafe(24)
        self._cookies: set[str] = set()
        """Those that let a browser in: a name, "=" and what it is."""
        self._news: asyncio.Event = asyncio.Event()
        self._looking_inside: set[web.WebSocketResponse] = set()
        app = web.Application(middlewares=[self._guarded], client_max_size=LONGEST_CODE)
        app.add_routes(
            [
                web.get("/", self._page),
                web.get("/page/{name}", self._page),
                web.post("/enter", self._enter),
                web.get("/live", self._live),
            ]
        )
        self._runner: web.AppRunner = web.AppRunner(
            app, access_log=None, shutdown_timeout=STOPPING_SECONDS, logger=log
        )

    @property
    def pages(self) -> int:
        """How many pages look on now."""
        return len(self._pages)

    @property
    def link(self) -> str:
        """The address with an unused code; the code never leaves the browser's page.

        A fragment is in no request, and so in no log.
        """
        return f"{self.url}#{self._code}"

    async def start(self) -> None:
        """Listen from now on.

        Raises:
            TransportError: the address is taken, or not of this computer.
        """
        await self._runner.setup()
        site = web.TCPSite(self._runner, self.host, self.port, ssl_context=self.tls)
        async with AsyncExitStack() as undo:
            undo.push_async_callback(self._runner.cleanup)
            with listen_errors(f"{self.host}:{self.port}"):
                await site.start()
            undo.pop_all()
        self.port = self._runner.addresses[0][1]
        shown = f"[{self.host}]" if ":" in self.host else self.host
        self.url = f"{'http' if self.tls is None else 'https'}://{shown}:{self.port}/"
        self.report(self.link)

    async def stop(self) -> None:
        """Send every page away and listen no more."""
        await self._runner.cleanup()

    def add(self, frames: bytes) -> None:
        """Take whole frames and wake the pages."""
        self.stream.add(frames)
        self._wake()

    def begin_again(self, stream: Stream) -> None:
        """Look at another stream from now on, pages that are open too."""
        self.stream = stream
        self._wake()

    def tell(self, control: dict[str, Any]) -> None:
        """Tell every page how the board is controlled, also those that come later."""
        self._state = json.dumps({"answer": control["text"], "control": control})
        self._wake()

    def _wake(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()

    # -- who may look -------------------------------------------------------------------------

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse requests that a page from elsewhere has made this browser send."""
        try:
            name, port = _named(request)
            if not self._known(name, port):
                raise web.HTTPForbidden(text=f"this is not {name or 'any host'}\n")
            answer = await handler(request)
        except web.HTTPException as refused:
            refused.headers.update(_HEADERS)
            raise
        if not answer.prepared:
            answer.headers.update(_HEADERS)
        return answer

    def _known(self, name: str, port: int) -> bool:
        """Whether a Host header names this computer: a name that others chose is refused."""
        if not name or (port or (443 if self.tls else 80)) != self.port:
            return False
        # Against DNS rebinding: a page elsewhere may point its own name at this computer.
        if name in ("localhost", self.host):
            return True
        if self.tls is None:
            return name in ("127.0.0.1", "::1")
        with suppress(ValueError):
            # With TLS the certificate says who answers, whatever the address.
            return bool(ip_address(name))
        return name == socket.gethostname()

    def _check_origin(self, request: web.Request) -> None:
        own = f"{'http' if self.tls is None else 'https'}://{request.host}"
        if request.headers.get("Origin", "") != own:
            raise web.HTTPForbidden(text="a page from elsewhere may not look at this board\n")

    @property
    def _cookie(self) -> str:
        """Its name: all ports of a computer share their cookies."""
        return f"vbus-scope-{self.port}"

    async def _enter(self, request: web.Request) -> web.Response:
        """Take a code and give a cookie."""
        self._check_origin(request)
        # In constant time: how long it takes tells nothing of the code.
        if not hmac.compare_digest((await _body(request)).encode(), self._code.encode()):
            raise web.HTTPForbidden(text="the code of this link was used, or is none\n")
        self._code = secrets.token_urlsafe(24)
        cookie = secrets.token_urlsafe(24)
        self._cookies.add(f"{self._cookie}={cookie}")
        answer = web.Response(status=204)
        answer.set_cookie(
            self._cookie, cookie, httponly=True, samesite="Strict", secure=self.tls is not None
        )
        self.report(self.link)
        return answer

    # -- what they see ------------------------------------------------------------------------

    async def _page(self, request: web.Request) -> web.Response:
        name = request.match_info.get("name", FIRST)
        try:
            text = page_file(name)
        except VbusError as error:
            raise web.HTTPNotFound(text=f"{error}\n") from None
        kind = _TYPES[name.rpartition(".")[2]]
        return web.Response(text=text, content_type=kind, charset="utf-8")

    async def _live(self, request: web.Request) -> web.WebSocketResponse:
        self._check_origin(request)
        sent = ";".join(request.headers.getall("Cookie", ())).split(";")
        if self._cookies.isdisjoint(cookie.strip() for cookie in sent):
            raise web.HTTPForbidden(text="open the link that was printed, with its code\n")
        # To this computer it is cheaper to send much than to make it less.
        # TLS is asked for whenever other computers are let in.
        far = self.tls is not None
        page = web.WebSocketResponse(
            heartbeat=HEARTBEAT_SECONDS, max_msg_size=1 << 16, compress=far
        )
        page.headers.update(_HEADERS)
        await page.prepare(request)
        self._pages.add(page)
        if len(self._pages) == 1:
            self.on_pages(True)
        sending = asyncio.create_task(self._send(page))
        try:
            async for message in page:
                if message.type == WSMsgType.TEXT:
                    answer = await self._answer(page, message.data)
                    if answer:
                        await page.send_str(json.dumps(answer))
        finally:
            self._pages.discard(page)
            if not self._pages:
                self.on_pages(False)
            self._look_inside(page, False)
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)
        return page

    async def _answer(self, page: web.WebSocketResponse, text: str) -> dict[str, Any]:
        """Carry out an order of a page; return the answer, if there is one."""
        asked = answer_to(text, self.order is not None)
        request = asked.get("request", {})
        if request.get("do") == REGISTERS:
            self._look_inside(page, request.get("on") is True)
            return {}
        if request.get("do") in BOOKMARKS and self.bookmarks is not None:
            refused = self._bookmark(request["do"], request.get("bookmark"))
            return {"answer": refused, "error": True} if refused else {}
        if self.order is None or "error" in asked:
            return {"answer": asked.get("error", "nothing is recorded of this"), "error": True}
        return await self.order(request)

    def _bookmark(self, what: str, bookmark: Any) -> str:
        """Add a bookmark or forget it, and show every page what there is."""
        assert self.bookmarks is not None
        refused = ""
        try:
            if what == "forget":
                self.bookmarks.remove(bookmark)
            else:
                refused = self.bookmarks.add(bookmark)
        except VbusError as error:
            refused = str(error)
        self._wake()
        return refused

    def _look_inside(self, page: web.WebSocketResponse, on: bool) -> None:
        """Note whether a page looks at registers; they are recorded while one does."""
        before = bool(self._looking_inside)
        if on:
            self._looking_inside.add(page)
        else:
            self._looking_inside.discard(page)
        if bool(self._looking_inside) != before:
            self.on_registers(not before)

    async def _send(self, page: web.WebSocketResponse) -> None:
        """Send a page what there is, as fast as it takes it: it has a place of its own.

        Of the state of the board and of the bookmarks it is sent the newest. A page that reads
        nothing waits here alone, until it has not answered for :data:`HEARTBEAT_SECONDS`.
        """
        with suppress(ConnectionError):
            stream: Stream | None = None
            place = 0
            state = ""
            sent: list[Bookmark] | None = None
            while True:
                news = self._news
                marks = None if self.bookmarks is None else self.bookmarks.all
                noted = {} if marks is None else {"bookmarks": marks}
                if stream is not self.stream:
                    stream, place = self.stream, 0
                    sent = None if marks is None else [*marks]
                    await page.send_str(json.dumps(stream.description | noted))
                elif sent != marks:
                    sent = None if marks is None else [*marks]
                    await page.send_str(json.dumps(noted))
                if state != self._state:
                    state = self._state
                    await page.send_str(state)
                message, place = stream.after(place)
                if message:
                    await page.send_bytes(message)
                if place == stream.end and stream is self.stream:
                    await news.wait()
                if len(message) < MESSAGE:  # else it is still catching up
                    await asyncio.sleep(RATE_SECONDS)
