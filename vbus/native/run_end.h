/* run_end.h - programs compiled with a shim that run for ever: $VBUS_UNTIL ends one that has written
 * that text to stdout, $VBUS_LIMIT_MS one that has run for so much chip time (exit code 1 if the text
 * has not come), or has computed for as long, and a second at least, without an access to the bus.
 * License: Apache-2.0.
 */
#ifndef RUN_END_H
#define RUN_END_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The bus is used, at this chip time (picoseconds): the program may end here. */
void run_end_access(uint64_t now);

/* Whether there is a limit: who has to ask for the time can do without. */
int run_end_limited(void);

/* A byte for stdout. */
void run_end_write(unsigned char byte);

#ifdef __cplusplus
}
#endif

#endif
