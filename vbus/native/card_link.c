/* card_link.c - see card_link.h. License: Apache-2.0. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#include "card_link.h"
#include "card_table.h"
#include "link_text.h"
#include "run_end.h"
#include "vbus.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define DELAY_PORT 0x80 /* writes here are pauses on every PC */
#define REPLY_MS 60000  /* a board on a busy machine */

static struct {
    struct vbus bus;
    struct card_table table;
    unsigned selected;
    pid_t owner;
    int slaved, realtime;
    uint64_t time;
} card;

static int inside; /* in here: the client's own looks at clocks are real */

static void fail(const char *where, const char *what)
{
    fflush(stdout);
    fprintf(stderr, "vbus: %s: %s\n", where, what);
    exit(4);
}

static void must(int error)
{
    if (error == VBUS_E_SYSTEM)
        fail("link", strerror(card.bus.system));
    if (error < 0)
        fail("link", vbus_strerror(error));
}

/* What is still held back goes out: polls answered from a lease, writes. */
static void leave(void)
{
    inside++;
    if (card.owner == getpid()) {
        vbus_echo(&card.bus, 0);
        vbus_close(&card.bus);
    }
}

static void open_session(void)
{
    static int leaves;

    static unsigned char description[LINK_TEXT_ROOM];
    static char text[LINK_TEXT_ROOM];
    const char *where = getenv("VBUS_LINK"), *leases;
    int size;

    if (card.owner == getpid())
        return;
    if (where == NULL)
        fail("VBUS_LINK", "not set; name a link that has a card, such as unix:PATH");
    if (card.owner != 0)
        vbus_close(&card.bus); /* the parent's session is not ours */
    memset(&card, 0, sizeof card);
    size = vbus_open(&card.bus, where);
    card.bus.timeout_ms = REPLY_MS;
    if (size == VBUS_E_SYSTEM)
        fail(where, strerror(card.bus.system));
    must(size);
    size = vbus_hello(&card.bus, description, sizeof description);
    must(size);
    if (link_text(description, (size_t)size, "card", text) <= 0)
        fail(where, "this link has no card; name one as card of the host in the board file");
    if (card_table_init(&card.table, text) < 0)
        fail(where, "its card cannot be understood");
    link_text(description, (size_t)size, "policy", text);
    card.slaved = strcmp(text, "slaved") == 0;
    card.realtime = strcmp(text, "realtime") == 0;
    card.selected = 1;
    card.owner = getpid();
    if (card.slaved)
        must(vbus_now(&card.bus, &card.time)); /* another program may have run before */
    if (!leaves)
        atexit(leave);
    leaves = 1;
    vbus_buffer(&card.bus);
    leases = getenv("VBUS_LEASES");
    if (!card.realtime && (leases == NULL || *leases != '0'))
        must(vbus_leases(&card.bus, 1));
}

static void open_card(void)
{
    inside++;
    open_session();
    inside--;
}

static const struct card_port *find(unsigned long address, int write)
{
    open_card();
    run_end_access(run_end_limited() ? card_now() : 0);
    return card_table_find(&card.table, address, write);
}

static void begin(const struct card_port *port)
{
    unsigned chips = 1U << port->chip;

    if (!port->answers && !card.slaved) /* a cycle all the same */
        must(vbus_delay(&card.bus, VBUS_US));
    if (port->answers && chips != card.selected)
        must(vbus_select(&card.bus, chips));
    if (port->answers)
        card.selected = chips;
    if (card.slaved) {
        card.time += VBUS_US;
        must(vbus_at(&card.bus, card.time));
    }
}

static void end(const struct card_port *port)
{
    if (port->acknowledges) {
        must(vbus_pin(&card.bus, port->pin, 0));
        must(vbus_pin(&card.bus, port->pin, 2));
    }
}

unsigned card_read(unsigned long address)
{
    const struct card_port *port = find(address, 0);
    int data;

    if (port == NULL)
        return 0xFF;
    inside++;
    begin(port);
    data = port->answers ? vbus_read(&card.bus, port->chip_address) : 0;
    must(data);
    end(port);
    inside--;
    return (unsigned)data | port->floating;
}

void card_write(unsigned long address, unsigned data)
{
    const struct card_port *port = find(address, 1);

    if (port == NULL) {
        if (address == DELAY_PORT)
            card_pass(VBUS_US);
        return;
    }
    inside++;
    begin(port);
    if (port->answers)
        must(vbus_write(&card.bus, port->chip_address, data & 0xFF));
    end(port);
    must(vbus_flush(&card.bus));
    vbus_buffer(&card.bus);
    if (card.realtime)
        must(vbus_echo(&card.bus, 0)); /* it has happened then: a delay loop may count from here */
    inside--;
}

uint32_t card_read_wide(unsigned long address, unsigned size, int big)
{
    uint32_t value = 0;
    unsigned turn;

    for (turn = 0; turn < size; turn++) {
        uint32_t byte = card_read(address + turn);

        value |= byte << 8 * (big ? size - 1 - turn : turn);
    }
    return value;
}

void card_write_wide(unsigned long address, uint32_t value, unsigned size, int big)
{
    unsigned turn;

    for (turn = 0; turn < size; turn++)
        card_write(address + turn, value >> 8 * (big ? size - 1 - turn : turn) & 0xFF);
}

void card_pass(uint64_t duration)
{
    open_card();
    inside++;
    if (card.slaved)
        card.time += duration;
    else
        must(vbus_delay(&card.bus, duration));
    inside--;
    run_end_access(run_end_limited() ? card_now() : 0);
}

int card_rules_time(void)
{
    return !inside && card.owner == getpid() && !card.realtime;
}

uint64_t card_now(void)
{
    uint64_t now = card.time;

    inside++;
    if (!card.slaved)
        must(vbus_now(&card.bus, &now));
    inside--;
    return now;
}
