/* axis.c - see axis.h. */
#include "axis.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define NEAR 4 /* counts: in real time the load may still be settling */

struct lm629 card;
const int32_t targets[MOVES] = { 400, -200, 0 };

void check(int result, const char *what)
{
    if (result == LM629_OK)
        return;
    fprintf(stderr, "%s: %s\n", what, result == LM629_E_PORTS ? strerror(errno) : "the chip");
    exit(1);
}

void open_axis(void)
{
    static const struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };

    check(lm629_open(&card, 0x340), "reset");
    check(lm629_interrupt_by(&card, LM629_TRAJECTORY_COMPLETE), "MSKI");
    check(lm629_load_filter(&card, &filter), "LFIL, UDF");
}

void start_move(int number)
{
    check(lm629_clear_flags(&card, LM629_TRAJECTORY_COMPLETE), "RSTI");
    check(lm629_start(&card, 2150, 167772, targets[number]), "LTRJ, STT");
}

void tell(int number, uint8_t status)
{
    struct timespec rest = { 0, 200000000 };
    int32_t position;

    while (nanosleep(&rest, &rest) != 0)
        ;
    check(lm629_real_position(&card, &position), "RDRP");
    printf("to %ld: status %02Xh, %s\n", (long)targets[number], status,
           labs((long)position - targets[number]) <= NEAR ? "there" : "elsewhere");
    if (labs((long)position - targets[number]) > NEAR
        || (status | lm629_status(&card)) & (LM629_POSITION_ERROR | LM629_COMMAND_ERROR))
        exit(1);
}
