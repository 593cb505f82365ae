/* threads.c - threads and what they wait for of each other, where they take turns (turns.c).
 * License: Apache-2.0.
 *
 * Mutexes and semaphores stay the C library's: what cannot be had at once is tried again when a
 * thread has let go of it. Conditions and barriers are places to wait at, not the C library's.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "spin.h"
#include "sys.h"
#include "trap.h"
#include "turns.h"

#include <errno.h>
#include <limits.h>
#include <semaphore.h>
#include <threads.h>

#define SHARED_MUTEX 128  /* bits of the C library's: PTHREAD_PROCESS_SHARED, */
#define SHARED_CONDITION 1
#define CONDITION_CLOCK 2 /* pthread_condattr_setclock's choice, */
#define ONCE_DONE 2       /* and what pthread_once keeps */

static int valid(const struct timespec *when)
{
    return when->tv_nsec >= 0 && when->tv_nsec < (long)NS;
}

/* An instant of a clock by which turns_now tells it. */
static int64_t instant(clockid_t clock, const struct timespec *when)
{
    if (when == NULL)
        return FOR_EVER;
    return ns_of(when) - clock_compare(clock) + turns_now();
}

/* --- what is tried until it succeeds ----------------------------------------------------------- */

/* 0 or an error number; EBUSY: not yet. */
typedef int attempt(void *what);

static int try_until(attempt *attempt, void *what, int shared, clockid_t clock,
                     const struct timespec *when)
{
    struct wait wait = {.object = what, .shared = shared, .steady = 1};
    int result;

    turns_enter();
    wait.until = FOR_EVER;
    result = attempt(what);
    if (result == EBUSY && when != NULL && !valid(when))
        result = EINVAL;
    else if (result == EBUSY)
        wait.until = instant(clock, when);
    while (result == EBUSY) {
        enum ending ending = turns_wait(&wait);

        if (ending == INTERRUPTED)
            turns_interrupt();
        result = attempt(what);
        if (result == EBUSY && ending == LATE)
            result = ETIMEDOUT;
    }
    turns_leave();
    return result;
}

/* Let go of `what`, then let those try who wait for it. */
#define LET_GO(what, result)                                                                       \
    do {                                                                                           \
        if (turns_many() && (result) == 0) {                                                       \
            turns_enter();                                                                         \
            turns_tell(what, UINT_MAX);                                                            \
            turns_leave();                                                                         \
        }                                                                                          \
    } while (0)

/* --- mutexes ---------------------------------------------------------------------------------- */

static int try_mutex(void *what)
{
    pthread_mutex_t *mutex = what;
    int result = pthread_mutex_trylock(mutex);
    static int (*real)(pthread_mutex_t *);

    if (result != EBUSY || (mutex->__data.__kind & 3) != PTHREAD_MUTEX_ERRORCHECK
        || mutex->__data.__owner != syscall(SYS_gettid))
        return result;
    if (real == NULL)
        *(void **)&real = dlsym(RTLD_NEXT, "pthread_mutex_lock");
    return real(mutex); /* the caller has it: an error at once */
}

static int lock_until(pthread_mutex_t *mutex, clockid_t clock, const struct timespec *when)
{
    return try_until(try_mutex, mutex, mutex->__data.__kind & SHARED_MUTEX, clock, when);
}

PUBLIC int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    REAL(pthread_mutex_lock);
    return turns_many() ? lock_until(mutex, 0, NULL) : real(mutex);
}

PUBLIC int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *when)
{
    REAL(pthread_mutex_timedlock);
    return turns_on() ? lock_until(mutex, CLOCK_REALTIME, when) : real(mutex, when);
}

PUBLIC int pthread_mutex_clocklock(pthread_mutex_t *mutex, clockid_t clock,
                                   const struct timespec *when)
{
    REAL(pthread_mutex_clocklock);
    return turns_on() ? lock_until(mutex, clock, when) : real(mutex, clock, when);
}

PUBLIC int pthread_mutex_unlock(pthread_mutex_t *mutex)
{
    int result;
    REAL(pthread_mutex_unlock);

    result = real(mutex);
    LET_GO(mutex, result);
    return result;
}

static int try_spin(void *what)
{
    return pthread_spin_trylock(what);
}

PUBLIC int pthread_spin_lock(pthread_spinlock_t *lock)
{
    REAL(pthread_spin_lock);
    return turns_many() ? try_until(try_spin, (void *)lock, 0, 0, NULL) : real(lock);
}

PUBLIC int pthread_spin_unlock(pthread_spinlock_t *lock)
{
    int result;
    REAL(pthread_spin_unlock);

    result = real(lock);
    LET_GO((void *)lock, result);
    return result;
}

/* --- locks for readers and writers ------------------------------------------------------------ */

static int try_reading(void *what)
{
    return pthread_rwlock_tryrdlock(what);
}

static int try_writing(void *what)
{
    return pthread_rwlock_trywrlock(what);
}

#define RWLOCK(name, attempt)                                                                      \
    PUBLIC int name(pthread_rwlock_t *lock)                                                        \
    {                                                                                              \
        REAL(name);                                                                                \
        if (!turns_many())                                                                         \
            return real(lock);                                                                     \
        return try_until(attempt, lock, lock->__data.__shared, 0, NULL);                           \
    }
#define TIMED_RWLOCK(name, attempt)                                                                \
    PUBLIC int name(pthread_rwlock_t *lock, const struct timespec *when)                           \
    {                                                                                              \
        REAL(name);                                                                                \
        if (!turns_on())                                                                           \
            return real(lock, when);                                                               \
        return try_until(attempt, lock, lock->__data.__shared, CLOCK_REALTIME, when);              \
    }
#define CLOCK_RWLOCK(name, attempt)                                                                \
    PUBLIC int name(pthread_rwlock_t *lock, clockid_t clock, const struct timespec *when)          \
    {                                                                                              \
        REAL(name);                                                                                \
        if (!turns_on())                                                                           \
            return real(lock, clock, when);                                                        \
        return try_until(attempt, lock, lock->__data.__shared, clock, when);                       \
    }

RWLOCK(pthread_rwlock_rdlock, try_reading)
RWLOCK(pthread_rwlock_wrlock, try_writing)
TIMED_RWLOCK(pthread_rwlock_timedrdlock, try_reading)
TIMED_RWLOCK(pthread_rwlock_timedwrlock, try_writing)
CLOCK_RWLOCK(pthread_rwlock_clockrdlock, try_reading)
CLOCK_RWLOCK(pthread_rwlock_clockwrlock, try_writing)

PUBLIC int pthread_rwlock_unlock(pthread_rwlock_t *lock)
{
    int result;
    REAL(pthread_rwlock_unlock);

    result = real(lock);
    LET_GO(lock, result);
    return result;
}

/* --- semaphores ------------------------------------------------------------------------------- */

static int try_semaphore(void *what)
{
    return sem_trywait(what) == 0 ? 0 : errno == EAGAIN ? EBUSY : errno;
}

/* Whether other processes have it: the word behind the value, in the C library's structure. */
static int is_shared(sem_t *semaphore)
{
    return ((const int *)(const void *)semaphore)[sizeof(void *) == 8 ? 2 : 1] != 0;
}

static int take_until(sem_t *semaphore, clockid_t clock, const struct timespec *when)
{
    struct wait wait = {.object = semaphore, .shared = is_shared(semaphore), .until = FOR_EVER};
    int result;

    pthread_testcancel();
    turns_enter();
    result = try_semaphore(semaphore);
    if (result == EBUSY && when != NULL && !valid(when))
        result = EINVAL;
    else if (result == EBUSY)
        wait.until = instant(clock, when);
    while (result == EBUSY) {
        enum ending ending = turns_wait(&wait);
        int again = ending != INTERRUPTED || turns_interrupt() != FAIL;

        result = try_semaphore(semaphore);
        if (result == EBUSY)
            result = ending == LATE ? ETIMEDOUT : again ? EBUSY : EINTR;
    }
    turns_leave();
    if (result == 0)
        return 0;
    errno = result;
    return -1;
}

PUBLIC int sem_wait(sem_t *semaphore)
{
    REAL(sem_wait);
    return turns_many() || clock_follows() ? take_until(semaphore, 0, NULL) : real(semaphore);
}

PUBLIC int sem_timedwait(sem_t *semaphore, const struct timespec *when)
{
    REAL(sem_timedwait);
    return turns_on() ? take_until(semaphore, CLOCK_REALTIME, when) : real(semaphore, when);
}

PUBLIC int sem_clockwait(sem_t *semaphore, clockid_t clock, const struct timespec *when)
{
    REAL(sem_clockwait);
    return turns_on() ? take_until(semaphore, clock, when) : real(semaphore, clock, when);
}

PUBLIC int sem_post(sem_t *semaphore)
{
    int result;
    REAL(sem_post);

    result = real(semaphore);
    LET_GO(semaphore, result);
    return result;
}

/* --- conditions ------------------------------------------------------------------------------- */

static int wait_at(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t clock,
                   const struct timespec *when)
{
    struct wait wait = {.object = condition, .until = FOR_EVER};
    int result, interrupted;
    REAL(pthread_mutex_unlock);

    if (when != NULL && !valid(when))
        return EINVAL;
    pthread_testcancel();
    turns_enter();
    wait.until = instant(clock, when);
    result = real(mutex);
    if (result == 0) {
        enum ending ending;

        turns_tell(mutex, UINT_MAX);
        ending = turns_wait(&wait);
        interrupted = ending == INTERRUPTED;
        result = ending == LATE ? ETIMEDOUT : 0;
        lock_until(mutex, 0, NULL);
        if (interrupted) /* it ends early: as the standard allows, and with the mutex */
            turns_interrupt();
    }
    turns_leave();
    return result;
}

static int is_ours(const pthread_cond_t *condition)
{
    return turns_on() && !(condition->__data.__wrefs & SHARED_CONDITION);
}

PUBLIC int pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *mutex)
{
    int result;
    REAL(pthread_cond_wait);

    if (is_ours(condition))
        return wait_at(condition, mutex, 0, NULL);
    turns_go_out();
    result = real(condition, mutex);
    turns_come_back();
    return result;
}

PUBLIC int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                  const struct timespec *when)
{
    REAL(pthread_cond_timedwait);
    if (!turns_on())
        return real(condition, mutex, when);
    return wait_at(condition, mutex,
                   condition->__data.__wrefs & CONDITION_CLOCK ? CLOCK_MONOTONIC : CLOCK_REALTIME,
                   when);
}

PUBLIC int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                  clockid_t clock, const struct timespec *when)
{
    REAL(pthread_cond_clockwait);
    return turns_on() ? wait_at(condition, mutex, clock, when)
                      : real(condition, mutex, clock, when);
}

static void signal_condition(pthread_cond_t *condition, unsigned most)
{
    turns_enter();
    turns_tell(condition, most);
    turns_leave();
}

PUBLIC int pthread_cond_signal(pthread_cond_t *condition)
{
    REAL(pthread_cond_signal);
    if (turns_many())
        signal_condition(condition, 1);
    return real(condition);
}

PUBLIC int pthread_cond_broadcast(pthread_cond_t *condition)
{
    REAL(pthread_cond_broadcast);
    if (turns_many())
        signal_condition(condition, UINT_MAX);
    return real(condition);
}

/* --- barriers, and what is done once ---------------------------------------------------------- */

PUBLIC int pthread_barrier_wait(pthread_barrier_t *barrier)
{
    unsigned count = ((const unsigned *)(const void *)barrier)[2]; /* the C library keeps it there */
    struct wait wait = {.object = barrier, .until = FOR_EVER, .steady = 1};
    int result = 0;
    REAL(pthread_barrier_wait);

    if (!turns_many())
        return real(barrier);
    turns_enter();
    if (turns_waiting(barrier) + 1 >= count) {
        turns_tell(barrier, UINT_MAX);
        result = PTHREAD_BARRIER_SERIAL_THREAD;
    } else {
        while (turns_wait(&wait) != TOLD)
            turns_interrupt();
    }
    turns_leave();
    return result;
}

PUBLIC int pthread_once(pthread_once_t *once, void (*routine)(void))
{
    struct wait wait = {.object = once, .until = FOR_EVER, .steady = 1};
    int result;
    REAL(pthread_once);

    if (turns_many() && (*once & 3) == 1) { /* another thread is in it */
        turns_enter();
        while ((*once & 3) == 1)
            if (turns_wait(&wait) == INTERRUPTED)
                turns_interrupt();
        turns_leave();
    }
    result = real(once, routine);
    LET_GO(once, 0);
    return result;
}

/* --- threads ---------------------------------------------------------------------------------- */

PUBLIC int pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*routine)(void *), void *argument)
{
    struct guest *guest;
    int result, how = PTHREAD_CREATE_JOINABLE;
    REAL(pthread_create);

    if (!turns_on())
        return real(thread, attributes, routine, argument);
    spin_watch();
    turns_enter();
    guest = turns_add();
    result = EAGAIN;
    if (guest != NULL) {
        if (attributes != NULL)
            pthread_attr_getdetachstate(attributes, &how);
        guest->detached = how == PTHREAD_CREATE_DETACHED;
        guest->routine = routine;
        guest->argument = argument;
        guest->state = READY;
        result = real(thread, attributes, turns_run, guest);
        if (result != 0)
            turns_drop(guest);
        else
            turns_await_start(guest);
    }
    turns_leave();
    return result;
}

static int join_until(pthread_t thread, void **value, clockid_t clock, const struct timespec *when)
{
    struct guest *guest;
    struct wait wait = {.until = FOR_EVER};
    int result = 0;
    REAL(pthread_join);

    if (when != NULL && !valid(when))
        return EINVAL;
    pthread_testcancel();
    turns_enter();
    guest = turns_find(thread);
    if (guest == turns_self())
        result = EDEADLK;
    if (guest != NULL && result == 0) {
        wait.object = guest;
        wait.until = instant(clock, when);
        while (!guest->ended && result == 0) {
            enum ending ending = turns_wait(&wait);

            if (ending == INTERRUPTED)
                turns_interrupt();
            else if (ending == LATE)
                result = ETIMEDOUT;
        }
    }
    if (guest != NULL && result == 0) { /* it has but to leave the kernel */
        result = real(thread, value);
        if (result == 0)
            turns_drop(guest);
    }
    turns_leave();
    if (guest == NULL) {
        turns_go_out();
        result = real(thread, value);
        turns_come_back();
    }
    return result;
}

PUBLIC int pthread_join(pthread_t thread, void **value)
{
    REAL(pthread_join);
    return turns_on() ? join_until(thread, value, 0, NULL) : real(thread, value);
}

PUBLIC int pthread_timedjoin_np(pthread_t thread, void **value, const struct timespec *when)
{
    REAL(pthread_timedjoin_np);
    return turns_on() ? join_until(thread, value, CLOCK_REALTIME, when)
                      : real(thread, value, when);
}

PUBLIC int pthread_clockjoin_np(pthread_t thread, void **value, clockid_t clock,
                                const struct timespec *when)
{
    REAL(pthread_clockjoin_np);
    return turns_on() ? join_until(thread, value, clock, when) : real(thread, value, clock, when);
}

PUBLIC int pthread_tryjoin_np(pthread_t thread, void **value)
{
    struct guest *guest;
    int ended;
    REAL(pthread_tryjoin_np);

    if (!turns_on())
        return real(thread, value);
    turns_yield();
    guest = turns_find(thread);
    ended = guest == NULL || guest->ended;
    return ended ? join_until(thread, value, 0, NULL) : EBUSY;
}

PUBLIC int pthread_detach(pthread_t thread)
{
    struct guest *guest;
    REAL(pthread_detach);

    if (turns_on()) {
        turns_enter();
        guest = turns_find(thread);
        if (guest != NULL) {
            guest->detached = 1;
            if (guest->ended)
                turns_drop(guest);
        }
        turns_leave();
    }
    return real(thread);
}

PUBLIC int sched_yield(void)
{
    REAL(sched_yield);
    if (!turns_on())
        return real();
    turns_yield();
    return 0;
}

/* --- cancelling ------------------------------------------------------------------------------- */

/* To the C library every thread is one that is cancelled at certain points only: elsewhere it might
 * be in here. An access or a wait is where those end that asked for it at any time. */
PUBLIC int pthread_setcanceltype(int type, int *before)
{
    struct guest *self;
    int old, result;
    REAL(pthread_setcanceltype);

    if (!card.present || (type != PTHREAD_CANCEL_ASYNCHRONOUS && type != PTHREAD_CANCEL_DEFERRED))
        return real(type, before);
    self = turns_enter();
    old = self->asynchronous;
    self->asynchronous = type == PTHREAD_CANCEL_ASYNCHRONOUS;
    turns_leave();
    result = real(PTHREAD_CANCEL_DEFERRED, NULL);
    if (before != NULL)
        *before = old ? PTHREAD_CANCEL_ASYNCHRONOUS : PTHREAD_CANCEL_DEFERRED;
    if (type == PTHREAD_CANCEL_ASYNCHRONOUS)
        pthread_testcancel();
    return result;
}

PUBLIC int pthread_cancel(pthread_t thread)
{
    struct guest *guest;
    int result;
    REAL(pthread_cancel);

    if (!card.present)
        return real(thread);
    turns_enter();
    result = real(thread);
    guest = turns_find(thread); /* after that: one that comes here first now is told by itself */
    if (guest != NULL)
        guest->cancelled = 1;
    turns_leave();
    if (guest == turns_self() && guest->asynchronous)
        pthread_testcancel();
    return result;
}

/* --- the same by the names of C11 ------------------------------------------------------------- */

static int as_c11(int error)
{
    return error == 0           ? thrd_success
           : error == EBUSY     ? thrd_busy
           : error == ETIMEDOUT ? thrd_timedout
           : error == ENOMEM    ? thrd_nomem
                                : thrd_error;
}

PUBLIC int thrd_create(thrd_t *thread, thrd_start_t routine, void *argument)
{
    return as_c11(pthread_create(thread, NULL, (void *(*)(void *))(void *)routine, argument));
}

PUBLIC int thrd_join(thrd_t thread, int *value)
{
    void *result = NULL;
    int error = pthread_join(thread, &result);

    if (value != NULL)
        *value = (int)(intptr_t)result;
    return as_c11(error);
}

PUBLIC int thrd_detach(thrd_t thread)
{
    return as_c11(pthread_detach(thread));
}

PUBLIC void thrd_yield(void)
{
    sched_yield();
}

PUBLIC int thrd_sleep(const struct timespec *wanted, struct timespec *rest)
{
    int error = clock_nanosleep(CLOCK_REALTIME, 0, wanted, rest);

    return error == 0 ? 0 : error == EINTR ? -1 : -2;
}

PUBLIC int mtx_lock(mtx_t *mutex)
{
    return as_c11(pthread_mutex_lock((pthread_mutex_t *)mutex));
}

PUBLIC int mtx_timedlock(mtx_t *restrict mutex, const struct timespec *restrict when)
{
    return as_c11(pthread_mutex_timedlock((pthread_mutex_t *)mutex, when));
}

PUBLIC int mtx_unlock(mtx_t *mutex)
{
    return as_c11(pthread_mutex_unlock((pthread_mutex_t *)mutex));
}

PUBLIC int cnd_wait(cnd_t *condition, mtx_t *mutex)
{
    return as_c11(pthread_cond_wait((pthread_cond_t *)condition, (pthread_mutex_t *)mutex));
}

PUBLIC int cnd_timedwait(cnd_t *restrict condition, mtx_t *restrict mutex,
                         const struct timespec *restrict when)
{
    return as_c11(pthread_cond_timedwait((pthread_cond_t *)condition, (pthread_mutex_t *)mutex,
                                         when));
}

PUBLIC int cnd_signal(cnd_t *condition)
{
    return as_c11(pthread_cond_signal((pthread_cond_t *)condition));
}

PUBLIC int cnd_broadcast(cnd_t *condition)
{
    return as_c11(pthread_cond_broadcast((pthread_cond_t *)condition));
}

PUBLIC void call_once(once_flag *flag, void (*routine)(void))
{
    pthread_once((pthread_once_t *)flag, routine);
}
