/* wire_shim.cpp - see Wire.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#include "Wire.h"
#include "../i2c.h"

TwoWire Wire;

namespace {

#ifdef __AVR_ATmega328P__
const unsigned PORT = 2, SCL = 5, SDA = 4;
#else
const unsigned PORT = 3, SCL = 0, SDA = 1;
#endif

class Lines : public vbus_shim::I2cMaster {
public:
    void clock(bool level) override { line(SCL, level); }
    void data(bool level) override { line(SDA, level); }
    bool sensed() override { return vbus_shim::port_input(PORT) >> SDA & 1; }

private:
    void line(unsigned number, bool level)
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
} lines;

} // namespace

void TwoWire::begin()
{
    lines.data(true);
    lines.clock(true);
}

void TwoWire::setClock(uint32_t hertz) { lines.set_clock(hertz); }

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
        lines.start();
        if (!lines.send((uint8_t)(address_ << 1)))
            result = 2;
        for (int place = 0; place < count_ && !result; place++)
            result = lines.send(bytes_[place]) ? 0 : 3;
        if (ends || result)
            lines.stop();
    }
    count_ = next_ = 0;
    return result;
}

uint8_t TwoWire::requestFrom(uint8_t address, uint8_t count, bool ends)
{
    count_ = next_ = 0;
    lines.start();
    if (lines.send((uint8_t)(address << 1 | 1)))
        for (bool more = true; count_ < count && more;) {
            more = count_ + 1 < count && count_ + 1 < BUFFER_LENGTH;
            bytes_[count_++] = lines.receive(more);
        }
    else
        ends = true;
    if (ends)
        lines.stop();
    return (uint8_t)count_;
}
