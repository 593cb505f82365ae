"""I2C1 of an STM32 and port expanders: the sequences of flags that polling drivers wait for."""

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
    bench.board = _board("PCA9554")
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
    assert out.split() == [str(n) for n in (1, 1, low, high, *[0xFE] * 6, 0)]


def test_a_pcf8574_answers_and_nobody_else_does(bench: Bench) -> None:
    bench.board = _board("PCF8574")
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
    R(I2C + 4) |= 0x200;
    return 0; }"""
    )
    code, out, err = bench.run(body)
    assert code == 0
    assert out.split() == ["1", str(0x7E), "1", str(0x7F), "0", str(0xEE), "0", "0"]
    assert "I2C1 makes no interrupts or DMA (CR2 = 0224h): poll SR1" in err


def test_a_bit_takes_its_time(bench: Bench) -> None:
    bench.board = _board("PCF8574")
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


def _board(part: str) -> str:
    pins = 'PB6 = "exp.SCL"\nPB7 = "exp.SDA"\nPB8 = "D0"'
    plain = BOARD.replace('PB8 = "D0"', pins).replace('PA4 = "/RST"\n', "")
    plain = plain.replace('PA5 = "HI"\n', "")
    return plain.replace("[pinmaps", EXPANDER.format(part), 1)


def test_without_i2c_the_pins_are_those_of_the_port(bench: Bench) -> None:
    bench.board = _board("PCF8574")
    body = """int main(void) { CLOCKS |= 0x1D; R(GPIOB) = 0x66444444; R(GPIOB + 0x10) = 0xC0;
    R(GPIOB + 0x14) = 0x40;
    number(R(GPIOB + 8) >> 6 & 3); return 0; }"""
    assert bench.run(body)[:2] == (0, "2\n")
