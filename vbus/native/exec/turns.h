/* turns.h - where time is virtual, one thread of the program runs at a time; see turns.c.
 * License: Apache-2.0.
 */
#ifndef VBUS_EXEC_TURNS_H
#define VBUS_EXEC_TURNS_H

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>

#define MOST_GUESTS 256
#define MOST_KEPT 16
#define FOR_EVER INT64_MAX

enum guest_state { RUNS, READY, WAITS, OUTSIDE, ENDED };

/* What a thread waits for: whatever comes first. Descriptors wake it when poll finds one. */
struct wait {
    const void *object; /* what turns_tell names */
    struct pollfd *set;
    nfds_t count;
    int64_t until; /* by turns_now (ns), or FOR_EVER */
    int shared;    /* another process may end it too: it is asked for again and again; BY_SIGNAL */
    int steady;    /* cancelling does not end it */
    int spins;     /* whatever another thread does may end it */
    unsigned asked, entries, looked;
    volatile int told;
    unsigned since;
};

#define BY_SIGNAL 2 /* by a signal alone */

enum ending { TOLD, FOUND, LATE, INTERRUPTED };

/* A thread of the program. */
struct guest {
    volatile unsigned number; /* in the order of creation, from 1; 0: the place is free */
    volatile int state, go;
    int inside; /* how deep in this library */
    pid_t tid;
    pthread_t thread;
    struct wait *volatile wait;
    const sigset_t *volatile trapped; /* the program's mask while an access is trapped */
    volatile unsigned kept;           /* signals that came inside */
    volatile int keeping;
    siginfo_t signals[MOST_KEPT];
    volatile int cancelled, ended;
    int detached, rounds, asynchronous;
    void *(*routine)(void *);
    void *argument;
};

/* Threads are known from the start of a program whose time is virtual. */
void turns_start(void);

/* Whether threads take turns; and whether anybody but the caller has to be asked. */
int turns_on(void);
int turns_many(void);

/* Who has the turn, or NULL; and how often a thread has come here. */
struct guest *turns_holder(void);
unsigned turns_entries(void);

/* Between these a thread has the turn, and its signals wait. */
struct guest *turns_enter(void);
void turns_leave(void);

/* Give the turn to the next thread that is ready, in order of creation, if there is one. */
void turns_offer(void);

/* The same for one that asks again and again: if no other is ready, a look at a clock's time. */
void turns_yield(void);

/* Give the turn away until one of these; between turns_enter and turns_leave. */
enum ending turns_wait(struct wait *wait);

/* After INTERRUPTED: run the handlers of what came; the thread may end here. What is to be done: */
enum after { FAIL, RESTART, GO_ON };
enum after turns_interrupt(void);

/* Whether a wait that has this object is over: for at most `most` of those who wait; how many. */
unsigned turns_tell(const void *object, unsigned most);
unsigned turns_waiting(const void *object);

/* The clock by which waits end: CLOCK_MONOTONIC as the program sees it (ns). */
int64_t turns_now(void);

/* A call that may block in the kernel: the turn is given away and taken again. */
void turns_go_out(void);
void turns_come_back(void);

/* Who this is, or NULL; who that is. */
struct guest *turns_self(void);
struct guest *turns_find(pthread_t thread);
struct guest *turns_next(const struct guest *after); /* in order of creation; NULL: the first */

/* A new thread's place, and its beginning and end. */
struct guest *turns_add(void);
void turns_await_start(const struct guest *guest);
void turns_drop(struct guest *guest);
void *turns_run(void *guest);

/* What this process has said of its waits (see card_say_rest) holds no more; and whether timers are its
 * own, which it says when that begins. */
void turns_stir(void);
void turns_say_begun(void);

/* Only the caller is left: the child of a fork. */
void turns_alone(void);

#endif
