/* time64.c - what 32-bit programs call that were compiled with a time_t of 64 bits.
 * License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "trap.h"

#ifdef __i386__
#include <dlfcn.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/epoll.h>
#include <sys/select.h>
#include <sys/timerfd.h>

#define LATEST 0x7FFFFFFF

struct timespec64 {
    int64_t seconds;
    int32_t nanoseconds, padding;
};
struct timeval64 {
    int64_t seconds, microseconds;
};
struct itimerspec64 {
    struct timespec64 interval, value;
};

/* A long wait is a long wait. */
static struct timespec *narrow(const struct timespec64 *wide, struct timespec *time)
{
    if (wide == NULL)
        return NULL;
    time->tv_sec = (time_t)(wide->seconds > LATEST ? LATEST : wide->seconds);
    time->tv_nsec = wide->nanoseconds;
    return time;
}

static void widen(const struct timespec *time, struct timespec64 *wide)
{
    wide->seconds = time->tv_sec;
    wide->nanoseconds = (int32_t)time->tv_nsec;
    wide->padding = 0;
}

PUBLIC int __clock_gettime64(clockid_t clock, struct timespec64 *when)
{
    static int (*real)(clockid_t, struct timespec64 *);
    int64_t now;

    if (!clock_is_ours(clock)) {
        if (real == NULL)
            *(void **)&real = dlsym(RTLD_NEXT, "__clock_gettime64");
        return real(clock, when);
    }
    now = clock_look(clock);
    when->seconds = now / NS;
    when->nanoseconds = (int32_t)(now % NS);
    return 0;
}

PUBLIC int __gettimeofday64(struct timeval64 *when, void *zone)
{
    struct timespec64 now;

    (void)zone;
    if (__clock_gettime64(CLOCK_REALTIME, &now) < 0)
        return -1;
    when->seconds = now.seconds;
    when->microseconds = now.nanoseconds / 1000;
    return 0;
}

PUBLIC int64_t __time64(int64_t *when)
{
    struct timespec64 now;

    if (__clock_gettime64(CLOCK_REALTIME, &now) < 0)
        return -1;
    if (when != NULL)
        *when = now.seconds;
    return now.seconds;
}

PUBLIC int __nanosleep64(const struct timespec64 *wanted, struct timespec64 *rest)
{
    struct timespec time, left = {0, 0};
    int result = nanosleep(narrow(wanted, &time), &left);

    if (result < 0 && errno == EINTR && rest != NULL)
        widen(&left, rest);
    return result;
}

PUBLIC int __clock_nanosleep_time64(clockid_t clock, int flags, const struct timespec64 *wanted,
                                    struct timespec64 *rest)
{
    struct timespec time, left = {0, 0};
    int result = clock_nanosleep(clock, flags, narrow(wanted, &time), &left);

    if (result == EINTR && rest != NULL && !(flags & TIMER_ABSTIME))
        widen(&left, rest);
    return result;
}

PUBLIC int __ppoll64(struct pollfd *set, nfds_t count, const struct timespec64 *timeout,
                     const sigset_t *mask)
{
    struct timespec time;

    return ppoll(set, count, narrow(timeout, &time), mask);
}

PUBLIC int __pselect64(int count, fd_set *in, fd_set *out, fd_set *except,
                       const struct timespec64 *timeout, const sigset_t *mask)
{
    struct timespec time;

    return pselect(count, in, out, except, narrow(timeout, &time), mask);
}

PUBLIC int __select64(int count, fd_set *in, fd_set *out, fd_set *except, struct timeval64 *timeout)
{
    struct timeval time;
    int result;

    if (timeout == NULL)
        return select(count, in, out, except, NULL);
    time.tv_sec = (time_t)(timeout->seconds > LATEST ? LATEST : timeout->seconds);
    time.tv_usec = (suseconds_t)timeout->microseconds;
    result = select(count, in, out, except, &time);
    timeout->seconds = time.tv_sec;
    timeout->microseconds = time.tv_usec;
    return result;
}

PUBLIC int __epoll_pwait2_time64(int fd, struct epoll_event *events, int most,
                                 const struct timespec64 *timeout, const sigset_t *mask)
{
    struct timespec time;

    return epoll_pwait2(fd, events, most, narrow(timeout, &time), mask);
}

PUBLIC int __pthread_cond_timedwait64(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                      const struct timespec64 *when)
{
    struct timespec time;

    return pthread_cond_timedwait(condition, mutex, narrow(when, &time));
}

PUBLIC int __pthread_cond_clockwait64(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                      clockid_t clock, const struct timespec64 *when)
{
    struct timespec time;

    return pthread_cond_clockwait(condition, mutex, clock, narrow(when, &time));
}

PUBLIC int __pthread_mutex_timedlock64(pthread_mutex_t *mutex, const struct timespec64 *when)
{
    struct timespec time;

    return pthread_mutex_timedlock(mutex, narrow(when, &time));
}

PUBLIC int __pthread_mutex_clocklock64(pthread_mutex_t *mutex, clockid_t clock,
                                       const struct timespec64 *when)
{
    struct timespec time;

    return pthread_mutex_clocklock(mutex, clock, narrow(when, &time));
}

PUBLIC int __sem_timedwait64(sem_t *semaphore, const struct timespec64 *when)
{
    struct timespec time;

    return sem_timedwait(semaphore, narrow(when, &time));
}

PUBLIC int __sem_clockwait64(sem_t *semaphore, clockid_t clock, const struct timespec64 *when)
{
    struct timespec time;

    return sem_clockwait(semaphore, clock, narrow(when, &time));
}

PUBLIC int __timerfd_settime64(int fd, int flags, const struct itimerspec64 *wanted,
                               struct itimerspec64 *before)
{
    struct itimerspec time, old;
    int result;

    narrow(&wanted->interval, &time.it_interval);
    narrow(&wanted->value, &time.it_value);
    result = timerfd_settime(fd, flags, &time, &old);
    if (result == 0 && before != NULL) {
        widen(&old.it_interval, &before->interval);
        widen(&old.it_value, &before->value);
    }
    return result;
}

PUBLIC int __timerfd_gettime64(int fd, struct itimerspec64 *now)
{
    struct itimerspec time;
    int result = timerfd_gettime(fd, &time);

    if (result == 0) {
        widen(&time.it_interval, &now->interval);
        widen(&time.it_value, &now->value);
    }
    return result;
}
#endif
