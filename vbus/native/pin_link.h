/* pin_link.h - a microcontroller's port bits as a session of vbus: pin decoder and client together.
 *
 * The board tells how port bits are wired (`pinmap` of the link in the board file). On a slaved board
 * every request carries the host's own time stamp. Requests without a reply are sent with the next
 * one that has one. License: Apache-2.0.
 */
#ifndef PIN_LINK_H
#define PIN_LINK_H

#include "card_table.h"
#include "pin_decoder.h"
#include "vbus.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of a chip that the host took outside the strobes that gave them. */
struct pin_missed {
    unsigned count, saw, gave; /* how many; what it saw first, and what the chip had given */
    uint64_t when;             /* and at this instant of chip time (ps) */
};

struct pin_link {
    struct vbus bus;
    struct pin_decoder pins;
    struct card_table card; /* what its memory bus reaches, where it has one */

    /* The host's own clock (ps), asked for time stamps; needed on slaved boards only. */
    uint64_t (*clock)(void *context);
    void *context;

    int slaved;        /* the board's time is the host's */
    int realtime;      /* the wall clock is the board's time: a write is waited for */
    int error;         /* the first error; nothing is sent any more */
    int touched;       /* the chips were touched since the last pin_link_sync */
    int told;          /* a read has reported the lines since the last pin_link_sync: see `edge` */
    uint64_t edge;     /* no output line moves before this, by the last report (host's clock) */
    uint64_t origin;   /* chip time when the host's own clock was 0: another may have run before */
    uint32_t outputs;  /* their levels by the last report */
    uint64_t step;     /* what looking at a clock takes in lockstep (ps) */
    uint64_t cycles;   /* bus cycles so far, or moves of strobes before glue */
    unsigned selected;
    struct pin_missed missed[PIN_CHIPS];
};

#define PIN_LINK_E_WIRING (-200) /* the link has no pin map; name one as `pinmap` in the board file */

#define PIN_LINK_E_BITS (-201) /* the pin map wires a port bit that this host's ports do not have */

/* Open the session at `where` (see vbus_open) and take its wiring, of ports of `bits` bits. Returns 0
 * or an error. Set `clock` before the first pin moves. */
int pin_link_open(struct pin_link *link, const char *where, unsigned bits);

/* Send what is still held back and close the session; the first error, or 0. Bytes that the host took
 * outside their strobes are listed in the file that $VBUS_MISSED names. */
int pin_link_close(struct pin_link *link);

/* What the pin decoder calls; for a bus beside the port bits too. `link` is the struct pin_link. */
unsigned pin_link_read(void *link, unsigned chips, unsigned address);
void pin_link_write(void *link, unsigned chips, unsigned address, unsigned data);
void pin_link_side(void *link, unsigned number, unsigned level);

/* Bring the chips up to the host's time and take the levels of the output lines; 0 or an error. */
int pin_link_sync(struct pin_link *link);

/* Whether an output line is wired to port `port`. */
int pin_link_watches(const struct pin_link *link, unsigned port);

/* A sentence about an error. */
const char *pin_link_strerror(int error);

#ifdef __cplusplus
}
#endif

#endif
