"""Encoder inputs that are driven as pins: filter, decoder, swap (MCP-ENC)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mcp1200.conftest import Bench, Follower, Rail
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.plant.ideal import IdealPlant
from vbus.plant.stepper import StepperMotor

UP = ((0, 1), (0, 0), (1, 0), (1, 1))
"""Levels of A and B from the resting state 11, A before B."""


def turn(bench: Bench, states: int, dwell: int = 10, backwards: bool = False) -> None:
    """Move the encoder by some states, ``dwell`` clocks each; from and to A = B = 1."""
    order = UP[2::-1] + UP[3:] if backwards else UP
    for state in range(states):
        a, b = order[state % 4]
        bench.drive("CHA", a)
        bench.drive("CHB", b)
        bench.wait(dwell)


@pytest.mark.spec("MCP-ENC-1")
@pytest.mark.parametrize(("swap", "sign"), [(0x00, 1), (0x80, -1)])
def test_a_before_b_counts_up_unless_swapped(bench: Bench, swap: int, sign: int) -> None:
    bench.write(0x1A, swap)
    turn(bench, 12)
    assert bench.get("ACTUAL_POSITION") == 12 * sign
    turn(bench, 8, backwards=True)
    assert bench.get("ACTUAL_POSITION") == 4 * sign


@pytest.mark.spec("MCP-ENC-1", "MCP-REG-20")
@pytest.mark.parametrize(
    ("code", "divider"), [(0, 1), (1, 2), (2, 4), (3, 8), (4, 16), (5, 32), (6, 32), (7, 32)]
)
def test_a_level_counts_after_three_filter_clocks(code: int, divider: int) -> None:
    bench = Bench()
    bench.write(0x1A, code << 4)
    bench.until(1000)
    bench.drive("CHA", 0)
    bench.until(1000 + 3 * divider - 1)
    assert bench.position == 0
    bench.until(1000 + 3 * divider)
    assert bench.position == 1
    bench.until(2000)
    bench.drive("CHB", 0)
    bench.until(2000 + 3 * divider - 1)
    bench.drive("CHB", 1)
    bench.until(3000)
    assert bench.position == 1


@pytest.mark.spec("MCP-ENC-1", "MCP-CAP-3")
@pytest.mark.parametrize(("rising", "first"), [(0x00, 0), (0x20, 1)])
def test_the_index_pin_passes_the_same_filter(rising: int, first: int) -> None:
    bench = Bench()
    bench.write(0x03, 0x10 | rising)
    turn(bench, 8)
    bench.until(500)
    bench.drive("INDEX", 0)
    if first:
        bench.wait(100)
        assert bench.seen("CAPTURE_CONTROL") == 0x10 | rising
        bench.until(700)
        bench.drive("INDEX", 1)
    edge = bench.cycle
    bench.until(edge + 2)
    assert bench.seen("CAPTURE_CONTROL") == 0x10 | rising
    bench.until(edge + 3)
    assert bench.seen("CAPTURE_CONTROL") == 0x18 | rising
    assert bench.seen("CAPTURE") == 8
    bench.write(0x03, 0x10 | rising)
    bench.drive("INDEX", first)
    bench.drive("INDEX", 1 - first)
    bench.wait(2)
    bench.drive("INDEX", first)
    bench.wait(100)
    assert bench.seen("CAPTURE_CONTROL") == 0x10 | rising


@pytest.mark.spec("MCP-ENC-1", "MCP-REG-20")
def test_swapped_channels_turn_a_plant_round() -> None:
    follower = Follower()
    bench = Bench(plant=follower)
    bench.write(0x1A, 0x80)
    bench.put("COMMAND_POSITION", 100)
    bench.control()
    bench.samples(2)
    assert (bench.position, follower.count) == (100, -100)


@pytest.mark.spec("MCP-ENC-1")
def test_a_and_b_together_count_nothing_and_are_reported(chip: Bench) -> None:
    chip.drive("CHA", 0)
    chip.wait(20)
    assert chip.position == 1
    chip.drive("CHA", 1)
    chip.drive("CHB", 0)
    chip.wait(20)
    assert (chip.position, chip.rules()) == (1, ["double-edge"])


@pytest.mark.spec("MCP-ENC-1", "MCP-BRK-1")
def test_a_breakpoint_is_reached_by_driven_counts(chip: Bench) -> None:
    chip.write(0x02, 0x10)
    chip.put("BREAKPOINT", 6)
    chip.samples(2)
    turn(chip, 5)
    assert chip.pin("TRIG") == 1
    turn(chip, 8)
    assert chip.pin("TRIG") == 0


@pytest.mark.spec("MCP-ENC-1")
def test_the_counter_wraps_with_driven_counts(chip: Bench) -> None:
    chip.write(0x15, 0x7F, 0xFF, 0xFE)
    turn(chip, 4)
    assert chip.position == -0x7FFFFE


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(3, 9)), max_size=40))
@pytest.mark.spec("MCP-ENC-1")
def test_any_walk_that_passes_the_filter_is_counted(walk: list[tuple[bool, int]]) -> None:
    bench = Bench()
    place = 0
    for up, dwell in walk:
        place += 1 if up else -1
        a, b = UP[(place - 1) % 4]
        bench.drive("CHA", a)
        bench.drive("CHB", b)
        bench.wait(dwell)
    bench.wait(3)
    assert bench.position == place


@pytest.mark.spec("MCP-BRK-1")
def test_an_edge_of_the_very_cycle_in_which_a_setting_changes_is_still_to_come() -> None:
    encoder = EncoderCourse(8_000_000)
    encoder.connect(IdealPlant(), limits=False, home=False)
    encoder.end = 0
    encoder.run(512, 0.0, encoder.error(100), stepping=False, steps=0)
    for _ in range(2):
        encoder.plan(armed=True, compare=50)
        assert (encoder.at, encoder.at_count) == (254, 50)
        encoder.look_from(254)
        assert encoder.seen == 49


@pytest.mark.spec("MCP-STP-1")
def test_a_plant_for_steps_stands_while_the_chip_gives_a_motor_command() -> None:
    encoder = EncoderCourse(8_000_000)
    motor = StepperMotor()
    encoder.connect(motor, limits=False, home=False)
    encoder.end = 0
    for period in range(1, 100):
        encoder.run(80_000 * period, 1.0, encoder.error(100), stepping=False, steps=0)
    assert motor.count == 0


@pytest.mark.spec("MCP-ENC-1")
def test_the_position_moves_within_each_clock_of_a_period() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    rail.speed = 16_000_000.0
    start = bench.sample_start()
    places = []
    for cycle in range(4):
        bench.until(start + cycle)
        places.append(bench.position)
    assert [place - places[0] for place in places] == [0, 2, 4, 6]


@pytest.mark.spec("MCP-TIM-7", "MCP-TIM-8")
def test_the_levels_at_power_on_have_stood_for_ever() -> None:
    bench = Bench()
    bench.chip.timing_checked = True
    bench.wait(1)
    bench.drive("CHA", 0)
    assert bench.violations == []


def test_a_plant_is_prepared_for_no_period_of_length_0() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    bench.samples(1)
    period = rail._period
    bench.probe.encoder_prepared = 0
    assert rail._period == period > 0
