"""The end of time: every chip, plant and wire format works up to it, and nothing goes beyond.

What is beyond is refused before any sum is made that a machine word could not hold, so these tests
are for the compiled core above all.
"""

from collections.abc import Iterator
from random import Random

import pytest

from tests.unit.faults.bench import DC, IDEAL, LM, MC, MCP, STEPPER, Lm, Mc, Mcp, build, settle
from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.core.kernel import END, HELD, MS, NEVER, SECOND, US
from vbus.protocols import codes
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.port import HostPort, PortError
from vbus.protocols.requests import REQUESTS
from vbus.protocols.text import TextProtocol

ALL = [(LM, DC), (LM, IDEAL), (MCP, DC), (MCP, IDEAL), (MCP, STEPPER), (MC, STEPPER), (MC, IDEAL)]
SPIN = {LM: Lm, MCP: Mcp, MC: Mc}


def u64(number: int) -> bytes:
    return number.to_bytes(8, "big")


def near_the_end(chip: str, plant: str, left: int = 3 * MS, policy: str = "lockstep") -> Board:
    """Return a board that has rested until so long before the end."""
    board = build(chip, plant, policy=policy)
    board.run_until(END - left)
    return board


def say(board: Board, port: HostPort, wire: ByteProtocol, data: bytes) -> bytes:
    """Give bytes to a wire format and let time pass as far as they ask."""
    wire.receive(data)
    while port.held:
        assert port.hold_until <= END
        board.run_until(max(port.hold_until, board.now))
        if port.go_on():
            wire.resume()
    wire.report_events()
    return wire.take()


def requests(random: Random) -> Iterator[bytes]:
    """Yield requests of every kind, with spans about as long as what is left."""
    rows = [row for row in REQUESTS if row.name not in ("HELLO", "CLAIM", "UNCLAIM")]
    while True:
        row = random.choice(rows)
        values: list[int | bytes] = [random.randrange(row.span)] if row.span > 1 else []
        for field in row.layout.fields:
            if field.kind == "u64":
                span = random.choice((random.randrange(10**6), random.randrange(10**9), 1 << 63))
                values.append(abs(END - span) if field.name == "instant" else span)
            elif field.kind == "bytes8":
                values.append(random.randbytes(4))
            elif field.name in ("a", "on", "level"):
                values.append(random.randrange(3))
            else:
                values.append(random.randrange(1 << int(field.kind[1:])))
        yield row.pack(*values)


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
@pytest.mark.parametrize(("chip", "plant"), ALL)
def test_whatever_a_host_asks_for_near_the_end_is_answered_or_refused(
    chip: str, plant: str, policy: str
) -> None:
    for seed in range(8):
        random = Random(seed)
        board = near_the_end(chip, plant, policy=policy)
        port = board.open_port("host0")
        wire = ByteProtocol(port)
        if seed % 2:
            SPIN[chip](board).spin()
        for request, _ in zip(requests(random), range(120), strict=False):
            say(board, port, wire, request)
            assert board.now <= END
        state = board.save()
        board.load(state)
        assert board.save() == state
        say(board, port, wire, b"\x50" + u64(END - board.now))
        with pytest.raises(PortError, match=f"time ends at {END} ps"):
            port.delay(END + 1 - board.now)
        board.run_until(END)
        board.catch_up()
        assert port.sync()[1] > END, "nothing is due any more"
        wire.reset()
        port.close()


@pytest.mark.parametrize(("chip", "plant"), ALL)
def test_strobes_across_the_last_millisecond_do_not_hang_and_sync_finds_no_edge(
    chip: str, plant: str
) -> None:
    board = near_the_end(chip, plant)
    port = board.open_port("host0")
    wire = ByteProtocol(port)
    for request in ("440200", "50000000003b9aca00", "21f9", "440401", "440202"):
        say(board, port, wire, bytes.fromhex(request))
    assert say(board, port, wire, b"\x53")[:1] == b"S"
    assert board.now == END - 2 * MS + US


def strobed(board: Board) -> list[tuple[str, int]]:
    """Move every line and side pin twice; return the rules that breaks, and by how much."""
    port = board.open_port("host0")
    port.delay(US)  # from here on strobes carry real times
    info = port.info()
    for name in info.lines * 2:
        bit = 1 << port.line_number(name)
        for level in (0, bit):
            port.lines(bit, level)
            port.delay(20 * US)
    for number in range(len(info.pins)):
        for level in (0, 1, 2):
            port.pin(number, level)
            port.delay(20 * US)
    return [(violation.rule, violation.measured) for violation in board.violations]


@pytest.mark.parametrize(("chip", "plant"), ALL)
def test_an_edge_that_never_was_is_long_ago_at_the_end_too(chip: str, plant: str) -> None:
    assert strobed(near_the_end(chip, plant)) == strobed(near_the_end(chip, plant, END - 1 * MS))


@pytest.mark.parametrize("leasing", [1, 2])
@pytest.mark.parametrize(("chip", "plant"), ALL)
def test_what_is_promised_to_a_host_ends_with_time_and_another_can_come(
    chip: str, plant: str, leasing: int
) -> None:
    board = near_the_end(chip, plant)
    port = board.open_port("host0")
    wire = ByteProtocol(port)
    say(board, port, wire, bytes((0x61, leasing)))
    for address in (0, 1):
        say(board, port, wire, bytes((0x10 | address,)))
    board.open_port("host1")
    assert board.now <= END


@pytest.mark.parametrize("stands", [1 << 62, END - 60 * MS])
@pytest.mark.parametrize(("chip", "plant"), [(LM, DC), (MC, STEPPER)])
def test_what_waits_for_a_clock_that_stands_does_not_come_before_it_runs(
    chip: str, plant: str, stands: int
) -> None:
    board = build(chip, plant)
    board.run_until(stands)
    host: HostBus = SPIN[chip](board).port
    host.write(*((0, 0x1E) if chip == LM else (1, 0x39)))
    left = board.chip("x").ready_at() - board.now
    assert left > 0
    fault = board.faults.arm("clock_stopped")
    settle(board, 20)
    assert board.chip("x").ready_at() == HELD + left
    board.faults.clear(fault)
    assert board.chip("x").ready_at() == board.now + left


@pytest.mark.parametrize(
    ("when", "until"),
    [(END + 1, None), (None, END + 1), ("at 9151315 s", None), (None, "for 9151315 s")],
)
def test_a_fault_beyond_the_end_is_refused(when: int | str | None, until: int | str | None) -> None:
    board = build(LM, DC)
    with pytest.raises(ValueError, match=r"time ends at 9151314 s; nothing takes longer$"):
        board.faults.arm("clock_stopped", when=when, until=until)
    assert not board.faults.all()
    board.faults.arm("clock_stopped", when=END)


def test_every_wire_format_refuses_what_lies_beyond_in_words() -> None:
    board = near_the_end(LM, DC, 2 * SECOND)
    port = board.open_port("host0")
    text = TextProtocol(port)
    text.receive(b"step 3s\nwait 9999999s\n")
    assert (
        text.take()
        == (
            f"error: delay {3 * SECOND}: time ends at {END} ps\n"
            "error: '9999999s' is too long; at most 9151314 s are possible\n"
        ).encode()
    )
    with pytest.raises(PortError) as refused:
        port.delay(2 * SECOND + 1)
    assert refused.value.code == codes.BAD_AT
    assert port.wait(NEVER) == (True, END - 2 * SECOND)


@pytest.mark.parametrize("when", [END + 1, NEVER, (1 << 64) - 1])
def test_a_time_stamp_beyond_is_refused_however_it_comes(when: int) -> None:
    board = build(LM, DC, policy="slaved")
    port = board.open_port("host0")
    wire = ByteProtocol(port)
    assert say(board, port, wire, b"\x51" + u64(when)) == b"X\x03\x00\x00"
    assert say(board, port, wire, b"\x55\x00" + u64(when) + b"\x00") == b"X\x03\x00\x01"
    assert say(board, port, wire, b"\x51" + u64(END - 5) + b"\x53")[:1] == b"S"
    assert board.now == END - 5
    assert say(board, port, wire, b"\x56" + u64(when))[:1] == b"W", "PASS ends where time does"
    assert board.now == END
    assert say(board, port, wire, b"\x51" + u64(END) + b"\x53")[:1] == b"S"
    assert say(board, port, wire, b"\x56" + u64(1))[5:] == u64(0)
