"""Firmware whose port bits, or whose memory bus, go through glue before they reach chips."""

import re
from pathlib import Path

import pytest

from tests.avr.conftest import EXAMPLES, compile_avr, early_bus
from tests.avr.test_firmware import UNO, bus_of, exec_command
from tests.firmware import run_avr
from tests.shims.conftest import compile_for

TWO_AXES = EXAMPLES / "lm629_two_axes"
BIT_BANG = EXAMPLES / "lm629_avr_bitbang"
DRIVER = EXAMPLES / "lm629_c" / "lm629_driver.c"


def cycles(path: Path) -> list[str]:
    """Return a transcript without the memory bus, and without how often a status was polled."""
    return [line for line in bus_of(path) if not line.startswith("bus ")]


@pytest.mark.parametrize(
    ("layer", "part", "clock"),
    [("avr_ports", "atmega328p", 16_000_000), ("avr_xmem", "atmega2560", 14_745_600),
     ("avr_gpio_xmem", "atmega2560", 14_745_600)],
)  # fmt: skip
def test_a_driver_moves_two_axes_behind_a_decoder(
    layer: str, part: str, clock: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    sources = [TWO_AXES / "main.c", TWO_AXES / f"{layer}.c", DRIVER]
    elf = compile_avr(tmp_path / "move.elf", *sources, mmcu=part, frequency=clock)
    transcript = tmp_path / "bus.txt"
    spec = f"mmcu={part},f={clock},cycles=64000000"
    board = str(TWO_AXES / f"{layer}.toml")
    assert run_avr(spec, str(elf), board, transcript=str(transcript)) == 0
    assert capfd.readouterr().out == (TWO_AXES / "expected.txt").read_text()
    lines = cycles(transcript)
    assert not [line for line in lines if line.startswith("!")]
    for chip in "xy":
        codes = [line.split()[3] for line in lines if line.startswith(f"{chip} w 0")]
        assert codes == ["1D", "1E", "04", "1F", "01", "0A", "08"]


BEHIND = (
    (BIT_BANG / "board.toml")
    .read_text()
    .replace('PC0 = "/CS"', 'PC0 = "u1./G2A"')
    .replace('PC3 = "/WR"', 'PC3 = "u2.1A"')
    .replace(
        "[pinmaps.atmega328p.pins]",
        """[glue.u1]
part = "74HC138"
low = ["A", "B", "C", "/G2B"]
high = ["G1"]
hosts = ["/G2A"]

[glue.u1.pins]
Y0 = "x./CS"

[glue.u2]
part = "74HC32"
low = ["1B"]
hosts = ["1A"]

[glue.u2.pins]
1Y = "x./WR"

[pinmaps.atmega328p.pins]""",
    )
)
"""The bit-bang example's board with a decoder before the select and a gate before /WR."""


def test_the_bit_bang_example_makes_the_same_cycles_through_a_decoder(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "board.toml"
    board.write_text(BEHIND)
    sources = [BIT_BANG / "main.c", BIT_BANG / "lm629_bus.c", DRIVER]
    elf = compile_avr(tmp_path / "move.elf", *sources)
    found = []
    for file in (board, BIT_BANG / "board.toml"):
        transcript = tmp_path / "bus.txt"
        assert (
            run_avr(f"{UNO},cycles=160000000", str(elf), str(file), transcript=str(transcript)) == 0
        )
        assert capfd.readouterr().out == (BIT_BANG / "expected.txt").read_text()
        found.append(bus_of(transcript))
    assert found[0] == found[1]
    program = compile_for(
        "avr", tmp_path / "move", "-DF_CPU=16000000UL", f"-I{EXAMPLES / 'lm629_c'}", *sources
    )
    shim = tmp_path / "shim.txt"
    assert exec_command(["--board", str(board), "--transcript", str(shim), str(program)]) == 0
    assert capfd.readouterr().out == (BIT_BANG / "expected.txt").read_text()
    assert bus_of(shim) == found[1]


@pytest.mark.parametrize("simulated", [True, False], ids=["simavr", "shim"])
@pytest.mark.parametrize("early", [True, False], ids=["early", "right"])
@pytest.mark.parametrize("behind", [False, True], ids=["wired", "behind glue"])
def test_a_byte_that_is_taken_before_its_strobe_is_named_with_what_the_chip_gave(
    behind: bool, simulated: bool, early: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    board = BIT_BANG / "board.toml"
    if behind:
        board = tmp_path / "board.toml"
        board.write_text(BEHIND)
    bus = early_bus(tmp_path / "lm629_bus.c") if early else BIT_BANG / "lm629_bus.c"
    sources = [BIT_BANG / "main.c", bus, DRIVER]
    if simulated:
        elf = compile_avr(tmp_path / "move.elf", *sources)
        run_avr(f"{UNO},cycles=16000000", str(elf), str(board))
    else:
        folders = [f"-I{EXAMPLES / 'lm629_c'}", f"-I{BIT_BANG}"]
        program = compile_for("avr", tmp_path / "move", "-DF_CPU=16000000UL", *folders, *sources)
        exec_command(["--board", str(board), "--limit", "1 s", str(program)])
    found = [line for line in capfd.readouterr().err.splitlines() if "the host took" in line]
    assert len(found) == early
    for line in found:
        assert re.search(r"x: the host took ..h where the chip gave ..h at \d", line)
        assert "look while the strobe is low" in line
