"""Hosts that move the lines themselves: their bus cycles are seen, recorded and replayed."""

import io
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from tests.unit.views.conftest import LM629, board_of, read
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.check.checks import all_rules
from vbus.board.host_bus import HostBus
from vbus.chips.packets import Packet
from vbus.circuit.stream import PacketTaker
from vbus.core.kernel import MS, NS, US
from vbus.core.signals import Observer
from vbus.record.difference import Divergence
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.record.view import play
from vbus.views.findings.report import Report

MC1241A = LM629.replace('plant = "m"', 'plants = ["none"]').replace("LM629N-8", "MC1241A")
MCP1200 = LM629.replace('plant = "m"', 'plant = "none"').replace("LM629N-8", "MCP-1200")
TEXTS = {
    "lm628": LM629,
    "mc1241a": MC1241A.replace("8 MHz", "25 MHz"),
    "mcp1200": MCP1200,
}
Cycles = list[tuple[int, str, bool, int, int]]


class Strobing:
    """A host that makes bus cycles of strobes; the edge that latches is one cycle time later."""

    def __init__(self, port: HostBus) -> None:
        self.port = port
        self.family = port.chips[0].FAMILY

    def level(self, name: str, value: int) -> None:
        number = self.port.line_number(name)
        self.port.lines(1 << number, value << number)

    def write(self, address: int, data: int) -> None:
        self._cycle(True, address, data)

    def read(self, address: int) -> int:
        return self._cycle(False, address, 0)

    def _cycle(self, write: bool, address: int, data: int) -> int:
        """Move the lines as the chip's own table of edges has it."""
        port = self.port
        chip = port.chips[0]
        begin = port.now() + US
        value = 0
        for offset, name, level in sorted(
            chip.strobes(write, address, data), key=lambda step: step[0]
        ):
            if begin + offset > port.now():
                port.delay(begin + offset - port.now())
            if offset >= 0 and not write and not value:
                value = port.sample()[0]
            if name == chip.data_pin.name:
                port.release() if level < 0 else port.drive(level)
            else:
                self.level(name, level)
        return value


class Whole:
    """The same host with whole bus cycles."""

    def __init__(self, port: HostBus) -> None:
        self.port = port

    def write(self, address: int, data: int) -> None:
        self.port.write(address, data)

    def read(self, address: int) -> int:
        return self.port.read(address)


Host = Strobing | Whole


def lm628(host: Host) -> None:
    for code, *words in ((0x1E, 0x000A, 300, 2000), (0x04,), (0x1F, 0x0008, 0, 0), (0x0A,)):
        while host.read(0) & 1:
            pass
        host.write(0, code)
        for word in words:
            while host.read(0) & 1:
                pass
            host.write(1, word >> 8)
            host.write(1, word & 0xFF)
    while host.read(0) & 1:
        pass
    for _ in range(4):
        host.read(1)
    host.write(0, 0x01)
    host.write(0, 0x01)  # too early


def mc1241a(host: Host) -> None:
    for code, reads, words in ((0x11, 0, (6, 0xD1EC)), (0x4B, 2, ()), (0x49, 0, ())):
        host.write(1, code)
        host.port.delay(80 * US)
        for word in words:
            host.write(0, word >> 8)
            host.write(0, word & 0xFF)
            host.port.delay(80 * US)
        for _ in range(reads + 1):
            host.read(0)
            host.read(0)
            host.port.delay(80 * US)


def mcp1200(host: Host) -> None:
    for address, data in ((0x05, 3), (0x0C, 0), (0x0D, 1), (0x0E, 0x7F)):
        host.write(address, data)
        host.port.delay(MS)
    for address in (0x07, 0x14, 0x0E, 0x0C, 0x1A, 0x0C):  # the last three hold the same byte
        host.read(address)
        host.port.delay(10 * US)


WORK: dict[str, Callable[[Host], None]] = {
    "lm628": lm628, "mc1241a": mc1241a, "mcp1200": mcp1200,
}  # fmt: skip
FAMILIES = pytest.mark.parametrize("family", sorted(TEXTS))


class Log(Observer):
    def __init__(self) -> None:
        self.cycles: Cycles = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.cycles.append((when, chip, write, address, data))


def run(family: str, kind: type[Host], *, watched: bool = False) -> tuple[Board, Cycles]:
    """Let a host work; return the board, still with its trace, and the cycles seen."""
    board = load_board_text(TEXTS[family])
    board.start_trace()
    log = Log()
    board.observe(log)
    if watched:
        for pin in board.chips[0].bus_pins:
            pin.net.observe(Observer())
    port = board.open_port("h")
    WORK[family](kind(port))
    port.close()
    return board, log.cycles


@FAMILIES
def test_strobes_are_seen_as_the_bus_cycles_they_are(family: str) -> None:
    _, whole = run(family, Whole)
    _, strobed = run(family, Strobing)
    assert [cycle[1:] for cycle in strobed] == [cycle[1:] for cycle in whole]
    assert len(whole) > 6


@FAMILIES
@pytest.mark.parametrize("kind", [Whole, Strobing])
def test_a_cycle_played_on_watched_nets_is_seen_once(family: str, kind: type[Host]) -> None:
    plain, cycles = run(family, kind)
    watched, again = run(family, kind, watched=True)
    assert again == cycles
    assert watched.trace_hash() == plain.trace_hash()


def test_the_trace_hash_knows_what_strobes_wrote() -> None:
    hashes = []
    for code in (0x02, 0x03):
        board = load_board_text(LM629)
        board.start_trace()
        port = board.open_port("h")
        Strobing(port).write(0, code)
        hashes.append(board.trace_hash())
    assert hashes[0] != hashes[1]


def test_nothing_is_looked_at_while_nobody_wants_to_know() -> None:
    def work(observer: Observer | None) -> Board:
        board = load_board_text(LM629)
        if observer is not None:
            board.observe(observer)
        port = board.open_port("h")
        lm628(Strobing(port))
        port.close()
        return board

    plain, watched = work(None), work(Log())
    assert plain.state_hash() == watched.state_hash()
    assert list(plain.violations) == list(watched.violations)


def test_whoever_comes_late_sees_the_cycles_from_then_on() -> None:
    board = load_board_text(TEXTS["mcp1200"])
    host = Strobing(board.open_port("h"))
    host.write(0x05, 3)
    log = Log()
    board.observe(log)
    host.level("/CS", 0)  # no address has been seen yet
    host.level("/CS", 1)
    assert log.cycles == []
    host.write(0x0E, 0x40)
    assert [cycle[1:] for cycle in log.cycles] == [("x", True, 0x0E, 0x40)]


def test_chips_written_by_one_strobe_are_one_cycle() -> None:
    other = '[chips.y]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
    board = load_board_text(LM629 + other + '[buses.main]\nchips = ["x", "y"]\n')
    log = Log()
    board.observe(log)
    port = board.open_port("h")
    names = port.info().lines
    mask = {name: 1 << number for number, name in enumerate(names)}
    both = mask["x./CS"] | mask["y./CS"] | mask["main./PS"]
    port.lines(both, 0)
    port.drive(0x02)
    port.lines(mask["main./WR"], 0)
    port.delay(200 * NS)
    port.lines(mask["main./WR"], mask["main./WR"])
    assert [cycle[1:] for cycle in log.cycles] == [("x+y", True, 0, 0x02)]


def test_lines_that_fall_back_when_their_host_goes_end_its_cycle() -> None:
    board = load_board_text(LM629)
    log = Log()
    board.observe(log)
    port = board.open_port("h")
    host = Strobing(port)
    for name in ("/PS", "/CS", "/WR"):
        host.level(name, 0)
    port.drive(0x02)
    port.delay(US)
    port.close()
    assert [cycle[1:] for cycle in log.cycles] == [("x", True, 0, 0x02)]


def test_a_read_has_the_byte_of_its_end_though_nobody_looked_in_between() -> None:
    board = load_board_text(LM629)
    log = Log()
    board.observe(log)
    host = Strobing(board.open_port("h"))
    host.write(0, 0x02)
    for name in ("/PS", "/CS", "/RD"):
        host.level(name, 0)
    assert host.port.sample()[0] & 1
    host.port.delay(MS)  # no longer busy: status is live (LM-BUS-3)
    host.level("/RD", 1)
    assert log.cycles[-1][1:] == ("x", False, 0, 0x84)


# -- journals -----------------------------------------------------------------------------------


def recorded(family: str, kind: type[Host]) -> bytes:
    text = TEXTS[family]
    board = load_board_text(text)
    file = io.BytesIO()
    journal = Journal(board, file, text)
    port = board.open_port("h")
    WORK[family](kind(port))
    port.close()
    journal.close()
    return file.getvalue()


def packets(data: bytes) -> list[str]:
    found: list[str] = []

    def take(chip: str, packet: Packet) -> None:
        found.append(f"{packet.kind} {packet.text}")

    reader = JournalReader(io.BytesIO(data))
    play(reader.header, reader, PacketTaker(take))
    return found


@FAMILIES
def test_a_journal_decodes_strobes_as_whole_cycles(family: str) -> None:
    assert packets(recorded(family, Strobing)) == packets(recorded(family, Whole))


def test_a_report_has_the_strobed_cycles_around_a_violation() -> None:
    reader = JournalReader(io.BytesIO(recorded("lm628", Strobing)))
    report = Report("bench", reader.header.families, all_rules())
    play(reader.header, reader, report)
    finding = [f for f in report.findings if f.violation.rule == "lm628.busy-write"][-1]
    assert len(finding.before) == 20
    assert finding.before[-1].text == "h x w 0 01"
    assert finding.after[0].text == "h x w 0 01"
    assert finding.after[0].when == finding.violation.when


@FAMILIES
def test_a_strobed_journal_plays_again(family: str) -> None:
    header, entries = read(recorded(family, Strobing))
    outcome = Replay(board_of(header), entries, header.families).run()
    assert outcome.divergence is None
    assert outcome.ended
    assert outcome.cycles == len([entry for entry in entries if entry.op == "cycle"])


def _changed(data: bytes, number: int, change: dict[str, object] | None) -> Divergence:
    """Replay with the n-th strobed cycle changed, or taken away."""
    header, entries = read(data)
    place = [n for n, entry in enumerate(entries) if entry.op == "cycle"][number]
    if change is None:
        del entries[place]
        entries = [replace(e, number=n) for n, e in enumerate(entries)]
    else:
        entries[place] = replace(entries[place], **change)  # type: ignore[arg-type]
    found = Replay(board_of(header), entries, header.families).run().divergence
    assert found is not None
    return found


def test_a_strobed_cycle_that_differs_is_shown_on_both_sides() -> None:
    data = recorded("lm628", Strobing)
    cycles = [entry for entry in read(data)[1] if entry.op == "cycle"]
    last = len(cycles) - 3  # the last byte of RDRP
    found = _changed(data, last, {"args": ("x", False, 1, 0x55)})
    assert (found.entry, found.what, found.clause) == (cycles[last].number, "reply", "LM-CMD-11")
    assert (found.recorded, found.now) == ("r 1 55 in RDRP +85 cnt", "r 1 00 in RDRP +0 cnt")
    assert found.where == "h, x: strobes"


def test_a_strobed_cycle_on_one_side_only_is_missing_or_unconsumed() -> None:
    data = recorded("lm628", Strobing)
    found = _changed(data, 5, None)
    assert (found.what, found.recorded, found.clause) == ("missing", "nothing", "LM-CMD-23")
    assert found.now == "r 0 85 in RDSTAT 85H MOTOR_OFF TRAJECTORY_COMPLETE BUSY"
    header, entries = read(data)
    cycle = next(n for n, entry in enumerate(entries) if entry.op == "cycle")
    twice = [*entries[: cycle + 1], *entries[cycle:]]
    twice = [replace(e, number=n) for n, e in enumerate(twice)]
    outcome = Replay(board_of(header), twice, header.families).run()
    assert outcome.divergence is not None
    assert (outcome.divergence.what, outcome.divergence.now) == ("unconsumed", "nothing")
    assert outcome.divergence.recorded == "r 0 84 in RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE"
    assert outcome.divergence.clause == "LM-CMD-23"
    assert outcome.divergence.entry == cycle + 1
