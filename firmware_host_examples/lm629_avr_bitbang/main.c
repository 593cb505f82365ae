/* main.c - moves an axis and tells about it on the UART, 115200 baud. */
#include "lm629_bus.h"
#include "lm629_driver.h"

#include <avr/io.h>
#include <avr/pgmspace.h>
#include <stdlib.h>
#include <util/delay.h>

#define UBRR_115200 8 /* 16 MHz, double speed off: 3.5 % off, as on every Uno */

static void put(char c)
{
    while (!(UCSR0A & _BV(UDRE0)))
        ;
    UDR0 = (uint8_t)c;
}

static void say(const char *text) /* in program memory */
{
    char c;

    while ((c = (char)pgm_read_byte(text++)) != '\0')
        put(c);
}

static void say_number(int32_t number)
{
    char digits[12];
    uint8_t count = 0;
    uint32_t rest = number < 0 ? 0 - (uint32_t)number : (uint32_t)number;

    if (number < 0)
        put('-');
    do {
        digits[count++] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    while (count)
        put(digits[--count]);
}

static void say_hex(uint8_t byte)
{
    static const char DIGITS[] PROGMEM = "0123456789ABCDEF";

    put((char)pgm_read_byte(&DIGITS[byte >> 4]));
    put((char)pgm_read_byte(&DIGITS[byte & 15]));
}

static uint8_t failed(int result, const char *what)
{
    if (result == LM629_OK)
        return 0;
    say(what);
    say(PSTR(": failed\n"));
    return 1;
}

static uint8_t move_to(int32_t target)
{
    struct lm629_move move;
    int32_t real = 0;
    uint8_t status;
    uint16_t polls = 0;

    move.position = target;
    move.velocity = 167772;
    move.acceleration = 2150;
    if (failed(lm629_clear_flags(LM629_TRAJECTORY_COMPLETE), PSTR("RSTI"))
        || failed(lm629_start(&move), PSTR("LTRJ, STT")))
        return 1;
    do {
        _delay_ms(1);
        status = lm629_bus_read_status();
    } while (!(status & (LM629_TRAJECTORY_COMPLETE | LM629_POSITION_ERROR)) && ++polls < 5000);
    _delay_ms(50); /* until the motor is at rest */
    if (failed(lm629_check_move(target, &real), PSTR("move")))
        return 1;
    say(PSTR("status "));
    say_hex(status);
    say(PSTR("h, position "));
    say_number(real);
    put('\n');
    return 0;
}

int main(void)
{
    static const struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };
    uint8_t first = 0, cleared = 0;

    UBRR0H = 0;
    UBRR0L = UBRR_115200;
    UCSR0B = _BV(TXEN0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    lm629_bus_init();
    if (failed(lm629_check_reset(&first, &cleared), PSTR("reset")))
        return 1;
    say(PSTR("reset: status "));
    say_hex(first);
    say(PSTR("h, after RSTI "));
    say_hex(cleared);
    say(PSTR("h\n"));
    if (failed(lm629_load_filter(&filter), PSTR("LFIL, UDF")))
        return 1;
    if (move_to(4000) || move_to(-1000) || move_to(0))
        return 1;
    say(PSTR("done\n"));
    while (!(UCSR0A & _BV(TXC0)))
        ;
    return 0;
}
