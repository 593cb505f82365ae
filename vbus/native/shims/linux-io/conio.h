/* conio.h - port accesses as DOS and Windows compilers have them: the port comes first.
 * License: Apache-2.0. */
#ifndef VBUS_SHIM_CONIO_H
#define VBUS_SHIM_CONIO_H

#include "card_link.h"

static inline int vbus_outp(unsigned port, int value)
{
    card_write(port, (unsigned)value & 0xFF);
    return value;
}
static inline unsigned vbus_outpw(unsigned port, unsigned value)
{
    card_write_wide(port, value, 2, 0);
    return value;
}

#define _inp(port) ((int)card_read(port))
#define _inpw(port) ((unsigned short)card_read_wide(port, 2, 0))
#define _inpd(port) ((unsigned long)card_read_wide(port, 4, 0))
#define _outp(port, value) vbus_outp(port, value)
#define _outpw(port, value) vbus_outpw(port, value)
#define _outpd(port, value) card_write_wide(port, value, 4, 0)
#define inp _inp
#define inpw _inpw
#define outp _outp
#define outpw _outpw
#define inport(port) _inpw(port)
#define inportb(port) ((unsigned char)card_read(port))
#define outport(port, value) ((void)vbus_outpw(port, (unsigned)(value)))
#define outportb(port, value) ((void)vbus_outp(port, (int)(value)))

#endif
