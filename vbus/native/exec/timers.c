/* timers.c - interval timers, timers that send signals, timer descriptors and epoll in virtual time.
 * License: Apache-2.0.
 *
 * Each timer is a row. An event counter of the kernel stands for each that has a descriptor: it is
 * written when the chips' time has reached the expiry, so that every way to wait works as ever.
 */
#define _GNU_SOURCE
#include "timers.h"

#include "card.h"
#include "clock.h"
#include "files.h"
#include "signals.h"
#include "sys.h"
#include "trap.h"

#include <errno.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/time.h>
#include <sys/timerfd.h>

#define MOST_TIMERS 256

enum kind { NONE, DESCRIPTOR, SIGNAL, ROUTINE, SILENT };

static struct timer {
    enum kind kind;
    int fd, number, overrun, has_real;
    clockid_t clock;
    int64_t until, interval; /* by turns_now; 0: disarmed */
    union sigval value;
    void (*routine)(union sigval);
    pid_t thread;
    timer_t real; /* the kernel's, while time is real */
} timers[MOST_TIMERS];

static struct timer interval_timer = {.kind = SIGNAL, .number = SIGALRM};
static int64_t soonest = FOR_EVER;

static struct timer *timer_at(unsigned place)
{
    return place == MOST_TIMERS ? &interval_timer : &timers[place];
}

static void find_soonest(void)
{
    unsigned place;

    soonest = FOR_EVER;
    for (place = 0; place <= MOST_TIMERS; place++) {
        const struct timer *timer = timer_at(place);

        if (timer->kind != NONE && timer->until != 0 && timer->until < soonest)
            soonest = timer->until;
    }
}

int64_t timers_next(void)
{
    return soonest;
}

static struct timer *with_descriptor(int fd)
{
    unsigned place;

    for (place = 0; fd >= 0 && place < MOST_TIMERS; place++)
        if (timers[place].kind == DESCRIPTOR && timers[place].fd == fd)
            return &timers[place];
    return NULL;
}

int timers_has(int fd)
{
    return with_descriptor(fd) != NULL;
}

void timers_closed(unsigned first, unsigned last)
{
    unsigned place;

    for (place = 0; place < MOST_TIMERS; place++)
        if (timers[place].kind == DESCRIPTOR && (unsigned)timers[place].fd >= first
            && (unsigned)timers[place].fd <= last)
            timers[place].kind = NONE;
    find_soonest();
}

void timers_forget(void)
{
    unsigned place;

    for (place = 0; place < MOST_TIMERS; place++)
        if (timers[place].kind != DESCRIPTOR)
            timers[place].kind = NONE;
    interval_timer.until = 0;
    find_soonest();
}

/* --- expiring --------------------------------------------------------------------------------- */

static void *run_routine(void *data)
{
    const struct timer *timer = data;

    timer->routine(timer->value);
    return NULL;
}

static void expire(struct timer *timer, uint64_t times)
{
    struct guest *guest;
    pthread_attr_t attributes;
    pthread_t thread;

    timer->overrun = (int)(times - 1);
    switch (timer->kind) {
    case DESCRIPTOR:
        sys_write(timer->fd, &times, sizeof times);
        files_changed();
        break;
    case SIGNAL:
        for (guest = timer->thread ? turns_next(NULL) : NULL; guest != NULL;
             guest = turns_next(guest))
            if (guest->tid == timer->thread) {
                signals_send_to(guest, timer->number, SI_TIMER, timer->value);
                return;
            }
        signals_send(timer->number, timer == &interval_timer ? SI_KERNEL : SI_TIMER, timer->value);
        break;
    case ROUTINE:
        pthread_attr_init(&attributes);
        pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
        pthread_create(&thread, &attributes, run_routine, timer);
        pthread_attr_destroy(&attributes);
        break;
    default:
        break;
    }
}

void timers_fire(void)
{
    int64_t now;
    unsigned place;

    if (soonest == FOR_EVER || (now = turns_now()) < soonest)
        return;
    for (place = 0; place <= MOST_TIMERS; place++) {
        struct timer *timer = timer_at(place);
        uint64_t times = 1;

        if (timer->kind == NONE || timer->until == 0 || timer->until > now)
            continue;
        if (timer->interval > 0) {
            times += (uint64_t)((now - timer->until) / timer->interval);
            timer->until += (int64_t)times * timer->interval;
        } else {
            timer->until = 0;
        }
        find_soonest();
        expire(timer, times);
    }
}

/* --- setting ---------------------------------------------------------------------------------- */

static int valid(const struct itimerspec *wanted)
{
    return wanted->it_value.tv_sec >= 0 && wanted->it_value.tv_nsec >= 0
           && wanted->it_value.tv_nsec < NS && wanted->it_interval.tv_sec >= 0
           && wanted->it_interval.tv_nsec >= 0 && wanted->it_interval.tv_nsec < NS;
}

static void get(const struct timer *timer, struct itimerspec *now)
{
    int64_t left = timer->until == 0 ? 0 : timer->until - turns_now();

    split_ns(timer->interval, &now->it_interval);
    split_ns(timer->until != 0 && left < 1 ? 1 : left, &now->it_value);
}

static void set(struct timer *timer, int absolute, const struct itimerspec *wanted)
{
    int64_t first = ns_of(&wanted->it_value), now = turns_now();

    timer->interval = ns_of(&wanted->it_interval);
    timer->until = 0;
    if (first > 0 && absolute) {
        first -= clock_look(timer->clock);
        now = turns_now();
    }
    if (ns_of(&wanted->it_value) > 0)
        timer->until = first > 0 ? now + first : now;
    find_soonest();
}

static struct timer *add(enum kind kind)
{
    unsigned place;

    for (place = 0; place < MOST_TIMERS; place++)
        if (timers[place].kind == NONE) {
            memset(&timers[place], 0, sizeof timers[place]);
            timers[place].kind = kind;
            return &timers[place];
        }
    errno = EAGAIN;
    return NULL;
}

/* --- descriptors ------------------------------------------------------------------------------ */

PUBLIC int timerfd_create(int clock, int flags)
{
    struct timer *timer;
    int fd;
    REAL(timerfd_create);

    if (!card.present || !card.virtual_time)
        return real(clock, flags);
    if (clock != CLOCK_REALTIME && clock != CLOCK_MONOTONIC && clock != CLOCK_BOOTTIME)
        return real(clock, flags);
    fd = eventfd(0, (flags & TFD_NONBLOCK ? EFD_NONBLOCK : 0)
                        | (flags & TFD_CLOEXEC ? EFD_CLOEXEC : 0));
    timer = fd < 0 ? NULL : add(DESCRIPTOR);
    if (timer == NULL) {
        if (fd >= 0)
            sys_close(fd);
        errno = EMFILE;
        return -1;
    }
    timer->clock = clock;
    timer->fd = fd;
    return fd;
}

PUBLIC int timerfd_gettime(int fd, struct itimerspec *now)
{
    REAL(timerfd_gettime);
    if (!timers_has(fd))
        return real(fd, now);
    timers_fire();
    get(with_descriptor(fd), now);
    return 0;
}

PUBLIC int timerfd_settime(int fd, int flags, const struct itimerspec *wanted,
                           struct itimerspec *before)
{
    struct pollfd full = {fd, POLLIN, 0};
    uint64_t count;
    REAL(timerfd_settime);

    if (!timers_has(fd))
        return real(fd, flags, wanted, before);
    if (!valid(wanted)) {
        errno = EINVAL;
        return -1;
    }
    card_enter();
    card_begin_time();
    card_leave();
    if (before != NULL)
        timerfd_gettime(fd, before);
    if (sys_poll(&full, 1, 0) > 0)
        sys_read(fd, &count, sizeof count); /* unread expiries are forgotten */
    set(with_descriptor(fd), flags & TFD_TIMER_ABSTIME, wanted);
    timers_fire();
    return 0;
}

/* --- the interval timer ----------------------------------------------------------------------- */

static void as_spec(const struct itimerval *from, struct itimerspec *to)
{
    to->it_value.tv_sec = from->it_value.tv_sec;
    to->it_value.tv_nsec = from->it_value.tv_usec * 1000;
    to->it_interval.tv_sec = from->it_interval.tv_sec;
    to->it_interval.tv_nsec = from->it_interval.tv_usec * 1000;
}

static void as_val(const struct itimerspec *from, struct itimerval *to)
{
    to->it_value.tv_sec = from->it_value.tv_sec;
    to->it_value.tv_usec = (from->it_value.tv_nsec + 999) / 1000;
    to->it_interval.tv_sec = from->it_interval.tv_sec;
    to->it_interval.tv_usec = from->it_interval.tv_nsec / 1000;
}

PUBLIC int getitimer(__itimer_which_t which, struct itimerval *now)
{
    struct itimerspec spec;
    REAL(getitimer);

    if (which != ITIMER_REAL || !clock_follows())
        return real(which, now);
    get(&interval_timer, &spec);
    as_val(&spec, now);
    return 0;
}

PUBLIC int setitimer(__itimer_which_t which, const struct itimerval *restrict wanted,
                     struct itimerval *restrict before)
{
    struct itimerspec spec;
    REAL(setitimer);

    if (which != ITIMER_REAL || !clock_follows())
        return real(which, wanted, before);
    as_spec(wanted, &spec);
    if (!valid(&spec)) {
        errno = EINVAL;
        return -1;
    }
    if (before != NULL)
        getitimer(which, before);
    turns_enter();
    set(&interval_timer, 0, &spec);
    turns_leave();
    return 0;
}

PUBLIC unsigned alarm(unsigned seconds)
{
    struct itimerval wanted = {{0, 0}, {(time_t)seconds, 0}}, before;
    REAL(alarm);

    if (!clock_follows())
        return real(seconds);
    setitimer(ITIMER_REAL, &wanted, &before);
    return (unsigned)before.it_value.tv_sec
           + (before.it_value.tv_usec >= 500000
              || (before.it_value.tv_sec == 0 && before.it_value.tv_usec > 0));
}

PUBLIC useconds_t ualarm(useconds_t first, useconds_t interval)
{
    struct itimerval wanted = {{interval / 1000000, interval % 1000000},
                               {first / 1000000, first % 1000000}}, before;

    if (setitimer(ITIMER_REAL, &wanted, &before) < 0)
        return (useconds_t)-1;
    return (useconds_t)(before.it_value.tv_sec * 1000000 + before.it_value.tv_usec);
}

/* --- timers that send signals ----------------------------------------------------------------- */

static struct timer *row_of(timer_t timer)
{
    struct timer *row = (struct timer *)timer;

    return row >= timers && row < timers + MOST_TIMERS ? row : NULL;
}

static int known_clock(clockid_t clock)
{
    return clock == CLOCK_REALTIME || clock == CLOCK_MONOTONIC || clock == CLOCK_BOOTTIME;
}

PUBLIC int timer_create(clockid_t clock, struct sigevent *restrict event, timer_t *restrict timer)
{
    struct timer *row;
    REAL(timer_create);

    if (!card.present || !card.virtual_time || !known_clock(clock))
        return real(clock, event, timer);
    turns_enter();
    row = add(SIGNAL);
    turns_leave();
    if (row == NULL)
        return -1;
    row->clock = clock;
    row->number = SIGALRM;
    row->value.sival_ptr = row;
    if (event != NULL) {
        row->kind = event->sigev_notify == SIGEV_NONE     ? SILENT
                    : event->sigev_notify == SIGEV_THREAD ? ROUTINE
                                                          : SIGNAL;
        row->number = event->sigev_signo;
        row->value = event->sigev_value;
        row->routine = event->sigev_notify_function;
        if (event->sigev_notify == SIGEV_THREAD_ID)
            row->thread = event->_sigev_un._tid;
    }
    if (!clock_follows()) {
        row->has_real = 1;
        if (real(clock, event, &row->real) < 0) {
            row->kind = NONE;
            return -1;
        }
    }
    *timer = (timer_t)row;
    return 0;
}

PUBLIC int timer_gettime(timer_t timer, struct itimerspec *now)
{
    struct timer *row = row_of(timer);
    REAL(timer_gettime);

    if (row == NULL || !clock_follows())
        return real(row == NULL ? timer : row->real, now);
    get(row, now);
    return 0;
}

PUBLIC int timer_settime(timer_t timer, int flags, const struct itimerspec *restrict wanted,
                         struct itimerspec *restrict before)
{
    struct timer *row = row_of(timer);
    REAL(timer_settime);

    if (row == NULL || !clock_follows())
        return real(row == NULL ? timer : row->real, flags, wanted, before);
    if (!valid(wanted)) {
        errno = EINVAL;
        return -1;
    }
    turns_enter();
    if (before != NULL)
        get(row, before);
    set(row, flags & TIMER_ABSTIME, wanted);
    timers_fire();
    turns_leave();
    return 0;
}

PUBLIC int timer_getoverrun(timer_t timer)
{
    struct timer *row = row_of(timer);
    REAL(timer_getoverrun);

    if (row == NULL || !clock_follows())
        return real(row == NULL ? timer : row->real);
    return row->overrun;
}

PUBLIC int timer_delete(timer_t timer)
{
    struct timer *row = row_of(timer);
    int result = 0;
    REAL(timer_delete);

    if (row == NULL)
        return real(timer);
    if (row->has_real)
        result = real(row->real);
    turns_enter();
    row->kind = NONE;
    find_soonest();
    turns_leave();
    return result;
}

void timers_begin(void)
{
    static const struct itimerval never;
    struct itimerval left;
    struct itimerspec spec;
    unsigned place;
    int (*get_real)(timer_t, struct itimerspec *);
    int (*drop_real)(timer_t);
    int (*real)(__itimer_which_t, const struct itimerval *, struct itimerval *);

    *(void **)&real = dlsym(RTLD_NEXT, "setitimer");
    *(void **)&get_real = dlsym(RTLD_NEXT, "timer_gettime");
    *(void **)&drop_real = dlsym(RTLD_NEXT, "timer_delete");
    if (real(ITIMER_REAL, &never, &left) == 0) {
        as_spec(&left, &spec);
        set(&interval_timer, 0, &spec);
    }
    for (place = 0; place < MOST_TIMERS; place++) {
        struct timer *timer = &timers[place];

        if (timer->kind == NONE || !timer->has_real || get_real(timer->real, &spec) < 0)
            continue;
        drop_real(timer->real);
        timer->has_real = 0;
        set(timer, 0, &spec);
    }
}

/* --- epoll ------------------------------------------------------------------------------------ */

static int wait_for_events(int fd, struct epoll_event *events, int most, int64_t ns,
                           const sigset_t *mask)
{
    struct pollfd set = {fd, POLLIN, 0};
    struct epoll_event none;
    int found = clock_poll(&set, 1, ns, mask);

    if (found < 0)
        return -1;
    return (int)syscall(SYS_epoll_pwait, fd, events == NULL ? &none : events, most, 0, NULL, 8);
}

PUBLIC int epoll_pwait(int fd, struct epoll_event *events, int most, int timeout_ms,
                       const sigset_t *mask)
{
    REAL(epoll_pwait);
    if (!clock_waits())
        return real(fd, events, most, timeout_ms, mask);
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

    if (clock_waits())
        return wait_for_events(fd, events, most, timeout == NULL ? -1 : ns_of(timeout), mask);
    if (real == NULL)
        *(void **)&real = dlsym(RTLD_NEXT, "epoll_pwait2");
    if (real == NULL) {
        errno = ENOSYS;
        return -1;
    }
    return real(fd, events, most, timeout, mask);
}
