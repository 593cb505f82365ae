"""Microstep waveforms, PWM and DAC outputs and their pins (PMD-USTP, PMD-TIM-21)."""

from math import pi, sin

import pytest

from tests.conformance.mc1241a.conftest import CLK, CYCLE, SLOT, Bench
from vbus.chips.mc1241a.datasheet import AC
from vbus.chips.mc1241a.microstep import (
    PHASE_A,
    PHASE_B,
    dac_word,
    pwm_magnitude,
    scaled,
)
from vbus.core.kernel import MS, NEVER, NS, US
from vbus.core.signals import Observer, Plant

spec = pytest.mark.spec


class Edges(Observer):
    """Notes every edge of some pins."""

    def __init__(self, bench: Bench, *pins: str) -> None:
        self.seen: list[tuple[int, str, int]] = []
        for pin in pins:
            bench.chip.pins[pin].net.observe(self)

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((when, net.removeprefix("m."), level))

    def of(self, pin: str) -> list[tuple[int, int]]:
        return [(when, level) for when, name, level in self.seen if name == pin]


def powered(command: int = 32767, two_phase: bool = True, **settings: str) -> Bench:
    bench = Bench(**settings)
    for axis in ("SET_2", "SET_1"):
        bench.send(axis)
        bench.send("SET_PHASE_2" if two_phase else "SET_PHASE_3")
        bench.load(buf_mtr_cmd=command, mtr_cmd=command)
    return bench


def at_angle(bench: Bench, angle: int) -> tuple[int, int]:
    """Move axis 1 to a microstep of the electrical cycle; return its outputs."""
    bench.move(pos=angle, vel=512 << 16, acc=512 << 16)
    bench.next_cycle(2)
    return bench.seen("phase A"), bench.seen("phase B")


# -- waveforms --------------------------------------------------------------------------------


@spec("PMD-USTP-1", "PMD-USTP-3")
def test_the_tables_are_sines_of_256_steps_64_to_a_full_step() -> None:
    assert len(PHASE_A) == 256
    for lead, two in ((1 / 4, True), (1 / 3, False)):
        table = PHASE_B[two, True]
        for i in range(256):
            exact = 32767 * sin(2 * pi * (i / 256 + lead))
            assert abs(table[i] - exact) < 0.5001
    assert (PHASE_B[False, True][64], PHASE_B[False, True][192]) == (-16384, 16384)  # +-16383.5
    for i in range(256):
        assert PHASE_B[True, True][i] == PHASE_A[(i + 64) % 256]
        assert abs(PHASE_A[i] - 32767 * sin(2 * pi * i / 256)) <= 0.5


@spec("PMD-USTP-3", "PMD-USTP-5", "PMD-T-11", "PMD-AMB-24")
@pytest.mark.parametrize(
    ("angle", "a", "b"),
    [(0, 32768, 65535), (64, 65535, 32768), (192, 1, 32768), (32, 55938, 55938)],
)
def test_dac_words_of_two_phases(angle: int, a: int, b: int) -> None:
    outputs = at_angle(powered(), angle)
    assert tuple(dac_word(output) for output in outputs) == (a, b)


@spec("PMD-USTP-3", "PMD-T-11")
def test_phase_b_of_three_is_a_third_of_a_cycle_ahead() -> None:
    bench = powered(two_phase=False)
    a, b = at_angle(bench, 0)
    assert (dac_word(a), dac_word(b)) == (32768, 32768 + 28377)


@spec("PMD-USTP-4")
@pytest.mark.parametrize(
    ("command", "wave", "out"),
    [
        (32767, 32767, 32767), (-32767, 32767, -32767), (0, 32767, 0), (16384, 32767, 16384),
        (16384, -23170, -11585), (1, 16383, 0), (1, 16384, 1), (-1, 16384, -1), (1, -16384, -1),
    ],
)  # fmt: skip
def test_outputs_are_scaled_and_rounded_half_away_from_zero(
    command: int, wave: int, out: int
) -> None:
    assert scaled(command, wave) == out


@spec("PMD-USTP-4")
def test_a_negative_motor_command_inverts_the_waveform() -> None:
    assert at_angle(powered(-32767), 64) == (-32767, 0)


@spec("PMD-USTP-6", "PMD-T-12", "PMD-AMB-3", "PMD-AMB-22")
@pytest.mark.parametrize(
    ("output", "magnitude"),
    [(32767, 256), (-32767, 256), (16384, 128), (-16384, 128), (0, 0), (63, 0), (64, 1)],
)
def test_pwm_magnitude_is_of_256_parts(output: int, magnitude: int) -> None:
    assert pwm_magnitude(output) == magnitude


@spec("PMD-USTP-1")
def test_the_angle_is_the_target_modulo_256_and_moves_only_with_generated_motion() -> None:
    bench = powered()
    a64 = at_angle(bench, 64)
    assert at_angle(bench, 64 + 256) == a64
    assert at_angle(bench, 64 - 256) == a64
    bench.send("SET_ACTL_POS", 1000)
    bench.next_cycle(2)
    assert (bench.seen("phase A"), bench.seen("phase B")) == a64
    assert at_angle(bench, 1000 + 128)[0] == PHASE_A[192]
    bench.send("SYNCH_PRFL")
    bench.send("STOP")
    bench.move()
    bench.next_cycle(2)
    assert bench.seen("target") == 1000
    assert bench.seen("phase A") == PHASE_A[192]


@spec("PMD-USTP-1", "PMD-CMD-17", "PMD-CMD-69")
@pytest.mark.parametrize("way", ["cycle", "strobe"])
@pytest.mark.parametrize("command", ["SYNCH_PRFL", "SET_ACTL_POS"])
def test_a_target_that_is_renumbered_between_microsteps_keeps_the_angle(
    way: str, command: str
) -> None:
    """In every look-up, though the target begins again without a fraction."""
    plain, renumbered = Bench(way), Bench(way)
    for bench in (plain, renumbered):
        bench.send("SET_PHASE_2")
        bench.send("SET_PRFL_VEL")
        bench.move(vel=45_000, acc=45_000, buf_mtr_cmd=32_767)
        bench.next_cycle(3)
    assert plain.seen("target") == 3 * 45_000 >> 16 == 2
    rest = plain.seen_time() - 3
    for _ in range(40):
        if command == "SYNCH_PRFL":
            for bench, name in ((plain, "GET_MODE"), (renumbered, command)):
                bench.send(name)
                bench.send("UPDATE")
        else:
            plain.send("SET_BRK_PNT", 100)
            renumbered.send(command, 100)
        assert plain.now // CYCLE == renumbered.now // CYCLE
        start = (plain.now // CYCLE + 1) * CYCLE
        for j in range(1, 9):
            for bench in (plain, renumbered):
                bench.run_until(start + (j - 1) * SLOT)
            angle = 45_000 * (8 * (plain.seen_time() - rest - 1) + j) // (8 << 16)
            seen = [bench.seen("phase A") for bench in (plain, renumbered)]
            assert seen == [PHASE_A[angle % 256]] * 2
        target = 0 if command == "SYNCH_PRFL" else 100
        assert renumbered.probe.profile_position == (target << 32) + (45_000 << 16)


@spec("PMD-USTP-2")
@pytest.mark.parametrize("speed", [64, 5, -5, 1])
def test_eight_look_ups_a_cycle_divide_the_way_evenly(speed: int) -> None:
    bench = powered()
    bench.move(pos=speed * 1000, vel=abs(speed) << 16, acc=abs(speed) << 16)
    start = (bench.now // CYCLE + 1) * CYCLE
    for cycle in range(3):
        for j in range(1, 9):
            bench.run_until(start + cycle * CYCLE + (j - 1) * SLOT)
            angle = (8 * cycle * speed + speed * j) // 8 % 256
            assert bench.seen("phase A") == PHASE_A[angle]
            bench.run_for(SLOT - 1)
            assert bench.seen("phase A") == PHASE_A[angle]


@spec("PMD-USTP-2", "PMD-CMD-64", "PMD-CMD-78")
def test_a_new_amplitude_or_waveform_is_used_from_the_next_look_up_on(chip: Bench) -> None:
    chip.send("SET_PHASE_2")
    chip.run_until(20 * SLOT + 1 * US)
    chip.send("SET_MTR_CMD", 32767)  # acts 137 us later: in the 23rd slot
    assert 22 * SLOT < chip.now < 23 * SLOT
    assert chip.seen("phase B") == 0
    chip.run_until(23 * SLOT - 1)
    assert chip.seen("phase B") == 0
    chip.run_until(23 * SLOT)
    assert chip.seen("phase B") == 32767
    chip.send("SET_PHASE_3")
    assert chip.seen("phase B") == 32767
    chip.run_until((chip.now // SLOT + 1) * SLOT)
    assert chip.seen("phase B") == 28377


@spec("PMD-USTP-2", "PMD-BUS-7")
def test_what_acts_at_the_instant_of_a_look_up_is_used_in_it() -> None:
    bench = Bench(host_busy="slot")
    bench.send("SET_PHASE_2")
    bench.command(0x62)  # SET_MTR_CMD
    bench.write_word(32767)
    at = bench.chip.ready_at()
    assert at % SLOT == 0
    bench.run_until(at - 1)
    assert bench.seen("phase B") == 0
    bench.run_until(at)
    assert bench.seen("phase B") == 32767


class Noted(Plant):
    """Stands still, and notes the currents it is driven with."""

    TAKES = ("phases",)

    def __init__(self) -> None:
        super().__init__()
        self.currents: list[tuple[float, float, float]] = []

    def prepare(self, period: float) -> None:
        pass

    def phases(self, a: float, b: float, c: float) -> int:
        self.currents.append((a, b, c))
        return 0

    def count_at(self, fraction: float) -> int:
        return 0

    def fraction_at(self, count: int) -> float:
        return 0.0


@spec("PMD-USTP-2", "PMD-BUS-7")
@pytest.mark.parametrize("slot", range(8))
def test_a_motor_has_the_new_currents_from_that_look_up_on_however_late_one_looks(
    slot: int,
) -> None:
    bench = Bench(host_busy="slot")
    motor = Noted()
    bench.chip.connect(0, motor)
    bench.send("SET_PHASE_2")
    bench.run_until(8 * CYCLE + slot * SLOT + 1 * US)
    bench.command(0x62)  # SET_MTR_CMD
    bench.chip.busy_stretch = 2 * SLOT
    bench.write_word(32767)
    at = bench.chip.ready_at()
    assert at % SLOT == 0
    assert at - 3 * SLOT < bench.now < at - 2 * SLOT
    before = len(motor.currents)
    bench.run_until(at + CYCLE)
    bench.chip.advance()
    late = motor.currents[before:]
    assert late == [(0.0, 0.0, 0.0)] * 2 + [(0.0, 1.0, 0.0)] * 9


@spec("PMD-AMB-23")
def test_phase_b_may_lag_instead() -> None:
    assert at_angle(powered(phase_b="lags"), 0) == (0, -32767)
    assert at_angle(powered(two_phase=False, phase_b="lags"), 0) == (0, -28377)


@spec("PMD-TIM-5", "PMD-RST-1")
def test_what_the_chip_did_before_a_reset_has_happened_though_nobody_looked() -> None:
    driven = []
    for looks in (True, False):
        bench = powered()
        plant = Noted()
        bench.chip.connect(0, plant)
        bench.move(pos=1 << 20, vel=16 << 16, acc=16 << 16)
        bench.kernel.run_for(20 * CYCLE)
        if looks:
            bench.chip.advance()
        bench.drive("~Reset", 0)
        bench.kernel.run_for(10 * US)
        bench.drive("~Reset", 1)
        bench.run_for(5 * MS)
        driven.append(plant.currents)
    assert len(driven[0]) > 20
    assert driven[0] == driven[1]


# -- PWM pins ---------------------------------------------------------------------------------

FRAME = 256 * CLK


@spec("PMD-USTP-6", "PMD-USTP-7")
def test_pwm_frames_carry_magnitude_and_sign() -> None:
    bench = powered(16384)
    at_angle(bench, 160)  # A negative, B negative
    a, b = bench.seen("phase A"), bench.seen("phase B")
    bench.run_for(1)
    edges = Edges(bench, "PWMMag1A", "PWMSign1A", "PWMMag1B", "PWMSign1B")
    start = (bench.now // FRAME + 1) * FRAME
    bench.run_until(start + 3 * FRAME - 1)
    high = pwm_magnitude(a)
    assert 0 < high < 256
    assert edges.of("PWMMag1A") == [
        (start, 1), (start + high * CLK, 0),
        (start + FRAME, 1), (start + FRAME + high * CLK, 0),
        (start + 2 * FRAME, 1), (start + 2 * FRAME + high * CLK, 0),
    ]  # fmt: skip
    assert edges.of("PWMSign1A") == [(start, 1)]
    assert b < 0
    assert edges.of("PWMSign1B") == [(start, 1)]


@spec("PMD-RST-1", "PMD-USTP-6")
def test_frames_are_counted_anew_after_a_reset() -> None:
    bench = powered(16384)
    for _ in range(2):
        at_angle(bench, 160)
        bench.run_for(1)
        edges = Edges(bench, "PWMMag1A")
        bench.run_for(20 * FRAME)
        assert len(edges.of("PWMMag1A")) >= 39
        bench.run_for(20 * MS)  # longer than what follows the reset
        bench.send("RESET")
        bench.run_for(5 * MS)
        bench.load(buf_mtr_cmd=16384, mtr_cmd=16384)


@spec("PMD-USTP-6", "PMD-USTP-5")
def test_an_observer_who_comes_late_sees_the_present_outputs() -> None:
    bench = powered()
    bench.move(pos=64, vel=16 << 16, acc=16 << 16)
    bench.kernel.run_for(20 * CYCLE)  # and nobody has looked since
    edges = Edges(bench, "PWMMag1A", "DACSlct")
    now = bench.now
    bench.run_for(2 * FRAME)
    assert edges.of("PWMMag1A") == [(-(-now // FRAME) * FRAME, 1)]
    assert bench.seen("target") == 64


@spec("PMD-USTP-6")
def test_outputs_heard_after_other_lines_are_made_in_time() -> None:
    bench = powered(16384)
    at_angle(bench, 64)
    ready = Edges(bench, "HostRdy")
    edges = Edges(bench, "PWMMag1A")
    bench.kernel.run_for(3 * FRAME)
    assert len(edges.of("PWMMag1A")) >= 5
    assert ready.seen == []


@spec("PMD-USTP-6")
@pytest.mark.parametrize(("command", "high"), [(64, 1), (191, 1), (192, 2), (32703, 255)])
def test_the_shortest_and_the_longest_pulse(command: int, high: int) -> None:
    bench = powered(command)
    at_angle(bench, 64)
    bench.run_for(1)
    edges = Edges(bench, "PWMMag1A")
    start = (bench.now // FRAME + 1) * FRAME
    bench.run_until(start + FRAME - 1)
    assert edges.of("PWMMag1A") == [(start, 1), (start + high * CLK, 0)]


@spec("PMD-USTP-6")
def test_full_and_no_magnitude_have_no_edges() -> None:
    bench = powered()
    at_angle(bench, 64)
    edges = Edges(bench, "PWMMag1A", "PWMMag1B")
    bench.run_for(5 * FRAME)
    assert [level for _, level in edges.of("PWMMag1A")] == [1]
    assert edges.of("PWMMag1B") == []


@spec("PMD-AMB-23", "PMD-USTP-6")
def test_sign_low_is_positive_unless_set_otherwise() -> None:
    for setting, level in (("low", 0), ("high", 1)):
        bench = powered(pwm_sign=setting)
        Edges(bench, "PWMSign1A")
        for angle, sign in ((64, level), (192, 1 - level)):
            at_angle(bench, angle)
            bench.run_for(2 * FRAME)
            assert bench.level("PWMSign1A") == sign


@spec("PMD-USTP-7", "PMD-CMD-61")
def test_in_dac_mode_the_pwm_pins_rest() -> None:
    bench = powered(16384)
    at_angle(bench, 160)
    edges = Edges(bench, "PWMMag1A", "PWMSign1A")
    bench.run_for(2 * FRAME)
    assert edges.seen
    bench.send("SET_OUTPUT_DAC16")
    del edges.seen[:]
    bench.run_for(5 * FRAME)
    assert edges.seen == []
    assert bench.level("PWMSign1A") == 0


@spec("PMD-USTP-6", "PMD-USTP-7")
def test_back_in_pwm_mode_the_next_frame_is_the_first() -> None:
    """Those that would have begun meanwhile are not made up for."""
    bench = powered()
    at_angle(bench, 43)
    edges = Edges(bench, "PWMMag1A")
    bench.send("SET_OUTPUT_DAC16")
    bench.run_for(20 * FRAME)
    del edges.seen[:]
    bench.send("SET_OUTPUT_PWM")
    here = bench.now
    bench.run_for(3 * FRAME)
    rises = [when for when, level in edges.of("PWMMag1A") if level]
    begun = -(-here // FRAME) * FRAME
    assert rises[-3:] == [begun, begun + FRAME, begun + 2 * FRAME]
    assert len(rises) <= 4, "send() may end in the frame after the switch"


# -- DAC pins ---------------------------------------------------------------------------------

DAC = ("I/OAddr0-3", "DAC16Addr0-1", "Data0-11", "DACLow0-3", "~I/OWrite", "DACSlct")


def dac_writes(edges: Edges) -> list[tuple[int, int, int]]:
    """Return (instant, DAC address, word) of each DAC write, as the DAC's latch takes it."""
    levels = dict.fromkeys(DAC, 0)
    levels["~I/OWrite"] = 1
    writes = []
    for when, pin, level in edges.seen:
        if pin == "~I/OWrite" and level == 1 and levels["DACSlct"] | 1:
            if levels["I/OAddr0-3"] == 15:
                word = levels["Data0-11"] << 4 | levels["DACLow0-3"]
                writes.append((when, levels["DAC16Addr0-1"], word))
        levels[pin] = level
    return writes


@spec("PMD-USTP-5", "PMD-USTP-7")
def test_each_look_up_writes_each_phase_s_dac() -> None:
    bench = powered()
    bench.send("SET_2")
    at_angle(bench, 0)
    bench.move(pos=32, vel=512 << 16, acc=512 << 16)
    bench.next_cycle(2)
    bench.send("SET_1")
    at_angle(bench, 192)
    bench.send("SET_OUTPUT_DAC16")
    edges = Edges(bench, *DAC)
    start = (bench.now // SLOT + 1) * SLOT
    bench.run_until(start + 2 * SLOT - 1)
    writes = dac_writes(edges)
    assert [(address, word) for _, address, word in writes] == 2 * [
        (0, 1), (1, 32768), (2, 55938), (3, 55938),
    ]  # fmt: skip
    assert all(when - start < US for when, _, _ in writes[:4])
    assert all(0 < when - start - SLOT < US for when, _, _ in writes[4:])


@spec("PMD-USTP-5")
def test_an_mc1141a_writes_two_dacs() -> None:
    bench = Bench(part="MC1141A")
    bench.send("SET_OUTPUT_DAC16")
    edges = Edges(bench, *DAC)
    bench.run_until((bench.now // SLOT + 1) * SLOT + 2 * US)
    assert [(address, word) for _, address, word in dac_writes(edges)] == [(0, 32768), (1, 32768)]


@spec("PMD-TIM-21")
def test_the_dac_port_keeps_its_own_limits() -> None:
    bench = powered()
    bench.send("SET_OUTPUT_DAC16")
    edges = Edges(bench, *DAC)
    start = (bench.now // SLOT + 1) * SLOT
    bench.run_until(start + 10 * US)
    clock_out = 4 * CLK
    assert AC.minimum("T25", bench.chip.clock) == clock_out == 160 * NS

    def first(pin: str, level: int, after: int = start) -> int:
        return next(w for w, p, v in edges.seen if p == pin and v == level and w >= after)

    address = first("I/OAddr0-3", 15)
    low = first("~I/OWrite", 0)
    high = first("~I/OWrite", 1)
    select = first("DACSlct", 1)
    data = max(w for w, p, _ in edges.seen if p in ("Data0-11", "DACLow0-3") and w < high)
    measured = {
        "T19": low - address,
        "T20": high - low,
        "T21": start + clock_out + 80 * NS - high,  # the next word's data
        "T22": address - start,
        "T23": low - start,
        "T24": data - start,
        "T26": select - address,
        "T27": select - low,
    }
    assert measured == {
        "T19": 55 * NS, "T20": 75 * NS, "T21": 85 * NS, "T22": 25 * NS, "T23": 80 * NS,
        "T24": 80 * NS, "T26": 63 * NS, "T27": 8 * NS,
    }  # fmt: skip
    for symbol, interval in measured.items():
        row = AC[symbol]
        assert row.min_ps <= interval <= (row.max_ps or NEVER), symbol
    # Where the chip set puts them within these limits.
    assert {symbol: interval // NS for symbol, interval in measured.items()} == {
        "T19": 55, "T20": 75, "T21": 85, "T22": 25, "T23": 80, "T24": 80, "T26": 63, "T27": 8,
    }  # fmt: skip
    assert first("~I/OWrite", 0, low + 1) - low == clock_out


@spec("PMD-USTP-5")
def test_outputs_are_made_only_while_somebody_looks() -> None:
    bench = powered()
    assert bench.probe.next_output_change() == NEVER
    observer = Edges(bench, "PWMMag1A")
    assert bench.probe.next_output_change() < NEVER
    bench.chip.pins["PWMMag1A"].net.unobserve(observer)
    assert bench.probe.next_output_change() == NEVER
