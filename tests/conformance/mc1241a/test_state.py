"""Being looked at changes nothing; a saved state goes on like the original; rest costs nothing."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mc1241a.conftest import CYCLE, words
from tests.probe import probe
from vbus.board.board import Board
from vbus.chips.base import OUTPUT
from vbus.chips.mc1241a.chip import MC1241A
from vbus.chips.mc1241a.chipset import ProfileRegisters
from vbus.chips.mc1241a.datasheet import COMMANDS
from vbus.chips.mc1241a.microstep import Microstepper
from vbus.core.kernel import MS, SECOND, US
from vbus.core.signals import Observer, Plant, Switch
from vbus.core.state import load, save
from vbus.plant.ideal import IdealPlant
from vbus.plant.stepper import StepperMotor
from vbus.protocols.port import HostPort


class Rig:
    """A board with one chip set, two motors and one host."""

    def __init__(self, motors: Callable[[], Plant] | None = None, skipping: bool = True) -> None:
        self.board = Board("rig", "lockstep")
        chip = self.board.add_chip(MC1241A, "m", "MC1241A", 25_000_000)
        assert isinstance(chip, MC1241A)
        self.chip: MC1241A = chip
        probe(chip).skipping = skipping
        if motors is not None:
            for axis in (0, 1):
                plant = motors()
                plant.switches["home"] = Switch(500, 600)
                plant.switches["limit+"] = Switch(3000, 5000, 1)
                self.board.connect("m", axis, plant)
        self.port: HostPort = self.board.open_port("host")
        self.board.power_on(True)

    def send(self, name: str, value: int = 0) -> None:
        row = COMMANDS[name]
        self.port.wait(10 * MS)
        self.port.write(1, row.code)
        for word in words(value, row.write):
            self.port.wait(10 * MS)
            self.port.write(0, word >> 8)
            self.port.write(0, word & 0xFF)
        self.port.wait(10 * MS)

    def pin(self, name: str, level: int) -> None:
        self.port.pin(self.port.pin_number(name), level)

    def do(self, action: tuple[str, int]) -> None:
        name, value = action
        if name == "run":
            self.board.run_for(value)
        elif name in COMMANDS_BY_NAME:
            self.send(name, value)
        else:
            self.pin(name, value)


COMMANDS_BY_NAME = {row.name for row in COMMANDS}
NUMBERS = {
    "SET_POS": st.integers(-3000, 3000),
    "SET_VEL": st.integers(0, 20 << 16),
    "SET_ACC": st.integers(-(4 << 16), 4 << 16),
    "SET_MAX_ACC": st.integers(0, 32767),
    "SET_MTR_CMD": st.integers(-32768, 32767),
    "SET_BUF_MTR_CMD": st.integers(-32768, 32767),
    "SET_JERK": st.integers(1 << 24, 2**31 - 1),
    "SET_RATIO": st.integers(-(4 << 16), 4 << 16),
    "SET_START_VEL": st.integers(0, 2 << 16),
    "SET_BRK_PNT": st.integers(-1000, 1000),
    "SET_POS_ERR": st.integers(0, 200),
    "SET_STEP_RATIO": st.sampled_from([0, 256]),
    "SET_LMT_SENSE": st.sampled_from([0, 0, 15]),
}
commands = st.one_of(
    *(
        st.tuples(
            st.just(row.name),
            NUMBERS.get(row.name, st.integers(0, (1 << 16 * row.write) - 1)),
        )
        for row in COMMANDS
    )
)
pins = st.tuples(
    st.sampled_from(["QuadA1", "QuadB1", "~Home1", "~Index1", "PosLimit1", "NegLimit2", "~Reset"]),
    st.sampled_from([0, 1, 2]),
)
runs = st.tuples(st.just("run"), st.integers(1, 40 * CYCLE))


@st.composite
def moves(draw: st.DrawFn) -> list[tuple[str, int]]:
    """Return what starts a motion in one of the four modes, and a while of it."""
    deeds = [
        (f"SET_{draw(st.sampled_from([1, 2]))}", 0),
        ("SET_PRFL_" + draw(st.sampled_from(["TRAP", "VEL", "S_CRV", "GEAR"])), 0),
        ("SET_BUF_MTR_CMD", draw(st.sampled_from([0, 20_000, 32_767]))),
        (draw(st.sampled_from(["SET_PHASE_2", "SET_PHASE_3"])), 0),
        (draw(st.sampled_from(["MTR_ON", "SET_INTRPT_MASK", "SET_EXT_BRK", "STOP"])), 0x5D),
    ]
    for name in ("POS", "VEL", "ACC", "MAX_ACC", "JERK", "RATIO"):
        deeds.append(("SET_" + name, draw(NUMBERS["SET_" + name])))
    return [*deeds, ("UPDATE", 0), ("run", draw(st.integers(1, 60 * CYCLE)))]


actions = st.lists(
    st.one_of(st.lists(st.one_of(commands, pins, runs), min_size=1, max_size=6), moves(), moves()),
    min_size=2,
    max_size=8,
).map(lambda parts: [deed for part in parts for deed in part])
motors = st.sampled_from([None, lambda: IdealPlant({"encoder_lines": 3200}), StepperMotor])


def _state(rig: Rig) -> dict[str, object]:
    """Return all but the instants of the slot run last: time, motors, port, outputs, axes."""
    saved = save(rig.chip)
    cycles = {key: saved["cycles"][key] for key in ("shared", "_driven", "motors")}
    commands = saved["commands"]
    return {
        "cycles": cycles,
        "commands": commands,
        **{key: saved[key] for key in ("interrupts", "port", "output", "host_pins", "axes")},
    }


@settings(deadline=None, max_examples=150)
@given(actions, motors)
def test_passing_over_rest_equals_running_through_it(
    deeds: list[tuple[str, int]], motor: Callable[[], Plant] | None
) -> None:
    quick, thorough = Rig(motor), Rig(motor, skipping=False)
    for deed in deeds:
        quick.do(deed)
        thorough.do(deed)
        assert _state(quick) == _state(thorough)


@settings(deadline=None, max_examples=60)
@given(actions, motors, st.integers(10 * US, 3 * CYCLE))
def test_a_chip_that_is_looked_at_often_does_the_same(
    deeds: list[tuple[str, int]], motor: Callable[[], Plant] | None, pause: int
) -> None:
    lazy, watched = Rig(motor), Rig(motor)
    for deed in deeds:
        lazy.do(deed)
        if deed[0] == "run":
            left = deed[1]
            while left:
                step = min(pause, left)
                watched.board.run_for(step)
                watched.board.catch_up()
                left -= step
        else:
            watched.do(deed)
    assert lazy.board.save() == watched.board.save()


@settings(deadline=None, max_examples=40)
@given(actions, motors)
def test_a_chip_whose_lines_are_heard_does_the_same(
    deeds: list[tuple[str, int]], motor: Callable[[], Plant] | None
) -> None:
    lazy, heard = Rig(motor), Rig(motor)
    for pin in ("HostRdy", "~HostIntrpt"):
        heard.board.watch(f"m.{pin}", Observer())
    for deed in deeds:
        lazy.do(deed)
        heard.do(deed)
    assert save(lazy.chip) == save(heard.chip)


@settings(deadline=None, max_examples=40)
@given(actions, actions, motors, st.booleans())
def test_a_loaded_state_goes_on_like_the_original(
    before: list[tuple[str, int]],
    after: list[tuple[str, int]],
    motor: Callable[[], Plant] | None,
    wave: bool,
) -> None:
    first, second = Rig(motor), Rig(motor)
    if wave:
        for rig in (first, second):
            rig.board.watch("m.PWMMag1A", Observer())
            rig.board.watch("m.~I/OWrite", Observer())
    for deed in before:
        first.do(deed if deed[0] != "run" else ("run", deed[1] // 20))
    state = first.board.save()
    second.board.load(state)
    assert second.board.save() == state
    for deed in after:
        short = deed if deed[0] != "run" else ("run", deed[1] // 20)
        first.do(short)
        second.do(short)
    assert first.board.save() == second.board.save()
    assert first.board.state_hash() == second.board.state_hash()


def test_the_widest_s_curve_can_be_saved_and_hashed() -> None:
    rig = Rig()
    rig.send("SET_PRFL_S_CRV")
    rig.send("SET_ACTL_POS", -(2**30))
    for name, value in (("POS", 2**30 - 1), ("VEL", 2**30 - 1), ("MAX_ACC", 1), ("JERK", 1)):
        rig.send("SET_" + name, value)
    rig.send("UPDATE")
    rig.board.run_for(SECOND)
    assert len(rig.board.state_hash()) == 64
    other = Rig()
    other.board.load(rig.board.save())
    assert other.board.state_hash() == rig.board.state_hash()


@pytest.mark.spec("PMD-UPD-1")
def test_once_an_update_has_replaced_it_an_amplitude_past_the_buffer_has_left_no_trace() -> None:
    first, second = Rig(), Rig()
    first.send("SET_MTR_CMD", 0x2000)
    second.send("SET_POS_ERR", 32767)  # as it is; takes as long
    for rig in (first, second):
        rig.send("SET_BUF_MTR_CMD", 0x1000)
        rig.send("UPDATE")
        rig.board.run_for(2 * CYCLE)
        rig.board.catch_up()
    one, other = (save(rig.chip)["axes"][0] for rig in (first, second))
    assert {name for name in one if one[name] != other[name]} <= {"stepper"}


def test_an_angle_that_renumbering_has_left_is_saved_with_its_fraction() -> None:
    stepper = Microstepper(True)
    stepper.renumber((200 << 32) + 0x89ABCDEF, 0)
    second = Microstepper(True)
    load(second, save(stepper))
    assert save(second) == save(stepper)
    for target, angle in ((0, 200), (0x76543210, 200), (0x76543211, 201)):
        second.begin_cycle(target, 0)
        assert second.angle(8) == angle


def test_registers_and_currents_begin_at_zero() -> None:
    assert {*save(ProfileRegisters()).values()} == {0}
    assert {*sum((tuple(one) for one in save(Rig().chip)["cycles"]["_driven"]), ())} == {0}


@pytest.mark.parametrize("motor", [None, StepperMotor])
def test_an_hour_of_rest_is_passed_over_at_once(motor: Callable[[], Plant] | None) -> None:
    """And equals the hour stepped cycle by cycle in state: time is all that changes."""
    rig = Rig(motor)
    rig.send("SET_PHASE_2")
    rig.send("SET_BUF_MTR_CMD", 0x4000)
    rig.send("UPDATE")
    rig.board.run_for(2 * SECOND)
    rig.board.catch_up()
    cycles = probe(rig.chip)
    time, run = cycles.time, cycles.cycles_computed
    rig.board.run_for(3600 * SECOND)
    rig.board.catch_up()
    assert cycles.time - time in (6_633_254, 6_633_255)
    assert cycles.cycles_computed - run <= 1


@pytest.mark.spec("PMD-USTP-2", "PMD-CMD-64")
@pytest.mark.parametrize("command", [30_000, -30_000])
def test_a_motor_at_rest_gets_a_new_amplitude_from_the_next_slot_on(command: int) -> None:
    """Two phases at angle 0: B alone changes, in whatever slot that is, and turns the field."""
    for phase in range(20):
        rig = Rig(lambda: IdealPlant({"encoder_lines": 3200}))
        rig.send("SET_PHASE_2")
        rig.send("SET_MTR_CMD", -command)
        rig.board.run_for(10 * CYCLE + phase * CYCLE // 20)
        before = rig.chip.telemetry()["actual 1"]
        rig.send("SET_MTR_CMD", command)
        rig.board.run_for(10 * CYCLE)
        assert rig.chip.telemetry()["actual 1"] != before, phase


class Standing(Plant):
    """A motor that has come to rest."""

    TAKES = ("phases",)

    def prepare(self, period: float) -> None:
        pass

    def phases(self, a: float, b: float, c: float) -> int:
        return 0

    def resting(self) -> bool:
        return True


def test_a_motor_at_rest_does_not_end_the_rest_of_a_chip_set_without_currents() -> None:
    rig = Rig()
    rig.board.run_for(10 * CYCLE)
    rig.board.catch_up()
    rig.chip.connect(0, Standing())
    assert rig.chip.resting()


def test_rest_ends_at_a_time_breakpoint() -> None:
    rig = Rig()
    rig.send("SET_BRK_PNT", 1_000_000)
    rig.send("SET_TIME_BRK")
    rig.send("SET_INTRPT_MASK", 0x0004)
    assert rig.chip.due(OUTPUT) == 1_000_000 * CYCLE
    rig.board.watch("m.~HostIntrpt", Observer())
    rig.board.run_until(1_000_000 * CYCLE - 1)
    assert rig.chip.pins["~HostIntrpt"].value == 1
    rig.board.run_until(1_000_000 * CYCLE)
    assert rig.chip.pins["~HostIntrpt"].value == 0


def test_a_breakpoint_met_at_rest_fires_in_its_own_cycle_though_nobody_looks() -> None:
    rig = Rig()
    for name, value in (("POS", 1000), ("VEL", 3 << 16), ("ACC", 3 << 16), ("BRK_PNT", -5)):
        rig.send("SET_" + name, value)
    rig.board.run_until((rig.board.now // CYCLE + 1) * CYCLE)
    rig.send("SET_POS_BRK")
    rig.board.run_for(20 * CYCLE)
    assert rig.chip.telemetry()["target 1"] == 60


@settings(deadline=None, max_examples=60)
@given(actions, motors)
def test_no_output_changes_before_the_next_event(
    deeds: list[tuple[str, int]], motor: Callable[[], Plant] | None
) -> None:
    """What leases and interrupt-driven hosts rely on."""
    rig = Rig(motor)
    for deed in deeds:
        rig.do(deed)
    rig.board.catch_up()
    due = rig.chip.due(OUTPUT)
    assert due > rig.board.now
    levels = (rig.chip.pins["HostRdy"].value, rig.chip.pins["~HostIntrpt"].value)
    rig.board.run_until(min(due, rig.board.now + 50 * CYCLE) - 1)
    rig.board.catch_up()
    assert levels == (rig.chip.pins["HostRdy"].value, rig.chip.pins["~HostIntrpt"].value)
