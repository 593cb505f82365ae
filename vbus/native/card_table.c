/* card_table.c - see card_table.h. License: Apache-2.0. */
#include "card_table.h"

#include <stdlib.h>

/* Read "r340=0.1/7F!5" or "r344!5"; return what follows, or NULL. */
static const char *read_port(const char *text, struct card_port *port)
{
    char *end;

    port->write = *text == 'w';
    if (!port->write && *text != 'r')
        return NULL;
    port->address = strtoul(text + 1, &end, 16);
    port->answers = *end == '=';
    port->floating = 0xFF;
    if (port->answers) {
        port->chip = (unsigned char)strtoul(end + 1, &end, 16);
        if (*end != '.')
            return NULL;
        port->chip_address = (unsigned char)strtoul(end + 1, &end, 16);
        port->floating = *end == '/' ? (unsigned char)strtoul(end + 1, &end, 16) : 0;
    }
    port->acknowledges = *end == '!';
    if (port->acknowledges)
        port->pin = (unsigned char)strtoul(end + 1, &end, 16);
    return *end == ' ' ? end + 1 : *end == '\0' ? end : NULL;
}

int card_table_init(struct card_table *table, const char *text)
{
    for (table->count = 0; *text != '\0'; table->count++)
        if (table->count == CARD_TABLE_PORTS
            || (text = read_port(text, &table->ports[table->count])) == NULL)
            return -1;
    return 0;
}

const struct card_port *card_table_find(const struct card_table *table, unsigned long address,
                                        int write)
{
    unsigned turn;

    for (turn = 0; turn < table->count; turn++)
        if (table->ports[turn].address == address && table->ports[turn].write == write)
            return &table->ports[turn];
    return NULL;
}
