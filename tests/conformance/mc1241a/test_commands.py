"""The command table, row by row, and plain parameters (PMD-CMD, PMD-VER)."""

from collections.abc import Iterator

import pytest

from tests.conformance.mc1241a.conftest import Bench, words
from vbus.chips.mc1241a.datasheet import COMMANDS, VALUES
from vbus.chips.mc1241a.packets import Mc1241aDecoder

spec = pytest.mark.spec

SUMMARY = """
SET_1 01 1r | SET_2 02 1r | SET_I 08 1r
SET_PRFL_S_CRV 0B 0 | SET_PRFL_TRAP 09 0 | SET_PRFL_VEL 0A 0 | SET_PRFL_GEAR 0C 0
SET_POS 10 2w | SET_VEL 11 2w | SET_ACC 12 2w | SET_MAX_ACC 15 1w | SET_JERK 13 2w
SET_RATIO 14 2w | SET_START_VEL 6A 2w | STOP 46 0 | SMOOTH_STOP 4E 0 | SYNCH_PRFL 47 0
GET_POS 4A 2r | GET_VEL 4B 2r | GET_ACC 4C 2r | GET_MAX_ACC 4F 1r | GET_JERK 58 2r
GET_RATIO 59 2r | GET_START_VEL 6B 2r | GET_TRGT_POS 1D 2r | GET_TRGT_VEL 1E 2r
SET_TIME_BRK 17 0 | SET_POS_BRK 18 0 | SET_NEG_BRK 19 0 | SET_ACTL_POS_BRK 1B 0
SET_ACTL_NEG_BRK 1C 0 | SET_MTN_CMPLT_BRK 35 0 | SET_EXT_BRK 5E 0 | SET_BRK_OFF 6D 0
SET_BRK_PNT 16 2w | UPDATE 1A 0 | MULTI_UPDATE 5B 1w | SET_AUTO_UPDATE_ON 5C 0
SET_AUTO_UPDATE_OFF 5D 0 | GET_BRK_PNT 57 2r
SET_INTRPT_MASK 2F 1w | GET_INTRPT 30 1r | RST_INTRPT 32 1w | GET_INTRPT_MASK 56 1r
CLR_STATUS 33 0 | RST_STATUS 34 1w | GET_STATUS 31 1r | GET_MODE 48 1r
GET_ACTL_POS 37 2r | SET_CAPT_INDEX 64 0 | SET_CAPT_HOME 65 0 | GET_CAPT 36 2r
SET_STEP_RATIO 68 1w | GET_STEP_RATIO 6F 1r | SET_AUTO_STOP_ON 45 0 | SET_AUTO_STOP_OFF 44 0
SET_POS_ERR 29 1w | GET_POS_ERR 55 1r | GET_ACTL_POS_ERR 60 1r
SET_OUTPUT_PWM 3C 0 | SET_OUTPUT_DAC16 3B 0 | MTR_ON 43 0 | MTR_OFF 42 0 | SET_MTR_CMD 62 1w
GET_MTR_CMD 3A 1r | SET_BUF_MTR_CMD 77 1w | GET_BUF_MTR_CMD 69 1r | GET_OUTPUT_MODE 6E 1r
SET_ACTL_POS 4D 2w | SET_LMT_SENSE 66 1w | GET_LMT_SWTCH 67 1r | LMTS_ON 70 0 | LMTS_OFF 71 0
GET_HOME 05 1r | RESET 39 0 | GET_VRSN 6C 1r | GET_TIME 3E 2r
SET_PHASE_2 74 0 | SET_PHASE_3 73 0 | GET_PHASE_INFO 7F 1r
"""


def _summary() -> Iterator[tuple[str, int, int, int]]:
    for cell in SUMMARY.replace("\n", "|").split("|"):
        if cell.strip():
            name, code, data = cell.split()
            count = int(data[0])
            yield name, int(code, 16), count * data.endswith("w"), count * data.endswith("r")


@spec("PMD-CMD-81", "PMD-AMB-10")
def test_the_table_has_the_80_rows_of_the_manual() -> None:
    assert [(r.name, r.code, r.write, r.read) for r in COMMANDS] == list(_summary())
    assert len(COMMANDS) == 80


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, marks=spec(f"PMD-CMD-{n}"), id=row[0])
        for n, row in enumerate(_summary(), 1)
    ],
)
def test_a_row_of_the_table_is_the_manual_s(row: tuple[str, int, int, int]) -> None:
    made = COMMANDS[row[0]]
    assert (made.name, made.code, made.write, made.read) == row


@spec("PMD-AMB-14")
def test_each_row_has_its_hook_or_its_parameter(chip: Bench) -> None:
    for row in COMMANDS:
        assert bool(row.hook) != bool(row.parameter), row.name
        assert row.hook or chip.probe.parameter(row) is not None
    names = {row.name for row in COMMANDS}
    assert not names & {"GET_I", "MULTI_AXIS", "SET_POS_ACTL_BRK", "SET_ACCEL", "CLR_PRFL"}


def test_the_clauses_of_the_rows_are_in_the_table_s_order() -> None:
    assert [row.clause for row in COMMANDS] == [f"PMD-CMD-{n}" for n in range(1, 81)]


# -- axis control -----------------------------------------------------------------------------


@spec("PMD-CMD-1", "PMD-CMD-2", "PMD-T-16")
def test_set_1_and_set_2_choose_the_axis_and_return_its_status(bench: Bench) -> None:
    assert bench.send("SET_2") == 0x1300
    assert bench.checksum() == 0x0002 + 0x1300
    bench.load(pos=77)
    assert bench.send("SET_1") == 0x0300
    assert bench.checksum() == 0x0001 + 0x0300
    assert bench.send("GET_POS") == 0
    bench.send("SET_2")
    assert bench.send("GET_POS") == 77


@spec("PMD-CMD-2")
def test_an_mc1141a_stays_on_axis_1() -> None:
    bench = Bench(part="MC1141A")
    bench.load(pos=5)
    assert bench.send("SET_2") == 0x0300
    assert bench.send("GET_POS") == 5
    assert bench.rules() == ["no-such-axis"]
    assert bench.chip.axis_count == 1


# -- plain parameters -------------------------------------------------------------------------

BUFFERED = [
    ("POS", (-(2**30), 2**30 - 1, 0, 1234567)),
    ("VEL", (0, 2**30 - 1, 180224)),
    ("ACC", (0, 2**30 - 1, -127795, -131072)),
    ("MAX_ACC", (0, 32767, 11469)),
    ("JERK", (0, 2**31 - 1, 32212256)),
    ("RATIO", (98304, -746455, 2**31 - 1, -(2**31))),
]


@spec(
    "PMD-CMD-8", "PMD-CMD-9", "PMD-CMD-10", "PMD-CMD-11", "PMD-CMD-12", "PMD-CMD-13",
    "PMD-CMD-18", "PMD-CMD-19", "PMD-CMD-20", "PMD-CMD-21", "PMD-CMD-22", "PMD-CMD-23",
)  # fmt: skip
@pytest.mark.parametrize(("name", "values"), BUFFERED)
def test_buffered_registers_read_back_at_once_and_act_at_an_update(
    chip: Bench, name: str, values: tuple[int, ...]
) -> None:
    attribute = {"POS": "position", "VEL": "velocity", "ACC": "acceleration",
                 "MAX_ACC": "max_acceleration", "JERK": "jerk", "RATIO": "ratio"}[name]  # fmt: skip
    axis = chip.probe
    for value in values:
        before = getattr(axis.active, attribute)
        chip.send("SET_" + name, value)
        assert chip.send("GET_" + name) == value
        chip.next_cycle()
        assert getattr(axis.active, attribute) == before
        chip.send("UPDATE")
        chip.send("STOP")
        chip.next_cycle()
        assert getattr(axis.active, attribute) == value
        chip.send("UPDATE")
        chip.next_cycle()
    assert chip.rules("idle-update", "no-rate", "other-profile") == []


@spec("PMD-CMD-70", "PMD-CMD-82")
@pytest.mark.parametrize(("value", "rules"), [(0x000F, []), (0x001F, ["unused-bits"])])
def test_limit_sense_has_four_bits(chip: Bench, value: int, rules: list[str]) -> None:
    chip.send("SET_LMT_SENSE", value)
    assert chip.rules() == rules


@spec("PMD-CMD-14", "PMD-CMD-24", "PMD-AMB-9")
@pytest.mark.parametrize("value", [0, 32768, 2**30 - 1])
def test_start_velocity_is_unsigned_and_acts_at_once(chip: Bench, value: int) -> None:
    chip.send("SET_START_VEL", value)
    assert chip.probe.start_velocity == value
    assert chip.send("GET_START_VEL") == value


@spec("PMD-CMD-35", "PMD-CMD-40")
@pytest.mark.parametrize("value", [0, -1, 2**31 - 1, -(2**31)])
def test_breakpoint_value(chip: Bench, value: int) -> None:
    chip.send("SET_BRK_PNT", value)
    assert chip.send("GET_BRK_PNT") == value
    assert chip.rules() == [], "every 32-bit number is one of some breakpoint"


@spec("PMD-CMD-41", "PMD-CMD-44", "PMD-AMB-12")
def test_interrupt_mask_has_eight_bits(chip: Bench) -> None:
    chip.send("SET_INTRPT_MASK", 0x00A5)
    assert chip.send("GET_INTRPT_MASK") == 0x00A5
    assert chip.rules() == []
    chip.send("SET_INTRPT_MASK", 0x08FF)
    assert chip.send("GET_INTRPT_MASK") == 0x00FF
    assert chip.rules() == ["unused-bits"]


@spec("PMD-CMD-53", "PMD-CMD-54", "PMD-AMB-7", "PMD-T-6")
@pytest.mark.parametrize("value", [0, 80, 32767])
def test_step_ratio_is_one_word_written_and_one_read(chip: Bench, value: int) -> None:
    assert round(4000 / 12800 * 256) == 80
    assert 4096 / 12800 * 256 == 81.92  # no whole number: the manual forbids such an encoder
    chip.send("SET_STEP_RATIO", value)
    assert chip.checksum() == 0x0068 + value
    assert chip.send("GET_STEP_RATIO") == value


@spec("PMD-CMD-57", "PMD-CMD-58")
@pytest.mark.parametrize("value", [0, 1, 32767])
def test_position_error_limit(chip: Bench, value: int) -> None:
    chip.send("SET_POS_ERR", value)
    assert chip.send("GET_POS_ERR") == value


@spec("PMD-CMD-82", "PMD-AMB-8", "PMD-AMB-9", "PMD-AMB-28")
@pytest.mark.parametrize(
    ("name", "given", "kept"),
    [
        ("POS", 2**30, -(2**30)),
        ("POS", -(2**30) - 1, 2**30 - 1),
        ("VEL", 2**30 + 5, 5),
        ("START_VEL", 0xC0000001, 1),
        ("MAX_ACC", 0x8001, 1),
        ("JERK", 0x80000002, 2),
        ("STEP_RATIO", 0x8050, 0x50),
        ("POS_ERR", 0xFFFF, 0x7FFF),
    ],
)
def test_data_out_of_range_are_cut_to_the_width_and_reported(
    chip: Bench, name: str, given: int, kept: int
) -> None:
    chip.send("SET_" + name, given)
    assert chip.send("GET_" + name) == kept
    assert chip.rules() == ["range"]


@spec("PMD-CMD-82", "PMD-CMD-10")
def test_acceleration_is_cut_where_it_is_used(chip: Bench) -> None:
    chip.move(pos=1000, vel=8 << 16, acc=2**30 + (2 << 16))
    assert chip.trace("target", 3) == [2, 6, 12]
    assert chip.send("GET_ACC") == 2**30 + (2 << 16)


@spec("PMD-CMD-38", "PMD-CMD-39", "PMD-CMD-48", "PMD-CMD-55", "PMD-CMD-56", "PMD-STA-5")
def test_switches_show_in_the_mode_word(chip: Bench) -> None:
    for name, word in (
        ("SET_AUTO_UPDATE_OFF", 0x0480),
        ("SET_AUTO_STOP_OFF", 0x0400),
        ("SET_AUTO_UPDATE_ON", 0x0000),
        ("SET_AUTO_STOP_ON", 0x0080),
    ):
        chip.send(name)
        assert chip.send("GET_MODE") == word
    chip.send("SET_2")
    chip.send("SET_AUTO_STOP_OFF")
    chip.send("SET_1")
    assert chip.send("GET_MODE") == 0x0080


@spec("PMD-CMD-4", "PMD-CMD-5", "PMD-CMD-6", "PMD-CMD-7", "PMD-STA-5")
@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("SET_PRFL_VEL", 0x0880),
        ("SET_PRFL_S_CRV", 0x1080),
        ("SET_PRFL_GEAR", 0x1880),
        ("SET_PRFL_TRAP", 0x0080),
    ],
)
def test_profile_modes_take_effect_at_once(chip: Bench, name: str, word: int) -> None:
    chip.send("SET_PRFL_VEL")
    chip.send(name)
    assert chip.send("GET_MODE") == word
    chip.send("SET_2")
    assert chip.send("GET_MODE") == 0x0080


@spec("PMD-CMD-5", "PMD-CMD-6", "PMD-CMD-7", "PMD-TRJ-13")
@pytest.mark.parametrize(
    ("first", "second", "told"),
    [("VEL", "TRAP", ["axis 2 is in motion"]), ("TRAP", "VEL", []), ("TRAP", "GEAR", [])],
)
def test_a_mode_chosen_in_motion_is_reported_if_the_axis_should_rest(
    chip: Bench, first: str, second: str, told: list[str]
) -> None:
    chip.send("SET_2")
    chip.send(f"SET_PRFL_{first}")
    chip.move(pos=10_000, vel=4 << 16, acc=1 << 16)
    chip.next_cycle(10)
    chip.send(f"SET_PRFL_{second}")
    assert [it.detail for it in chip.violations] == told


@spec("PMD-CMD-60", "PMD-CMD-61", "PMD-CMD-68")
def test_output_mode_is_of_both_axes(chip: Bench) -> None:
    chip.send("SET_2")
    chip.send("SET_OUTPUT_DAC16")
    assert chip.send("GET_OUTPUT_MODE") == 2
    chip.send("SET_1")
    assert chip.send("GET_OUTPUT_MODE") == 2
    chip.send("SET_OUTPUT_PWM")
    assert chip.send("GET_OUTPUT_MODE") == 0


@spec("PMD-CMD-64", "PMD-CMD-65", "PMD-CMD-66", "PMD-CMD-67", "PMD-AMB-2", "PMD-T-18")
def test_motor_command_and_its_buffer(chip: Bench) -> None:
    chip.send("SET_BUF_MTR_CMD", 0x4000)
    assert chip.send("GET_MTR_CMD") == 0
    assert chip.send("GET_BUF_MTR_CMD") == 0x4000
    chip.send("UPDATE")
    chip.next_cycle()
    assert chip.send("GET_MTR_CMD") == 0x4000
    assert chip.send("GET_BUF_MTR_CMD") == 0x4000
    chip.send("SET_MTR_CMD", -32767)
    assert chip.send("GET_MTR_CMD") == -32767
    assert chip.send("GET_BUF_MTR_CMD") == 0x4000
    assert COMMANDS["GET_MTR_CMD"].code == 0x3A


@spec("PMD-CMD-64")
@pytest.mark.parametrize("name", ["MTR_CMD", "BUF_MTR_CMD"])
def test_minus_32768_is_taken_as_minus_32767(chip: Bench, name: str) -> None:
    chip.send("SET_" + name, -32768)
    assert chip.send("GET_" + name) == -32767
    assert chip.rules() == ["range"]


@spec("PMD-UPD-1", "PMD-CMD-64", "PMD-CMD-65")
def test_an_amplitude_set_past_the_buffer_outlives_updates(bench: Bench) -> None:
    bench.send("SET_BUF_MTR_CMD", 0x1000)
    bench.send("UPDATE")
    bench.next_cycle()
    bench.send("SET_MTR_CMD", 0x2000)
    for _ in range(2):
        bench.send("UPDATE")
        bench.next_cycle()
        assert bench.send("GET_MTR_CMD") == 0x2000
    assert bench.send("GET_BUF_MTR_CMD") == 0x1000
    # Once for each value: another reading of the manual has it replaced.
    assert bench.rules("idle-update") == ["motor-command-lost"]
    lost = next(v for v in bench.violations if v.rule == "mc1241a.motor-command-lost")
    assert lost.severity == "note"
    assert lost.detail.startswith("axis 1: motor command 8192 set by SET_MTR_CMD")
    assert lost.detail.endswith("would bring the buffered 4096")
    bench.send("SET_MTR_CMD", 0x2001)
    bench.send("UPDATE")
    bench.next_cycle()
    assert bench.rules("idle-update") == ["motor-command-lost"] * 2


@spec("PMD-UPD-1", "PMD-CMD-66")
def test_an_amplitude_given_to_the_buffer_comes_with_the_next_update(bench: Bench) -> None:
    bench.send("SET_BUF_MTR_CMD", 0x1000)
    bench.send("SET_MTR_CMD", 0x2000)
    bench.send("UPDATE")
    bench.next_cycle()
    assert bench.send("GET_MTR_CMD") == 0x1000
    bench.send("SET_MTR_CMD", 0x3000)
    bench.send("SET_BUF_MTR_CMD", 0x1000)  # as it was, and given all the same
    bench.send("UPDATE")
    bench.next_cycle()
    assert bench.send("GET_MTR_CMD") == 0x1000
    assert bench.rules() == []


@spec("PMD-CMD-66")
@pytest.mark.parametrize("axis", [0, 1])
def test_without_an_amplitude_the_windings_are_undriven(chip: Bench, axis: int) -> None:
    chip.send(f"SET_{axis + 1}")
    chip.send("SET_BUF_MTR_CMD", 1)
    chip.next_cycle()
    none = "its motor command is 0, so its windings get no current: SET_MTR_CMD sets it"
    assert [chip.chip.undriven(number) for number in range(3)] == [none, none, ""]
    chip.send("UPDATE")
    chip.next_cycle()
    assert [chip.chip.undriven(number) == "" for number in (axis, 1 - axis)] == [True, False]


@spec("PMD-UPD-1", "PMD-CMD-64")
def test_an_amplitude_equal_to_the_buffered_one_is_nothing_to_tell_of(chip: Bench) -> None:
    chip.send("SET_MTR_CMD", 0)
    chip.send("UPDATE")
    chip.next_cycle()
    assert chip.rules("idle-update") == []


@spec("PMD-UPD-1", "PMD-BUS-9")
def test_updates_of_one_cycle_bring_the_amplitude_given_before_any_of_them(chip: Bench) -> None:
    chip.next_cycle()
    chip.send("SET_BUF_MTR_CMD", 0x1000)
    chip.send("UPDATE")
    chip.send("UPDATE")
    chip.send("SET_BUF_MTR_CMD", 0x2000)
    chip.next_cycle()
    assert chip.send("GET_MTR_CMD") == 0x1000
    chip.send("SET_MTR_CMD", 0x3000)
    chip.send("UPDATE")
    chip.next_cycle()
    assert chip.send("GET_MTR_CMD") == 0x2000


@spec("PMD-UPD-1", "PMD-RST-2", "PMD-CMD-75")
def test_reset_forgets_an_amplitude_given_to_the_buffer(bench: Bench) -> None:
    for updated in (False, True):
        bench.next_cycle()
        bench.send("SET_BUF_MTR_CMD", 0x1000)
        if updated:
            bench.send("UPDATE")  # to act at the next cycle, which does not come
        bench.send("RESET")
        assert bench.send("GET_MTR_CMD") == 0
        bench.send("SET_MTR_CMD", 0x2000)
        bench.send("UPDATE")
        bench.next_cycle()
        assert bench.send("GET_MTR_CMD") == 0x2000


@spec("PMD-UPD-1", "PMD-UPD-2")
def test_a_breakpoint_that_updates_keeps_an_amplitude_set_past_the_buffer(chip: Bench) -> None:
    chip.send("SET_MTR_CMD", 0x2000)
    chip.send("SET_POS_BRK")
    chip.next_cycle()
    assert chip.status() == 0x0304
    assert chip.send("GET_MTR_CMD") == 0x2000


@spec("PMD-CMD-14", "PMD-CMD-53")
@pytest.mark.parametrize("mode", ["TRAP", "VEL", "S_CRV", "GEAR"])
def test_in_motion_the_step_ratio_may_change_and_the_start_velocity_not(
    bench: Bench, mode: str
) -> None:
    """Gear mode is never in motion (PMD-STA-3) and does not use the start velocity."""
    bench.send("SET_START_VEL", 5)
    bench.send("SET_PRFL_" + mode)
    bench.move(pos=10_000, vel=8 << 16, acc=1 << 16, max_acc=0x7000, jerk=1 << 29)
    bench.next_cycle(4)
    bench.send("SET_STEP_RATIO", 128)
    bench.send("SET_START_VEL", 6)
    moving = mode != "GEAR"
    assert bench.send("GET_START_VEL") == (5 if moving else 6)
    assert bench.send("GET_STEP_RATIO") == 128
    assert bench.status() == (0x0780 if moving else 0x0300)


@spec("PMD-CMD-14", "PMD-CMD-53", "PMD-CMD-78", "PMD-CMD-79")
def test_step_ratio_start_velocity_and_waveform_need_no_update_and_are_the_current_axis_s(
    bench: Bench,
) -> None:
    for name, value in (("SET_START_VEL", 7), ("SET_STEP_RATIO", 80), ("SET_PHASE_2", 0)):
        bench.send(name, value)
    questions = ("GET_START_VEL", "GET_STEP_RATIO", "GET_PHASE_INFO")
    assert [bench.send(name) for name in questions] == [7, 80, 8]
    bench.send("SET_2")
    assert [bench.send(name) for name in questions] == [0, 0, 0]
    bench.send("SET_PHASE_2")
    bench.send("SET_1")
    bench.send("SET_PHASE_3")
    bench.send("SET_2")
    assert bench.send("GET_PHASE_INFO") == 8


@spec("PMD-CMD-78", "PMD-CMD-79", "PMD-CMD-80", "PMD-AMB-6", "PMD-AMB-27")
def test_the_waveform_is_chosen_per_axis(chip: Bench) -> None:
    assert chip.send("GET_PHASE_INFO") == 0x0000
    chip.send("SET_PHASE_2")
    assert chip.send("GET_PHASE_INFO") == 0x0008
    chip.send("SET_2")
    assert chip.send("GET_PHASE_INFO") == 0x0000
    chip.send("SET_1")
    chip.send("SET_PHASE_3")
    assert chip.send("GET_PHASE_INFO") == 0x0000


@spec("PMD-CMD-25", "PMD-CMD-26")
def test_target_position_and_velocity(chip: Bench) -> None:
    chip.move(pos=-1000, vel=6 << 15, acc=3 << 14)  # to -3.0 in steps of 0.75
    chip.next_cycle()
    assert chip.send("GET_TRGT_VEL") == -(3 << 14)
    chip.next_cycle(10)
    assert chip.send("GET_TRGT_VEL") == -(3 << 16)


@spec("PMD-CMD-25")
def test_the_target_position_is_the_floor(chip: Bench) -> None:
    chip.move(pos=-1000, vel=6 << 15, acc=3 << 14)
    assert chip.trace("target", 3) == [-1, -3, -5]  # -0.75, -2.25, -4.5


@spec("PMD-CMD-69", "PMD-CMD-49")
def test_set_actl_pos_gives_both_positions_a_number(chip: Bench) -> None:
    chip.send("SET_ACTL_POS", -123456)
    assert chip.send("GET_ACTL_POS") == -123456
    assert chip.send("GET_TRGT_POS") == -123456
    assert chip.send("GET_ACTL_POS_ERR") == 0
    chip.next_cycle(3)
    assert chip.send("GET_ACTL_POS") == -123456


@spec("PMD-CMD-69", "PMD-ENC-1")
def test_a_position_that_has_come_round_and_got_a_number_does_not_come_round_again(
    chip: Bench,
) -> None:
    chip.send("SET_ACTL_POS", -(1 << 30))
    chip.drive("QuadB1", 1)
    chip.next_cycle()
    assert chip.status() == 0x0302
    chip.send("SET_ACTL_POS", 100)
    chip.send("CLR_STATUS")
    chip.drive("QuadB1", 0)
    chip.next_cycle()
    assert (chip.seen("actual"), chip.status()) == (101, 0x0300)


@spec("PMD-CMD-69")
def test_set_actl_pos_takes_in_the_counts_made_until_it_acts(chip: Bench) -> None:
    chip.next_cycle()
    chip.drive("QuadA1", 1)
    chip.run_for(1_000_000)
    chip.send("SET_ACTL_POS", 100)
    chip.next_cycle()
    assert chip.seen("actual") == 100
    chip.drive("QuadB1", 1)
    chip.next_cycle()
    assert abs(chip.seen("actual") - 100) == 1
    assert chip.status() & 0x0002 == 0, "the position has not wrapped"


@spec("PMD-CMD-49")
def test_actual_position_is_of_the_last_cycle(chip: Bench) -> None:
    chip.next_cycle()
    chip.drive("QuadA1", 1)
    chip.run_for(1_000_000)
    assert chip.send("GET_ACTL_POS") == 0
    chip.next_cycle()
    assert chip.send("GET_ACTL_POS") == 1


@spec("PMD-CMD-70", "PMD-CMD-71")
@pytest.mark.parametrize("sense", [0x0, 0xF, 0x5])
def test_limit_levels_are_raw(chip: Bench, sense: int) -> None:
    chip.send("SET_LMT_SENSE", sense)
    assert chip.send("GET_LMT_SWTCH") == 0
    for bit, name in enumerate(("PosLimit1", "NegLimit1", "PosLimit2", "NegLimit2")):
        chip.drive(name, 1)
        assert chip.send("GET_LMT_SWTCH") == 1 << bit
        chip.drive(name, 0)


@spec("PMD-CMD-71", "PMD-CMD-74")
def test_an_mc1141a_reads_0_for_the_second_axis() -> None:
    bench = Bench(part="MC1141A")
    for name in ("PosLimit1", "NegLimit1", "PosLimit2", "NegLimit2", "~Home2"):
        bench.drive(name, 1)
    assert bench.send("GET_LMT_SWTCH") == 0x3
    assert bench.send("GET_HOME") == 0x1


@spec("PMD-CMD-74")
def test_home_levels(chip: Bench) -> None:
    assert chip.send("GET_HOME") == 3
    chip.drive("~Home2", 0)
    assert chip.send("GET_HOME") == 1
    chip.drive("~Home1", 0)
    assert chip.send("GET_HOME") == 0


@spec("PMD-VER-2")
def test_a_version_word_has_16_bits() -> None:
    assert Bench(version_word=0xFFFF).send("GET_VRSN") == 0xFFFF
    for word in (-1, 0x1_0000):
        with pytest.raises(ValueError, match=rf"^version_word = {word}: at "):
            Bench(version_word=word)


@spec("PMD-CMD-76", "PMD-VER-2", "PMD-AMB-4")
def test_version_words(bench: Bench) -> None:
    assert bench.send("GET_VRSN") == 0x4A10
    assert Bench(part="MC1141A").send("GET_VRSN") == 0x4210
    assert Bench(version_word=0x4A0B).send("GET_VRSN") == 0x4A0B  # the manual's worked word
    assert Bench(version_word=0x4B10).send("GET_VRSN") == 0x4B10


@spec("PMD-VER-1", "PMD-T-2")
def test_fields_of_the_version_word() -> None:
    for word, fields in (
        (0x5908, "4 axes, part 01, version 1.0"),  # MC1401
        (0x4928, "2 axes, part 01 dash 1, version 1.0"),  # MC1201-P
        (0x4A0B, "2 axes, part 31, version 1.3"),  # MC1241
        # Major versions from 2 on are "A" parts.
        (0x4A10, "2 axes, part 31, version 2.0"),
        (0x4210, "1 axes, part 31, version 2.0"),
        (0x4310, "1 axes, part 41, version 2.0"),
    ):
        shown = f"{word:04X}H generation 1, {fields}"
        assert Mc1241aDecoder().word("version", word) == shown


@spec("PMD-CMD-77", "PMD-CYC-2")
def test_time_counts_cycles_and_wraps(chip: Bench) -> None:
    chip.next_cycle(7)
    assert chip.send("GET_TIME") == 7
    chip.probe.time = 0xFFFFFFFF
    chip.next_cycle()
    assert chip.send("GET_TIME") == 0


# -- coding of numbers ------------------------------------------------------------------------


@spec("PMD-T-3")
@pytest.mark.parametrize(
    ("number", "coded", "sent"),
    [
        (2.75 * 65536, 180224, (0x0002, 0xC000)),
        (0.175 * 65536, 11469, (0x2CCD,)),
        (1.5 * 65536, 98304, (0x0001, 0x8000)),
        (-11.39 * 65536, -746455, (0xFFF4, 0x9C29)),
        (-1.95 * 65536, -127795, (0xFFFE, 0x0CCD)),
        (-2 * 65536, -131072, (0xFFFE, 0x0000)),
        (1234567, 1234567, (0x0012, 0xD687)),
    ],
)
def test_the_manual_s_numbers(number: float, coded: int, sent: tuple[int, ...]) -> None:
    assert round(number) == coded
    assert tuple(words(coded, len(sent))) == sent


@spec("PMD-T-4", "PMD-AMB-17")
def test_the_manual_s_jerk_is_one_off_and_is_coded_as_printed(chip: Bench) -> None:
    assert round(0.0075 * 2**32) == 32212255 == 0x1EB851F
    chip.send("SET_JERK", 32212256)
    assert chip.checksum() == 0x0013 + 0x01EB + 0x8520
    assert chip.send("GET_JERK") == 0x1EB8520


@spec("PMD-T-5", "PMD-AMB-16")
def test_the_manual_s_conversions_use_1851_cycles_a_second() -> None:
    assert int(12345 / 1851 * 65536) == 437083
    assert int(67890 / 1851**2 * 65536) == 1298
    assert round(67890 / 1851**2, 6) == 0.019815


@spec("PMD-CMD-9", "PMD-CMD-10", "PMD-CMD-11", "PMD-CMD-12", "PMD-CMD-13")
@pytest.mark.parametrize(
    ("name", "fraction"),
    [("velocity", 16), ("acceleration", 16), ("max acceleration", 16), ("jerk", 32),
     ("gear ratio", 16)],
)  # fmt: skip
def test_a_value_in_use_and_the_one_loaded_have_the_fraction_of_the_manual(
    name: str, fraction: int
) -> None:
    fractions = {row.name: row.fraction for row in VALUES.rows}
    assert fractions[name] == fractions[f"{name} buffered"] == fraction
