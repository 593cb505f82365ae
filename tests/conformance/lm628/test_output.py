"""The motor output on its pins: 8-bit and 12-bit converter, sign and magnitude PWM."""

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench, Course, Log
from vbus.chips.lm628.output import STEADY, ServoOutput
from vbus.core import state
from vbus.core.kernel import NS

CLK = 125 * NS


def driven(command: int, mode: str = "strobe", **settings) -> Bench:
    """A bench whose filter gives ``command`` from the next sample on."""
    plant = Course()
    bench = Bench(mode, plant=plant, **settings)
    bench.filter(kp=1)
    bench.next_sample()
    bench.move(0)
    bench.next_sample()
    bench.probe.desired_position = command << 16
    bench.chip.input_changed()
    return bench


def levels(bench: Bench) -> int:
    """DAC7..DAC0 as a byte."""
    return sum(bench.pin(f"DAC{n}") << n for n in range(8))


@pytest.mark.spec("LM-PID-8")
@pytest.mark.parametrize(
    ("command", "code8", "code12"),
    [
        (0, 0x80, 0x800), (255, 0x80, 0x80F), (256, 0x81, 0x810), (-1, 0x7F, 0x7FF),
        (32767, 0xFF, 0xFFF), (-32768, 0x00, 0x000),
    ],
)  # fmt: skip
def test_codes_are_offset_binary(command, code8, code12):
    output = ServoOutput(False, 512)
    output.put(command, True)
    assert output.code() == code8
    assert output.command == (code8 - 0x80) / 128
    output.put(command, False)
    assert output.code() == code12
    assert output.command == (code12 - 0x800) / 2048


@pytest.mark.spec("LM-PID-8", "LM-TRJ-17")
def test_the_8_bit_code_changes_on_its_pins_exactly_at_the_sample():
    bench = driven(0x1234)
    log = Log()
    for n in range(8):
        bench.chip.pins[f"DAC{n}"].net.observe(log)
    sample = (bench.now // SAMPLE + 1) * SAMPLE
    bench.run(SAMPLE)

    assert levels(bench) == 0x80 + 0x12
    assert log.edges == [(sample, "x.DAC1", 1), (sample, "x.DAC4", 1)]


@pytest.mark.spec("LM-PID-8")
def test_pins_nobody_listens_to_show_the_present_code_when_looked_at():
    bench = driven(-0x4000)
    bench.run(SAMPLE)
    assert levels(bench) == 0x40


@pytest.mark.spec("LM-PID-9")
def test_the_12_bit_port_gives_the_low_word_and_then_the_high_word_each_with_a_strobe():
    bench = driven(0x1230)
    bench.command("PORT12")
    log = Log()
    for n in range(8):
        bench.chip.pins[f"DAC{n}"].net.observe(log)
    bench.next_sample()
    bench.run(SAMPLE - 1)
    sample = bench.now // SAMPLE * SAMPLE

    # Code 923h: low word 100011, high word 100100. Latch at each rising edge of pin 25.
    latched = []
    word = dict.fromkeys(range(8), 0) | {7: 1}
    for when, net, level in log.edges:
        word[int(net[-1])] = level
        if net == "x.DAC0" and level:
            six = sum(word[7 - n] << (5 - n) for n in range(6))
            latched.append(((when - sample) // CLK, word[1], six))
    assert latched == [(8, 0, 0b100011), (32, 1, 0b100100)]
    falls = [(when - sample) // CLK for when, net, level in log.edges if net == "x.DAC0"]
    assert falls == [8, 16, 32, 40]


@pytest.mark.spec("LM-PID-8", "LM-PID-9")
def test_the_port_has_eight_bits_again_after_port8():
    bench = driven(0x1230)
    for name in ("PORT12", "PORT8"):
        bench.command(name)
        bench.next_sample()
    bench.run(SAMPLE)
    assert levels(bench) == 0x92


@pytest.mark.spec("LM-PID-9")
def test_the_12_bit_port_strobes_every_sample_though_nothing_changes():
    bench = driven(0)
    bench.command("PORT12")
    log = Log()
    bench.chip.pins["DAC0"].net.observe(log)
    bench.next_sample()
    log.edges.clear()
    bench.run(5 * SAMPLE)

    assert len(log.edges) == 5 * 4
    assert {(when % SAMPLE) // CLK for when, _, _ in log.edges} == {8, 16, 32, 40}


@pytest.mark.spec("LM-PID-9")
def test_the_12_bit_pins_show_their_word_of_the_moment_when_looked_at():
    bench = driven(0x1230)
    bench.command("PORT12")
    bench.next_sample()
    sample = bench.now
    for clk, word in ((0, 0b10001100), (8, 0b10001101), (16, 0b10001100), (24, 0b10010010),
                      (32, 0b10010011), (40, 0b10010010), (2047, 0b10010010)):  # fmt: skip
        bench.at(sample + clk * CLK - (1 if clk else 0))
        before = levels(bench)
        bench.at(sample + clk * CLK)
        assert levels(bench) == word
        assert clk in (0, 2047) or before != word


@pytest.mark.spec("LM-PID-9")
@pytest.mark.parametrize(("clk", "word"), [(9, 0b10001101), (15, 0b10001101), (39, 0b10010011)])
def test_a_state_loaded_within_a_word_of_the_12_bits_shows_it(clk, word):
    bench = driven(0x1230)
    bench.command("PORT12")
    bench.next_sample()
    bench.at(bench.now + clk * CLK)
    state.load(bench.chip, state.save(bench.chip))
    assert levels(bench) == word


@pytest.mark.spec("LM-PID-10")
@pytest.mark.parametrize(
    ("command", "sign", "magnitude"),
    [
        (0, 0, 0), (255, 0, 0), (256, 0, 1), (-1, 1, 1), (-256, 1, 1), (-257, 1, 2),
        (32767, 0, 127), (-32768, 1, 127),
    ],
)  # fmt: skip
def test_the_lm629_gives_a_sign_and_a_magnitude_of_7_bits(command, sign, magnitude):
    bench = driven(command, part="LM629N-8")
    bench.next_sample()

    assert bench.pin("SIGN") == sign
    assert bench.probe.output_code() == 4 * magnitude
    assert bench.probe.output_command == (-magnitude if sign else magnitude) / 128


@pytest.mark.spec("LM-PID-10", "LM-CFG-1")
@pytest.mark.parametrize("frame", [512, 128, 2048])
def test_the_pwm_frame_is_high_for_its_magnitude(frame):
    bench = driven(-0x3000, part="LM629N-8", pwm_frame_clk=frame)
    log = Log()
    bench.chip.pins["MAG"].net.observe(log)
    bench.next_sample()
    sample = bench.now
    bench.run(SAMPLE - 1)

    # 30h = 48 of 128.
    assert [((when - sample) // CLK, level) for when, _, level in log.edges] == [
        edge
        for start in range(0, 2048, frame)
        for edge in ((start, 1), (start + 48 * frame // 128, 0))
    ]


@pytest.mark.spec("LM-PID-10")
def test_the_pwm_pin_shows_its_level_of_the_moment_when_looked_at():
    bench = driven(0x4000, part="LM629M-8")
    bench.next_sample()
    sample = bench.now
    for frame in range(4):
        for clk, level in ((0, 1), (255, 1), (256, 0), (511, 0)):
            bench.at(sample + (frame * 512 + clk) * CLK)
            assert bench.pin("MAG") == level


@pytest.mark.spec("LM-PID-10")
def test_a_magnitude_of_zero_makes_no_edges():
    bench = driven(0, part="LM629N-8")
    log = Log()
    bench.chip.pins["MAG"].net.observe(log)
    bench.run(3 * SAMPLE)
    assert log.edges == []
    assert bench.probe.next_output_change(0) == STEADY


@pytest.mark.spec("LM-RST-3")
def test_the_pulses_of_an_lm629_end_with_a_reset():
    bench = driven(0x4000, part="LM629N-8")
    log = Log()
    bench.chip.pins["MAG"].net.observe(log)
    bench.next_sample()
    bench.run(SAMPLE - 1)
    assert [level for _, _, level in log.edges] == [1, 0] * 4

    bench.command("RESET")
    log.edges.clear()
    bench.run(3 * SAMPLE)
    assert log.edges == []
    assert bench.probe.next_output_change(0) == STEADY


@pytest.mark.spec("LM-CFG-1")
@pytest.mark.parametrize("frame", [129, 500, 1000])
def test_a_pwm_frame_that_does_not_fit_the_sample_is_refused(frame):
    with pytest.raises(ValueError, match=rf"^pwm_frame_clk = {frame}: allowed are 128, 256, 512"):
        Bench(part="LM629N-8", pwm_frame_clk=frame)


def test_each_part_has_its_own_output_pins():
    assert [n for n in Bench(part="LM629N-6", hz=6_000_000).chip.pins if n[:3] == "DAC"] == []
    assert "MAG" not in Bench(part="LM628N-6", hz=6_000_000).chip.pins


def test_the_mechanics_get_the_output_of_the_sample_for_the_coming_period():
    bench = driven(0x2000)
    plant = bench.plant
    bench.next_sample()
    assert plant.commands[-1] == 0x20 / 128
    bench.move(0x0100)
    bench.next_sample()
    assert plant.commands[-1] == 0


@pytest.mark.spec("LM-PID-10")
def test_the_amplifier_of_an_lm629_gets_127_parts_at_most() -> None:
    output = ServoOutput(True, 1024)
    for command, parts in ((-32768, -127), (-127 * 256, -127), (32767, 127), (-126 * 256, -126)):
        assert output.put(command, True) == output.command == parts / 128
        assert output.code() == abs(parts) * 8
