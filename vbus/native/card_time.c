/* card_time.c - sleeps and clocks of a program compiled for card_link.h: from its first access on they
 * follow chip time. The linker puts these in the place of the C library's (--wrap).
 * License: Apache-2.0.
 */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif

#include "card_link.h"
#include "vbus.h"

#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define NS 1000000000
#define PS_PER_NS 1000

#ifdef __cplusplus
extern "C" {
#endif

int __real_clock_gettime(clockid_t clock, struct timespec *when);
int __real_clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted,
                           struct timespec *rest);
int __wrap_clock_gettime(clockid_t clock, struct timespec *when);
int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted,
                           struct timespec *rest);
int __wrap_nanosleep(const struct timespec *wanted, struct timespec *rest);
int __wrap_usleep(useconds_t us);
unsigned __wrap_sleep(unsigned seconds);
int __wrap_gettimeofday(struct timeval *when, void *zone);
time_t __wrap_time(time_t *when);

#ifdef __cplusplus
}
#endif

/* A look at a clock takes a microsecond, so that loops which wait for one end. */
int __wrap_clock_gettime(clockid_t clock, struct timespec *when)
{
    static int64_t begun[2];
    int64_t *base = &begun[clock == CLOCK_REALTIME], now;

    if (!card_rules_time() || clock == CLOCK_PROCESS_CPUTIME_ID || clock == CLOCK_THREAD_CPUTIME_ID)
        return __real_clock_gettime(clock, when);
    card_pass(VBUS_US);
    now = (int64_t)(card_now() / PS_PER_NS);
    if (*base == 0) { /* from the next whole second on */
        __real_clock_gettime(clock, when);
        *base = ((int64_t)when->tv_sec + 1) * NS - now;
    }
    now += *base;
    when->tv_sec = (time_t)(now / NS);
    when->tv_nsec = (long)(now % NS);
    return 0;
}

int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted,
                           struct timespec *rest)
{
    int64_t left = (int64_t)wanted->tv_sec * NS + wanted->tv_nsec;
    struct timespec now;

    if (!card_rules_time())
        return __real_clock_nanosleep(clock, flags, wanted, rest);
    if (flags & TIMER_ABSTIME) {
        __wrap_clock_gettime(clock, &now);
        left -= (int64_t)now.tv_sec * NS + now.tv_nsec;
    }
    if (left > 0)
        card_pass((uint64_t)left * PS_PER_NS);
    return 0;
}

int __wrap_nanosleep(const struct timespec *wanted, struct timespec *rest)
{
    return __wrap_clock_nanosleep(CLOCK_MONOTONIC, 0, wanted, rest) == 0 ? 0 : -1;
}

int __wrap_usleep(useconds_t us)
{
    struct timespec wanted;

    wanted.tv_sec = (time_t)(us / 1000000);
    wanted.tv_nsec = (long)(us % 1000000) * 1000;
    return __wrap_nanosleep(&wanted, NULL);
}

unsigned __wrap_sleep(unsigned seconds)
{
    struct timespec wanted;

    wanted.tv_sec = (time_t)seconds;
    wanted.tv_nsec = 0;
    return __wrap_nanosleep(&wanted, NULL) == 0 ? 0 : seconds;
}

int __wrap_gettimeofday(struct timeval *when, void *zone)
{
    struct timespec now;

    (void)zone;
    __wrap_clock_gettime(CLOCK_REALTIME, &now);
    when->tv_sec = now.tv_sec;
    when->tv_usec = (suseconds_t)(now.tv_nsec / 1000);
    return 0;
}

time_t __wrap_time(time_t *when)
{
    struct timespec now;

    __wrap_clock_gettime(CLOCK_REALTIME, &now);
    if (when != NULL)
        *when = now.tv_sec;
    return now.tv_sec;
}
