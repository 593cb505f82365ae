/* ports.h - what the shims of microcontrollers have in common: registers that are objects, chip time,
 * interrupts, a console.
 *
 * The session is opened at the first use of a port, at $VBUS_LINK (such as unix:PATH). On a slaved
 * board this program is the master of time: an access to a register takes one clock period, a delay
 * what it says. On other boards the board lets time pass. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_PORTS_H
#define VBUS_SHIM_PORTS_H

#ifndef __cplusplus
#error "the shims make ports of C++ objects: compile with g++, also sources that end in .c"
#endif

#include <stdint.h>

#if !defined VBUS_INT_IS_32_BITS && !defined VBUS_SHIM_SOURCE
#pragma message("int has 32 bits here and 16 on the microcontroller: what overflows there does not"    \
                " here, and structures with int are larger; -DVBUS_INT_IS_32_BITS if that is known")
#endif

namespace vbus_shim {

/* A register of 8 bits: every read and every write is one access. */
class Register {
public:
    typedef uint8_t (*Read)(unsigned index);
    typedef void (*Write)(unsigned index, uint8_t value);

    constexpr Register(unsigned index, Read read, Write write)
        : index_(index), read_(read), write_(write) {}

    operator uint8_t() const { return read_(index_); }
    uint8_t operator=(int value) { write_(index_, (uint8_t)value); return (uint8_t)value; }
    uint8_t operator=(const Register &other) { return *this = (uint8_t)other; }
    uint8_t operator|=(int value) { return *this = *this | value; }
    uint8_t operator&=(int value) { return *this = *this & value; }
    uint8_t operator^=(int value) { return *this = *this ^ value; }
    uint8_t operator+=(int value) { return *this = *this + value; }
    uint8_t operator-=(int value) { return *this = *this - value; }
    uint8_t operator<<=(int value) { return *this = *this << value; }
    uint8_t operator>>=(int value) { return *this = *this >> value; }
    uint8_t operator++() { return *this += 1; }
    uint8_t operator--() { return *this -= 1; }
    uint8_t operator++(int) { uint8_t old = *this; *this = old + 1; return old; }
    uint8_t operator--(int) { uint8_t old = *this; *this = old - 1; return old; }

private:
    Register(const Register &);

    unsigned index_;
    Read read_;
    Write write_;
};

/* One bit of a register, as the bit structures of PIC compilers have it. */
template <Register &REGISTER, unsigned BIT> struct RegisterBit {
    operator bool() const { return REGISTER >> BIT & 1; }
    bool operator=(int value)
    {
        REGISTER = value & 1 ? REGISTER | 1U << BIT : REGISTER & ~(1U << BIT);
        return value & 1;
    }
    bool operator=(const RegisterBit &other) { return *this = (int)(bool)other; }
    bool operator^=(int value) { return *this = (int)(bool)*this ^ value; }
    bool operator|=(int value) { return *this = (int)(bool)*this | value; }
    bool operator&=(int value) { return *this = (int)(bool)*this & value; }
};

/* Ports by number (0 is A): what is driven, and what is read. */
uint8_t port_drive(unsigned port);
uint8_t port_level(unsigned port);
uint8_t port_input(unsigned port);
uint8_t port_lines(unsigned port); /* as port_input, without an access: what interrupt logic sees */
void set_drive(unsigned port, uint8_t drive);
void set_level(unsigned port, uint8_t level);

/* Time in picoseconds. Looking at a clock moves it, so that waiting for an instant ends. */
void pass(uint64_t duration);
uint64_t look_at_clock();
bool own_clock(uint64_t *now); /* one access; false if the board keeps the time */
void set_clock_period(uint64_t period); /* what a register access takes; at the start 62.5 ns */

/* Called whenever interrupts may be served. Returns whether any is enabled: if none is, the chips
 * are not asked for their lines. */
void set_interrupts(bool (*serve)());
bool serve_interrupts();
void sleep(); /* until a line moves; ends the program if none ever will */

/* The console: stdout and stdin. */
void console_write(uint8_t byte);
bool console_ready();
int console_read();

} // namespace vbus_shim

#endif
