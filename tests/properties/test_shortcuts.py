"""What is computed the short way is, bit for bit, what the long way gives."""

from hypothesis import example, given, settings
from hypothesis import strategies as st

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.mc1241a.microstep import STEPS, Microstepper
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.registers import RegisterFile, SampledRegisters
from vbus.core.state import load, save
from vbus.plant.angle import sine
from vbus.plant.dc_motor import DcMotor

# -- mechanics ---------------------------------------------------------------------------------


@given(turns=st.floats(-60, 60) | st.integers(-8, 8).map(float) | st.floats(0, 7))
@example(turns=-0.0)
@example(turns=0.9999999999999999)
@example(turns=5.999999999999999)
@example(turns=6.0)
def test_whole_turns_do_not_change_a_bit_of_the_sine(turns: float) -> None:
    part = turns - int(turns)
    if part < 0.0:
        part += 1.0
    assert sine(turns) == sine(part) or part == 1.0


PERIODS = st.sampled_from([256e-6, 100e-6, 31e-6])


@given(
    course=st.lists(
        st.tuples(PERIODS, st.floats(-1, 1), st.sampled_from([0, 0, 0, 1])), min_size=1, max_size=30
    ),
)
def test_periods_that_come_back_are_prepared_as_if_they_were_new(
    course: list[tuple[float, float, int]],
) -> None:
    motor = DcMotor()
    inertia = 5e-6
    for period, command, changed in course:
        if changed:
            # As faults do it: another inertia from here on.
            inertia *= 1.5
            motor.inertia = inertia
            motor._solve()
        fresh = DcMotor({"inertia": inertia})
        load(fresh, save(motor))
        motor.prepare(period)
        fresh.prepare(period)
        assert motor.drive(command, 0) == fresh.drive(command, 0)
        assert save(motor) == save(fresh)


# -- MC1241A ------------------------------------------------------------------------------------


@given(
    start=st.integers(-(1 << 70), 1 << 70),
    moved=st.integers(-(1 << 62), 1 << 62) | st.integers(-(1 << 36), 1 << 36),
    slot=st.integers(1, 8),
)
def test_the_angle_of_a_slot_is_that_of_unbounded_numbers(
    start: int, moved: int, slot: int
) -> None:
    stepper = Microstepper(True)
    stepper.begin_cycle(start, moved)
    assert stepper.angle(slot) == ((8 * start + moved * slot) >> 35) % STEPS


# -- MCP-1200 -----------------------------------------------------------------------------------


IMAGES = st.binary(min_size=ds.REGISTERS.size, max_size=ds.REGISTERS.size)


@given(content=IMAGES)
def test_velocities_are_what_the_registers_of_one_resolution_say(content: bytes) -> None:
    sampled = SampledRegisters()
    sampled.image = content
    assert sampled.accel == (content[0x27] & 0x7F) << 8 | content[0x26]
    if content[0x01] & ds.HIGH_RESOLUTION:
        velocity = int.from_bytes(content[0x23:0x26], "big", signed=True)
        assert (sampled.velocity_goal, sampled.top_velocity) == (velocity, abs(velocity))
    else:
        velocity = int.from_bytes(content[0x3C:0x3D], "big", signed=True)
        assert sampled.velocity_goal == 256 * velocity
        assert sampled.top_velocity == (content[0x28] & 0x7F) << 8


@given(dac=st.integers(0, 0xFFF), pwm=st.integers(-0x800, 0x7FF))
def test_outputs_are_in_the_registers_what_was_put_out(dac: int, pwm: int) -> None:
    registers = RegisterFile()
    registers.drive(dac, pwm)
    assert (registers.dac, registers.pwm) == (dac, pwm)
    assert registers.image[0x08:0x0A] == bytes((dac >> 4, pwm >> 4 & 0xFF))
    assert registers.image[0x4C:0x4E] == bytes((dac << 4 & 0xF0, pwm << 4 & 0xF0))


@given(
    stored=st.lists(
        st.lists(st.tuples(st.integers(0, ds.REGISTERS.size - 1), st.integers(0, 255)), max_size=3),
        min_size=1, max_size=8,
    ),
    loaded=st.lists(IMAGES | st.none(), min_size=8, max_size=8),
    dac=st.integers(0, 0xFFF),
)  # fmt: skip
def test_a_sample_computes_from_the_registers_as_they_are_when_it_begins(
    stored: list[list[tuple[int, int]]], loaded: list[bytes | None], dac: int
) -> None:
    registers = RegisterFile()
    for written, image in zip(stored, loaded, strict=False):
        if image is not None:
            registers.image = image
        for address, data in written:
            registers.put(address, data)
        registers.drive(dac, -dac // 2)
        registers.sample()
        assert registers.sampled.image == registers.image
        dac ^= 0x5A5
        registers.drive(dac, dac // 2)
        registers.sample()
        assert registers.sampled.image == registers.image
    registers.reset()
    registers.sample()
    assert registers.sampled.image == registers.image


FLAGS = st.sampled_from([0x08, 0x0B, 0x0C, 0x0D, 0x00, 0x03, 0x04, 0x05])
FEATURE, KP, MODE = (ds.REGISTERS[name].low for name in ("FEATURE", "KP", "MODE"))
LAST_BYTES = [
    ds.REGISTERS[name].low
    for name in (
        "FEATURE", "CAPTURE_CONTROL", "EXCEPTION", "COMMAND_INCREMENT", "COMMAND_POSITION",
        "VELOCITY_COMMAND", "VELOCITY", "FINAL_POSITION", "ACCELERATION", "PROFILE_VELOCITY",
        "BACKLASH", "DEADBAND", "FORCED_EXCEPTION", "MAX_ERROR", "KP", "KD", "LEAD_GAIN",
        "SATURATION", "DAC_OFFSET", "ENCODER_PWM", "PWM_COMMAND", "BREAKPOINT",
    )
]  # fmt: skip
WRITES = st.one_of(
    st.tuples(st.just(ds.FLAG), FLAGS),
    st.tuples(st.just(MODE), st.sampled_from([1, 2, 3, 3, 3])),
    st.tuples(st.sampled_from(LAST_BYTES), st.integers(0, 255)),
    st.tuples(st.just(ds.CONFIG), st.integers(0, 127).map(lambda value: 2 * value | 1)),
)


def board() -> Board:
    return load_board_text(
        '[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\n'
        'part = "MCP-1200"\nclock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "dc_motor"\n'
    )


@settings(deadline=None, max_examples=60)
@given(
    host=st.lists(st.tuples(WRITES, st.integers(0, 3_000_000_000)), min_size=1, max_size=12),
    gap=st.integers(1_000_000, 900_000_000),
)
def test_samples_in_one_go_leave_what_samples_looked_at_one_by_one_do(
    host: list[tuple[tuple[int, int], int]], gap: int
) -> None:
    whole, looked_at = board(), board()
    for made in (whole, looked_at):
        port = made.open_port("h")
        for register, value in ((ds.CONFIG, 1), (FEATURE, 8), (KP, 20), (MODE, 3)):
            port.write(register, value)
            port.delay(600_000_000)
        for (register, value), span in host:
            port.write(register, value)
            if made is whole:
                made.run_for(span)
                continue
            until = made.now + span
            while made.now < until:
                made.run_for(min(gap, until - made.now))
                # What a host sees, in the middle of a sample or not.
                made.chips[0].telemetry()
    # The whole run owes its pins the last sample until it is asked.
    whole.catch_up()
    looked_at.catch_up()
    assert save(whole) == save(looked_at)
    assert whole.state_hash() == looked_at.state_hash()
