/* timer.c - no interrupt line: an interval timer looks at the axis every 2 ms. */
#include "axis.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

static volatile sig_atomic_t status, moving, polls;

static void on_timer(int number)
{
    (void)number;
    if (!moving)
        return;
    polls = polls + 1;
    status = lm629_status(&card);
    if (status & (LM629_TRAJECTORY_COMPLETE | LM629_POSITION_ERROR))
        moving = 0;
}

int main(void)
{
    static const struct itimerval every = { { 0, 2000 }, { 0, 2000 } };
    struct sigaction action;
    sigset_t timer, before;
    int turn;

    memset(&action, 0, sizeof action);
    action.sa_handler = on_timer;
    sigaction(SIGALRM, &action, NULL);
    open_axis();
    sigemptyset(&timer);
    sigaddset(&timer, SIGALRM);
    sigprocmask(SIG_BLOCK, &timer, &before); /* a packet is never interrupted */
    setitimer(ITIMER_REAL, &every, NULL);
    for (turn = 0; turn < MOVES; turn++) {
        start_move(turn);
        moving = 1;
        while (moving)
            sigsuspend(&before);
        tell(turn, (uint8_t)status);
    }
    printf("%s\n", polls > 3 * MOVES ? "looked more than nine times" : "hardly looked");
    return 0;
}
