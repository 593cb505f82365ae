"""``--scope-control``: a page that pauses and steps a board that runs, breaks it, uses its bus."""

import asyncio
import json
import os
import re
import signal
import sys
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientSession, CookieJar

from tests.e2e.command import running, start, vbus
from tests.e2e.serving import served
from tests.e2e.test_scope import MOVE, drive, entries, link_in
from tests.e2e.test_scope import folder as folder
from tests.unit.faults.bench import build
from tests.waiting import until
from vbus.cli.sources import Feed
from vbus.core.errors import VbusError
from vbus.serve.registry import ask, socket_path


@contextmanager
def scope(*options: str) -> Iterator[str]:
    """A scope of the board while the block runs; gives its link."""
    process = start("scope", "bench", *options)
    assert process.stdout is not None
    try:
        yield link_in(process.stdout.readline())
    finally:
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert err == ""


def attached() -> None:
    """Wait until a host has come to the board."""
    until(lambda: ask(socket_path("bench"))["sessions"], "a host")


class Page:
    """A page's WebSocket."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self.states: list[dict[str, Any]] = []
        self.stood = -1

    async def text(self) -> dict[str, Any]:
        """Return the next text; frames go by."""
        while True:
            message = await self._socket.receive(timeout=60)
            if isinstance(message.data, str):
                found: dict[str, Any] = json.loads(message.data)
                return found

    async def order(self, do: str, **values: Any) -> dict[str, Any]:
        """Order something; return the answer."""
        await self._socket.send_str(json.dumps({"do": do, **values}))
        while "control" in (told := await self.text()):
            self.states.append(told["control"])
        return told

    async def until(self, text: str) -> int:
        """Wait until the board stands still somewhere else, for this reason; return when (ps)."""
        while True:
            if self.states:
                told = self.states[-1]
                now = int(told["now_ps"])
                if (told["state"], told["text"]) == ("paused", text) and now > self.stood:
                    self.stood = now
                    return now
            told = await self.text()
            if "control" in told:
                self.states.append(told["control"])


@asynccontextmanager
async def opened(link: str) -> AsyncIterator[tuple[Page, dict[str, Any]]]:
    """Open a link as a browser does; gives the page, and what it was told first."""
    url, _, code = link.partition("#")
    own = {"Origin": url.rstrip("/")}
    async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser:
        async with browser.post(f"{url}enter", data=code, headers=own) as answer:
            assert answer.status == 204
        async with browser.ws_connect(f"{url}live", headers=own, max_msg_size=0) as socket:
            page = Page(socket)
            yield page, await page.text()


@pytest.mark.slow
def test_without_leave_every_order_is_refused_and_does_nothing(folder: Path) -> None:
    async def look(link: str) -> None:
        async with opened(link) as (page, told):
            assert told["control"] is False
            assert "manual" not in told
            answer = await page.order("pause")
            assert answer == {
                "answer": "'pause' is refused: this page may look, not touch (--scope-control)",
                "error": True,
            }

    with running(folder / "bench.toml"), scope() as link:
        asyncio.run(look(link))
        drive(folder)
    assert [entry.args[0] for entry in entries(folder) if entry.op == "open"] == ["host0"]


@pytest.mark.slow
def test_a_driver_is_paused_stepped_and_let_go_and_the_journal_replays(folder: Path) -> None:
    reached: list[int] = []

    async def control(link: str) -> None:
        async with opened(link) as (page, told):
            assert told["control"] is True
            assert told["manual"]["chips"] == [{"name": "x", "addresses": 2}]
            assert (await page.order("pause"))["answer"] == "paused"
            driver = threading.Thread(target=lambda: reached.append(drive(folder)))
            driver.start()
            attached()
            for _ in range(3):
                await page.order("step", by="cycle")
                await page.until("the next bus cycle")
            answer = await page.order("step", by="condition", until="x.real > 100")
            assert answer["answer"] == "goes on until x.real > 100"
            await page.until("x.real > 100")
            assert reached == []
            saved = await page.order("journal.save")
            assert (await page.order("cycle", chip="x", address=0))["answer"].startswith("00H at ")
            answer = await page.order("fault.arm", name="jam", target="x")
            assert answer["answer"].startswith("#1 jam x")
            assert "jam" in (await page.order("fault.clear", which="all"))["answer"]
            assert (await page.order("pin", pin="x./RST", level="1"))["answer"] == (
                "x./RST is driven to 1"
            )
            refused = await page.order("snap.load")
            assert refused["error"] is True
            await page.order("go")
            while driver.is_alive():
                await asyncio.sleep(0.01)
            return Path(saved["done"]["file"])

    with running(folder / "bench.toml"), scope("--control") as link:
        copy = asyncio.run(control(link))
    assert abs(reached[0] - 500) <= 2
    assert copy.parent == folder / "run" / "journals"
    for journal in (folder / "run.vbj", copy):
        done = vbus("replay", journal)
        assert (done.returncode, done.stderr) == (0, ""), done.stdout
    labels = [entry.args[0] for entry in entries(folder) if entry.op == "open"]
    assert labels == ["scope", "host0"]


def processes_of(board: str) -> list[str]:
    """Return the processes that have a board's name in their command line."""
    found = []
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if board.encode() in line.read_bytes():
                found.append(line.parent.name)
    return found


@pytest.mark.slow
def test_rewind_opens_a_copy_as_it_was_then_and_leaves_the_board_alone(folder: Path) -> None:
    async def control(link: str) -> tuple[str, Path]:
        async with opened(link) as (page, _):
            await page.order("pause")
            assert (await page.order("rewind", to="soon"))["answer"] == (
                "'soon' is no duration; write a number with ps, ns, us, ms or s"
            )
            answer = await page.order("rewind", to="100 ms")
            assert answer["answer"] == "a copy of the board stands at 100 ms"
            async with opened(answer["link"]) as (copy, told):
                assert told["now"] == "100000000000"
                assert told["control"] is True
                assert re.fullmatch(r"bench-\d+", told["board"])
                # It goes on by itself: its hosts are not there.
                await copy.order("step", **{"by": "time", "for": "1 ms"})
                assert await copy.until("101000us") == 101_000_000_000
                assert (await copy.order("cycle", chip="x", address=0))["answer"].startswith("0")
                saved = await copy.order("journal.save")
            await page.order("go")
            return told["board"], Path(saved["done"]["file"])

    with running(folder / "bench.toml"), scope("--control") as link:
        reached = drive(folder)
        name, saved = asyncio.run(control(link))
        assert drive(folder)
    until(lambda: not processes_of(name), "the copy and its page end with the scope")
    assert abs(reached - 500) <= 2
    done = vbus("replay", saved)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    # What a journal has no board for, and a board no journal, is said in words.
    done = vbus("scope", folder / "run.vbj", "--at", "1 ms")
    assert done.returncode == 2
    assert "--at is for a journal that goes on as a board, with --control" in done.stderr


@pytest.mark.slow
def test_there_is_no_way_back_without_a_journal(folder: Path) -> None:
    async def control(link: str) -> None:
        async with opened(link) as (page, _):
            words = "this board keeps no journal, which begins at power-on: run it with"
            assert (await page.order("rewind"))["answer"] == f"no way back: {words} --journal FILE"
            assert (await page.order("journal.save"))["answer"] == f"{words} --journal FILE"

    file = folder / "bench.toml"
    file.write_text(file.read_text().partition("[record]")[0])
    with running(file), scope("--control") as link:
        asyncio.run(control(link))


@pytest.mark.slow
def test_a_program_is_paused_and_let_go_on_a_board_of_its_own(folder: Path) -> None:
    os.mkfifo(folder / "gate")
    gate = f"    open({str(folder / 'gate')!r}).read()\n    axis = "
    (folder / "move.py").write_text(MOVE.replace("    axis = ", gate))

    async def control(link: str) -> None:
        async with opened(link) as (page, told):
            assert told["control"] is True
            await page.order("pause")
            attached()
            assert (await page.order("back", to="0 s"))["answer"] == (
                "the live board goes back only when no other host is attached; here is host0"
            )
            await page.order("go")
            (folder / "gate").write_text("")

    process = start("exec", "--board", folder / "bench.toml", "--scope-control", "--",
                    sys.executable, folder / "move.py")  # fmt: skip
    assert process.stderr is not None
    line = process.stderr.readline()
    asyncio.run(control(link_in(line)))
    assert process.wait(timeout=60) == 0
    (pid,) = map(int, re.findall(r"\(process (\d+)\)$", line))
    os.kill(pid, signal.SIGTERM)
    process.communicate(timeout=60)
    labels = [entry.args[0] for entry in entries(folder) if entry.op == "open"]
    assert sorted(labels) == ["host0", "scope"]
    done = vbus("exec", "--join", "bench", "--scope-control", "--", "true")
    assert done.returncode == 2
    assert "a running board is taken in hand by: vbus scope NAME" in done.stderr


def test_who_may_give_no_orders_gets_no_session(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.serve.local_socket.user_behind", lambda fd: os.geteuid() + 1)
    board = build()
    with served(board):
        with closing(Feed("bench")) as feed:
            with pytest.raises(VbusError, match="this board takes orders from "):
                feed.ask("scope", control=True)
            assert not feed.ask("scope", control=False)["control"]
        assert board.ports == []
