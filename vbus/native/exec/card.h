/* card.h - the program's session with the board: card addresses, time, interrupts.
 *
 * Functions that touch the board are called between card_enter and card_leave, which keep other
 * threads and every signal out. A board that is gone ends the program with exit code 4 and a message.
 * License: Apache-2.0.
 */
#ifndef VBUS_EXEC_CARD_H
#define VBUS_EXEC_CARD_H

#include <stddef.h>
#include <stdint.h>

struct card_settings {
    int present;          /* whether vbus exec has sent settings */
    int virtual_time;     /* lockstep or slaved: clocks and sleeps follow the chips */
    int memory;           /* the card's addresses are memory, not ports */
    int big;              /* the byte at the lowest address is the most significant one */
    uintptr_t fixed;      /* where the program expects the card without mapping it, or 0 */
    uintptr_t first, end; /* the card's addresses: first, and one past the last */
    uint32_t lines, low;  /* output lines that interrupt, and those of them that do so when low */
    int signal;           /* signal they send, or 0 */
    int edge;             /* an interrupt that stands counts once, and not again when it is enabled */
    unsigned order;       /* a seed by which ready threads are drawn, or 0: in order of creation */
};

extern struct card_settings card;

#define REPLY_MS 60000 /* for the board's replies, on a busy machine too */

void card_read_settings(void);

void card_enter(void);
void card_leave(void);

/* Cycles on successive addresses. `ip` and `what` are for messages. */
void card_load(uintptr_t address, unsigned char *data, unsigned size, uintptr_t ip);
void card_store(uintptr_t address, const unsigned char *data, unsigned size, uintptr_t ip);

/* Whether the board is still there; if not the program ends. */
void card_check(void);

/* How many requests there have been: polls that a lease has answered are reported together. */
unsigned card_requests(void);

/* Send what is held back. */
void card_send(void);

/* The same before another process begins that may use the card. */
void card_share(void);

/* The same before the program dies: hardly waits for the lock, never ends the program itself. */
void card_send_last(void);

/* The child of a fork opens a session of its own when it needs one. */
void card_forget(void);

/* Whether this process has touched the card. */
int card_in_use(void);

/* Whether `fd` is the session's descriptor; and which that is, or -1. */
int card_owns(int fd);
int card_descriptor(void);

/* The program takes the number `fd` for itself: the session moves to another. */
void card_step_aside(int fd);

/* --- time, where it is virtual ---------------------------------------------------------------- */

/* Time is virtual from now on; and whether it is. */
void card_begin_time(void);
int card_time_begun(void);

/* Note where the clocks stand when virtual time begins (clock.c). */
void card_set_clocks(void);

/* Nanoseconds of the virtual clock since card_begin_time; each look costs the board's clock_step. */
uint64_t card_look(void);

/* The same without a look's cost: for comparing only. */
uint64_t card_elapsed(void);

/* Let time pass (ns), whatever comes meanwhile. */
void card_pass(uint64_t duration);

/* Let time pass while no thread can go on: at most `longest` (ns), and, if anybody heeds it, until an
 * interrupt may come. 0: nothing is to be waited for. */
int card_leap(int64_t longest, int heeds);

/* --- interrupts ------------------------------------------------------------------------------- */

/* Whether one of the lines interrupts: they are one wire. */
int card_interrupting(uint32_t outputs);

/* Watch the interrupt lines from now on. */
void card_watch(void);

/* Learn of interrupts that the time which has passed has brought. */
void card_refresh(void);

/* What a session tells of the lines, after `active`: in real time two of them hear of each edge, and it
 * counts once. The access that follows an edge finds it counted and the signal sent. */
void card_hear(int *active, uint32_t outputs, uint64_t instant);

/* Interrupts so far; and one more. */
uint32_t card_interrupts(void);
void card_interrupt(void);

/* Between these no thread counts one, and no signal is sent. */
void card_lock_interrupts(void);
void card_unlock_interrupts(void);

/* An interrupt that still stands counts again, where its level is sensed. */
void card_rearm(void);

/* Tell the program of interrupts that have come and of timers that have expired. */
void card_notice(void);

/* --- messages --------------------------------------------------------------------------------- */

/* Write "vbus exec: ..." to stderr; %x takes a uintptr_t, %s a string, %d an int. */
void card_say(const char *format, ...);
_Noreturn void card_end(int code);

/* Leave word to vbus exec that the program's end by a fault is its own. */
void card_note(void);

/* Leave word to vbus exec, which ends programs that hang: what this process's threads wait for, while
 * nothing that the process has in hand can end a wait. NULL: take it back. Whether anybody wants it. */
int card_wants_rest(void);
void card_say_rest(const char *text, size_t size);

/* Say where an instruction stands: "0x401136 (program+0x1136)". */
void card_say_place(const char *before, uintptr_t ip, const char *after);

#endif
