"""I2C1 of an STM32 and port expanders: drivers that poll, that are interrupted, and with DMA."""

import pytest

from tests.cpu.test_cortex_m import BOARD, Bench, bench

__all__ = ["bench"]

EXPANDER = """
[glue.exp]
part = "{}"
low = ["A0", "A1", "A2"]
hosts = ["SDA", "SCL", "/INT"]

[glue.exp.pins]
P0 = "x./RST"
P7 = "x.HI"

[pinmaps"""
DRIVER = """
#define I2C 0x40005400
#define CR1 R(I2C)
#define DR R(I2C + 0x10)
#define SR1 R(I2C + 0x14)
#define SR2 R(I2C + 0x18)
UNUSED int until(uint32_t flag)
{
    for (int n = 0; n < 20000; n++) {
        uint32_t now = SR1;
        if (now & flag) return 1;
        if (now & 0x400) { R(I2C + 0x14) = 0; CR1 |= 0x200; return 0; }
    }
    put("late\\n");
    return 0;
}
UNUSED void open(void)
{
    CLOCKS |= 0x1D; R(GPIOB) = 0xFF444444; R(GPIOB + 4) = 0x44444444;
    R(I2C + 4) = 36; R(I2C + 0x1C) = 180; CR1 = 1;
}
UNUSED int start(uint8_t address)
{
    CR1 |= 0x100;
    if (!until(1)) return 0;
    DR = address;
    return until(2);
}
UNUSED int put_bytes(uint8_t address, const uint8_t *bytes, int count)
{
    if (!start((uint8_t)(address << 1))) return 0;
    (void)SR2;
    while (count--) { if (!until(0x80)) return 0; DR = *bytes++; }
    return until(4);
}
UNUSED void stop(void) { CR1 |= 0x200; while (SR2 & 2) { } }
UNUSED uint8_t get_one(uint8_t address)
{
    if (!start((uint8_t)(address << 1 | 1))) return 0xEE;
    CR1 &= ~0x400u; (void)SR2; CR1 |= 0x200;
    until(0x40);
    return (uint8_t)DR;
}
"""


def test_a_pca9554_is_written_and_read_byte_by_byte(bench: Bench) -> None:
    bench.board = expander_board("PCA9554")
    body = (
        DRIVER
        + """
int main(void) {
    const uint8_t low[] = {1, 0xFE}, out[] = {3, 0xFE}, high[] = {1, 0xFF}, at[] = {0}, own[] = {3};
    open();
    number(put_bytes(0x20, low, 2)); stop();
    number(put_bytes(0x20, out, 2)); stop();
    put_bytes(0x20, at, 1); number(get_one(0x20));
    put_bytes(0x20, high, 2); stop();
    put_bytes(0x20, at, 1); number(get_one(0x20));
    put_bytes(0x20, own, 1);
    if (!start(0x41)) return 9;                 /* two bytes, as HAL has them: POS, then BTF */
    CR1 |= 0xC00; (void)SR2; CR1 &= ~0x400u;
    until(4); CR1 |= 0x200;
    number((uint8_t)DR); number((uint8_t)DR); CR1 &= ~0x800u;
    while (CR1 & 0x200) { }
    number(SR1);
    put_bytes(0x20, own, 1);
    if (!start(0x41)) return 8;                 /* four bytes, as StdPeriph has them */
    CR1 |= 0x400; (void)SR2;
    for (int n = 0; n < 4; n++) {
        if (n == 3) { CR1 &= ~0x400u; CR1 |= 0x200; }
        until(0x40); number((uint8_t)DR);
    }
    while (CR1 & 0x200) { }
    number(SR2);
    return 0; }"""
    )
    code, out, err = bench.run(body)
    assert (code, err) == (0, "")
    low, high = 0x7E, 0x7F  # P1 to P6 are open, and pulled up; HI is low
    assert out.split() == [str(n) for n in (1, 1, low, high, 0xFE, 0xFE, 0, *[0xFE] * 4, 0)]


def test_a_pcf8574_answers_and_nobody_else_does(bench: Bench) -> None:
    bench.board = expander_board("PCF8574")
    body = (
        DRIVER
        + """
int main(void) {
    const uint8_t low[] = {0xFE}, high[] = {0xFF};
    open();
    number(put_bytes(0x20, low, 1)); stop();
    number(get_one(0x20));
    number(put_bytes(0x20, high, 1)); stop();
    number(get_one(0x20));
    number(put_bytes(0x21, high, 1)); number(get_one(0x27));
    for (int n = 0; n < 4000; n++) __asm__ volatile("nop");
    number(SR2); number(SR1);
    return 0; }"""
    )
    code, out, err = bench.run(body)
    assert (code, err) == (0, "")
    assert out.split() == ["1", str(0x7E), "1", str(0x7F), "0", str(0xEE), "0", "0"]


def test_a_bit_takes_its_time(bench: Bench) -> None:
    bench.board = expander_board("PCF8574")
    body = (
        DRIVER
        + """
int main(void) {
    const uint8_t byte[] = {0xFF};
    uint32_t begun;
    R(0xE000EDFC) = 1 << 24; R(0xE0001000) = 1;
    open(); begun = R(0xE0001004);
    put_bytes(0x20, byte, 1);
    number((R(0xE0001004) - begun) / 720);
    return 0; }"""
    )
    code, out, _ = bench.run(body)  # a start and 18 bits of 10 us, and what polls them
    assert code == 0
    assert 18 <= int(out) <= 21


def expander_board(part: str) -> str:
    pins = 'PB6 = "exp.SCL"\nPB7 = "exp.SDA"\nPB8 = "D0"'
    plain = BOARD.replace('PB8 = "D0"', pins).replace('PA4 = "/RST"\n', "")
    plain = plain.replace('PA5 = "HI"\n', "")
    return plain.replace("[pinmaps", EXPANDER.format(part), 1)


def test_without_i2c_the_pins_are_those_of_the_port(bench: Bench) -> None:
    bench.board = expander_board("PCF8574")
    body = """int main(void) { CLOCKS |= 0x1D; R(GPIOB) = 0x66444444; R(GPIOB + 0x10) = 0xC0;
    R(GPIOB + 0x14) = 0x40;
    number(R(GPIOB + 8) >> 6 & 3); return 0; }"""
    assert bench.run(body)[:2] == (0, "2\n")


INTERRUPTED = """
#define CR2 R(I2C + 4)
static volatile uint32_t left, done, failed, events;
static const uint8_t *out;
static uint8_t *in, to;
static void stopped(uint32_t *flag) { CR2 &= ~0x1F00u; CR1 |= 0x200; *flag = 1; }
void event(void)                                  /* the steps are those of HAL's handler */
{
    uint32_t now = SR1;

    events++;
    if (now & 1) { DR = to; return; }
    if (now & 2) {
        if (to & 1 && left == 1) CR1 &= ~0x400u;
        (void)SR2;
        if (to & 1 && left == 1) CR1 |= 0x200;
        return;
    }
    if (now & 4 && !left) { stopped((uint32_t *)&done); return; }
    if (to & 1) {
        *in++ = (uint8_t)DR;
        if (--left == 1) { CR1 &= ~0x400u; CR1 |= 0x200; }
        if (!left) { CR2 &= ~0x700u; done = 1; }
    } else if (left) { DR = *out++; left--; }
    else CR2 &= ~0x400u;                          /* BTF comes when the last byte is out */
}
void error(void) { R(I2C + 0x14) = 0; stopped((uint32_t *)&failed); }
static int wait(void)
{
    for (int n = 0; n < 200000 && !done && !failed; n++) __asm__ volatile("nop");
    while (SR2 & 2) { }
    return done ? 1 : failed ? 2 : 0;
}
static void begin(uint8_t address) { done = failed = events = 0; to = address; CR1 |= 0x500; }
UNUSED int by_interrupts(uint8_t address, const uint8_t *from, uint8_t *into, uint32_t count)
{
    left = count; out = from; in = into; CR2 |= 0x700;
    begin(address);
    return wait();
}
#ifdef STREAMS
#define DMA 0x40026000
#define PORTB 0x40020400
static void opened(void) { R(0x40023830) |= 2; R(PORTB) = 0xA000; R(PORTB + 4) = 0xC0; }
#define SENDS DMA + 0xA0, 1 << 25 | 1 << 10 | 1 << 6 | 16 | 1
#define TAKES DMA + 0x10, 1 << 25 | 1 << 10 | 16 | 1
#define NOTHING R(DMA + 0x58) = 6 << 25 | 1
void sent(void) { R(DMA + 12) = 0x3D << 16; CR2 &= ~0x800u; }
void taken(void) { R(DMA + 8) = 0x3D; stopped((uint32_t *)&done); }
#else
#define DMA 0x40020000
static void opened(void) { CLOCKS |= 0x1D; R(GPIOB) = 0xFF444444; }
#define SENDS DMA + 0x6C, 0x93
#define TAKES DMA + 0x80, 0x83
#define NOTHING R(DMA + 8) = 1
void sent(void) { R(DMA + 4) = 1 << 20; CR2 &= ~0x800u; }
void taken(void) { R(DMA + 4) = 1 << 24; stopped((uint32_t *)&done); }
#endif
static void channel(uint32_t at, uint32_t control, const void *memory, uint32_t count)
{
    R(at) = 0; R(at + 4) = count; R(at + 8) = I2C + 0x10; R(at + 12) = (uint32_t)memory;
    R(at) = control;
}
UNUSED int by_dma(uint8_t address, const void *memory, uint32_t count)
{
    left = 0;
    if (address & 1) channel(TAKES, memory, count); else channel(SENDS, memory, count);
    CR2 |= 0x300 | 0x800 | (address & 1 ? 0x1000 : 0);
    begin(address);
    return wait();
}
static void ready(void)
{
    opened();
    CR2 = 36; R(I2C + 0x1C) = 180; CR1 = 1;
    R(0xE000E100) = 1u << 31 | 1 << 11 | 1 << 16 | 1 << 17; R(0xE000E104) = 1;
}
"""
VECTORS = (
    "[16 + 31] = (void *)event, [16 + 32] = (void *)error, [16 + SENT_BY] = (void *)sent,"
    " [16 + TAKEN_BY] = (void *)taken"
)


@pytest.mark.parametrize(
    ("spec", "family", "sent", "taken"),
    [("cortex-m3", "", "16", "17"), ("cortex-m4", "#define STREAMS\n", "17", "11")],
)
def test_events_errors_and_dma_drive_an_expander(
    bench: Bench, spec: str, family: str, sent: str, taken: str
) -> None:
    bench.board = expander_board("PCA9554")
    body = (
        family
        + DRIVER.replace("UNUSED void open", "#ifndef STREAMS\nUNUSED void open").replace(
            "UNUSED int start", "#endif\nUNUSED int start"
        )
        + INTERRUPTED
        + """
int main(void) {
    static const uint8_t low[] = {1, 0xFE}, out[] = {3, 0xFE}, high[] = {1, 0xFF}, own[] = {3};
    static uint8_t got[4];
    ready();
    number(by_interrupts(0x40, low, 0, 2)); number(events);
    number(by_interrupts(0x40, out, 0, 2));
    number(by_interrupts(0x40, own, 0, 1)); number(by_interrupts(0x41, 0, got, 3));
    number(got[0] == 0xFE && got[1] == 0xFE && got[2] == 0xFE);
    number(by_interrupts(0x42, high, 0, 2)); number(SR1);  /* nothing answers there */
    number(by_dma(0x40, high, 2)); number(events);
    number(by_dma(0x40, own, 1)); number(by_dma(0x41, got, 4));
    number(got[3]); number(SR1); number(R(DMA)); number(R(DMA + 4));
    number(get_one(0x20)); stop();
    NOTHING;
    return 0; }"""
    )
    vectors = VECTORS.replace("SENT_BY", sent).replace("TAKEN_BY", taken)
    code, said, err = bench.run(body, vectors, spec)
    # Events of a transfer: SB, ADDR, TXE for each byte and once more, BTF; by DMA no TXE.
    assert said.split() == [str(n) for n in (1, 6, 1, 1, 1, 1, 2, 0, 1, 3, 1, 1, 254, 0, 0, 0, 254)]
    assert code == 0
    assert (
        err.count("is turned on and moves nothing: the requests that are modelled are I2C1_") == 1
    )
