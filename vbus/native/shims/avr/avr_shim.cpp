/* avr_shim.cpp - the registers behind avr/io.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#include "avr/interrupt.h"

/* A firmware that handles an interrupt defines its vector; the others stay empty. */
#define VECTOR(name) extern "C" void name(void) __attribute__((weak));
VECTOR(INT0_vect) VECTOR(INT1_vect) VECTOR(INT2_vect) VECTOR(INT3_vect)
VECTOR(INT4_vect) VECTOR(INT5_vect) VECTOR(INT6_vect) VECTOR(INT7_vect)
VECTOR(PCINT0_vect) VECTOR(PCINT1_vect) VECTOR(PCINT2_vect)

namespace {

enum { STATUS, EXT_MASK, EXT_SENSE_A, EXT_SENSE_B, EXT_FLAGS, PC_CONTROL, PC_FLAGS, PC_MASK0, PC_MASK1,
       PC_MASK2, PLAIN, CONSOLE_A = PLAIN + 6, CONSOLE_B, CONSOLE_C, BAUD_H, BAUD_L, COUNT };

uint8_t plain[COUNT];

uint8_t read_plain(unsigned index) { return plain[index]; }
void write_plain(unsigned index, uint8_t value) { plain[index] = value; }

void write_flags(unsigned index, uint8_t value) { plain[index] &= (uint8_t)~value; }

void write_status(unsigned, uint8_t value) { vbus_shim::avr_interrupts(value >> SREG_I & 1); }

/* Ones written to PINx toggle. */
void write_pin(unsigned port, uint8_t value)
{
    vbus_shim::set_level(port, vbus_shim::port_level(port) ^ value);
}

#ifndef F_CPU
#define F_CPU 16000000UL
#endif

const uint64_t PERIOD = UINT64_C(1000000000000) / F_CPU;
const bool clock_is_set = (vbus_shim::set_clock_period(PERIOD), true);

uint64_t sent_at; /* when the last byte given to the UART has left it */

/* Start bit, eight bits, stop bit. */
uint64_t byte_time()
{
    unsigned divisor = (unsigned)plain[BAUD_H] << 8 | plain[BAUD_L] | UBRR0;

    return 10 * (plain[CONSOLE_A] & _BV(U2X0) ? 8 : 16) * (divisor + 1) * PERIOD;
}

uint8_t read_data(unsigned) { return (uint8_t)vbus_shim::console_read(); }

void write_data(unsigned, uint8_t value)
{
    uint64_t now;

    if (vbus_shim::own_clock(&now))
        sent_at = (sent_at > now ? sent_at : now) + byte_time();
    vbus_shim::console_write(value);
}

/* One byte is being sent and one may wait. Where the board keeps the time, sending takes none. */
uint8_t read_console(unsigned)
{
    uint64_t now;
    uint8_t flags = (uint8_t)(plain[CONSOLE_A] & _BV(U2X0));

    if (!vbus_shim::own_clock(&now))
        now = sent_at;
    vbus_shim::serve_interrupts();
    if (sent_at <= now + byte_time())
        flags |= _BV(UDRE0);
    if (sent_at <= now)
        flags |= _BV(TXC0);
    if (plain[CONSOLE_B] & _BV(RXEN0) && vbus_shim::console_ready())
        flags |= _BV(RXC0);
    return flags;
}

/* Where external interrupts and pin change interrupts come in. */
struct Input {
    uint8_t port, bit;
};

#ifdef __AVR_ATmega328P__
const Input EXTERNAL[] = {{3, 2}, {3, 3}};
const uint8_t CHANGE_PORTS[] = {1, 2, 3};
#else
const Input EXTERNAL[] = {{3, 0}, {3, 1}, {3, 2}, {3, 3}, {4, 4}, {4, 5}, {4, 6}, {4, 7}};
const uint8_t CHANGE_PORTS[] = {1};
#endif
const unsigned EXTERNALS = sizeof EXTERNAL / sizeof *EXTERNAL;
const unsigned CHANGES = sizeof CHANGE_PORTS;

void (*const external_vector[])(void) = {INT0_vect, INT1_vect, INT2_vect, INT3_vect,
                                         INT4_vect, INT5_vect, INT6_vect, INT7_vect};
void (*const change_vector[])(void) = {PCINT0_vect, PCINT1_vect, PCINT2_vect};

uint8_t was[12];

unsigned line(const Input &input) { return vbus_shim::port_lines(input.port) >> input.bit & 1; }

void call(void (*vector)(void))
{
    plain[STATUS] &= (uint8_t)~_BV(SREG_I);
    if (vector != 0)
        vector();
    plain[STATUS] |= _BV(SREG_I);
}

/* Note edges, then run what is enabled. */
bool serve()
{
    unsigned turn;
    bool enabled = plain[EXT_MASK] || plain[PC_CONTROL];

    if (!enabled)
        return false;
    for (turn = 0; turn < EXTERNALS; turn++) {
        const Input &input = EXTERNAL[turn];
        unsigned sense = plain[turn < 4 ? EXT_SENSE_A : EXT_SENSE_B] >> turn % 4 * 2 & 3;
        unsigned now = line(input), old = was[input.port] >> input.bit & 1;

        if (sense == 0 ? !now : now != old && (sense == 1 || now == (sense == 3)))
            plain[EXT_FLAGS] |= (uint8_t)_BV(turn);
    }
    for (turn = 0; turn < CHANGES; turn++)
        if ((vbus_shim::port_lines(CHANGE_PORTS[turn]) ^ was[CHANGE_PORTS[turn]])
            & plain[PC_MASK0 + turn])
            plain[PC_FLAGS] |= (uint8_t)_BV(turn);
    for (turn = 1; turn < 5; turn++)
        was[turn] = vbus_shim::port_lines(turn);
    for (turn = 0; turn < EXTERNALS && plain[STATUS] >> SREG_I & 1; turn++)
        if (plain[EXT_FLAGS] & plain[EXT_MASK] & _BV(turn)) {
            plain[EXT_FLAGS] &= (uint8_t)~_BV(turn);
            call(external_vector[turn]);
        }
    for (turn = 0; turn < CHANGES && plain[STATUS] >> SREG_I & 1; turn++)
        if (plain[PC_FLAGS] & plain[PC_CONTROL] & _BV(turn)) {
            plain[PC_FLAGS] &= (uint8_t)~_BV(turn);
            call(change_vector[turn]);
        }
    return true;
}

void write_mask(unsigned index, uint8_t value)
{
    unsigned turn;

    /* What moved without a listener is no edge. */
    if (!plain[EXT_MASK] && !plain[PC_CONTROL] && value)
        for (turn = 1; turn < 5; turn++)
            was[turn] = vbus_shim::port_lines(turn);
    plain[index] = value;
    vbus_shim::set_interrupts(serve);
    vbus_shim::serve_interrupts();
}

} // namespace

namespace vbus_shim {

void avr_interrupts(bool on)
{
    plain[STATUS] = (uint8_t)(on ? plain[STATUS] | _BV(SREG_I) : plain[STATUS] & ~_BV(SREG_I));
    if (on)
        serve_interrupts();
}

} // namespace vbus_shim

#define PORT(x, number)                                                                            \
    vbus_shim::Register PORT##x(number, vbus_shim::port_level, vbus_shim::set_level);                             \
    vbus_shim::Register DDR##x(number, vbus_shim::port_drive, vbus_shim::set_drive);                              \
    vbus_shim::Register PIN##x(number, vbus_shim::port_input, write_pin);

PORT(B, 1)
PORT(C, 2)
PORT(D, 3)
#ifndef __AVR_ATmega328P__
PORT(A, 0)
PORT(E, 4)
PORT(F, 5)
PORT(G, 6)
#endif
#ifdef __AVR_ATmega2560__
PORT(H, 7)
PORT(J, 9)
PORT(K, 10)
PORT(L, 11)
#endif

vbus_shim::Register UDR0(0, read_data, write_data), UCSR0A(CONSOLE_A, read_console, write_plain);
vbus_shim::Register UCSR0B(CONSOLE_B, read_plain, write_plain), UCSR0C(CONSOLE_C, read_plain, write_plain);
vbus_shim::Register UBRR0H(BAUD_H, read_plain, write_plain), UBRR0L(BAUD_L, read_plain, write_plain);
uint16_t UBRR0;

vbus_shim::Register SREG(STATUS, read_plain, write_status);
vbus_shim::Register EIMSK(EXT_MASK, read_plain, write_mask), PCICR(PC_CONTROL, read_plain, write_mask);
vbus_shim::Register EICRA(EXT_SENSE_A, read_plain, write_plain), EICRB(EXT_SENSE_B, read_plain, write_plain);
vbus_shim::Register EIFR(EXT_FLAGS, read_plain, write_flags), PCIFR(PC_FLAGS, read_plain, write_flags);
vbus_shim::Register PCMSK0(PC_MASK0, read_plain, write_plain), PCMSK1(PC_MASK1, read_plain, write_plain);
vbus_shim::Register PCMSK2(PC_MASK2, read_plain, write_plain);
vbus_shim::Register MCUSR(PLAIN, read_plain, write_plain), MCUCR(PLAIN + 1, read_plain, write_plain);
vbus_shim::Register SMCR(PLAIN + 2, read_plain, write_plain), GPIOR0(PLAIN + 3, read_plain, write_plain);
vbus_shim::Register GPIOR1(PLAIN + 4, read_plain, write_plain), GPIOR2(PLAIN + 5, read_plain, write_plain);
