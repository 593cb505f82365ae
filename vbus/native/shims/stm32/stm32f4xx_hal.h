/* See vbus_stm32.h. */
#define VBUS_STM32F4
#ifndef USE_HAL_DRIVER
#define USE_HAL_DRIVER
#endif
#include "vbus_stm32.h"
