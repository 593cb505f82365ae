/* calls.c - system calls that programs make by number. License: Apache-2.0. */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "sys.h"
#include "trap.h"
#include "turns.h"

#include <errno.h>
#include <limits.h>
#include <linux/futex.h>
#include <stdarg.h>
#include <sys/auxv.h>
#include <sys/time.h>

static long find_it(long number, ...);

long (*sys_call)(long number, ...) = find_it;

static long find_it(long number, ...)
{
    long a[6];
    va_list rest;
    int turn;

    va_start(rest, number);
    for (turn = 0; turn < 6; turn++)
        a[turn] = va_arg(rest, long);
    va_end(rest);
    *(void **)&sys_call = dlsym(RTLD_NEXT, "syscall");
    return sys_call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

/* --- what other languages and libraries wait with ---------------------------------------------- */

static long wait_at(const uint32_t *word, uint32_t value, int operation,
                    const struct timespec *longest)
{
    struct wait wait = {.object = word, .until = FOR_EVER};
    long result = 0;

    wait.shared = !(operation & FUTEX_PRIVATE_FLAG);
    turns_enter();
    if (longest != NULL && (operation & FUTEX_CMD_MASK) == FUTEX_WAIT)
        wait.until = turns_now() + ns_of(longest);
    else if (longest != NULL)
        wait.until = turns_now() + ns_of(longest)
                     - clock_compare(operation & FUTEX_CLOCK_REALTIME ? CLOCK_REALTIME
                                                                      : CLOCK_MONOTONIC);
    if (*(const volatile uint32_t *)word != value) {
        errno = EAGAIN;
        result = -1;
    }
    while (result == 0) {
        enum ending ending = turns_wait(&wait);

        if (ending == TOLD && (!wait.shared || *(const volatile uint32_t *)word != value))
            break;
        if (ending == LATE || (ending == INTERRUPTED && turns_interrupt() == FAIL)) {
            errno = ending == LATE ? ETIMEDOUT : EINTR;
            result = -1;
        }
    }
    turns_leave();
    return result;
}

static long tell_at(const uint32_t *word, unsigned most)
{
    long done;

    turns_enter();
    done = turns_tell(word, most);
    turns_leave();
    return done;
}

/* --- what is not bent -------------------------------------------------------------------------- */

/* Calls that wait, or let time pass, in a way of their own when they are made by number. */
static const struct {
    long number;
    const char *name;
} unbent[] = {
#ifdef SYS_select
    {SYS_select, "select"},
#endif
#ifdef SYS__newselect
    {SYS__newselect, "select"},
#endif
#ifdef SYS_alarm
    {SYS_alarm, "alarm"},
#endif
#ifdef SYS_clock_gettime64
    {SYS_clock_gettime64, "clock_gettime64"}, {SYS_clock_nanosleep_time64, "clock_nanosleep_time64"},
    {SYS_futex_time64, "futex_time64"}, {SYS_ppoll_time64, "ppoll_time64"},
    {SYS_pselect6_time64, "pselect6_time64"},
    {SYS_rt_sigtimedwait_time64, "rt_sigtimedwait_time64"},
#endif
#ifdef SYS_futex_waitv
    {SYS_futex_waitv, "futex_waitv"},
#endif
    {SYS_pselect6, "pselect6"}, {SYS_ppoll, "ppoll"}, {SYS_epoll_wait, "epoll_wait"},
    {SYS_epoll_pwait, "epoll_pwait"}, {SYS_rt_sigtimedwait, "rt_sigtimedwait"},
    {SYS_rt_sigsuspend, "rt_sigsuspend"}, {SYS_setitimer, "setitimer"},
    {SYS_timer_create, "timer_create"}, {SYS_timerfd_settime, "timerfd_settime"},
    {SYS_mq_timedreceive, "mq_timedreceive"}, {SYS_mq_timedsend, "mq_timedsend"},
    {SYS_io_getevents, "io_getevents"},
};

/* Name such a call, once. */
static void name_unbent(long number)
{
    static unsigned char said[sizeof unbent / sizeof *unbent];
    unsigned turn;

    for (turn = 0; turn < sizeof said; turn++)
        if (unbent[turn].number == number && !said[turn]) {
            said[turn] = 1;
            card_say("the program calls %s by its number: that waits in real time, and chip time stands"
                     " still meanwhile; the C library's function of that name follows chip time",
                     unbent[turn].name);
        }
}

/* Without its page of functions that read the clocks, a search for it makes a system call. */
PUBLIC unsigned long getauxval(unsigned long kind)
{
    REAL(getauxval);
    if (kind == AT_SYSINFO_EHDR && card.virtual_time) {
        errno = ENOENT;
        return 0;
    }
    return real(kind);
}

#undef syscall

PUBLIC long syscall(long number, ...)
{
    long a[6];
    va_list rest;
    int turn;

    va_start(rest, number);
    for (turn = 0; turn < 6; turn++)
        a[turn] = va_arg(rest, long);
    va_end(rest);
    if (card.present && number == SYS_futex && clock_waits()) {
        int what = (int)a[1] & FUTEX_CMD_MASK;
        const uint32_t *word = (const uint32_t *)a[0];

        if (what == FUTEX_WAIT || what == FUTEX_WAIT_BITSET)
            return wait_at(word, (uint32_t)a[2], (int)a[1], (const struct timespec *)a[3]);
        if (what == FUTEX_WAKE || what == FUTEX_WAKE_BITSET || what == FUTEX_REQUEUE
            || what == FUTEX_CMP_REQUEUE || what == FUTEX_WAKE_OP) {
            long done = tell_at(word, what == FUTEX_WAKE || what == FUTEX_WAKE_BITSET
                                          ? (unsigned)a[2] : UINT_MAX);
            long more = sys_call(number, a[0], a[1], a[2], a[3], a[4], a[5]);

            if (what == FUTEX_WAKE_OP)
                done += tell_at((const uint32_t *)a[4], UINT_MAX);
            return more < 0 ? more : done + more;
        }
    }
    if (card.present)
        switch (number) {
        case SYS_clock_gettime: return clock_gettime((clockid_t)a[0], (struct timespec *)a[1]);
        case SYS_gettimeofday: return gettimeofday((struct timeval *)a[0], (void *)a[1]);
        case SYS_nanosleep:
            return nanosleep((const struct timespec *)a[0], (struct timespec *)a[1]);
        case SYS_clock_nanosleep: {
            int error = clock_nanosleep((clockid_t)a[0], (int)a[1], (const struct timespec *)a[2],
                                        (struct timespec *)a[3]);

            if (error != 0)
                errno = error;
            return error == 0 ? 0 : -1;
        }
        case SYS_poll: return poll((struct pollfd *)a[0], (nfds_t)a[1], (int)a[2]);
        case SYS_rt_sigprocmask:
            return pthread_sigmask((int)a[0], (const sigset_t *)a[1], (sigset_t *)a[2]) == 0 ? 0 : -1;
        case SYS_read: return read((int)a[0], (void *)a[1], (size_t)a[2]);
        case SYS_write: return write((int)a[0], (const void *)a[1], (size_t)a[2]);
        case SYS_sched_yield: return sched_yield();
#ifdef SYS_pause
        case SYS_pause: return pause();
#endif
#ifdef SYS_time
        case SYS_time: return time((time_t *)a[0]);
#endif
#ifdef SYS_io_uring_setup
        case SYS_io_uring_setup:
            if (!card.virtual_time)
                break;
            card_say("io_uring is refused where time is virtual: its waits are the kernel's own");
            errno = ENOSYS;
            return -1;
#endif
        default:
            if (clock_follows())
                name_unbent(number);
            break;
        }
    return sys_call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
