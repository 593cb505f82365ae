/* card.h - the program's session with the board: card addresses, time, interrupts.
 *
 * Functions that touch the board are called between card_enter and card_leave, which keep other
 * threads and every signal out. A board that is gone ends the program with exit code 4 and a message.
 * License: Apache-2.0.
 */
#ifndef VBUS_EXEC_CARD_H
#define VBUS_EXEC_CARD_H

#include <signal.h>
#include <stddef.h>
#include <stdint.h>

struct card_settings {
    int present;          /* whether vbus exec has told anything */
    int virtual_time;     /* lockstep or slaved: clocks and sleeps follow the chips */
    int memory;           /* the card's addresses are memory, not ports */
    int big;              /* the byte at the lowest address is the most significant one */
    uintptr_t fixed;      /* where the program expects the card without mapping it, or 0 */
    uintptr_t first, end; /* the card's addresses: first, and one past the last */
    int line, active_low; /* output line that interrupts, or -1 */
    int signal;           /* signal it sends, or 0 */
};

extern struct card_settings card;

void card_read_settings(void);

void card_enter(sigset_t *before);
void card_leave(const sigset_t *before);

/* Cycles on successive addresses. `ip` and `what` are for messages. */
void card_load(uintptr_t address, unsigned char *data, unsigned size, uintptr_t ip);
void card_store(uintptr_t address, const unsigned char *data, unsigned size, uintptr_t ip);

/* Send what is kept back. */
void card_send(void);

/* The same before the program dies: hardly waits for the lock, never ends the program itself. */
void card_send_last(void);

/* The child of a fork opens a session of its own when it needs one. */
void card_forget(void);

/* Whether this process has touched the card. */
int card_in_use(void);

/* How often a thread has begun to use it; and how many do `now`. */
unsigned card_entries(int *now);

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

/* Let time pass (ns); returns what is left because an interrupt came, or 0. */
uint64_t card_pass(uint64_t duration);

/* --- interrupts ------------------------------------------------------------------------------- */

/* Watch the interrupt line from now on. */
void card_watch(void);

/* Interrupts so far, after bringing the chips up to now. */
uint32_t card_interrupts(void);

/* Let time pass until an interrupt may come, at most `longest` (ns). */
void card_approach_interrupt(uint64_t longest);

/* An interrupt that still stands counts again. */
void card_rearm(void);

/* Whether the signal is still to be sent. */
int card_due(void);

/* Send the signal for interrupts that have come; call after card_leave. */
void card_raise(void);

/* --- messages --------------------------------------------------------------------------------- */

/* Write "vbus exec: ..." to stderr; %x takes a uintptr_t, %s a string, %d an int. */
void card_say(const char *format, ...);
_Noreturn void card_end(int code);

/* Say where an instruction stands: "0x401136 (program+0x1136)". */
void card_say_place(const char *before, uintptr_t ip, const char *after);

#endif
