/* lm629_bus.c - an LM629 on the port bits of an ATmega328P (16 MHz).
 *
 *     D0, D1   PB0, PB1      /CS  PC0      /RD   PC2      /RST  PC4
 *     D2-D7    PD2-PD7       /PS  PC1      /WR   PC3
 *
 * PD0 and PD1 are the UART, so the data bus lies on two ports. A port access takes 62.5 ns or more;
 * the delays below are for the limits that are longer.
 */
#include "lm629_bus.h"
#include "lm629_driver.h"

#include <avr/io.h>
#include <util/delay.h>

#ifndef cbi
#define cbi(port, bit) ((port) &= (uint8_t)~_BV(bit))
#define sbi(port, bit) ((port) |= _BV(bit))
#endif

#define CS PC0
#define PS PC1
#define RD PC2
#define WR PC3
#define RST PC4
#define CONTROL (_BV(CS) | _BV(PS) | _BV(RD) | _BV(WR) | _BV(RST))
#define LOW_BITS 0x03  /* of the data bus, on port B */
#define HIGH_BITS 0xFC /* on port D */

static void data_out(uint8_t data)
{
    PORTB = (uint8_t)((PORTB & ~LOW_BITS) | (data & LOW_BITS));
    PORTD = (uint8_t)((PORTD & ~HIGH_BITS) | (data & HIGH_BITS));
    DDRB |= LOW_BITS;
    DDRD |= HIGH_BITS;
}

static void data_in(void)
{
    DDRB &= (uint8_t)~LOW_BITS;
    DDRD &= (uint8_t)~HIGH_BITS;
    PORTB &= (uint8_t)~LOW_BITS;
    PORTD &= (uint8_t)~HIGH_BITS;
}

static void write_cycle(uint8_t data)
{
    cbi(PORTC, CS);
    cbi(PORTC, WR);
    data_out(data); /* while /WR is low: 50 ns before it rises are enough */
    sbi(PORTC, WR);
    sbi(PORTC, CS);
    data_in();
}

static uint8_t read_cycle(void)
{
    uint8_t data;

    cbi(PORTC, CS);
    cbi(PORTC, RD);
    _delay_us(0.25); /* access time 180 ns, and the input synchroniser */
    data = (uint8_t)((PINB & LOW_BITS) | (PIND & HIGH_BITS));
    sbi(PORTC, RD);
    sbi(PORTC, CS);
    return data;
}

uint8_t lm629_bus_read_status(void)
{
    cbi(PORTC, PS);
    return read_cycle();
}

void lm629_bus_write_command(uint8_t command)
{
    cbi(PORTC, PS);
    write_cycle(command);
}

uint8_t lm629_bus_read_data(void)
{
    sbi(PORTC, PS);
    return read_cycle();
}

void lm629_bus_write_data(uint8_t data)
{
    sbi(PORTC, PS);
    write_cycle(data);
}

void lm629_bus_init(void)
{
    PORTC |= CONTROL;
    DDRC |= CONTROL;
    data_in();
    cbi(PORTC, RST);
    _delay_us(12);
    sbi(PORTC, RST);
    _delay_ms(1.6); /* the reset takes up to 1.5 ms */
}
