/* card_link.h - a computer's bus addresses as a session of vbus: card decoding and client together.
 *
 * The board tells which address reaches what (`card` of the link in the board file). The session is
 * opened at the first use, at $VBUS_LINK, and anew in a forked child. Where no chip answers, FFh is
 * read. License: Apache-2.0.
 */
#ifndef CARD_LINK_H
#define CARD_LINK_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One bus cycle. A link that is lost ends the program with exit code 4 and a message. */
unsigned card_read(unsigned long address);
void card_write(unsigned long address, unsigned data);

/* `size` successive cycles; `big` if the byte at the lowest address is the most significant one. */
uint32_t card_read_wide(unsigned long address, unsigned size, int big);
void card_write_wide(unsigned long address, uint32_t value, unsigned size, int big);

/* Let time pass (picoseconds): at once, unless the board runs in real time. */
void card_pass(uint64_t duration);

/* Whether sleeps and clocks follow chip time: from the first access on, unless the board runs in real
 * time; and chip time (picoseconds). See card_time.c. */
int card_rules_time(void);
uint64_t card_now(void);

#ifdef __cplusplus
}
#endif

#endif
