/* link_text.c - see link_text.h. License: Apache-2.0. */
#include "link_text.h"

#include <string.h>

/* One msgpack item: the bytes of its head and body, and how many items it holds. */
struct item {
    size_t size, items;
    const unsigned char *text; /* of a string; NULL for anything else */
    size_t length;
};

static size_t number(const unsigned char *bytes, unsigned count)
{
    size_t value = 0;

    while (count--)
        value = value << 8 | *bytes++;
    return value;
}

/* Read the item at `place`; 0 if the bytes end within it. */
static int read_item(const unsigned char *place, size_t left, struct item *item)
{
    unsigned head, wide = 0;

    memset(item, 0, sizeof *item);
    if (left == 0)
        return 0;
    head = *place;
    item->size = 1;
    if (head >= 0x80 && head <= 0x8F) {
        item->items = 2 * (head & 15);
    } else if (head >= 0x90 && head <= 0x9F) {
        item->items = head & 15;
    } else if (head >= 0xA0 && head <= 0xBF) {
        item->length = head & 31;
        item->text = place + 1;
    } else if (head == 0xC4 || head == 0xD9) {
        wide = 1;
    } else if (head == 0xC5 || head == 0xDA || head == 0xDC || head == 0xDE) {
        wide = 2;
    } else if (head == 0xC6 || head == 0xDB || head == 0xDD || head == 0xDF) {
        wide = 4;
    } else if (head == 0xCC || head == 0xD0) {
        item->size = 2;
    } else if (head == 0xCD || head == 0xD1) {
        item->size = 3;
    } else if (head == 0xCA || head == 0xCE || head == 0xD2) {
        item->size = 5;
    } else if (head == 0xCB || head == 0xCF || head == 0xD3) {
        item->size = 9;
    }
    if (wide) {
        size_t count;

        if (left < 1 + wide)
            return 0;
        count = number(place + 1, wide);
        item->size += wide;
        if (head == 0xDC || head == 0xDD) {
            item->items = count;
        } else if (head == 0xDE || head == 0xDF) {
            item->items = 2 * count;
        } else {
            item->length = count;
            item->text = head >= 0xD9 ? place + item->size : NULL;
        }
    }
    if (item->size > left || item->length > left - item->size)
        return 0;
    item->size += item->length;
    return 1;
}

int link_text(const unsigned char *map, size_t size, const char *key, char *text)
{
    const unsigned char *place = map, *end = map + size;
    size_t inside, pairs, skip;
    struct item item;

    *text = '\0';
    if (!read_item(place, size, &item) || item.text || item.items % 2)
        return -1;
    pairs = item.items / 2;
    place += item.size;
    /* Only the outermost map's own keys count: a chip may be called like one of them. */
    for (inside = 0; inside < pairs; inside++) {
        int wanted;

        if (!read_item(place, (size_t)(end - place), &item))
            return -1;
        wanted = item.text && item.length == strlen(key) && !memcmp(item.text, key, item.length);
        place += item.size;
        for (skip = 1; skip; skip--) {
            if (!read_item(place, (size_t)(end - place), &item))
                return -1;
            if (wanted) {
                if (!item.text || item.length >= LINK_TEXT_ROOM)
                    return -1;
                memcpy(text, item.text, item.length);
                text[item.length] = '\0';
                return (int)item.length;
            }
            place += item.size;
            skip += item.items;
        }
    }
    return -1;
}
