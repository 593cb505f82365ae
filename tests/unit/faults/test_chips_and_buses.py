"""Each fault of chips and buses, by what a host sees of it."""

import pytest

from tests.probe import probe
from tests.unit.faults.bench import DC, MC, MCP, STEPPER, Lm, Mc, Mcp, build, settle, telemetry
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.faults.row import LinkActs


class Edges(Observer):
    """Takes down edges."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((when, level))


@pytest.mark.spec("LM-RST-5")
def test_a_part_with_a_stuck_breakpoint_flag_starts_with_c4() -> None:
    for broken in (False, True):
        board = build(power_on="reset")
        host = Lm(board)
        if broken:
            board.faults.arm("power_on_c4")
        settle(board, 3)
        assert host.status() == (0xC4 if broken else 0x84)


def test_c4_holds_while_it_is_armed() -> None:
    board = build()
    host = Lm(board)
    fault = board.faults.arm("power_on_c4")
    host.port.write(0, 0x00)
    settle(board, 3)
    assert host.status() == 0xC4
    board.faults.clear(fault)
    host.port.write(0, 0x00)
    settle(board, 3)
    assert host.status() == 0x84


@pytest.mark.spec("LM-RST-9")
def test_resets_fail_as_often_as_was_asked_for() -> None:
    board = build(power_on="reset")
    host = Lm(board)
    board.faults.arm("reset_fails", times=2)
    settle(board, 20)
    assert host.status() == 0x00
    for expected in (0x00, 0x84):
        pin = host.port.pin_number("x./RST")
        host.port.pin(pin, 0)
        host.port.delay(10 * US)
        host.port.pin(pin, 1)
        settle(board, 20)
        assert host.status() == expected


class Told(Observer):
    """Takes down what faults say they change."""

    def __init__(self) -> None:
        self.seen: list[str] = []

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        self.seen.append(text)


@pytest.mark.parametrize(
    ("power_on", "text"),
    [("reset", "this reset fails, and 2 more"), ("done", "the next 3 resets fail")],
)
def test_it_is_told_which_resets_fail(power_on: str, text: str) -> None:
    board = build(power_on=power_on)
    told = Told()
    board.observe(told)
    board.faults.arm("reset_fails", times=3)
    settle(board, 1)
    assert told.seen[0] == text


@pytest.mark.spec("LM-BUS-8")
def test_the_longest_busy_is_100_us() -> None:
    board = build()
    host = Lm(board)
    fault = board.faults.arm("busy_longest", until="cleared")
    for longest in (True, False):
        host.port.write(0, 0x1E)
        board.run_for(90 * US)
        assert host.status() & 1 == longest
        board.run_for(10 * US)
        assert not host.status() & 1
        host.port.write(0, 0x00)
        settle(board, 3)
        if longest:
            board.faults.clear(fault)


def test_a_longer_busy_of_an_mc1241a_is_seen_in_the_adapters_status() -> None:
    board = build(MC, STEPPER)
    host = Mc(board)
    host.ready()
    board.faults.arm("busy_longest", until="cleared", extra=MS)
    host.port.write(1, 0x00)
    board.run_for(MS)
    assert not host.port.read(1) & 0x80
    board.run_for(68 * US)
    assert host.port.read(1) & 0x80


def test_with_hostrdy_stuck_a_driver_times_out_and_recovers_when_it_is_cleared() -> None:
    board = build(MC, STEPPER)
    host = Mc(board)
    host.ready()
    fault = board.faults.arm("ready_stuck", when="command GET_STATUS")
    with pytest.raises(TimeoutError):
        host.status()
    assert board.chips[0].pins["HostRdy"].value == 0
    assert host.port.wait(MS)[0] is False
    board.faults.clear(fault)
    assert board.chips[0].pins["HostRdy"].value == 1
    host.status()


def test_a_supply_that_dips_in_the_middle_of_a_command_resets_the_chip() -> None:
    board = build()
    host = Lm(board)
    host.spin()
    settle(board, 50)
    board.faults.arm("supply_dip", when="command LTRJ")
    host.port.write(0, 0x1F)
    assert host.status() == 0x00
    host.port.write(1, 0x00)
    settle(board, 3)
    assert host.status() == 0x84
    assert [finding.rule for finding in board.violations] == ["lm628.reset-write"]
    assert telemetry(board)["output"] == 0


@pytest.mark.parametrize("chip", ["mc", "mcp"])
def test_every_chip_starts_anew_after_a_dip(chip: str) -> None:
    board = build(MC, STEPPER) if chip == "mc" else build(MCP, DC)
    host = Mc(board) if chip == "mc" else Mcp(board)
    host.spin()
    settle(board, 20)
    board.faults.arm("supply_dip")
    settle(board, 5)
    if isinstance(host, Mc):
        assert host.ask(0x37, 2) == 0
    else:
        assert host.read(0x05) != 3


@pytest.mark.parametrize(("level", "expected"), [(0, 0x80), (1, 0x84)])
def test_a_stuck_data_line_is_read_until_it_is_cleared(level: int, expected: int) -> None:
    board = build()
    host = Lm(board)
    assert host.status() == 0x84
    fault = board.faults.arm("bit_stuck", bit=2, level=level, until="cleared")
    assert [host.status() for _ in range(3)] == [expected] * 3
    board.faults.clear(fault)
    assert host.status() == 0x84


def test_a_stuck_data_line_is_written_too() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("bit_stuck", bit=0, level=0, until="cleared")
    host.port.write(0, 0x1B)  # becomes 1AH
    board.run_for(200 * US)
    board.faults.clear()
    host.port.write(1, 0)
    assert not host.status() & 0x02


def test_one_byte_is_flipped_on_its_way() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("byte_flipped", when="cycle 3", mask=0x81, cycles="read")
    assert [host.status() for _ in range(5)] == [0x84, 0x84, 0x05, 0x84, 0x84]
    (fault,) = board.faults.all()
    assert (fault.state, fault.fired) == ("over", 1)


def test_a_flipped_command_is_another_command() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("byte_flipped", mask=0xFF, cycles="write")
    host.status()
    host.port.write(0, 0x1F)
    board.run_for(100 * US)
    assert host.status() & 0x02
    assert "command E0H" in board.violations[-1].detail


@pytest.mark.parametrize(("chip", "register"), [(MCP, 0x26)])
def test_a_flipped_byte_of_an_mcp1200_is_data_and_no_address(chip: str, register: int) -> None:
    board = build(chip, DC)
    host = Mcp(board)
    settle(board, 2)
    board.faults.arm("byte_flipped", mask=0x0F, cycles="write")
    host.write(register, 0x10)
    board.run_for(100 * US)
    assert host.read(register) == 0x1F


def test_a_lost_write_strobe_loses_the_byte_and_a_lost_read_strobe_reads_nothing() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("strobe_lost", cycles="write")
    host.port.write(0, 0xEE)
    board.run_for(100 * US)
    assert host.status() == 0x84
    board.faults.arm("strobe_lost", cycles="read")
    host.port.write(0, 0x02)
    assert host.status() == 0x02  # what the bus has kept
    board.run_for(100 * US)
    assert host.status() & 1 == 0


def test_a_doubled_write_strobe_writes_twice() -> None:
    board = build()
    host = Lm(board)
    host.command(0x1E)
    board.faults.arm("strobe_doubled", cycles="write", at=60_000, gap=20_000)
    host.port.write(1, 0x00)  # both bytes of the word
    assert host.status() & 1 == 1
    assert not board.faults.unfired()


@pytest.mark.parametrize(("at", "gap"), [(10_000, 10_000), (60_000, 20_000)])
def test_a_strobe_is_broken_once_however_long_it_is(at: int, gap: int) -> None:
    board = build()
    host = Lm(board)
    host.command(0x1E)
    whole = Edges()
    board.watch("x./WR", whole)
    board.faults.arm("strobe_doubled", cycles="write", at=at, gap=gap)
    host.port.write(1, 0x00)
    board.run_for(10 * US)
    begin = whole.seen[0][0]
    assert [(when - begin, level) for when, level in whole.seen] == [
        (0, 0), (at, 1), (at + gap, 0), (whole.seen[-1][0] - begin, 1),
    ]  # fmt: skip
    assert whole.seen[-1][0] - begin > at + gap
    # The one that was to be doubled has been; the next one is whole.
    host.ready()
    del whole.seen[:]
    host.port.write(1, 0x08)
    assert [level for _, level in whole.seen] == [0, 1]


def test_contention_is_reported_and_pulls_lines_low() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("contention", data=0x0F)
    assert host.status() == 0x84 & 0x0F
    assert board.violations[-1].rule == "board.contention"
    assert host.status() == 0x84


@pytest.mark.parametrize("name", ["bit_stuck", "byte_flipped", "strobe_lost", "contention"])
@pytest.mark.parametrize("family", ["mc", "mcp"])
def test_bus_faults_of_other_chips_come_and_go(name: str, family: str) -> None:
    board = build(MC, STEPPER) if family == "mc" else build(MCP, DC)
    host = Mc(board) if family == "mc" else Mcp(board)
    settle(board, 5)
    address = 0 if family == "mc" else 0x07
    whole = host.port.read(address)
    host.port.read(address)
    settle(board, 1)
    board.faults.arm(name, until="cleared")
    for _ in range(4):
        host.port.read(address)
        board.run_for(100 * US)
    board.faults.clear()
    assert not board.kernel.observed
    settle(board, 1)
    assert host.port.read(address) == whole


def test_a_state_throws_the_switches_of_the_faults_it_has_and_no_others() -> None:
    board, other = build(), build()
    board.faults.arm("busy_longest", until="cleared")
    other.load(board.save())
    chip = other.chips[0]
    assert (probe(chip).worst_busy, probe(chip).stuck_part) == (True, False)


def test_hostrdy_rises_when_it_is_no_longer_stuck_with_nothing_to_do() -> None:
    board = build(MC, STEPPER)
    Mc(board).ready()
    fault = board.faults.arm("ready_stuck")
    board.run_for(MS)
    assert board.chips[0].pins["HostRdy"].value == 0
    board.faults.clear(fault)
    assert board.chips[0].pins["HostRdy"].value == 1


class Links(LinkActs):
    """A server that can do the faults of links."""

    def __init__(self) -> None:
        self.begun: list[str] = []

    def check(self, name: str, target: str) -> None:
        pass

    def begin(self, number: int, name: str, target: str, once: bool, values: object) -> str:
        self.begun.append(name)
        return "1 sessions"

    def end(self, number: int) -> None:
        pass


def test_a_server_that_comes_lets_faults_of_links_act_and_no_others_again() -> None:
    board = build()
    host = Lm(board)
    stuck = board.faults.arm("bit_stuck", bit=0, level=1)
    board.faults.arm("jam")
    board.faults.arm("link_dead")
    settle(board, 3)
    assert host.status() & 1
    links = Links()
    board.serve_links(links)
    assert links.begun == ["link_dead"]
    board.faults.clear(stuck)
    assert not host.status() & 1
