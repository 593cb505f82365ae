"""The chip on a board: a motor behind it, other chips beside it, hosts of every kind."""

import pytest

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.chips.lm628.chip import LM628
from vbus.core.kernel import MS, NS, US
from vbus.core.signals import Observer
from vbus.plant.dc_motor import DcMotor


def board_with(*names: str, time: str = "lockstep") -> tuple[Board, HostBus]:
    board = Board("bench", time)
    for name in names:
        board.add_chip(LM628, name, "LM629N-8", 8_000_000)
        board.connect(name, 0, DcMotor())
    board.start_trace()
    board.power_on()
    return board, board.open_port("host")


def wait(port: HostBus) -> None:
    while port.read(0) & 1:
        pass


def command(port: HostBus, code: int, *words: int) -> None:
    wait(port)
    port.write(0, code)
    for word in words:
        wait(port)
        port.write(1, word >> 8)
        port.write(1, word & 0xFF)


def report(port: HostBus, code: int) -> int:
    command(port, code)
    value = 0
    for _ in range(2):
        wait(port)
        value = value << 16 | port.read(1) << 8 | port.read(1)
    return value - (1 << 32) if value >> 31 else value


def tune(port: HostBus) -> None:
    command(port, 0x1E, 0x000F, 60, 4, 800, 200)
    command(port, 0x04)


def load(port: HostBus, position: int) -> None:
    command(port, 0x1F, 0x002A, 0, 0x2000, 6, 0, position >> 16 & 0xFFFF, position & 0xFFFF)


@pytest.mark.spec("LM-BUS-1", "LM-T-7")
def test_a_driver_resets_tunes_and_moves_a_motor_and_watching_the_bus_changes_nothing():
    results = []
    for watched in (False, True):
        board, port = board_with("x")
        if watched:
            for pin in ("/CS", "/PS", "/RD", "/WR", "D0-D7", "HI", "SIGN", "MAG"):
                board.watch(f"x.{pin}", Observer())
        while port.read(0) != 0x84:
            assert board.now < 1500 * US
        command(port, 0x1D, 0)
        wait(port)
        assert port.read(0) == 0x80
        tune(port)
        load(port, 2000)
        command(port, 0x01)
        while not port.read(0) & 0x04:
            port.delay(50 * US)
        port.delay(100 * MS)
        assert report(port, 0x08) == 2000
        assert abs(report(port, 0x0A) - 2000) <= 5
        assert board.counters["violations"] == 0
        results.append((board.now, board.counters["reads"], board.trace_hash()))

    assert results[0] == results[1]


def test_a_board_saved_in_motion_goes_on_the_same():
    board, port = board_with("x")
    port.delay(MS)
    tune(port)
    load(port, 5000)
    command(port, 0x01)
    port.delay(20 * MS)
    state = board.save()
    other, other_port = board_with("x")
    other.load(state)

    courses = []
    for one, host in ((board, port), (other, other_port)):
        course = []
        for _ in range(20):
            host.delay(3 * MS)
            course.append((report(host, 0x0A), report(host, 0x07)))
        courses.append((course, one.state_hash()))
    assert courses[0] == courses[1]
    assert courses[0][0][0] != courses[0][0][-1]


@pytest.mark.spec("LM-CMD-2")
def test_one_strobe_to_two_chips_starts_both_in_the_same_sample():
    board, port = board_with("x", "y")
    port.delay(MS)
    for number, position in ((0, 100), (1, -100)):
        port.select(1 << number)
        tune(port)
        load(port, position)
        wait(port)
    port.select(0b11)
    port.write(0, 0x01)
    port.delay(300 * US)

    for _ in range(3):
        port.delay(256 * US)
        x, y = (board.chip(name).telemetry()["velocity"] for name in "xy")
        assert x == -y > 0


def test_strobes_with_real_times_are_judged_and_whole_cycles_are_not():
    board, port = board_with("x")
    port.delay(2 * MS)
    lines = {name: 1 << n for n, name in enumerate(port.info().lines)}
    cs, ps, wr = lines["x./CS"], lines["x./PS"], lines["x./WR"]

    def write(low: int) -> None:
        port.lines(cs | ps, 0)
        port.delay(50 * NS)
        port.drive(0x03)
        port.lines(wr, 0)
        port.delay(low)
        port.lines(wr, wr)
        port.delay(150 * NS)
        port.release()
        port.lines(cs | ps, cs | ps)

    write(100 * NS)
    wait(port)
    assert board.counters["violations"] == 0
    write(99 * NS)
    assert [(v.rule, v.measured) for v in board.violations] == [("lm628.T14", 99 * NS)]


def test_host_interrupt_comes_as_an_event_at_its_own_instant():
    board, port = board_with("x")
    info = port.info()
    bit = 1 << info.outputs.index("x.HI")
    port.events(bit)
    port.delay(2 * MS)
    command(port, 0x1D, 0)
    port.delay(100 * US)

    edges = [(word & bit != 0, when) for word, when in port.take_events()]
    assert [level for level, _ in edges] == [True, False]
    assert edges[0][1] == MS, "the end of the reset"
    assert 2 * MS < edges[1][1] < board.now


def test_a_joined_reset_line_resets_both_chips():
    board = Board("bench")
    for name in ("x", "y"):
        board.add_chip(LM628, name, "LM628N-8", 8_000_000)
    board.join("/RESET", ["x./RST", "y./RST"])
    board.power_on(done=True)
    port = board.open_port("host")
    pin = port.pin_number("x./RST")
    port.pin(pin, 0)
    port.delay(10 * US)
    port.pin(pin, 1)

    for number in (0, 1):
        port.select(1 << number)
        assert port.read(0) == 0x00
    port.delay(MS)
    for number in (0, 1):
        port.select(1 << number)
        assert port.read(0) == 0x84
