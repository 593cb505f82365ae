"""Cortex-M firmware in the emulator: peripherals of an STM32, interrupts, time, and failures."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.boards import AXIS
from tests.cpu.conftest import ARM, EXAMPLES, PROGRAMS, build, ended, example
from tests.firmware import run_cpu
from vbus.cli.run.firmware import settings_of
from vbus.core.errors import ConfigError, ProgramError

FOLDER = EXAMPLES / "stm32_lm629_mcp1200"
BOARD = """[board]
name = "bench"
time = "slaved"

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "ideal"

[cpu]
clock = "72 MHz"

[pinmaps.stm32.pins]
PB8 = "D0"
PB9 = "D1"
PB10 = "D2"
PB11 = "D3"
PB12 = "D4"
PB13 = "D5"
PB14 = "D6"
PB15 = "D7"
PA0 = "/CS"
PA1 = "/PS"
PA2 = "/RD"
PA3 = "/WR"
PA4 = "/RST"
PA5 = "HI"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/bench.sock"
pinmap = "stm32"
"""
GPIOA = 0x40010800
VECTORS = """
__attribute__((section(".vectors"), used)) static const void *const vectors[80] = {
    (void *)0x20005000, (void *)reset, VECTORS };
"""


class Bench:
    """Builds firmware from the body of a file, and runs it."""

    def __init__(self, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
        self.folder = folder
        self.capfd = capfd
        self.board = BOARD
        self.limit: int | None = None
        self.summary = False

    def image(self, body: str, vectors: str = "0", flags: tuple[str, ...] = ()) -> Path:
        source = self.folder / "main.c"
        source.write_text(
            '#include "arm.h"\n' + body + VECTORS.replace("VECTORS }", vectors + " }")
        )
        flags = (f"-I{PROGRAMS}", "-T", str(PROGRAMS / "arm.ld"), "-Wno-cast-function-type", *flags)
        return build(self.folder / "main.elf", [*ARM, *flags], source, Path("-lgcc"))

    def run(self, body: str, vectors: str = "0", spec: str = "cortex-m3") -> tuple[int, str, str]:
        """Return exit code, stdout and stderr."""
        return self.run_image(self.image(body, vectors), spec)

    def run_image(self, image: Path, spec: str = "cortex-m3") -> tuple[int, str, str]:
        board = self.folder / "board.toml"
        board.write_text(self.board)
        transcript = str(self.folder / "bus.txt")
        code = run_cpu(spec, str(image), str(board), transcript=transcript, summary=self.summary)
        said = self.capfd.readouterr()
        return code, said.out, said.err

    def bus(self) -> list[str]:
        return (self.folder / "bus.txt").read_text().splitlines()


@pytest.fixture
def bench(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Bench:
    return Bench(tmp_path, capfd)


@pytest.mark.slow
def test_the_example_gives_what_it_says_with_one_transcript_over_three_runs(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    image = str(example(FOLDER.name, tmp_path / "move.elf"))
    transcripts = set()
    for turn in range(3):
        transcript = tmp_path / f"{turn}.txt"
        board = str(FOLDER / "board.toml")
        assert run_cpu("cortex-m3", image, board, transcript=str(transcript)) == 0
        said = capfd.readouterr()
        assert (said.out, said.err) == ((FOLDER / "expected.txt").read_text(), "")  # no violation
        transcripts.add(transcript.read_text())
    (only,) = transcripts
    assert len(only.splitlines()) > 100


READ = """
static unsigned status(void)
{
    unsigned byte;

    R(GPIOA + 0x14) = 3;
    R(GPIOA + 0x14) = 4;
    byte = R(GPIOB + 8) >> 8;
    R(GPIOA + 0x10) = 4;
    R(GPIOA + 0x10) = 1;
    return byte;
}
static void begin(void)
{
    CLOCKS |= 0x1D;
    R(GPIOA + 0x10) = 0x1F;
    R(GPIOA) = 0x44433333;
}
"""


@pytest.mark.parametrize("early", [True, False], ids=["early", "right"])
def test_a_byte_that_is_taken_before_its_strobe_is_told(bench: Bench, early: bool) -> None:
    look, strobe = "    byte = R(GPIOB + 8) >> 8;\n", "    R(GPIOA + 0x14) = 4;\n"
    read = READ.replace(strobe + look, look + strobe) if early else READ
    bench.summary = True
    code, _, said = bench.run(
        read + "int main(void) { int n; begin(); for (n = 0; n < 40000; n++) __asm__ volatile("
        '"nop"); return status() != 0x84; }'
    )
    assert code == early
    told = [line for line in said.splitlines() if "the host took" in line]
    assert len(told) == early
    assert all("x: the host took FFh where the chip gave 84h at 166" in line for line in told)


def test_main_s_result_is_the_exit_code(bench: Bench) -> None:
    assert bench.run('int main(void) { put("hello\\n"); return 3; }') == (3, "hello\n", "")


def test_port_bits_run_bus_cycles(bench: Bench) -> None:
    body = (
        READ
        + """int main(void) { int n; begin();
        for (n = 0; n < 40000; n++) __asm__ volatile("nop");
        number(status()); number(R(GPIOA + 8) & 0x3F); return 0; }"""
    )
    assert bench.run(body) == (0, "132\n61\n", "")
    assert bench.bus() == ["x r 0 84"]


def test_an_f4_has_moder_and_no_brr(bench: Bench) -> None:
    bench.board = BOARD.replace('clock = "72 MHz"', 'clock = "168 MHz"')
    body = """
#define A 0x40020000
#define B 0x40020400
int main(void) { int n; R(0x40023830) = 3;
    R(A + 0x18) = 0x1F; R(A) = 0x155; R(B) = 2 << 20;  /* PB10, a peripheral's, is not driven */
    for (n = 0; n < 120000; n++) __asm__ volatile("nop");
    R(A + 0x18) = 3 << 16; R(A + 0x18) = 4 << 16;
    n = R(B + 0x10) >> 8; R(A + 0x14) |= 5; number(n); R(0x40011004) = 'x'; R(A + 0x28) = 1;
    return 0; }"""
    code, out, err = bench.run(body, spec="cortex-m4")
    assert (code, out, bench.bus()) == (0, "132\nx\n", ["x r 0 84"])
    assert "GPIOA+28h (40020028h) is not modelled: it is written, to no effect" in err


def test_interrupts_come_at_exact_clock_cycles(bench: Bench) -> None:
    body = """
static volatile uint32_t times[5], count;
void systick(void) { if (count < 5) times[count++] = R(0xE0001004); }
int main(void) { int n; R(0xE000EDFC) = 1 << 24; R(0xE0001000) = 1;
    R(0xE000E014) = 999; R(0xE000E018) = 0; R(0xE000E010) = 7;
    while (count < 5) __asm__ volatile("nop");
    for (n = 1; n < 5; n++) number(times[n] - times[n - 1]);
    return 0; }"""
    assert bench.run(body, "[15] = (void *)systick")[:2] == (0, "1000\n" * 4)


def test_a_priority_decides_and_masks_hold(bench: Bench) -> None:
    body = """
void one(void) { put("one\\n"); }
void two(void) { put("two "); R(0xE000EF00) = 3; R(0xE000EF00) = 1; put("still two\\n"); }
void three(void) { put("three "); }
int main(void) {
    R8(0xE000E401) = 0x80; R8(0xE000E402) = 0x40; R8(0xE000E403) = 0x10;
    R(0xE000E100) = 0xE; R(0xE000ED24) = ~0u;   /* SHCSR, behind the last priority */
    __asm__ volatile("cpsid i");
    R(0xE000E200) = 6; put("masked\\n");
    __asm__ volatile("cpsie i\\n\\tnop");
    put("main\\n");
    return 0; }"""
    vectors = "[17] = (void *)one, [18] = (void *)two, [19] = (void *)three"
    expected = "masked\ntwo three still two\none\nmain\n"
    assert bench.run(body, vectors) == (0, expected, "")


def test_an_interrupt_anywhere_changes_nothing_but_time(bench: Bench) -> None:
    """IT blocks and flags survive: SysTick comes after each 37 cycles, at every instruction."""
    body = """
static volatile uint32_t ticks;
void systick(void) { ticks++; }
static uint32_t work(void) { uint32_t n, sum = 1;
    for (n = 0; n < 3000; n++)
        __asm__ volatile("tst %0, #4\\n\\tittee ne\\n\\taddne %0, %0, %1\\n\\t"
                         "eorne %0, %0, #5\\n\\taddeq %0, %0, #3\\n\\t"
                         "lsleq %0, %0, #1" : "+r"(sum) : "r"(n) : "cc");
    return sum; }
int main(void) { uint32_t quiet = work();
    R(0xE000E014) = 36; R(0xE000E018) = 0; R(0xE000E010) = 7;
    put(work() == quiet ? "same\\n" : "different\\n");
    put(ticks > 300 ? "often\\n" : "seldom\\n"); return 0; }"""
    assert bench.run(body, "[15] = (void *)systick") == (0, "same\noften\n", "")


def test_svc_pendsv_and_the_process_stack(bench: Bench) -> None:
    body = """
static uint32_t stack[64];
void svc(void) { put("svc "); R(0xE000ED04) = 1 << 28; put("before "); }
void pendsv(void) { put("pendsv\\n"); }
int main(void) {
    __asm__ volatile("msr psp, %0\\n\\tmov r0, #2\\n\\tmsr control, r0\\n\\tisb"
                     : : "r"(stack + 64) : "r0");
    __asm__ volatile("svc 0\\n\\tmov r0, #0\\n\\tmsr control, r0\\n\\tisb" : : : "r0");
    put(stack[62] || stack[60] || stack[56] || stack[50] ? "used\\n" : "not used\\n");
    return 0; }"""
    vectors = "[11] = (void *)svc, [14] = (void *)pendsv"
    assert bench.run(body, vectors) == (0, "svc before pendsv\nused\n", "")
    urgent = "int main(void) {\n    R8(0xE000ED1F) = 0x80; R8(0xE000ED22) = 0x40;"
    body = body.replace("int main(void) {", urgent)
    assert bench.run(body, vectors) == (0, "svc pendsv\nbefore used\n", "")


# Of AFIO the register that gives the line its port, and the port; bit and interrupt of the line.
LINES = {"PA5": (0x4001000C, 0, 5, 23), "PB0": (0x40010008, 1, 0, 6)}


@pytest.mark.parametrize("pin", LINES)
def test_a_pin_interrupts_and_a_timer_counts_and_interrupts(pin: str, bench: Bench) -> None:
    bench.board = BOARD.replace("PA5", pin)
    choice, port, line, number = LINES[pin]
    body = (
        f"#define LINE (1 << {line})\n#define CHOICE R({choice})\n#define PORT {port}\n"
        f"#define NUMBER {number}\n{READ}"
        + """
static volatile uint32_t edges, updates;
void pin(void) { R(0x40010414) = LINE; edges++; }
void timer(void) { R(0x40000010) = 0; updates++; }
static void idle(void) { while (status() & 1) ; }
static void out(unsigned ps, unsigned byte) { idle();
    R(GPIOA + (ps ? 0x10 : 0x14)) = 2; R(GPIOA + 0x14) = 9;
    R(GPIOB + 12) = byte << 8; R(GPIOB + 4) = 0x33333333;
    R(GPIOA + 0x10) = 9; R(GPIOB + 4) = 0x44444444; }
int main(void) {
    begin(); CHOICE = PORT; R(0x40010408) = LINE; R(0x40010400) = LINE;
    R(0xE000E100) = 1 << NUMBER | 1 << 28;
    R(0x40000028) = 71; R(0x4000002C) = 999; R(0x40000014) = 1; R(0x40000010) = 0;
    R(0x4000000C) = 1; R(0x40000000) = 1;
    while (updates < 3) __asm__ volatile("wfi");
    number(R(0x40000024) < 5);
    R(0x4000000C) = 0;
    while (status() != 0x84) ;
    out(0, 0x1C); out(1, 0); out(1, 4);
    while (!edges) __asm__ volatile("wfi");
    number(edges); number(status() & 4); return 0; }"""
    )
    vectors = f"[16 + {number}] = (void *)pin, [16 + 28] = (void *)timer"
    code, out, err = bench.run(body, vectors)
    assert (code, out, err) == (0, "1\n1\n4\n", "")


def test_a_timer_is_read_while_it_counts_and_when_it_stands(bench: Bench) -> None:
    body = """int main(void) { unsigned at;
        R(0x4000002C) = 0xFFFF; R(0x40000014) = 1; number(R(0x40000010));
        R(0x40000010) = 0; R(0x40000000) = 4; R(0x40000014) = 1; number(R(0x40000010));
        R(0x40000000) = 5; at = R(0x40000024); number(R(0x40000024) > at);
        while (R(0x40000024) < 99) ;
        R(0x40000014) = 1; number(R(0x40000024) < 99);
        R(0x40000000) = 4; at = R(0x40000024); number(at > 0 && R(0x40000024) == at);
        return 0; }"""
    # An update that the program asks for sets UIF, and with URS it does not.
    assert bench.run(body) == (0, "1\n0\n1\n1\n1\n", "")


def test_a_reset_needs_its_key_and_the_priority_grouping_is_none(bench: Bench) -> None:
    body = """int main(void) { R(0xE000ED0C) = 4; R(0xE000ED0C) = 0x05FA0300; number(7);
        R(0xE000ED0C) = 0x05FA0004; return 0; }"""
    code, out, err = bench.run(body)
    assert (code, out, "the firmware resets the processor (AIRCR), at " in err) == (1, "7\n", True)


def test_the_cycle_counter_stands_until_it_is_let_go(bench: Bench) -> None:
    body = """int main(void) { unsigned at;
        R(0xE0001000) = 0; at = R(0xE0001004); number(R(0xE0001004) == at);
        R(0xE0001000) = 1; at = R(0xE0001004); number(R(0xE0001004) > at); return 0; }"""
    assert bench.run(body) == (0, "1\n1\n", "")


def test_registers_that_are_read_before_they_are_written(bench: Bench) -> None:
    """Priorities of all interrupts, the profiling counters of the DWT, the size of the flash."""
    body = """int main(void) { number(R(0xE000E400)); number(R(0xE0001008));
        number(R(0x1FFFF7E0) & 0xFFFF); return 0; }"""
    assert bench.run(body) == (0, "0\n0\n512\n", "")


def test_a_request_comes_again_until_its_handler_ends_it(bench: Bench) -> None:
    body = """
static const char text[] = "by interrupts\\n", by_dma[] = "by dma\\n";
static volatile uint32_t updates, sent;
void timer(void) { if (++updates == 3) R(0x40000010) = 0; }
void serial(void) { if (text[sent]) R(0x40004404) = text[sent++]; else R(0x4000440C) = 0; }
int main(void) {
    R(0xE000E100) = 1 << 28; R(0xE000E104) = 1 << 6;
    R(0x4000002C) = 999; R(0x4000000C) = 1; R(0x40000000) = 9;
    while (R(0x40000000) & 1) __asm__ volatile("nop");
    number(updates);
    R(0x4000440C) = 0x80;
    while (R(0x4000440C)) __asm__ volatile("nop");
    R(0x40020084) = 7; R(0x40020088) = 0x40004404; R(0x4002008C) = (uint32_t)by_dma;
    R(0x40020080) = 0x91; R(0x40004414) = 0x80;
    number(R(0x40020084)); number(R(0x40020000) >> 24); return 0; }"""
    vectors = "[16 + 28] = (void *)timer, [16 + 38] = (void *)serial"
    # Of the channel all flags but an error: GIF, TCIF, HTIF.
    assert bench.run(body, vectors) == (0, "3\nby interrupts\nby dma\n0\n7\n", "")


RESETS = {
    "cortex-m3": {
        0xE000ED00: 0x411FC231, 0xE0042000: 0x10036414, 0x40022000: 0x30, 0xA0000000: 0x30DB,
        0xA0000008: 0x30D2, 0xA0000104: 0x0FFFFFFF, GPIOA: 0x44444444,
    },
    "cortex-m4": {
        0xE000ED00: 0x410FC241, 0xE0042000: 0x10076413, 0x40007004: 0x4000, 0x40020000: 0xA8000000,
        0x4002000C: 0x64000000, 0x40020400: 0x280, 0x40020408: 0xC0, 0x40020800: 0,
    },
}  # fmt: skip


@pytest.mark.parametrize("spec", RESETS)
def test_registers_hold_what_those_of_the_part_do_after_a_reset(bench: Bench, spec: str) -> None:
    on = "R(0x40023830) |= 7; R(0x40023838) = 1;" if spec == "cortex-m4" else "CLOCKS |= 4;"
    wrong = "".join(
        f"if (R({at:#x}) != {value:#x}) number({at:#x});" for at, value in RESETS[spec].items()
    )
    assert bench.run(f"int main(void) {{ {on} {wrong} return 0; }}", spec=spec) == (0, "", "")


COMMON = {"TIM2": 28, "TIM3": 29, "TIM4": 30, "TIM5": 50, "TIM6": 54, "TIM7": 55, "TIM1": 25,
          "TIM8": 44, "USART1": 37, "USART2": 38, "USART3": 39, "UART4": 52,
          "UART5": 53}  # fmt: skip
OF_F4 = {"TIM9": 24, "TIM10": 25, "TIM11": 26, "TIM12": 43, "TIM13": 44, "TIM14": 45,
         "USART6": 71}  # fmt: skip


@pytest.mark.parametrize(("name", "more"), [("stm32f1", {}), ("stm32f4", OF_F4)])
def test_interrupts_have_the_numbers_of_the_vector_table(name: str, more: dict[str, int]) -> None:
    from vbus.cpu.dma import Dma4
    from vbus.cpu.stm32 import FAMILIES

    family = FAMILIES[name]  # vector tables of RM0008 and RM0090
    rows = {**family.timers, **family.uarts}
    assert {row: number for row, (_, number) in rows.items()} == COMMON | more
    assert Dma4.VECTORS == (11, 12, 13, 14, 15, 16, 17, 47)


@pytest.mark.parametrize("name", ["stm32f1", "stm32f4"])
def test_each_peripheral_has_a_kilobyte_of_its_own(name: str) -> None:
    from vbus.cpu.stm32 import FAMILIES

    family = FAMILIES[name]
    rows = {**family.timers, **family.uarts, **family.storage}
    bases = [*family.named.values(), *(base for base, _ in rows.values())]
    assert not [base for base in bases if base % 0x400]
    assert len(set(bases)) == len(bases)


def test_a_timer_counts_at_the_clock_of_its_bus(bench: Bench) -> None:
    # TIM2 of an F4 with APB1 at a quarter of the clock counts at half of it; TIM1, with APB2 at an
    # eighth, at a quarter.
    body = """int main(void) { uint32_t both[2], n;
        R(0x40000000) = R(0x40010000) = 1; R(0x40023808) = 5 << 10 | 6 << 13;
        R(0xE000E014) = 0xFFFFFF; R(0xE000E010) = 5; R(0x40000024) = R(0x40010024) = 0;
        n = R(0xE000E018);
        for (int turn = 0; turn < 4000; turn++) __asm__ volatile("");
        both[0] = R(0x40000024); both[1] = R(0x40010024); n -= R(0xE000E018);
        return 10 * (n / 2 - both[0] < 20) + (n / 4 - both[1] < 20); }"""
    assert bench.run(body, spec="cortex-m4") == (11, "", "")


def test_dma_copies_from_the_card_and_interrupts(bench: Bench) -> None:
    bench.board = (
        BOARD.split("[pinmaps")[0].replace("\n\n", '\npower_on = "done"\n\n', 1)
        + """[cards.fsmc]
base = 0x60000000
memory = true
ports = [
    { offset = 0, chip = "x", address = 0 }, { offset = 0x1000, chip = "x", address = 1 },
]

[pinmaps.none]

[[hosts]]
transport = "unix:$VBUS_RUNTIME/bench.sock"
card = "fsmc"
pinmap = "none"
"""
    )
    # Four reads of one address go to four bytes; the channel is on with nothing left.
    body = """static volatile uint32_t flags; static volatile uint8_t taken[4];
        void done(void) { flags = R(0x40020000); R(0x40020004) = 1; }
        int main(void) { R(0x4002000C) = 4; R(0x40020010) = 0x60000000;
            R(0x40020014) = (uint32_t)taken; R(0xE000E100) = 1 << 11;
            R(0x40020008) = 0x4000 | 0x80 | 2 | 1;
            if (flags != 7 || R(0x4002000C) != 0 || taken[0] != taken[3]) return 1;
            taken[0] = 0x0C;  /* RDSIGS, to the first address of the card */
            R(0x40020008) = 0; R(0x4002000C) = 1; R(0x40020010) = (uint32_t)taken;
            R(0x40020014) = 0x60000000; R(0x40020008) = 0x4000 | 1;
            while (R8(0x60000000) & 1) ;
            number(R8(0x60001000)); number(R8(0x60001000));
            R(0x40020008) = 0; R(0x4002000C) = 1; R(0x40020014) = 0x10000000;
            R(0x40020004) = 15; flags = 0;
            R(0x40020008) = 0x4000 | 8 | 1;
            number(flags); return taken[3]; }"""
    assert bench.run(body, "[16 + 11] = (void *)done") == (0x84, "129\n132\n9\n", "")


def test_subpriorities_order_and_do_not_interrupt(bench: Bench) -> None:
    # PRIGROUP 5: two bits of four interrupt. Interrupt 1 is higher within the group of 0.
    body = """static volatile int order;
        void low(void) { R(0xE000E200) = 2; order = order * 10 + 1; }
        void high(void) { order = order * 10 + 2; }
        int main(void) { R(0xE000ED0C) = 0x05FA0001 | 5 << 8; R8(0xE000E400) = 0x70;
            R8(0xE000E401) = 0x40; R(0xE000E100) = 3; R(0xE000E200) = 1;
            return order + 100 * (R(0xE000ED0C) == 0xFA050500); }"""
    vectors = "[16] = (void *)low, [17] = (void *)high"
    assert bench.run(body, vectors) == (112, "", "")


def test_bits_of_peripherals_are_words_of_their_own(bench: Bench) -> None:
    body = """int main(void) { R(0x42000000 + 0x21000 * 32 + 24 * 4) = 1;
        number(R(0x42000000 + 0x21000 * 32 + 25 * 4)); number(R(0x40021000) >> 24);
        R(0x4000002C) = 0xFF; R(0x42000000 + 0x2C * 32 + 3 * 4) = 0; number(R(0x4000002C));
        CLOCKS |= 8; R(GPIOB + 16) = 0x300; R8(GPIOB + 19) = 1; number(R(GPIOB + 12));
        return 0; }"""
    assert bench.run(body) == (0, "1\n3\n247\n512\n", "")


def test_semihosting_writes_and_ends(bench: Bench) -> None:
    body = """static uint32_t call(uint32_t what, const void *where) {
        register uint32_t r0 __asm__("r0") = what; register const void *r1 __asm__("r1") = where;
        __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory"); return r0; }
    int main(void) { static const uint32_t end[2] = { 0x20026, 7 };
        const uint32_t part[3] = { 1, (uint32_t)"written", 4 };
        call(4, "by debugger\\n"); call(5, part); call(0x20, end); return 0; }"""
    assert bench.run(body) == (7, "by debugger\nwrit\n", "")
    # Any other reason than that the application has ended is a failure.
    assert bench.run(body.replace("0x20026", "0x20023"))[0] == 1


def test_a_key_ends_the_run(bench: Bench) -> None:
    image = bench.image('int main(void) { for (;;) put("tick\\n"); }')
    assert bench.run_image(image, "cortex-m3,until=tick") == (0, "tick\n", "")
    code, _, err = bench.run_image(image, "cortex-m3,cycles=100,until=tock")
    assert (code, 'the firmware ended before "tock"' in err) == (1, True)


DEEP = """static int deep(int n) { volatile int a[32]; a[n & 31] = n;
    return n ? deep(n + 1) + a[3] : 0; } int main(void) { return deep(1); }"""
FAILURES = {
    "register": (
        "int main(void) { R(0x40013000) = 1; R(0x40013000) = 1; return (int)R(0x40050000); }", 0,
        ["SPI1+00h (40013000h) is not modelled: it is written, to no effect; the instruction at"
         " 08", "40050000h is not modelled: it is read; the answer is 0"],
    ),
    "no clock": (
        "int main(void) { R(GPIOB) = 1; return 0; }", 0,
        ["GPIOB has no clock (bit 3 of RCC APB2ENR is 0): accesses are lost"],
    ),
    "no clock of a timer": (
        "int main(void) { R(0x4002101C) = ~1u; R(0x40000000) = 1; return (int)R(0x40000000); }", 0,
        ["TIM2 has no clock (bit 0 of RCC APB1ENR is 0): accesses are lost, reads give 0; the first"
         " is at offset 00h"],
    ),
    "nothing there": (
        "int main(void) { R(0x50000000) = 1; return 0; }", 1,
        ["the firmware writes 50000000h, where nothing is; the instruction at 08", "(reset+"],
    ),
    "flash": (
        "int main(void) { R(0x08000000) = 1; return 0; }", 1,
        ["the firmware writes 08000000h, which is program memory"],
    ),
    "stack": (DEEP, 1, ["stack overflow: the stack has", "(deep"]),
    "wild": (
        "int main(void) { ((void (*)(void))0x09000001)(); return 0; }", 1,
        ["the firmware jumps to 09000000h, where nothing is"],
    ),
    "undefined": ('int main(void) { __asm__ volatile(".short 0xDEFE"); return 0; }', 1,
                  ["an instruction that this processor does not know, at 08"]),
    "no interrupt": ('int main(void) { __asm__ volatile("wfi"); return 0; }', 1,
                     ["waits for an interrupt that cannot come, at 08"]),
    "no vector": ("int main(void) { R(0xE000E100) = 4; R(0xE000EF00) = 2; return 0; }", 1,
                  ["exception 18 (interrupt 2) comes, and its vector at 08000048h is 00000000h"]),
    "breakpoint": ('int main(void) { __asm__ volatile("bkpt 1"); return 0; }', 1,
                   ["a breakpoint (BKPT) at 08"]),
    "reset": ("int main(void) { R(0xE000ED0C) = 0x05FA0004; return 0; }", 1,
              ["the firmware resets the processor (AIRCR), at 08"]),
}  # fmt: skip


@pytest.mark.parametrize("name", FAILURES)
def test_a_failure_is_said_with_its_place(name: str, bench: Bench) -> None:
    body, expected, sentences = FAILURES[name]
    code, _, err = bench.run(body)
    assert code == expected
    for sentence in sentences:
        assert err.count(sentence) == 1, err


def test_a_wrong_vector_table_is_said(bench: Bench) -> None:
    image = bench.image("int main(void) { return 0; }")
    data = image.read_bytes()
    image.write_bytes(data.replace((0x20005000).to_bytes(4, "little"), bytes(4)))
    code, _, err = bench.run_image(image)
    assert (code, "no vector table at 08000000h: its first word" in err) == (2, True)


def test_an_endless_loop_is_ended_by_the_limit_and_its_place_said(bench: Bench) -> None:
    image = bench.image("volatile int x; int main(void) { for (;;) x++; }")
    board = bench.folder / "board.toml"
    board.write_text(BOARD)
    said = ended("cortex-m3", image, board)
    assert "the limit of chip time is over; the next instruction is at 08" in said


def test_an_image_of_another_processor_is_refused(bench: Bench) -> None:
    board = bench.folder / "board.toml"
    board.write_text(BOARD)
    with pytest.raises(
        ProgramError, match=r"an image for a PC \(x86-64\); this processor is an ARM"
    ):
        run_cpu("cortex-m3", sys.executable, str(board))
    (bench.folder / "x.elf").write_text("no image")
    with pytest.raises(ProgramError, match="is no firmware image"):
        run_cpu("cortex-m3", str(bench.folder / "x.elf"), str(board))


def test_a_board_must_say_how_fast_the_processor_is(bench: Bench) -> None:
    image = bench.image("int main(void) { return 0; }")
    bench.board = BOARD.replace('[cpu]\nclock = "72 MHz"\n', "")
    with pytest.raises(ConfigError, match=r"how fast is the cortex-m3\? Write a \[cpu\] section"):
        bench.run_image(image)


@pytest.mark.parametrize(
    ("spec", "message"),
    [("cortex-m9", 'unknown processor "cortex-m9"'), ("cortex-m3,cycles", '"cycles" needs a value'),
     ("cortex-m3,cycles=x", "write a number of clock cycles"),
     ("cortex-m3,a=1", 'unknown key "a"')],
)  # fmt: skip
def test_a_wrong_specification_is_refused(spec: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        settings_of(spec)


def test_who_does_not_use_it_does_not_import_it() -> None:
    board = AXIS.format(time="slaved", model="ideal")
    names = "vbus.cli.run.exec, vbus.cli.hosted.program, vbus.board.build"
    code = f"""import sys, {names}
vbus.board.build.load_board_text({board!r})
never = ("unicorn", ".cpu.", "fmpy", "pythonfmu3", "vbus.views.fit")
print([name for name in sys.modules if any(one in name for one in never)])"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_campaign_breaks_cycles_of_an_image(bench: Bench) -> None:
    """A bit of the status that nobody checks is silent; the exit code of one that is, detected."""
    body = (
        READ
        + """int main(void) { int n; begin();
        for (n = 0; n < 40000; n++) __asm__ volatile("nop");
        return status() & 1; }"""
    )
    image = bench.image(body)
    bench.run_image(image)
    worlds = ("cycle:x.1:flip0", "cycle:x.1:flip6")
    command = [
        sys.executable,
        "-m",
        "vbus",
        "campaign",
        "--board",
        str(bench.folder / "board.toml"),
    ]
    command += ["--cpu", "cortex-m3"]
    codes = [
        subprocess.run([*command, "--world", world, "--", str(image)], capture_output=True)
        for world in worlds
    ]
    assert [done.returncode for done in codes] == [1, 0], codes
    refused = subprocess.run([*command, "--", str(image), "x"], capture_output=True, text=True)
    assert "--cpu takes one firmware file and no arguments" in refused.stderr
