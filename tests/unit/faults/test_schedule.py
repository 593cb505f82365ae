"""When faults begin and end, what they leave behind, and what is refused."""

import contextlib
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.probe import probe
from tests.unit.faults.bench import DC, IDEAL, LM, MC, MCP, STEPPER, Lm, Mc, Mcp, build, settle
from vbus.board.board import Board
from vbus.board.snapshot import fork
from vbus.core.errors import SnapshotError
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.faults.row import LINK
from vbus.faults.table import faults
from vbus.faults.trigger import (
    AT,
    COMMAND,
    CONDITION,
    CYCLE,
    EDGE,
    NOW,
    POSITION,
    RATE,
    When,
    read_when,
)

FAULTS = faults()


def test_there_are_at_least_thirty_faults_and_each_says_what_it_does() -> None:
    assert len(FAULTS) >= 30
    for name, fault in FAULTS.items():
        assert name == fault.name
        assert fault.title.endswith(".")
        for row in fault.parameters:
            assert row.title
            assert row.default is not None


def test_a_fault_at_an_instant_acts_from_that_instant_on() -> None:
    board = build()
    fault = board.faults.arm("jam", when="at 5 ms", until="for 2 ms")
    board.run_until(5 * MS - 1)
    assert fault.state == "waiting"
    board.run_until(5 * MS)
    assert fault.state == "acting"
    board.run_until(7 * MS - 1)
    assert fault.state == "acting"
    board.run_until(7 * MS)
    assert fault.state == "over"
    assert [(e.when, e.what) for e in board.faults.log] == [(5 * MS, "begun"), (7 * MS, "ended")]


def test_the_nth_bus_cycle_is_counted_from_arming() -> None:
    board = build()
    host = Lm(board)
    host.status()
    fault = board.faults.arm("offset_jump", when="cycle 3")
    host.status()
    host.status()
    assert not fault.fired
    host.status()
    host.status()
    assert [e.when for e in board.faults.log] == [4 * US]


def test_cycles_of_other_chips_are_not_counted() -> None:
    board = build(extra='[chips.y]\npart = "MCP-1200"\nclock = "20 MHz"\nplant = "none"\n')
    x, y = (board.open_port(name, [name]) for name in "xy")
    fault = board.faults.arm("offset_jump", "x.1", when="cycle 2")
    for port in (x, y, y):
        port.read(0)
    board.run_for(0)
    assert fault.fired == 0
    x.read(0)
    board.run_for(0)
    assert fault.fired == 1


@pytest.mark.parametrize(("chip", "plant", "name"), [(LM, DC, "ltrj"), (MC, STEPPER, "SET_VEL")])
def test_a_command_is_seen_in_its_first_byte(chip: str, plant: str, name: str) -> None:
    board = build(chip, plant)
    fault = board.faults.arm("offset_jump", when=f"command {name}")
    host = Lm(board) if chip == LM else Mc(board)
    code = 0x1F if chip == LM else 0x11
    host.ready()
    host.port.write(1 if chip == LM else 0, code)
    host.ready()
    assert not fault.fired
    host.port.write(0 if chip == LM else 1, code)
    assert not board.faults.log
    board.run_for(0)
    assert board.faults.log[0].when == board.now


@pytest.mark.parametrize("name", ["KP", "R26H"])
def test_a_register_write_is_seen_by_name_or_address(name: str) -> None:
    board = build(MCP, DC)
    fault = board.faults.arm("offset_jump", when="command FLAG")
    Mcp(board).write(0x00, 1)
    board.run_for(US)
    assert fault.fired == 1
    board.faults.arm("offset_jump", when=f"command {name}")


def test_an_edge_begins_it_at_its_own_instant() -> None:
    board = build()
    host = Lm(board)
    pin = host.port.pin_number("x./RST")
    host.port.pin(pin, 0)
    fault = board.faults.arm("jam", when="edge /RST low")
    board.run_until(2 * MS)
    host.port.pin(pin, 1)
    board.run_until(3 * MS)
    assert fault.state == "waiting"
    host.port.pin(pin, 0)
    board.run_for(US)
    assert fault.state == "acting"
    assert board.faults.log[0].when == 3 * MS
    assert not board.find_pin("x./RST").net.observers


@pytest.mark.parametrize("direction", [1, -1])
def test_a_position_begins_it_when_the_shaft_comes_there(direction: int) -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("jam", when=f"position {500 * direction}")
    host.move(2000 * direction)
    settle(board, 800)
    assert abs(host.position() - 500 * direction) < 20


def test_a_stream_is_repeatable_and_has_the_rate_asked_for() -> None:
    instants = []
    for _ in range(2):
        board = build()
        board.faults.arm("offset_jump", when="rate 1 kHz", until="for 400 ms", counts=1)
        settle(board, 600)
        instants.append([e.when for e in board.faults.log])
        assert board.faults.all()[0].state == "over"
    assert instants[0] == instants[1]
    assert 300 < len(instants[0]) < 500
    assert len(set(instants[0])) > 290


def test_a_stream_of_lasting_faults_comes_and_goes() -> None:
    board = build()
    board.faults.arm("jam", when="rate 200 Hz", until="for 1 ms")
    settle(board, 200)
    kinds = [e.what for e in board.faults.log]
    assert 20 < kinds.count("begun") < 60
    assert abs(kinds.count("begun") - kinds.count("ended")) <= 1
    board.faults.clear()
    assert type(probe(board.chips[0]).plant).__name__ == "DcMotor"


def test_unfired_tells_what_never_began_and_was_not_called_off() -> None:
    board = build()
    kept = board.faults.arm("jam", when="at 1 s")
    board.faults.clear(board.faults.arm("slip", when="at 1 s"))
    board.faults.arm("offset_jump")
    assert board.faults.unfired() == [kept]


def test_without_faults_nothing_is_put_in_between() -> None:
    board = build()
    host = Lm(board)
    host.tune()
    assert not board.broken
    plant = probe(board.chips[0]).plant
    for name in ("jam", "slip", "load_step", "bit_stuck", "ab_swapped"):
        board.faults.arm(name, until="for 1 ms")
    assert board.disturbed
    assert probe(board.chips[0]).plant is not plant
    settle(board, 5)
    board.faults.clear("ab_swapped")
    mine = probe(board.chips[0]).plant
    assert mine is plant or mine.inner is plant
    assert not board.disturbed
    assert not board.observers
    assert not board.kernel.observed
    assert not any(net.bends for net in board.pin_nets)


def test_no_lease_is_given_while_a_fault_waits() -> None:
    board = build()
    host = Lm(board)
    host.status()
    assert host.port.lease(0) is not None
    fault = board.faults.arm("byte_flipped", when="cycle 40")
    host.status()
    assert host.port.lease(0) is None
    board.faults.clear(fault)
    host.status()
    assert host.port.lease(0) is not None


class Faulty(Observer):
    def __init__(self) -> None:
        self.told: list[tuple[int, str, str, str]] = []

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        self.told.append((when, name, target, what))


def test_evidence_goes_to_observers_and_into_the_trace_hash() -> None:
    hashes = []
    for when in (None, "at 2 ms", "at 3 ms"):
        board = build()
        board.start_trace()
        seen = Faulty()
        board.listen(seen)
        if when:
            board.faults.arm("index_missing", when=when)
        settle(board, 5)
        assert len(seen.told) == (when is not None)
        hashes.append(board.trace_hash())
    assert len(set(hashes)) == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("jamm",), 'there is no fault "jamm"; did you mean "jam"?'),
        (("jam", "y"), "no chip called 'y'"),
        (("jam", "x.2"), 'axes of "x" are 1 to 1'),
        (("ready_stuck",), "say on which target; there are x"),
        (("ready_stuck", "x"), 'ready_stuck exists for mc1241a; "x" is a LM629N-8'),
        (("bit_stuck", "x.1"), 'bit_stuck is a fault of the chip: write "x"'),
        (("link_dead", "x"), 'write "host0" for the first'),
        (("jam", "x", "soon"), 'when = "soon": write "now", "at 5 ms"'),
        (("jam", "x", "at 5"), "it has no unit"),
        (("jam", "x", "cycle 0"), "1 or more"),
        (("jam", "x", "command LTRI"), 'has no command "LTRI"; did you mean "LTRJ"?'),
        (("jam", "x", "edge x./RTS low"), "LM629N-8 has no pin '/RTS'"),
        (("jam", "x", "edge x.HI up"), 'when = "edge x.HI up": write "now", "at 5 ms"'),
        (("jam", "x", "edge low"), 'when = "edge low": write "now", "at 5 ms"'),
        (("jam", "x", "now", "once"), 'jam lasts; write "for 5 ms", or "cleared"'),
        (("jam", "x", "now", "for 0 s"), "lasts longer than that"),
        (("jam", "x", "rate 5 Hz"), "say how long each time"),
        (("offset_jump", "x", "now", "for 1 ms"), "is over at once"),
    ],
)
def test_what_cannot_be_is_refused_with_a_sentence(arguments: tuple, message: str) -> None:
    board = build()
    with pytest.raises(ValueError, match=re.escape(message)):
        board.faults.arm(*arguments)
    assert not board.faults.all()


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("slip", {"shar": 0.5}, 'slip has no "shar"; did you mean "share"?'),
        ("slip", {"share": 2.0}, "share = 2.0: out of range: from 0.0 to 1.0"),
        ("load_step", {"torque": "5 V"}, '"V" is the unit of a voltage'),
        ("bit_stuck", {"bit": "D0"}, "write a whole number without unit, from 0 to 7"),
        ("index_double", {"distance": 41}, "a multiple of 4"),
    ],
)
def test_wrong_parameters_are_refused(name: str, parameters: dict, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        build().faults.arm(name, **parameters)


def test_a_shaft_is_needed_for_torques() -> None:
    with pytest.raises(ValueError, match="load_step needs a plant with a shaft, dc_motor or"):
        build(LM, IDEAL).faults.arm("load_step")


def test_texts_with_units_are_taken_as_in_a_board_file() -> None:
    fault = build().faults.arm("load_step", torque="20 mN*m")
    assert fault.values == {"torque": 0.02}


def test_clearing_what_is_not_there_says_what_is() -> None:
    board = build()
    board.faults.arm("jam")
    with pytest.raises(ValueError, match='no fault "slip" is armed; there are jam'):
        board.faults.clear("slip")
    assert [armed.number for armed in board.faults.clear("#1")] == [1]


def test_a_link_fault_without_a_server_fails_and_says_so() -> None:
    board = build()
    fault = board.faults.arm("link_closed")
    assert fault in board.faults.unfired()
    assert board.faults.log[-1].text == "no link is served: this board has no server, or none yet"


def test_a_command_to_the_only_chip_begins_a_fault_of_a_link() -> None:
    board = build()
    board.faults.arm("link_closed", when="command DFH")
    host = Lm(board)
    host.ready()
    host.port.write(0, 0x02)
    board.run_for(0)
    assert [(e.when, e.name) for e in board.faults.log] == [(board.now, "link_closed")]
    board = build(extra='[chips.y]\npart = "MCP-1200"\nclock = "20 MHz"\nplant = "none"\n')
    with pytest.raises(ValueError, match='when = "command DFH": a fault of a link has no command'):
        board.faults.arm("link_closed", when="command DFH")


@pytest.mark.parametrize(
    ("when", "instant"),
    [
        ("x.real > 40", None),
        ("x.status.BUSY", None),
        ("x.HI and time >= 3.5 ms", 3_500 * US),
        ("rising(x.A) and x.B == 0", 5 * MS),
        ("x.A == 1 and x.B == 0 or x.reset", 5 * MS),
        ("x.command == DFH", 7 * MS + US),
        ("command DFH and x.A", 7 * MS + US),
        ("violation lm628.busy-write", 7 * MS + 2 * US),
        ("time > 5 ms", 5 * MS + 1),
    ],
)
def test_a_fault_waits_for_a_condition(when: str, instant: int | None) -> None:
    """It begins at the instant; where a snapshot is taken on the way, no less."""
    when = when.replace("x.reset", "x./RST == 0")

    def run(saved: bool) -> Board:
        board = build()
        host = Lm(board)
        fault = board.faults.arm("friction", when=when, coulomb="1 mN*m")
        if instant is None:
            host.move(100)
            board.run_for(900 * MS)
            assert fault.fired
            return board
        board.run_until(5 * MS)
        host.port.pin(host.port.pin_number("A"), 1)
        board = fork(board) if saved else board
        board.run_until(7 * MS)
        board.ports[0].write(0, 0x02)
        board.ports[0].write(0, 0x02)
        board.run_for(MS)
        return board

    boards = [run(False)] if instant is None else [run(False), run(True)]
    for board in boards:
        (armed,) = board.faults.all()
        assert armed.fired == 1
        if instant is not None:
            begun = [one.when for one in board.faults.log]
            assert begun in ([instant], []), "what happened before the snapshot is in no log"
    assert len({board.state_hash() for board in boards}) == 1


@pytest.mark.parametrize(
    ("when", "message"),
    [
        ("x.reel > 4", 'when = "x.reel > 4": no "x.reel" at character 1; did you mean "x.real"?'),
        ("x.real > > 4", 'when = "x.real > > 4": a name or a number is expected, not ">", at'),
        ("x.HI stable for 2 ms", 'a fault waits for what is, and for edges of pins and values: no'),
        ("command LTRI and x.HI", 'no command "LTRI" at character 1; did you mean "LTRJ"?'),
    ],
)  # fmt: skip
def test_a_condition_that_cannot_be_is_refused(when: str, message: str) -> None:
    board = build()
    with pytest.raises(ValueError, match=re.escape(message)):
        board.faults.arm("jam", "x", when)
    assert board.kernel.observed == 0


@pytest.mark.parametrize(
    ("text", "when"),
    [
        ("x.HI and x.A", When(CONDITION, 0, "x.HI and x.A", "x.HI and x.A")),
        ("now", When(NOW, 0, "", "now")),
        ("at 5 ms", When(AT, 5 * MS, "", "at 5 ms")),
        ("cycle 12", When(CYCLE, 12, "", "cycle 12")),
        ("position -0x10", When(POSITION, -16, "", "position -0x10")),
        ("command LTRJ", When(COMMAND, 0, "LTRJ", "command LTRJ")),
        ("edge x./RST low", When(EDGE, 0, "x./RST", "edge x./RST low")),
        ("edge HI high", When(EDGE, 1, "HI", "edge HI high")),
        ("rate 10 Hz", When(RATE, 100 * MS, "", "rate 10 Hz")),
    ],
)
def test_a_trigger_is_read_into_its_kind_and_its_number(text: str, when: When) -> None:
    assert read_when(text) == when


NAMES = sorted(name for name, fault in FAULTS.items() if fault.target != LINK)


def moving(kind: str) -> Board:
    board = {
        "lm": lambda: build(LM, DC),
        "mcp": lambda: build(MCP, DC),
        "mc": lambda: build(MC, STEPPER),
    }[kind]()
    host = {"lm": Lm, "mcp": Mcp, "mc": Mc}[kind](board)
    host.spin()
    settle(board, 10)
    return board


WHENS = st.sampled_from([None, "at 12 ms", "rate 400 Hz", "position 3", "cycle 2"])


def but_ports(state: dict) -> dict:
    """Leave out what a host has soldered: strobes that were looked at leave their traces."""
    return {name: kept for name, kept in state.items() if name != "ports"}


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["lm", "mcp", "mc"]),
    st.lists(st.tuples(st.sampled_from(NAMES), WHENS), min_size=1, max_size=4),
    st.integers(0, 6 * MS),
    st.integers(0, 6 * MS),
)
def test_a_run_goes_on_from_a_saved_state_as_it_would_have(kind, wanted, first, second) -> None:
    board = moving(kind)
    for name, when in wanted:
        fault = FAULTS[name]
        if fault.families and board.chips[0].FAMILY not in fault.families:
            continue
        until = "for 2 ms" if fault.acts == "lasts" or when == "rate 400 Hz" else None
        with contextlib.suppress(ValueError):  # of another kind of motor
            board.faults.arm(name, when=when, until=until)
    board.run_for(first)
    state = board.save()
    board.run_for(second)
    board.ports[0].read(0)
    ends = board.save()
    other = moving(kind)
    for target in (other, board):
        target.load(state)
        assert but_ports(target.save()) == but_ports(state)
        target.run_for(second)
        target.ports[0].read(0)
        assert but_ports(target.save()) == but_ports(ends)


def test_faults_of_one_encoder_act_in_the_order_of_arming_before_and_after_a_load() -> None:
    board, other = moving("lm"), moving("lm")
    board.faults.arm("backlash", when=board.now + 5 * MS)
    board.faults.arm("a_stuck")
    board.run_for(10 * MS)
    other.load(board.save())
    for one in (board, other):
        one.run_for(20 * MS)
    assert but_ports(other.save()) == but_ports(board.save())


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"_last": 1.5}, "the state.faults._last: wants an integer of 64 bits, not 1.5"),
        ({"due": ((1, 2, 3),)}, "the state.faults.due: wants 4 values in a row, not (1, 2, 3)"),
        ({"records": ((1, "no_such"),)}, "the state.faults.records: wants 13 values in a row"),
        ({"acts": {"axes": (("q.1", True, 0, ()),), "courses": ()}},
         "the state.faults: no such axis: q.1"),
        ({"acts": {"axes": (), "courses": (("q", ()),)}}, "the state.faults: no such chip: q"),
        ({"acts": {"axes": ()}}, "the state.faults.acts.courses: is missing"),
    ],
)  # fmt: skip
def test_bad_saved_faults_are_named_and_change_nothing(
    change: dict[str, object], text: str
) -> None:
    board = build()
    board.faults.arm("backlash", gap=7)
    board.faults.arm("clock_off", ppm=50)
    before = board.save()
    bad = {**before, "faults": {**before["faults"], **change}}
    with pytest.raises(SnapshotError, match=re.escape(text)):
        board.load(bad)
    assert board.save() == before


def test_a_saved_fault_nobody_knows_is_named() -> None:
    board = build()
    board.faults.arm("backlash", gap=7)
    before = board.save()
    (record,) = before["faults"]["records"]
    bad = {**before, "faults": {**before["faults"], "records": ((1, "no_such", *record[2:]),)}}
    with pytest.raises(SnapshotError, match=r"^the state.faults: no such fault: no_such$"):
        board.load(bad)
    assert board.save() == before
