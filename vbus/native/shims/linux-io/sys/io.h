/* sys/io.h - port accesses of a Linux program as bus cycles; see card_link.h. As in glibc the value
 * comes before the port. Accesses of 16 and 32 bits are successive cycles of 8. C or C++.
 * License: Apache-2.0.
 */
#ifndef VBUS_SHIM_SYS_IO_H
#define VBUS_SHIM_SYS_IO_H

#include "card_link.h"

static inline int ioperm(unsigned long from, unsigned long count, int on)
{
    (void)from;
    (void)count;
    (void)on;
    return 0;
}

static inline int iopl(int level)
{
    (void)level;
    return 0;
}

static inline unsigned char inb(unsigned short port) { return (unsigned char)card_read(port); }
static inline unsigned short inw(unsigned short port)
{
    return (unsigned short)card_read_wide(port, 2, 0);
}
static inline unsigned int inl(unsigned short port) { return card_read_wide(port, 4, 0); }
static inline void outb(unsigned char value, unsigned short port) { card_write(port, value); }
static inline void outw(unsigned short value, unsigned short port)
{
    card_write_wide(port, value, 2, 0);
}
static inline void outl(unsigned int value, unsigned short port)
{
    card_write_wide(port, value, 4, 0);
}

/* With the pause of the PC: a write to port 80h, about a microsecond. */
static inline unsigned char inb_p(unsigned short port)
{
    unsigned char value = inb(port);

    card_write(0x80, 0);
    return value;
}
static inline void outb_p(unsigned char value, unsigned short port)
{
    outb(value, port);
    card_write(0x80, 0);
}
#define inw_p inw
#define inl_p inl
#define outw_p outw
#define outl_p outl

static inline void insb(unsigned short port, void *data, unsigned long count)
{
    unsigned char *byte = (unsigned char *)data;

    while (count-- > 0)
        *byte++ = inb(port);
}
static inline void outsb(unsigned short port, const void *data, unsigned long count)
{
    const unsigned char *byte = (const unsigned char *)data;

    while (count-- > 0)
        outb(*byte++, port);
}

#endif
