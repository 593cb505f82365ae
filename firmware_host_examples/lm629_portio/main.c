/* main.c - moves the axis of an LM629 card forth and back.
 *
 *     move [BASE]           base address of the card, hexadecimal; 340 if none is given
 */
#include "lm629_card.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define TOLERANCE 4 /* counts: the motor has friction */

static struct lm629 card;

static void check(int result, const char *what)
{
    static const char *const why[] = { "", "no access to the ports", "the chip stays busy",
                                       "no healthy reset" };

    if (result == LM629_OK)
        return;
    fprintf(stderr, "%s: %s", what, why[-result]);
    if (result == LM629_E_PORTS)
        fprintf(stderr, " (%s)", strerror(errno));
    fprintf(stderr, "\n");
    exit(1);
}

static long milliseconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (long)(now.tv_sec * 1000 + now.tv_nsec / 1000000);
}

static void move_to(int32_t target)
{
    struct timespec rest = { 0, 200000000 };
    long began = milliseconds();
    uint8_t status;
    int32_t position;

    check(lm629_clear_flags(&card, LM629_TRAJECTORY_COMPLETE), "RSTI");
    check(lm629_start(&card, 215, 167772, target), "LTRJ, STT"); /* 25 turns/s/s, 5 turns/s */
    check(lm629_wait(&card, LM629_TRAJECTORY_COMPLETE | LM629_POSITION_ERROR | LM629_COMMAND_ERROR,
                     5000, &status), "trajectory complete");
    printf("to %ld: status %02Xh after %ld ms", (long)target, status, milliseconds() - began);
    nanosleep(&rest, NULL);
    check(lm629_real_position(&card, &position), "RDRP");
    printf(", at %ld\n", (long)position);
    /* What the chip tells of bytes that came otherwise, and of a target that is another one. */
    if ((status & (LM629_POSITION_ERROR | LM629_COMMAND_ERROR))
        || labs((long)position - target) > TOLERANCE) {
        fprintf(stderr, "to %ld: not there\n", (long)target);
        exit(1);
    }
}

int main(int count, char **arguments)
{
    static const struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };
    unsigned long base = count > 1 ? strtoul(arguments[1], NULL, 16) : 0x340;

    check(lm629_open(&card, (unsigned short)base), "reset");
    printf("card at %03lXh: status %02Xh, after RSTI %02Xh, %u reset\n", base, card.after_reset,
           card.after_rsti, card.resets);
    if (card.resets > 1) /* it works now; somebody should look at the card */
        fprintf(stderr, "reset: it took %u\n", card.resets);
    check(lm629_load_filter(&card, &filter), "LFIL, UDF");
    move_to(4000);
    move_to(-1000);
    move_to(0);
    printf("busy for at most %u polls\n", card.most_polls);
    return 0;
}
