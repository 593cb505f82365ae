"""HostBus: what one host's hold on a board means, shown with a toy chip."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.boards import ALONE
from tests.unit.board.toy import Toy
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.card.cards import Card
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, NEVER, US
from vbus.core.signals import HIGH, LOW, STRICT, Observer, Policy
from vbus.protocols import codes
from vbus.protocols.port import CardAccess, HostPort, PortError


def bench(policy: str = "lockstep", chips: int = 1, **settings: object) -> tuple[Board, HostBus]:
    board = Board("bench", policy, **settings)  # type: ignore[arg-type]
    for number in range(chips):
        board.add_chip(Toy, f"t{number}", "TOY", 8_000_000)
    board.power_on()
    return board, board.open_port("host")


class Log(Observer):
    def __init__(self) -> None:
        self.edges: list[tuple[int, str, int]] = []
        self.cycles: list[tuple[int, str, str, bool, int, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.edges.append((when, net, level))

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.cycles.append((when, host, chip, write, address, data))


def test_in_lockstep_a_cycle_costs_one_microsecond_and_nothing_else_moves_time() -> None:
    board, port = bench()

    port.write(1, 0x42)
    assert board.now == 1 * US

    assert port.read(1) == 0x42
    assert board.now == 2 * US
    assert port.now() == 2 * US


def test_polling_a_busy_chip_ends_because_each_poll_takes_time() -> None:
    _, port = bench()
    port.write(0, 100)

    polls = 0
    while port.read(0) & 1:
        polls += 1

    assert polls == 10


def test_a_slaved_host_places_each_latching_edge_by_its_own_clock() -> None:
    board, port = bench("slaved")
    log = Log()
    board.observe(log)

    port.at(7 * US)
    port.write(0, 100)
    port.at(17 * US - 1)
    assert port.read(0) == 1
    port.at(17 * US)
    assert port.read(0) == 1, "the byte was latched at the read strobe's falling edge"
    port.at(18 * US)
    assert port.read(0) == 0

    assert [cycle[0] for cycle in log.cycles] == [7 * US, 17 * US - 1, 17 * US, 18 * US]


def test_a_host_clock_that_runs_backwards_is_refused() -> None:
    _, port = bench("slaved")
    port.at(10 * US)

    with pytest.raises(PortError, match=r"^at 9999999: before the last at, 10000000$") as refusal:
        port.at(10 * US - 1)
    assert refusal.value.code == 3


def test_at_is_refused_unless_the_board_is_slaved() -> None:
    _, port = bench("lockstep")

    with pytest.raises(PortError, match=r"^at: board 'bench' is lockstep, not slaved$"):
        port.at(10)


def test_polls_between_two_stamps_cost_cycle_time_and_never_push_the_stamp_back() -> None:
    board, port = bench("slaved")
    port.at(10 * US)
    port.read(0)
    port.read(0)
    port.read(0)
    assert board.now == 12 * US

    port.at(11 * US)
    port.read(0)
    assert board.now == 12 * US


def test_wait_ends_at_the_very_instant_the_chip_is_ready() -> None:
    board, port = bench()
    port.write(0, 200)

    assert port.wait(5 * US) == (False, 6 * US)
    assert port.wait(100 * US) == (True, 11 * US)
    assert board.now == 11 * US
    assert port.wait(100 * US) == (True, 11 * US)


def test_delay_moves_lockstep_time() -> None:
    board, port = bench()

    assert port.delay(123_456) is True
    assert board.now == 123_456


def test_in_real_time_a_delay_beyond_the_limit_holds_the_session_until_the_wall_clock_comes() -> (
    None
):
    board, port = bench("realtime")
    board.limit = 50 * US

    assert port.delay(80 * US) is False
    assert port.held
    assert port.hold_until == 80 * US
    assert not port.go_on()

    board.run_until(60 * US)
    board.limit = 110 * US
    assert port.go_on()
    assert port.delay(80 * US) is True
    assert board.now == 80 * US


def test_in_real_time_cycles_may_run_to_the_limit_and_then_wait_for_the_wall_clock() -> None:
    board, port = bench("realtime")
    board.limit = 1 * US
    done = 0
    while not port.held:
        port.read(1)
        done += 1

    assert done == 4, "three cycles of 300 ns fit, the fourth goes over and holds"
    assert not port.go_on()
    board.limit = 10 * US
    assert port.go_on()


def test_a_broadcast_write_reaches_every_selected_chip_and_only_those() -> None:
    board, port = bench(chips=3)
    port.select(0b101)
    port.write(1, 0x55)

    values = []
    for number in range(3):
        port.select(1 << number)
        values.append(port.read(1))
    assert values == [0x55, 0, 0x55]
    assert board.counters["writes"] == 1


@pytest.mark.parametrize("joined", [False, True])
@pytest.mark.parametrize("observed", [False, True])
def test_a_read_of_several_chips_reads_them_all_and_is_a_fight_if_they_disagree(
    joined: bool, observed: bool
) -> None:
    board, port = bench(chips=3)
    if joined:
        board.share_bus("data", ["t0", "t1", "t2"])
        port = board.open_port("another")
    for number, byte in enumerate((0x5C, 0x36, 0x77)):
        port.select(1 << number)
        port.write(1, byte)
    if observed:
        board.chips[0].bus_net.observe(Observer())
    port.select(0b011)

    assert port.read(1) == 0x5C & 0x36
    [found] = board.violations
    assert found.rule == "board.contention"
    assert found.when == board.now - (board.chips[0].read_low_ps if joined else 0)
    assert "=5C" in found.detail
    assert "=36" in found.detail
    # Each chip has been read; the third has not.
    values = []
    for number in range(3):
        port.select(1 << number)
        values.append(port.read(1))
    assert values == [0x5D, 0x37, 0x77]
    assert len(board.violations) == 1


def test_a_read_of_several_chips_that_agree_is_no_fight() -> None:
    board, port = bench(chips=2)
    port.select(0b11)
    port.write(1, 0x41)
    assert port.read(1) == 0x41
    assert list(board.violations) == []


@pytest.mark.parametrize("costs", [(1, 3, 2), (3, 1, 2), (2, 1, 3)])
def test_a_cycle_costs_what_the_slowest_of_the_selected_chips_costs(
    costs: tuple[int, ...],
) -> None:
    board, port = bench(chips=3)
    assert port.cost(*(cost * US for cost in costs)) == [US] * 3
    for mask in range(1, 8):
        port.select(mask)
        begun = board.now
        port.write(1, 0x55)
        slowest = max(cost for number, cost in enumerate(costs) if mask >> number & 1)
        assert board.now - begun == slowest * US

    port.select(0b011)
    port.cost(7 * US, 5 * US, 9 * US)
    begun = board.now
    port.write(1, 0x55)
    assert board.now - begun == 7 * US, "of those that were selected before"

    port.select(0)
    port.cost(4 * US)
    begun = board.now
    port.write(1, 0x55)
    assert board.now - begun == 4 * US, "a cycle that reaches nobody takes its time too"


def test_in_real_time_each_chip_has_its_own_shortest_cycle() -> None:
    board = Board("bench", "realtime")
    for number, cycle_ps in enumerate((300_000, 700_000)):
        board.add_chip(Toy, f"t{number}", "TOY", 8_000_000).cycle_ps = cycle_ps
    board.power_on()
    board.limit = US
    port = board.open_port("host")
    assert [chip.cycle_ps for chip in port.info().chips] == [300_000, 700_000]
    for mask, instant in ((0b01, 300_000), (0b10, 1_000_000), (0b11, 1_700_000)):
        port.select(mask)
        port.write(1, 0x55)
        assert board.now == instant


@pytest.mark.parametrize("watched", [False, True])
def test_each_chip_counts_its_own_cycles_and_the_board_those_of_the_bus(watched: bool) -> None:
    board, port = bench(chips=3)
    if watched:
        board.watch("t0./WR", Log())
    port.select(0b101)
    port.write(1, 0x55)
    port.write(1, 0x56)
    port.select(0b100)
    port.write(1, 0x57)
    port.read(1)
    port.polled(0, 4)
    port.select(0)
    port.write(1, 0x58)
    port.read(1)

    assert [(chip.reads, chip.writes) for chip in board.chips] == [(0, 2), (0, 0), (5, 3)]
    assert (board.counters["reads"], board.counters["writes"]) == (6, 4)


def test_reading_with_no_chip_selected_finds_the_last_value_on_a_floating_bus() -> None:
    _, port = bench(chips=2)
    port.write(1, 0x77)
    port.select(0)

    assert port.read(1) == 0x77


def test_selecting_a_chip_that_is_not_there_is_refused() -> None:
    _, port = bench(chips=2)

    with pytest.raises(PortError, match=r"^select 4: this session has 2 chips$"):
        port.select(4)


def by_lines(port: HostBus, write: bool, address: int, data: int, low_ps: int = 200_000) -> int:
    names = port.info().lines
    mask = {name.split(".")[1]: 1 << n for n, name in enumerate(names)}
    strobe = mask["/WR"] if write else mask["/RD"]
    port.lines(mask["A0"] | mask["/CS"], mask["A0"] if address else 0)
    if write:
        port.drive(data)
    port.delay(50_000)
    port.lines(strobe, 0)
    port.delay(low_ps)
    value, _ = port.sample()
    port.lines(strobe, strobe)
    port.delay(50_000)
    port.release()
    port.lines(mask["/CS"], mask["/CS"])
    return value


def test_strobes_moved_by_the_host_are_the_same_bus_cycle() -> None:
    _, port = bench()

    by_lines(port, True, 1, 0xA5)
    assert by_lines(port, False, 1, 0) == 0xA5
    assert port.read(1) == 0xA6


def test_a_write_strobe_that_is_too_short_is_a_violation_but_is_carried_out() -> None:
    board, port = bench()
    port.delay(1)

    by_lines(port, True, 1, 0x11, low_ps=99_999)

    assert [(v.rule, v.measured, v.limit) for v in board.violations] == [
        ("toy.T1", 99_999, 100_000)
    ]
    assert port.read(1) == 0x11


def test_in_strict_mode_a_write_strobe_that_is_too_short_is_lost() -> None:
    board, port = bench(violations=Policy(rules={"toy.T1": STRICT}))
    port.delay(1)

    by_lines(port, True, 1, 0x11, low_ps=99_999)

    assert port.read(1) == 0
    assert board.counters["toy.T1"] == 1


def test_strobes_without_any_time_between_them_are_not_judged() -> None:
    board, port = bench()
    names = [name.split(".")[1] for name in port.info().lines]
    write, select = 1 << names.index("/WR"), 1 << names.index("/CS")

    port.drive(0x33)
    port.lines(write | select, 0)
    port.lines(write | select, write | select)

    assert not board.violations


OPERATIONS = st.lists(st.tuples(st.booleans(), st.integers(0, 1), st.integers(0, 255)), max_size=30)


@given(OPERATIONS, st.sampled_from(["lockstep", "slaved"]))
def test_watching_the_bus_changes_nothing(
    operations: list[tuple[bool, int, int]], policy: str
) -> None:
    """The fast path and the strobes played on the nets give the same replies and instants."""
    results = []
    for watched in (False, True):
        board, port = bench(policy)
        log = Log()
        board.start_trace()
        if watched:
            board.watch("t0./WR", log)
            board.watch("t0.IRQ", log)
        replies = []
        for step, (write, address, data) in enumerate(operations):
            if policy == "slaved":
                port.at(step * 400_000)
            if write:
                port.write(address, data)
            else:
                replies.append(port.read(address))
        results.append((replies, board.now, board.trace_hash()))

    assert results[0] == results[1]


def test_a_watched_cycle_is_played_with_its_hold_times() -> None:
    board, port = bench()
    log = Log()
    for name in ("/CS", "/WR", "D0-D7"):
        board.watch(f"t0.{name}", log)

    port.write(1, 0x5A)
    port.delay(US)

    assert log.edges == [
        (750_000, "t0./CS", LOW),
        (800_000, "t0./WR", LOW),
        (800_000, "t0.D0-D7", 0x5A),
        (1_000_000, "t0./WR", HIGH),
        (1_050_000, "t0./CS", HIGH),
    ]


def test_an_output_that_somebody_watches_moves_at_its_own_instant() -> None:
    board, port = bench()
    log = Log()
    board.watch("t0.IRQ", log)
    port.write(0, 50)

    board.run_until(51 * US - 1)
    assert log.edges == []
    board.run_until(51 * US)
    assert log.edges == [(51 * US, "t0.IRQ", 1)]


def test_joined_pins_carry_an_edge_to_the_other_chip_at_the_same_instant() -> None:
    board, port = bench(chips=2)
    board.join("alarm", ["t0.IRQ", "t1.TRIG"])
    port.write(0, 30)

    board.run_until(100 * US)

    assert board.chip("t1").triggers == [31 * US]  # type: ignore[attr-defined]


def test_events_report_the_level_of_all_outputs_and_the_instant() -> None:
    board, port = bench(chips=2)
    calls: list[int] = []
    port.on_events = lambda: calls.append(board.now)
    port.events(0b10)
    port.select(0b10)
    port.write(0, 5)
    port.select(0b01)
    port.write(0, 1)

    board.run_until(20 * US)

    assert port.take_events() == [(0b11, 6 * US)]
    assert port.take_events() == []
    assert calls == [6 * US]


def test_sync_tells_the_outputs_and_when_the_next_edge_may_come() -> None:
    _, port = bench()

    assert port.sync() == (0, NEVER)
    port.write(0, 40)
    assert port.sync() == (0, 41 * US)
    port.delay(40 * US)
    assert port.sync() == (1, NEVER)


def test_a_claim_holds_the_other_session_until_it_is_given_back() -> None:
    board, one = bench(chips=2)
    two = board.open_port("two")
    resumed: list[str] = []
    two.on_resume = lambda: resumed.append("two")

    assert one.claim() is True
    assert two.held
    assert two.claim() is False

    one.unclaim()
    assert not two.held
    assert resumed == ["two"]
    assert two.claim() is True
    assert one.held


def test_a_session_that_is_held_by_a_claim_goes_on_no_sooner() -> None:
    board, one = bench()
    two = board.open_port("two")
    one.claim()
    assert not two.go_on()
    one.unclaim()
    assert two.go_on()


def test_a_port_is_not_held_until_it_says_so() -> None:
    assert HostPort().held is False


def test_a_session_held_by_a_claim_goes_on_with_another_chip() -> None:
    board, one = bench(chips=2)
    two = board.open_port("two")
    one.claim()
    two.select(0b10)
    assert two.go_on()


def test_a_wait_ends_when_its_time_is_over() -> None:
    _, port = bench()
    port.write(0, 100)
    assert port.wait(2 * US) == (False, 3 * US)


def test_a_slaved_host_may_be_a_millisecond_ahead_before_it_is_held() -> None:
    board, port = bench("slaved")
    board.limit = US
    port.at(1001 * US)
    assert not port.held
    port.at(1001 * US + 1)
    assert (port.held, port.hold_until) == (True, US + 1)


def test_a_cycle_stamped_with_instant_0_is_at_instant_0() -> None:
    board, port = bench("slaved")
    port.at(0)
    port.read(0)
    assert board.now == 0


def test_a_claim_on_one_chip_leaves_the_others_free() -> None:
    board, one = bench(chips=2)
    two = board.open_port("two")
    two.select(0b10)

    assert one.claim() is True
    assert not two.held
    two.select(0b01)
    assert two.held


def claimed_by_each(count: int) -> list[HostBus]:
    """Sessions of one board that have each claimed a chip, the first the first."""
    board, port = bench(chips=count)
    ports = [port, *(board.open_port(str(n)) for n in range(1, count))]
    for number, port in enumerate(ports):
        port.select(1 << number)
    assert all(port.claim() for port in ports)
    return ports


@pytest.mark.parametrize("count", [2, 3])
def test_the_select_that_would_make_all_wait_for_ever_is_refused(count: int) -> None:
    *others, last = claimed_by_each(count)
    for number, port in enumerate(others):
        port.select(2 << number)
        assert port.held

    with pytest.raises(PortError, match="select 1: claimed by a session that waits for") as refused:
        last.select(0b01)

    assert refused.value.code == codes.DEADLOCK
    assert last.selection.mask == 1 << count - 1
    assert not last.held
    last.unclaim()
    assert not others[-1].held


def test_to_wait_for_somebody_who_does_not_wait_is_no_deadlock() -> None:
    one, two = claimed_by_each(2)
    one.select(0b11)
    assert one.held
    two.read(0)
    two.unclaim()
    assert not one.held


def test_a_session_that_ends_gives_back_its_claim_its_lines_and_its_pins() -> None:
    board, one = bench()
    two = board.open_port("two")
    one.claim()
    one.lines(0b1000, 0)
    one.pin(one.pin_number("TRIG"), 1)

    one.close()

    assert not two.held
    assert board.find_pin("t0./WR").value == HIGH
    assert board.find_pin("t0.TRIG").value == LOW


def test_pins_and_lines_are_found_by_name_and_unknown_ones_name_what_there_is() -> None:
    _, port = bench(chips=2)

    assert port.info().pins == ["t0.TRIG", "t0.IRQ", "t1.TRIG", "t1.IRQ"]
    assert port.pin_number("t1.IRQ") == 3
    assert port.pin_number("IRQ") == 1
    with pytest.raises(PortError, match=r"^no 'X'; this session has t0\.TRIG, t0\.IRQ, "):
        port.pin_number("X")


def test_chips_on_a_shared_bus_have_one_set_of_strobes_and_their_own_selects() -> None:
    board = Board("bench")
    for name in ("a", "b"):
        board.add_chip(Toy, name, "TOY", 8_000_000)
    board.share_bus("main", ["a", "b"])
    port = board.open_port("host")

    assert port.info().lines == ["a./CS", "main.A0", "main./RD", "main./WR", "b./CS"]

    names = port.info().lines
    selects = 1 << names.index("a./CS") | 1 << names.index("b./CS")
    strobe = 1 << names.index("main./WR")
    address = 1 << names.index("main.A0")
    port.drive(0x99)
    port.lines(selects | strobe | address, address)
    port.lines(selects | strobe, selects | strobe)

    for number in (0, 1):
        port.select(1 << number)
        assert port.read(1) == 0x99, "one strobe, two chips"


def test_two_hosts_that_drive_one_bus_differently_are_found_fighting() -> None:
    board, one = bench()
    two = board.open_port("two")

    one.drive(0xFF)
    two.drive(0x0F)

    assert [v.rule for v in board.violations] == ["board.contention"]
    assert "outputs disagree" in board.violations[0].detail


def test_a_card_decodes_its_own_addresses_only() -> None:
    board, _ = bench(chips=2)
    reached = {0x340: (0, 0), 0x342: (0, 1), 0x344: (1, 0)}
    rows = {address: CardAccess(*place, 0, -1) for address, place in reached.items()}
    card = Card("isa", 0x340, rows, rows)
    port = board.open_port("host", card=card)

    assert port.card(0x342) == CardAccess(0, 1, 0, -1)
    assert port.card(0x344) == CardAccess(1, 0, 0, -1)
    assert port.card(0x341) is None
    assert port.card(0x100) is None


@given(OPERATIONS, OPERATIONS)
def test_a_board_restored_from_a_snapshot_goes_on_as_if_nothing_had_happened(
    first: list[tuple[bool, int, int]], second: list[tuple[bool, int, int]]
) -> None:
    def play(port: HostBus, operations: list[tuple[bool, int, int]]) -> list[int]:
        replies = []
        for write, address, data in operations:
            if write:
                port.write(address, data)
            else:
                replies.append(port.read(address))
        return replies

    board, port = bench()
    play(port, first)
    state = board.save()
    expected = play(port, second), board.state_hash()

    other, other_port = bench()
    other.load(state)

    assert (play(other_port, second), other.state_hash()) == expected


def test_an_edge_that_a_lazy_chip_owes_was_before_events_are_asked_for() -> None:
    """Whether somebody has looked at the chip since is no difference to the host."""
    board = load_board_text(
        'board = { name = "b", time = "lockstep", power_on = "done" }\n'
        '[chips]\nx = { part = "MC1241A", clock = "25 MHz", plants = ["none"] }\n'
    )
    port = board.open_port("host")
    port.write(1, 0x02)
    assert port.sample()[1] == 0b10, "HostRdy is low while the command is taken"
    port.delay(MS)
    port.events(0b11)
    assert port.take_events() == []
    assert port.sample()[1] == 0b11


@pytest.mark.parametrize(
    ("looks", "found"),
    [("within", {}), ("before", {"x": (1, 0x00, 0x84)}), ("after", {"x": (1, 0x00, 0x84)}),
     ("before within", {}), ("", {})],
)  # fmt: skip
def test_a_look_outside_the_strobe_that_gave_another_byte_is_noted(
    looks: str, found: dict[str, tuple[int, int, int]]
) -> None:
    board = load_board_text(ALONE)
    port = board.open_port("host")
    mask = {name.split(".")[1]: 1 << n for n, name in enumerate(port.info().lines)}

    def look(where: str) -> None:
        if where in looks.split():
            port.sample()

    port.lines(mask["/PS"] | mask["/CS"], 0)
    for _ in range(2):
        look("before")
        port.lines(mask["/RD"], 0)
        port.delay(US)
        look("within")
        port.lines(mask["/RD"], mask["/RD"])
        if "after" in looks:  # another byte stands there then
            port.drive(0x00)
            port.release()
        look("after")
    assert {chip: row[:3] for chip, row in board.missed.items()} == found


def test_a_byte_that_changes_while_its_strobe_is_low_has_not_been_missed() -> None:
    board = load_board_text(ALONE)
    port = board.open_port("host")
    mask = {name.split(".")[1]: 1 << n for n, name in enumerate(port.info().lines)}
    port.lines(mask["/PS"] | mask["/CS"], 0)
    for level in (0, mask["/WR"]):  # RSTI: the chip is busy with it
        port.lines(mask["/WR"], level)
        port.drive(0x1D)
        port.delay(US)
    port.release()
    port.lines(mask["/RD"], 0)
    port.delay(US)
    busy = port.sample()[0]
    port.delay(MS)
    free = port.board.chip("x").bus_net.value
    port.lines(mask["/RD"], mask["/RD"])
    assert (busy & 1, free & 1) == (1, 0)
    assert board.missed == {}


def test_the_word_of_levels_has_the_first_32_outputs() -> None:
    board = Board("bench", "lockstep")
    for number in range(40):
        board.add_chip(Toy, f"t{number}", "TOY", 8_000_000)
    board.power_on()
    host = board.open_port("host")
    assert len(host.pins.outputs) > 32
    changes = []
    for output in host.pins.outputs[30:33]:
        before = host.sample()[1]
        output.drive(1 - output.level)
        board.kernel.settle()
        changes.append(before ^ host.sample()[1])
    assert changes == [1 << 30, 1 << 31, 0]
