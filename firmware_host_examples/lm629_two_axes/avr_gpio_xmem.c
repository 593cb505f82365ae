/* avr_gpio_xmem.c - two LM629 on the external memory bus of an ATmega2560 (14.7456 MHz), reset and
 * tested by port bits before the memory interface is on. */
#include "axes.h"
#include "lm629_driver.h"

#include <avr/io.h>
#include <stdlib.h>
#include <util/delay.h>

#define AT(address) (*(volatile uint8_t *)(address))
#define COMMAND AT(0x8000 + 0x10 * axis)
#define DATA AT(0x8001 + 0x10 * axis)

#define WR PG0
#define RD PG1
#define ALE PG2
#define RESET PB7

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

/* A read cycle as the memory interface would make it, bit by bit. */
static uint8_t read_by_hand(uint16_t address)
{
    uint8_t data;

    PORTC = (uint8_t)(address >> 8);
    PORTA = (uint8_t)address;
    DDRA = 0xFF;
    PORTG |= _BV(ALE);
    PORTG &= (uint8_t)~_BV(ALE);
    DDRA = 0;
    PORTA = 0;
    PORTG &= (uint8_t)~_BV(RD);
    _delay_us(0.3);
    data = PINA;
    PORTG |= _BV(RD);
    PORTC = 0; /* no chip is selected */
    return data;
}

void axes_init(void)
{
    uint8_t turn, status;

    UBRR0L = 7; /* 115200 baud */
    UCSR0B = _BV(TXEN0);
    PORTG = _BV(WR) | _BV(RD);
    DDRG = _BV(WR) | _BV(RD) | _BV(ALE);
    PORTC = 0;
    DDRC = 0xFF;
    DDRB = _BV(RESET);
    PORTB = 0;
    _delay_us(12);
    PORTB = _BV(RESET);
    _delay_ms(2);
    for (turn = 0; turn < 2; turn++) {
        status = read_by_hand((uint16_t)(0x8000 + 0x10 * turn));
        if (status != 0x84 && status != 0xC4)
            exit(1);
    }
    XMCRA = _BV(SRE) | _BV(SRW11) | _BV(SRW10);
}
