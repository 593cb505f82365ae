/* queues.c - calls that wait for other processes, or for messages: sockets, queues, children.
 * License: Apache-2.0.
 *
 * What has a descriptor is polled for before the call; what can be tried is tried; a child that has not
 * ended is waited for outside, so that other threads have their turns meanwhile.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "sys.h"
#include "trap.h"
#include "turns.h"

#include <errno.h>
#include <mqueue.h>
#include <sched.h>
#include <sys/msg.h>
#include <sys/sem.h>
#include <sys/socket.h>
#include <sys/wait.h>

/* --- sockets ---------------------------------------------------------------------------------- */

#define AWAITED(type, name, events, skips, parameters, arguments)                                  \
    PUBLIC type name parameters                                                                    \
    {                                                                                              \
        REAL(name);                                                                                \
        if (!(skips) && clock_await(fd, events) < 0)                                               \
            return -1;                                                                             \
        return real arguments;                                                                     \
    }

AWAITED(ssize_t, recv, POLLIN, flags & MSG_DONTWAIT, (int fd, void *data, size_t size, int flags),
        (fd, data, size, flags))
AWAITED(ssize_t, recvfrom, POLLIN, flags & MSG_DONTWAIT,
        (int fd, void *restrict data, size_t size, int flags, struct sockaddr *restrict from,
         socklen_t *restrict room),
        (fd, data, size, flags, from, room))
AWAITED(ssize_t, recvmsg, POLLIN, flags & MSG_DONTWAIT, (int fd, struct msghdr *message, int flags),
        (fd, message, flags))
AWAITED(ssize_t, send, POLLOUT, flags & MSG_DONTWAIT,
        (int fd, const void *data, size_t size, int flags), (fd, data, size, flags))
AWAITED(ssize_t, sendto, POLLOUT, flags & MSG_DONTWAIT,
        (int fd, const void *data, size_t size, int flags, const struct sockaddr *to,
         socklen_t room),
        (fd, data, size, flags, to, room))
AWAITED(ssize_t, sendmsg, POLLOUT, flags & MSG_DONTWAIT,
        (int fd, const struct msghdr *message, int flags), (fd, message, flags))
AWAITED(int, accept, POLLIN, 0, (int fd, struct sockaddr *restrict from, socklen_t *restrict room),
        (fd, from, room))
AWAITED(int, accept4, POLLIN, 0,
        (int fd, struct sockaddr *restrict from, socklen_t *restrict room, int flags),
        (fd, from, room, flags))

/* --- children --------------------------------------------------------------------------------- */

/* A call that would not wait is made here, where no other thread has its turn meanwhile. */
static pid_t await_child(pid_t child, int *status, int options, struct rusage *usage)
{
    pid_t result;
    int error;
    REAL(wait4);

    result = real(child, status, options | WNOHANG, usage);
    if (result != 0)
        return result;
    if (options & WNOHANG) {
        sched_yield();
        return 0;
    }
    turns_go_out();
    result = real(child, status, options, usage);
    error = errno;
    turns_come_back();
    errno = error;
    return result;
}

PUBLIC pid_t wait(int *status)
{
    return await_child(-1, status, 0, NULL);
}

PUBLIC pid_t waitpid(pid_t child, int *status, int options)
{
    return await_child(child, status, options, NULL);
}

PUBLIC pid_t wait3(int *status, int options, struct rusage *usage)
{
    return await_child(-1, status, options, usage);
}

PUBLIC pid_t wait4(pid_t child, int *status, int options, struct rusage *usage)
{
    return await_child(child, status, options, usage);
}

PUBLIC int waitid(idtype_t type, id_t id, siginfo_t *info, int options)
{
    siginfo_t found = {.si_pid = 0};
    int result, error;
    REAL(waitid);

    result = real(type, id, &found, options | WNOHANG);
    if (result == 0 && found.si_pid == 0 && options & WNOHANG) {
        sched_yield();
    } else if (result == 0 && found.si_pid == 0) {
        turns_go_out();
        result = real(type, id, &found, options);
        error = errno;
        turns_come_back();
        errno = error;
    }
    if (result == 0 && info != NULL)
        *info = found;
    return result;
}

/* --- message queues --------------------------------------------------------------------------- */

/* Wait for a queue until an instant of CLOCK_REALTIME, or for ever: 0, or -1. */
static int await_queue(mqd_t queue, short events, const struct timespec *when)
{
    struct pollfd set = {(int)queue, events, 0};
    struct mq_attr attributes;
    int64_t left;
    int found;

    if (!clock_waits() || (mq_getattr(queue, &attributes) == 0 && attributes.mq_flags & O_NONBLOCK))
        return 0;
    if (when != NULL && (when->tv_nsec < 0 || when->tv_nsec >= NS)) {
        errno = EINVAL;
        return -1;
    }
    if (when == NULL)
        return clock_await((int)queue, events);
    left = ns_of(when) - clock_compare(CLOCK_REALTIME);
    found = clock_poll(&set, 1, left > 0 ? left : 0, NULL);
    if (found == 0)
        errno = ETIMEDOUT;
    return found > 0 ? 0 : -1;
}

PUBLIC ssize_t mq_timedreceive(mqd_t queue, char *restrict data, size_t size,
                               unsigned *restrict priority, const struct timespec *restrict when)
{
    REAL(mq_timedreceive);
    if (await_queue(queue, POLLIN, when) < 0)
        return -1;
    return real(queue, data, size, priority, when);
}

PUBLIC ssize_t mq_receive(mqd_t queue, char *data, size_t size, unsigned *priority)
{
    REAL(mq_receive);
    return await_queue(queue, POLLIN, NULL) < 0 ? -1 : real(queue, data, size, priority);
}

PUBLIC int mq_timedsend(mqd_t queue, const char *data, size_t size, unsigned priority,
                        const struct timespec *when)
{
    REAL(mq_timedsend);
    if (await_queue(queue, POLLOUT, when) < 0)
        return -1;
    return real(queue, data, size, priority, when);
}

PUBLIC int mq_send(mqd_t queue, const char *data, size_t size, unsigned priority)
{
    REAL(mq_send);
    return await_queue(queue, POLLOUT, NULL) < 0 ? -1 : real(queue, data, size, priority);
}

/* --- System V: tried again and again ----------------------------------------------------------- */

/* After a try in vain: 1 to try again, or 0 and errno. */
static int once_more(struct wait *wait, int *late)
{
    enum ending ending;

    if (*late) {
        errno = EAGAIN;
        return 0;
    }
    ending = turns_wait(wait);
    *late = ending == LATE;
    if (ending != INTERRUPTED || turns_interrupt() == GO_ON)
        return 1;
    errno = EINTR;
    return 0;
}

PUBLIC int semtimedop(int set, struct sembuf *operations, size_t count,
                      const struct timespec *longest)
{
    static const char changed;
    struct sembuf tried[32];
    struct wait wait = {.object = &changed, .shared = 1, .until = FOR_EVER};
    size_t turn;
    int result, late = 0, waits = 1;
    REAL(semtimedop);

    if (!clock_waits() || count > 32)
        return real(set, operations, count, longest);
    for (turn = 0; turn < count; turn++) {
        waits &= !(operations[turn].sem_flg & IPC_NOWAIT);
        tried[turn] = operations[turn];
        tried[turn].sem_flg |= IPC_NOWAIT;
    }
    turns_enter();
    if (longest != NULL)
        wait.until = turns_now() + ns_of(longest);
    do
        result = real(set, tried, count, NULL);
    while (result < 0 && errno == EAGAIN && waits && once_more(&wait, &late));
    if (result == 0)
        turns_tell(&changed, MOST_GUESTS);
    turns_leave();
    return result;
}

PUBLIC int semop(int set, struct sembuf *operations, size_t count)
{
    return semtimedop(set, operations, count, NULL);
}

PUBLIC ssize_t msgrcv(int queue, void *data, size_t size, long type, int flags)
{
    struct wait wait = {.shared = 1, .until = FOR_EVER};
    ssize_t result;
    int late = 0;
    REAL(msgrcv);

    if (!clock_waits() || flags & IPC_NOWAIT)
        return real(queue, data, size, type, flags);
    turns_enter();
    do
        result = real(queue, data, size, type, flags | IPC_NOWAIT);
    while (result < 0 && errno == ENOMSG && once_more(&wait, &late));
    turns_leave();
    return result;
}
