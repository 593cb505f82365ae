/* clock.h - virtual time as the program's waits see it; see clock.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_CLOCK_H
#define VBUS_EXEC_CLOCK_H

#include <stdint.h>
#include <time.h>

#define NS 1000000000u
#define GRACE_MS 1 /* of wall time, for what other processes and threads send */

/* Whether time is virtual; and whether this clock then follows it. */
int clock_follows(void);
int clock_is_ours(clockid_t clock);

/* What such a clock shows (ns). */
int64_t clock_look(clockid_t clock);

/* Let time pass (ns); what is left if an interrupt's signal came. */
uint64_t clock_pass(uint64_t duration);

/* --- waits that another thread may satisfy (running.c) ------------------------------------------ */

/* A wait of at most `left` (ns; negative: for ever) that looks once in GRACE_MS of wall time. */
struct patience {
    int64_t left, waited;
    int asleep;
    uint64_t seen;
};

void patience_begin(struct patience *patience, int64_t longest);

/* After such a look in vain: whether nobody will satisfy it any more, or others have worked for so
 * long in wall time as it may take (for ever: a second). What they let pass is taken from `left`. */
int patience_over(struct patience *patience);

/* --- timer descriptors (timers.c) -------------------------------------------------------------- */

/* Nanoseconds until the next expiry, or -1. */
int64_t timers_next(void);

/* Make descriptors of timers that have expired readable. */
void timers_fire(void);

/* Whether `fd` is a timer; let time pass until it has expired: 0, or -1 if a signal came first. */
int timers_has(int fd);
int timers_wait(int fd);
void timers_closed(unsigned first, unsigned last);

#endif
