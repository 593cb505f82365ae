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
        default: break;
        }
    return sys_call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
