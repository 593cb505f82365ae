/* context.h - registers of a signal's context as x86.h has them, and back. License: Apache-2.0. */
#ifndef VBUS_EXEC_CONTEXT_H
#define VBUS_EXEC_CONTEXT_H

#include "x86.h"

#include <stddef.h>
#include <string.h>
#include <ucontext.h>

#if X86_BITS == 64
static const int context_order[X86_REGISTERS] = {
    REG_RAX, REG_RCX, REG_RDX, REG_RBX, REG_RSP, REG_RBP, REG_RSI, REG_RDI,
    REG_R8,  REG_R9,  REG_R10, REG_R11, REG_R12, REG_R13, REG_R14, REG_R15};
#define CONTEXT_IP REG_RIP
#else
static const int context_order[X86_REGISTERS] = {REG_EAX, REG_ECX, REG_EDX, REG_EBX,
                                                 REG_ESP, REG_EBP, REG_ESI, REG_EDI};
#define CONTEXT_IP REG_EIP
/* Behind the old FPU state of 112 bytes comes what FXSAVE stores. */
#define CONTEXT_FX 112
#endif

/* Offsets in what FXSAVE stores, and in what XSAVE appends to it. */
#define FX_XMM 160
#define FX_MAGIC 464
#define FX_FEATURES 472
#define FX_STATE 512
#define FX_YMM 576
#define MAGIC 0x46505853u

static inline void context_get_wide(unsigned char *fpu, struct x86 *cpu)
{
    unsigned char *fx = fpu;
    uint32_t magic;
    uint64_t features;

    cpu->xmm = cpu->ymm = NULL;
    cpu->fpu = fpu;
    if (fpu == NULL)
        return;
#if X86_BITS == 32
    fx = fpu + CONTEXT_FX;
#endif
    cpu->xmm = (unsigned char(*)[16])(void *)(fx + FX_XMM);
    memcpy(&magic, fx + FX_MAGIC, sizeof magic);
    memcpy(&features, fx + FX_FEATURES, sizeof features);
    if (magic == MAGIC && features & 4) {
        cpu->ymm = (unsigned char(*)[16])(void *)(fx + FX_YMM);
        cpu->state = (uint64_t *)(void *)(fx + FX_STATE);
    }
}

static inline void context_get(const ucontext_t *context, struct x86 *cpu)
{
    unsigned turn;

    for (turn = 0; turn < X86_REGISTERS; turn++)
        cpu->regs[turn] = (uintptr_t)context->uc_mcontext.gregs[context_order[turn]];
    cpu->ip = (uintptr_t)context->uc_mcontext.gregs[CONTEXT_IP];
    cpu->flags = (uintptr_t)context->uc_mcontext.gregs[REG_EFL];
    context_get_wide((unsigned char *)context->uc_mcontext.fpregs, cpu);
}

static inline void context_put(ucontext_t *context, const struct x86 *cpu)
{
    unsigned turn;

    for (turn = 0; turn < X86_REGISTERS; turn++)
        context->uc_mcontext.gregs[context_order[turn]] = (greg_t)cpu->regs[turn];
    context->uc_mcontext.gregs[CONTEXT_IP] = (greg_t)cpu->ip;
    context->uc_mcontext.gregs[REG_EFL] = (greg_t)cpu->flags;
}

#endif
