/* See vbus_stm32.h. */
#define VBUS_STM32F4
#include "vbus_stm32.h"
