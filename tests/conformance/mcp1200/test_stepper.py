"""Step mode: pulses, direction, position, stall check (MCP-STP)."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mcp1200.conftest import Bench, Rail
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.core.signals import Plant
from vbus.plant.stepper import StepperMotor

PERIOD = 4160
WORK = 1200


def stepper(plant: Plant | None = None, config: int = 0x03, **registers: int) -> Bench:
    bench = Bench(plant=plant)
    bench.write(0x02, config)
    for name, value in registers.items():
        bench.put(name, value)
    bench.control()
    bench.samples(1)
    return bench


def batch(bench: Bench, command: int) -> tuple[int, list[tuple[int, str, int]]]:
    """Command a position; return when its results appear, and the edges of one period."""
    bench.put("COMMAND_POSITION", command & 0xFFFFFF)
    edges = bench.watch("PULSE", "SIGN")
    out = bench.sample_start() + WORK
    bench.until(out + PERIOD - 1)
    bench.chip.pins["PULSE"].net.unobserve(edges)
    bench.chip.pins["SIGN"].net.unobserve(edges)
    return out, edges.seen


@pytest.mark.spec("MCP-STP-1", "MCP-STP-2", "MCP-REG-21", "MCP-REG-3")
def test_four_steps_spread_evenly_over_a_sample() -> None:
    bench = stepper()
    out, edges = batch(bench, 4)
    assert edges == [
        edge
        for j in range(4)
        for edge in ((out + 1040 * j, "PULSE", 1), (out + 1040 * j + 16, "PULSE", 0))
    ]
    assert bench.position == 4
    assert bench.get("ACTUAL_POSITION") == 4


@pytest.mark.spec("MCP-STP-2", "MCP-T-17", "MCP-AMB-19")
@pytest.mark.parametrize(
    ("hz", "width", "picoseconds"),
    [(8_000_000, 15, 2_000_000), (20_000_000, 150, 7_550_000), (8_000_000, 0, 125_000)],
)
def test_the_width_of_a_step_pulse(hz: int, width: int, picoseconds: int) -> None:
    bench = Bench(hz=hz)
    bench.write(0x02, 0x03)
    bench.put("STEP_WIDTH", width)
    bench.put("COMMAND_POSITION", 1)
    bench.control()
    edges = bench.watch("PULSE")
    bench.samples(2)
    rise, fall = edges.of("PULSE", 1)[0], edges.of("PULSE", 0)[0]
    assert bench.clock.ps(fall) - bench.clock.ps(rise) == picoseconds


@pytest.mark.spec("MCP-STP-2")
def test_a_pulse_that_outlasts_its_sample_keeps_its_width() -> None:
    bench = stepper(STEP_WIDTH=255)
    out, edges = batch(bench, 20)
    assert edges == [(out, "PULSE", 1)]
    edges_after = bench.watch("PULSE")
    bench.until(out + PERIOD + 300)
    # Step 19 began 208 clocks before the end of the period.
    assert edges_after.seen == [(out + 19 * 208 + 256, "PULSE", 0)]


@pytest.mark.spec("MCP-STP-2")
def test_low_pulses() -> None:
    bench = stepper(config=0x07)
    assert bench.pin("PULSE") == 1
    out, edges = batch(bench, 1)
    assert edges == [(out, "PULSE", 0), (out + 16, "PULSE", 1)]


@pytest.mark.spec("MCP-STP-2", "MCP-T-17")
def test_a_change_of_direction_comes_1080_clocks_before_the_first_step() -> None:
    bench = stepper()
    batch(bench, 4)
    out, edges = batch(bench, 0)
    assert edges[0] == (out, "SIGN", 1)
    rises = [cycle for cycle, name, level in edges if (name, level) == ("PULSE", 1)]
    assert rises == [out + 1080 + 770 * j for j in range(4)]
    assert bench.position == 0
    out, edges = batch(bench, -2)
    assert edges[0] == (out, "PULSE", 1)
    out, edges = batch(bench, 0)
    assert edges[:2] == [(out, "SIGN", 0), (out + 1080, "PULSE", 1)]
    # 54 us at 20 MHz.
    assert 1080 * 50 == 54_000


@pytest.mark.spec("MCP-STP-1")
def test_the_position_counts_each_step_when_it_starts() -> None:
    bench = stepper()
    bench.put("COMMAND_POSITION", 4)
    out = bench.sample_start() + WORK
    for j in range(4):
        bench.until(out + 1040 * j - 1)
        assert bench.position == j
        bench.until(out + 1040 * j)
        assert bench.position == j + 1


@pytest.mark.spec("MCP-STP-1", "MCP-REG-3")
def test_the_position_stays_when_its_source_changes() -> None:
    rail = Rail()
    rail.speed = 50_000.0
    bench = Bench(plant=rail)
    bench.samples(20)
    rail.speed = 0.0
    bench.samples(2)
    here = bench.position
    assert here > 10
    for config in (0x03, 0x01, 0x03):
        bench.write(0x02, config)
        bench.samples(2)
        assert bench.position == here


@pytest.mark.spec("MCP-STP-1")
def test_the_encoder_does_not_count_and_the_filter_does_not_drive() -> None:
    rail = Rail()
    rail.speed = 50_000.0
    bench = stepper(rail)
    bench.put("COMMAND_POSITION", 10)
    bench.samples(4)
    assert (bench.position, bench.seen("ACTUAL_VELOCITY")) == (10, 0)
    assert (bench.seen("PWM_COMMAND"), bench.pin("MC0-MC11")) == (0, 0x800)
    assert rail.steps == 10


@pytest.mark.spec("MCP-STP-1", "MCP-T-19")
@pytest.mark.parametrize("final", [100, -100])
def test_profiles_make_steps(final: int) -> None:
    rail = Rail()
    bench = stepper(rail, PROFILE_VELOCITY=10, ACCELERATION=0x180,
                    FINAL_POSITION=final & 0xFFFFFF)  # fmt: skip
    bench.write(0x00, 0x08)
    bench.samples(20)
    assert (bench.position, rail.steps, bench.seen("FLAG")) == (final, final, 0)


@pytest.mark.spec("MCP-STP-1", "MCP-T-19")
def test_the_slowest_step_rate_takes_minutes() -> None:
    bench = Bench(hz=20_000_000)
    bench.write(0x02, 0x03)
    bench.put("SAMPLE_TIMER", 0xFF)
    bench.put("PRESCALER", 0xFFFF)
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", 1)
    bench.put("ACCELERATION", 1)
    bench.write(0x00, 0x0D)
    bench.control()
    bench.until(bench.sample_start())
    period = 65_536 * 256
    assert bench.period == period
    seconds = period * 256 / 20e6
    assert round(seconds, 1) == 214.7
    edges = bench.watch("PULSE")
    bench.until(bench.cycle + 520 * period)
    rises = edges.of("PULSE", 1)
    assert [b - a for a, b in itertools.pairwise(rises)] == [256 * period]


@pytest.mark.spec("MCP-STP-3")
@pytest.mark.parametrize(("steps", "told"), [(260, False), (261, True), (400, True)])
def test_steps_that_do_not_fit_are_reported_and_counted(steps: int, told: bool) -> None:
    rail = Rail()
    bench = stepper(rail)
    batch(bench, steps)
    assert bench.rules() == (["step-overrun"] if told else [])
    bench.samples(1)
    assert (bench.position, rail.steps) == (steps, steps)


@pytest.mark.spec("MCP-STP-1")
def test_an_abrupt_stop_takes_back_the_steps_not_yet_sent() -> None:
    rail = Rail()
    bench = stepper(rail)
    bench.write(0x04, 0x0C)
    bench.put("COMMAND_POSITION", 40)
    bench.until(bench.sample_start() + WORK + 10 * 104)
    bench.drive("/STOP", 0)
    bench.samples(3)
    # 40 steps a sample, 104 clocks apart: 29 have started when the next sample does.
    assert (bench.position, rail.steps, bench.seen("COMMAND_POSITION")) == (29, 29, 29)


@pytest.mark.spec("MCP-STP-1")
@pytest.mark.parametrize("speed", [40, -40])
def test_steps_cut_off_by_a_shorter_sample_are_sent_with_the_next(speed: int) -> None:
    """Leaving velocity mode ends BUSY 400 clocks sooner: three steps of 104 clocks."""
    rail = Rail()
    bench = stepper(rail, VELOCITY_COMMAND=speed & 0xFF, ACCELERATION=0x7F00)
    bench.write(0x00, 0x0D)
    bench.samples(4)
    bench.write(0x00, 0x05)
    out = bench.sample_start() + WORK
    bench.until(out - 1)
    command = bench.seen("COMMAND_POSITION")
    assert abs(bench.position - command) == 3
    bench.samples(2)
    assert bench.position == rail.steps == command


@pytest.mark.spec("MCP-STP-1")
def test_a_breakpoint_stands_at_a_step() -> None:
    bench = stepper(config=0x13, BREAKPOINT=3)
    bench.samples(1)
    bench.put("COMMAND_POSITION", 4)
    out = bench.sample_start() + WORK
    bench.until(out + 2079)
    assert bench.pin("TRIG") == 1
    bench.until(out + 2080)
    assert (bench.pin("TRIG"), bench.position) == (0, 3)


@pytest.mark.spec("MCP-BRK-1", "MCP-STP-2")
@pytest.mark.parametrize(("breakpoint", "steps", "first"), [(1, 4, 1), (2, 10_000, 3)])
def test_a_breakpoint_at_a_step_that_begins_with_the_results(
    breakpoint: int, steps: int, first: int
) -> None:
    bench = stepper(config=0x13, BREAKPOINT=breakpoint)
    bench.samples(1)
    bench.put("COMMAND_POSITION", steps)
    out = bench.sample_start() + WORK
    bench.until(out - 1)
    assert (bench.pin("TRIG"), bench.position) == (1, 0)
    bench.until(out)
    assert (bench.pin("TRIG"), bench.position) == (0, first)


@pytest.mark.spec("MCP-STP-1", "MCP-ERR-1")
def test_backlash_gives_no_steps() -> None:
    bench = stepper(config=0x03, BACKLASH=10)
    places = []
    for command in (0, 5, 2):
        bench.put("COMMAND_POSITION", command)
        bench.samples(3)
        places.append(bench.position)
    assert places == [0, 5, 2]
    assert bench.seen("POSITION_ERROR") == -10


@pytest.mark.spec("MCP-STP-1", "MCP-REG-3")
def test_the_way_of_the_encoder_in_step_mode_does_not_count_afterwards_either() -> None:
    rail = Rail()
    rail.speed = 50_000.0
    bench = stepper(rail)
    bench.put("COMMAND_POSITION", 10)
    bench.samples(4)
    rail.speed = 0.0
    bench.samples(2)
    bench.write(0x02, 0x01)
    bench.samples(2)
    assert bench.position == 10


@pytest.mark.spec("MCP-STP-1")
def test_switching_step_mode_keeps_the_counter() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    rail.speed = 100_000.0
    bench.samples(3)
    rail.speed = 0.0
    bench.samples(2)
    here = bench.position
    assert here > 100
    bench.write(0x02, 0x03)
    assert bench.position == here
    bench.write(0x02, 0x01)
    assert bench.position == here


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(-120, 120), min_size=1, max_size=8), st.integers(0, 3))
@pytest.mark.spec("MCP-STP-1", "MCP-STP-3")
def test_every_step_is_sent_and_counted(changes: list[int], backlash: int) -> None:
    rail = Rail()
    bench = stepper(rail)
    edges = bench.watch("PULSE")
    goal = 0
    for change in changes:
        goal += change
        bench.put("COMMAND_POSITION", goal & 0xFFFFFF)
        bench.samples(1 + backlash % 2)
    bench.samples(2)
    assert (bench.position, rail.steps) == (goal, goal)
    if max(abs(change) for change in changes) < 100:
        assert len(edges.of("PULSE", 1)) == sum(abs(change) for change in changes)


@pytest.mark.spec("MCP-STP-1", "MCP-POS-2")
@pytest.mark.parametrize("position", [0x5A5A5A, -0x5A5A5A])
def test_steps_are_counted_in_24_bits(position: int) -> None:
    bench = stepper()
    bench.probe.set_position(position, bench.cycle)
    assert bench.position == position


# -- stall check ----------------------------------------------------------------------------------


@pytest.mark.spec("MCP-T-18", "MCP-REG-22")
@pytest.mark.parametrize(("ratio", "msb", "fraction"), [(512 / 800, 0, 164), (2000 / 200, 10, 0)])
def test_ratio_registers(bench: Bench, ratio: float, msb: int, fraction: int) -> None:
    assert round(ratio * 256) == msb << 8 | fraction
    bench.write(0x1C, msb, fraction)
    assert bench.seen("ENCODER_RATIO") == round(ratio * 256)


class Slipping(Rail):
    """Turns by ``per_step`` counts for each step."""

    per_step = 1.0

    def pulses(self, steps: int) -> int:
        self.steps += steps
        self._start = self._place
        self._travel = steps * self.per_step
        self._place += self._travel
        self.count = round(self._place // 1)
        return self.count

    def resting(self) -> bool:
        return False


def run_at(bench: Bench, speed: int, samples: int) -> None:
    bench.put("VELOCITY_COMMAND", speed & 0xFF)
    bench.put("ACCELERATION", 0x7F00)
    bench.write(0x00, 0x0D)
    bench.samples(samples)


@pytest.mark.spec("MCP-STP-4", "MCP-AMB-6", "MCP-AMB-7")
@pytest.mark.parametrize("speed", [8, -8])
@pytest.mark.parametrize(
    ("per_step", "fraction", "stalled"),
    [(10.0, 0, False), (2.0, 0, False), (2.0, 1, True), (1.5, 0, True)],
)
def test_too_few_encoder_counts_are_a_stall(
    per_step: float, fraction: int, stalled: bool, speed: int
) -> None:
    plant = Slipping()
    plant.per_step = per_step
    bench = stepper(plant, EXCEPTION=0x00)
    run_at(bench, speed, 3)
    bench.write(0x1C, 2, fraction)
    bench.samples(8)
    assert bool(bench.seen("STATUS") & 0x10) != stalled
    bench.write(0x07, 0)
    bench.samples(6)
    assert bool(bench.seen("STATUS") & 0x10) != stalled


@pytest.mark.spec("MCP-STP-4")
def test_a_window_holds_four_samples_and_one_expected_count() -> None:
    plant = Slipping()
    plant.per_step = 0.0
    bench = stepper(plant, EXCEPTION=0x00, ENCODER_RATIO=0x0100)
    bench.put("VELOCITY_COMMAND", 5)
    bench.put("ACCELERATION", 0x7F00)
    bench.write(0x00, 0x0D)
    # The counting of windows began with the first control sample, one sample ago.
    bench.samples(2)
    assert bench.seen("STATUS") & 0x10
    bench.samples(1)
    assert not bench.seen("STATUS") & 0x10


@pytest.mark.spec("MCP-STP-4")
def test_a_slow_motor_is_judged_over_as_many_samples_as_it_needs() -> None:
    plant = Slipping()
    plant.per_step = 0.0
    bench = stepper(plant, EXCEPTION=0x00, ENCODER_RATIO=0x0010)
    bench.put("ACCELERATION", 0x7F00)
    bench.put("VELOCITY_COMMAND", 1)
    bench.write(0x00, 0x0D)
    # 16/256 expected counts a step: sixteen steps until there is something to expect.
    bench.samples(16)
    assert bench.seen("STATUS") & 0x10
    bench.samples(2)
    assert not bench.seen("STATUS") & 0x10


@pytest.mark.spec("MCP-MOD-2", "MCP-STP-4")
def test_idle_begins_a_new_window() -> None:
    plant = Slipping()
    plant.per_step = 0.0
    bench = stepper(plant, EXCEPTION=0x00)
    run_at(bench, 5, 2)
    bench.write(0x1C, 1, 0)
    bench.samples(2)
    bench.write(0x05, 0x01)
    bench.samples(2)
    bench.control()
    bench.samples(3)
    assert bench.seen("STATUS") & 0x10
    bench.samples(2)
    assert not bench.seen("STATUS") & 0x10


@pytest.mark.spec("MCP-STP-4", "MCP-EXC-1")
def test_a_stall_takes_the_maximum_error_action() -> None:
    plant = Slipping()
    plant.per_step = 0.0
    bench = stepper(plant, EXCEPTION=0x40, ENCODER_RATIO=0x0100)
    run_at(bench, 5, 8)
    assert bench.pin("IDLE") == 1


@pytest.mark.spec("MCP-STP-4")
@pytest.mark.parametrize("turns", [True, False])
def test_an_encoder_at_the_pins_counts_wherever_the_motor_stands(turns: bool) -> None:
    plant = Slipping()
    plant.per_step = 0.0
    plant.count = 255
    plant._place = 255.0
    bench = stepper(plant, EXCEPTION=0x00, ENCODER_RATIO=0x0100)
    run_at(bench, 1, 1)
    for _ in range(10):
        for pin, level in (("CHA", 0), ("CHB", 0), ("CHA", 1), ("CHB", 1)):
            if turns:
                bench.drive(pin, level)
            bench.wait(8)
        bench.samples(1)
    assert bool(bench.seen("STATUS") & 0x10) == turns


@pytest.mark.spec("MCP-STP-4")
def test_ratio_zero_is_no_check_and_standing_is_no_stall() -> None:
    plant = Slipping()
    plant.per_step = 0.0
    bench = stepper(plant, EXCEPTION=0x40)
    run_at(bench, 5, 12)
    assert bench.seen("STATUS") & 0x10
    bench = stepper(Slipping(), EXCEPTION=0x40, ENCODER_RATIO=0x0100)
    bench.samples(30)
    assert bench.seen("STATUS") & 0x10


@pytest.mark.spec("MCP-STP-4", "MCP-STP-1")
@pytest.mark.parametrize(("friction", "stalled"), [(0.005, False), (0.6, True)])
def test_a_stepper_motor_under_load(friction: float, stalled: bool) -> None:
    """200 full steps, 500 lines: ten counts a step, the manual's first example."""
    motor = StepperMotor({
        "coulomb_friction": friction, "static_friction": friction, "steps_per_rev": 200,
        "encoder_lines": 500,
    })  # fmt: skip
    bench = stepper(motor, EXCEPTION=0x00, ENCODER_RATIO=0x0200, PRESCALER=0x0FFF)
    bench.put("FINAL_POSITION", 60)
    bench.put("PROFILE_VELOCITY", 4)
    bench.put("ACCELERATION", 0x0080)
    bench.write(0x00, 0x08)
    bench.samples(60)
    assert bench.position == 60
    assert bool(bench.seen("STATUS") & 0x10) != stalled
    if not stalled:
        assert motor.count == pytest.approx(600, abs=10)


def test_a_servo_plant_is_refused_only_if_it_takes_neither_drive() -> None:
    class Phased(Rail):
        TAKES = ("phases",)

    with pytest.raises(ValueError, match="servo commands or step pulses; this plant takes phase"):
        Bench(plant=Phased())
    with pytest.raises(ValueError, match="the MCP-1200 has no axis 2; it has 1"):
        Bench().chip.connect(1, Rail())


@pytest.mark.spec("MCP-STP-1")
@given(st.integers(1, 300), st.integers(1, 200), st.integers(1, 600), st.integers(0, 200))
def test_steps_of_a_batch_start_evenly_up_to_its_last_clock(
    steps: int, period: int, again: int, cycle: int
) -> None:
    sent = Stepper(RegisterFile())
    sent.batch(1000, steps, period)
    starts = [1000 + step * period // steps for step in range(steps)]
    for now in (1000 + cycle, 1000 + again):
        assert sent.emitted(now) == sum(start <= now for start in starts)
    sent.stop(1000 + cycle)
    assert sent.emitted(1000 + cycle + period) == sum(start <= 1000 + cycle for start in starts)
