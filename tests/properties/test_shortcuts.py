"""What is computed the short way is, bit for bit, what the long way gives."""

from hypothesis import example, given, settings
from hypothesis import strategies as st

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.mc1241a.microstep import STEPS, Microstepper
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.picture import Picture
from vbus.chips.mcp1200.sheet import Sheet
from vbus.chips.mcp1200.shown import Shown
from vbus.chips.registers import RegisterFile
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
    )
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
            motor._inertia = inertia
            motor._divide(motor._substeps)
        fresh = DcMotor({"inertia": inertia})
        fresh.load(motor.save())
        motor.prepare(period)
        fresh.prepare(period)
        assert motor.drive(command, 0) == fresh.drive(command, 0)
        assert motor.save() == fresh.save()


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


def registers(content: bytes) -> RegisterFile:
    file = RegisterFile(ds.REGISTERS)
    file.bytes[:] = content
    # The low halves of these do not exist.
    file.bytes[ds.MOTOR_COMMAND_LOW] &= 0xF0
    file.bytes[ds.PWM_FRACTION] &= 0xF0
    return file


IMAGES = st.binary(min_size=ds.REGISTERS.size, max_size=ds.REGISTERS.size)


@given(content=IMAGES)
def test_what_samples_show_goes_back_into_the_registers_as_it_was(content: bytes) -> None:
    file = registers(content)
    before = bytes(file.bytes)
    shown, again = Shown(), Shown()
    shown.load(before)
    again.copy(shown)
    again.store(file.bytes)
    assert bytes(file.bytes) == before


@given(content=IMAGES)
def test_a_picture_says_what_the_registers_say(content: bytes) -> None:
    file = registers(content)
    data = file.bytes
    picture = Picture()
    picture.take(bytes(file.bytes))
    assert picture.command == file.value("COMMAND_POSITION")
    assert picture.final == file.value("FINAL_POSITION")
    assert picture.max_error == file.value("MAX_ERROR")
    assert picture.jerk == data[ds.JERK_MSB] << 8 | data[ds.JERK_LSB]
    assert picture.accel == (data[ds.ACCEL_MSB] & 0x7F) << 8 | data[ds.ACCEL_LSB]
    assert (picture.kp, picture.ki, picture.kd) == (data[ds.KP], data[ds.KI], data[ds.KD])
    assert abs(picture.goal) <= 1 << 23
    if data[ds.FEATURE] & ds.HIGH_RESOLUTION:
        assert picture.top == abs(picture.goal)
    else:
        assert picture.top == (data[ds.PROFILE_VELOCITY] & 0x7F) << 8
        assert picture.goal % 256 == 0


@given(
    content=IMAGES,
    acts=st.lists(
        st.tuples(st.sampled_from(["sample", "results", "host"]), st.integers(0, 255)), max_size=20
    ),
)
def test_registers_kept_in_words_are_at_any_time_what_bytes_would_be(
    content: bytes, acts: list[tuple[str, int]]
) -> None:
    file, model = registers(content), registers(content)
    sheet = Sheet(file)
    begun = sheet.image
    for act, value in acts:
        if act == "sample":
            sheet.take_picture()
            sheet.keep()
            begun = bytes(model.bytes)
            assert sheet.picture.flag == begun[ds.FLAG]
            assert sheet.picture.kp == begun[ds.KP]
            assert sheet.picture.command == model.value("COMMAND_POSITION")
        elif act == "results":
            sheet.write_on()
            expected = Shown()
            expected.load(bytes(model.bytes))
            for shown in (sheet.shown, expected):
                shown.status = value
                shown.command = value << 9
                shown.dac = value << 4
                shown.velocity = -value
            expected.store(model.bytes)
        else:
            sheet.settle()
            assert bytes(file.bytes) == bytes(model.bytes)
            for each in (file, model):
                each.bytes[ds.KP] = value
                each.bytes[ds.FLAG] = value
        assert sheet.image == begun
    sheet.settle()
    assert bytes(file.bytes) == bytes(model.bytes)


FLAGS = st.sampled_from([0x08, 0x0B, 0x0C, 0x0D, 0x00, 0x03, 0x04, 0x05])
WRITES = st.one_of(
    st.tuples(st.just(ds.FLAG), FLAGS),
    st.tuples(st.just(ds.MODE), st.sampled_from([1, 2, 3, 3, 3])),
    st.tuples(
        st.sampled_from(
            [ds.FEATURE, ds.CAPTURE_CONTROL, ds.EXCEPTION, ds.COMMAND_INCREMENT, ds.COMMAND_LSB,
             ds.VELOCITY_COMMAND, ds.VELOCITY_LSB, ds.FINAL_LSB, ds.ACCEL_LSB, ds.PROFILE_VELOCITY,
             ds.BACKLASH, ds.DEADBAND, ds.FORCED_EXCEPTION, ds.MAX_ERROR_LSB, ds.KP, ds.KD,
             ds.LEAD_GAIN, ds.SATURATION, ds.DAC_OFFSET, ds.ENCODER_PWM, ds.PWM_COMMAND,
             ds.BREAK_LSB]
        ),
        st.integers(0, 255),
    ),
    st.tuples(st.just(ds.CONFIG), st.integers(0, 127).map(lambda value: 2 * value | 1)),
)  # fmt: skip


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
        for register, value in ((ds.CONFIG, 1), (ds.FEATURE, 8), (ds.KP, 20), (ds.MODE, 3)):
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
    assert whole.save() == looked_at.save()
    assert whole.state_hash() == looked_at.state_hash()
