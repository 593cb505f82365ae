/* Loaded before a program: who is about to wake a thread, asks for a child, or sends what it has held
 * back, has no processor for a while, as on a busy machine. In the last case SIGTERM comes then.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <linux/futex.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

static void *behind(const char *name)
{
    return dlsym(RTLD_NEXT, name);
}

/* The kernel's own sleep, not that of the library in front. */
static void stand_still(long ms)
{
    struct timespec pause = {0, ms * 1000000};
    long (*call)(long, ...);

    *(void **)&call = behind("syscall");
    call(SYS_nanosleep, &pause, NULL);
}

long syscall(long number, ...)
{
    long (*call)(long, ...), a[6];
    va_list rest;
    int turn;

    va_start(rest, number);
    for (turn = 0; turn < 6; turn++)
        a[turn] = va_arg(rest, long);
    va_end(rest);
    *(void **)&call = behind("syscall");
    if (number == SYS_sendto && a[2] > 64)
        kill(getpid(), SIGTERM);
    if ((number == SYS_sendto && a[2] > 64) || (number == SYS_futex && a[1] == FUTEX_WAKE_PRIVATE))
        stand_still(60);
    return call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

pid_t waitpid(pid_t child, int *status, int options)
{
    pid_t (*ask)(pid_t, int *, int);

    *(void **)&ask = behind("waitpid");
    stand_still(5);
    return ask(child, status, options);
}

pid_t wait4(pid_t child, int *status, int options, struct rusage *usage)
{
    pid_t (*ask)(pid_t, int *, int, struct rusage *);

    *(void **)&ask = behind("wait4");
    stand_still(5);
    return ask(child, status, options, usage);
}
