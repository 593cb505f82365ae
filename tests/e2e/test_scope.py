"""``vbus scope``: pages of recorded runs, and of boards that run."""

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from threading import Thread
from typing import Any, TypeVar

import pytest
import trustme
from aiohttp import ClientSession, CookieJar

from tests.e2e.command import running, start, vbus
from tests.unit.views.scope.decoded import Seen, of_page
from tests.waiting import PATIENCE, Starved, until
from vbus import connect
from vbus.cli.look.scope_bookmarks import of_journal
from vbus.client.lm628 import Lm628
from vbus.record.format import Entry, JournalReader
from vbus.serve.registry import socket_path
from vbus.transports.runtime import socket_address

T = TypeVar("T")
BOARD = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "dc_motor"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
[record]
journal = "{folder}/run.vbj"
"""


SHOWN = """
[scope]
listen = "127.0.0.1:0"
"""
MOVE = """\
import os
from vbus import connect
from vbus.client.lm628 import Lm628
with connect(os.environ["VBUS_LINK"]) as bus:
    axis = Lm628(bus)
    axis.load_filter(kp=300, kd=2000)
    print(axis.move(500, acc=40, vel=2 << 16))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    (tmp_path / "bench.toml").write_text(BOARD.format(folder=tmp_path))
    return tmp_path


def drive(folder: Path, target: int = 500) -> int:
    with connect(f"unix:{folder}/run/x") as bus:
        axis = Lm628(bus)
        axis.load_filter(kp=300, kd=2000)
        return axis.move(target, acc=40, vel=2 << 16)


def told(look: Coroutine[Any, Any, T]) -> T:
    """Run what a page does; return what it was told."""
    try:
        return asyncio.run(look)
    except TimeoutError:
        raise Starved(f"in vain for {PATIENCE:g} s: what a page is told") from None


def seen_by_a_page(link: str, enough: Callable[[Seen], object], **order: Any) -> Seen:
    """Open a link as a browser does; return what it has been told once that is enough."""

    async def look() -> Seen:
        url, _, code = link.partition("#")
        own = {"Origin": url.rstrip("/")}
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser:
            async with browser.post(f"{url}enter", data=code, headers=own) as answer:
                assert answer.status == 204
            async with browser.ws_connect(f"{url}live", headers=own, max_msg_size=0) as page:
                description: dict[str, Any] = json.loads(await page.receive_str())
                if order:
                    await page.send_str(json.dumps(order))
                news: asyncio.Queue[bytes] = asyncio.Queue()

                async def read() -> None:
                    try:
                        while True:
                            news.put_nowait(await page.receive_bytes(timeout=PATIENCE))
                    finally:
                        news.put_nowait(b"")

                # At once: a page that does not answer because it decodes is given up.
                reading = asyncio.create_task(read())
                data = b""
                while not enough(seen := await asyncio.to_thread(Seen, description, data)):
                    data += (more := await news.get())
                    while not news.empty():
                        data += (more := news.get_nowait())
                    if not more:
                        await reading
                reading.cancel()
                return seen

    return told(look())


def orders(link: str, then: list[Any], *wanted: dict[str, Any]) -> list[Any]:
    """Open a link and order something, until the bookmarks are so; return those there were.

    A page is sent the newest bookmarks, not each change.
    """

    async def look() -> list[Any]:
        url, _, code = link.partition("#")
        own = {"Origin": url.rstrip("/")}
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser:
            async with browser.post(f"{url}enter", data=code, headers=own) as answer:
                assert answer.status == 204
            async with browser.ws_connect(f"{url}live", headers=own, max_msg_size=0) as page:
                had: list[Any] = json.loads(await page.receive_str())["bookmarks"]
                for order in wanted:
                    await page.send_str(json.dumps(order))
                now = had
                while now != then:
                    message = await page.receive(timeout=PATIENCE)
                    if isinstance(message.data, str):
                        now = json.loads(message.data).get("bookmarks", now)
                return had

    return told(look())


def at(place: int) -> Callable[[Seen], bool]:
    """Whether a page has seen the motor come to a place."""
    return lambda seen: [row[1] for row in seen.rows["x.real"]][-1:] == [place]


def held(seen: Seen, register: str) -> list[tuple[int, float]]:
    """What a register is told to hold; nothing before the chip is told of."""
    return seen.held("x", register) if seen.chips else []


def link_in(line: str) -> str:
    found = re.match(r"scope: (http://127\.0\.0\.1:\d+/#[\w-]{32})", line)
    assert found is not None, line
    return found[1]


def entries(folder: Path) -> list[Entry]:
    with (folder / "run.vbj").open("rb") as file:
        return list(JournalReader(file))


@pytest.mark.slow
def test_a_journal_is_one_file_the_same_each_time(folder: Path) -> None:
    with running(folder / "bench.toml"):
        reached = drive(folder)
    for name in ("a.html", "b.html"):
        done = vbus("scope", folder / "run.vbj", "-o", folder / name)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    page = (folder / "a.html").read_bytes()
    assert page == (folder / "b.html").read_bytes()
    seen = of_page(page)
    assert seen.description["board"] == "bench"
    assert not seen.description["live"]
    assert seen.rows["x.real"][-1][1] == reached
    # A journal that breaks off says so, and shows what there is.
    data = (folder / "run.vbj").read_bytes()
    (folder / "cut.vbj").write_bytes(data[:-30])
    done = vbus("scope", folder / "cut.vbj", "-o", folder / "c.html")
    told = vbus("explain", folder / "cut.vbj").stdout.splitlines()[-1]
    assert told.startswith(f"# {folder}/cut.vbj: ")
    assert done.returncode == 0
    assert done.stderr.startswith(f"vbus: {told.removeprefix('# ')}; what is before that is all")
    # And one that is damaged is refused as everywhere, and overwrites nothing.
    (folder / "bad.vbj").write_bytes(b"x" + data)
    done = vbus("scope", folder / "bad.vbj", "-o", folder / "c.html")
    assert (done.returncode, done.stderr) == (1, vbus("replay", folder / "bad.vbj").stderr)
    assert (folder / "c.html").exists()


@pytest.mark.slow
def test_a_recording_is_served(folder: Path) -> None:
    with running(folder / "bench.toml"):
        reached = drive(folder)
    process = start("scope", folder / "run.vbj", "--listen", "127.0.0.1:0")
    assert process.stdout is not None
    link = link_in(process.stdout.readline())
    seen = seen_by_a_page(link, lambda seen: seen.now >= 0)
    assert seen.rows["x.real"][-1][1] == reached
    assert seen.now == int(seen.description["now"])
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert link_in(out) != link


@pytest.mark.slow
def test_a_page_sees_a_running_board_as_its_journal_has_it(folder: Path) -> None:
    with running(folder / "bench.toml"):
        process = start("scope", "bench")
        assert process.stdout is not None
        link = link_in(process.stdout.readline())
        inside = seen_by_a_page(link, lambda seen: held(seen, "kp"), do="registers", on=True)
        reached = drive(folder)
        live = seen_by_a_page(link_in(process.stdout.readline()), at(reached))
    assert held(inside, "kp") == [(0, 0)]
    assert {name["name"] for name in live.chips[0]["commands"]} >= {"LFIL", "STT"}
    assert any(row["name"] == "LM-STA-1" for row in live.clauses)
    kept = [value for _, value in held(live, "kp")]
    assert kept[0] == 0
    assert 300 not in kept, "nobody looked at registers while it moved"
    assert live.description["live"]
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    watched = entries(folder)
    vbus("scope", folder / "run.vbj", "-o", folder / "run.html")
    whole = of_page((folder / "run.html").read_bytes())
    for lane in ("x.real", "x.desired", "x.error", "x.output", "x.current"):
        known = live.rows[lane]
        assert known == whole.rows[lane][: len(known)], lane
        assert len(known) > 10
    assert held(whole, "kp")[-1][1] == 300
    # One that is still open stands before others that were told.
    assert set(live.packets("x bus")) <= set(whole.packets("x bus"))
    assert len(live.packets("x bus")) > 100
    with running(folder / "bench.toml"):
        assert drive(folder) == reached
    assert entries(folder) == watched


@pytest.mark.slow
@pytest.mark.parametrize("sparse", [False, True])
def test_in_real_time_samples_are_recorded_always_or_while_a_page_is_open(
    folder: Path, sparse: bool
) -> None:
    board = folder / "bench.toml"
    board.write_text(board.read_text().replace("lockstep", "realtime"))
    back = Thread(target=drive, args=(folder, 0))

    def moved_back(seen: Seen) -> bool:
        if back.ident is None:
            back.start()
        return near(0)(seen)

    def near(place: int) -> Callable[[Seen], bool]:
        return lambda seen: any(abs(value - place) < 20 for _, value in seen.rows["x.real"][-1:])

    with running(board):
        process = start("scope", "bench", *(["--sparse"] if sparse else []))
        assert process.stdout is not None
        link = link_in(process.stdout.readline())
        drive(folder)
        unseen = seen_by_a_page(link, near(500)).rows["x.real"]
        seen = seen_by_a_page(link_in(process.stdout.readline()), moved_back).rows["x.real"]
        back.join()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert (len(unseen) > 100) is not sparse
    assert len(seen) - len(unseen) > 100


HERE = {"at": "5000000000", "text": "it <starts> here"}
THERE = {"at": "1000000", "text": "before"}


@pytest.mark.slow
def test_bookmarks_are_kept_beside_the_journal_and_in_its_page(folder: Path) -> None:
    with running(folder / "bench.toml"):
        drive(folder)
    process = start("scope", folder / "run.vbj")
    assert process.stdout is not None
    link = link_in(process.stdout.readline())
    set_, gone = ({"do": "bookmark", "bookmark": HERE}, {"do": "forget", "bookmark": THERE})
    had = orders(link, [THERE, HERE], set_, {"do": "bookmark", "bookmark": THERE}, set_)
    assert had == []
    link = link_in(process.stdout.readline())
    assert orders(link, [HERE], gone) == [THERE, HERE]
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    (runs,) = json.loads((folder / "run.vbj.bookmarks.json").read_text())["runs"].values()
    assert runs == [HERE]
    assert vbus("scope", folder / "run.vbj", "-o", folder / "a.html").returncode == 0
    assert of_page((folder / "a.html").read_bytes()).description["bookmarks"] == [HERE]


@pytest.mark.slow
def test_bookmarks_of_a_board_are_those_of_its_run_and_stay_with_its_journal(folder: Path) -> None:
    def begun(expected: list[Any]) -> subprocess.Popen[str]:
        process = start("scope", "bench")
        assert process.stdout is not None
        link = link_in(process.stdout.readline())
        assert orders(link, [HERE], {"do": "bookmark", "bookmark": HERE}) == expected
        return process

    def end(process: subprocess.Popen[str]) -> None:
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=60)[1] == ""

    for _ in range(2):
        with running(folder / "bench.toml"):
            drive(folder)
            end(begun([]))
            assert not (folder / "run.vbj.bookmarks.json").exists()
            process = begun([HERE])
        end(process)
        assert of_journal(folder / "run.vbj").all == [HERE]
        (folder / "run.vbj.bookmarks.json").unlink()


@pytest.mark.slow
def test_who_does_not_read_what_he_asked_for_keeps_no_host_waiting(folder: Path) -> None:
    with running(folder / "bench.toml") as (board, _):
        with (
            socket.socket(socket.AF_UNIX) as stuck,
            socket_address(socket_path("bench")) as address,
        ):
            stuck.connect(address)
            stuck.sendall(b'{"do": "watch", "scope": {}}\n')
            for _ in range(3):
                assert drive(folder)
        assert drive(folder)
        assert board.poll() is None


@pytest.mark.slow
def test_who_reads_late_gets_all_of_a_board_that_ends(folder: Path) -> None:
    with socket.socket(socket.AF_UNIX) as late, running(folder / "bench.toml") as (board, _):
        with socket_address(socket_path("bench")) as address:
            late.connect(address)
        late.sendall(b'{"do": "watch", "scope": {}}\n')
        for target in (900, 0, 900, 0, 900):
            reached = drive(folder, target)
        board.send_signal(signal.SIGINT)
        with late.makefile("rb") as told:
            data = told.read()
    messages = []
    while data:
        size = int.from_bytes(data[:4], "little")
        messages.append(data[4 : 4 + size])
        if len(messages[-1]) < size:
            raise Starved("the board was read by nobody for a second, and has hung up")
        data = data[4 + size :]
    description = json.loads(messages[0])["done"]
    frames = b"".join(messages[1:])
    seen = Seen(description, frames)
    assert len(frames) > 1 << 19, "more than a socket holds"
    assert seen.rows["x.real"][-1][1] == reached
    assert not seen.rows["left out"]


def shown(file: Path) -> tuple[subprocess.Popen[str], str, int]:
    """Run a board with a scope; return it, what the scope says first, and the scope's process."""
    board = start("run", file, "--scope")
    assert board.stderr is not None
    line = board.stderr.readline()
    (pid,) = map(int, re.findall(r"\(process (\d+)\)$", line))
    return board, line, pid


@pytest.mark.slow
def test_a_board_that_lets_others_in_can_be_shown_to_this_computer_alone(folder: Path) -> None:
    mine = trustme.CA().issue_cert("localhost")
    mine.cert_chain_pems[0].write_to_path(folder / "cert.pem")
    mine.private_key_pem.write_to_path(folder / "key.pem")
    secured = SHOWN.replace("127.0.0.1", "0.0.0.0") + (
        f'remote = true\ncertificate = "{folder}/cert.pem"\nkey = "{folder}/key.pem"\n'
    )
    (folder / "open.toml").write_text((folder / "bench.toml").read_text() + secured)
    board, line, pid = shown(folder / "open.toml")
    try:
        assert line.startswith("scope: https://127.0.0.1:")
        board.send_signal(signal.SIGINT)
        board.communicate(timeout=PATIENCE)
    finally:
        os.kill(pid, signal.SIGTERM)


@pytest.mark.slow
def test_a_run_with_a_scope_is_outlived_by_it(folder: Path) -> None:
    board, line, pid = shown(folder / "bench.toml")
    try:
        reached = drive(folder)
        board.send_signal(signal.SIGINT)
        assert board.wait(timeout=60) == 0
        # What stays holds no pipe of who has started the run.
        board.communicate(timeout=60)
        seen = seen_by_a_page(link_in(line), at(reached))
        assert seen.packets("x bus")
    finally:
        os.kill(pid, signal.SIGTERM)
    until(lambda: not Path(f"/proc/{pid}").exists(), "the end of the scope")


@pytest.mark.slow
def test_a_page_that_was_open_when_its_run_ended_can_be_loaded_anew(folder: Path) -> None:
    board, line, pid = shown(folder / "bench.toml")
    url, _, code = link_in(line).partition("#")

    async def look() -> int:
        own = {"Origin": url.rstrip("/")}
        async with ClientSession(cookie_jar=CookieJar(unsafe=True), headers=own) as browser:
            async with browser.post(f"{url}enter", data=code) as answer:
                assert answer.status == 204
            async with browser.ws_connect(f"{url}live", max_msg_size=0) as page:
                await page.receive_str()
                board.send_signal(signal.SIGINT)
                await asyncio.to_thread(board.communicate)
            async with browser.ws_connect(f"{url}live", max_msg_size=0) as page:
                return len(await page.receive_str())

    try:
        assert asyncio.run(look())
    finally:
        os.kill(pid, signal.SIGTERM)


def test_what_makes_no_sense_is_refused(folder: Path) -> None:
    done = vbus("scope", "nobody")
    assert done.returncode == 4
    assert 'no board called "nobody" can be watched' in done.stderr
    done = vbus("scope", "nobody", "-o", folder / "a.html")
    assert done.returncode == 2
    assert "-o is for journals, and nobody is none" in done.stderr
    for arguments in (("run", folder / "bench.toml"), ("demo",), ("scope", "nobody")):
        option = "--listen" if arguments[0] == "scope" else "--scope"
        done = vbus(*arguments, option, "0.0.0.0:80")
        assert done.returncode == 2
    (folder / "open.toml").write_text((folder / "bench.toml").read_text() + SHOWN.replace(
        "127.0.0.1", "0.0.0.0"))  # fmt: skip
    done = vbus("check", folder / "open.toml")
    assert done.returncode == 3
    assert (
        'scope.listen: "0.0.0.0:0" lets other computers in; write "127.0.0.1:0", or remote = true'
        " with certificate and key in [scope] if that is meant" in done.stderr
    )
    done = vbus("exec", "--join", "bench", "--scope", "--", "true")
    assert done.returncode == 2
    assert "--scope goes with --board; a running board is shown by: vbus scope" in done.stderr
    (folder / "nodes.toml").write_text((folder / "bench.toml").read_text().replace(
        'plant = "motor"', 'plant = "motor"\nnode = "a"').replace("[record]", "").replace(
        f'journal = "{folder}/run.vbj"', "") + "[nodes.a]\n")  # fmt: skip
    done = vbus("run", folder / "nodes.toml", "--scope-control")
    assert done.returncode == 2
    told = " ".join(done.stderr.replace("│", " ").split())
    assert "--scope-control is for boards without nodes: a node's time is that of all nodes" in told
    done = vbus("scope", folder / "nodes.toml", "nobody")
    assert done.returncode == 2
    assert "nodes.toml is a journal and nobody is none" in " ".join(done.stderr.split())


@pytest.mark.slow
def test_a_program_begins_when_its_scope_has_joined(folder: Path) -> None:
    (folder / "shown.toml").write_text((folder / "bench.toml").read_text() + SHOWN)
    (folder / "move.py").write_text(MOVE)
    for board, option in (("bench", ("--scope",)), ("shown", ())):
        done = start("exec", "--board", folder / f"{board}.toml", *option, "--", sys.executable,
                     folder / "move.py")  # fmt: skip
        assert done.stderr is not None
        line = done.stderr.readline()  # nothing is said before it, however soon the program ends
        said = re.search(r"^scope: .*\(process (\d+)\)$", line)
        assert said is not None, line
        pid = int(said[1])
        try:
            assert done.wait(timeout=60) == 0
            assert done.stdout is not None
            out = done.stdout.read()
            seen = seen_by_a_page(link_in(line), at(int(out)))
            assert seen.rows["x.real"][0] == (0, 0)
            assert next(iter(seen.packets("x bus")))[0] < 1_000_000_000
        finally:
            os.kill(pid, signal.SIGTERM)
        done.communicate(timeout=60)
