/* signals.c - handlers of the program, and its waits for signals. License: Apache-2.0.
 *
 * The program's handlers are called by one of ours. What comes while a thread is in this library is
 * kept until it leaves or waits, so no mask has to be changed on the way in and out; and where
 * threads take turns a handler runs when its thread has the turn.
 */
#define _GNU_SOURCE
#include "signals.h"

#include "card.h"
#include "clock.h"
#include "spin.h"
#include "sys.h"
#include "trap.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/signalfd.h>

#define SIGNALS 65

static struct sigaction actions[SIGNALS]; /* what the program has asked for */
static unsigned char ours[SIGNALS];       /* where a handler of ours stands for it */
static volatile int last_words;
static volatile unsigned sent; /* signals of ours to this process */
static const char pending; /* what those wait on who wait for a signal */

int signals_real(int number, const struct sigaction *action, struct sigaction *before)
{
    REAL(sigaction);
    return real(number, action, before);
}

static int has_handler(const struct sigaction *action)
{
    return action->sa_flags & SA_SIGINFO
           || (action->sa_handler != SIG_DFL && action->sa_handler != SIG_IGN);
}

/* --- delivery --------------------------------------------------------------------------------- */

static void call(int number, siginfo_t *info, void *context)
{
    struct sigaction action = actions[number];

    if (action.sa_flags & (int)SA_RESETHAND) {
        struct sigaction plain;

        memset(&plain, 0, sizeof plain);
        plain.sa_handler = SIG_DFL;
        sigaction(number, &plain, NULL);
    }
    if (action.sa_flags & SA_SIGINFO)
        action.sa_sigaction(number, info, context);
    else if (has_handler(&action))
        action.sa_handler(number);
}

static void keep(struct guest *guest, const siginfo_t *info)
{
    unsigned turn;

    while (__atomic_exchange_n(&guest->keeping, 1, __ATOMIC_ACQUIRE))
        syscall(SYS_sched_yield);
    for (turn = 0; turn < guest->kept && info->si_signo < 32; turn++)
        if (guest->signals[turn].si_signo == info->si_signo)
            break; /* it is on its way already */
    if ((turn >= guest->kept || info->si_signo >= 32) && guest->kept < MOST_KEPT)
        guest->signals[guest->kept++] = *info;
    __atomic_store_n(&guest->keeping, 0, __ATOMIC_RELEASE);
}

static void on_signal(int number, siginfo_t *info, void *context)
{
    struct guest *self = turns_self();
    int saved = errno;

    if (self != NULL && self->inside > 0) {
        keep(self, info);
    } else {
        turns_come_back();
        call(number, info, context);
    }
    errno = saved;
}

enum after signals_run(struct guest *self)
{
    enum after after = GO_ON;

    while (self->kept > 0) {
        siginfo_t info = self->signals[0];
        struct sigaction action = actions[info.si_signo];
        sigset_t mask = action.sa_mask, before;
        ucontext_t context;
        int saved = errno;

        memmove(self->signals, self->signals + 1, --self->kept * sizeof info);
        if (!has_handler(&action))
            continue;
        if (!(action.sa_flags & SA_NODEFER))
            sigaddset(&mask, info.si_signo);
        sigdelset(&mask, SIGSEGV);
        memset(&context, 0, sizeof context);
        syscall(SYS_rt_sigprocmask, SIG_BLOCK, &mask, &before, 8);
        context.uc_sigmask = before;
        call(info.si_signo, &info, &context);
        sys_restore(&before);
        if (!(action.sa_flags & (int)SA_RESTART))
            after = FAIL;
        else if (after == GO_ON)
            after = RESTART;
        errno = saved;
    }
    return after;
}

/* --- sending ---------------------------------------------------------------------------------- */

unsigned signals_sent(void)
{
    return sent;
}

static int blocks(const struct guest *guest, int number)
{
    unsigned long long mask = 0;
    char path[48], text[2048], *line;
    ssize_t size;
    sigset_t own;
    int fd;

    if (guest->trapped != NULL)
        return sigismember(guest->trapped, number) == 1;
    if (guest == turns_self()) {
        syscall(SYS_rt_sigprocmask, SIG_BLOCK, NULL, &own, 8);
        return sigismember(&own, number) == 1;
    }
    snprintf(path, sizeof path, "/proc/self/task/%d/status", (int)guest->tid);
    fd = sys_open(path, O_RDONLY | O_CLOEXEC);
    size = fd < 0 ? 0 : sys_read(fd, text, sizeof text - 1);
    if (fd >= 0)
        sys_close(fd);
    text[size > 0 ? size : 0] = '\0';
    line = strstr(text, "SigBlk:");
    if (line != NULL)
        mask = strtoull(line + 7, NULL, 16);
    return fd < 0 || (mask >> (number - 1) & 1);
}

void signals_send_to(struct guest *guest, int number, int code, union sigval value)
{
    siginfo_t info;

    sent++;
    memset(&info, 0, sizeof info);
    info.si_signo = number;
    info.si_code = code;
    info.si_value = value;
    if (guest == turns_self() || guest->trapped != NULL)
        syscall(SYS_rt_tgsigqueueinfo, getpid(), guest->tid, number, &info);
    else
        keep(guest, &info); /* it does not run: it finds it when it has the turn */
}

void signals_send(int number, int code, union sigval value)
{
    struct guest *guest;
    siginfo_t info;

    if (has_handler(&actions[number]))
        for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
            if (guest->tid != 0 && !blocks(guest, number)) {
                signals_send_to(guest, number, code, value);
                return;
            }
    sent++;
    memset(&info, 0, sizeof info);
    info.si_signo = number;
    info.si_code = code;
    info.si_value = value;
    syscall(SYS_rt_sigqueueinfo, getpid(), number, &info);
    turns_tell(&pending, UINT_MAX);
}

/* To another thread: there at once, whatever the system's scheduler thinks of it. */
PUBLIC int pthread_kill(pthread_t thread, int number)
{
    struct guest *guest;
    union sigval none = {0};
    REAL(pthread_kill);

    if (!turns_on() || number <= 0 || number >= SIGNALS || !has_handler(&actions[number]))
        return real(thread, number);
    turns_enter();
    guest = turns_find(thread);
    if (guest == NULL || guest->state == OUTSIDE || blocks(guest, number))
        real(thread, number);
    else
        signals_send_to(guest, number, SI_TKILL, none);
    turns_tell(&pending, UINT_MAX);
    turns_leave();
    return 0;
}

static int told(int result)
{
    if (turns_on()) {
        turns_enter();
        turns_tell(&pending, UINT_MAX);
        turns_leave();
    }
    return result;
}

PUBLIC int kill(pid_t process, int number)
{
    union sigval none = {0};
    REAL(kill);

    if (turns_many() && process == getpid() && number > 0 && number < SIGNALS
        && has_handler(&actions[number])) {
        turns_enter();
        signals_send(number, SI_USER, none);
        turns_leave();
        return 0;
    }
    return told(real(process, number));
}

PUBLIC int raise(int number)
{
    REAL(raise);
    return told(real(number));
}

PUBLIC int sigqueue(pid_t process, int number, const union sigval value)
{
    REAL(sigqueue);
    return told(real(process, number, value));
}

/* --- what is done at a signal ----------------------------------------------------------------- */

static int ends_by_default(int number)
{
    switch (number) {
    case SIGKILL: case SIGSTOP: case SIGTSTP: case SIGTTIN: case SIGTTOU: case SIGCHLD:
    case SIGCONT: case SIGURG: case SIGWINCH: case SIGSEGV:
    case 32: case 33: /* the C library's own */
    case SPIN_SIGNAL:
        return 0;
    default:
        return number > 0 && number < SIGNALS;
    }
}

static void on_end(int number, siginfo_t *info, void *data)
{
    int by_instruction = info->si_code > 0 && info->si_code != SI_KERNEL
                         && (number == SIGFPE || number == SIGILL || number == SIGBUS);
    struct sigaction action;

    (void)data;
    card_send_last();
    memset(&action, 0, sizeof action);
    action.sa_handler = SIG_DFL;
    signals_real(number, &action, NULL);
    if (!by_instruction) /* else it comes again by itself, at the right place */
        syscall(SYS_tgkill, getpid(), syscall(SYS_gettid), number);
}

/* Put a handler of ours in place; `flags` and `mask` as the program wants them. */
static int put(int number, void (*handler)(int, siginfo_t *, void *), int flags, const sigset_t *mask)
{
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_sigaction = handler;
    action.sa_flags = (flags & ~(int)SA_RESETHAND) | SA_SIGINFO;
    if (mask != NULL)
        action.sa_mask = *mask;
    else
        sigfillset(&action.sa_mask);
    sigdelset(&action.sa_mask, SIGSEGV);
    ours[number] = 1;
    return signals_real(number, &action, NULL);
}

void signals_last_words(void)
{
    int number;

    last_words = 1;
    for (number = 1; number < SIGNALS; number++) {
        struct sigaction now;

        if (ends_by_default(number) && !ours[number] && signals_real(number, NULL, &now) == 0
            && !has_handler(&now) && now.sa_handler == SIG_DFL)
            put(number, on_end, SA_ONSTACK | SA_RESTART, NULL);
    }
}

/* Trapped instructions need the signal even where the program has none blocked but this. */
static const sigset_t *without(const sigset_t *set, sigset_t *copy)
{
    if (set == NULL || !card.present)
        return set;
    *copy = *set;
    sigdelset(copy, SIGSEGV);
    sigdelset(copy, SPIN_SIGNAL);
    return copy;
}

PUBLIC int sigaction(int number, const struct sigaction *action, struct sigaction *before)
{
    struct sigaction old;
    int result;

    if (!card.present || number <= 0 || number >= SIGNALS)
        return signals_real(number, action, before);
    if (number == SIGSEGV)
        return trap_action(action, before);
    if (ours[number])
        old = actions[number];
    else if (signals_real(number, NULL, &old) < 0)
        return -1;
    if (action != NULL) {
        struct sigaction wanted = *action;

        if (has_handler(&wanted)) {
            spin_watch();
            actions[number] = wanted;
            result = put(number, on_signal, wanted.sa_flags, &wanted.sa_mask);
        } else if (last_words && ends_by_default(number) && wanted.sa_handler == SIG_DFL) {
            actions[number] = wanted;
            result = put(number, on_end, SA_ONSTACK | SA_RESTART, NULL);
        } else {
            result = signals_real(number, &wanted, NULL);
            actions[number] = wanted;
            ours[number] = 0;
        }
        if (result < 0)
            return result;
    }
    if (before != NULL)
        *before = old;
    return 0;
}

PUBLIC sighandler_t signal(int number, sighandler_t handler)
{
    struct sigaction action, before;

    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART;
    return sigaction(number, &action, &before) < 0 ? SIG_ERR : before.sa_handler;
}

PUBLIC sighandler_t bsd_signal(int number, sighandler_t handler);
PUBLIC sighandler_t bsd_signal(int number, sighandler_t handler)
{
    return signal(number, handler);
}

PUBLIC sighandler_t __sysv_signal(int number, sighandler_t handler)
{
    struct sigaction action, before;

    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = (int)SA_RESETHAND | SA_NODEFER;
    return sigaction(number, &action, &before) < 0 ? SIG_ERR : before.sa_handler;
}

PUBLIC sighandler_t sysv_signal(int number, sighandler_t handler)
{
    return __sysv_signal(number, handler);
}

PUBLIC int siginterrupt(int number, int interrupts)
{
    struct sigaction action;

    if (sigaction(number, NULL, &action) < 0)
        return -1;
    action.sa_flags = interrupts ? action.sa_flags & ~(int)SA_RESTART : action.sa_flags | (int)SA_RESTART;
    return sigaction(number, &action, NULL);
}

/* --- masks ------------------------------------------------------------------------------------ */

static int change_mask(int how, const sigset_t *set, sigset_t *before)
{
    sigset_t copy;
    REAL(pthread_sigmask);

    return real(how, how == SIG_UNBLOCK ? set : without(set, &copy), before);
}

PUBLIC int sigprocmask(int how, const sigset_t *set, sigset_t *before)
{
    int error = change_mask(how, set, before);

    if (error == 0)
        return 0;
    errno = error;
    return -1;
}

PUBLIC int pthread_sigmask(int how, const sigset_t *set, sigset_t *before)
{
    return change_mask(how, set, before);
}

/* --- waiting for a signal --------------------------------------------------------------------- */

static int ours_to_wait(void)
{
    return turns_many() || clock_follows();
}

enum ending signals_wait(const sigset_t *mask, struct wait *wait, enum after *after)
{
    sigset_t before;
    enum ending ending;

    if (mask != NULL)
        change_mask(SIG_SETMASK, mask, &before);
    ending = turns_wait(wait);
    *after = ending == INTERRUPTED ? turns_interrupt() : GO_ON;
    if (mask != NULL)
        change_mask(SIG_SETMASK, &before, NULL);
    return ending;
}

PUBLIC int sigsuspend(const sigset_t *mask)
{
    struct wait wait = {.until = FOR_EVER};
    enum after after = GO_ON;
    sigset_t copy = *mask;
    REAL(sigsuspend);

    if (card.present)
        sigdelset(&copy, SIGSEGV);
    if (!ours_to_wait())
        return real(&copy);
    pthread_testcancel();
    turns_enter();
    while (after == GO_ON)
        signals_wait(&copy, &wait, &after);
    turns_leave();
    errno = EINTR;
    return -1;
}

PUBLIC int pause(void)
{
    sigset_t mask;

    sigprocmask(SIG_BLOCK, NULL, &mask);
    return sigsuspend(&mask);
}

static int wait_for(const sigset_t *set, siginfo_t *info, int64_t longest)
{
    struct timespec now = {0, 0};
    struct wait wait = {.object = &pending, .shared = BY_SIGNAL};
    int number;

    pthread_testcancel();
    turns_enter();
    wait.until = longest == FOR_EVER ? FOR_EVER : turns_now() + longest;
    for (;;) {
        enum ending ending;

        number = (int)syscall(SYS_rt_sigtimedwait, set, info, &now, 8);
        if (number >= 0 || errno != EAGAIN)
            break;
        ending = turns_wait(&wait);
        if (ending == LATE || (ending == INTERRUPTED && turns_interrupt() != GO_ON)) {
            errno = ending == LATE ? EAGAIN : EINTR;
            break;
        }
    }
    turns_leave();
    return number;
}

PUBLIC int sigtimedwait(const sigset_t *set, siginfo_t *info, const struct timespec *longest)
{
    REAL(sigtimedwait);
    if (!ours_to_wait())
        return real(set, info, longest);
    return wait_for(set, info, longest == NULL ? FOR_EVER : ns_of(longest));
}

PUBLIC int sigwaitinfo(const sigset_t *set, siginfo_t *info)
{
    return sigtimedwait(set, info, NULL);
}

PUBLIC int sigwait(const sigset_t *set, int *number)
{
    siginfo_t info;
    int found;

    do
        found = sigwaitinfo(set, &info);
    while (found < 0 && errno == EINTR);
    if (found < 0)
        return errno;
    *number = found;
    return 0;
}
