/* xc.h - the ports of a PIC as objects: LATx, PORTx, TRISx, their bit structures, and delays; see
 * ports.h. Ports A to G. Define _XTAL_FREQ as on the PIC. The console is EUSART 1: TXREG, RCREG,
 * TXSTA, RCSTA, PIR1. Other peripherals are not there. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_PIC_XC_H
#define VBUS_SHIM_PIC_XC_H

#include "../ports.h"

#define VBUS_BITS(register, name)                                                               \
    struct {                                                                                       \
        vbus_shim::RegisterBit<register, 0> name##0;                                               \
        vbus_shim::RegisterBit<register, 1> name##1;                                               \
        vbus_shim::RegisterBit<register, 2> name##2;                                               \
        vbus_shim::RegisterBit<register, 3> name##3;                                               \
        vbus_shim::RegisterBit<register, 4> name##4;                                               \
        vbus_shim::RegisterBit<register, 5> name##5;                                               \
        vbus_shim::RegisterBit<register, 6> name##6;                                               \
        vbus_shim::RegisterBit<register, 7> name##7;                                               \
    }

/* Bits by their short names, as in `RB3 = 1`. */
#define VBUS_SHORT(name, register)                                                                 \
    extern vbus_shim::RegisterBit<register, 0> name##0;                                            \
    extern vbus_shim::RegisterBit<register, 1> name##1;                                            \
    extern vbus_shim::RegisterBit<register, 2> name##2;                                            \
    extern vbus_shim::RegisterBit<register, 3> name##3;                                            \
    extern vbus_shim::RegisterBit<register, 4> name##4;                                            \
    extern vbus_shim::RegisterBit<register, 5> name##5;                                            \
    extern vbus_shim::RegisterBit<register, 6> name##6;                                            \
    extern vbus_shim::RegisterBit<register, 7> name##7;

#define VBUS_PIC_PORT(x)                                                                           \
    extern vbus_shim::Register LAT##x, PORT##x, TRIS##x;                                           \
    typedef VBUS_BITS(LAT##x, LAT##x) LAT##x##bits_t;                                           \
    typedef VBUS_BITS(PORT##x, R##x) PORT##x##bits_t;                                           \
    typedef VBUS_BITS(TRIS##x, TRIS##x) TRIS##x##bits_t;                                        \
    extern LAT##x##bits_t LAT##x##bits;                                                            \
    extern PORT##x##bits_t PORT##x##bits;                                                          \
    extern TRIS##x##bits_t TRIS##x##bits;                                                          \
    VBUS_SHORT(R##x, PORT##x)                                                                      \
    VBUS_SHORT(LAT##x, LAT##x)                                                                     \
    VBUS_SHORT(TRIS##x, TRIS##x)                                                                   \
    extern vbus_shim::Register ANSEL##x;

VBUS_PIC_PORT(A)
VBUS_PIC_PORT(B)
VBUS_PIC_PORT(C)
VBUS_PIC_PORT(D)
VBUS_PIC_PORT(E)
VBUS_PIC_PORT(F)
VBUS_PIC_PORT(G)

extern vbus_shim::Register TXREG, RCREG, TXSTA, RCSTA, SPBRG, SPBRGH, BAUDCON, INTCON, ADCON0, ADCON1,
    OSCCON, CMCON;
#define TXREG1 TXREG
#define RCREG1 RCREG
#define TXSTA1 TXSTA
#define RCSTA1 RCSTA
#define SPBRG1 SPBRG

extern vbus_shim::Register PIR1;
typedef struct {
    vbus_shim::RegisterBit<PIR1, 4> TXIF;
    vbus_shim::RegisterBit<PIR1, 5> RCIF;
} PIR1bits_t;
typedef struct {
    vbus_shim::RegisterBit<TXSTA, 1> TRMT;
    vbus_shim::RegisterBit<TXSTA, 2> BRGH;
    vbus_shim::RegisterBit<TXSTA, 4> SYNC;
    vbus_shim::RegisterBit<TXSTA, 5> TXEN;
} TXSTAbits_t;
typedef struct {
    vbus_shim::RegisterBit<RCSTA, 4> CREN;
    vbus_shim::RegisterBit<RCSTA, 7> SPEN;
} RCSTAbits_t;
typedef struct {
    vbus_shim::RegisterBit<INTCON, 6> PEIE;
    vbus_shim::RegisterBit<INTCON, 7> GIE;
} INTCONbits_t;
extern PIR1bits_t PIR1bits;
extern TXSTAbits_t TXSTAbits;
extern RCSTAbits_t RCSTAbits;
extern INTCONbits_t INTCONbits;

#define __delay_us(microseconds) vbus_shim::pass((uint64_t)((microseconds) * 1e6))
#define __delay_ms(milliseconds) vbus_shim::pass((uint64_t)((milliseconds) * 1e9))
#ifdef _XTAL_FREQ
namespace {
const bool vbus_clock_is_set __attribute__((unused)) =
    (vbus_shim::set_clock_period(UINT64_C(4000000000000) / _XTAL_FREQ), true);
}
#define _delay(cycles) vbus_shim::pass((uint64_t)(cycles) * 4 * UINT64_C(1000000000000) / _XTAL_FREQ)
#else
#define _delay(cycles) vbus_shim::pass((uint64_t)(cycles) * UINT64_C(200000))
#endif
#define NOP() _delay(1)
#define Nop() _delay(1)
#define CLRWDT() ((void)0)
#define ClrWdt() ((void)0)
#define SLEEP() vbus_shim::sleep()
#define di() ((void)0)
#define ei() ((void)0)
#define __interrupt(...)
#define __persistent
#define __near
#define __far
#define __rom const
#define __bit bool

/* XC8 lets main be void; what it does at the end is to start again, so here the program ends. */
#define main vbus_pic_main

#endif
