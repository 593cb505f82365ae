/* timers.c - timer descriptors and epoll in virtual time. License: Apache-2.0.
 *
 * An event counter of the kernel stands for each timer: it is written when the chips' time has
 * reached the expiry, so that every way to wait for descriptors works as ever.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "sys.h"
#include "trap.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>

#define MOST_TIMERS 256

#define REAL(name)                                                                                 \
    static __typeof__(&name) real;                                                                 \
    if (real == NULL)                                                                              \
        *(void **)&real = dlsym(RTLD_NEXT, #name)

/* By descriptor. Expiry counts from the beginning of virtual time (ns); 0 is disarmed. */
static struct timer {
    int is_timer;
    clockid_t clock;
    uint64_t expiry, interval;
} timers[MOST_TIMERS];

static volatile int armed; /* whether there is anything to look at */

int timers_has(int fd)
{
    return fd >= 0 && fd < MOST_TIMERS && timers[fd].is_timer;
}

void timers_closed(unsigned first, unsigned last)
{
    for (; first <= last && first < MOST_TIMERS; first++)
        memset(&timers[first], 0, sizeof timers[first]);
}

int64_t timers_next(void)
{
    uint64_t now = card_elapsed();
    int64_t least = -1;
    int fd;

    for (fd = 0; armed && fd < MOST_TIMERS; fd++)
        if (timers[fd].expiry != 0) {
            int64_t left = timers[fd].expiry > now ? (int64_t)(timers[fd].expiry - now) : 0;

            if (least < 0 || left < least)
                least = left;
        }
    return least;
}

void timers_fire(void)
{
    uint64_t now = card_elapsed();
    int fd;

    for (fd = 0; armed && fd < MOST_TIMERS; fd++) {
        struct timer *timer = &timers[fd];
        uint64_t times = 1;

        if (timer->expiry == 0 || timer->expiry > now)
            continue;
        if (timer->interval > 0) {
            times += (now - timer->expiry) / timer->interval;
            timer->expiry += times * timer->interval;
        } else {
            timer->expiry = 0;
        }
        sys_write(fd, &times, sizeof times);
    }
}

/* Wait in steps: until a descriptor is readable, or nothing more can happen. */
int timers_wait(int fd)
{
    struct pollfd wanted = {fd, POLLIN, 0};

    for (;;) {
        int64_t left;

        timers_fire();
        if (fcntl(fd, F_GETFL) & O_NONBLOCK || sys_poll(&wanted, 1, 0) != 0)
            return 0;
        left = timers_next();
        if (left < 0)
            sys_poll(&wanted, 1, GRACE_MS); /* another thread may arm it */
        else if (clock_pass((uint64_t)left) > 0) {
            errno = EINTR;
            return -1;
        }
    }
}

PUBLIC int timerfd_create(int clock, int flags)
{
    int fd;
    REAL(timerfd_create);

    if (!card.present || !card.virtual_time)
        return real(clock, flags);
    if (clock != CLOCK_REALTIME && clock != CLOCK_MONOTONIC && clock != CLOCK_BOOTTIME)
        return real(clock, flags);
    fd = eventfd(0, (flags & TFD_NONBLOCK ? EFD_NONBLOCK : 0)
                        | (flags & TFD_CLOEXEC ? EFD_CLOEXEC : 0));
    if (fd < 0 || fd >= MOST_TIMERS) {
        if (fd >= 0) {
            sys_close(fd);
            errno = EMFILE;
        }
        return -1;
    }
    memset(&timers[fd], 0, sizeof timers[fd]);
    timers[fd].clock = clock;
    timers[fd].is_timer = 1;
    return fd;
}

static uint64_t ns_of(const struct timespec *time)
{
    return (uint64_t)time->tv_sec * NS + (uint64_t)time->tv_nsec;
}

static void split(uint64_t ns, struct timespec *time)
{
    time->tv_sec = (time_t)(ns / NS);
    time->tv_nsec = (long)(ns % NS);
}

PUBLIC int timerfd_gettime(int fd, struct itimerspec *now)
{
    REAL(timerfd_gettime);
    if (!timers_has(fd))
        return real(fd, now);
    timers_fire();
    split(timers[fd].interval, &now->it_interval);
    split(timers[fd].expiry > 0 ? timers[fd].expiry - card_elapsed() : 0, &now->it_value);
    return 0;
}

static int valid(const struct timespec *time)
{
    return time->tv_sec >= 0 && time->tv_nsec >= 0 && time->tv_nsec < (long)NS;
}

PUBLIC int timerfd_settime(int fd, int flags, const struct itimerspec *wanted,
                           struct itimerspec *before)
{
    struct timer *timer;
    struct pollfd full = {fd, POLLIN, 0};
    uint64_t first, count, now;
    sigset_t mask;
    REAL(timerfd_settime);

    if (!timers_has(fd))
        return real(fd, flags, wanted, before);
    if (!valid(&wanted->it_value) || !valid(&wanted->it_interval)) {
        errno = EINVAL;
        return -1;
    }
    card_enter(&mask);
    card_begin_time();
    card_leave(&mask);
    if (before != NULL)
        timerfd_gettime(fd, before);
    if (sys_poll(&full, 1, 0) > 0)
        sys_read(fd, &count, sizeof count); /* expiries nobody has read are forgotten */
    timer = &timers[fd];
    first = ns_of(&wanted->it_value);
    now = card_elapsed();
    timer->interval = ns_of(&wanted->it_interval);
    timer->expiry = 0;
    if (first > 0 && flags & TFD_TIMER_ABSTIME) {
        int64_t left = (int64_t)first - clock_look(timer->clock);

        now = card_elapsed();
        timer->expiry = left > 0 ? now + (uint64_t)left : now > 0 ? now : 1;
    } else if (first > 0) {
        timer->expiry = now + first;
    }
    armed = 1;
    return 0;
}

/* --- epoll ------------------------------------------------------------------------------------ */

static int (*real_epoll)(int, struct epoll_event *, int, int, const sigset_t *);

static int wait_for_events(int fd, struct epoll_event *events, int most, int64_t ns,
                           const sigset_t *mask)
{
    struct patience patience;

    patience_begin(&patience, ns);
    for (;;) {
        int64_t timer, step;
        int found;

        timers_fire();
        timer = timers_next();
        found = real_epoll(fd, events, most, ns == 0 ? 0 : ns < 0 && timer < 0 ? -1 : GRACE_MS, mask);
        if (found != 0 || ns == 0)
            return found;
        if (ns < 0 && timer < 0)
            continue;
        if (!patience_over(&patience)) {
            ns = patience.left;
            continue;
        }
        ns = patience.left;
        if (ns == 0)
            continue; /* a last look */
        step = timer >= 0 && (ns < 0 || timer < ns) ? timer : ns;
        if (clock_pass((uint64_t)step) > 0) {
            errno = EINTR;
            return -1;
        }
        if (ns > 0)
            ns -= step;
        patience_begin(&patience, ns);
    }
}

static void find_epoll(void)
{
    if (real_epoll == NULL)
        *(void **)&real_epoll = dlsym(RTLD_NEXT, "epoll_pwait");
}

PUBLIC int epoll_pwait(int fd, struct epoll_event *events, int most, int timeout_ms,
                       const sigset_t *mask)
{
    find_epoll();
    if (!clock_follows())
        return real_epoll(fd, events, most, timeout_ms, mask);
    return wait_for_events(fd, events, most, timeout_ms < 0 ? -1 : (int64_t)timeout_ms * 1000000,
                           mask);
}

PUBLIC int epoll_wait(int fd, struct epoll_event *events, int most, int timeout_ms)
{
    return epoll_pwait(fd, events, most, timeout_ms, NULL);
}

PUBLIC int epoll_pwait2(int fd, struct epoll_event *events, int most,
                        const struct timespec *timeout, const sigset_t *mask)
{
    static int (*real)(int, struct epoll_event *, int, const struct timespec *, const sigset_t *);

    find_epoll();
    if (clock_follows())
        return wait_for_events(fd, events, most, timeout == NULL ? -1 : (int64_t)ns_of(timeout),
                               mask);
    if (real == NULL)
        *(void **)&real = dlsym(RTLD_NEXT, "epoll_pwait2");
    if (real == NULL) {
        errno = ENOSYS;
        return -1;
    }
    return real(fd, events, most, timeout, mask);
}
