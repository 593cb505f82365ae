/* clock.c - clocks, sleeps and time-outs that follow the chips' time. License: Apache-2.0.
 *
 * Until the program touches the card, time is real; from then on it runs from the next whole second
 * at the chips' pace.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "files.h"
#include "signals.h"
#include "sys.h"
#include "trap.h"

#include <errno.h>
#include <pthread.h>
#include <sys/select.h>
#include <sys/time.h>

static int (*clock_behind)(clockid_t, struct timespec *);

void sys_find_clock(void)
{
    *(void **)&clock_behind = dlsym(RTLD_NEXT, "clock_gettime");
}

int sys_clock_gettime(clockid_t clock, struct timespec *when)
{
    if (clock_behind != NULL)
        return clock_behind(clock, when);
    return (int)syscall(SYS_clock_gettime, clock, when);
}

int clock_follows(void)
{
    return card.virtual_time && card_time_begun();
}

int clock_is_ours(clockid_t clock)
{
    switch (clock) {
    case CLOCK_REALTIME: case CLOCK_MONOTONIC: case CLOCK_MONOTONIC_RAW: case CLOCK_BOOTTIME:
    case CLOCK_REALTIME_COARSE: case CLOCK_MONOTONIC_COARSE: case CLOCK_TAI:
        return clock_follows();
    default:
        return 0;
    }
}

/* Where a clock stands while the virtual time is 0: the whole second that came next then. */
static int64_t base_of(clockid_t clock)
{
    static int64_t bases[16];
    int64_t *base = &bases[clock & 15];

    if (clock == CLOCK_REALTIME_COARSE)
        return base_of(CLOCK_REALTIME);
    if (clock == CLOCK_MONOTONIC_COARSE || clock == CLOCK_MONOTONIC_RAW)
        return base_of(CLOCK_MONOTONIC);
    if (*base == 0) {
        struct timespec now;

        sys_clock_gettime(clock, &now);
        *base = ((int64_t)now.tv_sec + 1) * NS;
    }
    return *base;
}

void card_set_clocks(void)
{
    base_of(CLOCK_REALTIME);
    base_of(CLOCK_MONOTONIC);
    base_of(CLOCK_BOOTTIME);
    base_of(CLOCK_TAI);
}

int64_t clock_look(clockid_t clock)
{
    uint64_t now;

    card_enter();
    now = card_look();
    card_leave();
    return base_of(clock) + (int64_t)now;
}

int64_t clock_compare(clockid_t clock)
{
    struct timespec now;

    if (clock_is_ours(clock))
        return base_of(clock) + (int64_t)card_elapsed();
    sys_clock_gettime(clock, &now);
    return ns_of(&now);
}

int clock_waits(void)
{
    return clock_follows() || turns_many();
}

/* --- clocks ----------------------------------------------------------------------------------- */

PUBLIC int clock_gettime(clockid_t clock, struct timespec *when)
{
    REAL(clock_gettime);
    if (!clock_is_ours(clock))
        return real(clock, when);
    split_ns(clock_look(clock), when);
    return 0;
}

PUBLIC int gettimeofday(struct timeval *restrict when, void *restrict zone)
{
    struct timespec now;
    REAL(gettimeofday);

    if (!clock_follows())
        return real(when, zone);
    split_ns(clock_look(CLOCK_REALTIME), &now);
    when->tv_sec = now.tv_sec;
    when->tv_usec = now.tv_nsec / 1000;
    return 0;
}

PUBLIC time_t time(time_t *when)
{
    time_t now;
    REAL(time);

    if (!clock_follows())
        return real(when);
    now = (time_t)(clock_look(CLOCK_REALTIME) / NS);
    if (when != NULL)
        *when = now;
    return now;
}

PUBLIC int timespec_get(struct timespec *when, int base)
{
    if (base != TIME_UTC)
        return 0;
    clock_gettime(CLOCK_REALTIME, when);
    return base;
}

/* --- sleeps ----------------------------------------------------------------------------------- */

/* Wait until an instant of turns_now: what is left if a signal came. */
static int64_t sleep_until(int64_t until)
{
    struct wait wait = {.until = until};
    int64_t left = 0;

    pthread_testcancel();
    turns_enter();
    while (turns_wait(&wait) == INTERRUPTED && turns_interrupt() != GO_ON) {
        left = until - turns_now();
        break;
    }
    turns_leave();
    return left > 0 ? left : 0;
}

static int64_t sleep_for(int64_t ns)
{
    return sleep_until(turns_now() + ns);
}

static int refused(const struct timespec *time)
{
    if (time == NULL || (time->tv_sec >= 0 && time->tv_nsec >= 0 && time->tv_nsec < (long)NS))
        return 0;
    errno = EINVAL;
    return -1;
}

PUBLIC int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted,
                           struct timespec *rest)
{
    int64_t left;
    REAL(clock_nanosleep);

    if (!clock_waits() || (clock_follows() && !clock_is_ours(clock)))
        return real(clock, flags, wanted, rest);
    if (refused(wanted))
        return EINVAL;
    left = ns_of(wanted) - (flags & TIMER_ABSTIME ? clock_look(clock) : 0);
    left = sleep_for(left);
    if (left > 0 && rest != NULL && !(flags & TIMER_ABSTIME))
        split_ns(left, rest);
    return left > 0 ? EINTR : 0;
}

PUBLIC int nanosleep(const struct timespec *wanted, struct timespec *rest)
{
    int error;
    REAL(nanosleep);

    if (!clock_waits())
        return real(wanted, rest);
    error = clock_nanosleep(CLOCK_MONOTONIC, 0, wanted, rest);
    if (error == 0)
        return 0;
    errno = error;
    return -1;
}

PUBLIC int usleep(useconds_t us)
{
    struct timespec wanted;

    split_ns((int64_t)us * 1000, &wanted);
    return nanosleep(&wanted, NULL);
}

PUBLIC unsigned sleep(unsigned seconds)
{
    struct timespec rest;
    REAL(sleep);

    if (!clock_waits())
        return real(seconds);
    split_ns(sleep_for((int64_t)seconds * NS), &rest);
    return (unsigned)rest.tv_sec + (rest.tv_nsec >= NS / 2);
}

/* --- waiting for descriptors ------------------------------------------------------------------ */

int clock_poll(struct pollfd *set, nfds_t count, int64_t ns, const sigset_t *mask)
{
    struct wait wait = {.set = set, .count = count, .until = FOR_EVER};
    int found;

    pthread_testcancel();
    card_refresh();
    if (ns == 0 && mask == NULL) {
        turns_yield();
        return sys_poll(set, count, 0);
    }
    turns_enter();
    if (ns >= 0)
        wait.until = turns_now() + ns;
    for (;;) {
        enum after after;
        enum ending ending = signals_wait(mask, &wait, &after);

        found = sys_poll(set, count, 0);
        if (found != 0 || ending == LATE)
            break;
        if (after != GO_ON) {
            errno = EINTR;
            found = -1;
            break;
        }
    }
    turns_leave();
    return found;
}

int clock_await(int fd, short events)
{
    struct pollfd set = {fd, events, 0};
    struct wait wait = {.set = &set, .count = 1, .until = FOR_EVER};
    int result = 0;

    if (!clock_waits() || sys_poll(&set, 1, 0) != 0 || fcntl(fd, F_GETFL) & O_NONBLOCK)
        return 0;
    pthread_testcancel();
    turns_enter();
    while (result == 0 && turns_wait(&wait) != FOUND)
        if (turns_interrupt() == FAIL) {
            errno = EINTR;
            result = -1;
        }
    turns_leave();
    return result;
}

PUBLIC int poll(struct pollfd *set, nfds_t count, int timeout_ms)
{
    REAL(poll);
    if (!clock_waits())
        return real(set, count, timeout_ms);
    return clock_poll(set, count, timeout_ms < 0 ? -1 : (int64_t)timeout_ms * 1000000, NULL);
}

PUBLIC int __poll_chk(struct pollfd *set, nfds_t count, int timeout_ms, size_t room);
PUBLIC int __poll_chk(struct pollfd *set, nfds_t count, int timeout_ms, size_t room)
{
    if (room / sizeof *set < count)
        __builtin_trap();
    return poll(set, count, timeout_ms);
}

PUBLIC int ppoll(struct pollfd *set, nfds_t count, const struct timespec *timeout,
                 const sigset_t *mask)
{
    REAL(ppoll);
    if (!clock_waits())
        return real(set, count, timeout, mask);
    if (refused(timeout))
        return -1;
    return clock_poll(set, count, timeout == NULL ? -1 : ns_of(timeout), mask);
}

static int select_until(int count, fd_set *in, fd_set *out, fd_set *except, int64_t ns,
                        const sigset_t *mask)
{
    struct pollfd set[FD_SETSIZE];
    nfds_t used = 0, turn;
    int fd, found, ready = 0;

    for (fd = 0; fd < count && fd < FD_SETSIZE; fd++) {
        short events = 0;

        events |= in != NULL && FD_ISSET(fd, in) ? POLLIN : 0;
        events |= out != NULL && FD_ISSET(fd, out) ? POLLOUT : 0;
        events |= except != NULL && FD_ISSET(fd, except) ? POLLPRI : 0;
        if (events != 0) {
            set[used].fd = fd;
            set[used].events = events;
            set[used++].revents = 0;
        }
    }
    found = clock_poll(set, used, ns, mask);
    if (found < 0)
        return found;
    for (turn = 0; turn < used; turn++) {
        short got = set[turn].revents;

        if (got & POLLNVAL) {
            errno = EBADF;
            return -1;
        }
        fd = set[turn].fd;
        if (set[turn].events & POLLIN) {
            if (got & (POLLIN | POLLHUP | POLLERR))
                ready++;
            else
                FD_CLR(fd, in);
        }
        if (set[turn].events & POLLOUT) {
            if (got & (POLLOUT | POLLERR))
                ready++;
            else
                FD_CLR(fd, out);
        }
        if (set[turn].events & POLLPRI) {
            if (got & POLLPRI)
                ready++;
            else
                FD_CLR(fd, except);
        }
    }
    return ready;
}

PUBLIC int select(int count, fd_set *in, fd_set *out, fd_set *except, struct timeval *timeout)
{
    int64_t ns = timeout == NULL ? -1 : (int64_t)timeout->tv_sec * NS + timeout->tv_usec * 1000;
    int found;
    REAL(select);

    if (!clock_waits())
        return real(count, in, out, except, timeout);
    if (timeout != NULL && (timeout->tv_sec < 0 || timeout->tv_usec < 0)) {
        errno = EINVAL;
        return -1;
    }
    found = select_until(count, in, out, except, ns, NULL);
    if (timeout != NULL && found == 0)
        timeout->tv_sec = 0, timeout->tv_usec = 0; /* as Linux does */
    return found;
}

PUBLIC int pselect(int count, fd_set *in, fd_set *out, fd_set *except,
                   const struct timespec *timeout, const sigset_t *mask)
{
    REAL(pselect);
    if (!clock_waits())
        return real(count, in, out, except, timeout, mask);
    if (refused(timeout))
        return -1;
    return select_until(count, in, out, except, timeout == NULL ? -1 : ns_of(timeout), mask);
}
