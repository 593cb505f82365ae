"""Clients and protocols against a served board with real chips, in lockstep."""

import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.examples.boards import compile_c, run
from vbus.board.build import load_board_text
from vbus.client import Bus, Units, connect
from vbus.client import aio as client_aio
from vbus.client.aio.lm628 import Lm628 as AioLm628
from vbus.client.links import open_link
from vbus.client.lm628 import Lm628
from vbus.core.errors import ProtocolError
from vbus.protocols.frames import FrameReader, frame
from vbus.serve.server import LinkSpec

ROOT = Path(__file__).parents[2]
BOARD = """\
[board]
name = "bench"
time = "lockstep"

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "mx"

[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "my"

[plants.mx]
model = "ideal"

[plants.my]
model = "ideal"
"""
LINKS = {
    "pty": LinkSpec("pty:$VBUS_RUNTIME/x", "byte"),
    "unix": LinkSpec("unix:$VBUS_RUNTIME/x.sock", "byte"),
    "tcp": LinkSpec("tcp:127.0.0.1:0", "byte"),
    "text": LinkSpec("pty:$VBUS_RUNTIME/text", "text"),
    "framed": LinkSpec("unix:$VBUS_RUNTIME/framed.sock", "framed"),
}


@pytest.fixture
def links(runtime: Path) -> Iterator[dict[str, str]]:
    """Serve the board; give the address of each kind of link."""
    with served(load_board_text(BOARD), *LINKS.values()) as server:
        urls = [link["url"] for link in server.statistics()["links"]]
        yield dict(zip(LINKS, urls, strict=True))


@pytest.fixture
def bus(links: dict[str, str]) -> Iterator[Bus]:
    with connect(links["pty"]) as bus:
        bus.delay("2ms")
        yield bus


def pulse_reset(bus: Bus, chip: str) -> None:
    bus.pin(f"{chip}./RST", 0)
    bus.delay("12us")
    bus.pin(f"{chip}./RST", 1)


@pytest.mark.parametrize("kind", ["pty", "unix", "tcp"])
def test_hello_describes_the_board_over_every_kind_of_link(
    links: dict[str, str], kind: str
) -> None:
    with connect(links[kind]) as bus:
        assert (bus.info.board, bus.info.policy) == ("bench", "lockstep")
        assert [(chip.name, chip.part) for chip in bus.info.chips] == [
            ("x", "LM629N-8"), ("y", "LM629N-8"),
        ]  # fmt: skip
        assert "x./RST" in bus.info.pins


@pytest.mark.spec("LM-RST-4", "LM-RST-5", "LM-RST-6")
def test_the_reset_check_passes_after_a_pulse_of_the_reset_pin(bus: Bus) -> None:
    axis = Lm628(bus, "x")
    pulse_reset(bus, "x")
    assert axis.status() == 0x00
    assert axis.check_reset() == 0x80


@pytest.mark.spec("LM-T-5")
@pytest.mark.parametrize("ready", ["poll", "wait"])
def test_a_short_move_lands_exactly(bus: Bus, ready: str) -> None:
    axis = Lm628(bus, "y", ready=ready)
    assert axis.check_reset() == 0x80
    axis.load_filter(kp=1)
    assert axis.move(20, acc=0x10000, vel=0x40000) == 20
    assert (axis.rddp(), axis.rddv()) == (20, 0)
    assert axis.rdsigs() & 0x0400
    axis.move(-20, relative=True)
    bus.delay("1ms")
    assert (axis.rddp(), axis.rdrp()) == (0, 0)


def test_a_move_in_turns_and_seconds(bus: Bus) -> None:
    units = Units.of_clock(2000, 8_000_000)
    axis = Lm628(bus, "x")
    axis.load_filter(kp=1)
    acc, vel = units.acceleration(25), units.velocity(5)
    start = bus.now()
    position = axis.move(units.position(2), acc=acc, vel=vel)
    assert units.turns(position) == 2.0
    # 0.2 s up, 0.2 s down, and the rest of the two turns at 5 turns/s.
    assert 0.59e12 < bus.now() - start < 0.62e12


def test_velocity_mode_and_stops(bus: Bus) -> None:
    axis = Lm628(bus, "x")
    axis.load_filter(kp=1)
    axis.load_trajectory(acc=0x10000, vel=0x40000, velocity_mode=True, forward=False, start=True)
    bus.delay("10ms")
    assert axis.rddv() == -0x40000
    axis.rsti(0)
    axis.stop()
    axis.wait_status()
    assert axis.rddv() == 0
    bus.delay("1ms")
    assert axis.rddp() == axis.rdrp() < -100
    axis.stop("off")
    axis.wait_ready()
    bus.delay("1ms")
    assert axis.status() & 0x80


@pytest.mark.asyncio
async def test_the_asyncio_client_moves_an_axis(links: dict[str, str]) -> None:
    async with await client_aio.connect(links["unix"]) as bus:
        await bus.delay("2ms")
        axis = AioLm628(bus, "x")
        assert await axis.check_reset() == 0x80
        await axis.load_filter(kp=1)
        assert await axis.move(-500, acc=0x8000, vel=0x28000) == -500


def test_two_chips_are_written_in_one_strobe(bus: Bus) -> None:
    bus.chip("x", "y").write(0, 0x02)
    bus.chip("x").write(0, 0x00)
    bus.delay("2ms")
    assert [bus.chip(name).read(0) for name in ("x", "y")] == [0x84, 0x84]
    bus.chip("x", "y").writes(0, b"\x1d")
    bus.delay("20us")
    bus.chip("x", "y").writes(1, b"\x00\x00")
    bus.delay("20us")
    assert [bus.chip(name).read(0) for name in ("x", "y")] == [0x80, 0x80]


def test_strobes_by_name_read_the_status(bus: Bus) -> None:
    bus.lines({"x./CS": 0, "x./PS": 0})
    bus.delay("30ns")
    bus.lines({"x./RD": 0})
    bus.delay("180ns")
    assert bus.sample().data == 0x84
    bus.lines({"x./RD": 1, "x./CS": 1, "x./PS": 1})


def test_the_host_interrupt_is_reported_as_an_event(bus: Bus) -> None:
    axis = Lm628(bus, "x")
    axis.rsti(0)
    bus.delay("1ms")
    line = 1 << bus.info.outputs.index("x.HI")
    assert not bus.sample().outputs & line
    axis.load_filter(kp=1)
    bus.events("x.HI")
    axis.load_trajectory(acc=0x10000, vel=0x10000, pos=10, start=True)
    assert bus.take_events() == []
    bus.delay("10ms")
    bus.echo()
    (event,) = bus.take_events()
    assert event.outputs & line
    assert event.instant % 256_000_000 == 0


def test_a_claim_keeps_others_out_until_it_is_given_back(links: dict[str, str]) -> None:
    order: list[str] = []
    with connect(links["pty"]) as first, connect(links["unix"]) as second:
        with first.claim():
            started = threading.Event()

            def other() -> None:
                started.set()
                with second.claim():
                    order.append("second")

            thread = threading.Thread(target=other)
            thread.start()
            started.wait()
            first.read(0)
            order.append("first")
        first.echo()
        thread.join()
    assert order == ["first", "second"]


def test_a_mistake_of_one_session_leaves_the_others_alone(links: dict[str, str]) -> None:
    with connect(links["pty"]) as good, connect(links["unix"]) as bad:
        bad.link.write(memoryview(b"\xff\x00\x10"))
        with pytest.raises(ProtocolError, match=r"was refused: unknown request$"):
            bad.echo()
        assert good.echo(1) == 1
    with connect(links["unix"]) as again:
        assert again.echo(2) == 2


# -- text, frames, shell ---------------------------------------------------------------------------


def test_the_text_protocol_on_a_terminal(links: dict[str, str]) -> None:
    with open(links["text"].removeprefix("pty:"), "r+b", buffering=0) as terminal:

        def say(line: str) -> str:
            terminal.write(line.encode() + b"\n")
            answer = b""
            while not answer.endswith(b"\n"):
                answer += terminal.read(1)
            return answer.decode().strip()

        assert say("step 2ms") == "2000us"
        assert say("r 0") == "84"
        assert say("chips") == "x LM629N-8 selected, y LM629N-8"
        assert say("select y") == "ok"
        assert say("w 0 1d") == "ok"
        assert re.fullmatch(r"ready 20\d\dus", say("wait 100us"))
        assert say("w 1 0 0") == "ok"
        assert re.fullmatch(r"ready 20\d\dus", say("wait 100us"))
        assert say("r 0") == "80"
        assert say("pin /RST 0") == "ok"
        assert say("r 0 junk").startswith("error: count 'junk' is no hexadecimal number; ")
        assert say("frob").startswith("error: unknown request 'frob'; allowed are r, w, select, ")


def test_the_framed_protocol_on_a_socket(links: dict[str, str]) -> None:
    link = open_link(links["framed"])
    reader = FrameReader()

    def say(data: bytes) -> tuple[int, bytes]:
        link.write(memoryview(data))
        while (found := reader.next()) is None:
            reader.feed(link.read())
        return found

    delay = b"\x50" + (2_000_000_000).to_bytes(8, "big")
    assert say(frame(0, b"")) == (0, b"")
    assert say(frame(1, delay + b"\x10")) == (1, b"D\x84")
    assert say(b"\xa5\xa5noise" + b"\0" * 260 + frame(2, b"\x02\x07")) == (2, b"E\x07")
    assert say(frame(2, b"\x02\x07")) == (2, b"E\x07")
    link.close()


def blocks(language: str) -> list[str]:
    page = (ROOT / "docs" / "clients.md").read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", page, re.MULTILINE | re.DOTALL)


def test_the_python_on_the_page_on_clients(
    links: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    for block in blocks("python"):
        exec(compile(block, "docs/clients.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == [
        "bench ['LM629N-8', 'LM629N-8']", "status 84h", "real position 0", "4000 8504h",
    ]  # fmt: skip


def test_the_c_on_the_page_on_clients(links: dict[str, str], tmp_path: Path) -> None:
    (source,) = blocks("c")
    (tmp_path / "host.c").write_text(source)
    host = compile_c(tmp_path / "host", str(tmp_path / "host.c"))
    assert run(host, links["pty"]) == "status 84h\n"
