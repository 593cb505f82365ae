/* Runs each instruction form on plain memory and on a window whose accesses are carried out by
 * x86.c, from the same random states, and compares everything. Forms between two "hlt" are followed
 * instead: x86.c carries them out on the plain memory too.
 *
 *     fuzz ROUNDS SEED        prints each form that differs, and how many there were
 */
#define _GNU_SOURCE
#include "context.h"
#include "x86.h"

#include <setjmp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define SIZE 4096
#define PLAIN 0x20000000u
#define WINDOW 0x30000000u
#define COMMON 0x40000000u
#define FLAGS 0x8D5u
#define MARK 0xF4 /* hlt */
#define SIGNAL_STACK 65536

struct form {
    void (*native)(void);
    void (*trapped)(void);
    const char *text;
    uintptr_t flags;
};

struct state {
    uintptr_t regs[X86_REGISTERS];
    uintptr_t flags;
    unsigned char xmm[8][16];
};

extern const struct form form_table[];
void run_form(void (*form)(void), struct state *state);

static unsigned char shadow[SIZE];
static sigjmp_buf refused;
static int steps;

static int covers(uintptr_t address, unsigned size)
{
    return address + size > WINDOW && address < WINDOW + SIZE;
}

static void load(uintptr_t address, unsigned char *data, unsigned size)
{
    memcpy(data, shadow + (address - WINDOW), size);
}

static void store(uintptr_t address, const unsigned char *data, unsigned size)
{
    memcpy(shadow + (address - WINDOW), data, size);
}

static int may(unsigned port, unsigned size)
{
    (void)port;
    (void)size;
    return 0;
}

static void load_plain(uintptr_t address, unsigned char *data, unsigned size)
{
    memcpy(data, (const void *)address, size);
}

static void store_plain(uintptr_t address, const unsigned char *data, unsigned size)
{
    memcpy((void *)address, data, size);
}

static const struct x86_bus bus = {0, covers, load, store, may, NULL, NULL};
static const struct x86_bus plain_bus = {1, covers, load_plain, store_plain, may, NULL, NULL};

static int at_mark(const struct x86 *cpu)
{
    return *(const unsigned char *)cpu->ip == MARK;
}

/* From behind one mark to behind the next. */
static void follow(struct x86 *cpu)
{
    for (cpu->ip++; !at_mark(cpu); steps++)
        if (x86_step(cpu, &plain_bus) != X86_DONE)
            siglongjmp(refused, 1);
    cpu->ip++;
}

static void on_fault(int number, siginfo_t *info, void *data)
{
    struct x86 cpu;

    (void)number;
    context_get(data, &cpu);
    if (at_mark(&cpu)) {
        follow(&cpu);
        context_put(data, &cpu);
        return;
    }
    steps++;
    if (!covers((uintptr_t)info->si_addr, 1)) {
        fprintf(stderr, "fault at %p, ip %p\n", info->si_addr, (void *)cpu.ip);
        _exit(2);
    }
    if (x86_step(&cpu, &bus) != X86_DONE)
        siglongjmp(refused, 1);
    context_put(data, &cpu);
}

static uint64_t seed;

static uintptr_t number(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (uintptr_t)(seed * UINT64_C(0x2545F4914F6CDD1D) >> 16);
}

static void point(struct state *state, uintptr_t base, uintptr_t flags)
{
    state->regs[X86_BX] = base + 0x400;
    state->regs[X86_SI] = (flags & 1 ? COMMON : base) + 0x480;
    state->regs[X86_DI] = (flags & 2 ? COMMON : base) + 0x500;
#if X86_BITS == 64
    state->regs[8] = base + 0x300;
    state->regs[13] = base + 0x380;
#endif
}

static int differs(const struct state *a, const struct state *b)
{
    unsigned turn;

    for (turn = 0; turn < X86_REGISTERS; turn++) {
        if (turn == X86_SP || a->regs[turn] == b->regs[turn])
            continue;
        if (b->regs[turn] - a->regs[turn] != WINDOW - PLAIN)
            return 1;
    }
    return (a->flags & FLAGS) != (b->flags & FLAGS) || memcmp(a->xmm, b->xmm, sizeof a->xmm) != 0;
}

static void *memory(uintptr_t where, int protection)
{
    return mmap((void *)where, SIZE, protection, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0);
}

int main(int count, char **arguments)
{
    static int rounds, wrong, forms, refusals; /* static: siglongjmp must not lose them */
    static unsigned char *plain, *common, before[SIZE], start[SIZE];
    static const struct form *form;
    static unsigned char signal_stack[SIGNAL_STACK]; /* instructions that are followed push and call */
    stack_t stack = {signal_stack, 0, sizeof signal_stack};
    struct sigaction action;

    rounds = atoi(arguments[1]);
    seed = strtoull(arguments[count - 1], NULL, 10) * 2 + 1;
    plain = memory(PLAIN, PROT_READ | PROT_WRITE);
    common = memory(COMMON, PROT_READ | PROT_WRITE);
    memory(WINDOW, PROT_NONE);
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    sigaltstack(&stack, NULL);
    sigaction(SIGSEGV, &action, NULL);
    for (form = form_table; form->native != NULL; form++) {
        static int turn, bad, refusal;

        forms++;
        bad = refusal = 0;
        for (turn = 0; turn < rounds && !bad && !refusal; turn++) {
            struct state native, trapped;
            unsigned place;

            memset(&native, 0, sizeof native);
            for (place = 0; place < X86_REGISTERS; place++)
                native.regs[place] = (uintptr_t)((uint64_t)number() << 32 ^ number());
            native.regs[X86_CX] = number() % 10;
            native.regs[X86_BP] = number() % 300;
            native.flags = 0x202 | (number() & FLAGS);
            for (place = 0; place < SIZE; place++)
                before[place] = common[place] = (unsigned char)number();
            for (place = 0; place < 128; place++)
                native.xmm[place / 16][place % 16] = (unsigned char)number();
            if (number() % 2) /* so that comparisons of strings go on for a while */
                memcpy(before + 0x480, before + 0x500, 3), memcpy(common + 0x500, before + 0x480, 3);
            memcpy(start, common, SIZE);
            trapped = native;
            point(&native, PLAIN, form->flags);
            point(&trapped, form->flags & 8 ? PLAIN : WINDOW, form->flags);
            memcpy(plain, before, SIZE);
            memcpy(shadow, before, SIZE);
            steps = 0;
            if (sigsetjmp(refused, 1) != 0) {
                refusal = 1;
                break;
            }
            run_form(form->trapped, &trapped);
            if (form->flags & 4) {
                bad = 1;
                break;
            }
            {
                unsigned char after[SIZE];

                memcpy(after, common, SIZE);
                if (form->flags & 8) {
                    memcpy(shadow, plain, SIZE);
                    memcpy(plain, before, SIZE);
                }
                if (form->flags & 2) /* both runs write there: from the same start */
                    memcpy(common, start, SIZE);
                run_form(form->native, &native);
                bad = memcmp(plain, shadow, SIZE) != 0 || differs(&native, &trapped)
                      || memcmp(after, common, SIZE) != 0;
            }
            if (steps == 0 && native.regs[X86_CX] == trapped.regs[X86_CX]
                && strstr(form->text, "rep") == NULL)
                bad = 1; /* it has not trapped at all */
        }
        refusals += refusal;
        if (bad || refusal != (int)(form->flags >> 2 & 1)) {
            wrong++;
            printf("%s: %s\n", refusal ? "refused" : "wrong", form->text);
        }
    }
    printf("%d forms, %d refused, %d wrong\n", forms, refusals, wrong);
    return wrong != 0;
}
