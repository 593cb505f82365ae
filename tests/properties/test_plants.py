"""What every plant keeps, whatever drives it."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.chips.motion.quadrature import ALL_LOW, Quadrature
from vbus.core.signals import Plant
from vbus.core.state import load, save
from vbus.plant.dc_motor import DcMotor
from vbus.plant.ideal import IdealPlant
from vbus.plant.stepper import StepperMotor

Period = Callable[[Plant], int]

UNIT = st.one_of(st.just(0.0), st.just(1.0), st.floats(-1, 1))


def drives() -> st.SearchStrategy[Period]:
    return st.builds(
        lambda command, error: lambda plant: plant.drive(command, error),
        UNIT,
        st.integers(-60, 60),
    )


def pulses() -> st.SearchStrategy[Period]:
    steps = st.one_of(st.just(0), st.integers(-4, 4), st.integers(-20, 20))
    return steps.map(lambda number: lambda plant: plant.pulses(number))


def phases() -> st.SearchStrategy[Period]:
    three = st.tuples(UNIT, UNIT).map(lambda ab: (*ab, -(ab[0] + ab[1])))
    currents = st.one_of(st.tuples(UNIT, UNIT, st.just(0.0)), three)
    return currents.map(lambda abc: lambda plant: plant.phases(*abc))


def runs(period: st.SearchStrategy[Period]) -> st.SearchStrategy[list[Period]]:
    """Drives for some periods, each held for a while so that plants get somewhere."""
    held = st.tuples(period, st.integers(1, 12))
    return st.lists(held, max_size=4).map(
        lambda spans: [drive for drive, periods in spans for _ in range(periods)]
    )


def motor_settings(stops: bool) -> dict[str, float]:
    return {"stop_low": -150, "stop_high": 90, "load_torque": 0.001} if stops else {}


KINDS = {
    "dc motor": (lambda: DcMotor(), drives()),
    "dc motor between stops": (lambda: DcMotor(motor_settings(True)), drives()),
    "stepper by pulses": (lambda: StepperMotor(), pulses()),
    "stepper by phases": (lambda: StepperMotor(), phases()),
    "stepper between stops": (lambda: StepperMotor(motor_settings(True)), phases()),
    "ideal by error": (lambda: IdealPlant(), drives()),
    "ideal by pulses": (lambda: IdealPlant(), pulses()),
    "ideal by phases": (lambda: IdealPlant(), phases()),
}
EVERY = pytest.mark.parametrize("kind", KINDS)


@EVERY
@given(data=st.data(), period=st.sampled_from([67.84e-6, 256e-6, 520e-6]))
def test_a_saved_plant_goes_on_where_it_was(kind, data, period):
    make, drive = KINDS[kind]
    first = data.draw(runs(drive))
    second = data.draw(runs(drive))
    plant = make()
    plant.prepare(period)
    for run in first:
        run(plant)
    copy = make()
    load(copy, save(plant))
    assert save(copy) == save(plant)
    assert (copy.count, copy.resting()) == (plant.count, plant.resting())
    for run in second:
        assert run(copy) == run(plant) == plant.count
        assert save(copy) == save(plant)
        assert copy.count_at(0.3) == plant.count_at(0.3)


@EVERY
@given(data=st.data())
def test_a_plant_that_says_it_rests_does_not_change(kind, data):
    make, drive = KINDS[kind]
    plant = make()
    plant.prepare(256e-6)
    for run in data.draw(runs(drive)):
        run(plant)
        if plant.resting():
            before = save(plant)
            run(plant)
            assert plant.resting()
            assert save(plant) == before
            assert plant.count_at(0.0) == plant.count_at(0.5) == plant.count


@EVERY
@given(data=st.data())
def test_the_course_leads_from_count_to_count_and_every_count_on_it_is_reached(kind, data):
    make, drive = KINDS[kind]
    plant = make()
    plant.prepare(256e-6)
    for run in data.draw(runs(drive)):
        start = plant.count
        end = run(plant)
        assert plant.count_at(0.0) == start
        assert plant.count_at(1.0) == end == plant.count
        step = 1 if end > start else -1
        last = 0.0
        for count in range(start, end + step, step):
            fraction = plant.fraction_at(count)
            assert 0.0 <= last <= fraction <= 1.0
            assert (plant.count_at(fraction) - count) * step >= 0
            last = fraction


@EVERY
@given(data=st.data())
def test_between_end_stops_no_motor_leaves_them(kind, data):
    if "stops" not in kind:
        return
    make, drive = KINDS[kind]
    plant = make()
    plant.prepare(256e-6)
    for run in data.draw(runs(drive)):
        assert -150 <= run(plant) <= 90


@pytest.mark.spec("LM-POS-1", "MCP-ENC-1", "PMD-ENC-1")
@given(commands=st.lists(st.tuples(UNIT, st.integers(1, 30)), max_size=6))
def test_its_encoder_lines_decoded_give_the_same_counts_and_index(commands):
    plant = DcMotor({"index_offset": 40, "encoder_lines": 60})
    plant.prepare(256e-6)
    decoder = Quadrature(0, 0, together=True)
    decoder.preset(0, 0, 1)

    def take(now: int) -> int:
        found = 0
        while event := decoder.settle(now):
            found += event & ALL_LOW > 0
        return found

    now = 0
    for command in [command for command, periods in commands for _ in range(periods)]:
        start = plant.count
        end = plant.drive(command, 0)
        step = 1 if end > start else -1
        seen = 0
        for count in range(start + step, end + step, step) if end != start else ():
            edge = now + int(plant.fraction_at(count) * 256_000_000)
            seen += take(edge)
            decoder.edge(edge, *plant.encoder.levels(count))
        now += 256_000_000
        seen += take(now)
        assert decoder.count == end
        assert (seen > 0) is plant.index_between(start, end)[0]


@pytest.mark.parametrize(
    ("plant", "wrong"),
    [
        (DcMotor(), lambda plant: plant.pulses(1)),
        (DcMotor(), lambda plant: plant.phases(0.0, 1.0, 0.0)),
        (StepperMotor(), lambda plant: plant.drive(0.5, 1)),
    ],
)
def test_a_drive_a_plant_does_not_take_is_refused(plant, wrong):
    with pytest.raises(TypeError, match=r"takes \("):
        wrong(plant)
