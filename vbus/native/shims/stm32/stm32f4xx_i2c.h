/* See vbus_stm32.h. */
#include "stm32f4xx.h"
