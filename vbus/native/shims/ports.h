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

/* A register: every read and every write is one access. A driver assigns VALUE to it. */
template <class T, class VALUE> class RegisterOf {
public:
    typedef T (*Read)(unsigned index);
    typedef void (*Write)(unsigned index, T value);

    constexpr RegisterOf(unsigned index, Read read, Write write)
        : index_(index), read_(read), write_(write) {}

    operator T() const { return read_(index_); }
    T operator=(VALUE value) { write_(index_, (T)value); return (T)value; }
    T operator=(const RegisterOf &other) { return *this = (T)other; }
    T operator|=(VALUE value) { return *this = *this | value; }
    T operator&=(VALUE value) { return *this = *this & value; }
    T operator^=(VALUE value) { return *this = *this ^ value; }
    T operator+=(VALUE value) { return *this = *this + value; }
    T operator-=(VALUE value) { return *this = *this - value; }
    T operator<<=(VALUE value) { return *this = *this << value; }
    T operator>>=(VALUE value) { return *this = *this >> value; }
    T operator++() { return *this += 1; }
    T operator--() { return *this -= 1; }
    T operator++(int) { T old = *this; *this = old + 1; return old; }
    T operator--(int) { T old = *this; *this = old - 1; return old; }

private:
    RegisterOf(const RegisterOf &);

    unsigned index_;
    Read read_;
    Write write_;
};

typedef RegisterOf<uint8_t, int> Register;
typedef RegisterOf<uint32_t, uint32_t> Register32;

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

/* Ports by number (0 is A): what is driven, and what is read. A port has VBUS_PORT_BITS. */
#ifndef VBUS_PORT_BITS
#define VBUS_PORT_BITS 8
#endif
#if VBUS_PORT_BITS > 8
typedef uint16_t port_t;
#else
typedef uint8_t port_t;
#endif
port_t port_drive(unsigned port);
port_t port_level(unsigned port);
port_t port_input(unsigned port);
port_t port_lines(unsigned port); /* as port_input, without an access: what interrupt logic sees */
void set_drive(unsigned port, port_t drive);
void set_level(unsigned port, port_t level);
void set_port(unsigned port, port_t drive, port_t level); /* both at one instant */
void set_pull_down(unsigned port, port_t pins); /* before set_port */

/* Time in picoseconds. Looking at a clock moves it, so that waiting for an instant ends. */
void pass(uint64_t duration);
uint64_t look_at_clock();
bool own_clock(uint64_t *now); /* one access; false if the board keeps the time */
void set_clock_period(uint64_t period); /* what a register access takes; at the start 62.5 ns */
uint64_t own_instant(); /* what accesses and pass() have taken so far, without an access */
void set_alarm(uint64_t instant); /* serve interrupts at this own instant, too */
void compute(uint64_t duration); /* the same as pass(), but what is short may pass a little later */

/* Code of the shim, and of an interrupt handler that it calls, takes no time but that of accesses. */
extern unsigned in_shim;
struct Inside {
    Inside() { in_shim++; }
    ~Inside() { in_shim--; }
};

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
