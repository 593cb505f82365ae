/* p18cxxx.h - the names of Microchip's C18 on the ports of xc.h. Any <p18fNNNN.h> comes here.
 * Sources of C18 do not say the clock: compile with -D_XTAL_FREQ=...; without it an instruction takes
 * 200 ns. Assembly, 24-bit integers and interrupts are not there. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_PIC_P18CXXX_H
#define VBUS_SHIM_PIC_P18CXXX_H

#include "xc.h"

#define rom
#define ram
#define near
#define far
#define overlay
#define Sleep() SLEEP()
#define Reset() exit(0)

#define VBUS_DDR(x)                                                                                \
    static VBUS_BITS(TRIS##x, R##x) DDR##x##bits __attribute__((unused));
VBUS_DDR(A)
VBUS_DDR(B)
VBUS_DDR(C)
VBUS_DDR(D)
VBUS_DDR(E)
VBUS_DDR(F)
VBUS_DDR(G)
#define DDRA TRISA
#define DDRB TRISB
#define DDRC TRISC
#define DDRD TRISD
#define DDRE TRISE
#define DDRF TRISF
#define DDRG TRISG

#endif
