"""DAC port and PWM (MCP-OUT)."""

import itertools

import pytest

from tests.conformance.mcp1200.conftest import RESET_CLK, Bench, Rail
from vbus.chips.base import EDGE
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.output import Pwm
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.core.kernel import NEVER

# Gains with which an error of n gives a motor command of 16 * n.
UNIT = {"LEAD_ZERO": 0, "LEAD_POLE": 0, "LEAD_GAIN": 4}


def command(bench: Bench, mc: int) -> int:
    """Make the loop give motor command ``mc`` (a multiple of 16); return the DAC code."""
    bench.put("COMMAND_POSITION", mc // 16 & 0xFFFFFF)
    bench.samples(1)
    assert bench.probe.mc == mc
    assert bench.seen("MOTOR_COMMAND") << 4 | bench.seen("MOTOR_COMMAND_LOW") >> 4 == bench.pin(
        "MC0-MC11"
    )
    return bench.pin("MC0-MC11")


def servo(unipolar: str = "magnitude", **registers: int) -> Bench:
    bench = Bench(unipolar=unipolar)
    bench.extended()
    for name, value in {**UNIT, **registers}.items():
        bench.put(name, value)
    bench.control()
    bench.samples(1)
    return bench


@pytest.mark.spec("MCP-OUT-1", "MCP-T-7", "MCP-AMB-11", "MCP-REG-39")
@pytest.mark.parametrize(
    ("limit", "mc", "code"),
    [
        (0xF0, 0, 0x800), (0xF0, 16, 0x810), (0xF0, -16, 0x7F0), (0xF0, 0x7E0, 0xFE0),
        (0xF0, 0x7F0, 0xFF0), (0xF0, 2048, 0xF00), (0xF0, -2048, 0x000), (0xF0, -2064, 0x0F0),
        (0xE7, 2048, 0xE70), (0xE7, -2064, 0x180), (0x18, 2048, 0xE70), (0x18, -2064, 0x180),
        (0xFF, 4800, 0xFF0), (0xFF, -4800, 0x000), (0x81, 2048, 0x810), (0x80, -4800, 0x7F0),
        (0x7F, 2048, 0x800),
    ],
)  # fmt: skip
def test_the_dac_code_and_its_fold_back(limit: int, mc: int, code: int) -> None:
    assert command(servo(SATURATION=limit), mc) == code


@pytest.mark.spec("MCP-OUT-1")
def test_the_low_nibble_reaches_the_pins() -> None:
    bench = servo(LEAD_GAIN=1)
    bench.put("COMMAND_POSITION", 3)
    bench.samples(1)
    assert (bench.pin("MC0-MC11"), bench.read(0x08), bench.read(0x4C)) == (0x80C, 0x80, 0xC0)


@pytest.mark.spec("MCP-OUT-2", "MCP-AMB-4", "MCP-AMB-5")
@pytest.mark.parametrize(
    ("mc", "code", "sign"),
    [(512, 0xA00, 0), (-512, 0xA00, 1), (2048, 0xF00, 0), (-4096, 0xF00, 1), (-2048, 0xFFF, 1)],
)
def test_unipolar_gives_the_magnitude_and_leaves_pwm_and_sign(
    mc: int, code: int, sign: int
) -> None:
    bench = servo(FEATURE=0x04)
    assert command(bench, mc) == code
    bench.wait(200)
    assert bench.pin("SIGN") == sign
    assert bench.probe.pwm == max(-2048, min(2047, mc))


@pytest.mark.spec("MCP-OUT-2", "MCP-AMB-5", "MCP-OUT-3")
@pytest.mark.parametrize(
    ("mc", "offset", "code", "sign"),
    [(512, 0, 0xA00, 0), (0, 0, 0x800, 0), (-16, 0, 0x800, 1), (-512, 0, 0x800, 1),
     (2032, 0, 0xFF0, 0), (2048, 0, 0xF00, 0), (-2048, 0, 0x800, 1), (-2064, 0, 0x800, 1),
     (-9600, 0, 0x800, 1), (-512, 0x7F, 0x87F, 1), (-512, 0x80, 0x780, 1)],
)  # fmt: skip
def test_unipolar_clipped_gives_zero_of_a_negative_command(
    mc: int, offset: int, code: int, sign: int
) -> None:
    bench = servo(unipolar="clip", FEATURE=0x04, DAC_OFFSET=offset)
    assert command(bench, mc) == code
    bench.wait(200)
    assert bench.pin("SIGN") == sign
    assert bench.probe.pwm == max(-2048, min(2047, mc))
    # In idle mode the host writes what it likes.
    bench.write(0x05, 0x01)
    bench.samples(1)
    bench.write(0x08, 0x12)
    assert bench.pin("MC0-MC11") == 0x120


@pytest.mark.spec("MCP-OUT-2", "MCP-AMB-5")
@pytest.mark.parametrize(("unipolar", "code"), [("magnitude", 0x801), ("clip", 0x800)])
def test_the_smallest_negative_command_of_a_unipolar_output(unipolar: str, code: int) -> None:
    bench = servo(unipolar=unipolar, FEATURE=0x0C, KP=2, KD=0)
    bench.put("COMMAND_POSITION", 0xFFFFFF)
    bench.samples(1)
    assert (bench.probe.mc, bench.pin("MC0-MC11")) == (-1, code)


@pytest.mark.spec("MCP-OUT-2")
@pytest.mark.parametrize("unipolar", ["magnitude", "clip"])
@pytest.mark.parametrize(("mc", "code"), [(-512, 0x600), (512, 0xA00), (-2064, 0x0F0)])
def test_bipolar_output_does_not_ask_what_unipolar_output_means(
    unipolar: str, mc: int, code: int
) -> None:
    assert command(servo(unipolar=unipolar), mc) == code


@pytest.mark.spec("MCP-OUT-9", "MCP-OUT-2")
@pytest.mark.parametrize("unipolar", ["magnitude", "clip"])
@pytest.mark.parametrize(("error", "code"), [(-3, 0x800 - 48), (3, 0x800 + 48), (-200, 0)])
def test_the_diagnostic_error_keeps_its_sign_on_a_unipolar_output(
    unipolar: str, error: int, code: int
) -> None:
    bench = servo(unipolar=unipolar, FEATURE=0x84)
    bench.put("COMMAND_POSITION", error & 0xFFFFFF)
    bench.samples(1)
    assert bench.pin("MC0-MC11") == code


@pytest.mark.spec("MCP-OUT-3", "MCP-REG-11")
@pytest.mark.parametrize(
    ("offset", "mc", "code"),
    [
        (0x01, 0, 0x801), (0xFF, 0, 0x7FF), (0x7F, 0, 0x87F), (0x80, 0, 0x780),
        (0x1F, 16, 0x82F), (0x7F, 0x7F0, 0xFFF), (0x80, -2048, 0x000), (0x10, 4096, 0xF10),
    ],
)  # fmt: skip
def test_the_dac_offset_is_added_with_carry_and_clamped(offset: int, mc: int, code: int) -> None:
    assert command(servo(DAC_OFFSET=offset), mc) == code


@pytest.mark.spec("MCP-OUT-4")
@pytest.mark.parametrize(
    ("mc", "shown"), [(0x7E0, 0x7E0), (2048, 2047), (9600, 2047), (-2048, -2048), (-9600, -2048)]
)
def test_pwm_takes_the_plain_command_limited_to_12_bits(mc: int, shown: int) -> None:
    bench = servo(DAC_OFFSET=0x40, SATURATION=0x90)
    command(bench, mc)
    assert bench.probe.pwm == shown
    assert bench.read(0x09) == shown >> 4 & 0xFF
    assert bench.read(0x4D) == shown << 4 & 0xF0


def duty(bench: Bench, resolution: int = 100, frames: int = 2) -> tuple[int, int]:
    """Clocks Pulse is high in a whole frame, and the level of Sign."""
    bench.wait(2 * resolution)
    while (bench.cycle - bench.probe.pwm_frame_start) % resolution:
        bench.wait(1)
        bench.pin("PULSE")
    high = 0
    for _ in range(resolution):
        high += bench.pin("PULSE")
        bench.wait(1)
    return high, bench.pin("SIGN")


@pytest.mark.spec("MCP-OUT-5", "MCP-OUT-6", "MCP-OUT-7", "MCP-T-5", "MCP-AMB-3", "MCP-AMB-18")
@pytest.mark.parametrize(
    ("data", "plain", "biased"),
    [(0x80, 100, 0), (0x9C, 100, 0), (0xCE, 50, 25), (0xFE, 2, 49), (0x00, 0, 50), (0x02, 2, 51),
     (0x32, 50, 75), (0x64, 100, 100), (0x7F, 100, 100), (0xD8, 40, 30)],
)  # fmt: skip
def test_duty_and_sign_for_the_manual_s_values(
    bench: Bench, data: int, plain: int, biased: int
) -> None:
    bench.write(0x09, data)
    assert duty(bench) == (plain, data >> 7)
    bench.write(0x02, 0x80)
    assert duty(bench) == (biased, data >> 7)


@pytest.mark.spec("MCP-OUT-5", "MCP-REG-20")
@pytest.mark.parametrize(
    ("code", "resolution"),
    [(0, 100), (1, 150), (2, 200), (3, 300), (4, 400), (5, 600), (6, 800), (7, 1200), (8, 1600),
     (9, 1600), (15, 1600)],
)  # fmt: skip
def test_the_resolution_table(chip: Bench, code: int, resolution: int) -> None:
    chip.write(0x1A, 0x50 | code)
    chip.write(0x09, 0x19)
    edges = chip.watch("PULSE")
    chip.wait(6 * 1600)
    rises = edges.of("PULSE", 1)[1:]
    falls = edges.of("PULSE", 0)[1:]
    assert {b - a for a, b in itertools.pairwise(rises)} == {resolution}
    # 25 of 100 parts.
    assert falls[1] - rises[1] == resolution // 4


@pytest.mark.spec("MCP-OUT-5")
def test_the_fraction_register_counts_sixteenths(chip: Bench) -> None:
    chip.extended()
    chip.write(0x1A, 0x08)
    chip.write(0x09, 0x01)
    chip.write(0x4D, 0xA0)
    chip.wait(3200)
    assert duty(chip, 1600)[0] == 26


@pytest.mark.spec("MCP-OUT-6")
@pytest.mark.parametrize(("msb", "fraction", "high"), [(0x63, 0xF0, 1599), (0x9C, 0x10, 0)])
def test_the_bias_is_exact_at_the_finest_resolution(
    chip: Bench, msb: int, fraction: int, high: int
) -> None:
    chip.write(0x02, 0x81)
    chip.write(0x1A, 0x08)
    chip.write(0x09, msb)
    chip.write(0x4D, fraction)
    chip.wait(3200)
    assert duty(chip, 1600)[0] == high


@pytest.mark.spec("MCP-T-6")
@pytest.mark.parametrize(
    ("hz", "code", "khz"), [(8_000_000, 4, 20.0), (20_000_000, 8, 12.5), (16_000_000, 0, 160.0)]
)
def test_the_pwm_frequency(hz: int, code: int, khz: float) -> None:
    bench = Bench(hz=hz)
    bench.write(0x1A, code)
    bench.write(0x09, 0x20)
    bench.wait(2000)
    edges = bench.watch("PULSE")
    bench.wait(8000)
    rises = edges.of("PULSE", 1)
    assert hz / (rises[1] - rises[0]) == khz * 1000


@pytest.mark.spec("MCP-OUT-7")
def test_a_new_command_waits_for_the_next_frame(chip: Bench) -> None:
    chip.write(0x09, 0x32)
    chip.wait(300)
    edges = chip.watch("PULSE", "SIGN")
    frame = chip.probe.pwm_frame_start + 100
    while frame <= chip.cycle + 5:
        frame += 100
    chip.until(frame + 10)
    chip.write(0x09, 0xF6)
    chip.until(frame + 250)
    assert [edge for edge in edges.seen if edge[0] >= frame] == [
        (frame, "PULSE", 1), (frame + 50, "PULSE", 0),
        (frame + 100, "PULSE", 1), (frame + 100, "SIGN", 1), (frame + 110, "PULSE", 0),
        (frame + 200, "PULSE", 1), (frame + 210, "PULSE", 0),
    ]  # fmt: skip


@pytest.mark.spec("MCP-OUT-7")
@pytest.mark.parametrize(
    ("command", "edges"),
    [
        (0x9C, [(0, "SIGN", 1)]),
        (0x32, [(50, "PULSE", 0), (100, "PULSE", 1), (150, "PULSE", 0)]),
        (0x00, [(0, "PULSE", 0)]),
    ],
)
def test_a_pin_that_has_been_high_for_frames_changes_with_the_next_one(
    chip: Bench, command: int, edges: list[tuple[int, str, int]]
) -> None:
    chip.write(0x09, 0x64)
    chip.wait(300)
    log = chip.watch("PULSE", "SIGN")
    frame = chip.probe.pwm_frame_start + 100
    while frame <= chip.cycle + 5:
        frame += 100
    chip.until(frame + 10)
    chip.write(0x09, command)
    chip.until(frame + 290)
    assert [(when - frame - 100, name, level) for when, name, level in log.seen] == edges


def long_frames(bench: Bench) -> int:
    """Frames of 1600 clocks; return the start of the one under way."""
    bench.write(0x1A, 0x08)
    bench.wait(200)
    bench.probe.show_pulse(bench.cycle)
    return bench.probe.pwm_frame_start


def unseen(bench: Bench, cycle: int) -> int:
    """Let time pass with nobody looking; return the level of Pulse then."""
    bench.kernel.run_until(bench.clock.ps(cycle))
    return bench.pin("PULSE")


@pytest.mark.spec("MCP-OUT-7", "MCP-SMP-5")
def test_a_result_waits_for_the_next_frame_even_if_nobody_has_looked_for_long() -> None:
    bench = Bench()
    bench.put("COMMAND_POSITION", 3)
    frame = long_frames(bench)
    bench.control()
    results = bench.sample_start() + 1000
    assert 100 < (results - frame) % 1600 < 1500
    assert unseen(bench, results + 5) == 0
    bench.until(results + 1600 - (results - frame) % 1600)
    assert bench.pin("PULSE") == 1


@pytest.mark.spec("MCP-OUT-7")
@pytest.mark.parametrize(("visible", "level"), [(2, 0), (1, 0), (0, 1)])
def test_a_write_that_becomes_visible_after_a_frame_began_waits_too(
    visible: int, level: int
) -> None:
    bench = Bench()
    frame = long_frames(bench) + 1600
    bench.until(frame + visible - 4)
    bench.chip.write(0x09, 0x7F)
    assert unseen(bench, frame + 10) == level
    assert unseen(bench, frame + 1600) == 1


@pytest.mark.spec("MCP-OUT-7", "MCP-MOD-2")
def test_a_frame_that_begins_together_with_idle_is_off() -> None:
    bench = Bench()
    bench.put("COMMAND_POSITION", 100)
    long_frames(bench)
    bench.control()
    bench.samples(2)
    bench.write(0x05, 0x01)
    idle = bench.sample_start()
    assert idle % 2 == 0
    bench.probe.pwm_frame_start = idle - 1600
    assert unseen(bench, idle + 5) == 0


@pytest.mark.spec("MCP-OUT-7", "MCP-MOD-2")
def test_the_frame_in_which_idle_begins_is_finished() -> None:
    bench = Bench()
    bench.put("COMMAND_POSITION", 100)
    frame = long_frames(bench)
    bench.control()
    bench.samples(2)
    bench.write(0x05, 0x01)
    idle = bench.sample_start()
    assert 100 < (idle - frame) % 1600 < 1500
    assert unseen(bench, idle + 5) == 1
    assert bench.pin("IDLE") == 1
    assert unseen(bench, idle + 1600 - (idle - frame) % 1600) == 0


@pytest.mark.spec("MCP-EXC-7", "MCP-OUT-7")
def test_a_limit_low_at_the_very_start_of_a_frame_takes_that_frame_away() -> None:
    bench = Bench()
    bench.write(0x09, 0x7F)
    frame = long_frames(bench) + 3200
    bench.kernel.run_until(bench.clock.ps(frame - 100))
    assert unseen(bench, frame - 100) == 1
    bench.kernel.run_until(bench.clock.ps(frame))
    bench.drive("/LIMIT", 0)
    assert unseen(bench, frame + 100) == 0


@pytest.mark.spec("MCP-OUT-7", "MCP-MOD-4")
def test_the_frame_in_which_a_limit_takes_the_output_away_is_finished() -> None:
    bench = Bench()
    frame = long_frames(bench) + 3200
    bench.write(0x09, 0x7F)
    bench.kernel.run_until(bench.clock.ps(frame + 700))
    bench.drive("/LIMIT", 0)
    assert bench.seen("PWM_COMMAND") == 0
    assert unseen(bench, frame + 800) == 1
    assert unseen(bench, frame + 1600) == 0


@pytest.mark.spec("MCP-OUT-8")
@pytest.mark.parametrize(("config", "silent"), [(0x40, 1), (0x00, 0)])
def test_after_a_sign_change_one_frame_is_silent_if_asked(
    chip: Bench, config: int, silent: int
) -> None:
    chip.write(0x02, config)
    chip.write(0x09, 0x32)
    chip.wait(300)
    edges = chip.watch("PULSE", "SIGN")
    chip.write(0x09, 0xCE)
    chip.wait(500)
    turned = edges.of("SIGN", 1)[0]
    rises = [cycle for cycle in edges.of("PULSE", 1) if cycle >= turned]
    assert rises[0] == turned + 100 * silent
    assert rises[1] == rises[0] + 100


@pytest.mark.spec("MCP-OUT-9", "MCP-REG-2")
@pytest.mark.parametrize(
    ("feature", "dac", "pwm"),
    [(0x80, 0x800 + 48, 24), (0x40, 0x800 + 24, 48), (0xC0, 0x800 + 48, 48), (0x00, 0x818, 24)],
)
def test_diagnostic_outputs_carry_the_position_error(feature: int, dac: int, pwm: int) -> None:
    bench = servo(LEAD_GAIN=2, FEATURE=feature)
    bench.put("COMMAND_POSITION", 3)
    bench.samples(1)
    assert (bench.pin("MC0-MC11"), bench.probe.pwm) == (dac, pwm)
    bench.put("COMMAND_POSITION", 0xFFFF00)
    bench.samples(1)
    shown = -256 * 8
    expected = -2048
    assert expected == shown
    if feature & 0x40:
        assert bench.probe.pwm == -2048
    if feature & 0x80:
        assert bench.pin("MC0-MC11") == 0


@pytest.mark.spec("MCP-OUT-4", "MCP-OUT-2")
@pytest.mark.parametrize(
    ("drive", "unipolar", "feature", "offset", "mc", "fraction"),
    [("pwm", "magnitude", 0, 0, 800, 0.5), ("pwm", "magnitude", 0, 0, 1600, 1.0),
     ("pwm", "magnitude", 0, 0, -2048, -1.0), ("dac", "magnitude", 0, 0, 1024, 0.5),
     ("dac", "magnitude", 0, 0, -2048, -1.0), ("dac", "magnitude", 4, 0, -1024, -0.5),
     ("dac", "magnitude", 4, 64, -1024, -0.53125), ("pwm", "clip", 4, 0, -800, -0.5),
     ("dac", "clip", 0, 0, -1024, -0.5), ("dac", "clip", 4, 0, -1024, 0.0),
     ("dac", "clip", 4, 64, -1024, 0.03125), ("dac", "clip", 4, 64, 960, 0.5)],
)  # fmt: skip
def test_the_plant_gets_the_output_the_board_names(
    drive: str, unipolar: str, feature: int, offset: int, mc: int, fraction: float
) -> None:
    rail = Rail()
    bench = Bench(plant=rail, drive=drive, unipolar=unipolar)
    for name, value in {**UNIT, "FEATURE": feature, "DAC_OFFSET": offset}.items():
        bench.put(name, value)
    bench.control()
    command(bench, mc)
    bench.samples(1)
    assert rail.commands[-1] == fraction


@pytest.mark.spec("MCP-SMP-5", "MCP-OUT-4")
def test_the_plant_feels_a_new_command_when_busy_ends() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    bench.control()
    bench.samples(1)
    bench.put("COMMAND_POSITION", 3)
    start = bench.sample_start()
    bench.until(start + 999)
    assert rail.commands[-1] == 0.0
    bench.until(start + 1000)
    assert rail.commands[-1] == 768 / 1600


@pytest.mark.spec("MCP-AMB-22", "MCP-T-5")
def test_the_figure_s_three_quarter_mark_is_4bh(chip: Bench) -> None:
    chip.write(0x09, 0x4B)
    assert duty(chip)[0] == 75


@pytest.mark.spec("MCP-BUS-5", "MCP-RST-5")
def test_what_is_ordered_is_waited_for_though_samples_move_no_pin() -> None:
    chip = Bench().chip
    assert chip.due(EDGE) == NEVER
    chip.write(0x0F, 0x03)
    assert chip.due(EDGE) == chip.clock.ps(4)
    resetting = Bench(done=False).chip
    assert resetting.due(EDGE) == resetting.clock.ps(RESET_CLK)


@pytest.mark.spec("MCP-SMP-4")
def test_idle_may_move_at_every_sample_of_control_mode_and_no_other(chip: Bench) -> None:
    chip.control()
    chip.samples()
    assert chip.chip.due(EDGE) == NEVER
    chip.watch("IDLE")
    assert chip.chip.due(EDGE) <= chip.clock.ps(chip.sample_start())
    chip.write(0x05, 0x01)
    chip.samples()
    assert chip.chip.due(EDGE) == NEVER


@pytest.mark.spec("MCP-OUT-8")
@pytest.mark.parametrize("cycle", [99, 100, 399, 400, 5000])
def test_frames_that_nobody_looked_at_are_as_if_somebody_had(cycle: int) -> None:
    pair = []
    for step in (1, cycle):
        registers = RegisterFile()
        registers.config = ds.SIGN_INHIBIT
        pwm = Pwm(registers)
        pwm.restart(0)
        registers.drive(0, -800)
        registers.encoder_pwm = 3
        for now in range(0, cycle + 1, step):
            pwm.roll(now)
        pair.append((pwm.start, pwm.length, pwm.high, pwm.sign))
    assert pair[0] == pair[1]
    # Frames are of 100 clocks, then 300, of which the first is held low.
    assert pair[0][2] == (0 if cycle < 400 else 150)
