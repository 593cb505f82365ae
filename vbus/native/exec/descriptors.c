/* descriptors.c - closing and copying: the session keeps its descriptor, devices are followed.
 * License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "card.h"
#include "files.h"
#include "listen.h"
#include "sys.h"
#include "trap.h"

#include <errno.h>
#include <stdarg.h>
#include <sys/resource.h>

#ifndef SYS_close_range
#define SYS_close_range 436
#endif
#define ONLY_ON_EXEC 4 /* CLOSE_RANGE_CLOEXEC */

PUBLIC int close(int fd)
{
    REAL(close);
    if (card_owns(fd) || listen_owns(fd)) { /* programs that close everything they may have inherited */
        errno = EBADF;
        return -1;
    }
    if (fd >= 0)
        files_closed((unsigned)fd, (unsigned)fd);
    return real(fd);
}

PUBLIC int close_range(unsigned first, unsigned last, int flags)
{
    int held = card_descriptor();
    long done = 0;

    if (flags & ONLY_ON_EXEC) /* the session's is so already */
        return (int)syscall(SYS_close_range, first, last, flags);
    if (held < 0 || (unsigned)held < first || (unsigned)held > last) {
        done = syscall(SYS_close_range, first, last, flags);
    } else {
        if ((unsigned)held > first)
            done = syscall(SYS_close_range, first, (unsigned)held - 1, flags);
        if (done == 0 && (unsigned)held < last)
            done = syscall(SYS_close_range, (unsigned)held + 1, last, flags);
    }
    if (done == 0)
        files_closed(first, last);
    return (int)done;
}

PUBLIC void closefrom(int first)
{
    struct rlimit limit;
    int fd = first < 0 ? 0 : first;

    if (close_range((unsigned)fd, ~0u, 0) == 0 || getrlimit(RLIMIT_NOFILE, &limit) < 0)
        return;
    for (; (rlim_t)fd < limit.rlim_cur; fd++) /* a kernel before 5.9 */
        close(fd);
}

PUBLIC int dup(int fd)
{
    REAL(dup);
    return files_copied(fd, real(fd));
}

PUBLIC int dup2(int fd, int to)
{
    REAL(dup2);
    card_step_aside(to);
    return files_copied(fd, real(fd, to));
}

PUBLIC int dup3(int fd, int to, int flags)
{
    REAL(dup3);
    card_step_aside(to);
    return files_copied(fd, real(fd, to, flags));
}

#define FCNTL(name)                                                                                \
    PUBLIC int name(int fd, int command, ...)                                                      \
    {                                                                                              \
        void *argument;                                                                            \
        va_list rest;                                                                              \
        int result;                                                                                \
        REAL(name);                                                                                \
        va_start(rest, command);                                                                   \
        argument = va_arg(rest, void *);                                                           \
        va_end(rest);                                                                              \
        result = real(fd, command, argument);                                                      \
        return command == F_DUPFD || command == F_DUPFD_CLOEXEC ? files_copied(fd, result)         \
                                                                : result;                          \
    }

FCNTL(fcntl)
FCNTL(fcntl64)
