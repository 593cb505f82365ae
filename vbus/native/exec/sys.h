/* sys.h - system calls and functions of the C library that pass by those this library puts in their
 * place. License: Apache-2.0.
 */
#ifndef VBUS_EXEC_SYS_H
#define VBUS_EXEC_SYS_H

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* The next definition of a function behind ours, as `real`. */
#define REAL(name)                                                                                 \
    static __typeof__(&name) real;                                                                 \
    if (real == NULL)                                                                              \
        *(void **)&real = dlsym(RTLD_NEXT, #name)

/* The C library's syscall; ours is in calls.c. */
extern long (*sys_call)(long number, ...);
#define syscall(...) sys_call(__VA_ARGS__)

static inline int sys_open(const char *path, int flags)
{
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0);
}

static inline int sys_close(int fd)
{
    return (int)syscall(SYS_close, fd);
}

static inline ssize_t sys_read(int fd, void *data, size_t size)
{
    return syscall(SYS_read, fd, data, size);
}

static inline ssize_t sys_write(int fd, const void *data, size_t size)
{
    return syscall(SYS_write, fd, data, size);
}

static inline int sys_poll(struct pollfd *set, nfds_t count, int timeout_ms)
{
    return (int)syscall(SYS_poll, set, count, timeout_ms);
}

/* The real clocks, once sys_find_clock has been called without a system call (where the kernel gives
 * its vDSO page). */
void sys_find_clock(void);
int sys_clock_gettime(clockid_t clock, struct timespec *when);

/* Block every signal, and put the old mask back. */
static inline void sys_block(sigset_t *before)
{
    sigset_t all;

    memset(&all, 0xFF, sizeof all);
    syscall(SYS_rt_sigprocmask, SIG_SETMASK, &all, before, 8);
}

static inline void sys_restore(const sigset_t *before)
{
    syscall(SYS_rt_sigprocmask, SIG_SETMASK, before, NULL, 8);
}

#endif
