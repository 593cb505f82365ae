/* thread.c - an interrupt thread reads /dev/uio0; the main thread waits for it with a condition. */
#include "axis.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER; /* the card, and what follows */
static pthread_cond_t complete = PTHREAD_COND_INITIALIZER;
static int served;
static uint8_t status;

static void *serve(void *data)
{
    int file = *(int *)data, turn;
    uint32_t number, on = 1;

    for (turn = 0; turn < MOVES;) {
        if (write(file, &on, sizeof on) != sizeof on
            || read(file, &number, sizeof number) != sizeof number) {
            perror("/dev/uio0");
            exit(1);
        }
        pthread_mutex_lock(&mutex);
        status = lm629_status(&card);
        if (!(status & LM629_TRAJECTORY_COMPLETE)) { /* the line has moved, and no move has ended */
            pthread_mutex_unlock(&mutex);
            continue;
        }
        turn++;
        check(lm629_clear_flags(&card, LM629_TRAJECTORY_COMPLETE), "RSTI");
        while (lm629_status(&card) & LM629_BUSY)
            ; /* then the line is down, and may be enabled again */
        served++;
        pthread_cond_signal(&complete);
        pthread_mutex_unlock(&mutex);
    }
    return NULL;
}

int main(void)
{
    struct timespec until;
    pthread_t thread;
    int file, turn, error = 0;

    open_axis();
    check(lm629_clear_flags(&card, 0xFF), "RSTI");
    file = open("/dev/uio0", O_RDWR);
    if (file < 0) {
        perror("/dev/uio0");
        return 1;
    }
    pthread_create(&thread, NULL, serve, &file);
    for (turn = 0; turn < MOVES; turn++) {
        pthread_mutex_lock(&mutex);
        start_move(turn);
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_sec += 5;
        while (served <= turn && error == 0)
            error = pthread_cond_timedwait(&complete, &mutex, &until);
        if (error != 0) {
            fprintf(stderr, "no interrupt in 5 s\n");
            return 1;
        }
        tell(turn, status);
        pthread_mutex_unlock(&mutex);
    }
    pthread_join(thread, NULL);
    printf("%d interrupts\n", served);
    return 0;
}
