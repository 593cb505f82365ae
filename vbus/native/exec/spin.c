/* spin.c - a thread that waits by looking at memory, where time is virtual. License: Apache-2.0.
 *
 * `while (!flag);` gives nothing away: neither another thread nor an interrupt could ever set the flag.
 * So the processor time of the program ticks, and each tick looks at the thread that has the turn. If
 * all its registers are the same whenever it is at the same instruction, it does nothing but wait for
 * memory. It is named, and from then on others run and time passes until one of them has done
 * something; then it is followed round its loop once, which is how it is known that it has looked:
 * where other programs have the processors, any time may pass without an instruction of it.
 */
#define _GNU_SOURCE
#include "spin.h"

#include "card.h"
#include "clock.h"
#include "context.h"
#include "follow.h"
#include "signals.h"
#include "sys.h"
#include "trap.h"
#include "turns.h"

#include <errno.h>

#define TICK_NS 20000000  /* of processor time */
#define PLACES 24         /* instructions of such a loop */
#define NEAR 64           /* bytes within which instructions are of one loop */
#define PROOF 20          /* ticks that find it where it was */
#define WORK 50           /* ticks without a sign of life, after which it is named anyhow */
#define LOOKED 2          /* the same, of one that is known to wait and could not be followed */
#define ROUNDS 8          /* of a loop that sees something new each time, and so does more than wait */

static struct place {
    uintptr_t ip, sum;
} places[PLACES];

static unsigned known, ticks, again;
static int changing, said_work, proven, watching;
static unsigned seen;

static uintptr_t sum_of(const ucontext_t *context)
{
    uintptr_t sum = (uintptr_t)context->uc_mcontext.gregs[REG_EFL];
    unsigned turn;

    for (turn = 0; turn < X86_REGISTERS; turn++)
        sum = (sum << 5 | sum >> (8 * sizeof sum - 5))
              ^ (uintptr_t)context->uc_mcontext.gregs[context_order[turn]];
    return sum;
}

static void start_again(unsigned now)
{
    seen = now;
    known = ticks = again = 0;
    changing = 0;
    proven = 0;
}

/* Whether this is where a system call returns to: what that did cannot be seen in registers. */
static int after_call(uintptr_t ip)
{
    const unsigned char *code = (const unsigned char *)ip;

    return (code[-2] == 0x0F && (code[-1] == 0x05 || code[-1] == 0x34))
           || (code[-2] == 0xCD && code[-1] == 0x80);
}

/* Whether it has been here with these registers; note it if not. */
static int was_here(uintptr_t ip, uintptr_t sum)
{
    unsigned turn;

    changing |= after_call(ip);
    for (turn = 0; turn < known; turn++)
        if (places[turn].ip == ip) {
            changing |= places[turn].sum != sum;
            return places[turn].sum == sum;
        }
    if (known == PLACES)
        changing = 1;
    else
        places[known++] = (struct place){ip, sum};
    return 0;
}

static void say(uintptr_t ip, const char *what, const char *after)
{
    static uintptr_t said[8];
    static unsigned count;
    unsigned turn;

    for (turn = 0; turn < count; turn++)
        if (ip - said[turn] + NEAR < 2 * NEAR)
            return;
    if (count == 8)
        return;
    said[count++] = ip;
    card_say("thread %d %s", (int)turns_self()->number, what);
    card_say_place("it is at the", ip, "");
    card_say("%s", after);
}

/* Until another thread has done something or a signal has come, this one would see nothing new. */
static void stand_by(struct guest *self)
{
    struct wait wait = {.until = FOR_EVER, .spins = 1};

    self->inside++;
    turns_wait(&wait);
    self->inside--;
    signals_run(self);
    seen = turns_entries();
}

/* Whether the thread has come round its loop to where it is. */
static int goes_round(ucontext_t *context)
{
    struct x86 cpu;
    int round;

    context_get(context, &cpu);
    round = follow_round(&cpu);
    context_put(context, &cpu);
    return round;
}

/* From here on it looks only when there may be something to see, and once each time. */
static void wait_for_memory(struct guest *self, ucontext_t *context)
{
    unsigned rounds;
    uintptr_t sum;
    int round;

    do {
        stand_by(self);
        rounds = 0;
        do {
            sum = sum_of(context);
            round = goes_round(context);
        } while (round && sum_of(context) != sum && ++rounds < ROUNDS);
    } while (round && rounds < ROUNDS);
    start_again(seen);
    proven = 1;
}

static void on_tick(int number, siginfo_t *info, void *data)
{
    struct guest *self = turns_self(), *holder = turns_holder();
    ucontext_t *context = data;
    uintptr_t ip = (uintptr_t)context->uc_mcontext.gregs[CONTEXT_IP];
    unsigned now = turns_entries();
    int saved = errno, here;

    if (holder != NULL && holder != self && info->si_code == SI_TIMER)
        syscall(SYS_tgkill, getpid(), holder->tid, number);
    if (!clock_follows() || holder == NULL || holder != self || self->inside > 0
        || self->trapped != NULL) {
        errno = saved;
        return;
    }
    if (now != seen)
        start_again(now);
    here = was_here(ip, sum_of(context));
    ticks++;
    again += (unsigned)here;
    if (!changing && here && again >= (proven ? LOOKED : PROOF)) {
        say(ip, "waits for memory to change",
            "chip time would stand still for ever, so other threads go on and time passes until one"
            " of them has done something; let the loop look at a clock or sleep instead");
        wait_for_memory(self, context);
    } else if (changing && ticks >= WORK && !said_work) {
        said_work = 1;
        say(ip, "has worked for a second of processor time",
            "meanwhile chip time stands still and no other thread has a turn: that comes with an"
            " access to the card, a wait or a look at a clock");
    }
    errno = saved;
}

void spin_watch(void)
{
    static const struct itimerspec ticking = {{0, TICK_NS}, {0, TICK_NS}};
    int (*create)(clockid_t, struct sigevent *, timer_t *);
    int (*set)(timer_t, int, const struct itimerspec *, struct itimerspec *);
    struct sigaction action;
    struct sigevent event;
    timer_t timer;

    if (watching || !turns_on())
        return;
    watching = 1;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_tick;
    action.sa_flags = SA_SIGINFO | SA_RESTART | SA_ONSTACK;
    signals_real(SPIN_SIGNAL, &action, NULL);
    memset(&event, 0, sizeof event);
    event.sigev_notify = SIGEV_SIGNAL;
    event.sigev_signo = SPIN_SIGNAL;
    *(void **)&create = dlsym(RTLD_NEXT, "timer_create");
    *(void **)&set = dlsym(RTLD_NEXT, "timer_settime");
    if (create(CLOCK_PROCESS_CPUTIME_ID, &event, &timer) == 0)
        set(timer, 0, &ticking, NULL);
}

void spin_forget(void)
{
    if (watching) {
        watching = 0;
        spin_watch();
    }
}
