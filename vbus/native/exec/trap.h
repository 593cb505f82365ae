/* trap.h - see trap.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_TRAP_H
#define VBUS_EXEC_TRAP_H

#include "x86.h"

#include <signal.h>
#include <stddef.h>
#include <stdint.h>

#define PUBLIC __attribute__((visibility("default")))

/* Handle SIGSEGV from now on; and what the program wants done at its own. */
void trap_install(void);
int trap_action(const struct sigaction *action, struct sigaction *before);

/* What ioperm and iopl ask for: 0, or -1 and errno. */
int trap_allow(unsigned long from, unsigned long count, int on);
int trap_level(int level);
int trap_may(unsigned port, unsigned size);

/* Carry out an instruction that reaches the card, by a thread of signal mask `mask`: how it ended is in
 * `result`. Whether nothing more has happened: no other thread has had the turn, no signal waits to be
 * delivered. */
int trap_reach(struct x86 *cpu, const sigset_t *mask, int *result);

/* A window of memory whose start is the card's address `at_card`; as mmap answers. */
void *trap_map(void *address, size_t size, int flags, uintptr_t at_card);
void trap_unmap(void *address, size_t size);
int trap_covers(uintptr_t address, unsigned size);

#endif
