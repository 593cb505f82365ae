/* misc.h has NVIC_Init and SysTick_CLKSourceConfig: vbus_stm32.h has them. */
