"""The scope's server: who may look, what they are told, and that nobody waits for a page."""

import asyncio
import json
import socket
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

import aiohttp
import pytest
import trustme
from aiohttp import ClientSession, CookieJar, WSServerHandshakeError

from tests.waiting import PATIENCE
from vbus.cli.look.scope_bookmarks import Bookmarks
from vbus.cli.look.scope_page import PagePlace
from vbus.cli.look.scope_server import ScopeServer
from vbus.core.errors import OptionError, TransportError, VbusError
from vbus.views.scope.frames import ALL, NOW, frame
from vbus.views.scope.stream import Stream

TOLD = {"format": 1, "board": "bench"}


def now(when: int) -> bytes:
    return frame(NOW, ALL, 0, when)


class Served:
    def __init__(self, place: PagePlace | None = None) -> None:
        self.links: list[str] = []
        place = place or PagePlace("127.0.0.1:0")
        self.server = ScopeServer(
            Stream(TOLD), place.host, place.port, self.links.append, place.tls
        )

    @property
    def url(self) -> str:
        return self.server.url

    @property
    def own(self) -> dict[str, str]:
        return {"Origin": self.url.rstrip("/")}

    async def enter(self, browser: ClientSession) -> None:
        code = self.links[-1].partition("#")[2]
        async with browser.post(f"{self.url}enter", data=code, headers=self.own) as answer:
            assert answer.status == 204


@asynccontextmanager
async def served(place: PagePlace | None = None) -> AsyncIterator[tuple[Served, ClientSession]]:
    made = Served(place)
    await made.server.start()
    try:
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser:
            yield made, browser
    finally:
        await made.server.stop()


async def status(browser: ClientSession, method: str, url: str, **options: object) -> int:
    async with browser.request(method, url, **options) as answer:  # type: ignore[arg-type]
        return answer.status


async def refused(browser: ClientSession, url: str, headers: dict[str, str]) -> int:
    with pytest.raises(WSServerHandshakeError) as error:
        await browser.ws_connect(f"{url}live", headers=headers)
    return error.value.status


@pytest.mark.asyncio
async def test_a_page_is_told_the_board_then_what_there_is_then_what_comes() -> None:
    async with served() as (made, browser):
        made.server.add(now(1))
        made.server.add(now(2))
        await made.enter(browser)
        async with browser.ws_connect(f"{made.url}live", headers=made.own) as page:
            assert json.loads(await page.receive_str()) == TOLD
            assert await page.receive_bytes() == now(1) + now(2)
            made.server.add(now(3))
            assert await page.receive_bytes() == now(3)
            assert made.server.pages == 1


@pytest.mark.asyncio
async def test_a_code_lets_one_browser_in_and_the_next_has_another() -> None:
    async with served() as (made, browser):
        assert await refused(browser, made.url, made.own) == 403
        await made.enter(browser)
        first, second = (link.partition("#")[2] for link in made.links)
        assert first != second
        assert len(first) == 32
        (cookie,) = browser.cookie_jar
        assert cookie["httponly"]
        assert cookie["samesite"] == "Strict"
        assert cookie.value not in (first, second)
        enter = f"{made.url}enter"
        for code in (first, second[:-1], "", "ä"):
            assert await status(browser, "POST", enter, data=code, headers=made.own) == 403
        assert await status(browser, "POST", enter, data=b"\xff" * 300, headers=made.own) == 413
        assert len(made.links) == 2
        async with browser.ws_connect(f"{made.url}live", headers=made.own) as page:
            await page.receive_str()
        async with ClientSession(cookies={cookie.key: second}) as other:
            assert await refused(other, made.url, made.own) == 403


@pytest.mark.asyncio
@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1", None])
async def test_a_page_from_elsewhere_is_refused(origin: str | None) -> None:
    async with served() as (made, browser):
        await made.enter(browser)
        headers = {} if origin is None else {"Origin": origin}
        assert await refused(browser, made.url, headers) == 403
        code = made.server.link.partition("#")[2]
        url = f"{made.url}enter"
        assert await status(browser, "POST", url, data=code, headers=headers) == 403
        assert made.server.link.endswith(code)


@pytest.mark.asyncio
async def test_a_name_that_others_chose_for_this_computer_is_refused() -> None:
    async with served() as (made, browser):
        port = made.url.rpartition(":")[2].rstrip("/")
        for host, code in {
            f"127.0.0.1:{port}": 200, f"localhost:{port}": 200, f"[::1]:{port}": 200,
            f"evil.example:{port}": 403, "127.0.0.1": 403, "127.0.0.1:1": 403, "[::1": 403,
            f"10.0.0.1:{port}": 403,
        }.items():  # fmt: skip
            assert await status(browser, "GET", made.url, headers={"Host": host}) == code, host


@pytest.mark.asyncio
async def test_every_answer_lets_nothing_from_elsewhere_in() -> None:
    async with served() as (made, browser):
        for path, code, kind in (
            ("", 200, "text/html"), ("page/main.js", 200, "text/javascript"),
            ("page/style.css", 200, "text/css"), ("page/no.js", 404, "text/plain"),
            ("page/..%2flanes.py", 404, "text/plain"), ("nothing", 404, "text/plain"),
        ):  # fmt: skip
            async with browser.get(f"{made.url}{path}") as answer:
                assert answer.status == code
                assert answer.content_type == kind
                allowed = answer.headers["Content-Security-Policy"]
                assert allowed.startswith("default-src 'none'; script-src 'self';")
                assert "unsafe" not in allowed
                assert answer.headers["X-Content-Type-Options"] == "nosniff"
                assert answer.headers["Referrer-Policy"] == "no-referrer"


@pytest.mark.asyncio
async def test_a_page_that_reads_nothing_keeps_nobody_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("vbus.cli.look.scope_server.HEARTBEAT_SECONDS", None)
    async with served() as (made, browser):
        await made.enter(browser)
        stuck = _stuck(made, browser)
        big = now(1) * 60_000
        async with browser.ws_connect(
            f"{made.url}live", headers=made.own, max_msg_size=1 << 24
        ) as page:
            await page.receive_str()
            for _ in range(30):
                made.server.add(big)
                assert await page.receive_bytes() == big
            assert made.server.pages == 2
        stuck.close()


@pytest.mark.asyncio
async def test_bookmarks_of_one_page_wait_for_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page that reads nothing is dropped after a while; others have every answer before."""
    heartbeat = "vbus.cli.look.scope_server.HEARTBEAT_SECONDS"
    monkeypatch.setattr(heartbeat, None)  # the others are not asked whether they are there
    async with served() as (made, browser):
        made.server.bookmarks = Bookmarks(tmp_path / "b.json", "run")
        await made.enter(browser)
        async with (
            asyncio.timeout(PATIENCE),
            browser.ws_connect(f"{made.url}live", headers=made.own, max_msg_size=1 << 24) as page,
        ):
            await until_pages(made.server, 1)
            monkeypatch.setattr(heartbeat, 2.0)
            stuck = _stuck(made, browser)
            stuck.setblocking(False)
            assert await asyncio.get_running_loop().sock_recv(stuck, 4) == b"HTTP"  # it is let in
            made.server.add(now(1) * 500_000)  # more than the system keeps for who does not read
            text = "t" * 200
            for number in range(200):
                await page.send_json(
                    {"do": "bookmark", "bookmark": {"at": f"{number}", "text": text}}
                )
                await page.send_json({"do": "nothing"})
                while (await page.receive()).type is not aiohttp.WSMsgType.TEXT:
                    pass
            await until_pages(made.server, 1)
            known = 0
            await page.send_json({"do": "forget", "bookmark": {"at": "0", "text": text}})
            while known != 199:
                told = await page.receive()
                if told.type is aiohttp.WSMsgType.TEXT:
                    known = len(json.loads(told.data).get("bookmarks", ()))
        stuck.close()


@pytest.mark.asyncio
async def test_a_server_ends_though_a_page_reads_nothing() -> None:
    async with served() as (made, browser):
        await made.enter(browser)
        stuck = _stuck(made, browser)
        await until_pages(made.server, 1)
        made.server.add(now(1) * 500_000)
        await asyncio.sleep(0.1)
        async with asyncio.timeout(50):  # aiohttp would wait for 60 s
            await made.server.stop()
        stuck.close()


def _stuck(made: Served, browser: ClientSession) -> socket.socket:
    """Open a page that reads nothing."""
    (cookie,) = browser.cookie_jar
    host, port = made.url.removeprefix("http://").rstrip("/").split(":")
    stuck = socket.create_connection((host, int(port)))
    stuck.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stuck.sendall(
        f"GET /live HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {made.own['Origin']}\r\n"
        f"Cookie: {cookie.key}={cookie.value}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
        .encode()
    )  # fmt: skip
    return stuck


async def until_pages(server: ScopeServer, count: int) -> None:
    async with asyncio.timeout(PATIENCE):
        while server.pages != count:
            await asyncio.sleep(0.01)


HUGE = "9" * 5000
HEADS = {
    "Host": ["", "x", "::::", "[", "127.0.0.1:999999", "127.0.0.1:\u0664", "h" * 4000, "{host}"],
    "Origin": ["", "null", "\udcff", "{origin}"],
    "Cookie": ["", ";;;=;", "a b=c", "\udcff=\udcff", '"', "vbus-scope-{port}=\udcff", "=" * 999],
    "Content-Type": [
        "text/plain; charset=none",
        "text/plain; charset=\udcff",
        "multipart/form-data",
    ],
    "Content-Encoding": ["", "deflate", "gzip", "br", "none"],
    "Content-Length": ["", "0", "-1", HUGE, "3", "x"],
    "Transfer-Encoding": ["", "chunked", "x"],
    "Sec-WebSocket-Key": ["", "x", "AAAAAAAAAAAAAAAAAAAAAA=="],
    "Sec-WebSocket-Version": ["", "13", HUGE],
    "Upgrade": ["", "websocket", "\udcff"],
    "Connection": ["", "Upgrade", "close"],
    "Sec-WebSocket-Extensions": ["", "permessage-deflate; server_max_window_bits=99", HUGE[:100]],
}
PATHS = (
    "/", "/enter", "/live", "/page/index.html", "/page/" + "x" * 300 + ".js", "/page/%ff.js",
    "/page/%00.js", "/page/..%2f..%2fetc%2fpasswd", "/page/.js", "//", "/%", "/page/a%0d%0ab.js",
    "/page/" + "\u00e9" * 300, "*", "/live?" + HUGE, "http://[", "/enter#", "/page/" + "a/" * 900,
)  # fmt: skip
BODIES = (
    b"",
    b"\xff\xfe",
    b"x" * 10_000,
    HUGE.encode(),
    b"3\r\nabc\r\n0\r\n\r\n",
    b"\0",
    b"z\r\n",
)


@pytest.mark.asyncio
async def test_whatever_is_sent_no_answer_is_a_500(caplog: pytest.LogCaptureFixture) -> None:
    draw = Random(9)
    async with served() as (made, _):
        host, port = made.url.removeprefix("http://").rstrip("/").split(":")
        known = {"{host}": f"{host}:{port}", "{origin}": made.own["Origin"], "{port}": port}

        def filled(text: str) -> bytes:
            for key, value in known.items():
                text = text.replace(key, value)
            return text.encode("utf-8", "surrogateescape")

        codes = set()
        for _ in range(300):
            method = draw.choice(("GET", "POST", "POST", "HEAD", "PUT", "\udcff"))
            heads = {"Host": "{host}", "Origin": "{origin}"}
            for name in draw.sample(sorted(HEADS), draw.randrange(4)):
                heads[name] = draw.choice(HEADS[name])
            body = draw.choice(BODIES)
            if method == "POST" and not {"Content-Length", "Transfer-Encoding"} & set(heads):
                heads["Content-Length"] = str(len(body))
            lines = [f"{method} {draw.choice(PATHS)} HTTP/1.1"]
            lines += [f"{name}: {value}" for name, value in {**heads, "X": ""}.items()]
            asked = b"\r\n".join(map(filled, lines)) + b"\r\n\r\n" + body
            reader, writer = await asyncio.open_connection(host, int(port))
            writer.write(asked)
            answer = b""
            with suppress(ConnectionError, TimeoutError):
                async with asyncio.timeout(0.2):  # half a request is waited for
                    answer = await reader.readline()
            writer.close()
            codes.add(answer.split(b" ")[1] if answer else answer)
            assert b" 500 " not in answer, asked
        assert {b"200", b"400", b"403", b"404"} <= codes
        assert not caplog.records
        async with ClientSession() as browser:
            for body, told in (
                (b"\xff\xfe", "this is no UTF-8 text\n"),
                (b"x" * 100, "the code of this link was used, or is none\n"),
            ):
                async with browser.post(f"{made.url}enter", data=body, headers=made.own) as refusal:
                    assert refusal.status == (400 if body[0] == 0xFF else 403)
                    assert await refusal.text() == told
            zipped = {**made.own, "Content-Encoding": "deflate"}
            async with browser.post(f"{made.url}enter", data=b"no zip", headers=zipped) as refusal:
                assert refusal.status == 400
                assert (await refusal.text()).startswith(
                    ("the body cannot be read: ", "Bad Request")
                )


@pytest.mark.asyncio
async def test_whatever_a_page_says_it_is_answered_in_words(
    caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    async with served() as (made, browser):
        made.server.order = _echo
        made.server.bookmarks = Bookmarks(tmp_path / "b.json", "run")
        await made.enter(browser)
        async with browser.ws_connect(f"{made.url}live", headers=made.own) as page:
            await page.receive_str()
            for asked in (
                "", "{", "[]", "1", "null", '{"do": 1}', '{"do": []}', '{"do": null}', "[" * 9000,
                '{"do": "step", "by": ' + "[" * 5000 + "]" * 5000 + "}",
                '{"do": "rate", "to": NaN}',
                '{"do": "rate", "rate": Infinity}', f'{{"do": "rate", "rate": {HUGE}}}',
                '{"do": "\\ud800"}', '{"do": "rewind", "to": 3}', '{"do": "registers", "on": 1}',
                '{"do": "' + "x" * 20_000 + '"}', '{"do": "pause"} x', '{"do": "bookmark"}',
            ):  # fmt: skip
                await page.send_str(asked)
                told = await page.receive_str()
                assert json.loads(told)["error"] is True, asked
                assert len(told) < 500
            await page.send_bytes(b"\xff")
            await page.send_str('{"do": "pause"}')
            assert json.loads(await page.receive_str()) == {"answer": "pause"}
    assert "Error handling request" not in caplog.text


async def _echo(request: dict[str, Any]) -> dict[str, Any]:
    return {"answer": request["do"]}


@pytest.mark.asyncio
async def test_a_page_may_look_and_not_touch() -> None:
    async with served() as (made, browser):
        await made.enter(browser)
        async with browser.ws_connect(f"{made.url}live", headers=made.own) as page:
            await page.receive_str()
            refusal = "'pause' is refused: this page may look, not touch (--scope-control)"
            for asked, answer in {
                '{"do": "pause"}': refusal,
                "[1]": 'write {"do": ...}',
                "{": 'write {"do": ...}',
            }.items():
                await page.send_str(asked)
                assert json.loads(await page.receive_str()) == {
                    "answer": answer, "error": True,
                }  # fmt: skip


@pytest.mark.asyncio
async def test_an_address_that_is_taken_is_named() -> None:
    async with served() as (made, _):
        port = int(made.url.rpartition(":")[2].rstrip("/"))
        other = ScopeServer(Stream(TOLD), "127.0.0.1", port, made.links.append)
        with pytest.raises(TransportError, match=f"127.0.0.1:{port}: cannot listen: .*in use"):
            await other.start()


@pytest.mark.parametrize(
    ("listen", "told"),
    [
        ("0.0.0.0:80", '"0.0.0.0:80" lets other computers in; write "127.0.0.1:80", or say'
                       " --remote with --certificate and --key if that is meant"),
        ("[::]:80", 'write "[::1]:80"'),
        ("10.0.0.1:80", "--remote with --certificate"),
        ("example.org:80", '"example.org" is no address'),
        ("80", "write HOST:PORT with a port of 0 to 65535"),
    ],
)  # fmt: skip
def test_addresses_that_are_refused(listen: str, told: str) -> None:
    with pytest.raises(OptionError) as error:
        PagePlace(listen)
    assert told in str(error.value)
    with pytest.raises(OptionError):
        PagePlace(listen, remote=True)


@pytest.mark.asyncio
async def test_other_computers_come_in_by_tls(tmp_path: Path) -> None:
    authority = trustme.CA()
    mine = authority.issue_cert("127.0.0.1")
    certificate, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    mine.cert_chain_pems[0].write_to_path(certificate)
    mine.private_key_pem.write_to_path(key)
    with pytest.raises(OptionError, match="belong together"):
        PagePlace("127.0.0.1:0", True, certificate)
    with pytest.raises(VbusError, match="no certificate with this key"):
        PagePlace("127.0.0.1:0", True, key, certificate)
    assert PagePlace("0.0.0.0:0", True, certificate, key).tls is not None
    async with served(PagePlace("127.0.0.1:0", True, certificate, key)) as (made, _):
        assert made.url.startswith("https://")
        trusted = aiohttp.TCPConnector(ssl=_client(authority))
        async with ClientSession(connector=trusted, cookie_jar=CookieJar(unsafe=True)) as browser:
            await made.enter(browser)
            (cookie,) = browser.cookie_jar
            assert cookie["secure"]
            async with browser.ws_connect(f"{made.url}live", headers=made.own) as page:
                assert json.loads(await page.receive_str()) == TOLD


def _client(authority: trustme.CA):  # type: ignore[no-untyped-def]
    import ssl

    context = ssl.create_default_context()
    authority.configure_trust(context)
    return context


def test_what_is_missing_for_the_page_is_named() -> None:
    code = """
import sys
sys.modules["aiohttp"] = None
import vbus.cli.look.scope_server
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "PluginError: the scope needs aiohttp" in done.stderr
