/* signal.c - the card's interrupt is SIGIO; the program sleeps until it comes. */
#define _GNU_SOURCE
#include "axis.h"

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static volatile sig_atomic_t interrupts;

static void on_interrupt(int number)
{
    (void)number;
    interrupts = interrupts + 1;
}

int main(void)
{
    struct sigaction action;
    sigset_t io, before;
    int turn, slept = 0;

    memset(&action, 0, sizeof action);
    action.sa_handler = on_interrupt;
    sigaction(SIGIO, &action, NULL);
    sigemptyset(&io);
    sigaddset(&io, SIGIO);
    open_axis();
    for (turn = 0; turn < MOVES; turn++) {
        struct timespec longest = { 5, 0 };

        start_move(turn);
        sigprocmask(SIG_BLOCK, &io, &before); /* it is not lost between the look and the sleep */
        while (!(lm629_status(&card) & LM629_TRAJECTORY_COMPLETE))
            if (ppoll(NULL, 0, &longest, &before) == 0)
                slept++;
        sigprocmask(SIG_SETMASK, &before, NULL);
        tell(turn, lm629_status(&card));
    }
    printf("%s\n", slept == 0 && interrupts >= MOVES ? "each sleep ended by the signal" : "slept on");
    return 0;
}
