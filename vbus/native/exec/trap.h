/* trap.h - see trap.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_TRAP_H
#define VBUS_EXEC_TRAP_H

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

/* A window of memory whose start is the card's address `at_card`; as mmap answers. */
void *trap_map(void *address, size_t size, int flags, uintptr_t at_card);
void trap_unmap(void *address, size_t size);
int trap_covers(uintptr_t address, unsigned size);

#endif
