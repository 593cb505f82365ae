/* follow.c - a program between two accesses, carried out without faults. License: Apache-2.0.
 *
 * A fault takes as long as some thousand instructions, and a loop that polls is a few: so after an
 * access the thread is followed to its next one, which needs no fault then. All goes as if the
 * processor had gone on: the same accesses at the same instants, and at each of them another thread
 * may have the turn. Where more has happened than the access, or an instruction is not known, the
 * program goes on by itself.
 */
#include "follow.h"

#include "card.h"
#include "trap.h"
#include "turns.h"

#define MOST_ACCESSES 256 /* signals wait meanwhile */
#define MOST_REQUESTS 64  /* where the board is asked, they wait longer */
#define MOST_STEPS 64     /* without an access: by itself it goes faster */
#define SINGLE_STEP 0x100u /* a debugger's flag */
#define RED_ZONE (X86_BITS == 64 ? 128 : 0)
#define FRAME 65536 /* more than the signal's frame and this library take of the stack */
#define BELOW 256   /* of that, what the program may use as long as it is followed */
#define PLACES 64
#define IN_VAIN 8 /* times that no access was found: from then on only now and then */
#define NOW_AND_THEN 16

enum found { STEP, ACCESS, NOTHING };

struct following {
    struct x86 *cpu, kept; /* now, and when its stack last ended where it can go on by itself */
    struct guest *who;
    uintptr_t stack_end; /* below it there is the frame of the signal */
    unsigned char below[BELOW];
    int reaches;
    void *back[5];
};

static struct guest *volatile looking; /* who looks at memory of the program */
static struct following *followed;

extern const char __ehdr_start __attribute__((visibility("hidden")));
extern const char _etext __attribute__((visibility("hidden")));

static int is_ours(uintptr_t ip)
{
    return ip - (uintptr_t)&__ehdr_start < (uintptr_t)(&_etext - &__ehdr_start);
}

static __attribute__((noinline)) _Noreturn void give_up(void)
{
    looking = NULL;
    __builtin_longjmp(followed->back, 1);
}

static int is_below(const struct following *following)
{
    return following->cpu->regs[X86_SP] - RED_ZONE < following->stack_end;
}

/* Where the program's memory is; give up unless it is plain, and unless it can be written. */
static volatile void *place(uintptr_t address, unsigned size, int write)
{
    uintptr_t start = followed->stack_end - BELOW;

    followed->reaches = trap_covers(address, size);
    if (!followed->reaches && address >= start && address + size <= followed->stack_end)
        return followed->below + (address - start);
    if (followed->reaches || (write && is_below(followed))
        || (address + size > followed->stack_end - FRAME && address < followed->stack_end))
        give_up();
    return (volatile void *)address;
}

static void load_plain(uintptr_t address, unsigned char *data, unsigned size)
{
    volatile void *from = place(address, size, 0);

    switch (size) {
    case 1: *data = *(volatile unsigned char *)from; break;
    case 2: *(uint16_t *)data = *(volatile uint16_t *)from; break;
    case 4: *(uint32_t *)data = *(volatile uint32_t *)from; break;
    default: *(uint64_t *)data = *(volatile uint64_t *)from;
    }
}

static void store_plain(uintptr_t address, const unsigned char *data, unsigned size)
{
    volatile void *to = place(address, size, 1);

    switch (size) {
    case 1: *(volatile unsigned char *)to = *data; break;
    case 2: *(volatile uint16_t *)to = *(const uint16_t *)data; break;
    case 4: *(volatile uint32_t *)to = *(const uint32_t *)data; break;
    default: *(volatile uint64_t *)to = *(const uint64_t *)data;
    }
}

static int may_not(unsigned port, unsigned size)
{
    followed->reaches = trap_may(port, size);
    return 0;
}

static const struct x86_bus plain = {1, trap_covers, load_plain, store_plain, may_not, NULL, NULL};

/* One instruction that reaches nothing; memory that is not there is the program's affair. */
static __attribute__((noinline)) enum found step(struct following *following)
{
    following->reaches = 0;
    if (!is_below(following))
        following->kept = *following->cpu;
    if (__builtin_setjmp(following->back) == 0) {
        int result;

        followed = following;
        looking = following->who;
        result = x86_step(following->cpu, &plain);
        looking = NULL;
        if (result == X86_DONE)
            return STEP;
    }
    return following->reaches && !is_below(following) ? ACCESS : NOTHING;
}

/* Follow the thread from behind an access; whether it has come to another. `result` is how that ended. */
static int follow(struct x86 *cpu, const sigset_t *mask, int *result)
{
    struct following following = {
        .cpu = cpu, .who = turns_self(), .stack_end = cpu->regs[X86_SP] - RED_ZONE};
    unsigned accesses = 0, steps = 0, requests = card_requests();

    while (accesses < MOST_ACCESSES && steps < MOST_STEPS && !is_ours(cpu->ip)) {
        enum found found = step(&following);

        if (found == NOTHING)
            break;
        steps++;
        if (found == ACCESS) {
            accesses++;
            steps = 0;
            if (!trap_reach(cpu, mask, result)
                || (uint16_t)(card_requests() - requests) > MOST_REQUESTS)
                break;
        }
    }
    if (is_below(&following))
        *cpu = following.kept;
    if (*result != X86_DIVISION)
        *result = X86_DONE; /* it faults by itself, if it must */
    return accesses > 0;
}

int follow_round(struct x86 *cpu)
{
    struct following following = {
        .cpu = cpu, .who = turns_self(), .stack_end = cpu->regs[X86_SP] - RED_ZONE};
    uintptr_t home = cpu->ip;
    enum found found = NOTHING;
    unsigned steps;

    for (steps = 0; steps < MOST_STEPS && !is_ours(cpu->ip); steps++) {
        found = step(&following);
        if (found != STEP || cpu->ip == home)
            break;
    }
    if (is_below(&following))
        *cpu = following.kept;
    return found == STEP && cpu->ip == home;
}

void follow_give_up(const struct guest *self)
{
    if (looking == self)
        give_up();
}

void follow_on(struct x86 *cpu, const sigset_t *mask, int *result)
{
    static unsigned char in_vain[PLACES]; /* by the place of the access */
    unsigned char *count = &in_vain[cpu->ip % PLACES];

    if (!card.virtual_time || cpu->flags & SINGLE_STEP)
        return;
    if (*count >= IN_VAIN && ++*count % NOW_AND_THEN != 0)
        return;
    if (follow(cpu, mask, result))
        *count = 0;
    else if (*count < IN_VAIN)
        ++*count;
}
