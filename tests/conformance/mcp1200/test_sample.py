"""The sample timer, BUSY, the order of a sample, /SYNC (MCP-SMP)."""

import pytest

from tests.conformance.mcp1200.conftest import Bench, Edges, Rail
from vbus.board.board import Board
from vbus.chips.base import OUTPUT
from vbus.chips.mcp1200.chip import MCP1200
from vbus.core.kernel import NEVER, NS, US, Kernel
from vbus.core.signals import HIGH, LOW

MS = 1_000 * US


@pytest.mark.spec("MCP-SMP-1", "MCP-T-1", "MCP-T-2", "MCP-T-3", "MCP-T-4", "MCP-AMB-10")
@pytest.mark.parametrize(
    ("hz", "timer", "prescaler", "period"),
    [
        (8_000_000, 0x40, 0x003F, 520 * US), (20_000_000, 0x40, 0x003F, 208 * US),
        (2_000_000, 0x26, 0x003F, 1248 * US), (4_000_000, 0x26, 0x003F, 624 * US),
        (8_000_000, 0x26, 0x003F, 312 * US), (10_000_000, 0x26, 0x003F, 249_600 * NS),
        (16_000_000, 0x26, 0x003F, 156 * US), (20_000_000, 0x26, 0x003F, 124_800 * NS),
        (2_000_000, 0x3B, 0x0027, 1200 * US), (4_000_000, 0x3B, 0x0027, 600 * US),
        (8_000_000, 0x3B, 0x003F, 480 * US), (20_000_000, 0x3B, 0x8235, 100_002 * US),
        (8_000_000, 0x4F, 0xC34F, 500 * MS), (8_000_000, 0x26, 0x0039, 282_750 * NS),
    ],
)  # fmt: skip
def test_the_sample_period_is_pre_scalar_times_timer(
    hz: int, timer: int, prescaler: int, period: int
) -> None:
    bench = Bench(hz=hz)
    bench.put("SAMPLE_TIMER", timer)
    bench.put("PRESCALER", prescaler)
    bench.write(0x05, 0x03)
    edges = bench.watch("BUSY")
    bench.until(bench.sample_start())
    first = bench.kernel.now
    bench.until_ps(first + 2 * period)
    starts = [bench.clock.ps(cycle) for cycle in edges.of("BUSY", 1)]
    assert starts == [first, first + period, first + 2 * period]


@pytest.mark.spec("MCP-SMP-1", "MCP-REG-14")
def test_the_timer_runs_in_idle_too(bench: Bench) -> None:
    counts = []
    for _ in range(3):
        bench.until(bench.sample_start())
        counts.append(bench.probe.read_register(0x0F, bench.cycle))
        bench.wait(64)
        counts.append(bench.probe.read_register(0x0F, bench.cycle))
    assert counts == [0x40, 0x3F] * 3


def four(done: bool = True) -> tuple[Kernel, list[Bench]]:
    """Four chips on one kernel, their /SYNC pins on one net."""
    kernel = Kernel()
    chips = [Bench(kernel=kernel, name=name, done=done) for name in "abcd"]
    net = chips[0].chip.pins["/SYNC"].net
    for bench in chips[1:]:
        bench.chip.pins["/SYNC"].move(net)
    return kernel, chips


@pytest.mark.spec("MCP-SMP-2")
def test_four_chips_on_one_sync_net_start_their_samples_in_the_same_clock() -> None:
    kernel, chips = four()
    for number, bench in enumerate(chips):
        # Timers started apart: each chip has its own period before /SYNC.
        bench.put("SAMPLE_TIMER", 0x41 + number)
        bench.until(bench.sample_start() + 1 + number)
        bench.put("SAMPLE_TIMER", 0x40)
    watches = [bench.watch("BUSY") for bench in chips]
    host = chips[0].chip.pins["/SYNC"].net.solder("host:/SYNC")
    host.drive(LOW)
    kernel.settle()
    for bench in chips:
        bench.control()
        assert bench.probe.read_register(0x0F, bench.cycle) == 0
    assert kernel.now > 50 * US
    kernel.run_until(kernel.now + 2 * MS + 30 * NS)
    assert all(edges.seen == [] for edges in watches)
    released = kernel.now
    host.drive(HIGH)
    kernel.settle()
    kernel.run_until(released + 2 * MS)
    first = -(-released // (125 * NS)) + 4160
    for edges in watches:
        assert edges.of("BUSY", 1) == [first, first + 4160, first + 2 * 4160]


@pytest.mark.spec("MCP-SMP-2")
def test_four_axes_of_a_board_move_in_step_after_sync() -> None:
    """The nets of a board file; a host pulses /SYNC and starts the same move on four chips."""
    board = Board("four", "slaved")
    for name in "abcd":
        board.add_chip(MCP1200, name, "MCP-1200", 8_000_000)
    board.join("/SYNC", [f"{name}./SYNC" for name in "abcd"])
    board.power_on(True)
    port = board.open_port("host")
    watches = []
    for place, name in enumerate("abcd"):
        watches.append(Edges(8_000_000))
        board.watch(f"{name}.BUSY", watches[-1])
        port.select(1 << place)
        # Different phases before the pulse.
        port.write(0x0F, 0x30 + place)
        port.delay(700 * US)
        port.write(0x0F, 0x40)
    sync = port.pin_number("/SYNC")
    port.pin(sync, 0)
    for place in range(4):
        port.select(1 << place)
        for address, data in ((0x28, 10), (0x26, 0x80), (0x2A, 1), (0x29, 0), (0x00, 8), (0x05, 3)):
            port.write(address, data)
    port.pin(sync, 1)
    port.delay(30 * MS)
    port.sample()
    starts = [edges.of("BUSY", 1) for edges in watches]
    assert len(starts[0]) > 50
    assert starts[1:] == [starts[0]] * 3
    positions = []
    for place in range(4):
        port.select(1 << place)
        positions.append([port.read(address) for address in (0x0C, 0x0D, 0x0E)])
    assert positions == [[0, 1, 0]] * 4


@pytest.mark.spec("MCP-SMP-2")
def test_sync_is_ignored_outside_idle(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    start = bench.sample_start()
    bench.drive("/SYNC", LOW)
    bench.wait(100)
    bench.drive("/SYNC", HIGH)
    assert bench.sample_start() == start
    bench.until(start)
    assert bench.pin("BUSY") == 1


@pytest.mark.spec("MCP-SMP-2")
def test_after_sync_counting_starts_from_the_programmed_values(bench: Bench) -> None:
    bench.drive("/SYNC", LOW)
    bench.put("SAMPLE_TIMER", 0x09)
    bench.put("PRESCALER", 0x0063)
    bench.wait(10_000)
    assert bench.read(0x0F) == 0
    bench.wait(1)
    bench.drive("/SYNC", HIGH)
    assert bench.sample_start() == bench.cycle + 1000
    bench.wait(99)
    assert bench.probe.read_register(0x0F, bench.cycle) == 9
    bench.wait(1)
    assert bench.probe.read_register(0x0F, bench.cycle) == 8


@pytest.mark.spec("MCP-SMP-2")
def test_sync_that_is_low_when_idle_begins_holds_the_timer(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    bench.drive("/SYNC", LOW)
    bench.write(0x05, 0x01)
    bench.samples(1)
    assert bench.pin("IDLE") == 1
    for _ in range(4):
        bench.wait(2_500)
        assert bench.read(0x0F) == 0


WORK = [
    # registers, flag to set, step mode: clocks
    ({}, 0, 1000),
    ({"FEATURE": 0x08}, 0, 1300),
    ({"PROFILE_VELOCITY": 1, "ACCELERATION": 1, "FINAL_POSITION": 9000}, 0x08, 1900),
    ({"ACCELERATION": 1}, 0x0D, 1400),
    ({"FINAL_POSITION": 9000, "INTERPOLATOR_PRESET": 7}, 0x0B, 1300),
    ({"VELOCITY": 9, "INTERPOLATOR_PRESET": 7}, 0x0C, 1300),
    ({"BACKLASH": 1}, 0, 1100),
    ({"DEADBAND": 1}, 0, 1100),
    ({"CONFIG": 0x03}, 0, 1200),
    (
        {
            "FEATURE": 0x08, "BACKLASH": 1, "DEADBAND": 1, "PROFILE_VELOCITY": 1,
            "ACCELERATION": 1, "FINAL_POSITION": 9000,
        },
        0x08, 2400,
    ),
]  # fmt: skip


@pytest.mark.spec("MCP-SMP-3", "MCP-CFG-1")
@pytest.mark.parametrize(("registers", "flag", "clocks"), WORK)
def test_busy_lasts_as_long_as_the_work(registers: dict[str, int], flag: int, clocks: int) -> None:
    bench = Bench()
    bench.extended()
    for name, value in registers.items():
        bench.put(name, value)
    if flag:
        bench.write(0x00, flag)
    edges = bench.watch("BUSY")
    bench.control()
    start = bench.sample_start()
    bench.until(start + 2 * bench.period - 1)
    assert edges.seen == [
        (start, "BUSY", 1), (start + clocks, "BUSY", 0),
        (start + 4160, "BUSY", 1), (start + 4160 + clocks, "BUSY", 0),
    ]  # fmt: skip


@pytest.mark.spec("MCP-SMP-3", "MCP-STA-1")
def test_status_bit_0_is_the_busy_pin(bench: Bench) -> None:
    bench.control()
    start = bench.sample_start()
    bench.until(start + 500)
    assert (bench.read(0x07) & 1, bench.pin("BUSY")) == (1, 1)
    bench.until(start + 1000)
    assert (bench.read(0x07) & 1, bench.pin("BUSY")) == (0, 0)


@pytest.mark.spec("MCP-SMP-4")
@pytest.mark.parametrize(("timer", "error"), [(999, True), (1000, False)])
def test_a_period_shorter_than_the_work_ends_in_idle(timer: int, error: bool) -> None:
    bench = Bench()
    bench.put("SAMPLE_TIMER", 0)
    bench.put("PRESCALER", timer - 1)
    bench.until(bench.sample_start())
    bench.put("COMMAND_POSITION", 5)
    bench.control()
    start = bench.sample_start()
    bench.until(start + timer - 1)
    assert bench.seen("STATUS") & 0x08
    bench.until(start + timer)
    assert bool(bench.seen("STATUS") & 0x08) != error
    assert (bench.pin("IDLE"), bench.seen("MODE")) == ((1, 1) if error else (0, 3))
    if error:
        assert (bench.pin("BUSY"), bench.seen("PWM_COMMAND")) == (0, 0)
        bench.write(0x07, 0)
        assert bench.seen("STATUS") & 0x08
        bench.until(bench.sample_start() + 10 * timer)
        assert bench.pin("IDLE") == 1


@pytest.mark.spec("MCP-SMP-5")
def test_the_results_of_a_sample_appear_together_when_busy_ends() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    rail.speed = 100_000.0
    bench.write(0x02, 0x01)
    bench.put("MAX_ERROR", 5)
    bench.write(0x04, 0x09)
    bench.put("FINAL_POSITION", 1000)
    bench.put("PROFILE_VELOCITY", 10)
    bench.put("ACCELERATION", 0x0A00)
    bench.write(0x00, 0x08)
    bench.control()
    start = bench.sample_start()
    names = ("COMMAND_POSITION", "POSITION_ERROR", "ACTUAL_VELOCITY", "PHASE", "PWM_COMMAND",
             "MOTOR_COMMAND", "STATUS")  # fmt: skip
    bench.until(start)
    before = [bench.seen(name) for name in names]
    bench.until(start + 1899)
    assert [bench.seen(name) for name in names] == before
    bench.wait(1)
    after = [bench.seen(name) for name in names]
    assert after[0] == 10
    assert all(new != old for new, old in zip(after, before, strict=True))


@pytest.mark.spec("MCP-SMP-5")
def test_what_is_written_while_busy_counts_in_the_next_sample(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    start = bench.sample_start()
    bench.until(start + 100)
    bench.put("COMMAND_POSITION", 50)
    bench.until(start + 1500)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("POSITION_ERROR")) == (50, 0)
    bench.until(start + 4160 + 1500)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("POSITION_ERROR")) == (50, 50)


@pytest.mark.spec("MCP-SMP-6")
def test_actual_velocity_is_the_difference_of_two_positions() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    bench.control()
    bench.samples(1)
    for speed, velocity in ((100_000.0, 52), (-200_000.0, -104), (0.0, 0)):
        rail.speed = speed
        bench.samples(3)
        assert bench.seen("ACTUAL_VELOCITY") == velocity


@pytest.mark.spec("MCP-SMP-6")
@pytest.mark.parametrize(("step", "velocity"), [(40_000, 40_000 - 65_536), (-3, -3)])
def test_actual_velocity_has_16_bits(bench: Bench, step: int, velocity: int) -> None:
    bench.control()
    bench.samples(2)
    bench.probe.set_position(step, bench.cycle)
    bench.samples(1)
    assert bench.seen("ACTUAL_VELOCITY") == velocity


# -- looking ahead --------------------------------------------------------------------------------


@pytest.mark.spec("MCP-SMP-1", "MCP-REG-14", "MCP-REG-15", "MCP-BUS-5")
@pytest.mark.parametrize(
    ("address", "clocks"),
    [(0x0E, 4160), (0x0F, 1), (0x10, 1), (0x11, 1), (0x12, 4160), (0x2F, 4160), (0x4F, 1)],
)
def test_a_byte_on_its_way_to_the_sample_period_may_make_it_a_single_clock(
    bench: Bench, address: int, clocks: int
) -> None:
    assert bench.chip.step_ps() == NEVER
    bench.chip.write(address, {0x0F: 0x40, 0x4F: 0x40, 0x11: 0x3F}.get(address, 0))
    assert bench.chip.step_ps() == bench.clock.span(clocks)
    bench.wait(4)
    assert bench.chip.step_ps() == NEVER


@pytest.mark.spec("MCP-SMP-5")
def test_the_next_event_is_never_later_than_the_next_change_of_an_output() -> None:
    bench = Bench(plant=Rail())
    assert bench.chip.due(OUTPUT) == NEVER
    bench.control()
    start = bench.sample_start()
    assert bench.chip.due(OUTPUT) <= bench.clock.ps(start)
    bench.until(start)
    assert bench.chip.due(OUTPUT) <= bench.clock.ps(start + 1000)
    for _ in range(50):
        due = bench.chip.due(OUTPUT)
        assert due > bench.kernel.now
        before = {name: pin.value for name, pin in bench.chip.pins.items()}
        bench.until_ps(due - 1)
        assert {name: pin.value for name, pin in bench.chip.pins.items()} == before
        bench.until_ps(due)


@pytest.mark.spec("MCP-SMP-1")
def test_an_idle_chip_skips_an_hour_and_keeps_its_phase() -> None:
    bench = Bench(plant=Rail())
    bench.until_ps(3600 * 1_000_000 * US + 77 * US)
    assert bench.sample_start() == (bench.cycle // 4160 + 1) * 4160


class Lengths(Rail):
    """Notes how long its periods are (clocks at 8 MHz)."""

    def __init__(self) -> None:
        super().__init__()
        self.clocks: list[int] = []

    def drive(self, command: float, error: int) -> int:
        self.clocks.append(round(self._period * 8_000_000))
        return super().drive(command, error)


@pytest.mark.spec("MCP-SMP-3", "MCP-SMP-5")
def test_the_drive_changes_with_results_though_those_before_came_at_the_samples_start() -> None:
    plant = Lengths()
    bench = Bench(plant=plant)
    bench.extended()
    bench.put("DEADBAND", 1)
    bench.put("PRESCALER", 9)
    bench.put("SAMPLE_TIMER", 109)
    bench.control()
    # With a deadband the work takes 1100 clocks: results appear as the next sample starts.
    bench.until(bench.sample_start() + 5)
    bench.samples(3)
    bench.put("DEADBAND", 0)
    start = bench.sample_start()
    plant.clocks.clear()
    bench.until(start + 2 * 1100 - 1)
    assert plant.clocks == [1000, 100, 1000, 100]
