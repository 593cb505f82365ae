/* pic_shim.cpp - the registers behind xc.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#include "xc.h"

#undef main

namespace {

enum { TX_STATUS, RX_STATUS, COUNT = 24 };

uint8_t plain[COUNT];

uint8_t read_plain(unsigned index) { return plain[index]; }
void write_plain(unsigned index, uint8_t value) { plain[index] = value; }

/* A one in TRIS is an input. */
uint8_t read_tris(unsigned port)
{
    return (uint8_t)~vbus_shim::port_drive(port);
}

void write_tris(unsigned port, uint8_t value)
{
    vbus_shim::set_drive(port, (uint8_t)~value);
}

uint8_t read_data(unsigned) { return (uint8_t)vbus_shim::console_read(); }
void write_data(unsigned, uint8_t value) { vbus_shim::console_write(value); }

uint8_t read_flags(unsigned)
{
    return (uint8_t)(1U << 4 | (vbus_shim::console_ready() ? 1U << 5 : 0));
}

uint8_t read_tx(unsigned) { return (uint8_t)(plain[TX_STATUS] | 1U << 1); }

void ignore(unsigned, uint8_t) {}

} // namespace

#define SHORT(name, register)                                                                      \
    vbus_shim::RegisterBit<register, 0> name##0;                                                   \
    vbus_shim::RegisterBit<register, 1> name##1;                                                   \
    vbus_shim::RegisterBit<register, 2> name##2;                                                   \
    vbus_shim::RegisterBit<register, 3> name##3;                                                   \
    vbus_shim::RegisterBit<register, 4> name##4;                                                   \
    vbus_shim::RegisterBit<register, 5> name##5;                                                   \
    vbus_shim::RegisterBit<register, 6> name##6;                                                   \
    vbus_shim::RegisterBit<register, 7> name##7;

#define PORT(x, number)                                                                            \
    vbus_shim::Register LAT##x(number, vbus_shim::port_level, vbus_shim::set_level);               \
    vbus_shim::Register PORT##x(number, vbus_shim::port_input, vbus_shim::set_level);              \
    vbus_shim::Register TRIS##x(number, read_tris, write_tris);                                    \
    vbus_shim::Register ANSEL##x(2 + number, read_plain, write_plain);                             \
    LAT##x##bits_t LAT##x##bits;                                                                   \
    PORT##x##bits_t PORT##x##bits;                                                                 \
    TRIS##x##bits_t TRIS##x##bits;                                                                 \
    SHORT(R##x, PORT##x)                                                                           \
    SHORT(LAT##x, LAT##x)                                                                          \
    SHORT(TRIS##x, TRIS##x)

PORT(A, 0)
PORT(B, 1)
PORT(C, 2)
PORT(D, 3)
PORT(E, 4)
PORT(F, 5)
PORT(G, 6)

vbus_shim::Register TXREG(0, read_data, write_data), RCREG(0, read_data, ignore);
vbus_shim::Register TXSTA(TX_STATUS, read_tx, write_plain), RCSTA(RX_STATUS, read_plain, write_plain);
vbus_shim::Register PIR1(0, read_flags, ignore), INTCON(10, read_plain, write_plain);
vbus_shim::Register SPBRG(11, read_plain, write_plain), SPBRGH(12, read_plain, write_plain);
vbus_shim::Register BAUDCON(13, read_plain, write_plain), ADCON0(14, read_plain, write_plain);
vbus_shim::Register ADCON1(15, read_plain, write_plain), OSCCON(16, read_plain, write_plain);
vbus_shim::Register CMCON(17, read_plain, write_plain);
PIR1bits_t PIR1bits;
TXSTAbits_t TXSTAbits;
RCSTAbits_t RCSTAbits;
INTCONbits_t INTCONbits;

void vbus_pic_main(void);

int main(void)
{
    vbus_pic_main();
    return 0;
}
