/* pin_link.c - see pin_link.h. License: Apache-2.0. */
#include "pin_link.h"

#include "link_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FLOATING 0xFF
#define REPLY_MS 60000 /* a host that slept for long makes the board compute for long */

const char *pin_link_strerror(int error)
{
    if (error == PIN_LINK_E_WIRING)
        return "this link has no pin map; name one as pinmap of the host in the board file";
    if (error == PIN_LINK_E_BITS)
        return "the pin map wires a port bit above 7, and a port has 8 bits here";
    return vbus_strerror(error);
}

static int keep(struct pin_link *link, int result)
{
    if (result < 0 && link->error == 0)
        link->error = result;
    return result;
}

static void tell_time(struct pin_link *link)
{
    if (link->slaved)
        keep(link, vbus_at(&link->bus, link->origin + link->clock(link->context)));
}

/* What follows happens now, to these chips. */
static void stamp(struct pin_link *link)
{
    link->touched = 1;
    tell_time(link);
}

/* An instant of chip time on the host's own clock. */
static uint64_t own_time(const struct pin_link *link, uint64_t instant)
{
    return instant == VBUS_NO_EDGE || instant < link->origin ? instant : instant - link->origin;
}

static void select_chips(struct pin_link *link, unsigned chips)
{
    if (chips != link->selected)
        keep(link, vbus_select(&link->bus, chips));
    link->selected = chips;
    link->cycles++;
}

unsigned pin_link_read(void *context, unsigned chips, unsigned address)
{
    struct pin_link *link = (struct pin_link *)context;
    int data;

    if (link->error != 0)
        return FLOATING;
    select_chips(link, chips);
    stamp(link);
    data = keep(link, vbus_read(&link->bus, address));
    if (link->bus.leased) { /* it tells of the lines too */
        uint64_t until = own_time(link, link->bus.lease_end);

        link->told |= link->edge != until || link->outputs != link->bus.lease_outputs;
        link->edge = until;
        link->outputs = link->bus.lease_outputs;
        pin_decoder_outputs(&link->pins, link->outputs);
        link->touched = 0;
    }
    return data < 0 ? FLOATING : (unsigned)data;
}

void pin_link_write(void *context, unsigned chips, unsigned address, unsigned data)
{
    struct pin_link *link = (struct pin_link *)context;

    if (link->error != 0)
        return;
    select_chips(link, chips);
    stamp(link);
    keep(link, vbus_write(&link->bus, address, data));
    if (link->realtime)
        keep(link, vbus_echo(&link->bus, 0)); /* a delay loop may count from here */
}

void pin_link_side(void *context, unsigned number, unsigned level)
{
    struct pin_link *link = (struct pin_link *)context;

    if (link->error != 0)
        return;
    stamp(link);
    keep(link, vbus_pin(&link->bus, number, level));
}

/* Lines and buses before glue: nothing of them is a whole cycle, and there are no leases. */
static void move_lines(void *context, unsigned mask, unsigned levels)
{
    struct pin_link *link = (struct pin_link *)context;

    if (link->error != 0)
        return;
    stamp(link);
    link->cycles++;
    keep(link, vbus_lines(&link->bus, mask, levels));
    if (link->realtime)
        keep(link, vbus_echo(&link->bus, 0));
}

/* DRIVE, RELEASE and SAMPLE are about the bus of the chip selected. */
static void choose(struct pin_link *link, unsigned chip)
{
    if (link->selected != 1U << chip)
        keep(link, vbus_select(&link->bus, 1U << chip));
    link->selected = 1U << chip;
}

static void move_bus(void *context, unsigned chip, unsigned data)
{
    struct pin_link *link = (struct pin_link *)context;

    if (link->error != 0)
        return;
    choose(link, chip);
    stamp(link);
    keep(link, data == PIN_FLOATS ? vbus_release(&link->bus) : vbus_drive(&link->bus, data));
}

static unsigned look_at_bus(void *context, unsigned chip)
{
    struct pin_link *link = (struct pin_link *)context;
    uint32_t outputs;
    int data;

    if (link->error != 0)
        return FLOATING;
    choose(link, chip);
    tell_time(link);
    data = keep(link, vbus_sample(&link->bus, &outputs));
    return data < 0 ? FLOATING : (unsigned)data;
}

static void miss(void *context, unsigned chip, unsigned saw, unsigned gave)
{
    struct pin_link *link = (struct pin_link *)context;
    struct pin_missed *missed = &link->missed[chip];

    if (missed->count++)
        return;
    missed->saw = saw;
    missed->gave = gave;
    missed->when = link->clock ? link->origin + link->clock(link->context) : 0;
}

static void list_missed(const struct pin_link *link)
{
    const char *path = getenv("VBUS_MISSED");
    FILE *file = path == NULL ? NULL : fopen(path, "a");
    unsigned chip;

    for (chip = 0; file != NULL && chip < PIN_CHIPS; chip++)
        if (link->missed[chip].count)
            fprintf(file, "%u %u %u %u %llu\n", chip, link->missed[chip].count, link->missed[chip].saw,
                    link->missed[chip].gave, (unsigned long long)link->missed[chip].when);
    if (file != NULL)
        fclose(file);
}

int pin_link_open(struct pin_link *link, const char *where, unsigned bits)
{
    static unsigned char description[LINK_TEXT_ROOM];
    static char text[LINK_TEXT_ROOM];
    const char *leases;
    int size;

    memset(link, 0, sizeof *link);
    link->edge = VBUS_NO_EDGE;
    link->selected = 1;
    size = vbus_open(&link->bus, where);
    link->bus.timeout_ms = REPLY_MS;
    if (size == 0)
        size = vbus_hello(&link->bus, description, sizeof description);
    if (size < 0)
        return keep(link, size);
    link_text(description, (size_t)size, "policy", text);
    link->slaved = strcmp(text, "slaved") == 0;
    link->realtime = strcmp(text, "realtime") == 0;
    link->step = VBUS_US;
    if (link_text(description, (size_t)size, "program", text) > 5 && strncmp(text, "step=", 5) == 0)
        link->step = strtoull(text + 5, NULL, 10);
    if (link_text(description, (size_t)size, "card", text) > 0
        && card_table_init(&link->card, text) < 0)
        return keep(link, VBUS_E_PROTOCOL);
    if (link_text(description, (size_t)size, "wiring", text) <= 0 && link->card.count == 0)
        return keep(link, PIN_LINK_E_WIRING);
    if (link->slaved && keep(link, vbus_now(&link->bus, &link->origin)) < 0)
        return link->error;
    if (pin_decoder_init(&link->pins, text) != 0)
        return keep(link, VBUS_E_PROTOCOL);
    if (link->pins.widest >= bits)
        return keep(link, PIN_LINK_E_BITS);
    link->pins.on_read = pin_link_read;
    link->pins.on_write = pin_link_write;
    link->pins.on_side = pin_link_side;
    link->pins.on_lines = move_lines;
    link->pins.on_bus = move_bus;
    link->pins.on_look = look_at_bus;
    link->pins.on_missed = miss;
    link->pins.context = link;
    vbus_buffer(&link->bus);
    if (link->realtime)
        return 0; /* nothing is promised */
    /* Polls of a byte that cannot have changed need no round trip; VBUS_LEASES=0 asks each time. */
    leases = getenv("VBUS_LEASES");
    return leases != NULL && *leases == '0' ? 0 : keep(link, vbus_leases(&link->bus, 1));
}

int pin_link_close(struct pin_link *link)
{
    if (link->error == 0)
        keep(link, vbus_echo(&link->bus, 0));
    vbus_close(&link->bus);
    list_missed(link);
    return link->error;
}

int pin_link_sync(struct pin_link *link)
{
    if (link->error != 0)
        return link->error;
    tell_time(link);
    if (link->error == 0 && keep(link, vbus_sync(&link->bus, &link->outputs, &link->edge)) == 0) {
        pin_decoder_outputs(&link->pins, link->outputs);
        link->edge = own_time(link, link->edge);
    }
    link->touched = link->told = 0;
    return link->error;
}

int pin_link_watches(const struct pin_link *link, unsigned port)
{
    unsigned turn;

    for (turn = 0; turn < link->pins.output_count; turn++)
        if (link->pins.outputs[turn].source.port == port)
            return 1;
    return 0;
}
