"""Reset by pin, by command and at power-on (PMD-RST)."""

import pytest

from tests.conformance.mc1241a.conftest import BUSY, CLK, CYCLE, SLOT, Bench
from tests.probe import probe
from vbus.chips.mc1241a.datasheet import COMMANDS
from vbus.core.kernel import MS, NEVER, NS, US
from vbus.core.signals import STRICT, Observer, Plant, Policy, Z
from vbus.plant.stepper import StepperMotor

spec = pytest.mark.spec


def _disturb(bench: Bench) -> None:
    """Change everything a host can change."""
    for axis in (1, 2):
        bench.send(f"SET_{axis}")
        bench.load(
            pos=5000, vel=9 << 16, acc=1 << 16, max_acc=77, jerk=88, ratio=99, start_vel=100,
            buf_mtr_cmd=0x1234, brk_pnt=4242, intrpt_mask=0xFF, step_ratio=80, pos_err=1000,
        )  # fmt: skip
        bench.send("SET_PRFL_S_CRV")
        bench.send("UPDATE")
        bench.next_cycle(3)
        bench.send("SET_PRFL_VEL")
        bench.send("SET_ACTL_POS", 12345)
        bench.send("SET_POS_BRK")
        bench.send("SET_AUTO_UPDATE_OFF")
        bench.send("SET_AUTO_STOP_OFF")
        bench.send("SET_CAPT_HOME")
        bench.send("SET_PHASE_2")
        bench.send("MTR_OFF")
    bench.send("SET_OUTPUT_DAC16")
    bench.send("SET_LMT_SENSE", 0x000F)
    bench.send("LMTS_OFF")


def _expect_reset_state(bench: Bench) -> None:
    assert bench.level("~HostIntrpt") == 1
    # Before the first cycle looks at them.
    for number in ("time", "target 1", "velocity 1", "actual 1", "error 1", "phase A 1", "error 2"):
        assert bench.chip.telemetry()[number] == 0
    assert bench.send("GET_STATUS") == 0x0300  # so the current axis is 1
    for axis in (1, 2):
        bench.send(f"SET_{axis}")
        assert bench.send("GET_MODE") == 0x0080
        for name in (
            "POS", "VEL", "ACC", "MAX_ACC", "JERK", "RATIO", "START_VEL", "TRGT_POS", "TRGT_VEL",
            "BRK_PNT", "INTRPT_MASK", "ACTL_POS", "CAPT", "STEP_RATIO", "ACTL_POS_ERR",
            "MTR_CMD", "BUF_MTR_CMD", "PHASE_INFO",
        ):  # fmt: skip
            assert bench.send("GET_" + name) == 0, name
        assert bench.send("GET_POS_ERR") == 32767
        assert probe(bench.chip, axis).breakpoint_mode == 0
    assert bench.send("GET_OUTPUT_MODE") == 0
    assert bench.probe.limit_sense == 0
    assert bench.probe.limit_sensing


@spec("PMD-RST-1", "PMD-RST-2", "PMD-CMD-75")
def test_the_reset_command_restores_every_default(bench: Bench) -> None:
    _disturb(bench)
    bench.send("RESET")
    _expect_reset_state(bench)
    assert bench.send("GET_TIME") < 120


@spec("PMD-RST-1", "PMD-RST-2")
def test_the_reset_pin_restores_every_default(bench: Bench) -> None:
    _disturb(bench)
    bench.drive("~Reset", 0)
    bench.run_for(10 * US)
    bench.drive("~Reset", 1)
    bench.run_for(2 * MS)
    _expect_reset_state(bench)


@spec("PMD-RST-3", "PMD-T-13")
def test_words_after_reset(bench: Bench) -> None:
    bench.send("RESET")
    assert bench.send("GET_STATUS") == 0x0300
    assert bench.send("SET_2") == 0x1300
    assert bench.send("GET_MODE") == 0x0080
    assert bench.send("GET_POS_ERR") == 0x7FFF
    assert bench.send("GET_OUTPUT_MODE") == 0
    assert bench.send("GET_PHASE_INFO") & 0x0008 == 0


@spec("PMD-RST-1")
def test_ready_2_ms_after_the_reset_command(bench: Bench) -> None:
    bench.command(0x39)
    edge = bench.now if bench.way == "cycle" else bench.now - 30 * NS
    bench.run_until(edge + 2 * MS - 1)
    assert bench.level("HostRdy") == 0
    bench.run_until(edge + 2 * MS)
    assert bench.level("HostRdy") == 1


@spec("PMD-RST-1")
def test_ready_2_ms_after_the_reset_pin_rises(chip: Bench) -> None:
    chip.drive("~Reset", 0)
    chip.run_for(5 * MS)
    assert chip.level("HostRdy") == 0
    assert chip.chip.ready_at() == NEVER
    chip.drive("~Reset", 1)
    at = chip.now
    chip.run_until(at + 2 * MS - 1)
    assert chip.level("HostRdy") == 0
    chip.run_until(at + 2 * MS)
    assert chip.level("HostRdy") == 1


@spec("PMD-RST-1", "PMD-CYC-2")
def test_the_first_cycle_begins_with_the_first_clock_after_the_reset() -> None:
    bench = Bench(hz=6_700_000)
    bench.run_for(100 * NS)
    bench.drive("~Reset", 0)
    bench.run_for(2 * US)
    bench.drive("~Reset", 1)
    ready = bench.chip.ready_at()
    clock = bench.chip.clock.ps(bench.chip.clock.cycle_at(ready) + 1)
    for when, resting in ((ready - 1, False), (ready, False), (clock - 1, False), (clock, True)):
        bench.run_until(when)
        assert bench.chip.resting() is resting


@spec("PMD-RST-1")
def test_after_reset_there_is_no_checksum_to_read(bench: Bench) -> None:
    bench.send("RESET")
    assert bench.read_word() == 0


@spec("PMD-RST-1", "PMD-BUS-8")
def test_nothing_gets_through_during_reset(bench: Bench) -> None:
    bench.command(0x39)
    bench.run_for(MS)
    bench.byte_out(1, COMMANDS["SET_2"].code)
    assert bench.rules() == ["not-ready"]
    bench.wait_ready()
    assert bench.status() == 0x0300


@spec("PMD-RST-1", "PMD-BUS-8")
def test_the_byte_read_last_is_forgotten_by_a_reset(bench: Bench) -> None:
    bench.command(COMMANDS["GET_VRSN"].code)
    bench.wait_ready()
    assert bench.byte_in() == 0x4A
    bench.command(0x39)
    assert bench.byte_in() == 0x4A
    bench.run_for(MS)
    assert bench.byte_in() == 0


@spec("PMD-RST-1", "PMD-BUS-3")
def test_a_read_under_way_when_a_reset_comes_does_not_count() -> None:
    bench = Bench("strobe")
    bench.command(COMMANDS["GET_VRSN"].code)
    bench.wait_ready()
    for pin in ("HostCmd", "~HostSlct", "~HostRead", "~Reset"):
        bench.drive(pin, 0)
        bench.run_for(US)
    bench.run_for(10 * US)
    bench.drive("~Reset", 1)
    bench.run_for(3 * MS)
    for pin in ("~HostRead", "~HostSlct"):
        bench.drive(pin, 1)
        bench.run_for(US)
    bench.byte_in()
    assert bench.level("HostRdy") == 1
    bench.byte_in()
    assert bench.level("HostRdy") == 0


@spec("PMD-RST-2", "PMD-AMB-25", "PMD-CMD-77")
def test_time_starts_at_0_with_every_reset(chip: Bench) -> None:
    chip.next_cycle(1000)
    chip.run_for(13 * NS)  # the clock goes on at multiples of 40 ns
    chip.command(0x39)
    edge = chip.now
    chip.run_until(edge + 2 * MS)
    assert chip.seen_time() == 0
    first = -(-(edge + 2 * MS) // (40 * NS)) * 40 * NS + CYCLE
    chip.run_until(first - 1)
    assert chip.seen_time() == 0
    chip.run_until(first)
    assert chip.seen_time() == 1
    assert chip.send("GET_TIME") == 1


class Coasting(Plant):
    """Counts the periods it has had; moves one count in the middle of each while it is let."""

    TAKES = ("phases",)

    def __init__(self) -> None:
        super().__init__()
        self.driven: list[tuple[float, float, float]] = []
        self.until = 0

    def prepare(self, period: float) -> None:
        pass

    def phases(self, a: float, b: float, c: float) -> int:
        self.driven.append((a, b, c))
        self.before = self.count
        self.count += len(self.driven) <= self.until
        return self.count

    def count_at(self, fraction: float) -> int:
        return self.before if fraction < 0.5 else self.count


@spec("PMD-RST-1", "PMD-RST-2")
def test_a_motor_coasts_through_the_reset_and_its_place_is_then_0(chip: Bench) -> None:
    """28 whole slots of 67.84 us lie between the command's effect and the first slot."""
    motor = Coasting()
    chip.chip.connect(0, motor)
    chip.send("SET_PHASE_2")
    chip.send("SET_MTR_CMD", 32767)
    chip.next_cycle(10)
    chip.command(0x39)
    chip.run_for(BUSY)
    slots = len(motor.driven)
    assert motor.driven[-1] == (0.0, 1.0, 0.0)
    motor.until = slots + 28
    chip.wait_ready()
    chip.run_for(CLK)
    assert motor.driven[slots:] == [(0.0, 0.0, 0.0)] * 29
    chip.next_cycle(2)
    assert motor.count == 28
    assert chip.send("GET_ACTL_POS") == 0


@spec("PMD-RST-1", "PMD-TIM-5")
def test_host_rdy_falls_when_the_reset_pin_has_been_low_for_1_us(chip: Bench) -> None:
    edges: list[tuple[int, int]] = []

    class Ready(Observer):
        def edge(self, when: int, net: str, level: int) -> None:
            edges.append((when, level))

    chip.chip.pins["HostRdy"].net.observe(Ready())
    chip.kernel.run_until(7 * MS)
    chip.drive("~Reset", 0)
    chip.kernel.run_until(9 * MS)
    chip.drive("~Reset", 1)
    chip.kernel.run_until(20 * MS)
    assert edges == [(7 * MS + US, 0), (11 * MS, 1)]


@spec("PMD-RST-2", "PMD-UPD-1")
def test_an_update_that_was_asked_for_does_not_outlive_a_reset(chip: Bench) -> None:
    chip.next_cycle()
    for name in ("STOP", "UPDATE", "RESET"):
        chip.send(name)
    chip.send("UPDATE")
    chip.run_for(2 * CYCLE)
    assert chip.status() == 0x0300


@spec("PMD-RST-2", "PMD-BUS-3", "PMD-BUS-5")
def test_a_read_that_a_reset_cuts_short_moves_no_byte_pointer() -> None:
    chip = Bench("cycle")
    chip.chip.begin_read(0)
    chip.drive("~Reset", 0)
    chip.run_for(10 * US)
    chip.drive("~Reset", 1)
    chip.wait_ready()
    chip.chip.end_read()
    chip.byte_in()
    assert chip.chip.ready_at() < chip.now, "that was a high byte"
    chip.byte_in()
    assert chip.chip.ready_at() == chip.now + BUSY


@spec("PMD-RST-2", "PMD-LIM-2")
def test_reset_arms_the_limit_detector(chip: Bench) -> None:
    chip.drive("NegLimit1", 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    chip.send("RESET")
    assert chip.status() == 0x0300
    chip.run_for(2 * CYCLE)
    assert chip.status() == 0x0341


@spec("PMD-RST-2")
def test_reset_stops_a_move_and_takes_the_currents_away(chip: Bench) -> None:
    chip.send("SET_MTR_CMD", 0x7FFF)
    chip.load(buf_mtr_cmd=0x7FFF)
    chip.move(pos=100_000, vel=5 << 16, acc=1 << 16)
    chip.next_cycle(20)
    assert chip.seen("phase B") != 0
    chip.send("RESET")
    assert (chip.seen("phase A"), chip.seen("phase B")) == (0, 0)
    chip.next_cycle(20)
    assert chip.seen("target") == 0


@spec("PMD-RST-2")
def test_counts_made_during_reset_are_not_in_the_position(chip: Bench) -> None:
    chip.command(0x39)
    chip.run_for(MS)
    for a, b in ((1, 0), (1, 1), (0, 1)):
        chip.drive("QuadA1", a)
        chip.drive("QuadB1", b)
        chip.run_for(US)
    chip.wait_ready()
    chip.run_for(2 * CYCLE)
    assert chip.send("GET_ACTL_POS") == 0


@spec("PMD-RST-2")
@pytest.mark.parametrize("by_pin", [False, True])
def test_during_reset_a_motor_has_no_current_and_its_load_turns_it(by_pin: bool) -> None:
    bench = Bench()
    motor = StepperMotor({"load_torque": 0.2, "detent_torque": 0.0})
    bench.chip.connect(0, motor)
    bench.load(buf_mtr_cmd=0x7FFF)
    bench.send("SET_PHASE_2")
    bench.send("UPDATE")
    bench.next_cycle(400)
    held = motor.count
    if by_pin:
        bench.drive("~Reset", 0)
        bench.run_for(50 * MS)
        bench.drive("~Reset", 1)
        bench.run_for(2 * MS)
    else:
        bench.command(0x39)
        bench.run_for(2 * MS)
    start = motor.count_at(0.0)
    assert start < held - (100 if by_pin else 5)
    bench.run_for(CYCLE)
    assert bench.seen("actual") in range(motor.count - start, 1)


@spec("PMD-RST-4", "PMD-AMB-11")
def test_servo_rows_of_the_reset_table_have_no_command_here(chip: Bench) -> None:
    names = {row.name for row in COMMANDS}
    for absent in ("GET_KP", "GET_I_LM", "GET_SMPL_TIME", "SET_PHASE_OFFSET", "GET_PRESCALE"):
        assert absent not in names
    for axis in (1, 2):
        assert probe(chip.chip, axis).stepper.angle(1) == 0  # not FFFFH


def test_power_on_runs_the_reset_or_starts_after_it() -> None:
    bench = Bench()
    bench.chip.power_on(False)
    assert bench.chip.ready_at() == 2 * MS
    bench.run_until(2 * MS - 1)
    assert bench.level("HostRdy") == 0
    bench.run_until(2 * MS)
    assert bench.level("HostRdy") == 1
    started = Bench()
    assert started.chip.ready_at() == 0
    assert started.level("HostRdy") == 1


@spec("PMD-TIM-5")
@pytest.mark.parametrize(
    ("low", "strict", "found", "resets"),
    [
        (1000, False, [], True),
        (999, False, ["reset"], True),
        (999, True, ["reset"], False),
        (1000, True, [], True),
    ],
)
def test_reset_must_be_low_for_1_us(low: int, strict: bool, found: list[str], resets: bool) -> None:
    bench = Bench(policy=Policy(STRICT) if strict else None)
    bench.send("SET_POS_ERR", 5)
    bench.chip.timing_checked = True
    bench.drive("~Reset", 0)
    bench.run_for(low * NS)
    bench.drive("~Reset", 1)
    assert bench.rules() == found
    bench.run_for(2 * MS)
    assert bench.send("GET_POS_ERR") == (0x7FFF if resets else 5)


@spec("PMD-TIM-4")
@pytest.mark.parametrize(
    ("cold", "at", "found"),
    [(True, 250 * MS, []), (True, 250 * MS - 1, ["power"]), (False, 10 * MS, [])],
)
def test_reset_belongs_250_ms_after_power(cold: bool, at: int, found: list[str]) -> None:
    bench = Bench(cold_start=cold)
    bench.chip.timing_checked = True
    bench.run_until(at - 5 * US)
    bench.drive("~Reset", 0)
    bench.run_until(at)
    bench.drive("~Reset", Z)
    assert bench.rules() == found


@spec("PMD-RST-1", "PMD-BUS-7")
def test_slots_are_counted_from_the_end_of_the_last_reset() -> None:
    bench = Bench(host_busy="slot")
    bench.run_for(100 * US)
    bench.command(0x39)
    for _ in ("the command", "the reset"):
        bench.wait_ready()
    begin = bench.now
    bench.run_for(SLOT + US)
    bench.command(0x31)
    assert bench.chip.ready_at() == begin + 2 * SLOT
