/* timers.h - see timers.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_TIMERS_H
#define VBUS_EXEC_TIMERS_H

#include <stdint.h>

/* The next expiry by turns_now, or FOR_EVER. */
int64_t timers_next(void);

/* Let timers expire whose time has come. */
void timers_fire(void);

/* Time is virtual from now on: what the kernel's timers would do is ours. */
void timers_begin(void);

/* The child of a fork has none but those with descriptors. */
void timers_forget(void);

/* Whether `fd` is a timer; descriptors that are closed, and copied. */
int timers_has(int fd);
void timers_closed(unsigned first, unsigned last);

#endif
