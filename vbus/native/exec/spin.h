/* spin.h - see spin.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_SPIN_H
#define VBUS_EXEC_SPIN_H

#define SPIN_SIGNAL 63 /* a real-time signal this library keeps for itself */

/* Watch from now on for a thread that waits for memory to change. */
void spin_watch(void);

/* The child of a fork has to get it again. */
void spin_forget(void);

#endif
