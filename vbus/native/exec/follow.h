/* follow.h - see follow.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_FOLLOW_H
#define VBUS_EXEC_FOLLOW_H

#include "turns.h"
#include "x86.h"

#include <signal.h>

/* Where time is virtual: follow a thread of signal mask `mask` from behind an access. `result` becomes how
 * its last access has ended. */
void follow_on(struct x86 *cpu, const sigset_t *mask, int *result);

/* Follow a thread until it is again where it is now; whether it has come there, in a few instructions that
 * are known here and reach no card. If not, it goes on by itself from `cpu`. */
int follow_round(struct x86 *cpu);

/* At a fault: if this thread is being followed, and its memory is not there, this does not return. */
void follow_give_up(const struct guest *self);

#endif
