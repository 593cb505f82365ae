/* card_table.h - the table of a card as HELLO tells it: which address reaches what.
 * License: Apache-2.0.
 */
#ifndef CARD_TABLE_H
#define CARD_TABLE_H

#ifdef __cplusplus
extern "C" {
#endif

#define CARD_TABLE_PORTS 512

struct card_port {
    unsigned long address;
    unsigned char write, chip, chip_address, floating;
    unsigned char answers, acknowledges, pin; /* whether a chip does; side pin pulsed low after it */
};

struct card_table {
    struct card_port ports[CARD_TABLE_PORTS];
    unsigned count;
};

/* Take the text `card` of HELLO; 0, or -1 if it cannot be understood. */
int card_table_init(struct card_table *table, const char *text);

/* What an access reaches, or NULL. */
const struct card_port *card_table_find(const struct card_table *table, unsigned long address,
                                        int write);

#ifdef __cplusplus
}
#endif

#endif
