/* arduino_shim.cpp - see Arduino.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#include "Arduino.h"

#include <stdio.h>

HardwareSerial Serial;

namespace {

struct Wire {
    char port;
    uint8_t bit;
};

/* Arduino's pin numbers. */
#ifdef __AVR_ATmega2560__
const Wire PINS[] = {
    {'E', 0}, {'E', 1}, {'E', 4}, {'E', 5}, {'G', 5}, {'E', 3}, {'H', 3}, {'H', 4}, {'H', 5},
    {'H', 6}, {'B', 4}, {'B', 5}, {'B', 6}, {'B', 7}, {'J', 1}, {'J', 0}, {'H', 1}, {'H', 0},
    {'D', 3}, {'D', 2}, {'D', 1}, {'D', 0}, {'A', 0}, {'A', 1}, {'A', 2}, {'A', 3}, {'A', 4},
    {'A', 5}, {'A', 6}, {'A', 7}, {'C', 7}, {'C', 6}, {'C', 5}, {'C', 4}, {'C', 3}, {'C', 2},
    {'C', 1}, {'C', 0}, {'D', 7}, {'G', 2}, {'G', 1}, {'G', 0}, {'L', 7}, {'L', 6}, {'L', 5},
    {'L', 4}, {'L', 3}, {'L', 2}, {'L', 1}, {'L', 0}, {'B', 3}, {'B', 2}, {'B', 1}, {'B', 0},
    {'F', 0}, {'F', 1}, {'F', 2}, {'F', 3}, {'F', 4}, {'F', 5}, {'F', 6}, {'F', 7}, {'K', 0},
    {'K', 1}, {'K', 2}, {'K', 3}, {'K', 4}, {'K', 5}, {'K', 6}, {'K', 7},
};
const uint8_t INTERRUPTS[] = {2, 3, 21, 20, 19, 18};
#else
const Wire PINS[] = {
    {'D', 0}, {'D', 1}, {'D', 2}, {'D', 3}, {'D', 4}, {'D', 5}, {'D', 6}, {'D', 7}, {'B', 0}, {'B', 1},
    {'B', 2}, {'B', 3}, {'B', 4}, {'B', 5}, {'C', 0}, {'C', 1}, {'C', 2}, {'C', 3}, {'C', 4}, {'C', 5},
};
const uint8_t INTERRUPTS[] = {2, 3};
#endif
const unsigned PIN_COUNT = sizeof PINS / sizeof *PINS;
const unsigned INTERRUPT_COUNT = sizeof INTERRUPTS;

unsigned port_of(uint8_t pin) { return (unsigned)(PINS[pin].port - 'A'); }
uint8_t mask_of(uint8_t pin) { return (uint8_t)(1U << PINS[pin].bit); }

struct Handler {
    void (*call)(void);
    int mode;
    unsigned was;
} handlers[INTERRUPT_COUNT];

unsigned line(unsigned number)
{
    uint8_t pin = INTERRUPTS[number];

    return vbus_shim::port_lines(port_of(pin)) & mask_of(pin) ? 1 : 0;
}

bool serve()
{
    bool enabled = false;

    for (unsigned number = 0; number < INTERRUPT_COUNT; number++) {
        Handler &handler = handlers[number];
        unsigned now, was = handler.was;

        if (handler.call == 0)
            continue;
        enabled = true;
        if (!(SREG >> SREG_I & 1))
            continue; /* the edge is kept until interrupts are on again */
        handler.was = now = line(number);
        if (handler.mode == LOW ? !now
                                : now != was && (handler.mode == CHANGE || now == (handler.mode == RISING)))
            handler.call();
    }
    return enabled;
}

uint64_t microseconds() { return vbus_shim::look_at_clock() / 1000000; }

} // namespace

/* --- pins ----------------------------------------------------------------------------------------- */

void pinMode(uint8_t pin, uint8_t mode)
{
    if (pin >= PIN_COUNT)
        return;
    unsigned port = port_of(pin);
    uint8_t mask = mask_of(pin), drive = vbus_shim::port_drive(port), level = vbus_shim::port_level(port);

    if (mode == OUTPUT) {
        vbus_shim::set_drive(port, drive | mask);
        return;
    }
    vbus_shim::set_drive(port, drive & (uint8_t)~mask);
    vbus_shim::set_level(port, mode == INPUT_PULLUP ? level | mask : level & (uint8_t)~mask);
}

void digitalWrite(uint8_t pin, uint8_t level)
{
    if (pin >= PIN_COUNT)
        return;
    unsigned port = port_of(pin);
    uint8_t mask = mask_of(pin), now = vbus_shim::port_level(port);

    vbus_shim::set_level(port, level ? now | mask : now & (uint8_t)~mask);
}

int digitalRead(uint8_t pin)
{
    return pin < PIN_COUNT && vbus_shim::port_input(port_of(pin)) & mask_of(pin) ? HIGH : LOW;
}

void shiftOut(uint8_t data, uint8_t clock, uint8_t order, uint8_t value)
{
    for (uint8_t turn = 0; turn < 8; turn++) {
        digitalWrite(data, value >> (order == LSBFIRST ? turn : 7 - turn) & 1);
        digitalWrite(clock, HIGH);
        digitalWrite(clock, LOW);
    }
}

uint8_t shiftIn(uint8_t data, uint8_t clock, uint8_t order)
{
    uint8_t value = 0;

    for (uint8_t turn = 0; turn < 8; turn++) {
        digitalWrite(clock, HIGH);
        value |= (uint8_t)(digitalRead(data) << (order == LSBFIRST ? turn : 7 - turn));
        digitalWrite(clock, LOW);
    }
    return value;
}

uint8_t digitalPinToPort(uint8_t pin)
{
    return (uint8_t)(pin < PIN_COUNT ? port_of(pin) + 1 : 0);
}

uint8_t digitalPinToBitMask(uint8_t pin)
{
    return pin < PIN_COUNT ? mask_of(pin) : 0;
}

#define PORT_CASES(kind)                                                                           \
    switch (port - 1) {                                                                            \
    case 1: return &kind##B;                                                                       \
    case 2: return &kind##C;                                                                       \
    case 3: return &kind##D;                                                                       \
        MORE_CASES(kind)                                                                           \
    default: return 0;                                                                             \
    }
#ifdef __AVR_ATmega2560__
#define MORE_CASES(kind)                                                                           \
    case 0: return &kind##A;                                                                       \
    case 4: return &kind##E;                                                                       \
    case 5: return &kind##F;                                                                       \
    case 6: return &kind##G;                                                                       \
    case 7: return &kind##H;                                                                       \
    case 9: return &kind##J;                                                                       \
    case 10: return &kind##K;                                                                      \
    case 11: return &kind##L;
#else
#define MORE_CASES(kind)
#endif

vbus_shim::Register *portOutputRegister(uint8_t port) { PORT_CASES(PORT) }
vbus_shim::Register *portModeRegister(uint8_t port) { PORT_CASES(DDR) }
vbus_shim::Register *portInputRegister(uint8_t port) { PORT_CASES(PIN) }

/* --- time and interrupts -------------------------------------------------------------------------- */

unsigned long millis(void) { return (uint32_t)(microseconds() / 1000); }
unsigned long micros(void) { return (uint32_t)microseconds(); }
void delay(unsigned long milliseconds) { vbus_shim::pass(milliseconds * UINT64_C(1000000000)); }
void delayMicroseconds(unsigned int us) { vbus_shim::pass(us * UINT64_C(1000000)); }
void yield(void) {}

int digitalPinToInterrupt(int pin)
{
    for (unsigned number = 0; number < INTERRUPT_COUNT; number++)
        if (INTERRUPTS[number] == pin)
            return (int)number;
    return NOT_AN_INTERRUPT;
}

void attachInterrupt(uint8_t number, void (*handler)(void), int mode)
{
    if (number >= INTERRUPT_COUNT)
        return;
    handlers[number].call = handler;
    handlers[number].mode = mode;
    handlers[number].was = line(number);
    vbus_shim::set_interrupts(serve);
}

void detachInterrupt(uint8_t number)
{
    if (number < INTERRUPT_COUNT)
        handlers[number].call = 0;
}

/* --- numbers -------------------------------------------------------------------------------------- */

long map(long value, long from_low, long from_high, long to_low, long to_high)
{
    return (value - from_low) * (to_high - to_low) / (from_high - from_low) + to_low;
}

static uint32_t random_state = 1;

void randomSeed(unsigned long seed)
{
    random_state = seed ? (uint32_t)seed : 1;
}

long random(long limit)
{
    random_state = random_state * UINT32_C(1664525) + UINT32_C(1013904223);
    return limit > 0 ? (long)((random_state >> 1) % (uint32_t)limit) : 0;
}

long random(long low, long high)
{
    return low >= high ? low : low + random(high - low);
}

/* --- text ----------------------------------------------------------------------------------------- */

size_t Print::write(const uint8_t *data, size_t size)
{
    size_t turn;

    for (turn = 0; turn < size; turn++)
        write(data[turn]);
    return size;
}

size_t Print::write(const char *text)
{
    return write((const uint8_t *)text, strlen(text));
}

static std::string digits_of(unsigned long value, int base)
{
    std::string text;

    do {
        text.insert(text.begin(), "0123456789ABCDEF"[value % (unsigned long)base]);
        value /= (unsigned long)base;
    } while (value);
    return text;
}

static std::string text_of(double value, int digits)
{
    char text[64];

    snprintf(text, sizeof text, "%.*f", digits, value);
    return text;
}

size_t Print::number(unsigned long value, int base)
{
    std::string text = digits_of((uint32_t)value, base < 2 ? DEC : base);

    return write(text.data(), text.size());
}

size_t Print::print(long value, int base)
{
    if (base == DEC && value < 0)
        return write((uint8_t)'-') + number(0 - (unsigned long)value, base);
    return number((unsigned long)value, base);
}

size_t Print::print(double value, int digits)
{
    return write(text_of(value, digits).c_str());
}

String::String(long value, int base)
    : std::string(base == DEC && value < 0 ? "-" + digits_of(0 - (unsigned long)value, base)
                                           : digits_of((uint32_t)value, base))
{
}

String::String(double value, int digits) : std::string(text_of(value, digits)) {}

long String::toInt() const { return strtol(c_str(), 0, 10); }

size_t HardwareSerial::write(uint8_t value)
{
    vbus_shim::console_write(value);
    return 1;
}

int HardwareSerial::peek()
{
    if (kept_ < 0)
        kept_ = vbus_shim::console_read();
    return kept_;
}

int HardwareSerial::available() { return peek() >= 0; }

int HardwareSerial::read()
{
    int value = peek();

    kept_ = -1;
    return value;
}

int main(void)
{
    sei();
    setup();
    for (;;) {
        loop();
        vbus_shim::pass(1000000); /* a loop that does nothing takes time, too */
    }
}
