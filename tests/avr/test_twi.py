"""The TWI of an AVR: a port expander on I2C between the firmware and the chip."""

from collections.abc import Callable

import pytest

from tests.avr.conftest import Compile
from tests.avr.test_firmware import Run, run, transcript

__all__ = ["run", "transcript"]

BOARD = """\
[board]
time = "slaved"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[glue.exp]
part = "PART"
low = ["A1", "A2"]
high = ["A0"]
hosts = ["SDA", "SCL", "/INT"]
[glue.exp.pins]
P0 = "x./RST"
P7 = "x.HI"
[pinmaps.uno.pins]
PB0 = "D0"
PB1 = "D1"
PD2 = "D2"
PD3 = "D3"
PD4 = "D4"
PD5 = "D5"
PD6 = "D6"
PD7 = "D7"
PC0 = "/CS"
PC1 = "/PS"
PC2 = "/RD"
PC3 = "/WR"
PC4 = "exp.SDA"
PC5 = "exp.SCL"
PB2 = "exp./INT"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/twi.sock"
pinmap = "uno"
"""

MASTER = """
#include <util/twi.h>
static uint8_t step(uint8_t control)
{
    TWCR = _BV(TWINT) | _BV(TWEN) | control;
    while (!(TWCR & _BV(TWINT)))
        ;
    return TW_STATUS;
}
static void stop(void) { TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO); _delay_us(10); }
static uint8_t send(uint8_t byte) { TWDR = byte; return step(0); }
static uint8_t store(uint8_t address, const uint8_t *bytes, uint8_t count)
{
    uint8_t status;
    step(_BV(TWSTA));
    status = send(address << 1);
    while (count-- && status != TW_MT_SLA_NACK)
        status = send(*bytes++);
    stop();
    return status;
}
static uint8_t load(uint8_t address, int command)
{
    uint8_t byte;
    step(_BV(TWSTA));
    if (command >= 0) {
        send(address << 1);
        send((uint8_t)command);
        step(_BV(TWSTA));
    }
    send(address << 1 | 1);
    step(0);
    byte = TWDR;
    stop();
    return byte;
}
static uint8_t status(void)
{
    uint8_t byte;
    PORTC &= ~0x07;
    byte = (PIND & 0xFC) | (PINB & 0x03);
    PORTC |= 0x0F;
    return byte;
}
"""


@pytest.mark.parametrize(
    ("part", "program", "expected"),
    [
        (
            "PCF8574",
            "uint8_t low[] = {0xFE}, high[] = {0xFF};"
            "say_hex(store(0x21, low, 1)); say_hex(load(0x21, -1));"
            "_delay_us(50); store(0x21, high, 1); _delay_ms(2);"
            "say_hex(status()); say_hex(load(0x21, -1)); say_hex(store(0x22, low, 1) & 0x28);"
            "say_hex(PINB & 4);",
            ["28", "FE", "84", "FF", "20", "04"],
        ),
        (
            "PCA9554",
            "uint8_t out[] = {1, 0x00}, turn[] = {3, 0xFE}, high[] = {1, 0x01};"
            "store(0x21, out, 2); store(0x21, turn, 2); say_hex(load(0x21, 0) & 1); _delay_us(50);"
            "store(0x21, high, 2); _delay_ms(2); say_hex(status()); say_hex(load(0x21, 0) & 0x81);"
            "say_hex(load(0x21, 3));",
            ["00", "84", "81", "FE"],
        ),
        (
            "PCA9554",
            # Each status is that of the byte which TWINT says has been sent, as drivers check it.
            "say_hex(step(_BV(TWSTA))); say_hex(send(0x42)); say_hex(send(0));"
            "say_hex(step(_BV(TWSTA))); say_hex(send(0x43)); say_hex(step(0));"
            "stop(); step(_BV(TWSTA)); say_hex(send(0x44));"
            "stop(); uint8_t turn[] = {3, 0xFE}; store(0x21, turn, 2); say_hex(load(0x21, 3));"
            "say_hex(status());",
            ["08", "18", "28", "10", "40", "58", "20", "FE", "84"],
        ),
    ],
)
def test_an_expander_on_the_twi_resets_the_chip(
    run: Run,
    firmware: Compile,
    transcript: Callable[[], list[str]],
    part: str,
    program: str,
    expected: list[str],
) -> None:
    elf = firmware(
        f"{MASTER}int main(void) {{ PORTC = 0x0F; DDRC = 0x0F; TWBR = 72; {program} return 0; }}"
    )
    assert run(elf, board=BOARD.replace("PART", part)) == (0, expected)
    assert transcript() == ["x r 0 84"]


def test_port_bits_can_be_the_master_too(run: Run, firmware: Compile) -> None:
    elf = firmware(
        """
#define SDA _BV(4)
#define SCL _BV(5)
static void line(uint8_t which, uint8_t level)
{
    if (level) DDRC &= ~which; else DDRC |= which;
    _delay_us(5);
}
static uint8_t bits(uint16_t value)
{
    uint8_t place, found = 0;
    for (place = 9; place--;) {
        line(SDA, value >> place & 1);
        line(SCL, 1);
        found = found << 1 | (PINC & SDA ? 1 : 0);
        line(SCL, 0);
    }
    return found;
}
static void start(void) { line(SDA, 1); line(SCL, 1); line(SDA, 0); line(SCL, 0); }
int main(void)
{
    start();
    say_hex(bits(0x42 << 1 | 1) & 1);
    say_hex(bits(0x5E << 1 | 1) & 1);
    start();
    say_hex(bits(0x43 << 1 | 1) & 1);
    say_hex(bits(0x1FF));
    say_hex(PINC & SDA ? 1 : 0);
    return 0;
}
"""
    )
    # The ninth bit falls out of the byte at the left: 5Eh read, then no acknowledge.
    assert run(elf, board=BOARD.replace("PART", "PCF8574")) == (0, ["00", "00", "00", "BD", "01"])
