/* A driver with an interrupt thread: what one thread does comes at the same bus cycle of the other in
 * every run. The card is an LM629 at 340h whose HI interrupts.
 *
 *     threads HOW WORK    HOW: what the interrupt thread waits in; WORK: what the main thread does
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

#include "lm629.h"

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t condition = PTHREAD_COND_INITIALIZER;
static sem_t semaphore;
static volatile int served, ended;
static int device;
static const char *how;

static void command_in_turn(unsigned code, unsigned count, const unsigned char *data)
{
    pthread_mutex_lock(&mutex);
    command(code, count, data);
    pthread_mutex_unlock(&mutex);
}

static uint32_t wait_for_interrupt(void)
{
    struct pollfd set = {device, POLLIN, 0};
    struct epoll_event event = {.events = EPOLLIN};
    uint32_t number;
    fd_set in;
    int poller;

    FD_ZERO(&in);
    FD_SET(device, &in);
    if (strcmp(how, "poll") == 0 && poll(&set, 1, -1) != 1)
        exit(1);
    if (strcmp(how, "select") == 0 && select(device + 1, &in, NULL, NULL, NULL) != 1)
        exit(1);
    if (strcmp(how, "epoll") == 0) {
        poller = epoll_create1(0);
        if (epoll_ctl(poller, EPOLL_CTL_ADD, device, &event) != 0
            || epoll_wait(poller, &event, 1, -1) != 1)
            exit(1);
        close(poller);
    }
    if (read(device, &number, 4) != 4)
        exit(1);
    return number;
}

static void *serve(void *data)
{
    (void)data;
    while (served < 2) {
        uint32_t number = wait_for_interrupt();

        printf("interrupt %u, status %02x\n", (unsigned)number, inb(BASE));
        command_in_turn(0x1D, 2, nothing); /* RSTI */
        pthread_mutex_lock(&mutex);
        served++;
        pthread_cond_signal(&condition);
        pthread_mutex_unlock(&mutex);
        sem_post(&semaphore);
    }
    ended = 1;
    return NULL;
}

static long long now(void)
{
    struct timespec when;

    clock_gettime(CLOCK_MONOTONIC, &when);
    return (long long)when.tv_sec * 1000000000 + when.tv_nsec;
}

int main(int count, char **arguments)
{
    const char *work = count > 2 ? arguments[2] : "";
    struct timespec pause = {0, 300000};
    pthread_t thread;
    unsigned turn, polls = 0, before;
    long long start;

    how = count > 1 ? arguments[1] : "";
    if (ioperm(BASE, 2, 1) != 0)
        return 1;
    while (inb(BASE) != 0x84)
        ;
    load_move(200, 40);
    sem_init(&semaphore, 0, 0);
    if (strcmp(how, "nobody") != 0) {
        device = open("/dev/uio0", O_RDWR);
        pthread_create(&thread, NULL, serve, NULL);
    }
    start = now();
    for (turn = 0; turn < 100; turn++)
        inb(BASE);
    printf("100 inb took %lld us\n", (now() - start) / 1000);
    if (strcmp(how, "nobody") == 0)
        return 0;
    for (turn = 1; turn <= 2; turn++) {
        command_in_turn(0x01, 0, NULL); /* STT */
        before = polls;
        if (strcmp(work, "condition") == 0) {
            pthread_mutex_lock(&mutex);
            while (served < (int)turn)
                pthread_cond_wait(&condition, &mutex);
            pthread_mutex_unlock(&mutex);
        } else if (strcmp(work, "semaphore") == 0) {
            sem_wait(&semaphore);
        } else if (strcmp(work, "spin") == 0) {
            while (served < (int)turn)
                ;
        } else {
            while (served < (int)turn) {
                polls++;
                if (strcmp(work, "sleep") == 0)
                    nanosleep(&pause, NULL);
                else if (strcmp(work, "clock") == 0)
                    now();
                else
                    inb(BASE);
            }
        }
        printf("move %u after %lld us, %u polls\n", turn, (now() - start) / 1000, polls - before);
    }
    pthread_join(thread, NULL);
    printf("ended %d\n", ended);
    return 0;
}
