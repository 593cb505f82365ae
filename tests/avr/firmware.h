/* firmware.h - what the test firmware has in common: words on the UART. */
#include "lm629_bus.h"
#include "lm629_driver.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/delay.h>

static inline void put(char c)
{
    UCSR0B = _BV(TXEN0);
    while (!(UCSR0A & _BV(UDRE0)))
        ;
    UDR0 = (uint8_t)c;
}

static inline void say(const char *text)
{
    while (*text)
        put(*text++);
}

static inline void say_hex(uint8_t byte)
{
    put("0123456789ABCDEF"[byte >> 4]);
    put("0123456789ABCDEF"[byte & 15]);
    put('\n');
    _delay_ms(1); /* until it is sent */
}
