"""Leases: a host that answers its own polls sees and leaves behind what it would have anyway."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.board.toy import Toy
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.board.host_polls import LONGEST_LEASE
from vbus.chips.lm628.datasheet import COMMANDS
from vbus.core.kernel import END, MS, NEVER, US
from vbus.core.signals import Observer
from vbus.protocols.port import PortError

PLANT = '[plants.m]\nmodel = "ideal"\n'
PARTS = {
    "LM629": ('part = "LM629N-8"\nclock = "8 MHz"\nplant = "m"\n' + PLANT, 0),
    "MC1141A": ('part = "MC1141A"\nclock = "15 MHz"\nplant = "none"\n', 1),
    "MCP-1200": ('part = "MCP-1200"\nclock = "10 MHz"\nplant = "m"\n' + PLANT, 7),
}
PARTS["LM629 on a card"] = (
    PARTS["LM629"][0]
    + """

[cards.slot]
bus = "ISA"
hold = "130 ns"

[cards.slot.pins]
"D0-D7" = "x.D0-D7"
"/IOR" = "x./RD"
"/IOW" = "x./WR"
A0 = "x./PS"

[glue.u1]
part = "74HC138"
delay = "15 ns"
high = ["G1"]
low = ["/G2A"]

[glue.u1.pins]
A = "slot.A1"
B = "slot.A2"
C = "slot.A3"
"/G2B" = "slot.AEN"
Y0 = "x./CS"

[cards.slot.registers.switches]
at = 8
kind = "status"

[cards.slot.registers.switches.pins]
I0 = "x.HI"
""",
    0,
)


def toy_bench(policy: str = "lockstep") -> tuple[Board, HostBus, Toy]:
    board = Board("bench", policy)
    chip = board.add_chip(Toy, "t0", "TOY", 8_000_000)
    board.power_on()
    assert isinstance(chip, Toy)
    return board, board.open_port("host"), chip


def bench(part: str, traced: bool = True) -> tuple[Board, HostBus, int]:
    chip, address = PARTS[part]
    board = load_board_text(f'[board]\nname = "b"\ntime = "lockstep"\n[chips.x]\n{chip}')
    if traced:
        board.start_trace()
    return board, open_port(board), address


def open_port(board: Board) -> HostBus:
    """Return a port that reaches the chip as its driver does: through the card, if there is one."""
    return board.open_port("host", [board.chips[-1].name])


class Leasing:
    """A host that keeps to its leases; counts what it asks the board for."""

    def __init__(self, port: HostBus, on: bool, cycle: int = US, ahead: bool = True) -> None:
        self.port = port
        self.on = on
        self.ahead = ahead
        self._then: tuple[int, int] | None = None
        self.cycle = cycle
        self.asked = 0
        self._address = -1
        self._data = self._now = self._until = self._polls = 0

    def read(self, address: int) -> int:
        when = self._now + self.cycle
        if self.on and address == self._address and when >= self._until and self._then:
            (self._data, self._until), self._then = self._then, None
        if self.on and address == self._address and when < self._until:
            self._now += self.cycle
            self._polls += 1
            return self._data
        self.settle()
        self._address = -1
        self.asked += 1
        data = self.port.read(address)
        lease = self.port.lease(address) if self.on else None
        if lease is not None:
            self._address, self._data = address, data
            _, self._now, self._until = lease
            self._then = self.port.foresee(address) if self.ahead else None
        return data

    def settle(self) -> None:
        if self._polls:
            assert self.port.polled(self._address, self._polls)
        self._polls = 0

    def write(self, address: int, data: int) -> None:
        self.settle()
        self._address = -1
        self.port.write(address, data)

    def delay(self, duration: int) -> None:
        self.settle()
        self._now += duration
        assert self.port.delay(duration)


class Log(Observer):
    def __init__(self) -> None:
        self.cycles: list[tuple[int, bool, int, int]] = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.cycles.append((when, write, address, data))


steps = st.lists(
    st.one_of(
        st.tuples(st.just("w"), st.integers(0, 1), st.integers(0, 255)),
        st.tuples(st.just("r"), st.integers(0, 1), st.integers(0, 1)),
        st.tuples(st.just("poll"), st.integers(1, 400), st.integers(0, 0)),
        st.tuples(st.just("delay"), st.integers(0, 3 * MS), st.integers(0, 0)),
    ),
    max_size=25,
)


def run(
    part: str, script: list[tuple[str, int, int]], on: bool, watched: bool
) -> tuple[object, ...]:
    # Cycles on a card are played one by one while somebody looks at its wires.
    traced = watched or "card" not in part
    board, port, status = bench(part, traced)
    log = Log()
    if watched:
        board.observe(log)
        board.watch(f"x.{board.chips[0].data_pin.name}", Observer())
    host = Leasing(port, on)
    seen: list[int] = []
    for kind, first, second in script:
        if kind == "w":
            host.write(first if part != "MCP-1200" else (5, 0)[first], second)
        elif kind == "r":
            seen.append(host.read(first if part != "MCP-1200" else (7, 0x14)[first]))
        elif kind == "poll":
            seen.extend(host.read(status) for _ in range(first))
        else:
            host.delay(first)
    host.settle()
    trace = board.trace_hash() if traced else ""
    return seen, log.cycles, board.now, dict(board.counters), board.state_hash(), trace


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize("part", list(PARTS))
@settings(max_examples=40, deadline=None)
@given(script=steps)
def test_leased_and_unleased_runs_are_the_same_run(
    part: str, watched: bool, script: list[tuple[str, int, int]]
) -> None:
    assert run(part, script, True, watched) == run(part, script, False, watched)


def reset_and_move(host: Leasing) -> list[int]:
    """What an LM629 driver does: reset, load a trajectory, poll until it is complete."""
    polls: list[int] = []

    def wait(mask: int, value: int) -> None:
        count = 1
        while host.read(0) & mask != value:
            count += 1
        polls.append(count)

    def command(code: int, *data: int) -> None:
        host.write(0, code)
        wait(1, 0)
        for place in range(0, len(data), 2):
            host.write(1, data[place])
            host.write(1, data[place + 1])
            wait(1, 0)

    wait(0xFF, 0x84)
    command(0x1E, 0x00, 0x0F, 0, 50, 0, 10, 0, 50, 0, 100)
    command(0x04)
    command(0x1F, 0x00, 0x2A, 0, 0, 0, 20, 0, 2, 0, 0, 0, 0, 4, 0)
    command(0x01)
    wait(4, 4)
    return polls


@pytest.mark.parametrize("part", ["LM629", "LM629 on a card"])
@pytest.mark.parametrize("traced", [False, True])
def test_a_driver_polls_as_often_and_asks_a_tenth(traced: bool, part: str) -> None:
    results = []
    hosts = []
    for on in (False, True):
        chip = PARTS[part][0]
        board = load_board_text(f'[board]\ntime = "lockstep"\n[chips.x]\n{chip}')
        if traced:
            board.start_trace()
        host = Leasing(open_port(board), on)
        polls = reset_and_move(host)
        host.settle()
        trace = board.trace_hash() if traced else ""
        results.append((polls, board.now, board.counters["reads"], board.state_hash(), trace))
        hosts.append(host)

    assert results[0] == results[1]
    if traced and "card" in part:
        return  # each cycle is played while somebody looks at the wires of a card
    assert hosts[1].asked * 10 < hosts[0].asked, "most polls were answered from leases"


NAMES = {row.name: row.code for row in COMMANDS}
DATA = {
    "RSTI": [0, 0], "MSKI": [0, 0x7E], "LPEI": [0x12, 0x34], "LPES": [0xFF, 0xFF],
    "SBPA": [0, 0, 0, 9], "SBPR": [0, 0, 0, 9], "LFIL": [0, 0x08, 0, 9], "LTRJ": [0, 0x20, 0, 1],
}  # fmt: skip
"""What the last of these bytes does is foreseen as well."""

FORESEEN = {
    **dict.fromkeys(("UDF", "RDSIGS", "RDIP", "RDDP", "RDRP", "RDDV", "RDRV", "RDSUM"), 1),
    **dict.fromkeys(("MSKI", "LPEI", "LPES"), 2),
    "RSTI": 1,
    **dict.fromkeys(("SBPA", "SBPR", "LFIL", "LTRJ"), 3),
}
"""Phases of busy; after a reset the word of RSTI moves HI, which is not foreseen."""


def foreseen(
    bytes_before: list[tuple[int, int]],
) -> tuple[HostBus, int, tuple[int, int, int] | None]:
    """Write these bytes, each as soon as the chip is ready, then read the status.

    Returns the port, the status, and until when it stays, the next byte and until when that stays.
    """
    _, port, _ = bench("LM629")
    assert port.delay(1800 * US)  # the reset is over, and the next sample is 248 us away
    status = port.read(0)
    for address, byte in bytes_before:
        while status & 1:
            status = port.read(0)
        port.write(address, byte)
        status = port.read(0)
    lease = port.lease(0)
    following = port.foresee(0) if lease is not None else None
    if lease is None or following is None:
        return port, status, None
    return port, status, (lease[2], following[0], following[1])


@pytest.mark.parametrize("before", [(), ("MSKI", 0, 0x7E, "undefined"), ("STT",)], ids=str)
@pytest.mark.parametrize("name", list(NAMES))
def test_what_comes_after_busy_is_foreseen_and_comes_true(
    name: str, before: tuple[str | int, ...]
) -> None:
    """At the last instant of each byte and at the first one of the next."""
    told = 0
    whole = [*before, name, *DATA.get(name, [])]
    script = [(1, step) if isinstance(step, int) else (0, NAMES.get(step, 0xFF)) for step in whole]
    for length in range(len(before) + 1, len(script) + 1):
        port, status, after = foreseen(script[:length])
        if after is None:
            continue
        until, byte, end = after
        told += 1
        assert until + US < end <= until + 256 * US
        assert port.polls.until == end
        for when, expected in ((until - 1, status), (until, byte), (end - 1, byte)):
            port, _, _ = foreseen(script[:length])
            assert port.delay(when - US - port.now())
            assert port.read(0) == expected
            assert port.now() == when
    assert told == FORESEEN.get(name, 0) or before, "busy phases, the byte between two aside"


def test_what_comes_after_busy_is_foreseen_while_all_interrupts_are_masked() -> None:
    mask = [(0, NAMES["MSKI"]), (1, 0), (1, 0)]
    _, status, after = foreseen([*mask, (0, NAMES["UDF"])])
    assert after is not None
    assert after[1] == status & ~1


def test_what_comes_after_a_word_has_been_taken_is_foreseen() -> None:
    _, port, _ = bench("LM629")
    assert port.delay(1800 * US)
    port.write(0, NAMES["RDRP"])
    while port.read(0) & 1:
        pass
    port.read(1)
    port.read(1)
    status = port.read(0)
    assert status & 1
    assert port.lease(0) is not None
    following = port.foresee(0)
    assert following is not None
    assert following[0] == status & ~1


def test_foreseeing_halves_what_a_driver_asks() -> None:
    hosts = []
    for ahead in (False, True):
        board, port, _ = bench("LM629")
        assert port.delay(2 * MS)
        host = Leasing(port, True, ahead=ahead)
        for _ in range(20):
            host.write(0, NAMES["RSTI"])
            while host.read(0) & 1:
                pass
            host.write(1, 0)
            host.write(1, 0)
            while host.read(0) & 1:
                pass
        host.settle()
        hosts.append((host.asked, board.now, board.counters["reads"], board.state_hash()))
    assert hosts[0][1:] == hosts[1][1:]
    assert hosts[1][0] < 0.6 * hosts[0][0]


def test_polls_of_a_card_are_promised_once_they_are_known_to_move_nothing() -> None:
    board, port, _ = bench("LM629 on a card", traced=False)
    assert port.delay(2 * MS)
    found = []
    for address in (0, 0, 0, 8, 8, 8, 1, 1, 1):
        port.read(address)
        found.append(port.lease(address) is not None)
    assert (found[0], found[2], found[3], found[5]) == (False, True, False, True)
    assert not any(found[6:]), "the data port's bytes are taken"
    port.read(8)
    assert port.lease(8) is None, "the wires have moved, though the cycle is remembered"
    reads, now = board.counters["reads"], board.now
    port.read(8)
    lease = port.lease(8)
    assert lease is not None
    assert port.polled(8, 100)
    assert (board.counters["reads"], board.now) == (reads + 101, now + 101 * US)


def test_a_lease_of_a_card_ends_before_a_wire_moves_that_decides() -> None:
    _, port, _ = bench("LM629 on a card", traced=False)
    assert port.delay(2 * MS)
    for _ in range(3):
        byte = port.read(8)
    lease = port.lease(8)
    assert lease is not None
    assert port.foresee(8) is None
    port.write(0, NAMES["RESET"])
    assert port.lease(8) is None
    assert byte & 1 != port.read(8) & 1, "HI falls with a reset"


def test_a_lease_ends_before_the_byte_changes() -> None:
    _, port, _ = toy_bench()
    port.write(0, 200)  # busy for 10 us from 1 us on
    assert port.read(0) == 1
    assert port.lease(0) == (0, 2 * US, 11 * US)


def test_a_lease_ends_before_an_output_line_moves() -> None:
    _, port, _ = toy_bench()
    port.write(0, 5)  # IRQ rises at 6 us, busy ends at 11 us
    port.read(0)
    assert port.lease(0) == (0, 2 * US, 6 * US)


def test_no_lease_reaches_further_than_a_tenth_of_a_second() -> None:
    _, port, _ = toy_bench()
    port.read(0)
    assert port.lease(0) == (0, US, US + LONGEST_LEASE)


def test_nothing_is_promised_where_reading_has_an_effect() -> None:
    _, port, _ = toy_bench()
    port.read(1)
    assert port.lease(1) is None


def test_nothing_is_promised_that_no_poll_could_use() -> None:
    _, port, chip = toy_bench()
    port.write(0, 200)
    port.delay(8 * US)
    port.read(0)
    assert chip.busy_until == port.now() + US
    assert port.lease(0) is None


def test_nothing_is_promised_in_real_time_or_to_one_of_several_hosts() -> None:
    _, port, _ = toy_bench("realtime")
    port.read(0)
    assert port.lease(0) is None

    board, port, _ = toy_bench()
    other = board.open_port("other")
    port.read(0)
    assert port.lease(0) is None
    other.close()
    assert port.lease(0) is not None


def test_nothing_is_promised_with_several_chips_selected() -> None:
    board = Board("bench", "lockstep")
    for name in ("t0", "t1"):
        board.add_chip(Toy, name, "TOY", 8_000_000)
    board.power_on()
    port = board.open_port("host")
    port.select(3)
    port.read(0)
    assert port.lease(0) is None


def test_whoever_comes_acts_after_what_was_promised() -> None:
    board, port, _ = toy_bench()
    port.write(0, 200)
    port.read(0)
    assert port.lease(0) == (0, 2 * US, 11 * US)

    board.open_port("operator")

    assert board.now == 11 * US


def test_polls_are_run_a_cycle_apart_and_counted() -> None:
    board, port, _ = toy_bench()
    log = Log()
    board.observe(log)
    port.write(0, 200)

    assert port.polled(0, 3)

    assert log.cycles[1:] == [(when * US, False, 0, 1) for when in (2, 3, 4)]
    assert board.counters["reads"] == 3
    assert board.now == 4 * US


def test_a_slaved_host_stamps_each_of_its_polls() -> None:
    board, port, _ = toy_bench("slaved")
    log = Log()
    board.observe(log)
    port.at(7 * US)
    port.polled(0, 1)
    port.at(9 * US)
    port.polled(0, 1)
    assert [when for when, *_ in log.cycles] == [7 * US, 9 * US]


def test_polls_of_a_slaved_host_begin_at_its_stamp() -> None:
    board, port, _ = toy_bench("slaved")
    port.at(100 * US)
    assert port.polled(0, 3)
    assert (board.now, board.counters["reads"]) == (102 * US, 3)


@pytest.mark.parametrize("watched", [False, True])
def test_stamped_polls_are_run_at_their_stamps_and_counted(watched: bool) -> None:
    board, port, _ = toy_bench("slaved")
    log = Log()
    if watched:
        board.observe(log)
    assert port.polled_at(0, 7 * US, (2 * US, 0, 5 * US))
    assert (board.now, board.counters["reads"]) == (14 * US, 4)
    if watched:
        assert [when // US for when, *_ in log.cycles] == [7, 9, 9, 14]
    with pytest.raises(PortError, match="before the last at"):
        port.polled_at(0, 13 * US, ())
    with pytest.raises(PortError, match=f"^at {END + 2}: time ends at {END} ps$"):
        port.polled_at(0, END - 3, (2, 3))
    assert board.counters["reads"] == 4, "a refused request has run no poll"


def test_stamped_polls_belong_to_slaved_boards() -> None:
    _, port, _ = toy_bench("lockstep")
    with pytest.raises(PortError, match="not slaved"):
        port.polled_at(0, US, ())


@pytest.mark.parametrize("watched", [False, True])
def test_stamped_polls_wait_for_their_time(watched: bool) -> None:
    board, port, _ = toy_bench("slaved")
    if watched:
        board.observe(Log())
    board.limit = 4 * US
    far = 5000 * US
    assert not port.polled_at(0, 2 * US, (US, far, US))
    assert port.held
    assert board.counters["reads"] == 2
    board.limit = NEVER
    assert port.go_on()
    assert port.polled_at(0, 2 * US, (US, far, US))
    assert (board.now, board.counters["reads"]) == (3 * US + far + US, 4)


@pytest.mark.parametrize("watched", [False, True])
def test_polls_wait_for_the_time_they_take(watched: bool) -> None:
    board, port, _ = toy_bench()
    if watched:
        board.observe(Log())
    board.limit = 4 * US
    assert not port.polled(0, 10)
    assert port.held
    assert board.now <= 5 * US

    board.limit = 100 * US
    assert port.go_on()
    assert port.polled(0, 10), "the same call again finishes the rest"
    assert (board.now, board.counters["reads"]) == (10 * US, 10)
    assert port.polled(0, 2)
    assert board.counters["reads"] == 12


def test_polls_beyond_the_end_of_time_are_refused() -> None:
    board, port, _ = toy_bench()
    assert port.delay(END - 5 * US)
    with pytest.raises(PortError, match="time ends"):
        port.polled(0, 10)
    assert board.counters["reads"] == 5
