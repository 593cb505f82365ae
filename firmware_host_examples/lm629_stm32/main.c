/* main.c - moves an axis, waits for the chip's interrupt, and tells about it on the USART. */
#include "lm629_bus.h"
#include "lm629_driver.h"

static void say(const char *text)
{
    while (*text != '\0')
        console_write(*text++);
}

static void say_number(int32_t number)
{
    char digits[12];
    uint8_t count = 0;
    uint32_t rest = number < 0 ? 0 - (uint32_t)number : (uint32_t)number;

    if (number < 0)
        console_write('-');
    do {
        digits[count++] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    while (count)
        console_write(digits[--count]);
}

static int move_to(int32_t target)
{
    struct lm629_move move = {target, 167772, 2150};
    int32_t position;

    if (lm629_clear_flags(LM629_TRAJECTORY_COMPLETE) != LM629_OK)
        return 1;
    lm629_interrupted = 0;
    if (lm629_start(&move) != LM629_OK)
        return 1;
    while (!lm629_interrupted)
        ;
    lm629_bus_delay_ms(50); /* until the motor is at rest */
    if (lm629_check_move(target, &position) != LM629_OK)
        return 1;
    say("position ");
    say_number(position);
    say("\n");
    return 0;
}

int main(void)
{
    static const struct lm629_filter filter = {200, 200, 2000, 20000, 0};
    uint8_t first, cleared;

    lm629_bus_init();
    if (lm629_check_reset(&first, &cleared) != LM629_OK || lm629_load_filter(&filter) != LM629_OK) {
        say("no LM629\n");
        return 1;
    }
    if (move_to(4000) || move_to(-1000) || move_to(0)) {
        say("failed\n");
        return 1;
    }
    say("done\n");
    return 0;
}
