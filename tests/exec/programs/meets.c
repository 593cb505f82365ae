/* Waits with a time-out that end otherwise: another thread does what is waited for, after work that
 * takes wall time, chip time, or both. The card is an MCP-1200: R20h to R27h keep bytes.
 *
 *     meets WAIT WORK         prints the wait's result, and whether an hour has passed
 *     meets WAIT for-ever     waits again and again in vain, and reads the card in between
 *     meets sleep too-long    sleeps for 136 years
 */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/io.h>
#include <sys/select.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define KEEP 0x320
#define HOUR (strcmp(work, "for-ever") == 0 ? 1 : 3600)

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER, held = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t condition = PTHREAD_COND_INITIALIZER;
static sem_t semaphore, locked;
static volatile int came;
static int pipes[2], timer;
static const char *work;

static void labour(void)
{
    int labours = strcmp(work, "labours") == 0;
    unsigned long turns = labours ? 30000000 : 3000000;
    volatile unsigned long turn;

    for (turn = 0; strcmp(work, "sleeps") != 0 && turn < turns; turn++)
        if (strcmp(work, "polls") == 0 && turn % 10000 == 0)
            inb(KEEP);
    if (!labours && strcmp(work, "computes") != 0)
        usleep(2000000);
}

static void *other(void *data)
{
    struct itimerspec soon = {{0, 0}, {0, 1}};

    (void)data;
    pthread_mutex_lock(&held);
    sem_post(&locked);
    labour();
    pthread_mutex_lock(&mutex);
    came = 1;
    pthread_cond_broadcast(&condition);
    pthread_mutex_unlock(&mutex);
    sem_post(&semaphore);
    if (write(pipes[1], "x", 1) != 1)
        exit(1);
    timerfd_settime(timer, 0, &soon, NULL);
    pthread_mutex_unlock(&held);
    return NULL;
}

static struct timespec in_an_hour(clockid_t clock)
{
    struct timespec when;

    clock_gettime(clock, &when);
    when.tv_sec += HOUR;
    return when;
}

static int wait_by(const char *how)
{
    struct timespec real = in_an_hour(CLOCK_REALTIME), monotonic = in_an_hour(CLOCK_MONOTONIC);
    struct timespec long_time = {HOUR, 0};
    struct timeval long_enough = {HOUR, 0};
    struct pollfd set = {strcmp(how, "timer") == 0 ? timer : pipes[0], POLLIN, 0};
    struct epoll_event event = {.events = EPOLLIN};
    int result = 0, poller;
    fd_set in;

    FD_ZERO(&in);
    FD_SET(pipes[0], &in);
    if (strncmp(how, "cond_", 5) == 0) {
        pthread_mutex_lock(&mutex);
        while (!came && result == 0)
            result = strcmp(how, "cond_timedwait") == 0
                         ? pthread_cond_timedwait(&condition, &mutex, &real)
                         : pthread_cond_clockwait(&condition, &mutex, CLOCK_MONOTONIC, &monotonic);
        pthread_mutex_unlock(&mutex);
        return result;
    }
    if (strcmp(how, "sem_timedwait") == 0)
        return sem_timedwait(&semaphore, &real) == 0 ? 0 : errno;
    if (strcmp(how, "sem_clockwait") == 0)
        return sem_clockwait(&semaphore, CLOCK_MONOTONIC, &monotonic) == 0 ? 0 : errno;
    if (strcmp(how, "mutex_timedlock") == 0)
        return pthread_mutex_timedlock(&held, &real);
    if (strcmp(how, "mutex_clocklock") == 0)
        return pthread_mutex_clocklock(&held, CLOCK_MONOTONIC, &monotonic);
    if (strcmp(how, "select") == 0)
        return select(pipes[0] + 1, &in, NULL, NULL, &long_enough) == 1 ? 0 : ETIMEDOUT;
    if (strcmp(how, "pselect") == 0)
        return pselect(pipes[0] + 1, &in, NULL, NULL, &long_time, NULL) == 1 ? 0 : ETIMEDOUT;
    if (strcmp(how, "ppoll") == 0)
        return ppoll(&set, 1, &long_time, NULL) == 1 ? 0 : ETIMEDOUT;
    if (strcmp(how, "epoll") == 0) {
        poller = epoll_create1(0);
        epoll_ctl(poller, EPOLL_CTL_ADD, pipes[0], &event);
        return epoll_wait(poller, &event, 1, HOUR * 1000) == 1 ? 0 : ETIMEDOUT;
    }
    if (strcmp(how, "sleep") == 0)
        return (int)sleep(HOUR);
    return poll(&set, 1, HOUR * 1000) == 1 ? 0 : ETIMEDOUT; /* "poll" and "timer" */
}

int main(int count, char **arguments)
{
    struct timespec before, after;
    pthread_t thread;
    int result;

    if (count < 3 || iopl(3) != 0 || pipe(pipes) != 0)
        return 1;
    work = arguments[2];
    inb(KEEP);
    timer = timerfd_create(CLOCK_MONOTONIC, 0);
    sem_init(&semaphore, 0, 0);
    sem_init(&locked, 0, 0);
    if (strcmp(work, "too-long") == 0)
        return (int)sleep(~0U);
    if (strcmp(work, "for-ever") == 0) {
        pthread_mutex_lock(&held);
        puts("waiting");
        fflush(stdout);
        for (;;) {
            wait_by(arguments[1]);
            inb(KEEP);
        }
    }
    pthread_create(&thread, NULL, other, NULL);
    sem_wait(&locked);
    clock_gettime(CLOCK_MONOTONIC, &before);
    result = wait_by(arguments[1]);
    clock_gettime(CLOCK_MONOTONIC, &after);
    printf("result %d, an hour %d\n", result, after.tv_sec - before.tv_sec >= HOUR - 1);
    fflush(stdout);
    if (strncmp(arguments[1], "mutex", 5) != 0)
        pthread_join(thread, NULL);
    return 0;
}
