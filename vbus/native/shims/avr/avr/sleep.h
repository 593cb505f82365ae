/* avr/sleep.h - sleeping until a line of a chip moves. License: Apache-2.0. */
#ifndef VBUS_SHIM_AVR_SLEEP_H
#define VBUS_SHIM_AVR_SLEEP_H

#include <avr/io.h>

#define SLEEP_MODE_IDLE 0
#define SLEEP_MODE_ADC 2
#define SLEEP_MODE_PWR_DOWN 4
#define SLEEP_MODE_PWR_SAVE 6
#define SLEEP_MODE_STANDBY 12
#define set_sleep_mode(mode) ((void)(mode))
#define sleep_enable() ((void)0)
#define sleep_disable() ((void)0)
#define sleep_cpu() vbus_shim::sleep()
#define sleep_mode() vbus_shim::sleep()

#endif
