/* x86.h - carries out one x86 instruction that touched a port or a window of memory.
 *
 * The instruction's memory operands that lie in the window, and its ports, go through the caller's
 * functions; everything else (registers, flags, other memory) is what the processor itself would
 * have done. License: Apache-2.0.
 */
#ifndef VBUS_EXEC_X86_H
#define VBUS_EXEC_X86_H

#include <stdint.h>

#if defined(__x86_64__)
#define X86_BITS 64
#define X86_REGISTERS 16
#else
#define X86_BITS 32
#define X86_REGISTERS 8
#endif

enum { X86_AX, X86_CX, X86_DX, X86_BX, X86_SP, X86_BP, X86_SI, X86_DI };

struct x86 {
    uintptr_t regs[X86_REGISTERS]; /* in the order of their numbers */
    uintptr_t ip;
    uintptr_t flags;
    unsigned char (*xmm)[16]; /* as many as registers, or NULL */
    unsigned char (*ymm)[16]; /* upper halves of the same, or NULL where the processor has none */
    uint64_t *state;          /* XSTATE_BV: which of them are in use; with `ymm` only */
    unsigned char *fpu;       /* x87 registers: as FXSAVE stores them (64 bits), as FNSAVE (32) */
};

/* What the instruction reaches. Addresses grow by successive bytes; `size` is 1 to 16. With `follows`
 * every memory operand goes through these functions, `covers` is not asked, and instructions that have
 * none are carried out too: those that stand between two accesses of a loop (x86_follow.c). */
struct x86_bus {
    int follows;
    int (*covers)(uintptr_t address, unsigned size);
    void (*load)(uintptr_t address, unsigned char *data, unsigned size);
    void (*store)(uintptr_t address, const unsigned char *data, unsigned size);
    int (*may)(unsigned port, unsigned size); /* whether the program may touch these ports */
    uint32_t (*in)(unsigned port, unsigned size);
    void (*out)(unsigned port, uint32_t value, unsigned size);
};

enum {
    X86_DONE,    /* carried out; registers, flags and ip are those after it */
    X86_FOREIGN, /* it touches no port and nothing of the window, or a port it may not */
    X86_UNKNOWN, /* it touches the window and is not known here */
    X86_DIVISION /* it divides by 0, or the quotient is too large: nothing has changed */
};

int x86_step(struct x86 *cpu, const struct x86_bus *bus);

/* What kind of instruction it is that is not known. */
const char *x86_kind(uintptr_t ip);

#endif
