"""The reference model of the MCP-1200 against cases that were worked out by hand."""

import pytest

from tests.reference.mcp1200 import Reference

FLAG, FEATURE, CONFIG, MODE = 0x00, 0x01, 0x02, 0x05
PROFILE, POSITION_INTERPOLATION, VELOCITY_INTERPOLATION, INTEGRAL_VELOCITY = 8, 11, 12, 13
FINAL, ACCELERATION, JERK = (0x2B, 0x2A, 0x29), (0x27, 0x26), (0x55, 0x54)
COMMAND, VELOCITY, BREAK = (0x0C, 0x0D, 0x0E), (0x23, 0x24, 0x25), (0x3F, 0x3E, 0x3D)


class Driven(Reference):
    """The model with whole registers and samples; it addresses all 128 registers."""

    def __init__(self) -> None:
        super().__init__()
        self.write(CONFIG, 0x01)

    def put(self, addresses: tuple[int, ...], value: int) -> None:
        for place, address in enumerate(reversed(addresses)):
            self.r[address] = value >> 8 * place & 0xFF
        self.write(addresses[-1], value & 0xFF)

    def get(self, *addresses: int) -> int:
        value = 0
        for address in addresses:
            value = value << 8 | self.read(address, self.started)
        return value

    def sample(self) -> int:
        """Run a sample; return the command position."""
        if self.start():
            self.results()
        return self.command

    def course(self, samples: int) -> list[int]:
        return [self.sample() for _ in range(samples)]

    def begin(self, flag: int) -> None:
        self.write(FLAG, flag)
        self.write(MODE, 3)

    def motor(self, error: int) -> int:
        """Run a sample with this position error; return the PWM command, 12 bits."""
        self.put(COMMAND, self.actual + error)
        self.sample()
        word = self.get(0x09, 0x4D) >> 4
        return word - 0x1000 if word & 0x800 else word


@pytest.mark.spec("MCP-T-1", "MCP-T-2", "MCP-T-3", "MCP-T-4", "MCP-SMP-1")
@pytest.mark.parametrize(
    ("prescaler", "timer", "clocks"),
    [(0x3F, 0x40, 4160), (0x3F, 0x26, 2496), (0x27, 0x3B, 2400), (0x3F, 0x3B, 3840),
     (0x8235, 0x3B, 2_000_040), (0xC34F, 0x4F, 4_000_000)],
)  # fmt: skip
def test_sample_periods(prescaler: int, timer: int, clocks: int) -> None:
    chip = Driven()
    chip.put((0x10, 0x11), prescaler)
    chip.write(0x0F, timer)
    chip.sample()
    assert chip.period == clocks


@pytest.mark.spec("MCP-T-8", "MCP-FLT-2")
def test_the_lead_filter_of_the_defaults() -> None:
    chip = Driven()
    chip.write(MODE, 3)
    motors = [chip.motor(error) for error in (1, 1, 1, 1, 0, 0, -3)]
    assert motors == [256, -37, 37, 18, -233, 59, -782]
    assert chip.motor(10) == 2047


@pytest.mark.spec("MCP-T-9", "MCP-FLT-3")
def test_the_pid_filter_of_the_defaults() -> None:
    chip = Driven()
    chip.write(FEATURE, 0x08)
    chip.write(MODE, 3)
    motors = [chip.motor(error) for error in (1, 1, 2, 2, 2, -3)]
    assert motors == [160, 32, 192, 64, 64, -736]


@pytest.mark.spec("MCP-T-7", "MCP-OUT-1")
def test_codes_of_a_saturated_dac() -> None:
    chip = Driven()
    chip.write(0x4B, 0xE7)
    assert [chip.dac(motor) for motor in (2048, -2049)] == [0xE70, 0x180]
    chip.write(0x4B, 0xF0)
    assert [chip.dac(motor) for motor in (2048, -2049, 0x7E0)] == [0xF00, 0x0F0, 0xFE0]


@pytest.mark.spec("MCP-T-10", "MCP-T-19", "MCP-TRP-2", "MCP-TRP-8")
def test_a_trapezoid_of_100_counts() -> None:
    chip = Driven()
    chip.put(FINAL, 100)
    chip.put(ACCELERATION, 0x180)
    chip.write(0x28, 10)
    chip.begin(PROFILE)
    course = [1, 4, 9, 15, 22, 31, 41, 51, 61, 71, 80, 87, 92, 96, 99]
    assert chip.course(15) == course
    assert chip.r[FLAG] & 1
    assert chip.sample() == 100
    assert not chip.r[FLAG] & 1
    assert (chip.get(0x33, 0x32, 0x31), chip.get(0x3B, 0x3A, 0x39)) == (41, 71)


@pytest.mark.spec("MCP-T-11", "MCP-SCV-1", "MCP-SCV-2", "MCP-SCV-5")
def test_an_s_curve_of_1000_counts() -> None:
    chip = Driven()
    chip.write(FEATURE, 0x10)
    chip.put(FINAL, 1000)
    chip.put(ACCELERATION, 0x80)
    chip.put(JERK, 0x2000)
    chip.write(0x28, 10)
    chip.begin(PROFILE)
    course = chip.course(122)
    assert course[:12] == [0, 0, 1, 2, 4, 6, 9, 12, 16, 20, 25, 30]
    assert (course[23], course[120] < 1000, course[121]) == (130, True, 1000)
    assert (chip.get(0x33, 0x32, 0x31), chip.get(0x3B, 0x3A, 0x39)) == (130, 890)
    assert chip.r[FLAG] == 0


@pytest.mark.spec("MCP-T-12", "MCP-VEL-1")
def test_integral_velocity_there_and_back() -> None:
    chip = Driven()
    chip.put(ACCELERATION, 0x80)
    chip.write(0x3C, 3)
    chip.begin(INTEGRAL_VELOCITY)
    course = chip.course(10)
    chip.write(0x3C, 0xFE)
    course += chip.course(10)
    assert course == [
        0, 1, 3, 5, 7, 10, 13, 16, 19, 22, 25, 27, 28, 29, 30, 30, 29, 28, 27, 25,
    ]  # fmt: skip


@pytest.mark.spec("MCP-T-13", "MCP-INT-1")
def test_position_interpolation_over_eight_samples() -> None:
    chip = Driven()
    chip.write(0x18, 2)
    chip.put(FINAL, 100)
    chip.begin(POSITION_INTERPOLATION)
    assert chip.course(8) == [12, 25, 37, 50, 62, 75, 87, 100]


@pytest.mark.spec("MCP-T-14", "MCP-INT-5")
def test_velocity_interpolation_over_eight_samples() -> None:
    chip = Driven()
    chip.write(0x18, 2)
    chip.put(VELOCITY, 0x400)
    chip.begin(VELOCITY_INTERPOLATION)
    assert chip.course(8) == [0, 1, 3, 5, 7, 10, 14, 18]
    assert chip.velocity == 0x400


@pytest.mark.spec("MCP-T-15", "MCP-BRK-2", "MCP-BRK-3")
def test_breakpoints_at_15000_and_every_2500_from_there() -> None:
    chip = Driven()
    chip.put(BREAK, 15000)
    chip.write(CONFIG, 0x11)
    chip.sample()
    chip.write(0x07, 0)
    chip.write(CONFIG, 0x31)
    chip.put(BREAK, 2500)
    falls = []
    for _ in range(230):
        for _ in range(100):
            before = chip.trig
            chip.count(1)
            if before and not chip.trig:
                falls.append(chip.actual)
        chip.sample()
    assert falls == [15000, 17500, 20000, 22500]


@pytest.mark.spec("MCP-T-16", "MCP-ERR-3", "MCP-STA-4")
def test_a_deadband_of_two_counts() -> None:
    chip = Driven()
    chip.write(0x45, 2)
    chip.write(MODE, 3)
    chip.put(COMMAND, 1000)
    driven, in_position = [], []
    for place in range(995, 1006):
        chip.preset(place)
        chip.sample()
        driven += [place] * bool(chip.get(0x2D, 0x2C))
        in_position += [place] * bool(chip.r[0x07] & 4)
    assert driven == [995, 996, 997, 1003, 1004, 1005]
    assert in_position == [*range(997, 1004)]


@pytest.mark.spec("MCP-T-20", "MCP-FLG-1", "MCP-FLG-2")
def test_flags_by_number() -> None:
    chip = Driven()
    assert chip.r[FLAG] == 0x02
    shown = []
    for data in (0x08, 0x0B, 0x0C, 0x0D, 0x0A):
        chip.write(FLAG, data)
        shown.append(chip.r[FLAG])
    assert shown == [0x03, 0x0B, 0x1B, 0x3B, 0x3B]


@pytest.mark.spec("MCP-T-21", "MCP-STA-2", "MCP-EXC-4")
def test_the_limit_flag_clears_once_the_pin_is_high() -> None:
    chip = Driven()
    chip.pin("/LIMIT", 0, 0)
    chip.write(0x07, 0)
    assert chip.r[0x07] == 0x78
    chip.pin("/LIMIT", 1, 0)
    assert chip.r[0x07] == 0x78
    chip.write(0x07, 0)
    assert chip.r[0x07] == 0xF8


@pytest.mark.spec("MCP-T-22", "MCP-BUS-9")
def test_six_or_seven_bits_of_address() -> None:
    chip = Reference()
    chip.write(0x4B, 5)
    assert (chip.r[0x0B], chip.r[0x4B]) == (5, 0xF0)
    chip.write(CONFIG, 1)
    chip.write(0x4B, 6)
    assert (chip.r[0x0B], chip.r[0x4B]) == (5, 6)
