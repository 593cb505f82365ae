/* link_text.h - one text of HELLO's description. License: Apache-2.0. */
#ifndef LINK_TEXT_H
#define LINK_TEXT_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LINK_TEXT_ROOM 16384

/* Copy the text that belongs to `key` in HELLO's msgpack map to `text`, which has LINK_TEXT_ROOM
 * bytes. Returns its length; -1 if it is not there or does not fit. */
int link_text(const unsigned char *map, size_t size, const char *key, char *text);

#ifdef __cplusplus
}
#endif

#endif
