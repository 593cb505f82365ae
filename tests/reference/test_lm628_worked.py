"""The reference model of the LM628 against cases that were worked out by hand."""

import pytest

from tests.reference.lm628 import LM628

STT, UDF, PORT12 = 0x01, 0x04, 0x06
RDDV, RDDP, RDRP, RDSIGS, RDSUM = 0x07, 0x08, 0x0A, 0x0C, 0x0D
LPES, MSKI, RSTI, LFIL, LTRJ, SBPA, SBPR = 0x1A, 0x1C, 0x1D, 0x1E, 0x1F, 0x20, 0x21


class Driven(LM628):
    """The model with whole packets, and an encoder that stands at :attr:`at`."""

    def __init__(self, **settings: str) -> None:
        super().__init__(**settings)
        self.at = 0

    def packet(self, code: int, *words: int) -> None:
        self.command(code)
        for word in words:
            assert not self.write(word >> 8)
            assert self.write(word & 0xFF)

    def ask(self, code: int) -> int:
        self.command(code)
        value = bytes(self.read()[0] for _ in range(len(self.to_read)))
        return int.from_bytes(value, "big", signed=code != RDSIGS)

    def trajectory(self, control: int, *longs: int) -> None:
        words = (half for value in longs for half in (value >> 16 & 0xFFFF, value & 0xFFFF))
        self.packet(LTRJ, control, *words)

    def move(self, control: int, *longs: int) -> None:
        self.trajectory(control, *longs)
        self.packet(STT)

    def run(self, samples: int) -> None:
        for _ in range(samples):
            self.sample(self.at)

    def step(self) -> tuple[int, int]:
        """Run a sample; return desired position and velocity."""
        self.run(1)
        return self.ask(RDDP), self.ask(RDDV)


@pytest.mark.spec("LM-T-4", "LM-TRJ-12")
def test_a_move_of_100_turns() -> None:
    chip = Driven()
    chip.move(0x2A, 15, 446956, 200000)
    course = [chip.step() for _ in range(59121)]
    assert max(course, key=lambda place: place[1]) == course[29559] == (100001, 443400)
    assert course[-2] == (199999, 15)
    assert course[-1] == (200000, 0)
    assert chip.on_target
    assert chip.status() & 0x04


@pytest.mark.spec("LM-T-5", "LM-TRJ-12", "LM-STA-5")
def test_a_move_of_20_counts() -> None:
    chip = Driven()
    chip.move(0x2A, 0x10000, 0x40000, 20)
    places = []
    while not chip.on_target:
        places.append(chip.step()[0])
    assert places == [1, 3, 6, 10, 14, 17, 19, 20]
    assert chip.ask(RDDV) == 0


@pytest.mark.spec("LM-T-6", "LM-TRJ-12")
def test_a_move_that_does_not_divide_evenly() -> None:
    chip = Driven()
    chip.move(0x2A, 0x8000, 0x28000, 11)
    places, speeds = zip(*(chip.step() for _ in range(9)), strict=True)
    assert places == (0, 1, 3, 5, 7, 8, 9, 10, 11)
    # In the last sample it comes to rest on the target: its step of 8000h is not left standing.
    assert [f"{speed:X}" for speed in speeds] == [
        "8000", "10000", "18000", "20000", "20000", "18000", "10000", "10000", "0",
    ]  # fmt: skip
    assert chip.on_target


@pytest.mark.spec("LM-T-7", "LM-RST-5", "LM-RST-6", "LM-RST-7")
@pytest.mark.parametrize(("status", "first", "then"), [("84", 0x84, 0x80), ("C4", 0xC4, 0xC0)])
def test_reset_as_drivers_check_it(status: str, first: int, then: int) -> None:
    chip = Driven(reset_status=status)
    assert chip.status() == first
    assert chip.ask(RDSIGS) == 0x8100 | first
    chip.packet(RSTI, 0)
    assert chip.status() == then
    assert chip.ask(RDSIGS) == 0x0100 | then
    chip.packet(SBPA, 0, 5)
    chip.packet(RSTI, 0)
    assert chip.status() == 0x80


def held(chip: Driven, port12: bool = False) -> None:
    """Hold position 0 from the sample that comes now, with what LFIL has loaded."""
    chip.packet(UDF)
    if port12:
        chip.packet(PORT12)
    chip.packet(STT)
    chip.run(1)


@pytest.mark.spec("LM-T-8", "LM-PID-3", "LM-PID-4", "LM-PID-5", "LM-PID-7", "LM-PID-8")
@pytest.mark.parametrize(
    ("port12", "codes"),
    [
        (False, [0x80, 0x85, 0x88, 0x8C, 0x8B, 0x79, 0x00]),
        (True, [0x800, 0x851, 0x88F, 0x8CE, 0x8BB, 0x79F, 0x000]),
    ],
)
def test_filter_seven_samples(port12: bool, codes: list[int]) -> None:
    chip = Driven()
    chip.packet(LFIL, 0x000F, 100, 50, 30, 2000)
    held(chip, port12)
    commands, put_out = [], []
    for error in (0, 10, 20, 30, 30, -5, -400):
        chip.sample(-error)
        commands.append(chip.motor_command)
        put_out.append(chip.code)
    assert commands == [0, 1300, 2300, 3300, 3000, -1550, -32768]
    assert put_out == codes


@pytest.mark.spec("LM-T-9", "LM-PID-5")
def test_integration_limit_of_a_held_error() -> None:
    chip = Driven(integral_limit="term")
    chip.packet(LFIL, 0x0005, 20, 50)
    held(chip)
    terms, sums = [], []
    for _ in range(5):
        chip.sample(-300)
        terms.append(chip.ask(RDSUM))
        sums.append(chip.sum)
    assert terms == [20, 40, 50, 50, 50]
    assert sums == [300, 600, 600, 600, 600]
    assert chip.motor_command == 50


@pytest.mark.spec("LM-PID-5", "LM-AMB-9")
def test_the_summation_is_limited_and_read_as_added_where_it_passes_the_limit() -> None:
    chip = Driven()
    chip.packet(LFIL, 0x0005, 20, 3)
    held(chip)
    seen = []
    for error in (300, 300, 300, 900, 300, -600, -1200, -300):
        chip.sample(-error)
        seen.append((chip.ask(RDSUM), chip.motor_command, chip.sum))
    assert seen == [
        (1, 20, 300), (2, 40, 600), (3, 60, 900), (7, 60, 900), (3, 60, 900),
        (1, 20, 300), (-4, -60, 300), (0, 0, 0),
    ]  # fmt: skip


@pytest.mark.spec("LM-T-10", "LM-PID-3")
def test_derivative_of_four_samples() -> None:
    chip = Driven()
    chip.packet(LFIL, 0x0302, 100)
    held(chip)
    commands = []
    for error in range(1, 9):
        chip.sample(-error)
        commands.append(chip.motor_command)
    assert commands == [0, 0, 0, 400, 400, 400, 400, 400]


@pytest.mark.spec("LM-T-11", "LM-POS-2")
def test_position_wraps() -> None:
    chip = Driven()
    chip.packet(RSTI, 0)
    chip.sample(0x3FFFFFFF)
    assert chip.ask(RDRP) == 0x3FFFFFFF
    assert chip.status() == 0x80
    chip.sample(0x40000000)
    assert chip.ask(RDRP) == -0x40000000
    assert chip.status() == 0x90


@pytest.mark.spec("LM-T-12", "LM-STA-7")
def test_mask_and_hi() -> None:
    chip = Driven()
    assert chip.hi()
    chip.packet(MSKI, 0)
    assert not chip.hi()
    chip.packet(MSKI, 0x0004)
    assert chip.hi()


@pytest.mark.spec("LM-T-14", "LM-TRJ-4")
def test_acceleration_changed_in_motion() -> None:
    chip = Driven()
    chip.packet(RSTI, 0)
    chip.move(0x2A, 0x100, 0x10000, 1000)
    chip.run(10)
    chip.move(0x20, 0x200)
    chip.run(1)
    assert chip.ask(RDDV) == 0x100 * 11
    assert chip.ask(RDSIGS) == 0xC102
    chip.move(0x0100)
    chip.run(1)
    assert chip.status() == 0x86
    chip.move(0x28, 0x300, 0x10000)
    chip.run(1)
    assert chip.ask(RDDV) == 0x300
    assert chip.ask(RDSIGS) == 0x8106


@pytest.mark.spec("LM-TRJ-3", "LM-TRJ-9", "LM-TRJ-13", "LM-AMB-5")
@pytest.mark.parametrize("buffered", [None, 7000])
def test_relative_values_count_from_the_smooth_stop(buffered: int | None) -> None:
    chip = Driven()
    chip.move(0x182A, 0x4000, 0xA0000, 0)
    chip.run(60)
    if buffered is not None:
        chip.trajectory(0x1802, buffered)
    chip.move(0x1C00)
    chip.run(2)
    assert chip.ask(RDDP) == 424
    chip.move(0x0003, 100)
    chip.run(100)
    assert chip.ask(RDDP) == 524


@pytest.mark.spec("LM-CMD-22", "LM-AMB-5")
def test_a_relative_breakpoint_counts_from_the_smooth_stop() -> None:
    chip = Driven()
    chip.move(0x182A, 0x4000, 0xA0000, 0)
    chip.run(60)
    chip.move(0x1C00)
    chip.run(2)
    chip.packet(SBPR, 0, 40)
    assert chip.breakpoint == 424 + 40


@pytest.mark.spec("LM-TRJ-5", "LM-TRJ-10")
def test_a_stop_leaves_a_buffered_position_buffered() -> None:
    chip = Driven()
    chip.move(0x2A, 0x10000, 0x40000, 20)
    chip.run(20)
    chip.trajectory(0x0002, 50)
    chip.move(0x0100)
    chip.run(1)
    chip.packet(SBPR, 0, 1)
    assert chip.breakpoint == 21
    chip.packet(STT)
    chip.run(60)
    assert chip.ask(RDDP) == 50


@pytest.mark.spec("LM-CMD-5")
def test_udf_takes_what_is_loaded_when_it_is_executed() -> None:
    chip = Driven()
    chip.packet(LFIL, 0x0008, 200)
    held(chip)
    chip.packet(LFIL, 0x0008, 1000)
    chip.sample(-1)
    assert chip.motor_command == 200
    chip.packet(UDF)
    chip.sample(-1)
    assert chip.motor_command == 1000


@pytest.mark.spec("LM-CMD-15", "LM-POS-6")
def test_an_excessive_error_stops_the_motor_in_the_same_sample() -> None:
    chip = Driven()
    chip.packet(RSTI, 0)
    chip.packet(LFIL, 0x0008, 100)
    chip.packet(LPES, 10)
    held(chip)
    chip.sample(-10)
    assert (chip.status(), chip.motor_command) == (0x04, 1000)
    chip.packet(RSTI, 0)
    chip.sample(-11)
    assert (chip.status(), chip.motor_command) == (0xA0, 0)
