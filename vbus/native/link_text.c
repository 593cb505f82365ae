/* link_text.c - see link_text.h. License: Apache-2.0. */
#include "link_text.h"

#include <string.h>

/* Keys and names of a description are ASCII, so that the head byte of a key is found nowhere else. */
int link_text(const unsigned char *map, size_t size, const char *key, char *text)
{
    size_t length = strlen(key), place;

    *text = '\0';
    if (size > LINK_TEXT_ROOM)
        size = LINK_TEXT_ROOM;
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
        if (value + found > map + size)
            return -1;
        memcpy(text, value, found);
        text[found] = '\0';
        return (int)found;
    }
    return -1;
}
