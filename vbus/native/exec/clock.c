/* clock.c - clocks, sleeps and time-outs that follow the chips' time. License: Apache-2.0.
 *
 * Until the program touches the card, time is real; from then on it runs from the next whole second
 * at the chips' pace.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "files.h"
#include "sys.h"
#include "trap.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <sys/select.h>
#include <sys/time.h>


#define REAL(name)                                                                                 \
    static __typeof__(&name) real;                                                                 \
    if (real == NULL)                                                                              \
        *(void **)&real = dlsym(RTLD_NEXT, #name)

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
    sigset_t before;
    uint64_t now;

    card_enter(&before);
    now = card_look();
    card_leave(&before);
    return base_of(clock) + (int64_t)now;
}

/* Let time pass; what is left if an interrupt's signal came. */
uint64_t clock_pass(uint64_t duration)
{
    sigset_t before;
    uint64_t left;

    card_enter(&before);
    left = card_pass(duration);
    card_send();
    card_leave(&before);
    card_raise();
    return left;
}

static void split(int64_t ns, struct timespec *when)
{
    when->tv_sec = (time_t)(ns / NS);
    when->tv_nsec = (long)(ns % NS);
}

static int64_t join(const struct timespec *when)
{
    return (int64_t)when->tv_sec * NS + when->tv_nsec;
}

/* --- clocks ----------------------------------------------------------------------------------- */

PUBLIC int clock_gettime(clockid_t clock, struct timespec *when)
{
    REAL(clock_gettime);
    if (!clock_is_ours(clock))
        return real(clock, when);
    split(clock_look(clock), when);
    return 0;
}

PUBLIC int gettimeofday(struct timeval *restrict when, void *restrict zone)
{
    struct timespec now;
    REAL(gettimeofday);

    if (!clock_follows())
        return real(when, zone);
    split(clock_look(CLOCK_REALTIME), &now);
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

/* --- sleeps ----------------------------------------------------------------------------------- */

PUBLIC int nanosleep(const struct timespec *wanted, struct timespec *rest)
{
    uint64_t left;
    REAL(nanosleep);

    if (!clock_follows())
        return real(wanted, rest);
    if (wanted->tv_sec < 0 || wanted->tv_nsec < 0 || wanted->tv_nsec >= (long)NS) {
        errno = EINVAL;
        return -1;
    }
    left = clock_pass((uint64_t)join(wanted));
    if (left == 0)
        return 0;
    if (rest != NULL)
        split((int64_t)left, rest);
    errno = EINTR;
    return -1;
}

PUBLIC int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted,
                           struct timespec *rest)
{
    int64_t left;
    REAL(clock_nanosleep);

    if (!clock_is_ours(clock))
        return real(clock, flags, wanted, rest);
    if (wanted->tv_sec < 0 || wanted->tv_nsec < 0 || wanted->tv_nsec >= (long)NS)
        return EINVAL;
    left = join(wanted) - (flags & TIMER_ABSTIME ? clock_look(clock) : 0);
    left = left > 0 ? (int64_t)clock_pass((uint64_t)left) : 0;
    if (left > 0 && rest != NULL && !(flags & TIMER_ABSTIME))
        split(left, rest);
    return left > 0 ? EINTR : 0;
}

PUBLIC int usleep(useconds_t us)
{
    REAL(usleep);
    if (!clock_follows())
        return real(us);
    if (clock_pass((uint64_t)us * 1000) == 0)
        return 0;
    errno = EINTR;
    return -1;
}

PUBLIC unsigned sleep(unsigned seconds)
{
    REAL(sleep);
    return clock_follows() ? (unsigned)((clock_pass((uint64_t)seconds * NS) + NS / 2) / NS) : real(seconds);
}

/* --- waiting for descriptors ------------------------------------------------------------------ */

/* Real time offers nothing to wait for on the device: look once a millisecond. */
static int64_t nap(int64_t ns)
{
    struct timespec before, after;

    sys_clock_gettime(CLOCK_MONOTONIC, &before);
    sys_poll(NULL, 0, GRACE_MS);
    sys_clock_gettime(CLOCK_MONOTONIC, &after);
    if (ns < 0)
        return ns;
    ns -= join(&after) - join(&before);
    return ns > 0 ? ns : 0;
}

static int has_uio(const struct pollfd *set, nfds_t count)
{
    nfds_t turn;

    for (turn = 0; card.present && turn < count; turn++)
        if (files_uio(set[turn].fd))
            return 1;
    return 0;
}

static int selects_uio(int count, const fd_set *in)
{
    int fd;

    for (fd = 0; card.present && in != NULL && fd < count && fd < FD_SETSIZE; fd++)
        if (FD_ISSET(fd, in) && files_uio(fd))
            return 1;
    return 0;
}

/* Wait until descriptors are ready or `ns` of the chips' time have passed (negative: for ever). */
static int poll_until(struct pollfd *set, nfds_t count, int64_t ns)
{
    nfds_t turn, uio = 0, others = 0;
    struct patience patience;

    patience_begin(&patience, ns);
    for (turn = 0; turn < count; turn++) {
        if (files_uio(set[turn].fd))
            uio++;
        else if (set[turn].fd >= 0)
            others++;
    }
    for (;;) {
        int found = 0;

        timers_fire();
        for (turn = 0; turn < count; turn++) { /* what stands for the device is always readable */
            if (files_uio(set[turn].fd))
                set[turn].fd = ~set[turn].fd;
        }
        found = sys_poll(set, count, uio > 0 || ns == 0 ? 0
                                     : ns < 0 && timers_next() < 0 ? -1
                                     : others == 0 ? 0 : GRACE_MS);
        for (turn = 0; turn < count; turn++) {
            if (set[turn].fd < -1 && files_uio(~set[turn].fd)) {
                set[turn].fd = ~set[turn].fd;
                set[turn].revents = 0;
                if (set[turn].events & POLLIN && files_uio_ready()) {
                    set[turn].revents = POLLIN;
                    found = found < 0 ? 1 : found + 1;
                }
            }
        }
        if (found != 0 || ns == 0)
            return found;
        if (uio == 0) {
            int64_t timer = timers_next();

            if (ns < 0 && timer < 0)
                continue;
            if (others > 0 && !patience_over(&patience)) {
                ns = patience.left;
                continue;
            }
            ns = patience.left;
            if (ns == 0)
                continue; /* a last look */
            if (timer >= 0 && (ns < 0 || timer < ns)) {
                if (clock_pass((uint64_t)timer) == 0) {
                    ns = ns < 0 ? ns : ns - timer;
                    patience_begin(&patience, ns);
                    continue;
                }
            } else if (clock_pass((uint64_t)ns) == 0) {
                return 0;
            }
            errno = EINTR;
            return -1;
        }
        if (!card.virtual_time) {
            ns = nap(ns);
        } else {
            int64_t before = clock_look(CLOCK_MONOTONIC), step = ns < 0 || ns > 10000000 ? 10000000 : ns;
            sigset_t mask;

            card_enter(&mask);
            card_approach_interrupt((uint64_t)step);
            card_leave(&mask);
            if (ns > 0) {
                ns -= clock_look(CLOCK_MONOTONIC) - before;
                ns = ns < 0 ? 0 : ns;
            }
        }
    }
}

PUBLIC int poll(struct pollfd *set, nfds_t count, int timeout_ms)
{
    REAL(poll);
    if (!clock_follows() && !has_uio(set, count))
        return real(set, count, timeout_ms);
    return poll_until(set, count, timeout_ms < 0 ? -1 : (int64_t)timeout_ms * 1000000);
}

PUBLIC int __poll_chk(struct pollfd *set, nfds_t count, int timeout_ms, size_t room);
PUBLIC int __poll_chk(struct pollfd *set, nfds_t count, int timeout_ms, size_t room)
{
    if (room / sizeof *set < count)
        __builtin_trap();
    return poll(set, count, timeout_ms);
}

static int refused(const struct timespec *time)
{
    if (time == NULL || (time->tv_sec >= 0 && time->tv_nsec >= 0 && time->tv_nsec < (long)NS))
        return 0;
    errno = EINVAL;
    return -1;
}

PUBLIC int ppoll(struct pollfd *set, nfds_t count, const struct timespec *timeout,
                 const sigset_t *mask)
{
    sigset_t before;
    int found;
    REAL(ppoll);

    if (!clock_follows() && !has_uio(set, count))
        return real(set, count, timeout, mask);
    if (refused(timeout))
        return -1;
    if (mask != NULL)
        pthread_sigmask(SIG_SETMASK, mask, &before);
    found = poll_until(set, count, timeout == NULL ? -1 : join(timeout));
    if (mask != NULL)
        pthread_sigmask(SIG_SETMASK, &before, NULL);
    return found;
}

static int select_until(int count, fd_set *in, fd_set *out, fd_set *except, int64_t ns)
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
    found = poll_until(set, used, ns);
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

    if (!clock_follows() && !selects_uio(count, in))
        return real(count, in, out, except, timeout);
    if (timeout != NULL && (timeout->tv_sec < 0 || timeout->tv_usec < 0)) {
        errno = EINVAL;
        return -1;
    }
    found = select_until(count, in, out, except, ns);
    if (timeout != NULL && found == 0)
        timeout->tv_sec = 0, timeout->tv_usec = 0; /* as Linux does */
    return found;
}

PUBLIC int pselect(int count, fd_set *in, fd_set *out, fd_set *except,
                   const struct timespec *timeout, const sigset_t *mask)
{
    sigset_t before;
    int found;
    REAL(pselect);

    if (!clock_follows() && !selects_uio(count, in))
        return real(count, in, out, except, timeout, mask);
    if (refused(timeout))
        return -1;
    if (mask != NULL)
        pthread_sigmask(SIG_SETMASK, mask, &before);
    found = select_until(count, in, out, except, timeout == NULL ? -1 : join(timeout));
    if (mask != NULL)
        pthread_sigmask(SIG_SETMASK, &before, NULL);
    return found;
}

/* --- waiting for a signal --------------------------------------------------------------------- */

/* Let time pass until the interrupt's signal is on its way; the program's other signals count too. */
static void pass_to_interrupt(void)
{
    uint32_t seen;
    sigset_t before, waiting;

    card_enter(&before);
    seen = card_interrupts();
    while (!card_due() && card_interrupts() == seen) {
        if (card.virtual_time)
            card_approach_interrupt(10000000);
        else
            sys_poll(NULL, 0, GRACE_MS);
        sigemptyset(&waiting);
        if (sigpending(&waiting) == 0 && !sigisemptyset(&waiting))
            break;
    }
    card_leave(&before);
}

PUBLIC int sigsuspend(const sigset_t *mask)
{
    sigset_t copy = *mask, all, before;
    int result, code;
    REAL(sigsuspend);

    if (card.present)
        sigdelset(&copy, SIGSEGV);
    if (!card_in_use() || card.signal == 0 || sigismember(mask, card.signal))
        return real(&copy);
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    pass_to_interrupt();
    card_raise(); /* pending until the mask lets it through */
    result = real(&copy);
    code = errno;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    errno = code;
    return result;
}

PUBLIC int pause(void)
{
    sigset_t mask;

    pthread_sigmask(SIG_BLOCK, NULL, &mask);
    return sigsuspend(&mask);
}
