"""Lead filter and PID filter, to the bit (MCP-FLT)."""

from fractions import Fraction
from math import floor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conformance.mcp1200.conftest import Bench


def respond(bench: Bench, errors: list[int]) -> list[int]:
    """Give the loop one position error per sample; return the motor commands."""
    commands = []
    for error in errors:
        bench.put("COMMAND_POSITION", error & 0xFFFFFF)
        bench.samples(1)
        commands.append(bench.probe.mc)
    return commands


def servo(pid: bool = False, **registers: int) -> Bench:
    bench = Bench()
    bench.extended()
    if pid:
        bench.write(0x01, 0x08)
    for name, value in registers.items():
        bench.put(name, value)
    bench.control()
    return bench


@pytest.mark.spec("MCP-FLT-1", "MCP-FLT-2", "MCP-T-8", "MCP-AMB-25", "MCP-AMB-26", "MCP-AMB-32")
def test_the_lead_filter_with_its_default_parameters() -> None:
    bench = servo()
    assert respond(bench, [1, 1, 1, 1, 0, 0, -3]) == [256, -37, 37, 18, -233, 59, -782]
    assert bench.probe.pwm == -782
    assert bench.pin("MC0-MC11") == 0x800 - 782


@pytest.mark.spec("MCP-FLT-2", "MCP-T-8", "MCP-OUT-1")
def test_an_error_of_ten_saturates_and_the_limited_command_is_what_is_remembered() -> None:
    bench = servo()
    assert respond(bench, [10]) == [2560]
    assert bench.pin("MC0-MC11") == 0xF00
    # 4*K*E - ((4*A*K*10 + B*2047) >> 8): 2047, not 2560.
    assert respond(bench, [0]) == [-((4 * 229 * 64 * 10 + 64 * 2047) >> 8)]


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(*[st.integers(0, 255)] * 3),
    st.lists(st.integers(-40, 40), min_size=1, max_size=8),
)
@pytest.mark.spec("MCP-FLT-2")
def test_the_lead_filter_is_its_difference_equation(
    gains: tuple[int, ...], errors: list[int]
) -> None:
    zero, pole, gain = gains
    bench = servo(LEAD_ZERO=zero, LEAD_POLE=pole, LEAD_GAIN=gain)
    expected = []
    old_error = old_command = 0
    for error in errors:
        k = Fraction(gain, 4)
        now = 16 * k * error
        old = Fraction(zero, 256) * k * old_error * 16 + Fraction(pole, 256) * old_command
        command = int(now) - floor(old)
        expected.append(command)
        old_error, old_command = error, max(-2048, min(2047, command))
    assert respond(bench, errors) == expected


@pytest.mark.spec("MCP-FLT-3", "MCP-T-9", "MCP-AMB-24", "MCP-AMB-26")
def test_the_pid_filter_with_its_default_parameters() -> None:
    bench = servo(pid=True)
    assert respond(bench, [1, 1, 2, 2, 2, -3]) == [160, 32, 192, 64, 64, -736]
    assert bench.probe.pwm == -736


@pytest.mark.spec("MCP-FLT-3", "MCP-REG-44")
@pytest.mark.parametrize(
    ("gains", "command"),
    [
        # In 1/16 of an R08 step: 1/32, 1/8192, 1/8 of a step per unit.
        ({"KP": 32, "KI": 0, "KD": 0}, 16 * 3), ({"KP": 0, "KI": 255, "KD": 0}, 255 * 3 >> 9),
        ({"KP": 0, "KI": 0, "KD": 8}, 16 * 3), ({"KP": 0, "KI": 0, "KD": 0}, 0),
        ({"KP": 255, "KI": 255, "KD": 255}, (256 * 255 * 3 + 255 * 3 + 1024 * 255 * 3) >> 9),
    ],
)  # fmt: skip
def test_scaling_of_the_pid_terms(gains: dict[str, int], command: int) -> None:
    assert respond(servo(pid=True, **gains), [3]) == [command]


@pytest.mark.spec("MCP-FLT-3", "MCP-REG-46")
@pytest.mark.parametrize(("limit", "reached"), [(0x0064, 100), (0x8064, 100), (0x7FFF, 250)])
def test_the_integral_is_limited_by_15_bits(limit: int, reached: int) -> None:
    bench = servo(pid=True, KP=0, KI=1, KD=0, INTEGRAL_LIMIT=limit)
    respond(bench, [50] * 5)
    assert bench.probe.integral == reached
    respond(bench, [-50] * 12)
    assert bench.probe.integral == max(reached - 600, -reached if reached == 100 else -32767)


@pytest.mark.spec("MCP-FLT-3")
def test_the_integral_rests_in_the_sample_after_a_saturated_one() -> None:
    bench = servo(pid=True, KP=255, KI=1, KD=0)
    integral = bench.probe
    seen = []
    for error in (10, 20, 20, 10, 10):
        respond(bench, [error])
        seen.append(integral.integral)
    # 20 * 127.5 = 2550 saturates: the samples after it do not add.
    assert seen == [10, 30, 30, 30, 40]


@pytest.mark.spec("MCP-FLT-3", "MCP-REG-46")
@pytest.mark.parametrize(("command", "limited"), [(1000, 49), (-1000, -50)])
def test_a_lowered_limit_holds_while_the_motor_command_is_saturated(
    bench: Bench, command: int, limited: int
) -> None:
    bench.write(0x02, 0x01)
    bench.write(0x04, 0x00)
    bench.write(0x01, 0x08)
    for place, gain in ((0x61, 0x00), (0x62, 0xFF), (0x63, 0x00)):
        bench.write(place, gain)
    bench.put("COMMAND_POSITION", command & 0xFFFFFF)
    bench.control()
    bench.samples(8)
    core = bench.probe
    assert not -2048 <= core.mc <= 2047
    assert (core.integral, bench.pin("MC0-MC11")) == (
        (5000, 0xF00) if command > 0 else (-5000, 0x0F0)
    )
    bench.write(0x66, 0x00)
    bench.write(0x65, 0x64)
    bench.samples(1)
    # 255 * 100 / 512, one floor.
    assert (core.mc, bench.pin("MC0-MC11")) == (limited, 0x800 + limited)
    assert bench.read(0x09) << 8 | bench.read(0x4D) == limited << 4 & 0xFFFF


@pytest.mark.spec("MCP-FLT-3", "MCP-OUT-1")
@pytest.mark.parametrize(
    ("errors", "commands", "integrals", "codes"),
    [
        # 255 * 4111 / 512 = 2047.5 and 255 * -4112 / 512 = -2047.9: the last that fit 12 bits.
        ([4111, 2, 1], [2047, 2048, 2048], [4111, 4113, 4113], [0xFFF, 0xF00, 0xF00]),
        ([-4112, -1, -1], [-2048, -2049, -2049], [-4112, -4113, -4113], [0x000, 0x0F0, 0x0F0]),
    ],
)  # fmt: skip
def test_the_last_command_that_fits_is_not_saturated(
    errors: list[int], commands: list[int], integrals: list[int], codes: list[int]
) -> None:
    bench = servo(pid=True, KP=0, KI=255, KD=0)
    seen = []
    for error in errors:
        mc = respond(bench, [error])[0]
        seen.append((mc, bench.probe.integral, bench.pin("MC0-MC11")))
    assert seen == list(zip(commands, integrals, codes, strict=True))


@pytest.mark.spec("MCP-FLT-3", "MCP-REG-45", "MCP-AMB-8")
@pytest.mark.parametrize(
    ("code", "span"),
    [(1, 1), (2, 2), (3, 3), (4, 4), (8, 8), (0, 1), (5, 1), (6, 1), (7, 1), (9, 1), (255, 1)],
)
def test_the_derivative_span(code: int, span: int) -> None:
    bench = servo(pid=True, KP=0, KI=0, KD=8, DERIVATIVE_SPAN=code)
    errors = [1, 3, 6, 10, 15, 21, 28, 36, 45, 55]
    past = [0] * 10
    expected = [16 * (error - (past + errors)[10 + n - span]) for n, error in enumerate(errors)]
    assert respond(bench, errors) == expected


@pytest.mark.spec("MCP-FLT-3", "MCP-FLT-4", "MCP-REG-43", "MCP-REG-47", "MCP-AMB-24")
@pytest.mark.parametrize("value", [0x0280, 0x8001, 0x7FFF])
def test_feed_forward_in_position_control_comes_from_its_registers(value: int) -> None:
    bench = servo(pid=True, KP=0, KI=0, KD=0, KV=7, KA=3, FEED_FORWARD=value)
    velocity = value - 0x10000 if value & 0x8000 else value
    # The second sample has the velocity, but no acceleration any more.
    first = 2 * 7 * velocity + 32 * 3 * velocity >> 9
    assert respond(bench, [0, 0]) == [first, 2 * 7 * velocity >> 9]


@pytest.mark.spec("MCP-FLT-4", "MCP-REG-47")
def test_feed_forward_of_a_profile_comes_from_the_generator() -> None:
    bench = Bench()
    bench.extended()
    bench.write(0x01, 0x08)
    for name, value in {"KP": 0, "KI": 0, "KD": 0, "KV": 16, "KA": 1, "FEED_FORWARD": 0x7000,
                        "FINAL_POSITION": 100, "PROFILE_VELOCITY": 10,
                        "ACCELERATION": 0x180}.items():  # fmt: skip
        bench.put(name, value)
    bench.write(0x00, 0x08)
    bench.control()
    commands = []
    for _ in range(8):
        bench.samples(1)
        commands.append(bench.probe.mc)
    speeds = [384, 768, 1152, 1536, 1920, 2304, 2560, 2560]
    changes = [384, 384, 384, 384, 384, 384, 256, 0]
    assert commands == [
        2 * 16 * speed + 32 * change >> 9 for speed, change in zip(speeds, changes, strict=True)
    ]


@pytest.mark.spec("MCP-FLT-4")
@pytest.mark.parametrize(
    ("code", "speeds"), [(0x0B, [640, 640, 640, 640, 0]), (0x0C, [640, 1280, 1920, 2560, 2560])]
)
def test_feed_forward_of_interpolation(code: int, speeds: list[int]) -> None:
    bench = Bench()
    bench.extended()
    bench.write(0x01, 0x08)
    for name, value in {"KP": 0, "KI": 0, "KD": 0, "KV": 255, "FINAL_POSITION": 10,
                        "VELOCITY": 0x000A00, "INTERPOLATOR_PRESET": 1}.items():  # fmt: skip
        bench.put(name, value)
    bench.write(0x00, code)
    bench.control()
    commands = []
    for _ in range(5):
        bench.samples(1)
        commands.append(bench.probe.mc)
    assert commands == [2 * 255 * speed >> 9 for speed in speeds]


@pytest.mark.spec("MCP-FLT-5", "MCP-MOD-2")
@pytest.mark.parametrize("pid", [False, True])
def test_idle_clears_the_history(pid: bool) -> None:
    bench = servo(pid=pid, KI=200, KA=9, KV=9, FEED_FORWARD=0x0300)
    first = respond(bench, [3, 5, 7])
    bench.write(0x05, 0x01)
    bench.samples(2)
    bench.put("COMMAND_POSITION", 3)
    bench.control()
    assert respond(bench, [3, 5, 7]) == first


@pytest.mark.spec("MCP-RST-4", "MCP-FLT-5")
@pytest.mark.parametrize("pid", [False, True])
def test_a_soft_reset_clears_the_history(pid: bool) -> None:
    bench = servo(pid=pid, KI=200, KA=9, KV=9, FEED_FORWARD=0x0300)
    first = respond(bench, [3, 5, 7])
    bench.write(0x05, 0x00)
    bench.until(bench.sample_start())  # where it begins
    bench.wait(320)
    bench.extended()
    bench.control()
    assert respond(bench, [3, 5, 7]) == first


@pytest.mark.spec("MCP-FLT-6")
def test_switching_the_filter_in_motion_keeps_both_histories() -> None:
    bench = servo()
    respond(bench, [4])
    bench.write(0x01, 0x08)
    assert respond(bench, [2, 2]) == [320, 64]
    bench.write(0x01, 0x00)
    # As if the sample with error 4 had been the last one.
    assert respond(bench, [0]) == [-((4 * 229 * 64 * 4 + 64 * 1024) >> 8)]


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(*[st.integers(0, 255)] * 3),
    st.lists(st.tuples(st.integers(-3000, 3000), st.integers(0, 0x7FFF)), min_size=1, max_size=8),
)
@pytest.mark.spec("MCP-FLT-3")
def test_the_pid_filter_is_its_equation(
    gains: tuple[int, ...], course: list[tuple[int, int]]
) -> None:
    kp, ki, kd = gains
    bench = servo(pid=True, KP=kp, KI=ki, KD=kd)
    integral = old = 0
    saturated = False
    for error, limit in course:
        if not saturated:
            integral += error
        integral = max(-limit, min(limit, integral))
        steps = (
            Fraction(kp * error, 32)
            + Fraction(ki * integral, 8192)
            + Fraction(kd * (error - old), 8)
        )
        command = floor(16 * steps)
        old = error
        saturated = not -2048 <= command <= 2047
        bench.put("INTEGRAL_LIMIT", limit)
        assert respond(bench, [error]) == [command]
