/* lm629_card.c - see lm629_card.h. */
#include "lm629_card.h"

#include <sys/io.h>
#include <time.h>

#define RESET 0x00
#define STT 0x01
#define UDF 0x04
#define RDRP 0x0A
#define MSKI 0x1C
#define RSTI 0x1D
#define LFIL 0x1E
#define LTRJ 0x1F

#define LFIL_ALL 0x000F /* kp, ki, kd and il follow */
#define LTRJ_ALL 0x002A /* acceleration, velocity and position follow, all absolute */

/* A read of an ISA port takes a microsecond; busy takes some 15 of them at 8 MHz, and 100 at most. */
#define BUSY_POLLS 150
#define RESETS 5

static void pause_us(long us)
{
    struct timespec pause = { 0, us * 1000 };

    nanosleep(&pause, NULL);
}

/* --- bytes and words -------------------------------------------------------------------------- */

static int not_busy(struct lm629 *card)
{
    unsigned polls;

    for (polls = 1; polls <= BUSY_POLLS; polls++)
        if (!(inb(card->base) & LM629_BUSY)) {
            if (polls > card->most_polls)
                card->most_polls = polls;
            return LM629_OK;
        }
    return LM629_E_BUSY;
}

static int command(struct lm629 *card, uint8_t code)
{
    if (not_busy(card) != LM629_OK)
        return LM629_E_BUSY;
    outb(code, card->base);
    return LM629_OK;
}

static int put_word(struct lm629 *card, uint16_t word)
{
    if (not_busy(card) != LM629_OK)
        return LM629_E_BUSY;
    outb((uint8_t)(word >> 8), card->base + 1);
    outb((uint8_t)word, card->base + 1);
    return LM629_OK;
}

static int put_long(struct lm629 *card, uint32_t value)
{
    return put_word(card, (uint16_t)(value >> 16)) || put_word(card, (uint16_t)value)
        ? LM629_E_BUSY : LM629_OK;
}

static int get_word(struct lm629 *card, uint16_t *word)
{
    if (not_busy(card) != LM629_OK)
        return LM629_E_BUSY;
    *word = (uint16_t)(inb(card->base + 1) << 8);
    *word = (uint16_t)(*word | inb(card->base + 1));
    return LM629_OK;
}

/* --- what the program calls ------------------------------------------------------------------- */

/* The data sheet's check of a healthy reset; boards that come up badly get further tries. */
int lm629_open(struct lm629 *card, unsigned short base)
{
    card->base = base;
    card->most_polls = 0;
    if (ioperm(base, 2, 1) != 0)
        return LM629_E_PORTS;
    for (card->resets = 1; card->resets <= RESETS; card->resets++) {
        outb(RESET, base);
        pause_us(1500);
        card->after_reset = inb(base);
        if (card->after_reset != 0x84 && card->after_reset != 0xC4)
            continue;
        if (lm629_clear_flags(card, 0xFF) != LM629_OK || not_busy(card) != LM629_OK)
            continue;
        card->after_rsti = inb(base);
        if (card->after_rsti == 0x80 || card->after_rsti == 0xC0)
            return LM629_OK;
    }
    return LM629_E_RESET;
}

uint8_t lm629_status(struct lm629 *card)
{
    return inb(card->base);
}

int lm629_clear_flags(struct lm629 *card, uint8_t flags)
{
    return command(card, RSTI) || put_word(card, (uint16_t)~flags) ? LM629_E_BUSY : LM629_OK;
}

int lm629_interrupt_by(struct lm629 *card, uint8_t flags)
{
    return command(card, MSKI) || put_word(card, flags) ? LM629_E_BUSY : LM629_OK;
}

int lm629_load_filter(struct lm629 *card, const struct lm629_filter *filter)
{
    if (command(card, LFIL) || put_word(card, (uint16_t)(filter->interval << 8 | LFIL_ALL))
        || put_word(card, filter->kp) || put_word(card, filter->ki) || put_word(card, filter->kd)
        || put_word(card, filter->il) || command(card, UDF))
        return LM629_E_BUSY;
    return LM629_OK;
}

int lm629_start(struct lm629 *card, uint32_t acceleration, uint32_t velocity, int32_t position)
{
    if (command(card, LTRJ) || put_word(card, LTRJ_ALL) || put_long(card, acceleration)
        || put_long(card, velocity) || put_long(card, (uint32_t)position) || command(card, STT))
        return LM629_E_BUSY;
    return LM629_OK;
}

int lm629_wait(struct lm629 *card, uint8_t flags, unsigned limit_ms, uint8_t *status)
{
    do {
        *status = lm629_status(card);
        if (*status & flags)
            return LM629_OK;
        pause_us(1000);
    } while (limit_ms-- > 0);
    return LM629_E_BUSY;
}

int lm629_real_position(struct lm629 *card, int32_t *position)
{
    uint16_t high, low;

    if (command(card, RDRP) || get_word(card, &high) || get_word(card, &low))
        return LM629_E_BUSY;
    *position = (int32_t)((uint32_t)high << 16 | low);
    return LM629_OK;
}
