/* trap.c - the signal handler in which trapped instructions become bus cycles, ports and windows.
 * License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "trap.h"

#include "card.h"
#include "context.h"
#include "follow.h"
#include "signals.h"
#include "sys.h"
#include "turns.h"
#include "x86.h"

#include <errno.h>
#include <sys/mman.h>

#define MOST_WINDOWS 32
#define PORTS 65536u

#ifndef SI_KERNEL
#define SI_KERNEL 128
#endif

struct window {
    uintptr_t start, size, card; /* memory, and the card address at its start */
};

static struct window windows[MOST_WINDOWS];
static volatile unsigned window_count;
static unsigned char allowed[PORTS / 8];
static volatile int level;
static struct sigaction theirs; /* what the program wants done on SIGSEGV */
static uintptr_t trapped_ip;

/* --- what may be reached ---------------------------------------------------------------------- */

int trap_allow(unsigned long from, unsigned long count, int on)
{
    unsigned long port;

    if (from >= PORTS || count > PORTS || from + count > PORTS) {
        errno = EINVAL;
        return -1;
    }
    for (port = from; port < from + count; port++) {
        if (on)
            __atomic_or_fetch(&allowed[port / 8], (unsigned char)(1u << port % 8), __ATOMIC_RELAXED);
        else
            __atomic_and_fetch(&allowed[port / 8], (unsigned char)~(1u << port % 8),
                               __ATOMIC_RELAXED);
    }
    return 0;
}

int trap_level(int wanted)
{
    if (wanted < 0 || wanted > 3) {
        errno = EINVAL;
        return -1;
    }
    level = wanted;
    return 0;
}

int trap_may(unsigned port, unsigned size)
{
    unsigned turn;

    if (level == 3)
        return 1;
    if (size == 0)
        return 0; /* cli and sti */
    for (turn = port; turn < port + size; turn++)
        if (turn >= PORTS || !(allowed[turn / 8] >> turn % 8 & 1))
            return 0;
    return 1;
}

/* --- windows ---------------------------------------------------------------------------------- */

static const struct window *window_at(uintptr_t address, unsigned size)
{
    unsigned turn;

    for (turn = 0; turn < window_count; turn++)
        if (address + size > windows[turn].start
            && address < windows[turn].start + windows[turn].size)
            return &windows[turn];
    return NULL;
}

int trap_covers(uintptr_t address, unsigned size)
{
    return window_at(address, size) != NULL;
}

void *trap_map(void *address, size_t size, int flags, uintptr_t at_card)
{
    long result;

    flags = (flags & (MAP_FIXED | MAP_FIXED_NOREPLACE)) | MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE;
#if X86_BITS == 64
    result = syscall(SYS_mmap, address, size, PROT_NONE, flags, -1, 0);
#else
    result = syscall(SYS_mmap2, address, size, PROT_NONE, flags, -1, 0);
#endif
    if (result == -1)
        return MAP_FAILED;
    card_enter();
    if (window_count < MOST_WINDOWS) {
        windows[window_count].start = (uintptr_t)result;
        windows[window_count].size = (size + 4095) & ~(size_t)4095;
        windows[window_count].card = at_card;
        window_count++;
    }
    card_leave();
    return (void *)result;
}

void trap_unmap(void *address, size_t size)
{
    uintptr_t start = (uintptr_t)address;
    unsigned turn;

    if (window_count == 0)
        return;
    card_enter();
    for (turn = 0; turn < window_count; turn++)
        if (windows[turn].start >= start && windows[turn].start < start + size) {
            windows[turn] = windows[window_count - 1];
            window_count--;
            turn--;
        }
    card_leave();
}

/* --- what the decoder calls ------------------------------------------------------------------- */

static void load(uintptr_t address, unsigned char *data, unsigned size)
{
    const struct window *window = window_at(address, size);

    card_load(window->card + (address - window->start), data, size, trapped_ip);
}

static void store(uintptr_t address, const unsigned char *data, unsigned size)
{
    const struct window *window = window_at(address, size);

    card_store(window->card + (address - window->start), data, size, trapped_ip);
}

/* Ports at which every PC loses a microsecond, whatever is written there. */
static int pauses(unsigned port)
{
    return port == 0x80 || port == 0xED;
}

static uint32_t in(unsigned port, unsigned size)
{
    unsigned char bytes[4] = {0xFF, 0xFF, 0xFF, 0xFF};
    uint32_t value = 0;
    unsigned turn;

    if (pauses(port))
        card_pass(1000);
    else if (!card.memory)
        card_load(port, bytes, size, trapped_ip);
    for (turn = 0; turn < size; turn++)
        value |= (uint32_t)bytes[turn] << 8 * turn;
    return value;
}

static void out(unsigned port, uint32_t value, unsigned size)
{
    unsigned char bytes[4];
    unsigned turn;

    for (turn = 0; turn < 4; turn++)
        bytes[turn] = (unsigned char)(value >> 8 * turn);
    if (pauses(port))
        card_pass(1000);
    else if (!card.memory)
        card_store(port, bytes, size, trapped_ip);
}

static const struct x86_bus bus = {0, trap_covers, load, store, trap_may, in, out};

/* --- accesses --------------------------------------------------------------------------------- */

static struct guest *volatile stepping; /* who carries an access out */

/* Carry out an instruction that reaches the card; the thread has `mask`. */
static int reach(struct x86 *cpu, const sigset_t *mask)
{
    int result;

    card_enter(); /* the kernel has blocked signals meanwhile */
    stepping = turns_self();
    stepping->trapped = mask;
    trapped_ip = cpu->ip;
    result = x86_step(cpu, &bus);
    trapped_ip = 0;
    stepping = NULL;
    card_leave();
    return result;
}

int trap_reach(struct x86 *cpu, const sigset_t *mask, int *result)
{
    unsigned entries = turns_entries(), sent = signals_sent();

    *result = reach(cpu, mask);
    return *result == X86_DONE && turns_entries() == entries + 1 && signals_sent() == sent;
}

/* --- the handler ------------------------------------------------------------------------------ */

static void say_bytes(uintptr_t ip)
{
    static const char digits[] = "0123456789ABCDEF";
    const unsigned char *bytes = (const unsigned char *)ip;
    char text[3 * 15 + 1];
    unsigned turn;

    for (turn = 0; turn < 15; turn++) {
        text[3 * turn] = digits[bytes[turn] >> 4];
        text[3 * turn + 1] = digits[bytes[turn] & 15];
        text[3 * turn + 2] = ' ';
    }
    text[3 * 15] = '\0';
    card_say("the instruction's bytes (and what follows it): %s", text);
}

static _Noreturn void refuse(uintptr_t ip, uintptr_t address)
{
    card_say("%s touches the card at 0x%x, which is not supported", x86_kind(ip), address);
    card_say_place("it is the", ip, "");
    say_bytes(ip);
    card_say("supported are moves of up to 32 bytes and integer instructions: access the card through"
             " volatile integers, or compile without -O3 and -march");
    card_end(1);
}

/* Whether the instruction is one that needs a privilege: in, out, cli, sti, hlt and the like. */
static int privileged(uintptr_t ip)
{
    const unsigned char *code = (const unsigned char *)ip;

    for (;; code++) {
        switch (*code) {
        case 0x26: case 0x2E: case 0x36: case 0x3E: case 0x64: case 0x65: case 0x66: case 0x67:
        case 0xF0: case 0xF2: case 0xF3:
            continue;
        case 0x6C: case 0x6D: case 0x6E: case 0x6F: case 0xE4: case 0xE5: case 0xE6: case 0xE7:
        case 0xEC: case 0xED: case 0xEE: case 0xEF: case 0xF4: case 0xFA: case 0xFB:
            return 1;
        case 0x0F: /* lgdt, clts, invd, moves of control registers, wrmsr, rdmsr ... */
            return code[1] <= 0x09 || (code[1] >= 0x20 && code[1] <= 0x23)
                   || (code[1] >= 0x30 && code[1] <= 0x33);
        default:
            if (X86_BITS == 64 && (*code & 0xF0) == 0x40)
                continue;
            return 0;
        }
    }
}

/* It is the program's own fault, in both senses. */
static void pass_on(int number, siginfo_t *info, void *data, uintptr_t ip)
{
    ucontext_t *context = data;
    struct sigaction action = theirs;
    sigset_t mask;
    int turn;

    if ((action.sa_flags & SA_SIGINFO) == 0
        && (action.sa_handler == SIG_DFL || action.sa_handler == SIG_IGN)) {
        if (info->si_code == SI_KERNEL && !privileged(ip))
            card_say("the program faults: at an address no program can have (not canonical), or one"
                     " that is not aligned for the instruction");
        else if (info->si_code == SI_KERNEL)
            card_say("the program faults: a privileged instruction, or a port for which it has not"
                     " called ioperm or iopl");
        else
            card_say("the program faults at address 0x%x", (uintptr_t)info->si_addr);
        card_say_place("by the", ip, "");
        card_send_last();
        card_note();
        action.sa_handler = SIG_DFL;
        action.sa_flags = 0;
        signals_real(SIGSEGV, &action, NULL);
        return; /* it faults again and ends as it would have without us */
    }
    if (action.sa_flags & (int)SA_RESETHAND)
        theirs.sa_handler = SIG_DFL, theirs.sa_flags = 0;
    mask = context->uc_sigmask;
    for (turn = 1; turn < 65; turn++)
        if (sigismember(&action.sa_mask, turn) == 1)
            sigaddset(&mask, turn);
    sigdelset(&mask, SIGSEGV);
    sys_restore(&mask);
    if (action.sa_flags & SA_SIGINFO)
        action.sa_sigaction(number, info, data);
    else
        action.sa_handler(number);
}

/* A division error happens at the instruction, as on the processor. */
static void raise_division(ucontext_t *context, uintptr_t ip)
{
    struct sigaction action;
    siginfo_t info;

    if (signals_real(SIGFPE, NULL, &action) == 0
        && (action.sa_handler == SIG_IGN || sigismember(&context->uc_sigmask, SIGFPE) == 1)) {
        memset(&action, 0, sizeof action);
        action.sa_handler = SIG_DFL; /* it cannot be put off */
        signals_real(SIGFPE, &action, NULL);
        sigdelset(&context->uc_sigmask, SIGFPE);
    }
    memset(&info, 0, sizeof info);
    info.si_signo = SIGFPE;
    info.si_code = FPE_INTDIV;
    info.si_addr = (void *)ip;
    syscall(SYS_rt_tgsigqueueinfo, getpid(), syscall(SYS_gettid), SIGFPE, &info);
}

/* This library has faulted, at memory of the program, for an instruction of its. */
static void on_own_fault(void)
{
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_handler = SIG_DFL;
    signals_real(SIGSEGV, &action, NULL);
}

static void on_fault(int number, siginfo_t *info, void *data)
{
    int saved = errno, result = X86_FOREIGN, ends = 0;
    uintptr_t address = (uintptr_t)info->si_addr;
    int by_window = info->si_code == SEGV_ACCERR && trap_covers(address, 1);
    ucontext_t *context = data;
    struct guest *self = turns_self();
    struct x86 cpu;

    if (self != NULL) {
        follow_give_up(self);
        if (stepping == self) {
            on_own_fault();
            return;
        }
    }
    context_get(data, &cpu);
    if (by_window || info->si_code == SI_KERNEL) {
        int only = trap_reach(&cpu, &context->uc_sigmask, &result);

        self = turns_self();
        ends = self->asynchronous;
        if (only && !ends)
            follow_on(&cpu, &context->uc_sigmask, &result);
        self->trapped = NULL;
    }
    if (result == X86_DONE || result == X86_DIVISION)
        context_put(data, &cpu);
    if (result == X86_DONE)
        ; /* it goes on */
    else if (result == X86_DIVISION)
        raise_division(data, cpu.ip);
    else if (by_window)
        refuse(cpu.ip, address);
    else
        pass_on(number, info, data, cpu.ip);
    if (ends) {
        sys_restore(&context->uc_sigmask);
        pthread_testcancel();
    }
    errno = saved;
}

void trap_install(void)
{
    struct sigaction action;
    sigset_t mask;

    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK | SA_RESTART | SA_NODEFER;
    memset(&action.sa_mask, 0xFF, sizeof action.sa_mask); /* the C library's own too */
    sigdelset(&action.sa_mask, SIGSEGV);
    signals_real(SIGSEGV, &action, &theirs);
    sigemptyset(&mask);
    sigaddset(&mask, SIGSEGV);
    syscall(SYS_rt_sigprocmask, SIG_UNBLOCK, &mask, NULL, 8);
}

int trap_action(const struct sigaction *action, struct sigaction *before)
{
    struct sigaction old = theirs;

    if (action != NULL)
        theirs = *action;
    if (before != NULL)
        *before = old;
    return 0;
}
