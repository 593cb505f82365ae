/* i2c.h - an I2C master on two lines, each of which it pulls low or lets go. Arbitration, and slaves
 * that stretch the clock, are not there. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_I2C_H
#define VBUS_SHIM_I2C_H

#include "ports.h"

namespace vbus_shim {

class I2cMaster {
public:
    void set_clock(uint32_t hertz) { half_ = UINT64_C(500000000000) / hertz; }

    void start()
    {
        data(true);
        pass(half_);
        clock(true);
        pass(half_);
        data(false);
        pass(half_);
        clock(false);
    }
    void stop()
    {
        data(false);
        pass(half_);
        clock(true);
        pass(half_);
        data(true);
        pass(half_);
    }
    bool send(uint8_t value) /* whether a slave has acknowledged it */
    {
        for (int place = 7; place >= 0; place--)
            clocked(value >> place & 1);
        return !clocked(true);
    }
    uint8_t receive(bool more) /* more: acknowledge it, for a further byte */
    {
        uint8_t value = 0;

        for (int place = 0; place < 8; place++)
            value = (uint8_t)(value << 1 | clocked(true));
        clocked(!more);
        return value;
    }

protected:
    virtual void clock(bool level) = 0; /* true: let go, which a pull-up makes high */
    virtual void data(bool level) = 0;
    virtual bool sensed() = 0; /* the level of the data line */

private:
    bool clocked(bool level)
    {
        bool seen;

        data(level);
        pass(half_);
        clock(true);
        pass(half_);
        seen = sensed();
        clock(false);
        return seen;
    }

    uint64_t half_ = 5000000; /* of a clock period, in picoseconds: 100 kHz, the standard mode */
};

} // namespace vbus_shim

#endif
