/* avr_ports.c - two LM629 on the port bits of an ATmega328P (16 MHz), behind a 4-to-16 decoder.
 *
 *     D0, D1  PC4, PC5      /PS  PC0      /RD  PC1      /WR  PC2      /RST  PB4
 *     D2-D7   PD2-PD7       number of the chip  PB0-PB3
 */
#include "axes.h"
#include "lm629_driver.h"

#include <avr/io.h>
#include <util/delay.h>

#define PS _BV(PC0)
#define RD _BV(PC1)
#define WR _BV(PC2)
#define RST _BV(PB4)
#define CHIP 0x0F
#define LOW_BITS 0x30  /* of the data bus, on port C */
#define HIGH_BITS 0xFC /* on port D */
#define NONE 0x0F

uint8_t axis;

static void select_chip(uint8_t number)
{
    PORTB = (uint8_t)((PORTB & ~CHIP) | number);
}

static void begin(uint8_t data)
{
    PORTC = (uint8_t)((PORTC & ~PS) | (data ? PS : 0));
    select_chip(axis);
}

static uint8_t read_cycle(uint8_t data)
{
    uint8_t byte;

    begin(data);
    PORTC &= (uint8_t)~RD;
    _delay_us(0.25);
    byte = (uint8_t)((PINC & LOW_BITS) >> 4 | (PIND & HIGH_BITS));
    PORTC |= RD;
    select_chip(NONE);
    return byte;
}

static void write_cycle(uint8_t data, uint8_t byte)
{
    begin(data);
    PORTC = (uint8_t)((PORTC & ~LOW_BITS) | (byte << 4 & LOW_BITS));
    PORTD = (uint8_t)((PORTD & ~HIGH_BITS) | (byte & HIGH_BITS));
    DDRC |= LOW_BITS;
    DDRD |= HIGH_BITS;
    PORTC &= (uint8_t)~WR;
    _delay_us(0.1);
    PORTC |= WR;
    _delay_us(0.1); /* the chip wants its data for 120 ns more */
    DDRC &= (uint8_t)~LOW_BITS;
    DDRD &= (uint8_t)~HIGH_BITS;
    select_chip(NONE);
}

uint8_t lm629_bus_read_status(void)
{
    return read_cycle(0);
}

void lm629_bus_write_command(uint8_t command)
{
    write_cycle(0, command);
}

uint8_t lm629_bus_read_data(void)
{
    return read_cycle(1);
}

void lm629_bus_write_data(uint8_t data)
{
    write_cycle(1, data);
}

void axes_init(void)
{
    UBRR0L = 8; /* 115200 baud */
    UCSR0B = _BV(TXEN0);
    PORTC = PS | RD | WR;
    DDRC = PS | RD | WR;
    PORTB = RST | NONE;
    DDRB = RST | CHIP;
    PORTB &= (uint8_t)~RST;
    _delay_us(12);
    PORTB |= RST;
    _delay_ms(2);
}
