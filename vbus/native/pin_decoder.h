/* pin_decoder.h - port bits of a microcontroller to bus cycles of chips.
 *
 * It is told how port bits are wired (the `wiring` text of HELLO, see docs/byte-protocol.md) and what
 * each port drives. It calls back for each bus cycle that follows:
 *
 * - a write is latched when (select AND write strobe) ends, whichever of the two rises first, with
 *   the pins as they were before that edge: data may change while the strobe is low;
 * - a read begins when (select AND read strobe) begins, and the byte stays on the data bus until it
 *   ends;
 * - where an address is latched, select alone carries a cycle out: as it rises, the write strobe (R/W)
 *   says which, and the read strobe (/OE), then or later, shows what the last read gave;
 * - a strobe or select that the microcontroller does not drive is idle;
 * - a floating data bus keeps its last value, unless the port has its pull-ups on;
 * - a byte that the microcontroller takes before the read strobe, or after it, is told if it differs.
 *
 * Where glue stands before the strobes of a chip, its cycles are not worked out here: lines and data
 * bus are moved as the port bits move, strobes that rise before data and side pins, strobes that fall
 * after them.
 *
 * No dependency, no allocation, C99 or C++. License: Apache-2.0.
 */
#ifndef PIN_DECODER_H
#define PIN_DECODER_H

#ifdef __cplusplus
extern "C" {
#endif

#define PIN_PORTS 13 /* A to L of up to 16 bits, and M: interrupt inputs of a processor */
#define PIN_BITS 16
#define PIN_CHIPS 16
#define PIN_SIDES 64
#define PIN_OUTPUTS 32
#define PIN_LINES 16

/* Where a pin gets its level from. */
struct pin_source {
    unsigned char kind; /* 0: not wired, 1: a port bit, 2: tied */
    unsigned char port, bit, level, inverted;
};

struct pin_chip {
    struct pin_source select, read, write, latch, address[8], data[8], bus[8];
    unsigned char reading, writing, latching, latched, byte;
    unsigned char selected; /* 2: and it has read, where an address is latched */
    unsigned char looked;   /* at its data lines, since the last strobe, or within this one */
    unsigned char early;    /* looked, when this strobe began */
    unsigned char saw;      /* there, outside a strobe */
    unsigned char late;     /* the last read strobe has ended without a look before or within it */
    unsigned char behind;   /* its data bus is moved as it is: `bus` is wired in place of `data` */
    unsigned short driving; /* what is driven there, or PIN_FLOATS */
    unsigned short ports;   /* those on which select, strobes and latch are, a bit each */
};

#define PIN_FLOATS 0x100

struct pin_side {
    struct pin_source source;
    unsigned char number, level;
};

struct pin_decoder {
    /* Bus cycles of the chips in `chips` (bit n is chip n), and side pins (level 2: let go). */
    unsigned (*on_read)(void *context, unsigned chips, unsigned address);
    void (*on_write)(void *context, unsigned chips, unsigned address, unsigned data);
    void (*on_side)(void *context, unsigned number, unsigned level);
    /* Control lines of `mask` go to `levels`; the data bus of chip number `chip` is driven with
     * `data`, let go (PIN_FLOATS), or looked at. */
    void (*on_lines)(void *context, unsigned mask, unsigned levels);
    void (*on_bus)(void *context, unsigned chip, unsigned data);
    unsigned (*on_look)(void *context, unsigned chip);
    /* May be left out: the microcontroller has not looked at the data lines of a chip while its read
     * strobe was low, but before or after, and saw another byte than the chip gave. */
    void (*on_missed)(void *context, unsigned chip, unsigned saw, unsigned gave);
    void *context;

    /* The rest is the decoder's own, to be looked at. */
    unsigned short drive[PIN_PORTS], level[PIN_PORTS];      /* what the microcontroller does */
    unsigned short external[PIN_PORTS], driven[PIN_PORTS];  /* what chips do, and where */
    unsigned widest;                                        /* the highest port bit that is wired */
    struct pin_chip chips[PIN_CHIPS];
    struct pin_side sides[PIN_SIDES], outputs[PIN_OUTPUTS]; /* outputs: bit `number` of SYNC */
    struct pin_side lines[PIN_LINES];
    unsigned chip_count, side_count, output_count, line_count;
};

/* Take a wiring text. Returns 0, or the position (from 1) of an entry that cannot be understood.
 * All ports start as inputs; set the callbacks afterwards. */
int pin_decoder_init(struct pin_decoder *decoder, const char *wiring);

/* Port `port` (0 is A) now drives the bits of `drive` to `level`; in the others a 1 in `level` is a
 * pull-up. One call is one instant. */
void pin_decoder_port(struct pin_decoder *decoder, unsigned port, unsigned drive, unsigned level);

/* The chips' output lines are now at these levels (SYNC's word). */
void pin_decoder_outputs(struct pin_decoder *decoder, unsigned long word);

/* Look at the data buses behind glue that are wired to a port: call it before pin_decoder_input. */
void pin_decoder_look(struct pin_decoder *decoder, unsigned port);

/* What the microcontroller reads at a port; of one of 8 bits the low byte counts. */
unsigned pin_decoder_input(struct pin_decoder *decoder, unsigned port);

#ifdef __cplusplus
}
#endif

#endif
