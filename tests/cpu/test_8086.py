"""DOS programs in the emulator: ports, the card's interrupt, the timer, and services of DOS."""

import struct
import sys
from pathlib import Path

import pytest

from tests.boards import AXIS
from tests.cpu.conftest import EXAMPLES, build, ended
from tests.firmware import run_cpu
from vbus.core import exit_codes
from vbus.core.errors import ConfigError, ProgramError

FOLDER = EXAMPLES / "mc1241a_dos"
BOARD = FOLDER / "board.toml"
NASM = ["nasm", "-f", "bin"]
END = "mov ah, 4Ch\n int 21h\n"


def program(folder: Path, body: str, name: str = "x.com") -> Path:
    source = folder / "x.asm"
    source.write_text(f"cpu 8086\norg 100h\n{body}\n")
    return build(folder / name, NASM, source)


def run(
    folder: Path, capfd: pytest.CaptureFixture[str], image: Path, board: Path = BOARD
) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr."""
    code = run_cpu("8086", str(image), str(board), summary=False)
    said = capfd.readouterr()
    return code, said.out, said.err


@pytest.mark.slow
def test_the_example_gives_what_it_says_with_one_transcript_over_three_runs(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    image = build(tmp_path / "move.com", NASM, FOLDER / "move.asm")
    transcripts = set()
    for turn in range(3):
        transcript = tmp_path / f"{turn}.txt"
        assert run_cpu("8086", str(image), str(BOARD), transcript=str(transcript)) == 0
        said = capfd.readouterr()
        assert (said.out, said.err) == ((FOLDER / "expected.txt").read_text(), "")
        transcripts.add(transcript.read_text())
    assert len(transcripts) == 1


def test_an_exe_is_relocated_and_has_its_own_stack(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    body = (
        """mov ax, 0
        mov ds, ax
        mov dx, text - 100h
        mov ah, 9
        int 21h
        mov ax, ss
        mov bx, cs
        sub ax, bx
        """
        + END
        + "text db 'an EXE', 13, 10, '$'"
    )
    code = program(tmp_path, body, "x.bin").read_bytes()
    head = struct.pack(
        "<2s13H", b"MZ", (32 + len(code)) % 512, 1, 1, 2, 0, 0xFFFF, 0x20, 0x100, 0, 0, 0, 0x1C, 0
    )
    image = tmp_path / "x.exe"
    image.write_bytes(head + struct.pack("<HH", 1, 0) + code)
    assert run(tmp_path, capfd, image) == (0x20, "an EXE\n", "")


def test_the_timer_ticks_and_time_passes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """36 or 37 ticks of the timer are two seconds of DOS's clock; its date is always the same."""
    body = """mov ah, 0
        int 1Ah
        mov si, dx
        mov ah, 2Ch
        int 21h
        mov bl, dh
wait_:  hlt
        mov ah, 2Ch
        int 21h
        sub dh, bl
        cmp dh, 2
        jb wait_
        mov ah, 0
        int 1Ah
        sub dx, si
        mov al, dl
        """ + END  # fmt: skip
    code, _, err = run(tmp_path, capfd, program(tmp_path, body))
    assert (code in (36, 37), err) == (True, "")


def test_the_timer_can_be_set_and_read(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    body = (
        """mov al, 36h
        out 43h, al
        mov ax, 11932
        out 40h, al
        mov al, ah
        out 40h, al
        mov ah, 0
        int 1Ah
        mov si, dx
        mov cx, 10
wait_:  hlt
        loop wait_
        mov ah, 0
        int 1Ah
        sub dx, si
        xor al, al
        out 43h, al
        in al, 40h
        mov bl, al
        in al, 40h
        mov bh, al
        cmp bx, 11932
        mov al, 99
        ja end_
        mov al, dl
end_:   """
        + END
    )
    assert run(tmp_path, capfd, program(tmp_path, body)) == (10, "", "")


LETS_IN = {
    "sti": ("cli\n call wait_\n sti\n", 1),  # the instruction after STI comes before
    "popf": ("pushf\n cli\n call wait_\n popf\n", 0),
    "iret": ("mov dx, masked\n mov ax, 2560h\n int 21h\n int 60h\n", 0),
}


@pytest.mark.parametrize("name", LETS_IN)
def test_a_request_that_waits_comes_as_soon_as_it_may(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    lets_in, before = LETS_IN[name]
    body = f"""mov dx, isr
        mov ax, 2508h
        int 21h
        xor bx, bx
        {lets_in}
        inc bl
        inc bl
        inc bl
        mov al, [came]
        {END}
masked: call wait_
        iret
wait_:  mov cx, 0       ; 65,536 times, in which the timer ticks
        loop $
        ret
isr:    mov [came], bl
        iret
came:   db 99"""
    assert run(tmp_path, capfd, program(tmp_path, body)) == (before, "", "")


def test_the_bios_prints_a_character(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    body = "mov ax, 0E21h\n int 10h\n mov al, 4\n"
    assert run(tmp_path, capfd, program(tmp_path, body + END)) == (4, "!\n", "")


def test_a_request_whose_line_falls_before_it_is_served_is_forgotten(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    # HI is high after the reset; RSTI lets it fall while IRQ 5 is masked.
    board = tmp_path / "board.toml"
    board.write_text(
        AXIS.format(time="slaved", model="ideal")
        + """
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
card = "isa"
pinmap = "isa"
[cpu]
clock = "8 MHz"
cycles = 10
[cards.isa]
base = 0x340
decode = "direct"
chips = ["x"]
[pinmaps.isa.pins]
IRQ5 = "x.HI"
"""
    )
    body = (
        """mov dx, isr
        mov ax, 250Dh
        int 21h
        in al, 21h
        or al, 20h
        out 21h, al
        mov dx, 340h
        mov al, 1Dh
        out dx, al
        inc dx
        mov cx, 200
wait1:  loop wait1
        mov al, 0
        out dx, al
        out dx, al
        mov cx, 200
wait2:  loop wait2
        in al, 21h
        and al, 0DFh
        out 21h, al
        mov cx, 20
wait3:  loop wait3
        mov al, [came]
        """
        + END
        + """isr:    sti             ; of IRQ 5; the timer, IRQ 0, is more urgent
        hlt
        add byte [came], 7
        push ax
        mov al, 20h
        out 20h, al
        pop ax
        iret
came:   db 0"""
    )
    image = program(tmp_path, body)
    assert run(tmp_path, capfd, image, board) == (0, "", "")
    image = program(tmp_path, body.replace("or al, 20h", "and al, 0DFh"))
    assert run(tmp_path, capfd, image, board)[0] == 7
    # The first request finds no vector, and ends; a command that is none makes another.
    vector, begin = body.split("        in al, 21h", 1)
    wait = "        mov cx, 200\n        loop $\n"
    unknown = f"""{wait}        mov dx, 340h
        mov al, 1Ch
        out dx, al
{wait}        inc dx
        mov al, 0
        out dx, al
        mov al, 2
        out dx, al
{wait}        dec dx
        mov al, 7Fh
        out dx, al
"""
    begin = "        in al, 21h" + begin.replace("or al, 20h", "and al, 0DFh").replace(
        "        mov cx, 200\nwait2:", f"{vector}{unknown}        mov cx, 200\nwait2:"
    )
    assert run(tmp_path, capfd, program(tmp_path, begin), board)[:2] == (7, "")


def test_the_timer_takes_another_divisor_and_is_read_without_a_command(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    body = (
        """mov al, 36h
        out 43h, al
        mov cx, 2
again:  mov al, 0
        out 40h, al
        mov al, 80h
        out 40h, al
        loop again
        in al, 61h
        in al, 40h
        in al, 40h
        """
        + END
    )
    code, out, err = run(tmp_path, capfd, program(tmp_path, body))
    assert (code in (0x7F, 0x80), out, err) == (True, "", "")


FAILURES = {
    "port": ("mov dx, 300h\n in al, dx\n" + END, 0xFF,
             "no chip of the card answers at 300h: it is read"),
    "service": ("mov ah, 3Dh\n int 21h\n mov al, 0\n adc al, 7\n" + END, 8,
                "function 3Dh of DOS is not modelled: it fails"),
    "screen": ("mov ax, 3\n int 10h\n" + END, 3,
               "function 00h of int 10h is not modelled: it does nothing"),
    "clock": ("mov ah, 2\n int 1Ah\n mov al, 2\n" + END, 2,
              "function 02h of int 1Ah is not modelled: it does nothing"),
    "interrupt": ("int 33h\n mov al, 1\n" + END, 1, "interrupt 33h is not modelled: it returns"),
    "division": ("xor cx, cx\n div cx\n", 1, "a division by zero, at 0100:0102"),
    "stack": ("deep: call deep\n", 1, "stack overflow: SP is"),
    "loop": ("cli\n mov al, 6\n jmp $", 6, ""),
    "return": ("mov ax, 5\n ret\n", 0, ""),
    "halt": ("cli\n hlt\n" + END, 1, "waits for an interrupt that cannot come"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAILURES)
def test_a_failure_is_said(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    body, expected, sentence = FAILURES[name]
    code, _, err = run(tmp_path, capfd, program(tmp_path, body))
    assert (code, sentence in err) == (expected, True), err


def test_an_endless_loop_is_ended_by_the_limit_and_its_place_said(tmp_path: Path) -> None:
    image = program(tmp_path, "again: inc ax\n jmp again")
    assert "the next instruction is at 0000110" in ended("8086", image, BOARD)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\x7fELF" + bytes(60), "is no DOS program"),
        (b"", "is no DOS program"),
        (b"MZ" + bytes(58) + b"\x40\0\0\0PE\0\0", "a program for Windows"),
        (bytes(0x10000), "is no DOS program"),
    ],
)
def test_a_program_of_another_kind_is_refused(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "x.com").write_bytes(data)
    with pytest.raises(ProgramError, match=message) as refused:
        run_cpu("8086", str(tmp_path / "x.com"), str(BOARD))
    assert refused.value.exit_code == exit_codes.NOT_RUNNABLE
    with pytest.raises(ProgramError, match="is no DOS program"):
        run_cpu("8086", sys.executable, str(BOARD))


@pytest.mark.parametrize("key", ['family = "stm32f4"', "rom = 0x8000", "uart = 0x9000"])
def test_a_key_of_another_processor_is_refused(key: str, tmp_path: Path) -> None:
    board = tmp_path / "board.toml"
    board.write_text(BOARD.read_text().replace("cycles = 10", f"cycles = 10\n{key}\n#"))
    with pytest.raises(
        ConfigError, match=rf"{key.split()[0]} of \[cpu\] means nothing to the 8086"
    ):
        run_cpu("8086", str(program(tmp_path, END)), str(board))


def test_a_port_that_the_processor_does_not_have_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "board.toml"
    text = BOARD.read_text().replace("IRQ5", "PA0").replace("base = 0x340", "memory = true")
    board.write_text(text)
    assert run_cpu("8086", str(program(tmp_path, END)), str(board)) == 2
    said = capfd.readouterr().err
    assert "the pin map uses port A, and this processor has IRQ0 to IRQ15" in said
