/* avr_xmem.c - two LM629 on the external memory bus of an ATmega2560 (14.7456 MHz). */
#include "axes.h"
#include "lm629_driver.h"

#include <avr/io.h>
#include <util/delay.h>

#define AT(address) (*(volatile uint8_t *)(address))
#define COMMAND AT(0x8000 + 0x10 * axis)
#define DATA AT(0x8001 + 0x10 * axis)
#define LAMPS AT(0x80F0) /* bit 0: no reset */

uint8_t axis;

uint8_t lm629_bus_read_status(void)
{
    return COMMAND;
}

void lm629_bus_write_command(uint8_t command)
{
    COMMAND = command;
}

uint8_t lm629_bus_read_data(void)
{
    return DATA;
}

void lm629_bus_write_data(uint8_t data)
{
    DATA = data;
}

void axes_init(void)
{
    UBRR0L = 7; /* 115200 baud */
    UCSR0B = _BV(TXEN0);
    XMCRA = _BV(SRE) | _BV(SRW11) | _BV(SRW10);
    LAMPS = 0;
    _delay_us(12);
    LAMPS = 1;
    _delay_ms(2);
}
