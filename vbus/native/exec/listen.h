/* listen.h - see listen.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_LISTEN_H
#define VBUS_EXEC_LISTEN_H

/* Hear of interrupts from now on. */
void listen_begin(void);

/* Whether `fd` is the descriptor it hears by; the child of a fork has none. */
int listen_owns(int fd);
void listen_forget(void);

#endif
