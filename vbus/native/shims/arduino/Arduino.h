/* Arduino.h - the Arduino API on ports that are objects; see ports.h.
 *
 * Pins are numbered as on an Uno, or as on a Mega if __AVR_ATmega2560__ is defined. A sketch's setup
 * and loop run for ever, until $VBUS_UNTIL, $VBUS_LIMIT_MS or exit(). Analog pins are digital;
 * analogRead, analogWrite, tone, SPI and EEPROM are not there; Wire.h is. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_ARDUINO_H
#define VBUS_SHIM_ARDUINO_H

#ifndef F_CPU
#define F_CPU 16000000UL
#endif
#ifndef ARDUINO
#define ARDUINO 10819
#endif
#define ARDUINO_ARCH_AVR 1

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <util/delay.h>

#include "Print.h"
#include "binary.h"

#define HIGH 0x1
#define LOW 0x0
#define INPUT 0x0
#define OUTPUT 0x1
#define INPUT_PULLUP 0x2
#define LSBFIRST 0
#define MSBFIRST 1
#define CHANGE 1
#define FALLING 2
#define RISING 3
#define NOT_AN_INTERRUPT -1
#define PI 3.1415926535897932384626433832795

typedef uint8_t byte;
typedef bool boolean;
typedef uint16_t word;

#ifdef __AVR_ATmega2560__
enum { A0 = 54, A1, A2, A3, A4, A5, A6, A7, A8, A9, A10, A11, A12, A13, A14, A15 };
#define LED_BUILTIN 13
#define NUM_DIGITAL_PINS 70
#else
enum { A0 = 14, A1, A2, A3, A4, A5 };
#define LED_BUILTIN 13
#define NUM_DIGITAL_PINS 20
#endif

void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);
int digitalRead(uint8_t pin);
void shiftOut(uint8_t data, uint8_t clock, uint8_t order, uint8_t value);
uint8_t shiftIn(uint8_t data, uint8_t clock, uint8_t order);

unsigned long millis(void);
unsigned long micros(void);
void delay(unsigned long milliseconds);
void delayMicroseconds(unsigned int microseconds);
void yield(void);

int digitalPinToInterrupt(int pin);
void attachInterrupt(uint8_t number, void (*handler)(void), int mode);
void detachInterrupt(uint8_t number);
#define interrupts() sei()
#define noInterrupts() cli()

/* Ports by pin, for drivers that look them up. The registers are objects, not bytes: keep them in
 * `vbus_shim::Register *`, or in auto. */
uint8_t digitalPinToPort(uint8_t pin);
uint8_t digitalPinToBitMask(uint8_t pin);
vbus_shim::Register *portOutputRegister(uint8_t port);
vbus_shim::Register *portModeRegister(uint8_t port);
vbus_shim::Register *portInputRegister(uint8_t port);

long map(long value, long from_low, long from_high, long to_low, long to_high);
long random(long limit);
long random(long low, long high);
void randomSeed(unsigned long seed);

#define bit(number) (1UL << (number))
#define bitRead(value, number) (((value) >> (number)) & 0x01)
#define bitSet(value, number) ((value) |= (1UL << (number)))
#define bitClear(value, number) ((value) &= ~(1UL << (number)))
#define bitWrite(value, number, to) ((to) ? bitSet(value, number) : bitClear(value, number))
#define lowByte(value) ((uint8_t)((value) & 0xff))
#define highByte(value) ((uint8_t)((value) >> 8))
#define constrain(value, low, high) ((value) < (low) ? (low) : ((value) > (high) ? (high) : (value)))
#define sq(value) ((value) * (value))
#define radians(degrees) ((degrees) * 0.017453292519943295)
#define degrees(radians) ((radians) * 57.29577951308232)
#define clockCyclesPerMicrosecond() (F_CPU / 1000000L)
#ifndef sbi
#define sbi(port, number) ((port) |= _BV(number))
#define cbi(port, number) ((port) &= ~_BV(number))
#endif

template <class A, class B> auto min(const A &a, const B &b) -> decltype(a < b ? a : b)
{
    return b < a ? b : a;
}
template <class A, class B> auto max(const A &a, const B &b) -> decltype(a < b ? b : a)
{
    return b < a ? a : b;
}

class HardwareSerial : public Stream {
public:
    void begin(unsigned long baud, uint8_t config = 0) { (void)baud; (void)config; }
    void end() {}
    int available() override;
    int read() override;
    int peek() override;
    size_t write(uint8_t value) override;
    using Print::write;
    int availableForWrite() { return 63; }
    void flush() {}
    operator bool() const { return true; }

private:
    int kept_ = -1;
};

extern HardwareSerial Serial;

void setup(void);
void loop(void);

#endif
