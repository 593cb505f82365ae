"""Packets, checksums, codes that are no commands (PMD-PKT)."""

import pytest

from tests.conformance.mc1241a.conftest import CYCLE, DATA, Bench
from vbus.chips.mc1241a.datasheet import COMMANDS, FAMILY_CODES
from vbus.core.state import save

spec = pytest.mark.spec

UNDOCUMENTED = sorted(
    set(range(0x01, 0x80)) - {row.code for row in COMMANDS} - {0x03, 0x04, 0x22, 0x49}
)


@spec("PMD-PKT-1", "PMD-PKT-2", "PMD-T-1", "PMD-CMD-9")
def test_the_checksum_of_the_manual_s_example(bench: Bench) -> None:
    bench.send("SET_VEL", 0xFEDCBA98)
    assert bench.checksum() == 0xB985


@spec("PMD-PKT-1", "PMD-PKT-2")
def test_the_three_forms_of_a_packet_have_a_checksum(bench: Bench) -> None:
    bench.send("UPDATE")
    assert bench.checksum() == 0x001A
    bench.send("SET_POS", -2)
    assert bench.checksum() == (0x0010 + 0xFFFF + 0xFFFE) & 0xFFFF
    bench.send("GET_POS")
    assert bench.checksum() == (0x004A + 0xFFFF + 0xFFFE) & 0xFFFF
    bench.send("SET_POS", 0x3EDC_BA98)
    bench.send("GET_POS")
    assert bench.checksum() == 0x004A + 0x3EDC + 0xBA98


@spec("PMD-PKT-3")
def test_the_checksum_is_an_ordinary_word_and_can_be_read_again(bench: Bench) -> None:
    bench.send("GET_POS_ERR")
    assert bench.read_word() == 0x0055 + 0x7FFF
    assert bench.level("HostRdy") == 0
    assert bench.read_word() == 0x0055 + 0x7FFF
    assert bench.read_word() == 0x0055 + 0x7FFF


@spec("PMD-PKT-3")
def test_checksum_and_data_may_be_left_unread(bench: Bench) -> None:
    bench.command(COMMANDS["GET_POS_ERR"].code)
    bench.command(COMMANDS["GET_TIME"].code)
    bench.read_word()
    assert bench.send("GET_VRSN") == 0x4A10
    assert bench.checksum() == 0x6C + 0x4A10
    assert bench.rules() == []


@spec("PMD-PKT-4", "PMD-T-14")
@pytest.mark.parametrize("code", [0x00, 0x03, 0x04, 0x22, 0x80, 0xC5, 0xFF])
def test_after_an_illegal_code_everything_reads_0(bench: Bench, code: int) -> None:
    bench.command(code)
    bench.write_word(0x1234)
    bench.write_word(0x5678)
    assert bench.checksum() == 0x0000
    assert bench.checksum() == 0x0000
    assert bench.rules() == ["illegal-command"]
    assert bench.send("GET_POS_ERR") == 0x7FFF
    assert bench.checksum() == 0x8054


@spec("PMD-PKT-4")
def test_every_code_from_80h_up_is_illegal(chip: Bench) -> None:
    for code in range(0x80, 0x100):
        chip.command(code)
        assert chip.checksum() == 0
    assert chip.rules() == ["illegal-command"] * 128


@spec("PMD-PKT-5", "PMD-T-14", "PMD-AMB-1")
def test_reserved_49h_does_nothing_and_has_a_checksum(bench: Bench) -> None:
    before = save(bench.chip)["axes"][0]
    bench.command(0x49)
    assert bench.checksum() == 0x0049
    bench.write_word(0x1111)
    assert bench.checksum() == 0x0049
    assert save(bench.chip)["axes"][0] == before
    assert bench.rules() == ["reserved-command", "unexpected-write"]


@spec("PMD-PKT-5")
def test_reserved_49h_ends_a_packet_that_is_open(bench: Bench) -> None:
    bench.command(0x10)  # SET_POS
    bench.write_word(0x0001)
    bench.command(0x49)
    bench.write_word(0x0002)
    assert bench.checksum() == 0x0049
    assert bench.probe.position_buffered == 0
    assert "unexpected-write" in bench.rules()


@spec("PMD-AMB-1", "PMD-CMD-16")
def test_4eh_is_smooth_stop(chip: Bench) -> None:
    chip.command(0x4E)
    assert chip.checksum() == 0x004E
    assert chip.probe.smooth_stop_buffered == 1


@spec("PMD-PKT-6", "PMD-AMB-20")
def test_undocumented_codes_are_illegal(chip: Bench) -> None:
    assert len(UNDOCUMENTED) == 127 - 80 - 4
    for code in UNDOCUMENTED:
        chip.command(code)
        chip.write_word(0x1234)
        assert chip.checksum() == 0
    assert set(chip.rules()) == {"illegal-command"}


FAMILY = {
    0x06: ("SET_MTR_LMT", 1, 0), 0x07: ("GET_MTR_LMT", 0, 1), 0x0F: ("SET_MTR_BIAS", 1, 0),
    0x25: ("SET_KP", 1, 0), 0x26: ("SET_KI", 1, 0), 0x27: ("SET_KD", 1, 0),
    0x28: ("SET_I_LM", 1, 0), 0x2B: ("SET_KVFF", 1, 0), 0x2D: ("GET_MTR_BIAS", 0, 1),
    0x2E: ("GET_INTGR", 0, 2), 0x38: ("SET_SMPL_TIME", 1, 0), 0x40: ("AXIS_OFF", 0, 0),
    0x41: ("AXIS_ON", 0, 0), 0x50: ("GET_KP", 0, 1), 0x51: ("GET_KI", 0, 1),
    0x52: ("GET_KD", 0, 1), 0x53: ("GET_I_LM", 0, 1), 0x54: ("GET_KVFF", 0, 1),
    0x61: ("GET_SMPL_TIME", 0, 1),
}  # fmt: skip


@spec("PMD-PKT-6")
def test_names_and_words_of_the_family_s_codes() -> None:
    assert FAMILY_CODES == FAMILY


@spec("PMD-PKT-6", "PMD-AMB-20")
@pytest.mark.parametrize("code", FAMILY)
def test_family_codes_can_be_taken_as_commands_that_do_nothing(code: int) -> None:
    bench = Bench(family_codes="noop")
    before = save(bench.chip)["axes"][0]
    _, written, read = FAMILY[code]
    bench.command(code)
    for _ in range(written):
        bench.write_word(0x0102)
    for _ in range(read):
        assert bench.read_word() == 0
    assert bench.checksum() == code + 0x0102 * written
    assert save(bench.chip)["axes"][0] == before
    assert bench.rules() == []
    assert bench.status() == 0x0300  # AXIS_OFF does not change bit 9 either


@spec("PMD-PKT-6")
def test_other_codes_stay_illegal_beside_the_family_s(chip: Bench) -> None:
    bench = Bench(family_codes="noop")
    for code in set(UNDOCUMENTED) - set(FAMILY):
        bench.command(code)
        assert bench.checksum() == 0


@spec("PMD-PKT-7")
def test_both_words_of_a_report_are_of_the_instant_the_command_acted(chip: Bench) -> None:
    chip.run_until(65_535 * CYCLE + 1)
    chip.command(COMMANDS["GET_TIME"].code)
    assert chip.read_word() == 0x0000  # 0000FFFFH cycles
    chip.next_cycle(3)
    assert chip.read_word() == 0xFFFF  # not 0002H, which it is by now
    assert chip.send("GET_TIME") >= 65_538


def test_a_packet_may_take_as_long_as_the_host_likes(bench: Bench) -> None:
    bench.command(COMMANDS["SET_POS"].code)
    bench.wait_ready()
    for byte in (0x00, 0x01, 0x86, 0xA0):
        bench.next_cycle(3)
        bench.byte_out(DATA, byte)
    bench.wait_ready()
    assert bench.send("GET_POS") == 100_000
