"""A 68000 in the emulator: a card on a VME-like window, big-endian accesses, interrupts."""

from pathlib import Path

import pytest

from tests.cpu.conftest import EXAMPLES, M68K, PROGRAMS, build, ended
from tests.firmware import run_cpu
from vbus.core.errors import ProgramError

FOLDER = EXAMPLES / "lm629_vme_68000"
BOARD = (FOLDER / "board.toml").read_text()
NEXT = BOARD.replace("stride = 2\n", "").replace("0xFF8001", "0xFF8000")
"""Both ports of the chip in one word."""
START = """
        .section .vectors, "a"
        .long   0x140000, start
        .fill   254, 4, 0
        .text
start:  {}
        move    #0x2700, %sr
        bra.s   .
        .section .note.GNU-stack, "", @progbits
"""


def image(folder: Path, body: str, flags: tuple[str, ...] = ()) -> Path:
    source = folder / "start.S"
    source.write_text(START.format(body))
    return build(folder / "x.elf", [*M68K, *flags, "-T", str(PROGRAMS / "m68k.ld")], source)


def run(
    folder: Path, capfd: pytest.CaptureFixture[str], elf: Path, text: str = BOARD,
    processor: str = "68000",
) -> tuple[int, str, str]:  # fmt: skip
    """Return exit code, stderr and transcript."""
    board, transcript = folder / "board.toml", folder / "bus.txt"
    board.write_text(text)
    code = run_cpu(processor, str(elf), str(board), transcript=str(transcript), summary=False)
    return code, capfd.readouterr().err, transcript.read_text()


@pytest.mark.slow
def test_the_example_gives_what_it_says_with_one_transcript_over_three_runs(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    sources = [FOLDER / "start.S", FOLDER / "main.c"]
    elf = build(tmp_path / "move.elf", [*M68K, "-T", str(FOLDER / "vme.ld")], *sources)
    transcripts = set()
    for turn in range(3):
        transcript = tmp_path / f"{turn}.txt"
        board = str(FOLDER / "board.toml")
        assert run_cpu("68000", str(elf), board, transcript=str(transcript)) == 0
        said = capfd.readouterr()
        assert (said.out, said.err) == ((FOLDER / "expected.txt").read_text(), "")
        transcripts.add(transcript.read_text())
    assert len(transcripts) == 1


def test_the_high_byte_of_a_word_is_at_the_lower_address(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = image(tmp_path, "move.w #0x1234, 0xFF8000\n move.w 0xFF8000, %d0")
    code, err, bus = run(tmp_path, capfd, elf, NEXT)
    cycles = [line for line in bus.splitlines() if not line.startswith("!")]
    assert cycles[:3] == ["x w 0 12", "x w 1 34", "x r 0 85"]
    assert (code, err) == (int(cycles[3].split()[3], 16), "")


@pytest.mark.parametrize("processor", ["68000", "68020"])
def test_a_trap_has_a_frame_and_returns(
    processor: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    # A 68020 says in the frame which vector was taken: 33 of TRAP #1.
    offset = "move.w 6(%sp), %d1\n sub.w #4*33, %d1\n add.w %d1, %d0\n" * (processor == "68020")
    body = f"""lea handler, %a0
        move.l  %a0, 0x100000
        moveq   #5, %d0
        move.w  #0x2500, %sr
        trap    #1
        addq    #1, %d0
        move.w  %sr, %d1
        lsr.w   #8, %d1
        cmp.b   #0x25, %d1
        beq     2f
        moveq   #99, %d0
        bra     2f
handler: addq   #2, %d0
        {offset}
        move.w  #0x2700, %sr
        rte
2:"""
    elf = image(tmp_path, body)
    data = elf.read_bytes()
    at = data.index((0x140000).to_bytes(4, "big"))
    trap = at + 33 * 4
    handler = data[at:].index(bytes.fromhex("5440"))  # addq #2, d0
    elf.write_bytes(data[:trap] + handler.to_bytes(4, "big") + data[trap + 4 :])
    assert run(tmp_path, capfd, elf, processor=processor)[:2] == (8, "")


FAILURES = {
    "register": (
        "move.b #1, 0xFE0015\n moveq #0, %d0",
        0,
        "DUART+14h (00FE0015h) is not modelled: it is written, to no effect",
    ),
    "nobody": ("move.b 0xFF8800, %d0\n moveq #0, %d0", 0, "no chip of the card answers at FF8800h"),
    "nothing": ("move.b 0xA00000, %d0", 1, "the firmware reads 00A00000h, where nothing is"),
    "stack": (
        "1: move.l %d0, -(%sp)\n bra 1b",
        1,
        "stack overflow: the stack has reached 000FFFFCh",
    ),
    "trap": ("trap #3", 1, "exception 35 comes at 00000400h, and its vector at 0000008Ch is"),
    "illegal": ("illegal", 1, "an illegal instruction comes at 00000400h"),
    "stop": ("stop #0x2000", 1, "waits for an interrupt that cannot come, at 00000404h"),
}


@pytest.mark.parametrize("name", FAILURES)
def test_a_failure_is_said_with_its_place(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    body, expected, sentence = FAILURES[name]
    quiet = BOARD.replace('IRQ4 = "x.HI"', "")
    code, err, _ = run(tmp_path, capfd, image(tmp_path, body), quiet)
    assert (code, sentence in err) == (expected, True), err


@pytest.mark.parametrize("table", ["0014000100000400", "0014000000000401"])
def test_a_wrong_vector_table_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], table: str
) -> None:
    elf = image(tmp_path, "nop")
    right = bytes.fromhex("0014000000000400")
    elf.write_bytes(elf.read_bytes().replace(right, bytes.fromhex(table)))
    code, err, _ = run(tmp_path, capfd, elf)
    told = (
        f"no vector table at 00000000h: stack pointer {table[:8]}h, first instruction {table[8:]}h"
    )
    assert (code, told in err) == (2, True)


def test_level_7_cannot_be_masked_and_comes_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    # HI is high after the reset, and stays so.
    body = """moveq #0, %d0
        lea handler(%pc), %a0
        move.w  #20000, %d1
1:      dbra    %d1, 1b
        bra     2f
handler: addq   #2, %d0
        rte
2:"""
    elf = image(tmp_path, body)
    data = elf.read_bytes()
    at = data.index(bytes.fromhex("0014000000000400"))
    handler = data[at:].index(bytes.fromhex("5440"))  # addq #2, d0
    vector = at + 31 * 4
    elf.write_bytes(data[:vector] + handler.to_bytes(4, "big") + data[vector + 4 :])
    text = BOARD.replace("IRQ4", "IRQ7").replace('power_on = "done"\n', "")
    assert run(tmp_path, capfd, elf, text)[:2] == (2, "")


def test_an_image_of_another_processor_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="an image for a 68000; this processor is an ARM"):
        run_cpu("cortex-m3", str(image(tmp_path, "nop")), str(FOLDER / "board.toml"))


def test_an_endless_loop_is_ended_by_the_limit_and_its_place_said(tmp_path: Path) -> None:
    elf = image(tmp_path, "1: addq.l #1, %d0\n bra 1b")
    assert "the next instruction is at 0000040" in ended("68000", elf, FOLDER / "board.toml")
