"""The LM628's calls: packets word by word, and the calls made from the command table."""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from tests.unit.client.served import Served
from tests.unit.fake_port import FakePort
from vbus.chips.lm628.datasheet import COMMANDS
from vbus.chips.tables import Command, CommandTable
from vbus.client import Bus, connect
from vbus.client.aio import access
from vbus.client.aio.access import calls_of
from vbus.client.aio.lm628 import Lm628 as AsyncioLm628
from vbus.client.blocking import blocking
from vbus.client.lm628 import Lm628, Lm628Calls
from vbus.core.errors import NotReadyError


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Served]:
    with Served("unix", tmp_path) as board:
        board.port.answers = {0: [0x00]}
        yield board


@pytest.fixture
def bus(board: Served) -> Iterator[Bus]:
    with connect(board.where) as bus:
        yield bus


@pytest.fixture(params=["poll", "wait"])
def axis(request: pytest.FixtureRequest, bus: Bus) -> Lm628:
    return Lm628(bus, "x", ready=request.param)


def packet(port: FakePort) -> list[tuple[object, ...]]:
    """Return the writes and data reads so far."""
    return [call for call in port.calls if call[0] == "write" or call == ("read", 1)]


def command(code: int, *words: int) -> list[tuple[object, ...]]:
    calls: list[tuple[object, ...]] = [("write", 0, code)]
    for word in words:
        calls += [("write", 1, word >> 8), ("write", 1, word & 0xFF)]
    return calls


def test_every_command_has_a_call_and_every_call_a_command() -> None:
    calls = {name for name in vars(Lm628Calls) if not name.startswith("_")}
    assert calls == {row.name.lower() for row in COMMANDS}


@pytest.mark.parametrize(
    ("call", "written"),
    [
        (lambda axis: axis.stt(), command(0x01)),
        (lambda axis: axis.mski(0x0004), command(0x1C, 0x0004)),
        (lambda axis: axis.sbpa(-2), command(0x20, 0xFFFF, 0xFFFE)),
        (lambda axis: axis.ltrj(0x0002, 0x0003, 0x0D40), command(0x1F, 2, 3, 0x0D40)),
        (
            lambda axis: axis.load_filter(kp=100, kd=0x7FFF, ds=2),
            command(0x1E, 0x020A, 100, 0x7FFF) + command(0x04),
        ),
        (
            lambda axis: axis.load_filter(ki=5, il=6, update=False),
            command(0x1E, 0x0005, 5, 6),
        ),
        (
            lambda axis: axis.load_trajectory(acc=15, vel=0x6D1EC, pos=200_000, start=True),
            command(0x1F, 0x002A, 0, 15, 6, 0xD1EC, 3, 0x0D40) + command(0x01),
        ),
        (
            lambda axis: axis.load_trajectory(pos=-1, relative=True),
            command(0x1F, 0x0003, 0xFFFF, 0xFFFF),
        ),
        (
            lambda axis: axis.load_trajectory(acc=-1, vel=-2, relative=True),
            command(0x1F, 0x003C, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFE),
        ),
        (
            lambda axis: axis.load_trajectory(vel=0x10000, velocity_mode=True),
            command(0x1F, 0x1808, 1, 0),
        ),
        (
            lambda axis: axis.load_trajectory(velocity_mode=True, forward=False),
            command(0x1F, 0x0800),
        ),
        (lambda axis: axis.stop(), command(0x1F, 0x0400) + command(0x01)),
        (lambda axis: axis.stop("abruptly"), command(0x1F, 0x0200) + command(0x01)),
        (lambda axis: axis.stop("off"), command(0x1F, 0x0100) + command(0x01)),
    ],
)  # fmt: skip
def test_a_call_writes_its_packet_high_byte_first(
    axis: Lm628, board: Served, call: Callable[[Lm628], None], written: list[tuple[object, ...]]
) -> None:
    call(axis)
    axis.bus.echo()
    assert packet(board.port) == written


def test_a_long_value_is_read_high_word_first(axis: Lm628, board: Served) -> None:
    board.port.answers[1] = [0xFF, 0xFF, 0xF2, 0xC0]
    assert axis.rdrp() == -3392
    assert packet(board.port) == [("write", 0, 0x0A)] + [("read", 1)] * 4


def test_a_word_is_read_unsigned_or_signed_as_the_table_says(axis: Lm628, board: Served) -> None:
    board.port.answers[1] = [0x81, 0x84]
    assert axis.rdsigs() == 0x8184
    board.port.answers[1] = [0x81, 0x84]
    assert axis.rdrv() == 0x8184 - 0x10000


def test_busy_is_polled_before_every_command_and_word(bus: Bus, board: Served) -> None:
    board.port.answers[0] = [1, 1, 0, 0, 1, 0]
    Lm628(bus).mski(0x0102)
    bus.echo()
    assert board.port.calls == [
        ("read", 0), ("read", 0), ("read", 0), ("write", 0, 0x1C), ("read", 0),
        ("write", 1, 1), ("write", 1, 2),
    ]  # fmt: skip


def test_a_packet_whose_waiting_the_board_does_is_one_message(bus: Bus, board: Served) -> None:
    axis = Lm628(bus, ready="wait")
    board.messages.clear()
    board.port.answers[1] = [0, 0, 0, 7]
    assert axis.rdrp() == 7
    assert len(board.messages) == 1
    ms10 = ("wait", 10_000_000_000)
    assert board.port.calls == [
        ms10, ("write", 0, 0x0A), ms10, ("read", 1), ("read", 1), ms10, ("read", 1), ("read", 1),
    ]  # fmt: skip


def test_a_chip_that_stays_busy_is_given_up(bus: Bus, board: Served) -> None:
    board.port.answers[0] = [1]
    axis = Lm628(bus, polls=30)
    with pytest.raises(NotReadyError, match=r"^the chip is still busy after 30 status reads$"):
        axis.stt()
    assert board.port.calls == [("read", 0)] * 30


def test_a_chip_the_board_waits_for_in_vain_is_given_up(bus: Bus, board: Served) -> None:
    board.port.busy_until = 10**15
    with pytest.raises(NotReadyError, match=r"^the chip is still busy after 10ms$"):
        Lm628(bus, ready="wait").stt()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda axis: axis.load_filter(kp=0x8000), "kp = 32768: allowed are 0 to 32767"),
        (lambda axis: axis.load_filter(ds=256), "ds = 256: allowed are 0 to 255"),
        (lambda axis: axis.load_trajectory(acc=-1), "acc = -1: allowed are 0 to 1073741823"),
        (
            lambda axis: axis.load_trajectory(vel=1 << 30, relative=True),
            "vel = 1073741824: allowed are -1073741823 to 1073741823",
        ),
        (
            lambda axis: axis.load_trajectory(pos=1 << 30),
            "pos = 1073741824: allowed are -1073741824 to 1073741823",
        ),
        (lambda axis: axis.stop("now"), "stop 'now': allowed are smoothly, abruptly, off"),
        (lambda axis: axis.mski(0x10000), "65536 does not fit into 16 bits"),
        (lambda axis: axis.sbpa(1 << 32), "4294967296 does not fit into 32 bits"),
        (
            lambda axis: Lm628(axis.bus, ready="guess"),
            "ready = 'guess': allowed are 'poll' and 'wait'",
        ),
    ],
)
def test_a_value_out_of_range_is_refused_before_anything_is_written(
    axis: Lm628, board: Served, call: Callable[[Lm628], None], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        call(axis)
    assert str(caught.value) == message
    axis.bus.echo()
    assert packet(board.port) == []


@pytest.mark.spec("LM-RST-5", "LM-RST-6")
@pytest.mark.parametrize(("after", "cleared"), [(0x84, 0x80), (0xC4, 0xC0)])
def test_the_reset_check_demands_84_then_80_or_c4_then_c0(
    bus: Bus, board: Served, after: int, cleared: int
) -> None:
    board.port.answers[0] = [0x00, 0x00, after, after, after, cleared]
    assert Lm628(bus).check_reset() == cleared
    assert packet(board.port) == command(0x1D, 0)
    assert [call for call in board.port.calls if call[0] == "delay"] == [("delay", 10**8)] * 2


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        (
            [0x00],
            "status 00h for 10ms; after a reset it is 84h or C4h: a chip that was in use needs"
            r" reset\(\) first",
        ),
        ([0x84, 0x84, 0x84, 0x84], "status 84h after RSTI; 80h or C0h is required"),
    ],
)
def test_a_reset_that_went_wrong_is_told(
    bus: Bus, board: Served, answers: list[int], message: str
) -> None:
    board.port.answers[0] = answers
    with pytest.raises(NotReadyError, match=f"^{message}$"):
        Lm628(bus).check_reset()


def test_waiting_for_a_status_bit_lets_chip_time_pass(bus: Bus, board: Served) -> None:
    board.port.answers[0] = [0x80, 0x80, 0x84]
    assert Lm628(bus).wait_status(0x04, every="2ms") == 0x84
    assert [call for call in board.port.calls if call[0] == "delay"] == [("delay", 2 * 10**9)] * 2
    with pytest.raises(NotReadyError, match=r"^status 84h after 5ms; none of the bits 20h is set$"):
        Lm628(bus).wait_status(0x20, longest="5ms")


def test_a_move_resets_the_flag_loads_starts_and_waits(axis: Lm628, board: Served) -> None:
    board.port.answers = {0: [0x04], 1: [0, 0, 1, 0]}
    assert axis.move(256, acc=1, vel=2) == 256
    writes = [call for call in packet(board.port) if call[0] == "write"]
    assert writes == (
        command(0x1D, 0xFFFB)
        + command(0x1F, 0x0028, 0, 1, 0, 2)
        + command(0x1F, 0x0002, 0, 256)
        + command(0x01)
        + command(0x0A)
    )


TABLE = CommandTable(
    Command("GO", 0x01, clause="T-1", title="go there", note="1"),
    Command("SET", 0x02, write=1, signed=True, clause="T-2", title="set it"),
    Command("LONG", 0x03, write=2, clause="T-3", title="set more"),
    Command("LOAD", 0x04, write=1, up_to=3, clause="T-4", title="load"),
    Command("GET", 0x05, read=1, clause="T-5", title="get it"),
    Command("DEEP", 0x06, read=2, signed=True, fraction=16, clause="T-6", title="get more"),
)


def test_a_call_is_made_typed_and_documented_for_each_row(bus: Bus, board: Served) -> None:
    sheet = ModuleType("made.datasheet")
    sheet.__dict__.update(COMMANDS=TABLE, NOTES={"1": "At any time."})
    calls = blocking(calls_of("Made", access.Packets, sheet))
    assert {
        name: f"{inspect.signature(call)} {call.__doc__}"
        for name, call in vars(calls).items()
        if not name.startswith("_")
    } == {
        "go": "(self) -> None Go there (GO, 01H, T-1).\n\nAt any time.",
        "set": "(self, value: int) -> None Set it (SET, 02H, T-2).\n\nArgs:\n"
        "    value: 16 bits, two's complement,\n        -32768 to 32767.",
        "long": "(self, value: int) -> None Set more (LONG, 03H, T-3).\n\nArgs:\n"
        "    value: 32 bits, unsigned,\n        0 to 4294967295.",
        "load": "(self, control: int, *words: int) -> None Load (LOAD, 04H, T-4).\n\nArgs:\n"
        "    control: the control word, which says what follows.\n    words: 0 to 2 data words.",
        "get": "(self) -> int Get it (GET, 05H, T-5).\n\nReturns 16 bits, unsigned.",
        "deep": "(self) -> int Get more (DEEP, 06H, T-6).\n\n"
        "Returns 32 bits, two's complement, in 1/65536.",
    }
    made = calls(bus)
    made.go()
    made.set(-1)
    made.long(0x12345)
    made.load(3, 4, 5)
    board.port.answers[1] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE]
    assert (made.get(), made.deep()) == (0xFFFF, -2)
    assert [call for call in packet(board.port) if call[0] == "write"] == (
        command(0x01) + command(0x02, 0xFFFF) + command(0x03, 1, 0x2345) + command(0x04, 3, 4, 5)
        + command(0x05) + command(0x06)
    )  # fmt: skip


class Noted(Lm628):
    """A driver that changes calls of the client."""

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus, "x")
        self.noted: list[str] = []

    def status(self) -> int:
        self.noted.append("status")
        return super().status()

    def ltrj(self, *words: int) -> None:
        self.noted.append(f"ltrj of {len(words)}")
        super().ltrj(*words)


class Louder(Noted):
    """One that changes some of them again, and one more."""

    def ltrj(self, *words: int) -> None:
        self.noted.append("louder")
        super().ltrj(*words)

    def wait_ready(self) -> None:
        self.noted.append("ready")
        super().wait_ready()


def test_a_call_that_a_derived_class_changes_is_made_by_the_other_calls(bus: Bus) -> None:
    for cls, noted in ((Noted, {"status", "ltrj of 7"}), (Louder, {"ready", "louder"})):
        axis = cls(bus)
        axis.load_trajectory(acc=1, vel=2, pos=3)
        assert noted <= {*axis.noted}
        assert axis.noted.count("ltrj of 7") == 1


def test_a_constant_that_a_derived_class_changes_is_that_of_the_calls(bus: Bus) -> None:
    class Reversed(Lm628):
        READY_LEVEL = 1

    with pytest.raises(NotReadyError):
        Reversed(bus).stt()


def test_a_derived_class_may_not_change_what_the_client_uses_inside(bus: Bus) -> None:
    name = next(name for name in dir(AsyncioLm628) if name[0] == "_" != name[1])
    with pytest.raises(
        TypeError, match=rf"Wrong.{name}: Lm628 uses a function of this name inside"
    ):
        type("Wrong", (Lm628,), {name: lambda self: None})
    assert type("Right", (Lm628,), {f"{name}_of_mine": 1})(bus, "x").status() == 0
