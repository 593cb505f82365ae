"""Sources for two other compilers of PICs, CCS and C18, compiled for the PC."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.left_out import require
from tests.shims.conftest import EXAMPLES, Run, compile_for, flags
from tests.shims.test_shims import CONTROL, DATA, pins

Driver = Callable[..., Path]
FOLDER = EXAMPLES / "lm629_pic"
WIRES = CONTROL.replace("PC", "RC").replace("PD2", "RD2") + DATA.replace("PB", "RB")

CCS = """
#include <18F4520.h>
#fuses HS,NOWDT
#use delay(clock=20,000,000)
"""


def test_the_examples_of_both_compilers_make_the_same_cycles(tmp_path: Path, run: Run) -> None:
    board = (FOLDER / "board.toml").read_text()
    told = []
    for dialect, clock in (("ccs", ""), ("c18", "-D_XTAL_FREQ=20000000UL")):
        program = compile_for(
            dialect, tmp_path / dialect, "-DVBUS_INT_IS_32_BITS", *clock.split(),
            FOLDER / f"{dialect}.c",
        )  # fmt: skip
        ran = run(program, board)
        assert ran.said == (FOLDER / "expected.txt").read_text()
        told.append([line for line in ran.bus if " w " in line])
    assert told[0] == told[1]
    assert "x w 0 01" in told[0]


def test_types_of_ccs_have_their_widths_and_letters_either_case(driver: Driver, run: Run) -> None:
    program = driver(
        "ccs",
        CCS
        + """
Struct { INT a; long B; int32 c; signed int d; short e; char f; } All;
Void Main()
{
   UNSIGNED INT16 wide = 0xFFFF;
   SIGNED LONG Minus = -2;
   int i = 255;
   int1 bit = 2;               // its lowest bit
   const char text[] = "Int LONG";
   i++;
   WIDE++;
   printf("%u %u %u %u %u|", sizeof(all.a), sizeof(all.b), sizeof(all.c), sizeof(all.d),
          sizeof(signed long));
   printf("%u %lu %Ld %d %s %LX %3u%%", i, wide, minus, bit, text, (int32)0xABCDEF01, 7);
}
""",
    )
    assert run(program, pins(wires=WIRES)).said == "1 2 4 1 2|0 0 -2 0 Int LONG ABCDEF01   7%\n"


@pytest.mark.parametrize(
    ("use", "turned"), [("", "EF"), ("#use standard_io(C)", "EF"), ("#use fast_io(C)", "FF")]
)
def test_only_fast_io_leaves_the_direction_of_a_pin_alone(
    driver: Driver, run: Run, use: str, turned: str
) -> None:
    program = driver(
        "ccs",
        f"{CCS}{use}\n"
        'void main() { set_tris_c(0xFF); output_low(PIN_C4); printf("%X", get_tris_c());'
        " delay_us(20); output_high(pin_c4); }",
    )
    assert run(program, pins(wires=WIRES)).said == f"{turned}\n"


def test_included_files_are_translated_too_and_named_in_messages(tmp_path: Path) -> None:
    (tmp_path / "bus.c").write_text("#byte LATCH = 0xF8A\n\nINT8 Get() { return Nothing; }\n")
    done = compiled(tmp_path, "ccs", CCS + '#include "bus.c"\nvoid main() { LATCH = Get(); }\n')
    assert f"{tmp_path}/bus.c:3:" in done.stderr
    assert "error: ‘nothing’ was not declared" in done.stderr


def compiled(folder: Path, dialect: str, text: str) -> "subprocess.CompletedProcess[str]":
    source = folder / "driver.c"
    source.write_text(text)
    options = [word for word in flags(dialect) if not word.endswith((".c", ".cpp"))]
    return subprocess.run(
        [require("g++"), *options, "-c", "-o", str(folder / "x.o"), str(source)],
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(
    ("dialect", "line", "named"),
    [
        ("ccs", "#use i2c(master, sda=PIN_C4, scl=PIN_C3)", "#use i2c"),
        ("ccs", "#use fixed_io(b_outputs=PIN_B1)", "#use fixed_io"),
        ("ccs", "#INT_EXT", "#int_ext is not there"),
        ("ccs", "#asm", "#asm is not there"),
        ("ccs", "#byte STATUS = 0xFD8", "#byte STATUS = 0xFD8 is not a port's register"),
        ("ccs", "#bit carry = 0xFD8.0", "#bit carry = 0xFD8.0 is not a port's register"),
        ("ccs", "void f() { setup_timer_0(RTCC_INTERNAL); }", "rtcc_internal"),
        ("c18", "void f(void) { T0CON = 0x88; }", "T0CON"),
        ("c18", "void f(void) { _asm nop _endasm }", "_asm"),
        ("c18", "unsigned short long wide;", "‘long’ and ‘short’ specified together"),
    ],
)
def test_what_is_not_there_is_named_with_the_sources_own_line(
    tmp_path: Path, dialect: str, line: str, named: str
) -> None:
    header = CCS if dialect == "ccs" else "\n\n#include <p18f452.h>\n\n"
    done = compiled(tmp_path, dialect, f"{header}{line}\nvoid main(void) {{}}\n")
    assert done.returncode != 0
    errors = [row for row in done.stderr.splitlines() if "error:" in row]
    assert errors[0].startswith(f"{tmp_path}/driver.c:5:")
    assert named in errors[0]


def test_delays_of_c18_are_instruction_cycles_and_0_is_256(driver: Driver, run: Run) -> None:
    text = (
        "#include <p18cxxx.h>\n#include <delays.h>\nvoid main(void) { Delay100TCYx(0); Delay1TCY();"
        " Delay10KTCYx(2); TRISCbits.TRISC4 = !DDRBbits.RB0; }\n"
    )
    ran = run(driver("c18", text, "-D_XTAL_FREQ=40000000UL"), pins(wires=WIRES))
    assert 0 <= ran.when - (25600 + 1 + 20000) * 100_000 <= 400_000
