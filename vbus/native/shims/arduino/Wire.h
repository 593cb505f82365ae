/* Wire.h - Arduino's I2C master on two port bits: SDA and SCL are A4 and A5 of an Uno, 20 and 21 of a
 * Mega. A slave's clock stretching and slave mode are not there. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_WIRE_H
#define VBUS_SHIM_WIRE_H

#include <Arduino.h>

#define BUFFER_LENGTH 32

class TwoWire : public Stream {
public:
    void begin();
    void end() {}
    void setClock(uint32_t hertz);
    void beginTransmission(uint8_t address);
    void beginTransmission(int address) { beginTransmission((uint8_t)address); }
    uint8_t endTransmission(bool stop = true); /* 0; 1 too long, 2 no such slave, 3 byte refused */
    uint8_t requestFrom(uint8_t address, uint8_t count, bool stop = true);
    uint8_t requestFrom(int address, int count, int stop = 1)
    {
        return requestFrom((uint8_t)address, (uint8_t)count, stop != 0);
    }
    size_t write(uint8_t value) override;
    size_t write(int value) { return write((uint8_t)value); }
    using Print::write;
    int available() override { return count_ - next_; }
    int read() override { return next_ < count_ ? bytes_[next_++] : -1; }
    int peek() override { return next_ < count_ ? bytes_[next_] : -1; }
    void flush() {}

private:
    uint8_t bytes_[BUFFER_LENGTH];
    int count_ = 0, next_ = 0;
    uint8_t address_ = 0;
    bool too_long_ = false;
};

extern TwoWire Wire;

#endif
