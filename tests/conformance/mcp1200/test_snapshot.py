"""Saving and loading, laziness, and that looking changes nothing."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mcp1200.conftest import Bench, Rail
from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.chips.base import OUTPUT
from vbus.chips.mcp1200.chip import MCP1200
from vbus.core.signals import Observer, Plant
from vbus.core.state import save
from vbus.plant.dc_motor import DcMotor
from vbus.plant.ideal import IdealPlant
from vbus.plant.stepper import StepperMotor

Op = tuple[str, int, int]


def plant_of(kind: int) -> Plant | None:
    if kind == 0:
        return None
    if kind == 1:
        return DcMotor()
    return StepperMotor() if kind == 2 else IdealPlant()


WRITES = st.one_of(
    st.tuples(st.just("write"), st.sampled_from([0x00, 0x05]), st.integers(0, 15)),
    st.tuples(st.just("write"), st.sampled_from([0x02, 0x03]), st.integers(0, 255)),
    st.tuples(st.just("write"), st.sampled_from(
        [0x01, 0x04, 0x07, 0x08, 0x09, 0x0A, 0x0B, 0x0E, 0x0F, 0x13, 0x17, 0x18, 0x1A, 0x1C,
         0x24, 0x25, 0x26, 0x28, 0x29, 0x2A, 0x3C, 0x3D, 0x3F, 0x44, 0x45, 0x46, 0x4A, 0x55,
         0x62, 0x64]), st.integers(0, 255)),
    st.tuples(st.just("read"), st.integers(0, 127), st.just(0)),
    st.tuples(st.just("pin"), st.integers(0, 4), st.integers(0, 1)),
    st.tuples(st.just("wait"), st.integers(1, 9000), st.just(0)),
    st.tuples(st.just("wait"), st.integers(30_000, 90_000), st.just(0)),
)  # fmt: skip
SIDE = ("/LIMIT", "/STOP", "TRIG", "INDEX", "/SYNC")


PRELUDE: tuple[Op, ...] = (
    ("write", 0x02, 0x01), ("write", 0x2A, 0x01), ("write", 0x29, 0x90), ("write", 0x28, 12),
    ("write", 0x26, 0x80), ("write", 0x55, 0x10), ("write", 0x00, 0x08), ("write", 0x05, 0x03),
    ("wait", 20_000, 0),
)  # fmt: skip


def perform(bench: Bench, operation: Op) -> int:
    kind, where, value = operation
    if kind == "write":
        bench.write(where, value)
    elif kind == "read":
        return bench.read(where)
    elif kind == "pin":
        bench.drive(SIDE[where], value)
    else:
        bench.wait(where)
    return 0


def prelude(bench: Bench) -> None:
    """A move under way, so that there is something to disturb."""
    bench.extended()
    bench.put("FINAL_POSITION", 400)
    bench.put("PROFILE_VELOCITY", 12)
    bench.put("ACCELERATION", 0x0180)
    bench.put("JERK", 0x1000)
    bench.write(0x00, 0x08)
    bench.control()
    bench.samples(4)


def board_of(kind: int) -> tuple[Board, HostBus]:
    """A board with the chip, a plant and one host."""
    board = Board("b", "slaved")
    board.add_chip(MCP1200, "x", "MCP-1200", 8_000_000)
    plant = plant_of(kind)
    if plant is not None:
        board.connect("x", 0, plant)
    board.power_on(True)
    return board, board.open_port("host")


def ask(port: HostBus, operation: Op) -> int:
    """Perform an operation through a board's port."""
    kind, where, value = operation
    if kind == "write":
        port.write(where, value)
    elif kind == "read":
        return port.read(where)
    elif kind == "pin":
        port.pin(port.pin_number(SIDE[where]), value)
    else:
        port.delay(where * 125_000)
    return port.sample()[1]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 3), st.lists(WRITES, max_size=12), st.lists(WRITES, max_size=12))
def test_running_on_equals_loading_and_running_on(
    kind: int, first: list[Op], then: list[Op]
) -> None:
    board, port = board_of(kind)
    for operation in (*PRELUDE, *first):
        ask(port, operation)
    saved = board.save()
    outcome = [ask(port, operation) for operation in then]
    other, host = board_of(kind)
    other.load(saved)
    assert [ask(host, operation) for operation in then] == outcome
    assert other.state_hash() == board.state_hash()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 3), st.lists(WRITES, max_size=16))
def test_listening_to_every_output_changes_nothing(kind: int, operations: list[Op]) -> None:
    """A lazy chip and one whose every edge is watched end in the same state."""
    lazy, watched = Bench(plant=plant_of(kind)), Bench(plant=plant_of(kind))
    for name, pin in watched.chip.pins.items():
        if name != "DB0-DB7":
            pin.net.observe(Observer())
    for bench in (lazy, watched):
        prelude(bench)
    for operation in operations:
        assert perform(lazy, operation) == perform(watched, operation)
    assert save(lazy.chip) == save(watched.chip)
    assert {name: pin.value for name, pin in lazy.chip.pins.items()} == {
        name: pin.value for name, pin in watched.chip.pins.items()
    }


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 3), st.lists(WRITES, max_size=12))
def test_strobes_and_whole_cycles_give_the_same(kind: int, operations: list[Op]) -> None:
    benches = [Bench("cycle", plant=plant_of(kind)), Bench("strobe", plant=plant_of(kind))]
    for bench in benches:
        prelude(bench)
    for operation in operations:
        seen = []
        at = max(one.cycle for one in benches) + 1
        for bench in benches:
            bench.until(at)
            seen.append(perform(bench, operation))
        assert seen[0] == seen[1]
    at = max(one.cycle for one in benches) + 1
    for bench in benches:
        bench.until(at)
    assert save(benches[0].chip)["axis"] == save(benches[1].chip)["axis"]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 3), st.lists(WRITES, max_size=12))
def test_no_output_changes_before_the_next_event(kind: int, operations: list[Op]) -> None:
    bench = Bench(plant=plant_of(kind))
    prelude(bench)
    bench.watch("PULSE", "SIGN", "BUSY", "PROF", "IDLE", "TRIG", "MC0-MC11")
    for operation in operations:
        perform(bench, operation)
        due = bench.chip.due(OUTPUT)
        assert due > bench.kernel.now
        before = {name: pin.value for name, pin in bench.chip.pins.items()}
        bench.until_ps(min(due - 1, bench.kernel.now + 10**10))
        assert {name: pin.value for name, pin in bench.chip.pins.items()} == before


def test_an_idle_hour_skipped_equals_an_idle_hour_stepped() -> None:
    benches = [Bench(plant=Rail()), Bench(plant=Rail())]
    restless = benches[1].probe.plant
    assert restless is not None
    restless.resting = lambda: False  # type: ignore[method-assign]
    for bench in benches:
        bench.until(4160 * 500 + 77)
    one, other = (save(bench.chip)["axis"] for bench in benches)
    assert {name for name in one if one[name] != other[name]} <= {"encoder", "loop", "timer"}
    assert benches[0].sample_start() == benches[1].sample_start()


@pytest.mark.parametrize("kind", [0, 1, 2, 3])
@pytest.mark.parametrize(
    "registers",
    [
        {}, {"FEATURE": 0x08, "KI": 3, "COMMAND_POSITION": 2}, {"EXCEPTION": 0x4C, "MAX_ERROR": 1},
        {"CONFIG": 0x03, "COMMAND_POSITION": 9, "ENCODER_RATIO": 0x0010},
        {"FLAG": 0x0D, "BACKLASH": 3}, {"FLAG": 0x0B, "FINAL_POSITION": 33},
    ],
    ids=lambda registers: "-".join(registers) or "lead",
)  # fmt: skip
def test_a_resting_axis_jumped_over_equals_one_that_was_stepped(
    kind: int, registers: dict[str, int]
) -> None:
    benches = [Bench(plant=plant_of(kind)), Bench(plant=plant_of(kind))]
    for bench in benches:
        bench.extended()
        for name, value in registers.items():
            bench.put(name, value)
        bench.control()
        bench.until(4160 * 40)
    begun = benches[0].cycle
    benches[0].until(begun + 4160 * 400 + 333)
    for clock in range(begun, begun + 4160 * 400 + 333, 4000):
        benches[1].until(clock)
    benches[1].until(begun + 4160 * 400 + 333)
    assert save(benches[0].chip) == save(benches[1].chip)


@pytest.mark.parametrize("before", [1, 2, 3, 50, 95])
@pytest.mark.parametrize("what", ["write", "count"])
def test_what_comes_just_before_a_sample_is_not_jumped_over(what: str, before: int) -> None:
    """A byte not yet visible, a level still in the filter, when a rest of many samples begins."""
    benches = [Bench(), Bench()]
    for bench in benches:
        bench.write(0x1A, 0x70)
        bench.until(4160 * 10 - before)
        if what == "write":
            bench.chip.write(0x0F, 0x50)
        else:
            bench.drive("CHA", 0)
    begun = benches[0].cycle
    benches[0].until(begun + 4160 * 60)
    for clock in range(begun, begun + 4160 * 60, 1000):
        benches[1].until(clock)
    benches[1].until(begun + 4160 * 60)
    assert save(benches[0].chip) == save(benches[1].chip)


@pytest.mark.parametrize("plant", [1, 3])
def test_telemetry_names_what_a_live_view_shows(plant: int) -> None:
    bench = Bench(plant=plant_of(plant))
    assert bench.chip.telemetry()["mode"] == "idle"
    prelude(bench)
    seen = bench.chip.telemetry()
    assert seen["mode"] == "profile"
    assert seen["command"] == bench.seen("COMMAND_POSITION")
    assert set(seen) == {
        "mode", "command", "actual", "error", "velocity", "drive", "flags", "status", "phase",
    }  # fmt: skip
    bench.write(0x05, 0x02)
    bench.samples(1)
    assert bench.chip.telemetry()["mode"] == "halted"


def test_a_motor_is_brought_to_its_target() -> None:
    """The whole loop: PID, PWM, a real motor, an S-curve; settings for a 520 us sample."""
    bench = Bench(plant=DcMotor())
    bench.extended()
    for name, value in {
        "FEATURE": 0x18, "KP": 30, "KI": 120, "KD": 80, "JERK": 0x2000, "ACCELERATION": 0x0080,
        "PROFILE_VELOCITY": 40, "FINAL_POSITION": 4000,
    }.items():  # fmt: skip
        bench.put(name, value)
    bench.write(0x00, 0x08)
    bench.control()
    bench.samples(400)
    assert bench.seen("FLAG") == 0
    assert bench.seen("COMMAND_POSITION") == 4000
    assert bench.get("ACTUAL_POSITION") == pytest.approx(4000, abs=2)
    assert bench.seen("STATUS") == 0xFC
