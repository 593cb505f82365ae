/* pin_link.c - see pin_link.h. License: Apache-2.0. */
#include "pin_link.h"

#include <string.h>

#define HELLO_ROOM 16384
#define FLOATING 0xFF
#define REPLY_MS 60000 /* a host that slept for long makes the board compute for long */

const char *pin_link_strerror(int error)
{
    if (error == PIN_LINK_E_WIRING)
        return "this link has no pin map; name one as pinmap of the host in the board file";
    return vbus_strerror(error);
}

/* Find the text that belongs to `key` in a msgpack map; its length, or -1. Keys are ASCII, and no
 * text of the map has bytes above 7Fh, so that a key's head byte is found nowhere else. */
static int text_of(const unsigned char *map, size_t size, const char *key, const char **text)
{
    size_t length = strlen(key), place;

    for (place = 0; place + length + 4 < size; place++) {
        const unsigned char *value = map + place + 1 + length;
        size_t found;

        if (map[place] != (0xA0 | length) || memcmp(map + place + 1, key, length) != 0)
            continue;
        if ((*value & 0xE0) == 0xA0) {
            found = *value & 0x1F;
            value += 1;
        } else if (*value == 0xD9) {
            found = value[1];
            value += 2;
        } else if (*value == 0xDA) {
            found = (size_t)value[1] << 8 | value[2];
            value += 3;
        } else {
            continue;
        }
        *text = (const char *)value;
        return value + found <= map + size ? (int)found : -1;
    }
    return -1;
}

static int keep(struct pin_link *link, int result)
{
    if (result < 0 && link->error == 0)
        link->error = result;
    return result;
}

/* What follows happens now, to these chips. */
static void stamp(struct pin_link *link)
{
    link->touched = 1;
    if (link->slaved)
        keep(link, vbus_at(&link->bus, link->clock(link->context)));
}

static void select_chips(struct pin_link *link, unsigned chips)
{
    if (chips != link->selected)
        keep(link, vbus_select(&link->bus, chips));
    link->selected = chips;
    link->cycles++;
}

static unsigned on_read(void *context, unsigned chips, unsigned address)
{
    struct pin_link *link = (struct pin_link *)context;
    int data;

    if (link->error != 0)
        return FLOATING;
    select_chips(link, chips);
    stamp(link);
    data = keep(link, vbus_read(&link->bus, address));
    return data < 0 ? FLOATING : (unsigned)data;
}

static void on_write(void *context, unsigned chips, unsigned address, unsigned data)
{
    struct pin_link *link = (struct pin_link *)context;

    if (link->error != 0)
        return;
    select_chips(link, chips);
    stamp(link);
    keep(link, vbus_write(&link->bus, address, data));
}

static void on_side(void *context, unsigned number, unsigned level)
{
    struct pin_link *link = (struct pin_link *)context;

    if (link->error != 0)
        return;
    stamp(link);
    keep(link, vbus_pin(&link->bus, number, level));
}

int pin_link_open(struct pin_link *link, const char *where)
{
    static unsigned char description[HELLO_ROOM];
    char wiring[HELLO_ROOM];
    const char *text = NULL;
    int size, length;

    memset(link, 0, sizeof *link);
    link->edge = VBUS_NO_EDGE;
    link->selected = 1;
    size = vbus_open(&link->bus, where);
    link->bus.timeout_ms = REPLY_MS;
    if (size == 0)
        size = vbus_hello(&link->bus, description, sizeof description);
    if (size < 0)
        return keep(link, size);
    if (size > HELLO_ROOM)
        size = HELLO_ROOM;
    length = text_of(description, (size_t)size, "policy", &text);
    link->slaved = length == 6 && memcmp(text, "slaved", 6) == 0;
    length = text_of(description, (size_t)size, "wiring", &text);
    if (length <= 0)
        return keep(link, PIN_LINK_E_WIRING);
    memcpy(wiring, text, (size_t)length);
    wiring[length] = '\0';
    if (pin_decoder_init(&link->pins, wiring) != 0)
        return keep(link, VBUS_E_PROTOCOL);
    link->pins.on_read = on_read;
    link->pins.on_write = on_write;
    link->pins.on_side = on_side;
    link->pins.context = link;
    vbus_buffer(&link->bus);
    return 0;
}

int pin_link_close(struct pin_link *link)
{
    if (link->error == 0)
        keep(link, vbus_echo(&link->bus, 0));
    vbus_close(&link->bus);
    return link->error;
}

int pin_link_sync(struct pin_link *link)
{
    uint32_t outputs;

    if (link->error != 0)
        return link->error;
    if (link->slaved)
        keep(link, vbus_at(&link->bus, link->clock(link->context)));
    if (link->error == 0 && keep(link, vbus_sync(&link->bus, &outputs, &link->edge)) == 0)
        pin_decoder_outputs(&link->pins, outputs);
    link->touched = 0;
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
