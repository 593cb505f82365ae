/* clock.h - virtual time as the program's waits see it; see clock.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_CLOCK_H
#define VBUS_EXEC_CLOCK_H

#include "turns.h"

#include <stdint.h>
#include <time.h>

#define NS 1000000000

static inline int64_t ns_of(const struct timespec *when)
{
    int64_t seconds = when->tv_sec;

    return seconds > FOR_EVER / 2 / NS ? FOR_EVER / 2 : seconds * NS + when->tv_nsec;
}

static inline void split_ns(int64_t ns, struct timespec *when)
{
    when->tv_sec = (time_t)(ns / NS);
    when->tv_nsec = (long)(ns % NS);
}

/* Whether time is virtual; and whether this clock then follows it. */
int clock_follows(void);
int clock_is_ours(clockid_t clock);

/* What a clock shows (ns); and the same for comparing, which costs nothing. */
int64_t clock_look(clockid_t clock);
int64_t clock_compare(clockid_t clock);

/* Whether waits are ours: time is virtual, or another thread wants its turn. */
int clock_waits(void);

/* Wait for descriptors at most `ns` (negative: for ever), with `mask` unless NULL; as ppoll answers. */
int clock_poll(struct pollfd *set, nfds_t count, int64_t ns, const sigset_t *mask);

/* Wait until `fd` can be read or written, for a call that will do it: 0, or -1 if it shall fail. */
int clock_await(int fd, short events);

#endif
