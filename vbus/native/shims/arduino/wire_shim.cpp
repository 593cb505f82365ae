/* wire_shim.cpp - see Wire.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#include "Wire.h"

TwoWire Wire;

namespace {

#ifdef __AVR_ATmega328P__
const unsigned PORT = 2, SCL = 5, SDA = 4;
#else
const unsigned PORT = 3, SCL = 0, SDA = 1;
#endif

} // namespace

void TwoWire::begin()
{
    line(SDA, true);
    line(SCL, true);
}

/* Let go, which a pull-up makes high, or pull low. */
void TwoWire::line(unsigned number, bool level)
{
    unsigned mask = 1U << number;
    uint8_t drive = vbus_shim::port_drive(PORT), up = vbus_shim::port_level(PORT);

    if (level == !(drive & mask))
        return;
    if (level) {
        vbus_shim::set_drive(PORT, (uint8_t)(drive & ~mask));
    } else {
        vbus_shim::set_level(PORT, (uint8_t)(up & ~mask));
        vbus_shim::set_drive(PORT, (uint8_t)(drive | mask));
    }
}

bool TwoWire::clocked(bool level)
{
    bool seen;

    line(SDA, level);
    vbus_shim::pass(half_);
    line(SCL, true);
    vbus_shim::pass(half_);
    seen = vbus_shim::port_input(PORT) >> SDA & 1;
    line(SCL, false);
    return seen;
}

bool TwoWire::send(uint8_t value)
{
    for (int place = 7; place >= 0; place--)
        clocked(value >> place & 1);
    return !clocked(true);
}

void TwoWire::start()
{
    line(SDA, true);
    vbus_shim::pass(half_);
    line(SCL, true);
    vbus_shim::pass(half_);
    line(SDA, false);
    vbus_shim::pass(half_);
    line(SCL, false);
}

void TwoWire::stop()
{
    line(SDA, false);
    vbus_shim::pass(half_);
    line(SCL, true);
    vbus_shim::pass(half_);
    line(SDA, true);
    vbus_shim::pass(half_);
}

void TwoWire::beginTransmission(uint8_t address)
{
    address_ = address;
    count_ = next_ = 0;
    too_long_ = false;
}

size_t TwoWire::write(uint8_t value)
{
    if (count_ == BUFFER_LENGTH) {
        too_long_ = true;
        return 0;
    }
    bytes_[count_++] = value;
    return 1;
}

uint8_t TwoWire::endTransmission(bool ends)
{
    uint8_t result = too_long_ ? 1 : 0;

    if (!result) {
        start();
        if (!send((uint8_t)(address_ << 1)))
            result = 2;
        for (int place = 0; place < count_ && !result; place++)
            result = send(bytes_[place]) ? 0 : 3;
        if (ends || result)
            stop();
    }
    count_ = next_ = 0;
    return result;
}

uint8_t TwoWire::requestFrom(uint8_t address, uint8_t count, bool ends)
{
    count_ = next_ = 0;
    start();
    if (send((uint8_t)(address << 1 | 1)))
        while (count_ < count && count_ < BUFFER_LENGTH) {
            uint8_t value = 0;

            for (int place = 0; place < 8; place++)
                value = (uint8_t)(value << 1 | clocked(true));
            bytes_[count_++] = value;
            clocked(count_ == count || count_ == BUFFER_LENGTH);
        }
    else
        ends = true;
    if (ends)
        stop();
    return (uint8_t)count_;
}
