/* threads.c - waiting for other threads until an instant of virtual time. License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "sys.h"
#include "trap.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <semaphore.h>

#define REAL(name)                                                                                 \
    static __typeof__(&name) real;                                                                 \
    if (real == NULL)                                                                              \
        *(void **)&real = dlsym(RTLD_NEXT, #name)

static int64_t join(const struct timespec *when)
{
    return (int64_t)when->tv_sec * NS + when->tv_nsec;
}

static void split(int64_t ns, struct timespec *when)
{
    when->tv_sec = (time_t)(ns / NS);
    when->tv_nsec = (long)(ns % NS);
}

/* One of the waits below, until an instant of `clock` in real time; 0 or an error number. */
struct wait {
    int (*real)(const struct wait *wait, const struct timespec *until);
    void *what, *mutex;
    clockid_t clock;
};

static int wait_until(const struct wait *wait, const struct timespec *when)
{
    struct patience patience;

    if (when->tv_nsec < 0 || when->tv_nsec >= (long)NS)
        return wait->real(wait, when);
    patience_begin(&patience, join(when) - clock_look(wait->clock));
    patience.left = patience.left < 0 ? 0 : patience.left;
    for (;;) {
        struct timespec until;
        int result;

        sys_clock_gettime(wait->clock, &until);
        split(join(&until) + (patience.left > 0 ? GRACE_MS * 1000000 : 0), &until);
        result = wait->real(wait, &until);
        if (result != ETIMEDOUT || patience.left == 0)
            return result;
        if (!patience_over(&patience))
            continue;
        if (patience.left > 0)
            patience_begin(&patience, (int64_t)clock_pass((uint64_t)patience.left));
    }
}

/* --- conditions ------------------------------------------------------------------------------- */

static int real_condition(const struct wait *wait, const struct timespec *until)
{
    REAL(pthread_cond_timedwait);
    return real(wait->what, wait->mutex, until);
}

static int real_condition_clock(const struct wait *wait, const struct timespec *until)
{
    REAL(pthread_cond_clockwait);
    return real(wait->what, wait->mutex, wait->clock, until);
}

PUBLIC int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                  const struct timespec *when)
{
    /* glibc keeps pthread_condattr_setclock's choice in this bit. */
    clockid_t clock = condition->__data.__wrefs & 2 ? CLOCK_MONOTONIC : CLOCK_REALTIME;
    struct wait wait = {real_condition, condition, mutex, clock};

    return clock_follows() ? wait_until(&wait, when) : real_condition(&wait, when);
}

PUBLIC int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                  clockid_t clock, const struct timespec *when)
{
    struct wait wait = {real_condition_clock, condition, mutex, clock};

    return clock_is_ours(clock) ? wait_until(&wait, when) : real_condition_clock(&wait, when);
}

/* --- mutexes ---------------------------------------------------------------------------------- */

static int real_mutex(const struct wait *wait, const struct timespec *until)
{
    REAL(pthread_mutex_timedlock);
    return real(wait->what, until);
}

static int real_mutex_clock(const struct wait *wait, const struct timespec *until)
{
    REAL(pthread_mutex_clocklock);
    return real(wait->what, wait->clock, until);
}

PUBLIC int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *when)
{
    struct wait wait = {real_mutex, mutex, NULL, CLOCK_REALTIME};

    return clock_follows() ? wait_until(&wait, when) : real_mutex(&wait, when);
}

PUBLIC int pthread_mutex_clocklock(pthread_mutex_t *mutex, clockid_t clock,
                                   const struct timespec *when)
{
    struct wait wait = {real_mutex_clock, mutex, NULL, clock};

    return clock_is_ours(clock) ? wait_until(&wait, when) : real_mutex_clock(&wait, when);
}

/* --- semaphores ------------------------------------------------------------------------------- */

static int real_semaphore(const struct wait *wait, const struct timespec *until)
{
    REAL(sem_timedwait);
    return real(wait->what, until) == 0 ? 0 : errno;
}

static int real_semaphore_clock(const struct wait *wait, const struct timespec *until)
{
    REAL(sem_clockwait);
    return real(wait->what, wait->clock, until) == 0 ? 0 : errno;
}

static int with_errno(int result)
{
    if (result == 0)
        return 0;
    errno = result;
    return -1;
}

PUBLIC int sem_timedwait(sem_t *semaphore, const struct timespec *when)
{
    struct wait wait = {real_semaphore, semaphore, NULL, CLOCK_REALTIME};

    return with_errno(clock_follows() ? wait_until(&wait, when) : real_semaphore(&wait, when));
}

PUBLIC int sem_clockwait(sem_t *semaphore, clockid_t clock, const struct timespec *when)
{
    struct wait wait = {real_semaphore_clock, semaphore, NULL, clock};

    return with_errno(clock_is_ours(clock) ? wait_until(&wait, when)
                                           : real_semaphore_clock(&wait, when));
}
