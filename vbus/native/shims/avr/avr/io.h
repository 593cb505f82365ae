/* avr/io.h - the ports, the UART and the external interrupts of an AVR as objects; see ports.h.
 *
 * Define __AVR_ATmega1281__ or __AVR_ATmega2560__ for those parts; else it is an ATmega328P. Timers,
 * SPI, I2C, ADC and EEPROM are not there: code that uses them does not compile. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_AVR_IO_H
#define VBUS_SHIM_AVR_IO_H

#include "../../ports.h"

#if !defined __AVR_ATmega2560__ && !defined __AVR_ATmega1281__ && !defined __AVR_ATmega328P__
#define __AVR_ATmega328P__ 1
#endif

#define _BV(bit) (1 << (bit))
#define bit_is_set(reg, bit) ((reg) & _BV(bit))
#define bit_is_clear(reg, bit) (!((reg) & _BV(bit)))
#define loop_until_bit_is_set(reg, bit) do { } while (bit_is_clear(reg, bit))
#define loop_until_bit_is_clear(reg, bit) do { } while (bit_is_set(reg, bit))
#define _MemoryBarrier() __asm__ __volatile__("" ::: "memory")

#define VBUS_PORT(x)                                                                               \
    extern vbus_shim::Register PORT##x, DDR##x, PIN##x;                                                 \
    enum { P##x##0, P##x##1, P##x##2, P##x##3, P##x##4, P##x##5, P##x##6, P##x##7 };               \
    enum { PORT##x##0, PORT##x##1, PORT##x##2, PORT##x##3, PORT##x##4, PORT##x##5, PORT##x##6,     \
           PORT##x##7 };                                                                           \
    enum { DD##x##0, DD##x##1, DD##x##2, DD##x##3, DD##x##4, DD##x##5, DD##x##6, DD##x##7 };       \
    enum { DDR##x##0, DDR##x##1, DDR##x##2, DDR##x##3, DDR##x##4, DDR##x##5, DDR##x##6,            \
           DDR##x##7 };                                                                            \
    enum { PIN##x##0, PIN##x##1, PIN##x##2, PIN##x##3, PIN##x##4, PIN##x##5, PIN##x##6, PIN##x##7 };

/* Drivers ask with #ifdef whether a port is there. */
VBUS_PORT(B)
VBUS_PORT(C)
VBUS_PORT(D)
#define PORTB PORTB
#define DDRB DDRB
#define PINB PINB
#define PORTC PORTC
#define DDRC DDRC
#define PINC PINC
#define PORTD PORTD
#define DDRD DDRD
#define PIND PIND
#ifndef __AVR_ATmega328P__
VBUS_PORT(A)
VBUS_PORT(E)
VBUS_PORT(F)
VBUS_PORT(G)
#define PORTA PORTA
#define DDRA DDRA
#define PINA PINA
#define PORTE PORTE
#define DDRE DDRE
#define PINE PINE
#define PORTF PORTF
#define DDRF DDRF
#define PINF PINF
#define PORTG PORTG
#define DDRG DDRG
#define PING PING
#endif
#ifdef __AVR_ATmega2560__
VBUS_PORT(H)
VBUS_PORT(J)
VBUS_PORT(K)
VBUS_PORT(L)
#define PORTH PORTH
#define DDRH DDRH
#define PINH PINH
#define PORTJ PORTJ
#define DDRJ DDRJ
#define PINJ PINJ
#define PORTK PORTK
#define DDRK DDRK
#define PINK PINK
#define PORTL PORTL
#define DDRL DDRL
#define PINL PINL
#endif

/* UART 0 is the console. */
extern vbus_shim::Register UDR0, UCSR0A, UCSR0B, UCSR0C, UBRR0H, UBRR0L;
extern uint16_t UBRR0;
#define UDR0 UDR0
#define UCSR0A UCSR0A
#define UBRR0 UBRR0
enum { MPCM0, U2X0, UPE0, DOR0, FE0, UDRE0, TXC0, RXC0 };
enum { TXB80, RXB80, UCSZ02, TXEN0, RXEN0, UDRIE0, TXCIE0, RXCIE0 };
enum { UCPOL0, UCSZ00, UCSZ01, USBS0, UPM00, UPM01, UMSEL00, UMSEL01 };

/* External and pin change interrupts. */
extern vbus_shim::Register SREG, EIMSK, EICRA, EICRB, EIFR, PCICR, PCIFR, PCMSK0, PCMSK1, PCMSK2;
extern vbus_shim::Register MCUSR, MCUCR, SMCR, GPIOR0, GPIOR1, GPIOR2;
#define SREG SREG
#define EIMSK EIMSK
enum { SREG_C, SREG_Z, SREG_N, SREG_V, SREG_S, SREG_H, SREG_T, SREG_I };
enum { INT0, INT1, INT2, INT3, INT4, INT5, INT6, INT7 };
enum { INTF0, INTF1, INTF2, INTF3, INTF4, INTF5, INTF6, INTF7 };
enum { ISC00, ISC01, ISC10, ISC11, ISC20, ISC21, ISC30, ISC31 };
enum { ISC40, ISC41, ISC50, ISC51, ISC60, ISC61, ISC70, ISC71 };
enum { PCIE0, PCIE1, PCIE2 };
enum { PCIF0, PCIF1, PCIF2 };
enum { PCINT0, PCINT1, PCINT2, PCINT3, PCINT4, PCINT5, PCINT6, PCINT7, PCINT8, PCINT9, PCINT10,
       PCINT11, PCINT12, PCINT13, PCINT14, PCINT15, PCINT16, PCINT17, PCINT18, PCINT19, PCINT20,
       PCINT21, PCINT22, PCINT23 };

#endif
