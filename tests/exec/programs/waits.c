/* Every wait with a time-out a driver may use; prints how long each took by the program's clock (us),
 * rounded to 100 us. The card is an MCP-1200: R20h to R27h keep bytes.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/io.h>
#include <sys/select.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define KEEP 0x320

static sem_t semaphore;
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static long long start;

static long long now(void)
{
    struct timespec when;

    clock_gettime(CLOCK_MONOTONIC, &when);
    return (long long)when.tv_sec * 1000000 + when.tv_nsec / 1000;
}

static struct timespec in(clockid_t clock, int seconds)
{
    struct timespec when;

    clock_gettime(clock, &when);
    when.tv_sec += seconds;
    return when;
}

static void begin(void)
{
    inb(KEEP);
    start = now();
}

static void told(const char *what, int result)
{
    printf("%s %d %lld\n", what, result, (now() - start + 50) / 100);
}

static void *post_later(void *data)
{
    (void)data;
    usleep(3000000);
    outb(0x55, KEEP);
    sem_post(&semaphore);
    return NULL;
}

static void *hold(void *data)
{
    (void)data;
    pthread_mutex_lock(&mutex);
    sem_post(&semaphore);
    pause();
    return NULL;
}

static void threads(void)
{
    pthread_cond_t condition = PTHREAD_COND_INITIALIZER, monotonic;
    pthread_condattr_t attributes;
    struct timespec until;
    pthread_t thread;

    pthread_mutex_lock(&mutex);
    begin();
    until = in(CLOCK_REALTIME, 100);
    told("timedwait", pthread_cond_timedwait(&condition, &mutex, &until) == ETIMEDOUT);
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&monotonic, &attributes);
    begin();
    until = in(CLOCK_MONOTONIC, 200);
    told("monotonic", pthread_cond_timedwait(&monotonic, &mutex, &until) == ETIMEDOUT);
    begin();
    until = in(CLOCK_MONOTONIC, 300);
    told("clockwait",
         pthread_cond_clockwait(&condition, &mutex, CLOCK_MONOTONIC, &until) == ETIMEDOUT);
    pthread_mutex_unlock(&mutex);
    sem_init(&semaphore, 0, 0);
    begin();
    until = in(CLOCK_REALTIME, 400);
    told("semaphore", sem_timedwait(&semaphore, &until) < 0 && errno == ETIMEDOUT);
    begin();
    until = in(CLOCK_MONOTONIC, 500);
    told("sem_clockwait",
         sem_clockwait(&semaphore, CLOCK_MONOTONIC, &until) < 0 && errno == ETIMEDOUT);
    until = in(CLOCK_REALTIME, 600);
    pthread_create(&thread, NULL, post_later, NULL);
    printf("posted %d", sem_timedwait(&semaphore, &until));
    pthread_join(thread, NULL);
    printf(" %02x\n", inb(KEEP));
    pthread_create(&thread, NULL, hold, NULL);
    sem_wait(&semaphore);
    begin();
    until = in(CLOCK_REALTIME, 700);
    told("mutex", pthread_mutex_timedlock(&mutex, &until) == ETIMEDOUT);
}

static void take(int timer)
{
    uint64_t count;

    if (read(timer, &count, sizeof count) != 8)
        exit(1);
}

static void descriptors(void)
{
    struct itimerspec every = {{10, 0}, {20, 0}}, left;
    struct timespec limit = {800, 0};
    struct epoll_event event = {.events = EPOLLIN};
    int timer, poller = epoll_create1(0), pipes[2];
    struct pollfd set[2];
    uint64_t count = 0;
    fd_set in;

    begin();
    timer = timerfd_create(CLOCK_MONOTONIC, 0);
    told("settime", timerfd_settime(timer, 0, &every, NULL));
    told("timer", read(timer, &count, sizeof count) == 8 && count == 1);
    sleep(25);
    told("missed", read(timer, &count, sizeof count) == 8 ? (int)count : -1);
    told("again", read(timer, &count, sizeof count) == 8 ? (int)count : -1);
    timerfd_gettime(timer, &left);
    printf("left %ld of %ld\n", (long)left.it_value.tv_sec, (long)left.it_interval.tv_sec);
    if (pipe(pipes) != 0)
        exit(1);
    set[0].fd = timer;
    set[1].fd = pipes[0];
    set[0].events = set[1].events = POLLIN;
    begin();
    told("poll", poll(set, 2, -1) == 1 && set[0].revents == POLLIN);
    take(timer);
    begin();
    FD_ZERO(&in);
    FD_SET(timer, &in);
    FD_SET(pipes[0], &in);
    told("select", select(timer + pipes[0] + 1, &in, NULL, NULL, NULL) == 1 && FD_ISSET(timer, &in));
    take(timer);
    epoll_ctl(poller, EPOLL_CTL_ADD, timer, &event);
    begin();
    told("epoll", epoll_wait(poller, &event, 1, -1));
    take(timer);
    begin();
    told("epoll short", epoll_pwait(poller, &event, 1, 4000, NULL));
    every.it_value.tv_sec = 0;
    timerfd_settime(timer, 0, &every, NULL);
    begin();
    told("epoll empty", epoll_wait(poller, &event, 1, 900000));
    begin();
    told("ppoll", ppoll(set, 2, &limit, NULL));
    FD_ZERO(&in);
    FD_SET(pipes[0], &in);
    begin();
    told("pselect", pselect(pipes[0] + 1, &in, NULL, NULL, &limit, NULL));
    if (write(pipes[1], "x", 1) != 1)
        exit(1);
    told("ready", ppoll(set, 2, &limit, NULL));
}

static void clocks(void)
{
    struct timespec wait = {60, 0}, until;
    struct timeval first, second;
    time_t whole;

    begin();
    nanosleep(&wait, NULL);
    told("nanosleep", 0);
    until = in(CLOCK_MONOTONIC, 60);
    told("absolute", clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL));
    gettimeofday(&first, NULL);
    whole = time(NULL);
    sleep(5);
    gettimeofday(&second, NULL);
    printf("gettimeofday %ld, time %ld\n", (long)(second.tv_sec - first.tv_sec),
           (long)(time(NULL) - whole));
}

static void vectors(void)
{
    unsigned char bytes[3] = {0x61, 0x62, 0x63}, back[3] = {0};
    struct iovec out[2] = {{bytes, 1}, {bytes + 1, 2}}, in[2] = {{back, 2}, {back + 2, 1}};
    int fd = open("/dev/port", O_RDWR);

    lseek(fd, KEEP, SEEK_SET);
    printf("writev %zd", writev(fd, out, 2));
    lseek(fd, KEEP, SEEK_SET);
    printf(" readv %zd", readv(fd, in, 2));
    printf(" %02x%02x%02x\n", back[0], back[1], back[2]);
    bytes[0] = 0x71;
    printf("pwritev %zd", pwritev(fd, out, 2, KEEP));
    printf(" preadv %zd", preadv(fd, in, 2, KEEP));
    printf(" %02x%02x%02x\n", back[0], back[1], back[2]);
}

int main(void)
{
    if (iopl(3) != 0)
        return 1;
    clocks();
    threads();
    descriptors();
    vectors();
    fflush(stdout);
    return 0;
}
