/* signals.h - see signals.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_SIGNALS_H
#define VBUS_EXEC_SIGNALS_H

#include "turns.h"

#include <signal.h>

/* What the C library's sigaction does. */
int signals_real(int number, const struct sigaction *action, struct sigaction *before);

/* From now on signals that end the program by default let it send what it has held back first. */
void signals_last_words(void);

/* Run the handlers of what came inside. */
enum after signals_run(struct guest *self);

/* Wait with another mask, or NULL; what it lets through ends it. */
enum ending signals_wait(const sigset_t *mask, struct wait *wait, enum after *after);

/* How many these two have sent. */
unsigned signals_sent(void);

/* Send a signal to the program: to the first of its threads that does not block it. */
void signals_send(int number, int code, union sigval value);

/* The same to one thread, which may not be the caller. */
void signals_send_to(struct guest *guest, int number, int code, union sigval value);

#endif
