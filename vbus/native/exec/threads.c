/* threads.c - waiting for other threads until an instant of virtual time. License: Apache-2.0.
 *
 * Other threads run in wall time. A wait is in vain when for a moment none of them runs and none has
 * used the card; then the chips' time passes and the wall's does not.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "sys.h"
#include "trap.h"

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>

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

/* Whether another thread of this process has something to do right now. */
static int others_run(void)
{
    DIR *folder = opendir("/proc/self/task");
    long self = syscall(SYS_gettid);
    struct dirent *entry;
    int found = 0;

    while (folder != NULL && !found && (entry = readdir(folder)) != NULL) {
        char path[64], text[128], *end;
        ssize_t size;
        int fd;

        if (entry->d_name[0] == '.' || atol(entry->d_name) == self)
            continue;
        snprintf(path, sizeof path, "/proc/self/task/%.16s/stat", entry->d_name);
        fd = sys_open(path, O_RDONLY | O_CLOEXEC);
        size = fd < 0 ? 0 : sys_read(fd, text, sizeof text - 1);
        if (fd >= 0)
            sys_close(fd);
        text[size > 0 ? size : 0] = '\0';
        end = strrchr(text, ')');
        found = end != NULL && end[1] == ' ' && (end[2] == 'R' || end[2] == 'D');
    }
    if (folder != NULL)
        closedir(folder);
    return found;
}

/* One of the waits below, until an instant of `clock` in real time; 0 or an error number. */
struct wait {
    int (*real)(const struct wait *wait, const struct timespec *until);
    void *what, *mutex;
    clockid_t clock;
};

static int wait_until(const struct wait *wait, const struct timespec *when)
{
    int64_t left, waited = 0;
    int result;

    if (when->tv_nsec < 0 || when->tv_nsec >= (long)NS)
        return wait->real(wait, when);
    left = join(when) - clock_look(wait->clock);
    for (;;) {
        uint64_t seen = card_elapsed(), gone;
        struct timespec until;

        sys_clock_gettime(wait->clock, &until);
        split(join(&until) + (left > 0 ? GRACE_MS * 1000000 : 0), &until);
        result = wait->real(wait, &until);
        if (result != ETIMEDOUT || left <= 0)
            return result;
        gone = card_elapsed() - seen;
        waited += GRACE_MS * 1000000;
        if (gone > 0) {
            left -= (int64_t)gone;
        } else if (waited >= left || !others_run()) {
            left = (int64_t)clock_pass((uint64_t)left);
            waited = 0;
        }
        if (left <= 0)
            return ETIMEDOUT;
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
