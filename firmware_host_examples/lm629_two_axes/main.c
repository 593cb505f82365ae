/* main.c - moves two axes and tells where they are. The same for every board, on Linux and AVRs. */
#include "axes.h"
#include "lm629_driver.h"

#ifdef __AVR__
#include <avr/io.h>
#include <util/delay.h>
#else
#include <stdio.h>
#include <time.h>
#endif

/* --- the computer ----------------------------------------------------------------------------- */

#ifdef __AVR__
void pause_ms(uint16_t milliseconds)
{
    while (milliseconds--)
        _delay_ms(1);
}

void put_char(char c)
{
    while (!(UCSR0A & _BV(UDRE0)))
        ;
    UDR0 = (uint8_t)c;
}
#else
void pause_ms(uint16_t milliseconds)
{
    struct timespec pause = { milliseconds / 1000, milliseconds % 1000 * 1000000L };

    nanosleep(&pause, NULL);
}

void put_char(char c)
{
    putchar(c);
}
#endif

/* --- the program ------------------------------------------------------------------------------ */

static void say(const char *text)
{
    while (*text != '\0')
        put_char(*text++);
}

static void say_number(int32_t number)
{
    char digits[10];
    uint8_t count = 0;
    uint32_t rest = number < 0 ? 0 - (uint32_t)number : (uint32_t)number;

    if (number < 0)
        put_char('-');
    do {
        digits[count++] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    while (count)
        put_char(digits[--count]);
}

static uint8_t failed(int result, const char *what)
{
    if (result == LM629_OK)
        return 0;
    say(what);
    say(axis == X ? ": x failed\n" : ": y failed\n");
    return 1;
}

static uint8_t move(int32_t target)
{
    struct lm629_move move;

    move.position = target;
    move.velocity = 167772;
    move.acceleration = 2150;
    return failed(lm629_start(&move), "LTRJ, STT");
}

static uint8_t tell(int32_t target)
{
    int32_t real = 0;
    uint16_t polls = 0;

    while (!(lm629_bus_read_status() & LM629_TRAJECTORY_COMPLETE) && ++polls < 5000)
        pause_ms(1);
    pause_ms(50); /* until the motor is at rest */
    if (failed(lm629_check_move(target, &real), "move"))
        return 1;
    say(axis == X ? "x at " : "y at ");
    say_number(real);
    put_char('\n');
    return 0;
}

int main(void)
{
    static const struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };
    uint8_t first, cleared;

    axes_init();
    for (axis = X; axis <= Y; axis++)
        if (failed(lm629_check_reset(&first, &cleared), "reset")
            || failed(lm629_load_filter(&filter), "LFIL, UDF"))
            return 1;
    for (axis = X; axis <= Y; axis++)
        if (move(axis == X ? 4000 : -1000))
            return 1;
    for (axis = X; axis <= Y; axis++)
        if (tell(axis == X ? 4000 : -1000))
            return 1;
    put_char('\n'); /* a UART has sent all but its last character */
    return 0;
}
