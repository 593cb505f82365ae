/* files.h - see files.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_FILES_H
#define VBUS_EXEC_FILES_H

#include <poll.h>

/* An interrupt has come: a thread that waits for it can read. */
void files_interrupt(void);

/* Something has happened that may make a descriptor of ours ready; and how often that was. */
void files_changed(void);
unsigned files_changes(void);

/* Whether nothing but interrupts and virtual time makes these descriptors ready. */
int files_inner(const struct pollfd *set, nfds_t count);

/* Descriptors have been closed, or one copied (returns `to`). */
void files_closed(unsigned first, unsigned last);
int files_copied(int from, int to);

#endif
