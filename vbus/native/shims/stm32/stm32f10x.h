/* See vbus_stm32.h. */
#define VBUS_STM32F1
#include "vbus_stm32.h"
