"""The pin decoder: what port bits do, and the bus cycles that follow."""

import subprocess
from pathlib import Path

import pytest

from tests.left_out import require
from tests.unit.native.conftest import WARNINGS
from vbus.native import include_dir

HERE = Path(__file__).parent

DATA = " ".join(f"0d{bit}=D{bit}" for bit in range(8))
ONE = f"{DATA} 0r=C0 0w=C1 0a0=C2 0s=C3 p4=B0 o1=B2"
"""Data on port D; C0 /RD, C1 /WR, C2 /PS, C3 /CS; /RST at B0; an interrupt line at B2."""

TWO = f"{ONE} {DATA.replace('0d', '1d')} 1r=C0 1w=C1 1a0=C2 1s=C4"
"""A second chip beside it, whose /CS is C4."""

IDLE = "C1F 1F"


@pytest.fixture(scope="session")
def decoder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("pins") / "pins"
    compile_pins(["gcc", "-std=c99", "-g"], program)
    return program


def compile_pins(compiler: list[str], output: Path) -> None:
    done = subprocess.run(
        [require(compiler[0]), *compiler[1:], *WARNINGS, f"-I{include_dir()}", "-o", str(output),
         str(HERE / "pins.c"), f"{include_dir()}/pin_decoder.c"],
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def play(decoder: Path, wiring: str, *steps: str) -> list[str]:
    """Return what the decoder called back, and what ports read as."""
    script = "\n".join([wiring, *steps, ""])
    done = subprocess.run([decoder], input=script, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@pytest.mark.parametrize(
    "compiler",
    [["gcc", "-std=c99", "-O2"], ["g++", "-x", "c++", "-std=c++11"]],
    ids=" ".join,
)
def test_it_builds_as_c_and_as_cpp_without_a_warning(compiler: list[str], tmp_path: Path) -> None:
    compile_pins(compiler, tmp_path / "pins")


BEHIND = " ".join(f"0b{bit}=D{bit}" for bit in range(8)) + " c0=C0 c1=C1 c2=C2 c4=!C4 p7=B0 p8=B1"
"""A chip behind glue: data on port D; lines at port C, one inverted; a decoder at B0, B1."""


# -- before glue -----------------------------------------------------------------------------------


def test_before_glue_lines_buses_and_side_pins_follow_the_port_bits(decoder: Path) -> None:
    played = play(
        decoder, BEHIND, "C17 07", "B03 02", "DFF 1E", "C17 03", "C17 07", "D00 00", "C17 15",
    )  # fmt: skip
    assert played == [
        "lines 17 17", "side 7 0", "side 8 1", "drive 0 1E", "lines 4 0", "lines 4 4", "release 0",
        "lines 12 0",
    ]  # fmt: skip


def test_before_glue_strobes_rise_before_data_moves_and_fall_after_it(decoder: Path) -> None:
    together = BEHIND.replace("D7", "C7").replace("p8=B1", "p8=C6")
    played = play(decoder, together, "CD7 05", "D7F 00", "CD7 82", "CD7 C7")
    assert played == [
        "lines 15 15", "side 8 0", "lines 2 0", "drive 0 00",
        "lines 2 2", "drive 0 80", "lines 5 0", "lines 5 5", "side 8 1",
    ]  # fmt: skip


def test_before_glue_a_bus_is_looked_at_whenever_a_port_that_does_not_drive_it_is_read(
    decoder: Path,
) -> None:
    played = play(decoder, BEHIND, "=A5", "?D", "=5A", "?D", "DFF 12", "?D", "?C")
    assert played[:4] == ["look 0", "D A5", "look 0", "D 5A"]
    assert played[-2:] == ["D 12", "C FF"]
    assert "look 0" not in played[4:]


# -- writes ----------------------------------------------------------------------------------------


def test_a_write_is_latched_when_the_strobe_rises_before_the_select(decoder: Path) -> None:
    steps = [IDLE, "DFF 1E", "C1F 13", "C1F 11"]
    assert play(decoder, ONE, *steps) == []
    assert play(decoder, ONE, *steps, "C1F 13") == ["write 1 0 1E"]
    assert play(decoder, ONE, *steps, "C1F 13", "C1F 1F") == ["write 1 0 1E"]


def test_a_write_is_latched_when_the_select_rises_before_the_strobe(decoder: Path) -> None:
    steps = [IDLE, "DFF 1E", "C1F 11", "C1F 19"]
    assert play(decoder, ONE, *steps) == ["write 1 0 1E"]
    assert play(decoder, ONE, *steps, "C1F 1F") == ["write 1 0 1E"]


def test_data_may_change_while_the_strobe_is_low(decoder: Path) -> None:
    played = play(decoder, ONE, IDLE, "DFF 00", "C1F 15", "DFF 55", "DFF AA", "C1F 17")
    assert played == ["write 1 1 AA"]


def test_pins_that_move_together_with_the_edge_come_too_late(decoder: Path) -> None:
    everything = DATA.replace("D7", "C7") + " 0r=C0 0w=C1 0a0=C2 0s=C3"
    played = play(decoder, everything, "CFF 1F", "DFF 00", "CFF 91", "CFF 1F")
    assert played == ["write 1 0 80"]


def test_a_strobe_without_select_is_nothing(decoder: Path) -> None:
    assert play(decoder, ONE, IDLE, "DFF 55", "C1F 1D", "C1F 1F", "C1F 1E", "C1F 1F") == []


def test_a_floating_strobe_is_idle(decoder: Path) -> None:
    # /WR is an input when the select falls; then it is driven low; then it floats again.
    assert play(decoder, ONE, "C1D 00") == ["read 1 0"]
    assert play(decoder, ONE, "C1D 01", "DFF 42", "C1F 01") == []
    assert play(decoder, ONE, "C1D 01", "DFF 42", "C1F 01", "C1D 01") == ["write 1 0 42"]


def test_a_floating_select_is_idle(decoder: Path) -> None:
    assert play(decoder, ONE, "C17 11", "DFF 42", "C17 13") == []


def test_ports_at_reset_are_inputs_and_nothing_happens(decoder: Path) -> None:
    assert play(decoder, ONE, "C00 00", "D00 00", "C00 1F") == []


def test_data_lines_that_float_read_high_or_what_was_there_last(decoder: Path) -> None:
    assert play(decoder, ONE, IDLE, "C1F 11", "C1F 13") == ["write 1 0 FF"]
    assert play(decoder, ONE, IDLE, "DFF 21", "D00 00", "C1F 11", "C1F 13") == ["write 1 0 21"]


def test_two_chips_are_written_by_one_strobe(decoder: Path) -> None:
    played = play(decoder, TWO, IDLE, "DFF 1D", "C1F 01", "C1F 03", "C1F 1F")
    assert played == ["write 3 0 1D"]


def test_the_select_moves_to_the_other_chip_while_the_strobe_is_low(decoder: Path) -> None:
    played = play(decoder, TWO, IDLE, "DFF 1D", "C1F 11", "C1F 09", "DFF 33", "C1F 1F")
    assert played == ["write 1 0 1D", "write 2 0 33"]


def test_chips_with_data_lines_of_their_own_take_their_own_bytes(decoder: Path) -> None:
    other = " ".join(f"1d{bit}=A{bit}" for bit in range(8))
    wiring = f"{DATA} {other} 0r=1 0w=C1 0a0=C2 0s=0 1r=1 1w=C1 1a0=C2 1s=0"
    played = play(decoder, wiring, IDLE, "DFF 11", "AFF 22", "C1F 1D", "C1F 1F")
    assert played == ["write 1 1 11", "write 2 1 22"]


# -- reads -----------------------------------------------------------------------------------------


def test_a_read_begins_at_the_falling_edge_and_the_byte_stays_until_it_ends(decoder: Path) -> None:
    steps = [IDLE, "D00 00", "=A5", "C1F 16", "=00", "?D"]
    assert play(decoder, ONE, *steps) == ["read 1 1", "D A5"]
    # The strobe rises: the floating bus keeps the byte, and pull-ups end that.
    assert play(decoder, ONE, *steps, "C1F 1F", "?D")[2:] == ["D A5"]
    assert play(decoder, ONE, *steps, "C1F 1F", "D00 FF", "?D")[2:] == ["D FF"]


def test_pull_ups_do_not_win_against_a_chip(decoder: Path) -> None:
    assert play(decoder, ONE, IDLE, "D00 FF", "=00", "C1F 16", "?D") == ["read 1 1", "D 00"]


def test_a_port_that_still_drives_reads_itself(decoder: Path) -> None:
    assert play(decoder, ONE, IDLE, "DFF 3C", "=A5", "C1F 16", "?D") == ["read 1 1", "D 3C"]
    # When it lets go with the strobe still low, the chip is there.
    played = play(decoder, ONE, IDLE, "DFF 3C", "=A5", "C1F 16", "D00 00", "?D")
    assert played == ["read 1 1", "D A5"]


def test_a_port_that_fights_the_chip_for_a_while_leaves_its_byte_alone(decoder: Path) -> None:
    steps = [IDLE, "D00 00", "=A5", "C1F 16", "DFF 3C", "?D", "D00 00", "?D"]
    assert play(decoder, ONE, *steps) == ["read 1 1", "D 3C", "D A5"]


def test_with_both_strobes_low_it_is_a_write(decoder: Path) -> None:
    assert play(decoder, ONE, IDLE, "DFF 21", "C1F 1D", "C1F 14", "C1F 17") == ["write 1 1 21"]


def test_one_read_per_strobe_however_often_the_port_is_looked_at(decoder: Path) -> None:
    played = play(decoder, ONE, IDLE, "=85", "C1F 12", "?D", "?D", "C1F 1F", "C1F 12")
    assert played == ["read 1 0", "D 85", "D 85", "read 1 0"]


def test_read_bytes_come_scattered_over_ports(decoder: Path) -> None:
    scattered = "0d0=B7 0d1=A0 0d2=D2 0d3=!D3 0d4=L1 0d5=L0 0d6=K6 0d7=A1"
    wiring = f"{scattered} 0r=C0 0w=C1 0a0=C2 0s=C3"
    played = play(decoder, wiring, IDLE, "=93", "C1F 16", "?A", "?B", "?D", "?K", "?L")
    assert played[0] == "read 1 1"
    # 93h: bits 0, 1, 4 and 7 are high; bit 3 is behind an inverter; lines not wired read high.
    assert played[1:] == ["A FF", "B FF", "D FB", "K BF", "L FE"]


def test_a_chip_goes_on_driving_after_another_on_the_same_lines_has_let_go(decoder: Path) -> None:
    played = play(decoder, TWO, IDLE, "D00 FF", "=0F", "C1F 16", "=F0", "C1F 06", "C1F 0E", "?D")
    assert played == ["read 1 1", "read 2 1", "D F0"]


def test_two_chips_read_by_one_strobe_are_one_cycle(decoder: Path) -> None:
    assert play(decoder, TWO, IDLE, "C1F 06") == ["read 3 1"]


# -- wiring ----------------------------------------------------------------------------------------


def test_one_pin_reads_when_low_and_writes_when_high(decoder: Path) -> None:
    wiring = f"{DATA} 0r=C0 0w=!C0 0a0=C2 0s=C3"
    played = play(
        decoder, wiring, "C0D 09", "DFF 07", "C0D 01", "C0D 09", "=84", "C0D 08", "C0D 00", "C0D 08"
    )
    assert played == ["write 1 0 07", "read 1 0"]


def test_a_multiplexed_bus_takes_its_address_when_the_latch_rises(decoder: Path) -> None:
    wiring = f"{DATA} 0l=C0 0r=C1 0w=C2 0s=C3"
    write = ["C0F 0F", "DFF 38", "C0F 0E", "DFF 39", "C0F 0F", "DFF 42", "C0F 0B", "C0F 03"]
    assert play(decoder, wiring, *write, "C0F 0B", "C0F 0F") == ["write 1 39 42"]
    read = ["C0F 0F", "DFF 12", "C0F 0E", "C0F 0F", "D00 00", "=77", "C0F 07", "C0F 05", "?D"]
    assert play(decoder, wiring, *read) == ["read 1 12", "D 77"]


MULTIPLEXED = f"{DATA} 0l=C0 0r=C1 0w=C2 0s=C3"  # /ALE, /OE, R/W, /CS
LATCH = ("C0F 0F", "DFF 12", "C0F 0E", "C0F 0F")


def test_a_read_strobe_after_the_select_shows_what_it_has_read(decoder: Path) -> None:
    """As an HCTL-1100 is read: /CS low and high, then /OE."""
    read = [*LATCH, "D00 00", "=77", "C0F 07", "C0F 0F", "=00", "?D", "C0F 0D", "?D", "C0F 0F"]
    again = ["C0F 0D", "?D", "C0F 0F", "D00 FF", "?D"]
    played = play(decoder, MULTIPLEXED, *read, *again)
    assert played == ["read 1 12", "D 12", "D 77", "D 77", "D FF"]


def test_of_a_latched_address_one_select_reads_once(decoder: Path) -> None:
    within = ["C0F 07", "C0F 05", "C0F 07", "C0F 0F"]
    after = ["C0F 07", "C0F 05", "C0F 0D", "C0F 0F"]
    assert play(decoder, MULTIPLEXED, *LATCH, "D00 00", *within, *after) == ["read 1 12"] * 2


def test_a_latched_address_is_written_if_r_w_is_low_as_the_select_rises(decoder: Path) -> None:
    late = ["C0F 07", "C0F 03", "DFF 42", "C0F 0B", "C0F 0F"]
    together = ["C0F 03", "C0F 0F"]
    early = ["C0F 03", "C0F 07", "C0F 0F"]  # R/W rises first: a read
    assert play(decoder, MULTIPLEXED, *LATCH, *late, *together, *early) == [
        "write 1 12 42", "write 1 12 42", "read 1 12",
    ]  # fmt: skip


def test_a_tied_select_is_always_selected(decoder: Path) -> None:
    assert play(decoder, f"{DATA} 0r=C0 0w=C1 0a0=1 0s=0", IDLE, "C1F 1E") == ["read 1 1"]


def test_side_pins_follow_and_are_let_go(decoder: Path) -> None:
    played = play(decoder, ONE, "B01 00", "B01 00", "B01 01", "B00 01")
    assert played == ["side 4 0", "side 4 1", "side 4 2"]


def test_an_output_line_is_seen_at_its_port_bit(decoder: Path) -> None:
    played = play(decoder, ONE, "B00 00", "?B", "o2", "?B", "oD", "?B", "B04 04", "?B")
    assert played == ["B FF", "B FF", "B FB", "B FF"]


def test_a_port_may_have_16_bits(decoder: Path) -> None:
    """Data on the high half, strobes on the low one: one call is one instant for both."""
    wide = " ".join(f"0d{bit}=B{bit + 8}" for bit in range(8)) + " 0r=B1 0w=B2 0s=B0"
    played = play(decoder, wide, "BFF07 FF07", "BFF07 5502", "BFF07 AA07", "?B+",
                  "=3C", "B0007 0005", "B0007 0004", "?B+")  # fmt: skip
    assert played == ["write 1 0 55", "B AAFF", "read 1 0", "B 3CFC"]


@pytest.mark.parametrize(
    ("wiring", "place"),
    [
        ("0r=N0", 1), ("0r=A16", 1), ("0x=A0", 1), ("16r=A0", 1), ("r=A0", 1), ("0d8=A0", 1),
        ("0r=A0 0w", 7), ("0r=A0 0w=", 7), ("0r=A0,0w=A1", 1), ("o32=A0", 1), ("p=A0", 1),
        ("0r=!", 1), ("0r", 1),
    ],
)  # fmt: skip
def test_a_wiring_that_cannot_be_understood_is_refused(
    decoder: Path, wiring: str, place: int
) -> None:
    assert play(decoder, wiring) == [f"wrong at {place}"]


def test_ports_that_do_not_exist_are_nothing(decoder: Path) -> None:
    assert play(decoder, ONE, "ZFF 00") == []


# -- looks outside a strobe ------------------------------------------------------------------------

READ = ("C1F 13", "C1F 12", "C1F 13", "C1F 1F")
"""/CS and /PS low, /RD low and high again, all idle."""


def test_a_byte_that_is_taken_within_its_strobe_is_not_missed(decoder: Path) -> None:
    played = play(decoder, ONE, IDLE, "=5A", *READ[:2], "?D", *READ[2:], "?D", "=A5", *READ[:2],
                  "?D", *READ[2:], "?D", "?D")  # fmt: skip
    assert not [line for line in played if line.startswith("missed")]


def test_a_byte_that_is_taken_before_its_strobe_is_missed_if_it_differs(decoder: Path) -> None:
    early = (*READ[:1], "?D", *READ[1:])
    played = play(decoder, ONE, IDLE, "=5A", *early, *early, "=A5", *early)
    assert played == ["D FF", "read 1 0", "missed 0 FF 5A", "D 5A", "read 1 0",
                      "D 5A", "read 1 0", "missed 0 5A A5"]  # fmt: skip


def test_a_byte_that_is_taken_after_its_strobe_is_missed_if_it_differs(decoder: Path) -> None:
    pulled_up = "D00 FF"
    played = play(decoder, ONE, IDLE, pulled_up, "=5A", *READ, "?D", *READ, "?D")
    assert played == ["read 1 0", "missed 0 FF 5A", "D FF"] * 2


def test_a_read_for_its_effect_alone_misses_nothing(decoder: Path) -> None:
    played = play(decoder, ONE, IDLE, "=5A", *READ, "DFF 12", "C1F 15", "C1F 17", "D00 FF", "?D")
    assert played == ["read 1 0", "write 1 1 12", "D FF"]
