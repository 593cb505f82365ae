"""Small drivers as they were written for other machines, compiled for the PC."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.left_out import require
from tests.shims.conftest import EXAMPLES, Run, compile_for, flags
from vbus.cli.run.cflags import SHIMS

Driver = Callable[..., Path]

CHIP = """
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""
HOST = '[[hosts]]\ntransport = "unix:$VBUS_RUNTIME/x.sock"\n'
CONTROL = 'PC0 = "/RD"\nPC1 = "/WR"\nPC2 = "/PS"\nPC3 = "/CS"\nPC4 = "/RST"\nPD2 = "HI"\n'
DATA = "".join(f'PB{bit} = "D{bit}"\n' for bit in range(8))


def pins(time: str = "slaved", wires: str = CONTROL + DATA, chip: str = CHIP) -> str:
    return f'[board]\ntime = "{time}"\n{chip}{HOST}pinmap = "m"\n[pinmaps.m.pins]\n{wires}'


def card(more: str = "", time: str = "lockstep") -> str:
    return (
        f'[board]\ntime = "{time}"\n{CHIP}{HOST}card = "c"\n[cards.c]\nbase = 0x340\n'
        f'decode = "direct"\nchips = ["x"]\n{more}'
    )


AVR = """
#include <avr/io.h>
#include <avr/interrupt.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <util/atomic.h>
#include <util/delay.h>
#define sbi(port, bit) (port) |= _BV(bit)
#define cbi(port, bit) (port) &= ~_BV(bit)
void put(char c) { loop_until_bit_is_set(UCSR0A, UDRE0); UDR0 = c; }
void say_hex(uint8_t byte)
{
    put("0123456789ABCDEF"[byte >> 4]);
    put("0123456789ABCDEF"[byte & 15]);
    put('\\n');
}
uint8_t in(uint8_t command)
{
    uint8_t byte;
    DDRB = 0;
    if (command) cbi(PORTC, 2); else sbi(PORTC, 2);
    cbi(PORTC, 3);
    cbi(PORTC, 0);
    byte = PINB;
    sbi(PORTC, 0);
    sbi(PORTC, 3);
    return byte;
}
void out(uint8_t command, uint8_t byte)
{
    if (command) cbi(PORTC, 2); else sbi(PORTC, 2);
    cbi(PORTC, 3);
    cbi(PORTC, 1);
    PORTB = byte;
    DDRB = 0xFF;
    sbi(PORTC, 1);
    sbi(PORTC, 3);
    DDRB = 0;
}
void init(void)
{
    PORTC = 0x1F;
    DDRC = 0x1F;
    cbi(PORTC, 4);
    _delay_us(20);
    sbi(PORTC, 4);
    _delay_ms(2);
}
"""


# -- AVR -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", ["slaved", "lockstep", "realtime"])
def test_avr_sources_run_on_every_kind_of_board(driver: Driver, run: Run, time: str) -> None:
    program = driver(
        "avr",
        AVR + "int main(void) { init(); say_hex(in(1)); out(1, 0x1D); while (in(1) & 1) ;"
        " out(0, 0); out(0, 0); while (in(1) & 1) ; say_hex(in(1)); return 3; }",
        "-DF_CPU=16000000UL",
    )
    ran = run(program, pins(time), code=3)
    if time != "realtime":
        asked = run(program, pins(time), code=3, VBUS_LEASES="0")
        assert (asked.said, asked.bus, asked.when) == (ran.said, ran.bus, ran.when)

    assert ran.said == "84\n80\n"
    assert [line for line in ran.bus if " w " in line] == ["x w 0 1D", "x w 1 00 x2"]


def test_a_delay_is_chip_time_and_costs_nothing(driver: Driver, run: Run) -> None:
    program = driver(
        "avr",
        AVR + "int main(void) { init(); _delay_ms(100000); return in(1) & 0; }",
        "-DF_CPU=16000000UL",
    )
    assert 100_002 * 10**9 < run(program, pins()).when < 100_003 * 10**9


@pytest.mark.parametrize(("delay", "status"), [("_delay_us(30)", "84"), ("_delay_us(5)", "85")])
def test_calibrated_delays_without_polling(
    driver: Driver, run: Run, delay: str, status: str
) -> None:
    program = driver(
        "avr",
        AVR + f"int main(void) {{ init(); out(1, 0x1D); {delay}; say_hex(in(1)); return 0; }}",
        "-DF_CPU=16000000UL",
    )
    assert run(program, pins()).said == f"{status}\n"


def test_a_scattered_bus_and_one_pin_for_both_strobes(driver: Driver, run: Run) -> None:
    wires = (
        'PD7 = "D0"\nPB1 = "D1"\nPD5 = "D2"\nPB3 = "D3"\nPD4 = "D4"\nPB5 = "D5"\nPD6 = "D6"\n'
        'PB0 = "D7"\nPC0 = ["/RD", "!/WR"]\nPC2 = "/PS"\nPC3 = "/CS"\n'
    )
    program = driver(
        "avr",
        """
#include <avr/io.h>
#include <util/delay.h>
int main(void)
{
    uint8_t high, low;
    PORTC = 0x0D;
    DDRC = 0x0D;
    _delay_ms(2);
    PORTC &= ~_BV(2);
    PORTC &= ~_BV(0);       /* /RD falls, chip not selected: nothing */
    PORTC &= ~_BV(3);       /* the read begins with /CS */
    high = PIND;
    low = PINB;
    PORTC |= _BV(3);
    PORTC |= _BV(0);
    /* 84h: D2 is PD5 and D7 is PB0. */
    return (high & 0xF0) == 0x20 && (low & 0x2B) == 0x01 ? 9 : 1;
}
""",
        "-DF_CPU=16000000UL",
    )
    assert run(program, pins(wires=wires), code=9).bus == ["x r 0 84"]


def test_a_strobe_that_floats_is_no_cycle(driver: Driver, run: Run) -> None:
    """The select is driven while the strobes are still inputs, as after a reset."""
    program = driver(
        "avr",
        """
#include <avr/io.h>
#include <util/delay.h>
int main(void)
{
    PORTC = 0;
    DDRC = 0x08;            /* /CS low; /RD, /WR and /PS float */
    _delay_us(50);
    PORTC = 0x1F;
    DDRC = 0x1F;
    return 0;
}
""",
        "-DF_CPU=16000000UL",
    )
    assert run(program, pins()).bus == []


def test_two_chips_are_written_by_one_strobe(driver: Driver, run: Run) -> None:
    wires = CONTROL.replace('"/CS"', '"x./CS"').replace('"HI"', '"x.HI"') + 'PC5 = "y./CS"\n'
    two = CHIP + CHIP.replace("chips.x", "chips.y") + '[buses.b]\nchips = ["x", "y"]\n'
    program = driver(
        "avr",
        AVR
        + """
int main(void)
{
    init();
    PORTC |= _BV(5);
    DDRC |= _BV(5);
    cbi(PORTC, 5);          /* y; out() selects x as well */
    out(1, 0x1D);
    sbi(PORTC, 5);
    say_hex(in(1));
    return 0;
}
""",
        "-DF_CPU=16000000UL",
    )
    ran = run(program, pins(wires=wires + DATA, chip=two))
    assert (ran.said, ran.bus) == ("85\n", ["x+y w 0 1D", "x r 0 85"])


def test_data_that_changes_while_the_strobe_is_low_is_taken_as_it_is_at_the_end(
    driver: Driver, run: Run
) -> None:
    program = driver(
        "avr",
        AVR
        + """
int main(void)
{
    init();
    cbi(PORTC, 2);
    cbi(PORTC, 3);
    PORTB = 0x55;
    DDRB = 0xFF;
    cbi(PORTC, 1);
    PORTB = 0xAA;
    PORTB = 0x1D;
    sbi(PORTC, 1);
    PORTB = 0x00;
    sbi(PORTC, 3);
    return 0;
}
""",
        "-DF_CPU=16000000UL",
    )
    assert run(program, pins()).bus == ["x w 0 1D"]


SLEEPER = (
    AVR
    + """
static volatile uint8_t seen;
ISR(INT0_vect) { seen++; }
static void word(uint8_t code, uint8_t high, uint8_t low)
{
    while (in(1) & 1) ;
    out(1, code);
    while (in(1) & 1) ;
    out(0, high);
    out(0, low);
}
int main(void)
{
    uint8_t copy;
    init();
    EICRA = _BV(ISC01) | _BV(ISC00);
    EIMSK = _BV(INT0);
    word(0x1D, 0, 0);
    word(0x1C, 0, 2);       /* MSKI: command error */
    sei();
    while (in(1) & 1) ;
    out(0, 0);              /* data nobody has asked for */
    while (!seen)
        sleep_mode();
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { copy = seen; }
    say_hex(copy);
    return 0;
}
"""
)


@pytest.mark.parametrize("time", ["slaved", "lockstep"])
def test_an_interrupt_line_calls_its_vector(driver: Driver, run: Run, time: str) -> None:
    program = driver("avr", SLEEPER, "-DF_CPU=16000000UL")
    assert run(program, pins(time)).said == "01\n"


def test_other_avrs_have_other_ports(driver: Driver, run: Run) -> None:
    wires = CONTROL + DATA.replace("PB", "PL")
    program = driver(
        "avr",
        AVR.replace("PORTB", "PORTL").replace("DDRB", "DDRL").replace("PINB", "PINL")
        + "int main(void) { init(); return in(1) == 0x84 ? 5 : 1; }",
        "-DF_CPU=16000000UL",
        "-D__AVR_ATmega2560__",
    )
    assert run(program, pins(wires=wires), code=5).bus == ["x r 0 84"]


def test_a_reset_loop_retries_until_the_chip_comes_up(driver: Driver, run: Run) -> None:
    program = driver(
        "avr",
        AVR + "int main(void) { uint8_t n = 0; do { init(); n++; } while (in(1) != 0x84);"
        " return n; }",
        "-DF_CPU=16000000UL",
    )
    run(program, pins(chip=CHIP + "reset_fail = 4\n"), code=4)


def test_without_a_board_it_says_what_to_set(driver: Driver, tmp_path: Path) -> None:
    program = driver("avr", AVR + "int main(void) { init(); return in(1); }", "-DF_CPU=16000000UL")
    environment = {key: value for key, value in os.environ.items() if key != "VBUS_LINK"}
    done = subprocess.run([program], env=environment, capture_output=True, text=True)
    assert done.returncode == 4
    assert done.stderr == (
        "vbus: no board: set VBUS_LINK to a link with a pin map, such as unix:PATH\n"
    )
    done = subprocess.run(
        [program],
        env={**environment, "VBUS_LINK": f"unix:{tmp_path}/x"},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (
        4,
        f"vbus: unix:{tmp_path}/x: No such file or directory\n",
    )


def test_a_link_without_a_pin_map_says_what_to_write(driver: Driver, run: Run) -> None:
    program = driver("avr", AVR + "int main(void) { init(); return in(1); }", "-DF_CPU=16000000UL")
    ran = run(program, pins().replace('pinmap = "m"', ""), code=4)
    assert "name one as pinmap of the host in the board file" in ran.errors


def test_a_limit_ends_a_program_that_polls_for_ever(driver: Driver, run: Run) -> None:
    program = driver("avr", AVR + "int main(void) { for (;;) in(1); }", "-DF_CPU=16000000UL")
    assert run(program, pins(), VBUS_LIMIT_MS="1").errors == ""
    ran = run(program, pins(), code=1, VBUS_LIMIT_MS="1", VBUS_UNTIL="done")
    assert ran.errors == "vbus: done did not come within 1 ms\n"


COMPUTED = (
    "vbus: the program has computed for 1000 ms without an access to the bus, which is no chip"
    " time; VBUS_LIMIT_MS ends it\n"
)
PRINTS = "#include <stdio.h>\n"


@pytest.mark.parametrize(("until", "code"), [({}, 0), ({"VBUS_UNTIL": "done"}, 1)])
def test_a_limit_ends_a_loop_without_an_access(
    driver: Driver, run: Run, until: dict[str, str], code: int
) -> None:
    """Before or after the first access; what was printed is not lost."""
    program = driver(
        "avr",
        PRINTS + AVR + 'int main(void) { init(); printf("%02X", in(1)); while (1); }',
        "-DF_CPU=16000000UL",
    )
    ran = run(program, pins(), code=code, VBUS_LIMIT_MS="300", **until)
    assert (ran.said.rstrip("\n"), ran.errors) == ("84", COMPUTED)
    program = driver("linux-io", "int main(void) { while (1); }", compiler="gcc")
    assert run(program, card(), code=code, VBUS_LIMIT_MS="300", **until).errors == COMPUTED


LOOPS = 'for (;;) { printf("not d%s", "on"); puts("e"); fputs("almost: don\\n", stdout);'
SAID = "not done\nalmost: don\nnot done\n"


@pytest.mark.parametrize(
    ("shim", "compiler", "loop"),
    [
        ("avr", "g++", "in(1); }"),
        ("linux-io", "gcc", "inb(0x340); }"),
        ("mmio", "gcc", "readb((void *)0x340); }"),
    ],
)
def test_text_that_ends_a_program_may_come_from_printf(
    driver: Driver, run: Run, shim: str, compiler: str, loop: str
) -> None:
    """It ends with the text, which may come in pieces."""
    head = AVR if shim == "avr" else "#include <sys/io.h>\n"
    start = "init();" if shim == "avr" else ""
    more = ["-DF_CPU=16000000UL"] if shim == "avr" else []
    source = f"{PRINTS}{head}int main(void) {{ {start} {LOOPS} {loop} }}"
    board = pins() if shim == "avr" else card("memory = true" if shim == "mmio" else "")
    program = driver(shim, source, *more, compiler=compiler)
    ran = run(program, board, VBUS_UNTIL="don\nnot done", VBUS_LIMIT_MS="100")
    assert (ran.said, ran.errors) == (SAID, "")


@pytest.mark.parametrize("access", ["inb(0x340)", "usleep(100)"])
def test_a_limit_ends_a_program_on_a_card(driver: Driver, run: Run, access: str) -> None:
    source = "#include <sys/io.h>\n#include <unistd.h>\n"
    program = driver(
        "linux-io",
        f"{source}int main(void) {{ inb(0x340); for (;;) {access}; }}",
        "-D_DEFAULT_SOURCE",
        compiler="gcc",
    )
    ran = run(program, card(), code=1, VBUS_LIMIT_MS="20", VBUS_UNTIL="done")
    assert ran.errors == "vbus: done did not come within 20 ms\n"
    assert ran.when // 10**9 == 20


@pytest.mark.parametrize(
    ("shim", "header"), [("avr", "avr/io.h"), ("arduino", "Arduino.h"), ("pic", "xc.h")]
)
def test_the_compiler_notes_once_that_int_is_wider_here(
    tmp_path: Path, shim: str, header: str
) -> None:
    source = tmp_path / "driver.c"
    source.write_text(f"#include <{header}>\nvoid setup(void) {{}}\nvoid loop(void) {{}}\n")
    if shim != "arduino":
        source.write_text(f"#include <{header}>\nint main(void) {{ return 0; }}\n")
    command = [require("g++"), "-Wall", "-Wextra", "-Werror", "-D_XTAL_FREQ=4000000"]
    command += ["-o", str(tmp_path / "driver"), str(source), *flags(shim)]
    for more, count in (([], 1), (["-DVBUS_INT_IS_32_BITS"], 0)):
        done = subprocess.run([*command, *more], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        noted = "note: \u2018#pragma message: int has 32 bits here and 16 on the microcontroller:"
        assert done.stderr.count(noted.replace("\u2018", "'")) + done.stderr.count(noted) == count


# -- Arduino ---------------------------------------------------------------------------------------


def test_an_arduino_sketch(tmp_path: Path, run: Run) -> None:
    sketch = tmp_path / "sketch.ino"
    sketch.write_text(
        """
const byte DATA[8] = {8, 9, 10, 11, 12, 13, 6, 7};
void setup() {
  Serial.begin(9600);
  for (int pin = A0; pin <= A4; pin++) { digitalWrite(pin, HIGH); pinMode(pin, OUTPUT); }
  digitalWrite(A4, LOW);
  delayMicroseconds(20);
  digitalWrite(A4, HIGH);
  unsigned long began = micros();
  delay(2);
  Serial.println((micros() - began) / 1000);
  digitalWrite(A2, LOW);
  digitalWrite(A3, LOW);
  digitalWrite(A0, LOW);
  byte value = 0;
  for (byte bit = 0; bit < 8; bit++) bitWrite(value, bit, digitalRead(DATA[bit]));
  digitalWrite(A0, HIGH);
  Serial.print(F("status "));
  Serial.println(value, HEX);
  Serial.print(-5L); Serial.print(' '); Serial.print(3.14159); Serial.print(' ');
  Serial.println(String(42) + "!" + (B10000001 == 0x81 ? "" : "?"));
  DDRB |= B00000011;
  Serial.println(map(5, 0, 10, 0, 100));
}
void loop() { if (millis() > 50) Serial.println("done"); }
"""
    )
    wires = CONTROL + "".join(f'PB{bit} = "D{bit}"\n' for bit in range(6))
    wires += 'PD6 = "D6"\nPD7 = "D7"\n'
    program = compile_for(
        "arduino", tmp_path / "sketch", "-x", "c++", "-include", "Arduino.h", sketch
    )
    ran = run(program, pins(wires=wires), VBUS_UNTIL="done")
    assert ran.said == "2\nstatus 84\n-5 3.14 42!\n50\ndone\n"


@pytest.mark.parametrize("time", ["lockstep", "slaved"])
@pytest.mark.parametrize(("step", "looks"), [("10 us", 100), ("250 us", 4)])
def test_looking_at_a_clock_takes_the_clock_step_of_the_board(
    tmp_path: Path, run: Run, time: str, step: str, looks: int
) -> None:
    sketch = tmp_path / "looks.ino"
    sketch.write_text(
        """
void setup() {
  unsigned long began = micros();
  int looks = 0;
  do looks++; while (micros() - began < 1000);
  Serial.println(looks);
}
void loop() { Serial.println("done"); }
"""
    )
    program = compile_for(
        "arduino", tmp_path / "looks", "-x", "c++", "-include", "Arduino.h", sketch
    )
    board = pins(time).replace("[board]", f'[board]\nclock_step = "{step}"')
    assert run(program, board, VBUS_UNTIL="done").said == f"{looks}\ndone\n"


def test_the_arduino_example_on_the_pc(tmp_path: Path, run: Run) -> None:
    folder = EXAMPLES / "lm629_arduino"
    program = compile_for(
        "arduino", tmp_path / "two", f"-I{folder / 'Lm629'}", folder / "Lm629" / "Lm629.cpp",
        "-x", "c++", "-include", "Arduino.h", folder / "TwoAxes" / "TwoAxes.ino",
    )  # fmt: skip
    ran = run(program, (folder / "board.toml").read_text(), VBUS_UNTIL="done")
    assert ran.said == (folder / "expected.txt").read_text()
    assert ran.bus.count("x+y w 0 01") == 3


# -- PIC -------------------------------------------------------------------------------------------


def test_pic_sources_with_bytes_bits_and_short_names(driver: Driver, run: Run) -> None:
    wires = CONTROL.replace("PC", "RC").replace("PD2", "RD2") + DATA.replace("PB", "RB")
    program = driver(
        "pic",
        """
#define _XTAL_FREQ 20000000
#include <xc.h>
#pragma config FOSC = HS
static void put(char c) { while (!PIR1bits.TXIF) ; TXREG = c; }
static unsigned char in(void)
{
    unsigned char byte;
    TRISB = 0xFF;
    LATCbits.LATC2 = 0;
    LATCbits.LATC3 = 0;
    RC0 = 0;
    byte = PORTB;
    PORTCbits.RC0 = 1;
    LATCbits.LATC3 = 1;
    return byte;
}
static void out(unsigned char byte)
{
    LATC2 = 0;
    LATC &= ~0x08;
    LATCbits.LATC1 = 0;
    LATB = byte;
    TRISB = 0;
    NOP();
    LATCbits.LATC1 = 1;
    LATC |= 0x08;
    TRISB = 0xFF;
}
void main(void)
{
    ANSELB = 0;
    LATC = 0x1F;
    TRISC = 0xE0;
    TRISCbits.TRISC4 = 0;
    LATCbits.LATC4 = 0;
    __delay_us(20);
    LATCbits.LATC4 = 1;
    __delay_ms(2);
    TXSTAbits.TXEN = 1;
    RCSTAbits.SPEN = 1;
    put(in() == 0x84 ? 'y' : 'n');
    out(0x1D);
    put(in() == 0x85 ? 'y' : 'n');
    __delay_us(20);
    put(in() == 0x84 ? 'y' : 'n');
    put(PORTDbits.RD2 ? '1' : '0');
}
""",
    )
    ran = run(program, pins(wires=wires))
    # After a reset the trajectory-complete interrupt is on, and so is its flag.
    assert ran.said == "yyy1\n"
    assert ran.bus == ["x r 0 84", "x w 0 1D", "x r 0 85", "x r 0 84"]


# -- port I/O --------------------------------------------------------------------------------------

PORT_IO = """
#include <stdio.h>
#include <unistd.h>
#include <sys/io.h>
#define BASE 0x340
int main(void)
{
    int polls = 0;
    if (iopl(3) < 0 || ioperm(BASE, 2, 1) < 0)
        return 1;
    outb(0x1D, BASE);
    while (inb(BASE) & 1)
        polls++;
    outb_p(0, BASE + 1);
    outb_p(0, BASE + 1);
    while (inb(BASE) & 1)
        outb(0, 0x80);
    printf("%d %02X %02X %04X\\n", polls > 10 && polls < 20, inb(0x350), inb(BASE), inw(0x400));
    return 0;
}
"""


@pytest.mark.parametrize("compiler", ["gcc", "g++"])
@pytest.mark.parametrize("time", ["lockstep", "slaved"])
def test_linux_port_io(driver: Driver, run: Run, compiler: str, time: str) -> None:
    program = driver("linux-io", PORT_IO, compiler=compiler)
    board = card(time=time).replace('plant = "none"', 'plant = "none"\nreset_time = "1 us"')
    ran = run(program, board)
    assert ran.said == "1 FF 80 FFFF\n"
    asked = run(program, board, VBUS_LEASES="0")
    assert (asked.said, asked.bus, asked.when) == (ran.said, ran.bus, ran.when)
    assert ran.bus[0] == "x w 0 1D"


@pytest.mark.parametrize("compiler", ["gcc", "g++"])
@pytest.mark.parametrize("time", ["lockstep", "slaved"])
def test_sleeps_and_clocks_follow_chip_time(
    driver: Driver, run: Run, compiler: str, time: str
) -> None:
    """Two looks at the clock, of 1 us each, and two cycles."""
    program = driver(
        "linux-io",
        """
#include <stdio.h>
#include <sys/io.h>
#include <time.h>
#include <unistd.h>
int main(void)
{
    struct timespec begun, ended, pause = {0, 5000000};
    int turn;
    inb(0x340);
    clock_gettime(CLOCK_MONOTONIC, &begun);
    for (turn = 0; turn < 3; turn++)
        usleep(100000);
    nanosleep(&pause, NULL);
    sleep(2);
    inb(0x340);
    clock_gettime(CLOCK_MONOTONIC, &ended);
    printf("%ld us\\n", (long)((ended.tv_sec - begun.tv_sec) * 1000000
                              + (ended.tv_nsec - begun.tv_nsec) / 1000));
    return 0;
}
""",
        compiler=compiler,
    )
    assert run(program, card(time=time)).said == "2305002 us\n"


def test_port_io_with_the_names_of_dos_compilers(driver: Driver, run: Run) -> None:
    program = driver(
        "linux-io",
        """
#include <conio.h>
#include <dos.h>
#include <stdio.h>
int main(void)
{
    delay(2);
    _outp(0x340, 0x1D);
    delay(1);
    outportb(0x341, 0);
    outp(0x341, 0);
    delay(1);
    printf("%02X %02X\\n", _inp(0x340), inportb(0x340));
    return 0;
}
""",
        compiler="gcc",
    )
    assert run(program, card()).said == "80 80\n"


def test_a_forked_child_has_a_session_of_its_own(driver: Driver, run: Run) -> None:
    program = driver(
        "linux-io",
        """
#include <stdio.h>
#include <sys/io.h>
#include <sys/wait.h>
#include <unistd.h>
int main(void)
{
    int status;
    inb(0x340);
    if (fork() == 0)
        _exit(inb(0x340) & 0x80 ? 5 : 6);
    wait(&status);
    printf("%d %d\\n", WEXITSTATUS(status), inb(0x340) >> 7);
    return 0;
}
""",
        compiler="gcc",
    )
    ran = run(program, card().replace('time = "lockstep"', 'time = "lockstep"\npower_on = "done"'))
    assert ran.said == "5 1\n"


def test_a_board_on_a_busy_machine_has_a_minute_for_a_reply(driver: Driver, run: Run) -> None:
    """The program's poll takes the place of the C library's, and notes how long it is to wait."""
    program = driver(
        "linux-io",
        """
#define _GNU_SOURCE
#include <poll.h>
#include <stdio.h>
#include <sys/io.h>
static int longest;
int poll(struct pollfd *set, nfds_t count, int ms)
{
    longest = ms > longest ? ms : longest;
    return ppoll(set, count, NULL, NULL);
}
int main(void)
{
    inb(0x340);
    printf("%d\\n", longest > 50000);
    return 0;
}
""",
        compiler="gcc",
    )
    assert run(program, card(time="realtime")).said == "1\n"


def test_a_link_without_a_card_says_what_to_write(driver: Driver, run: Run) -> None:
    program = driver("linux-io", PORT_IO, compiler="gcc")
    ran = run(program, card().replace('card = "c"', ""), code=4)
    assert "name one as card of the host in the board file" in ran.errors


@pytest.mark.parametrize("turn", [1, 2])
def test_calibrated_delay_loops_are_enough_in_real_time(
    tmp_path: Path, run: Run, turn: int
) -> None:
    """A filter is loaded and the signals are read without one look at the busy bit."""
    source = Path(__file__).parents[1] / "e2e" / "driver_habits.c"
    program = compile_for("linux-io", tmp_path / "habits", "-O2", source, compiler="gcc")
    board = card(time="realtime").replace("[board]", '[board]\npower_on = "done"')
    ran = run(program, board, "delays")
    assert ran.said == "signals 8184, status 84\n"
    assert [line for line in ran.bus if line.startswith("!")] == []


# -- memory-mapped ---------------------------------------------------------------------------------


@pytest.mark.parametrize("standard", ["-std=gnu99", "-std=c99"])
def test_macros_of_memory_mapped_chips(driver: Driver, run: Run, standard: str) -> None:
    program = driver(
        "mmio",
        """
#include <linux/io.h>
#include <stdio.h>
int main(void)
{
    volatile void __iomem *chip = (volatile void *)0x340;
    out_8(0x340, 0x1D);
    while (ioread8(chip) & 1)
        ;
    iowrite16be(0x1234, (char *)chip + 1 - 1 + 0);
    printf("%02X\\n", readb(chip) & 0x80);
    return 0;
}
""",
        standard,
        compiler="gcc",
    )
    ran = run(program, card().replace('time = "lockstep"', 'time = "lockstep"\npower_on = "done"'))
    assert ran.said == "80\n"
    # A big-endian access of 16 bits: the byte at the lower address first, and most significant.
    assert [line for line in ran.bus if " w " in line] == ["x w 0 1D", "x w 0 12", "x w 1 34"]


def test_registers_that_are_objects(driver: Driver, run: Run) -> None:
    program = driver(
        "mmio",
        """
#define STATUS REG8(0x340)
#define COMMAND MMIO8(0x340)
#define DATA HWREGB(0x341)
int main(void)
{
    uint8_t status;
    COMMAND = 0x1D;
    do status = STATUS; while (status & 0x01);
    DATA = 0;
    DATA = 0;
    COMMAND |= 0x40;
    return 0;
}
""",
    )
    ran = run(program, card().replace('time = "lockstep"', 'time = "lockstep"\npower_on = "done"'))
    assert [line for line in ran.bus if " w " in line][:3] == [
        "x w 0 1D",
        "x w 1 00 x2",
        "x w 0 C5",
    ]


# -- 32 bits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("shim", ["arduino", "avr", "pic", "linux-io", "mmio"])
def test_every_shim_builds_for_32_bits(shim: str, tmp_path: Path) -> None:
    probe = tmp_path / "probe.cpp"
    probe.write_text("#include <string>\nint main() { return std::string().size(); }\n")
    command = [require("g++"), "-m32", "-o", str(tmp_path / "probe"), str(probe)]
    done = subprocess.run(command, capture_output=True)
    if done.returncode:
        pytest.skip("needs a 32-bit compiler (g++-multilib)")
    source = tmp_path / "driver.cpp"
    main = "#include <Arduino.h>\nvoid setup() {}\nvoid loop() {}\n"
    source.write_text(
        main
        if shim == "arduino"
        else "#include <xc.h>\nvoid main(void) {}\n"
        if shim == "pic"
        else "int main() { return 0; }\n"
    )
    compile_for(shim, tmp_path / "driver", "-m32", source)


def test_flags_name_files_that_are_there() -> None:
    for shim in SHIMS:
        named = [flag for flag in flags(shim) if flag.startswith("/") and "," not in flag]
        assert named
        assert all(Path(name).is_file() for name in named)
