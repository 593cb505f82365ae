/* context.h - registers of a signal's context as x86.h has them, and back. License: Apache-2.0. */
#ifndef VBUS_EXEC_CONTEXT_H
#define VBUS_EXEC_CONTEXT_H

#include "x86.h"

#include <stddef.h>
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
/* Behind the old FPU state of 112 bytes comes what FXSAVE stores; XMM0 is at 160 in it. */
#define CONTEXT_XMM (112 + 160)
#endif

static void context_get(const ucontext_t *context, struct x86 *cpu)
{
    unsigned turn;

    for (turn = 0; turn < X86_REGISTERS; turn++)
        cpu->regs[turn] = (uintptr_t)context->uc_mcontext.gregs[context_order[turn]];
    cpu->ip = (uintptr_t)context->uc_mcontext.gregs[CONTEXT_IP];
    cpu->flags = (uintptr_t)context->uc_mcontext.gregs[REG_EFL];
    cpu->xmm = NULL;
    if (context->uc_mcontext.fpregs != NULL) {
#if X86_BITS == 64
        cpu->xmm = (unsigned char(*)[16])(void *)context->uc_mcontext.fpregs->_xmm;
#else
        cpu->xmm =
            (unsigned char(*)[16])(void *)((char *)context->uc_mcontext.fpregs + CONTEXT_XMM);
#endif
    }
}

static void context_put(ucontext_t *context, const struct x86 *cpu)
{
    unsigned turn;

    for (turn = 0; turn < X86_REGISTERS; turn++)
        context->uc_mcontext.gregs[context_order[turn]] = (greg_t)cpu->regs[turn];
    context->uc_mcontext.gregs[CONTEXT_IP] = (greg_t)cpu->ip;
    context->uc_mcontext.gregs[REG_EFL] = (greg_t)cpu->flags;
}

#endif
